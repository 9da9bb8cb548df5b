"""Recordings from caches, finished or not."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.soft_body.track import tracks_in
from rigidimpulse.io.cache.layout import Content, Header
from rigidimpulse.io.cache.read import REMEDY, read
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.events import Event, impact_table
from rigidimpulse.recording.joined import cut, joined_frames
from rigidimpulse.recording.recording import Recording
from rigidimpulse.recording.status import STOPPED, Status, restored
from rigidimpulse.scene.frames import own_frames


def load_cache(path: Path) -> Recording:
    """Return what a cache holds: all frames of a finished run, those until the last checkpoint of another.

    Raises:
        SceneError: no such file, or no cache.

    """
    header, content = read(path)
    run = recording_of(path, header, content)
    while header.take.base:
        first, before = header.take.first_frame, header.take
        header, content = read(path, take=before.base)
        if header.take.first_frame >= first:
            raise SceneError("its takes are none", REMEDY, f"cache {str(path)!r}")
        earlier = recording_of(path, header, content)
        run = joined_frames(cut(earlier, first - header.take.first_frame), run)
    return run


def recording_of(path: Path, header: Header, content: Content) -> Recording:
    """Return the recording of one take alone."""
    frames = content.frames
    position, orientation = own_frames(frames["position"], frames["orientation"], header.offset, header.turn)
    impacts = impact_table(content.impacts)
    return Recording(
        times=header.times[: len(position)],
        names=header.names,
        positions=position,
        orientations=orientation,
        velocities=frames["velocity"],
        angular_velocities=frames["angular_velocity"],
        centers=frames["position"],
        impacts=impacts[impacts["time"] <= header.duration],
        contacts=content.tables.get("contacts", np.zeros(0, CONTACT_DTYPE)),
        status=_status(path, header, content),
        soft_bodies=tracks_in(content.tables),
    )


def _status(path: Path, header: Header, content: Content) -> Status:
    """That of the finished run; of another, how far it is."""
    if content.complete:
        try:
            return restored(content.tables["status"])
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise SceneError(f"its status cannot be read: {error}", REMEDY, f"cache {str(path)!r}") from None
    so_far = f"the recording is partial: it ends at {content.time:.6g} s of {header.duration:g} s; the run was stopped, or still goes on"
    return Status.of([Event(content.time, STOPPED, (), f"{so_far}; simulate the scene with this cache again to go on from there")])
