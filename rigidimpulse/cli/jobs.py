"""Shared by the commands: runs with a progress bar, and tables. Expensive modules are imported where they are used."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import click

from rigidimpulse.recording.cache import Cache
from rigidimpulse.recording.exporters import ExportOptions, check_export, export_suffixes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rigidimpulse.gallery.record import Check
    from rigidimpulse.recording.recording import Recording
    from rigidimpulse.scene.accuracy import Accuracy, Preset
    from rigidimpulse.scene.accuracy_targets import AccuracyTarget
    from rigidimpulse.scene.scene import Scene
    from rigidimpulse.studies.compare import Comparison
    from rigidimpulse.studies.job import Job

PATIENCE = 0.5
"""s of work before a progress bar appears."""
CHECK_FAILED, BAD_SCENE, STOPPED_BY_USER = 1, 2, 130
"""Exit codes, besides 0 for success; the last is what shells give for Ctrl-C."""


def given_options(settings: dict[str, Any]) -> dict[str, Any]:
    """Return the options that were given; an accuracy target takes the place of the accuracy.

    Raises:
        SceneError: more than one accuracy was given.

    """
    from rigidimpulse.core.errors import SceneError

    given = {name: value for name, value in settings.items() if value is not None}
    if len({"accuracy", "within", "per_frame"} & set(given)) > 1:
        raise SceneError("more than one of --accuracy, --within and --per-frame", "give one of them")
    if "within" in given:
        from rigidimpulse.scene.accuracy_targets import Within

        given["accuracy"] = Within(position=given.pop("within"))
    if "per_frame" in given:
        from rigidimpulse.scene.accuracy_targets import InTime

        given["accuracy"] = InTime(given.pop("per_frame"))
    return given


class Storage(NamedTuple):
    """Where a run is kept while it goes on, and the frame of the run there from which on the scene is another one; None: neither."""

    cache: Cache | None = None
    from_frame: int | None = None


NOT_KEPT = Storage()


def storage_of(settings: dict[str, Any]) -> Storage:
    """Take the options of storage out of the settings of a command."""
    path, trust = settings.pop("cache"), settings.pop("trust_cache")
    return Storage(None if path is None else Cache(path, trust=trust), settings.pop("from_frame"))


class Outputs(NamedTuple):
    """Files that a run is written to.

    Attributes:
        names: of the files. options: of animated files. pre_roll: frames at the beginning that are not written.

    """

    names: Sequence[str] = ()
    options: ExportOptions = ExportOptions()
    pre_roll: int = 0

    def options_of(self, name: str) -> ExportOptions:
        """Return the options that a file has."""
        return self.options if Path(name).suffix in export_suffixes(with_options=True) else ExportOptions()

    def check(self, job: Job, scene: Scene | None = None) -> None:
        """Look at all that is asked for, as far as it is known before the run; scene: None before it is made.

        Raises:
            SceneError: something of it cannot be written.

        """
        from rigidimpulse.core.errors import SceneError
        from rigidimpulse.core.files import check_target
        from rigidimpulse.io.motion import check_options

        check_options(self.options)
        for name in self.names:
            if Path(name).suffix not in export_suffixes():
                raise SceneError(f"cannot write {name!r}", f"use a name that ends in {', '.join(export_suffixes())}")
            check_target(Path(name))
            check_export(Path(name), self.options_of(name), scene)
        length = job.duration * job.fps
        if self.pre_roll and math.isfinite(length) and self.pre_roll > round(length):
            raise SceneError(f"a pre-roll of {self.pre_roll} frames in a run of {round(length) + 1}", "leave out fewer, or run longer")


NO_FILE = Outputs()


def run_job(job: Job, outputs: Outputs = NO_FILE, profile: bool = False, storage: Storage = NOT_KEPT) -> Recording:
    """Simulate with a progress bar, kept in a cache if one is named, and print the summary; outputs are looked at first."""
    outputs.check(job)
    from time import perf_counter

    from tqdm import tqdm

    from rigidimpulse.engine.simulate import simulate as run_scene

    scene = job.make()
    outputs.check(job, scene)
    cache, from_frame = storage
    begun = cache is not None and from_frame is None and Path(cache.path).exists()
    start = perf_counter()
    # disable=None: no bar where the output is no terminal.
    with tqdm(
        total=job.duration, desc=job.name, unit="s", delay=PATIENCE, disable=None, leave=False,
        bar_format="{desc} {percentage:3.0f} % |{bar}| {n:.2f} of {total:g} s, {remaining} left",
    ) as bar:  # fmt: skip

        def progress(time: float) -> None:
            bar.update(min(time, job.duration) - bar.n)

        accuracy = cast("Preset | Accuracy | AccuracyTarget", job.accuracy)  # another name is refused there
        run = run_scene(scene, job.duration, job.fps, accuracy=accuracy, progress=progress, cache=cache, from_frame=from_frame)
    seconds = perf_counter() - start
    num_impacts = len(run.impacts)
    impacts = f"{num_impacts} {'impact' if num_impacts == 1 else 'impacts'}"
    rest = f"; {cache.path} already had the beginning, or all of it" if cache is not None and begun else ""
    click.echo(f"{run.times[-1] if run.status.is_partial else job.duration:g} s of motion, {impacts}, computed in {seconds:.2f} s{rest}")
    click.echo(f"status: {run.status.message}")
    if profile and run.profile is not None:
        click.echo(run.profile.table())
    return run


def end_if_partial(run: Recording) -> None:
    """End the program with an exit code of its own after a run that Ctrl-C stopped."""
    if run.status.is_partial:
        sys.exit(STOPPED_BY_USER)


def print_table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...]) -> None:
    """Print rows with aligned columns; those of the given indices to the right, the last one ragged."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    for row in rows:
        cells = [cell.rjust(width) if k in right else cell.ljust(width) for k, (cell, width) in enumerate(zip(row, widths))]
        click.echo("  ".join([*cells, row[-1]]))


@dataclass(frozen=True)
class Head:
    """What stands above a page: the scene's sentence, and its checks."""

    title: str
    checks: tuple[Check, ...] = ()


def show(run: Recording | Comparison, head: Head | None = None) -> None:
    """Open a recording in the browser; where there is none, serve it until Ctrl-C. head: of its page."""
    from rigidimpulse.view import server

    viewer = run.show() if head is None else server.show(cast("Recording", run), head.title, head.checks)
    if not viewer.fetched.is_set():
        click.echo("open this address in a browser; Ctrl-C ends")
        viewer.wait()


def recording_with_shapes(path: Path, scene: str | None) -> Recording:
    """Return the recording of an .npz file or a cache, with the scene that has its shapes."""
    from dataclasses import replace

    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.recording.recording import load_recording
    from rigidimpulse.studies.job import find_job

    if scene is None:
        remedy = "name its scene, --scene SCENE, or export the run as .html"
        raise SceneError(f"an {path.suffix} recording has the motion but not the shapes", remedy, f"recording {str(path)!r}")
    run = load_recording(path)
    made = find_job(scene).make()
    if list(made.names) != run.names:
        bodies = f"its bodies are {', '.join(run.names)}, those of the scene {', '.join(made.names)}"
        raise SceneError(bodies, "name the scene it was made of", f"recording {str(path)!r}")
    return replace(run, scene=made)


def size_of(path: Path) -> str:
    """Return the size of a file in words."""
    size = path.stat().st_size
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"
