"""Recordings as .npz files: their arrays, compressed, with every bit."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.soft_body.track import tracks_in
from rigidimpulse.recording.exporters import ExportTarget
from rigidimpulse.recording.recording import Recording
from rigidimpulse.recording.status import Status, restored


def write_npz(run: Recording, target: ExportTarget) -> None:
    """Write the arrays of a run."""
    soft_bodies: dict[str, Any] = {}
    for number, track in enumerate(run.soft_bodies):
        soft_bodies.update(track.arrays(number))
    np.savez_compressed(
        target.path,
        times=run.times,
        names=np.array(run.names),
        position=run.positions,
        orientation=run.orientations,
        velocity=run.velocities,
        angular_velocity=run.angular_velocities,
        center_of_mass=run.centers,
        impacts=run.impacts,
        contacts=run.contacts,
        status=np.array(run.status.stored()),
        **soft_bodies,
    )


def read_npz(path: Path) -> Recording:
    """Read what `write_npz` wrote.

    Raises:
        SceneError: the file is missing or no recording.

    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return Recording(
                times=data["times"],
                names=[str(name) for name in data["names"]],
                positions=data["position"],
                orientations=data["orientation"],
                velocities=data["velocity"],
                angular_velocities=data["angular_velocity"],
                centers=data["center_of_mass"],
                impacts=data["impacts"],
                contacts=data["contacts"],
                status=restored(str(data["status"])) if "status" in data else Status(True, "loaded"),
                soft_bodies=tracks_in(data),
            )
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise SceneError(f"{os.fspath(path)} is no recording: {error}", "give an .npz file written by Recording.export") from None
