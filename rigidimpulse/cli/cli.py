"""The command line. Only click is imported here; commands import what they use, so that `--help` answers at once."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import rigidimpulse
from rigidimpulse.cli.jobs import (
    BAD_SCENE,
    CHECK_FAILED,
    Head,
    Outputs,
    end_if_partial,
    given_options,
    print_table,
    recording_with_shapes,
    run_job,
    show,
    size_of,
    storage_of,
)
from rigidimpulse.cli.live import live
from rigidimpulse.cli.site import gallery as gallery_pages
from rigidimpulse.cli.studies import compare, hardcases, study
from rigidimpulse.cli.warmup import warmup
from rigidimpulse.cli.wedge import wedge
from rigidimpulse.recording.exporters import ExportOptions, export_suffixes, reader_suffixes

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rigidimpulse.gallery.record import Check
    from rigidimpulse.recording.recording import Recording


OUTPUT_SUFFIXES = " or ".join(", ".join(export_suffixes()).rsplit(", ", 1))


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
            from rigidimpulse.core.errors import SceneError

            if isinstance(error, SceneError):
                raise Failure(str(error)) from None
            raise


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(rigidimpulse.__version__, prog_name="rigidimpulse")
def main() -> None:
    """Rigid bodies that collide exactly: mesh scenes in, accurate motion for animation out.

    SCENE is the name of a gallery scene (`rigidimpulse demo` lists them), a .glb, .gltf, .usd, .urdf or .xml (MJCF) file, or a
    file.py that defines scene().
    """


def run_options(command: Callable) -> Callable:
    """Add the options of commands that simulate."""
    for option in (
        click.option("--view", is_flag=True, help="Open the result in the browser."),
        click.option("--cache", type=click.Path(), help="Keep the run in this .h5 file while it goes on; go on from there if it is there."),
        click.option("--trust-cache", is_flag=True, help="Go on from --cache though another user, or another machine, has written it."),
        click.option("--from-frame", type=int, help="Go on from this frame of the run in --cache, with SCENE as it is now."),
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
    for option in (
        click.option("--pre-roll", type=click.IntRange(min=0), default=0, help="Frames at the beginning that are not written."),
        click.option("--up-axis", type=click.Choice(["y", "z"]), help="Of USD files; by default that of the scene."),
        click.option("--unit", type=float, default=1.0, help="Of USD files: metres in a unit, 0.01 for centimetres."),
        click.option("--samples", type=int, default=1, help="Keys a frame in glTF and USD files, for motion blur."),
        click.option("--impact-keys", is_flag=True, help="Have keys at impacts between frames in glTF and USD files, too."),
        click.option("--tolerance", type=float, help="Leave out keys in glTF and USD files that no point misses by more, m."),
        click.option("--start-frame", type=float, default=0.0, help="Number of the first frame in glTF and USD files: 1001."),
    ):
        command = option(command)
    return command


@main.command()
@click.argument("name", required=False)
@click.option("-o", "--output", multiple=True, help=f"Write the recording: a name that ends in {OUTPUT_SUFFIXES}.")
@export_options
@run_options
def demo(name: str | None, output: tuple[str, ...], view: bool, profile: bool, **settings: Any) -> None:
    """Run a gallery scene and its checks; without NAME, list the scenes."""
    from rigidimpulse import gallery
    from rigidimpulse.studies.job import job_of

    if name is None:
        width = max(map(len, gallery.names() + gallery.hard_names()))
        for title, known in (("Gallery", gallery.names()), ("Hard cases", gallery.hard_names())):
            click.echo(f"{title}:")
            for entry_name in known:
                click.echo(f"  {entry_name.ljust(width)}  {gallery.load(entry_name).description}")
        return
    entry, outputs, storage = gallery.load(name), _outputs(output, settings), storage_of(settings)
    job = job_of(entry)._replace(**given_options(settings))
    click.echo(f"{entry.name}: {entry.description}")
    run = run_job(job, outputs, profile, storage)
    is_whole = job.duration == entry.duration and not run.status.is_partial
    checks = entry.check(run) if is_whole else []
    if is_whole:
        _print_checks(checks)
    else:
        click.echo(f"checks left out: they are for the scene's own duration, {entry.duration:g} s")
    is_written = _hand_over(run, outputs, view, Head(entry.description, tuple(checks)))
    end_if_partial(run)
    if not is_written:
        sys.exit(BAD_SCENE)
    if not all(check.passed for check in checks):
        sys.exit(CHECK_FAILED)


@main.command()
@click.argument("scene")
@click.option("-o", "--output", multiple=True, required=True, help=f"Where to write: a name that ends in {OUTPUT_SUFFIXES}.")
@export_options
@run_options
def simulate(scene: str, output: tuple[str, ...], view: bool, profile: bool, **settings: Any) -> None:
    """Simulate SCENE and write the recording."""
    from rigidimpulse.studies.job import find_job

    outputs, storage = _outputs(output, settings), storage_of(settings)
    job = find_job(scene)._replace(**given_options(settings))
    head = None if job.entry is None else Head(job.entry.description)
    run = run_job(job, outputs, profile, storage)
    is_written = _hand_over(run, outputs, view, head)
    end_if_partial(run)
    if not is_written:
        sys.exit(BAD_SCENE)


@main.command()
@click.argument("file", type=click.Path())
@click.option("--scene", help="SCENE that an .npz recording or a cache was made of: it has the motion, the scene has the shapes.")
def view(file: str, scene: str | None) -> None:
    """Open FILE, an .html or .npz recording or the .h5 cache of a run, in the browser."""
    from rigidimpulse.core.errors import SceneError

    path = Path(file)
    if not path.is_file():
        raise SceneError(f"there is no file {file!r}", "check the path")
    if path.suffix == ".html":
        click.launch(path.resolve().as_uri())
    elif path.suffix in reader_suffixes():
        show(recording_with_shapes(path, scene))
    else:
        raise SceneError(f"cannot view {path.name!r}", f"give a recording, a file that ends in .html or {' or '.join(reader_suffixes())}")


@main.command()
@click.argument("scene")
@click.option("--duration", type=float, help="Also simulate for this time [s], to see each effect's share of the work.")
@click.option("--accuracy", help="preview, standard or exact.")
def explain(scene: str, duration: float | None, accuracy: str | None) -> None:
    """Say which effects SCENE calls for, which not, and why; and what a run of it will cost."""
    from rigidimpulse.engine.begin import make_plan
    from rigidimpulse.engine.compile_scene import compile_scene
    from rigidimpulse.engine.forecast import forecast, remember
    from rigidimpulse.scene.accuracy import Accuracy
    from rigidimpulse.studies.job import find_job

    job = find_job(scene)._replace(**given_options({"accuracy": accuracy, "duration": duration}))
    chosen = job.accuracy if isinstance(job.accuracy, str | Accuracy) else "standard"
    world = compile_scene(job.make(), chosen)
    plan = make_plan(world)
    told = forecast(world, plan, job.duration).text(job.duration)
    if duration is not None:
        run = run_job(job)
        end_if_partial(run)
        assert run.plan is not None and run.profile is not None
        remember(world, plan, job.duration, run.profile.seconds - run.profile.preparing)
        plan, told = run.plan, forecast(world, plan, job.duration).text(job.duration)
    plan.forecast = told
    click.echo(plan.explain())


def _outputs(names: Sequence[str], settings: dict[str, Any]) -> Outputs:
    """Return what is to be written; the options of `export_options` are taken out of the settings."""
    pre_roll = settings.pop("pre_roll")
    given = {name: settings.pop(name) for name in ("start_frame", "tolerance", "impact_keys", "samples", "up_axis", "unit")}
    return Outputs(names, ExportOptions(**given), pre_roll)


def _print_checks(checks: Sequence[Check]) -> None:
    """Print a table of checks."""
    from rigidimpulse.gallery.record import figure

    rows = [("ok" if check.passed else "FAILED", check.what, figure(check.value), figure(check.bound), check.law) for check in checks]
    print_table([("", "check", "value", "bound", "law"), *rows], right=(2, 3))


def _hand_over(run: Recording, outputs: Outputs, view: bool, head: Head | None) -> bool:
    """Write the recording where it was asked for, and open it; return whether every file was written. head: of its page."""
    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.core.files import write_renamed
    from rigidimpulse.view.page import write_html

    run, is_written = run.part(outputs.pre_roll), True
    for name in outputs.names:
        target = Path(name)
        try:
            if target.suffix == ".html" and head is not None:
                path = write_renamed(target, lambda part: write_html(run, part, head.title, head.checks))
            else:
                path = run.export(target, **outputs.options_of(name)._asdict())
        except SceneError as error:  # the run is not lost for the other files
            Failure(str(error)).show()
            is_written = False
        else:
            click.echo(f"wrote {path} ({size_of(path)})")
    if view:
        show(run, head)
    return is_written


for command in (hardcases, study, compare, wedge, live, gallery_pages, warmup):
    main.add_command(command)
