"""A run that is prepared again takes the state of a checkpoint in place of its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.absent import NoCompiledLoop
from rigidimpulse.engine.begin import bind_compiled_loop
from rigidimpulse.io.cache.arrays import Damaged
from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.decode import REMEDY, thaw
from rigidimpulse.io.cache.layout import FRAMES, SUFFIXES, Content, Header
from rigidimpulse.io.cache.likeness import check_alike
from rigidimpulse.io.cache.signature import CHECKPOINT, check_signature
from rigidimpulse.recording.cache import Cache

if TYPE_CHECKING:
    from rigidimpulse.engine.run import Run


def path_of(cache: Cache) -> Path:
    """Return the path of a cache.

    Raises:
        SceneError: it has another suffix.

    """
    path = Path(cache.path)
    if path.suffix not in SUFFIXES:
        raise SceneError("it has another suffix", f"use a name that ends in {' or '.join(SUFFIXES)}", f"cache {path.name!r}")
    return path


def check_writer(header: Header, stored: Content, where: str) -> None:
    """Check that this user has written the state of a content; where: how a message names the file.

    Raises:
        SceneError: somebody else has, or nobody knows.

    """
    assert stored.commit is not None
    check_signature(bytes(stored.commit["signature"]), CHECKPOINT, header.fingerprint, bytes(stored.commit["digest"]), where)


def recalled(run: Run, stored: Content, where: str) -> Run:
    """Return a run, given at its start, as a checkpoint left it.

    Raises:
        SceneError: the checkpoint is none of this run; where: how it names the file.

    """
    recorder, log = run.recorder, run.log
    for name, frames in stored.frames.items():
        getattr(recorder, name)[: len(frames)] = frames
    log.buffers = log.buffers._replace(impacts=np.concatenate([stored.impacts, log.buffers.impacts]))
    try:
        return thawed_run(run, stored.state or b"")
    except SceneError as error:
        raise error.within(where) from None
    except Damaged as error:
        raise SceneError(f"the checkpoint is none of this run: {error}", REMEDY, where) from None


def thawed_run(run: Run, state: bytes) -> Run:
    """Return the run of a state; what the state does not hold is that of a run of the same scene.

    Raises:
        Damaged, SceneError: it is no state of such a run.

    """
    constants = constants_of(run)
    known = thaw(state, constants)
    check_alike(known, run, constants)
    known.compiled = NoCompiledLoop()  # that of the other process is gone with its memory
    bind_compiled_loop(known)
    return known


def constants_of(run: Run) -> Constants:
    """Return the parts of a run that its checkpoints do not hold."""
    world, recorder = run.world, run.recorder
    own = [run.plan, recorder.times, *(getattr(recorder, name) for name in FRAMES), run.log.buffers.impacts]
    made_again = [run.compiled, run.narrow_phase, run.triggers.narrowphase]
    roots = [world.scene, world.scene.bodies, world.scene.effects, world.shapes, world.geometry, world.accuracy, *own, *made_again]
    return Constants(roots)
