"""Other engines on the same scene: one adapter a file, with `pip install 'rigidimpulse[peers]'`.

They answer what a user would get elsewhere for the same time. Each is set up as somebody who knows it would: double precision where it
has it, thresholds of restitution off, solvers given the iterations they need. What an adapter cannot say to its engine is refused, never
left out.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name

if TYPE_CHECKING:
    from collections.abc import Callable

    from rigidimpulse.recording.recording import Recording
    from rigidimpulse.scene.scene import Scene
    from rigidimpulse.studies.peers.common import Peer

PEERS = ("mujoco", "pybullet")


def load_peer(name: str, scene: Scene, step: float) -> Peer:
    """Put a scene into another engine.

    Args:
        name: one of PEERS.
        scene: the scene.
        step: s, > 0.

    Raises:
        SceneError: an unknown name, an engine that is not installed, or a part of the scene that its adapter does not know.

    """
    if name not in PEERS:
        raise unknown_name("peer", name, PEERS)
    try:
        module = importlib.import_module(f"rigidimpulse.studies.peers.{name}_peer")
    except ImportError as error:
        raise SceneError(f"{name} is not installed ({error})", "pip install 'rigidimpulse[peers]'") from None
    return module.make(scene, step)


def run_peer(
    name: str, scene: Scene, duration: float, fps: float, steps_a_frame: int, progress: Callable[[float], None] | None = None
) -> tuple[Recording, float]:
    """Run a scene in another engine; return its frames, and the time that its steps took, s.

    Args:
        name: one of PEERS.
        scene: the scene.
        duration: s. fps: frames per second.
        steps_a_frame: the step is 1 / (fps steps_a_frame).
        progress: called with the simulated time in s after every frame.

    Raises:
        SceneError: as `load_peer`.

    """
    from time import process_time

    from rigidimpulse.recording.recording import Recording

    times = np.arange(round(duration * fps) + 1) / fps
    peer = load_peer(name, scene, 1.0 / (fps * steps_a_frame))
    try:
        frames, spent = [peer.state()], 0.0
        for time in times[1:].tolist():
            start = process_time()
            peer.advance(steps_a_frame)
            spent += process_time() - start
            frames.append(peer.state())
            if progress is not None:
                progress(time)
        columns = [np.array(column) for column in zip(*frames, strict=True)]
    finally:
        peer.close()
    return Recording(times, list(scene.names), *columns, impacts=np.zeros(0), scene=scene), spent
