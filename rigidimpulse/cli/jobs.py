"""What commands share: scenes found by name or file, run with a progress bar; tables. Whatever is dear is imported where it is used."""

from __future__ import annotations

from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from rigidimpulse.core.files import ANIMATED_SUFFIXES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rigidimpulse.gallery.record import GalleryScene
    from rigidimpulse.recording.recording import Recording
    from rigidimpulse.scene.accuracy import Accuracy
    from rigidimpulse.scene.scene import Scene
    from rigidimpulse.studies.accuracy_targets import AccuracyTarget
    from rigidimpulse.studies.compare import Comparison

SCENE_SUFFIXES = (*ANIMATED_SUFFIXES, ".urdf", ".xml", ".mjcf")
OUTPUT_SUFFIXES = (".html", ".npz", *ANIMATED_SUFFIXES, ".csv")
RECORDING_SUFFIXES = (".npz", ".h5", ".hdf5")
DEFAULT_DURATION = 4.0
"""s, of scenes from files."""
DEFAULT_FPS = 60.0
PATIENCE = 0.5
"""s of work before a progress bar appears."""
CHECK_FAILED, BAD_SCENE = 1, 2
"""Exit codes, besides 0 for success."""


class Job(NamedTuple):
    """A scene to run: name, how to make it, how long [s], frames per second, accuracy, gallery record."""

    name: str
    make: Callable[..., Scene]
    duration: float
    fps: float
    accuracy: str | Accuracy | AccuracyTarget
    entry: GalleryScene | None


def given_options(settings: dict[str, Any]) -> dict[str, Any]:
    """Return the options that were given; a wish takes the place of the accuracy.

    Raises:
        SceneError: more than one accuracy was given.

    """
    from rigidimpulse.core.errors import SceneError

    given = {name: value for name, value in settings.items() if value is not None}
    if len({"accuracy", "within", "per_frame"} & set(given)) > 1:
        raise SceneError("more than one of --accuracy, --within and --per-frame", "give one of them")
    if "within" in given:
        from rigidimpulse.studies.accuracy_targets import Within

        given["accuracy"] = Within(position=given.pop("within"))
    if "per_frame" in given:
        from rigidimpulse.studies.accuracy_targets import InTime

        given["accuracy"] = InTime(given.pop("per_frame"))
    return given


def job_of(entry: GalleryScene) -> Job:
    return Job(entry.name, entry.scene, entry.duration, entry.fps, entry.accuracy, entry)


def find_job(scene: str) -> Job:
    """Return the job for a gallery name or a file.

    Raises:
        SceneError: it is neither, with the ways to name a scene.

    """
    from rigidimpulse import gallery
    from rigidimpulse.core.errors import SceneError

    path = Path(scene)
    if path.suffix == ".py":
        return Job(path.stem, _scene_function(path), DEFAULT_DURATION, DEFAULT_FPS, "standard", None)
    if path.suffix in SCENE_SUFFIXES:
        return Job(path.stem, partial(_load_scene, path), DEFAULT_DURATION, DEFAULT_FPS, "standard", None)
    if path.suffix or len(path.parts) > 1:
        known = "a gallery scene (`rigidimpulse demo` lists them), a .glb, .gltf, .usd, .urdf or .xml file, a file.py that defines scene()"
        raise SceneError(f"cannot read a scene from {scene!r}", f"supported: {known}")
    return job_of(gallery.load(scene))


def _load_scene(path: Path) -> Scene:
    """Return the scene of a file; what of the file is not in it is printed."""
    from rigidimpulse.io.scene_file import load_scene

    scene = load_scene(path)
    for line in scene.report:
        click.echo(f"{path.name}: {line}", err=True)
    return scene


def _scene_function(path: Path) -> Callable[[], Scene]:
    """Return the function `scene` of a Python file, so wrapped that its errors name the file and the line."""
    import runpy
    import traceback

    from rigidimpulse.core.errors import RigidImpulseError, SceneError
    from rigidimpulse.scene.scene import Scene

    where = f"scene file {str(path)!r}"
    if not path.is_file():
        raise SceneError("there is no such file", "check the path", where)

    def guarded(function: Callable[[], Any]) -> Any:
        try:
            return function()
        except RigidImpulseError:
            raise
        except Exception as error:
            lines = [entry.lineno for entry in traceback.extract_tb(error.__traceback__) if entry.filename == str(path)]
            line = getattr(error, "lineno", None) or (lines[-1] if lines else "?")
            raise SceneError(f"line {line}: {type(error).__name__}: {error}", "correct the file", where) from error

    function = guarded(lambda: runpy.run_path(str(path))).get("scene")
    if not callable(function):
        raise SceneError("it defines no function scene()", "write: def scene(): ... return a Scene", where)

    @wraps(function)
    def make(**arguments: Any) -> Scene:
        made = guarded(partial(function, **arguments))
        if not isinstance(made, Scene):
            raise SceneError(f"scene() returned a {type(made).__name__}", "return a Scene", where)
        return made

    return make


def run_job(job: Job, output: Sequence[str], profile: bool = False, cache: str | None = None) -> Recording:
    """Simulate with a progress bar, kept in a cache if one is named, and print the summary; names of outputs are looked at first."""
    from rigidimpulse.core.errors import SceneError

    for target in output:
        if Path(target).suffix not in OUTPUT_SUFFIXES:
            raise SceneError(f"cannot write {target!r}", f"use a name that ends in {', '.join(OUTPUT_SUFFIXES)}")
    from time import perf_counter

    from tqdm import tqdm

    from rigidimpulse.engine.simulate import simulate as run_scene

    scene = job.make()
    begun = cache is not None and Path(cache).exists()
    start = perf_counter()
    # disable=None: no bar where the output is no terminal.
    with tqdm(
        total=job.duration, desc=job.name, unit="s", delay=PATIENCE, disable=None, leave=False,
        bar_format="{desc} {percentage:3.0f} % |{bar}| {n:.2f} of {total:g} s, {remaining} left",
    ) as bar:  # fmt: skip

        def progress(time: float) -> None:
            bar.update(min(time, job.duration) - bar.n)

        run = run_scene(scene, job.duration, job.fps, accuracy=job.accuracy, progress=progress, cache=cache)
    seconds = perf_counter() - start
    num_impacts = len(run.impacts)
    impacts = f"{num_impacts} {'impact' if num_impacts == 1 else 'impacts'}"
    rest = f"; {cache} had what came before, or all" if begun else ""
    click.echo(f"{job.duration:g} s of motion, {impacts}, computed in {seconds:.2f} s{rest}")
    click.echo(f"status: {run.status.message}")
    if profile and run.profile is not None:
        click.echo(run.profile.table())
    return run


def print_table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...]) -> None:
    """Print rows with aligned columns; those of the given indices to the right, the last one ragged."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    for row in rows:
        cells = [cell.rjust(width) if k in right else cell.ljust(width) for k, (cell, width) in enumerate(zip(row, widths))]
        click.echo("  ".join([*cells, row[-1]]))


def show(run: Recording | Comparison) -> None:
    """Open a recording in the browser; where there is none, serve it until Ctrl-C."""
    viewer = run.show()
    if not viewer.fetched.is_set():
        click.echo("open this address in a browser; Ctrl-C ends")
        viewer.wait()


def recording_with_shapes(path: Path, scene: str | None) -> Recording:
    """Return the recording of an .npz file or a cache, with the scene that has its shapes."""
    from dataclasses import replace

    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.recording.recording import load_recording

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
