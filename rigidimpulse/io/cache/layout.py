"""What lies where in the HDF5 file of a run, and the checks that tell damage from content.

    attributes      format, fingerprint, version, duration [s], fps, complete, seal: `seal_of` what does not change while the run goes on;
                    take, base, first_frame, origin: see `Take`
    names           of the bodies, a list in JSON
    times           (f,) s, of all frames of the run
    body            offset (n, 3) m and turn (n, 4): centre of mass and principal axes in body frames
    frames          position (f, n, 3) m of centres of mass, orientation (f, n, 4) wxyz of principal axes, velocity and
                    angular_velocity (f, n, 3)
    impacts         (m, 15), columns as in `recording.events.IMPACT_DTYPE`
    checks          frames (f,) and impacts (m,): `check_words` of each row
    checkpoint      two slots of bytes, and commits (2,): number, time, frames, impacts, size, length (unpacked), digest and signature of
                    each
    tables          of a finished run: contacts, status (JSON), and vertices and faces of flexible bodies
    origin          bytes of the scene and the settings (`origin.frozen`); its signature is the attribute origin_signature
    kept            earlier checkpoints, from which a changed scene may go on: commits (k,), and states, the bytes of all in a row
    takes           the other takes by their numbers, each laid out like the file itself

The file itself is the take that was written last. Times and frames of a take begin at its first frame.

Texts among the attributes have a fixed length (`attribute_of`). Names are none of them, because attributes hold 64 kB. Seal, checks and
digests find damage. Who forges a cache makes them, too, but has no key for the signatures (`signature`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.recording.events import ROW_LENGTH

FORMAT = "rigidimpulse cache 4"
ATTRIBUTES = (
    "format", "fingerprint", "version", "duration", "fps", "complete", "seal", "take", "base", "first_frame", "origin", "origin_signature",
)  # fmt: skip
SUFFIXES = (".h5", ".hdf5")
FRAMES = {"position": 3, "orientation": 4, "velocity": 3, "angular_velocity": 3}
COMMIT = np.dtype([
    ("number", "<u8"), ("time", "<f8"), ("frames", "<u8"), ("impacts", "<u8"), ("size", "<u8"), ("length", "<u8"), ("digest", "S64"),
    ("signature", "S64"),
])  # fmt: skip
CHECK = np.dtype("<u8")
_ODD = 0x9E3779B97F4A7C15


def attribute_of(group: Any, name: str) -> Any:
    """Return an attribute of a group, a text as str; None where it has none of this name that is a number or a text of fixed length.

    Texts of variable length lie in a place of their own without checks, which HDF5 reads for ever if it is damaged.
    """
    if name not in group.attrs:
        return None
    types, kind = library().h5t, group.attrs.get_id(name).get_type()
    if not isinstance(kind, types.TypeIntegerID | types.TypeFloatID | types.TypeEnumID | types.TypeStringID):
        return None
    if isinstance(kind, types.TypeStringID) and kind.is_variable_str():
        return None
    value = group.attrs[name]
    return value.decode() if isinstance(value, bytes) else value


def set_attributes(group: Any, **values: Any) -> None:
    """Give a group attributes; texts have a fixed length."""
    group.attrs.update({name: np.bytes_(value.encode()) if isinstance(value, str) else value for name, value in values.items()})


def library() -> Any:
    """The module h5py.

    Raises:
        SceneError: it is not installed.

    """
    try:
        import h5py
    except ImportError:
        raise SceneError("a cache needs the library h5py", "pip install rigidimpulse[cache]") from None
    return h5py


class Take(NamedTuple):
    """Which run of a file it is.

    number: from 1 on. base: number of the take before the change of the scene, 0 for one that begins at time 0. first_frame: that of the
    change. origin: digest of the bytes of scene and settings.
    """

    number: int = 1
    base: int = 0
    first_frame: int = 0
    origin: str = hashlib.sha256().hexdigest()


ONLY_TAKE = Take()


@dataclass(frozen=True)
class Header:
    """What a file says of a run: fingerprint, version, duration [s], fps, names (n,), times (f,) s, frames of the bodies, its take."""

    fingerprint: str
    version: str
    duration: float
    fps: float
    names: list[str]
    times: np.ndarray
    offset: np.ndarray
    turn: np.ndarray
    take: Take = ONLY_TAKE


class Kept(NamedTuple):
    """A checkpoint: its commit (a row of COMMIT), and the bytes of the state, packed."""

    commit: np.void | np.ndarray
    data: bytes


class Content(NamedTuple):
    """What a file holds: frames by name (k, n, ...), impacts (m, 15), until when they go [s], the state there, whether that is all.

    tables: what only a finished run has, by name. kept: earlier checkpoints. commit: that of the state, a row of COMMIT.
    """

    frames: dict[str, np.ndarray]
    impacts: np.ndarray
    time: float
    state: bytes | None
    complete: bool
    tables: dict[str, Any]
    kept: Sequence[Kept] = ()
    commit: np.void | np.ndarray | None = None


def empty(n: int) -> Content:
    """Return the content of a run of n bodies before its first checkpoint."""
    return Content({name: np.zeros((0, n, width)) for name, width in FRAMES.items()}, np.zeros((0, ROW_LENGTH)), 0.0, None, False, {})


def check_words(*tables: np.ndarray) -> np.ndarray:
    """Return a number (k,) for each row of tables (k, ...) of doubles, which is another one if a single double of the row is."""
    total = np.zeros(len(tables[0]), CHECK)
    for rows in tables:
        width = prod(rows.shape[1:])
        factors = np.arange(1, 2 * width, 2, dtype=CHECK) * CHECK.type(_ODD)
        total = total * CHECK.type(3) + np.ascontiguousarray(rows).reshape(len(rows), width).view(CHECK) @ factors
    return total


def digest_of(commit: np.void | np.ndarray, data: bytes) -> bytes:
    """Return the digest of a commit and the bytes of its slot."""
    told = [commit[name].tobytes() for name in COMMIT.names or () if name not in ("digest", "signature")]
    return hashlib.sha256(b"".join([*told, data])).hexdigest().encode()


def seal_of(header: Header, complete: bool, tables: Mapping[str, Any]) -> str:
    """Return a hash of what a file says of its run, and of what only a finished run has."""
    told = [header.fingerprint, header.version, header.duration, header.fps, header.names, header.take, complete, sorted(tables)]
    digest = hashlib.sha256(json.dumps(told).encode())
    for table in (header.times, header.offset, header.turn, *(tables[name] for name in sorted(tables))):
        digest.update(np.ascontiguousarray(table).tobytes())
    return digest.hexdigest()
