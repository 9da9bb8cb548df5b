"""Recordings as .npz files: their arrays, compressed, with every bit."""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import LEAST_UNPACKED, LONGEST_REASON, MOST_UNPACKED
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack, tracks_in
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.recording.exporters import ExportTarget
from rigidimpulse.recording.recording import Recording
from rigidimpulse.recording.status import Status, restored

FRAMES = ("position", "orientation", "velocity", "angular_velocity", "center_of_mass")
"""Arrays with a row a frame and body."""


def write_npz(run: Recording, target: ExportTarget) -> None:
    """Write the arrays of a run."""
    soft_bodies: dict[str, Any] = {}
    for number, track in enumerate(run.soft_bodies):
        soft_bodies.update(track.arrays(number))
    np.savez_compressed(
        target.path,
        times=run.times,
        names=np.array(run.names, np.str_),
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
    """Read what `write_npz` wrote. The file may come from anywhere: sizes are checked before memory is asked for, then types and shapes.

    Raises:
        SceneError: the file is missing, damaged or no recording.

    """
    where = f"recording {os.fspath(path)!r}"
    if not path.is_file():
        raise SceneError(f"there is no such file (looked for {path.absolute()})", "check the path", where)
    try:
        with zipfile.ZipFile(path) as archive:
            return _recording(_Arrays(archive, path.stat().st_size))
    except Exception as error:  # zipfile, zlib and NumPy raise anything on damaged files
        reason = (str(error) or type(error).__name__).splitlines()[0][:LONGEST_REASON]
        raise SceneError(f"it is no recording: {reason}", "give an .npz file written by Recording.export", where) from None


class _Arrays:
    """The arrays of an .npz file of `size` bytes; each is looked at before it is read."""

    def __init__(self, archive: zipfile.ZipFile, size: int) -> None:
        self._archive, self._size = archive, size
        self._names = set(archive.namelist())

    def __contains__(self, name: str) -> bool:
        """Whether the file has an array of this name."""
        return f"{name}.npy" in self._names

    def __getitem__(self, name: str) -> np.ndarray:
        """Return an array.

        Raises:
            ValueError: there is none, or its bytes are not there. What zipfile, zlib and NumPy raise besides.

        """
        if name not in self:
            raise ValueError(f"there is no array {name!r} in it")
        member = self._archive.getinfo(f"{name}.npy")
        packed = min(member.compress_size, self._size)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name} is packed in a way that is not read")
        if member.file_size > MOST_UNPACKED * packed + LEAST_UNPACKED:
            raise ValueError(f"{name} claims {member.file_size} bytes in {packed}")
        with self._archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            if version not in _HEADERS:
                raise ValueError(f"{name} is of an unknown version")
            shape, _, dtype = _HEADERS[version](file)
            claimed, there = math.prod(shape) * dtype.itemsize, member.file_size - file.tell()
            if dtype.hasobject or claimed != there:
                raise ValueError(f"{name} claims {claimed} bytes of {dtype}, in the file are {there}")
        with self._archive.open(member) as file:
            array = np.lib.format.read_array(file)  # objects are refused above, and by default
            if file.read(1):  # the end of the bytes has their check sum
                raise ValueError(f"{name} is longer than it says")
        return array

    def table(self, name: str, dtype: np.dtype | type, shape: tuple[int | None, ...]) -> np.ndarray:
        """Return an array of this type and shape; None: any length.

        Raises:
            ValueError: it is of another type or shape.

        """
        array = self[name]
        if array.dtype != dtype or array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
            raise ValueError(f"{name} is of type {array.dtype} and shape {array.shape}")
        return array

    def text(self, name: str, ndim: int) -> np.ndarray:
        """Return an array of texts with `ndim` dimensions.

        Raises:
            ValueError: it holds something else.

        """
        array = self[name]
        if array.dtype.kind != "U" or array.ndim != ndim:
            raise ValueError(f"{name} is no text")
        return array


_HEADERS: dict[tuple[int, int], Callable] = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def _recording(arrays: _Arrays) -> Recording:
    """The recording that the arrays hold.

    Raises:
        ValueError: an array is missing, or is of another type or shape; or an index is none of a body.

    """
    names = [str(name) for name in arrays.text("names", 1)]
    times, n = arrays.table("times", np.float64, (None,)), len(names)
    if not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise ValueError("its times are none that follow each other")
    frames = {name: arrays.table(name, np.float64, (len(times), n, 4 if name == "orientation" else 3)) for name in FRAMES}
    impacts, contacts = arrays.table("impacts", IMPACT_DTYPE, (None,)), arrays.table("contacts", CONTACT_DTYPE, (None,))
    for table, what in ((impacts, "impacts"), (contacts, "contacts")):
        for body in ("body_a", "body_b"):
            if not np.all((table[body] >= 0) & (table[body] < n)):
                raise ValueError(f"its {what} are of bodies that it does not have")
    return Recording(
        times=times, names=names, positions=frames["position"], orientations=frames["orientation"], velocities=frames["velocity"],
        angular_velocities=frames["angular_velocity"], centers=frames["center_of_mass"], impacts=impacts, contacts=contacts,
        status=restored(str(arrays.text("status", 0))) if "status" in arrays else Status(True, "loaded"),
        soft_bodies=[_checked(track, len(times)) for track in tracks_in(arrays)],
    )  # fmt: skip


def _checked(track: FlexibleTrack, frames: int) -> FlexibleTrack:
    """The same flexible body, if its arrays fit each other."""
    vertices, faces = track.vertices, track.faces
    if vertices.dtype != np.float64 or vertices.ndim != 3 or vertices.shape[::2] != (frames, 3):
        raise ValueError(f"the vertices of {track.name!r} are of type {vertices.dtype} and shape {vertices.shape}")
    if faces.dtype.kind not in "iu" or faces.ndim != 2 or faces.shape[1] != 3 or not np.all((faces >= 0) & (faces < vertices.shape[1])):
        raise ValueError(f"the faces of {track.name!r} are none of its vertices")
    return track
