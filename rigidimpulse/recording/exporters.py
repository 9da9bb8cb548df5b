"""The formats that recordings are written to and read from: a registry from suffixes to functions.

The packages that write and read files register their functions here: see `rigidimpulse.io.registration`, `rigidimpulse.view.registration`.
A function is named as "module:function" and is imported when a file of its format is first written or read.

A new format takes three things: a function, one line in such a `registration`, and a page of the documentation.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.providers import load_function

if TYPE_CHECKING:
    from rigidimpulse.recording.recording import Recording


class ExportOptions(NamedTuple):
    """Options of animated files, see `Recording.export`."""

    start_frame: float = 0.0
    tolerance: float | None = None
    impact_keys: bool = False
    only_moved: bool = True
    samples: int = 1
    up_axis: str | None = None
    unit: float = 1.0


class ExportTarget(NamedTuple):
    """Where a recording is written.

    Attributes:
        path: the file to write. It has a temporary name and is renamed when it is complete.
        title: the final name of the file, without its suffix.
        options: those that the caller gave; the defaults for formats without options.

    """

    path: Path
    title: str
    options: ExportOptions


class Exporter(NamedTuple):
    """A format that recordings are written to.

    Attributes:
        function: "module:function"; it is called with the recording and an `ExportTarget`.
        needs_shapes: what is written, for the message where the recording has no scene and so no shapes; None: it needs no shapes.
        takes_options: whether the format has the options of `ExportOptions`.
        check: "module:function", called with the path, the options and the scene, None before there is one; raises a `SceneError`
            for what cannot be written, before anything is simulated. None: the format takes everything.

    """

    function: str
    needs_shapes: str | None
    takes_options: bool
    check: str | None = None

    def write(self, run: Recording, target: ExportTarget) -> None:
        """Write the recording."""
        load_function(self.function)(run, target)


_EXPORTERS: dict[str, Exporter] = {}
_READERS: dict[str, str] = {}


def register_exporter(
    suffixes: Sequence[str], function: str, *, needs_shapes: str | None = None, takes_options: bool = False, check: str | None = None
) -> None:
    """Register the function that writes files of these suffixes; see `Exporter`."""
    for suffix in suffixes:
        _EXPORTERS[suffix] = Exporter(function, needs_shapes, takes_options, check)


def register_reader(suffixes: Sequence[str], function: str) -> None:
    """Register the function ("module:function", called with the path) that reads recordings from files of these suffixes."""
    for suffix in suffixes:
        _READERS[suffix] = function


def export_suffixes(with_options: bool = False) -> list[str]:
    """Suffixes of the files that recordings can be written to, or only those of formats with options."""
    return [suffix for suffix, exporter in _EXPORTERS.items() if exporter.takes_options or not with_options]


def reader_suffixes() -> list[str]:
    """Suffixes of the files that recordings can be read from."""
    return list(_READERS)


def find_exporter(path: Path) -> Exporter:
    """Return the exporter for the suffix of a path.

    Raises:
        SceneError: no exporter writes such files; lists the suffixes that are written.

    """
    if path.suffix not in _EXPORTERS:
        raise SceneError(f"cannot export to {path.name!r}", f"use a name that ends in {', '.join(_EXPORTERS)}")
    return _EXPORTERS[path.suffix]


def check_export(path: Path, options: ExportOptions, scene: Any = None) -> Exporter:
    """Return the exporter for a path after a look at what is asked for, as far as it is known before there is a run.

    Args:
        path: the file to write. options: of animated files. scene: of the run, None if it is not known.

    Raises:
        SceneError: for another suffix, for an option that makes no sense, that the format does not have, or that does not fit the scene,
            or where the file would take the place of the one that the scene comes from.

    """
    exporter = find_exporter(path)
    if options != ExportOptions() and not exporter.takes_options:
        names = "start_frame, tolerance, impact_keys, only_moved, samples, up_axis or unit"
        raise SceneError(f"{names} for {path.name!r}", f"give them for {', '.join(export_suffixes(with_options=True))} only")
    if exporter.check is not None:
        load_function(exporter.check)(path, options, scene)
    if scene is not None and scene.origin is not None:
        scene.origin.check_target(path)
    return exporter


def find_reader(path: str | os.PathLike[str]) -> Callable[[Path], Recording]:
    """Return the function that reads recordings from files with the suffix of a path.

    Raises:
        SceneError: no reader reads such files; lists the suffixes that are read.

    """
    suffix = Path(path).suffix
    if suffix not in _READERS:
        raise SceneError(f"{os.fspath(path)} is no recording", f"give a file that ends in {' or '.join(_READERS)}")
    return load_function(_READERS[suffix])
