"""The command line. Only click is imported here; commands import what they use, so that `--help` answers at once."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

import rigidimpulse

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rigidimpulse.accuracy import Accuracy
    from rigidimpulse.gallery.record import Check, GalleryScene
    from rigidimpulse.recording import Recording
    from rigidimpulse.scene import Scene
    from rigidimpulse.studies.compare import Comparison
    from rigidimpulse.studies.hard_cases import CaseResult
    from rigidimpulse.studies.wishes import Wish

SCENE_SUFFIXES = (".glb", ".gltf")
OUTPUT_SUFFIXES = (".html", ".npz", ".glb", ".gltf")
DEFAULT_DURATION = 4.0
"""s, of scenes from files."""
DEFAULT_FPS = 60.0
PATIENCE = 0.5
"""s of work before a progress bar appears."""
CHECK_FAILED, BAD_SCENE = 1, 2
"""Exit codes, besides 0 for success."""


class Failure(click.ClickException):
    """A message for the user, without a traceback."""

    exit_code = BAD_SCENE


class Commands(click.Group):
    """Commands whose `SceneError` ends the program with its message."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except ValueError as error:
            from rigidimpulse.errors import SceneError

            if isinstance(error, SceneError):
                raise Failure(str(error)) from None
            raise


class Job(NamedTuple):
    """A scene to run: name, how to make it, how long [s], frames per second, accuracy, gallery record."""

    name: str
    make: Callable[[], Scene]
    duration: float
    fps: float
    accuracy: str | Accuracy | Wish
    entry: GalleryScene | None


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(rigidimpulse.__version__, prog_name="rigidimpulse")
def main() -> None:
    """Rigid bodies that collide exactly: mesh scenes in, accurate motion for animation out.

    SCENE is the name of a gallery scene (`rigidimpulse demo` lists them), a .glb or .gltf file, or a file.py that defines scene().
    """


def run_options(command: Callable) -> Callable:
    """Add the options of commands that simulate."""
    for option in (
        click.option("--view", is_flag=True, help="Open the result in the browser."),
        click.option("--profile", is_flag=True, help="Print where the time went, by stage and by kernel."),
        click.option("--fps", type=float, help="Frames per second; changes what is recorded, never what happens."),
        click.option("--duration", type=float, help="Time to simulate, s."),
        click.option("--per-frame", type=float, help="Instead of --accuracy: the finest setting that takes so long for a frame, s."),
        click.option("--within", type=float, help="Instead of --accuracy: the cheapest setting whose places are right to so much, m."),
        click.option("--accuracy", help="preview, standard or exact."),
    ):
        command = option(command)
    return command


def export_options(command: Callable) -> Callable:
    """Add the options of commands that write recordings."""
    command = click.option("--impact-keys", is_flag=True, help="Have keys at impacts between frames in .glb and .gltf, too.")(command)
    command = click.option("--tolerance", type=float, help="Leave out keys in .glb and .gltf that no point misses by more, m.")(command)
    return click.option("--start-frame", type=float, default=0.0, help="Number of the first frame in .glb and .gltf: 1001.")(command)


@main.command()
@click.argument("name", required=False)
@click.option("-o", "--output", multiple=True, help="Write the recording: a name that ends in .html, .npz, .glb or .gltf.")
@export_options
@run_options
def demo(name: str | None, output: tuple[str, ...], view: bool, profile: bool, **settings: Any) -> None:
    """Run a gallery scene and its checks; without NAME, list the scenes."""
    from rigidimpulse import gallery

    if name is None:
        width = max(map(len, gallery.names() + gallery.hard_names()))
        for title, known in (("Gallery", gallery.names()), ("Hard cases", gallery.hard_names())):
            click.echo(f"{title}:")
            for entry_name in known:
                click.echo(f"  {entry_name.ljust(width)}  {gallery.load(entry_name).description}")
        return
    entry, keys = gallery.load(name), _export_settings(settings)
    job = _job_of(entry)._replace(**_given(settings))
    click.echo(f"{entry.name}: {entry.description}")
    run = _run(job, output, profile)
    passed = True
    if job.duration == entry.duration:
        passed = _print_checks(entry.check(run))
    else:
        click.echo(f"checks left out: they are for the scene's own duration, {entry.duration:g} s")
    _hand_over(run, output, view, keys)
    if not passed:
        sys.exit(CHECK_FAILED)


@main.command()
@click.argument("names", nargs=-1)
@click.option("-o", "--output", default="hard_cases", show_default=True, help="Folder for hard_cases.json and hard_cases.html.")
@click.option("--limit", type=float, default=120.0, show_default=True, help="Time for a case, s; one that takes longer has failed.")
def hardcases(names: tuple[str, ...], output: str, limit: float) -> None:
    """Run the hard-case suite, or the cases NAMES, at default settings; the exit code is 1 if any fails."""
    from tqdm import tqdm

    from rigidimpulse import gallery
    from rigidimpulse.studies.hard_cases import run_suite, write_results

    chosen = names or gallery.hard_names()
    with tqdm(total=len(chosen), unit="case", disable=None, leave=False) as bar:
        bar.set_description(chosen[0])

        def report(result: CaseResult) -> None:
            bar.update()
            if bar.n < len(chosen):
                bar.set_description(chosen[int(bar.n)])

        results = run_suite(chosen, limit, report)
    _print_results(results)
    passed = sum(result.passed for result in results)
    click.echo(f"{passed} of {len(results)} passed, {sum(result.seconds for result in results):.0f} s")
    for path in write_results(results, Path(output), limit):
        click.echo(f"wrote {path}")
    if passed < len(results):
        sys.exit(CHECK_FAILED)


@main.command()
@click.argument("scene", required=False)
@click.option("-o", "--output", help="Folder for the table and the charts; a study found there is gone on with.  [default: study_SCENE]")
@click.option("--budget", type=float, help="Time the study may take, s.  [default: 60, or 3600 with --full]")
@click.option("--full", is_flag=True, help="All settings of every strategy.")
@click.option("--peer", "peers", multiple=True, help="Another engine on the same chart: mujoco or pybullet; may be repeated.")
@click.option("--duration", type=float, help="Time to simulate, s.")
@click.option("--scaling", is_flag=True, help="Instead, time scenes of 10 to 20,000 bodies and print exponents p of cost ~ n^p.")
@click.option("--most", type=int, default=20_000, show_default=True, help="Bodies of the largest scene of --scaling.")
def study(scene: str | None, output: str | None, scaling: bool, most: int, **settings: Any) -> None:
    """Measure what accuracy costs in time: run SCENE with many settings, against a reference."""
    from rigidimpulse.errors import SceneError

    if scaling == (scene is not None):
        raise SceneError("study takes a SCENE, or --scaling", "give one of them")
    if scene is not None:
        _study_scene(scene, output, **settings)
    else:
        _study_scaling(most)


def _study_scene(scene: str, output: str | None, budget: float | None, full: bool, peers: tuple[str, ...], duration: float | None) -> None:
    """Print the table of a study and write its files."""
    from tqdm import tqdm

    from rigidimpulse.studies.work_precision import BUDGET, FULL_BUDGET
    from rigidimpulse.studies.work_precision import study as run_study

    job = _find_job(scene)
    given = job.name if job.entry is not None else job.make()
    folder = Path(output or f"study_{job.name}")
    with tqdm(total=100, disable=None, leave=False, bar_format="{desc} {percentage:3.0f} % of the budget |{bar}|") as bar:

        def progress(what: str, share: float) -> None:
            bar.set_description(what)
            bar.update(round(100.0 * share) - bar.n)

        result = run_study(
            given, duration or job.duration, job.fps, name=job.name, full=full, budget=budget or (FULL_BUDGET if full else BUDGET),
            peers=peers, output=folder, progress=progress,
        )  # fmt: skip
    click.echo(f"{result.name}, {result.duration:g} s; reference: {result.reference.describe()}")
    click.echo(result.table())
    if result.left:
        click.echo(f"no time for {len(result.left)} settings: {', '.join(result.left)}; raise --budget, and the study goes on")
    for name in ("study.csv", "study.png", "study.html"):
        click.echo(f"wrote {folder / name}")


def _study_scaling(most: int) -> None:
    """Print how the cost of impacts and of steps grows with the number of bodies."""
    from rigidimpulse.studies.scaling import SCENES, exponent, measure_scaling, sizes

    for kind in SCENES:
        rows = [("bodies", "s in all", f"{SCENES[kind].unit}s", f"us a {SCENES[kind].unit}", "")]
        points = []
        for point in measure_scaling(kind, sizes(kind, most)):
            points.append(point)
            rows.append((f"{point.number:,}", f"{point.seconds:.2f}", f"{point.count:,}", f"{1e6 * point.cost:.1f}", ""))
        click.echo(f"{kind}: {SCENES[kind].description}")
        _print_table(rows, right=(0, 1, 2, 3))
        click.echo(f"exponent of the cost a {SCENES[kind].unit}: {exponent(points):+.2f}")


@main.command()
@click.argument("scene")
@click.option("-o", "--output", multiple=True, required=True, help="Where to write: a name that ends in .html, .npz, .glb or .gltf.")
@export_options
@run_options
def simulate(scene: str, output: tuple[str, ...], view: bool, profile: bool, **settings: Any) -> None:
    """Simulate SCENE and write the recording."""
    keys = _export_settings(settings)
    job = _find_job(scene)._replace(**_given(settings))
    _hand_over(_run(job, output, profile), output, view, keys)


@main.command()
@click.argument("file", type=click.Path())
@click.option("--scene", help="SCENE that an .npz recording was made of: it has the motion, the scene has the shapes.")
def view(file: str, scene: str | None) -> None:
    """Open FILE, an .html or .npz recording, in the browser."""
    from rigidimpulse.errors import SceneError

    path = Path(file)
    if not path.is_file():
        raise SceneError(f"there is no file {file!r}", "check the path")
    if path.suffix == ".html":
        click.launch(path.resolve().as_uri())
    elif path.suffix == ".npz":
        _show(_recording_with_shapes(path, scene))
    else:
        raise SceneError(f"cannot view {path.name!r}", "give a recording, a file that ends in .html or .npz")


@main.command()
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@click.option("--scene", required=True, help="SCENE that both are runs of: it has the shapes.")
@click.option("-o", "--output", help="Write a page that plays both runs and plots how far they are apart: a name that ends in .html.")
@click.option("--view", is_flag=True, help="Open that page in the browser.")
@click.option("--fps", type=float, help="Frames per second of what is run; default: those of a recording, else the scene's.")
@click.option("--duration", type=float, help="Time to run, s; default: that of a recording, else the scene's.")
def compare(first: str, second: str, scene: str, output: str | None, view: bool, **settings: Any) -> None:
    """Say how far A and B are apart: recordings (.npz) of SCENE, or accuracies (preview, standard, exact) that it is run with."""
    from rigidimpulse.studies import compare as comparison

    words, job = (first, second), _find_job(scene)
    comparison.check_words(words, output)
    recorded = {word: _recording_with_shapes(Path(word), scene) for word in words if comparison.is_recording(word)}
    for run in recorded.values():
        job = job._replace(**comparison.frames_of(run))
    job = job._replace(**_given(settings))
    runs = [recorded[word] if word in recorded else _run(job._replace(accuracy=word), ()) for word in words]
    result = comparison.compare(runs[0], runs[1], comparison.labels_of(words), comparison.common_horizon(runs))
    click.echo(result.table())
    if output:
        path = result.export(output)
        click.echo(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
    if view:
        _show(result)


@main.command()
@click.argument("scene")
@click.option("--duration", type=float, help="Also simulate for this time [s], to see each effect's share of the work.")
@click.option("--accuracy", help="preview, standard or exact.")
def explain(scene: str, duration: float | None, accuracy: str | None) -> None:
    """Say which effects SCENE calls for, which not, and why."""
    from rigidimpulse.simulation import make_plan
    from rigidimpulse.world import compile_scene

    job = _find_job(scene)._replace(**_given({"accuracy": accuracy, "duration": duration}))
    if duration is None:
        plan = make_plan(compile_scene(job.make(), accuracy or (job.entry.accuracy if job.entry is not None else "standard")))
    else:
        plan = _run(job, ()).plan
        assert plan is not None
    click.echo(plan.explain())


def _given(settings: dict[str, Any]) -> dict[str, Any]:
    """Return the options that were given; a wish takes the place of the accuracy.

    Raises:
        SceneError: more than one accuracy was given.

    """
    from rigidimpulse.errors import SceneError

    given = {name: value for name, value in settings.items() if value is not None}
    if len({"accuracy", "within", "per_frame"} & set(given)) > 1:
        raise SceneError("more than one of --accuracy, --within and --per-frame", "give one of them")
    if "within" in given:
        from rigidimpulse.studies.wishes import Within

        given["accuracy"] = Within(position=given.pop("within"))
    if "per_frame" in given:
        from rigidimpulse.studies.wishes import InTime

        given["accuracy"] = InTime(given.pop("per_frame"))
    return given


def _export_settings(settings: dict[str, Any]) -> dict[str, Any]:
    """Take out and return the options of `export_options`."""
    return {name: settings.pop(name) for name in ("start_frame", "tolerance", "impact_keys")}


def _job_of(entry: GalleryScene) -> Job:
    return Job(entry.name, entry.scene, entry.duration, entry.fps, entry.accuracy, entry)


def _find_job(scene: str) -> Job:
    """Return the job for a gallery name or a file.

    Raises:
        SceneError: it is neither, with the ways to name a scene.

    """
    from rigidimpulse import gallery
    from rigidimpulse.errors import SceneError

    path = Path(scene)
    if path.suffix == ".py":
        return Job(path.stem, _scene_function(path), DEFAULT_DURATION, DEFAULT_FPS, "standard", None)
    if path.suffix in SCENE_SUFFIXES:
        return Job(path.stem, partial(_load_scene, path), DEFAULT_DURATION, DEFAULT_FPS, "standard", None)
    if path.suffix or len(path.parts) > 1:
        known = "a gallery scene (`rigidimpulse demo` lists them), a .glb or .gltf file, or a file.py that defines scene()"
        raise SceneError(f"cannot read a scene from {scene!r}", f"supported: {known}")
    return _job_of(gallery.load(scene))


def _load_scene(path: Path) -> Scene:
    """Return the scene of a .glb or .gltf file; what of the file is not in it is printed."""
    from rigidimpulse.io.scene_file import load_scene

    scene = load_scene(path)
    for line in scene.report:
        click.echo(f"{path.name}: {line}", err=True)
    return scene


def _scene_function(path: Path) -> Callable[[], Scene]:
    """Return the function `scene` of a Python file, so wrapped that its errors name the file and the line."""
    import runpy
    import traceback

    from rigidimpulse.errors import RigidImpulseError, SceneError
    from rigidimpulse.scene import Scene

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

    def make() -> Scene:
        made = guarded(function)
        if not isinstance(made, Scene):
            raise SceneError(f"scene() returned a {type(made).__name__}", "return a Scene", where)
        return made

    return make


def _run(job: Job, output: Sequence[str], profile: bool = False) -> Recording:
    """Simulate with a progress bar and print the summary; names of outputs are looked at first."""
    from rigidimpulse.errors import SceneError

    for target in output:
        if Path(target).suffix not in OUTPUT_SUFFIXES:
            raise SceneError(f"cannot write {target!r}", f"use a name that ends in {', '.join(OUTPUT_SUFFIXES)}")
    from time import perf_counter

    from tqdm import tqdm

    from rigidimpulse.simulation import simulate as run_scene

    scene = job.make()
    start = perf_counter()
    # disable=None: no bar where the output is no terminal.
    with tqdm(
        total=job.duration, desc=job.name, unit="s", delay=PATIENCE, disable=None, leave=False,
        bar_format="{desc} {percentage:3.0f} % |{bar}| {n:.2f} of {total:g} s, {remaining} left",
    ) as bar:  # fmt: skip

        def progress(time: float) -> None:
            bar.update(min(time, job.duration) - bar.n)

        run = run_scene(scene, job.duration, job.fps, accuracy=job.accuracy, progress=progress)
    seconds = perf_counter() - start
    num_impacts = len(run.impacts)
    impacts = f"{num_impacts} {'impact' if num_impacts == 1 else 'impacts'}"
    click.echo(f"{job.duration:g} s of motion, {impacts}, computed in {seconds:.2f} s")
    click.echo(f"status: {run.status.message}")
    if profile and run.profile is not None:
        click.echo(run.profile.table())
    return run


def _print_checks(checks: Sequence[Check]) -> bool:
    """Print a table of checks; return whether all hold."""
    from rigidimpulse.gallery.record import figure

    rows = [("ok" if check.passed else "FAILED", check.what, figure(check.value), figure(check.bound), check.law) for check in checks]
    _print_table([("", "check", "value", "bound", "law"), *rows], right=(2, 3))
    return all(check.passed for check in checks)


def _print_results(results: Sequence[CaseResult]) -> None:
    """Print a table of hard cases, a line each: the check that says most."""
    from rigidimpulse.gallery.record import figure

    rows = [("", "case", "value", "bound", "time", "measure")]
    for result in results:
        check = result.main_check
        value, bound = (figure(check["value"]), figure(check["bound"])) if check else ("-", "-")
        measure = check["what"] if check else result.message.splitlines()[-1]
        mark = "ok" if result.passed else result.outcome.upper()
        rows.append((mark, result.name, value, bound, f"{result.seconds:.1f} s", measure))
    _print_table(rows, right=(2, 3, 4))


def _print_table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...]) -> None:
    """Print rows with aligned columns; those of the given indices to the right, the last one ragged."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    for row in rows:
        cells = [cell.rjust(width) if k in right else cell.ljust(width) for k, (cell, width) in enumerate(zip(row, widths))]
        click.echo("  ".join([*cells, row[-1]]))


def _hand_over(run: Recording, output: Sequence[str], view: bool, keys: dict[str, Any]) -> None:
    """Write the recording where it was asked for, and open it; keys: options of animated nodes."""
    for target in output:
        path = run.export(target, **(keys if Path(target).suffix in SCENE_SUFFIXES else {}))
        click.echo(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)")
    if view:
        _show(run)


def _show(run: Recording | Comparison) -> None:
    """Open a recording in the browser; where there is none, serve it until Ctrl-C."""
    viewer = run.show()
    if not viewer.fetched.is_set():
        click.echo("open this address in a browser; Ctrl-C ends")
        viewer.wait()


def _recording_with_shapes(path: Path, scene: str | None) -> Recording:
    """Return the recording of an .npz file, with the scene that has its shapes."""
    from dataclasses import replace

    from rigidimpulse.errors import SceneError
    from rigidimpulse.recording import load_recording

    if scene is None:
        remedy = "name its scene, --scene SCENE, or export the run as .html"
        raise SceneError("an .npz recording has the motion but not the shapes", remedy, f"recording {str(path)!r}")
    run = load_recording(path)
    made = _find_job(scene).make()
    if list(made.names) != run.names:
        bodies = f"its bodies are {', '.join(run.names)}, those of the scene {', '.join(made.names)}"
        raise SceneError(bodies, "name the scene it was made of", f"recording {str(path)!r}")
    return replace(run, scene=made)
