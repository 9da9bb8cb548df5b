"""Commands that run many runs: hard cases, studies, comparisons."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rigidimpulse.cli.jobs import CHECK_FAILED, end_if_partial, given_options, print_table, recording_with_shapes, run_job, show, size_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rigidimpulse.studies.glance.known import Glance
    from rigidimpulse.studies.hard_cases import CaseResult
    from rigidimpulse.studies.job import Job


@click.command()
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


@click.command()
@click.argument("scene", required=False)
@click.option("-o", "--output", help="Folder for the page study.html, and the table of --full.  [default: study_SCENE]")
@click.option("--budget", type=float, help="Time the study may take, s.  [default: 60, or 3600 with --full]")
@click.option("--view", is_flag=True, help="Open the page in the browser at once; it follows the study.")
@click.option("--full", is_flag=True, help="Then also all settings of every strategy: a table and charts.")
@click.option("--peer", "peers", multiple=True, help="Another engine beside it: mujoco or pybullet.  [default: those installed]")
@click.option("--duration", type=float, help="Time to simulate, s.")
@click.option("--scaling", is_flag=True, help="Instead, time scenes of 10 to 20,000 bodies and print exponents p of cost ~ n^p.")
@click.option("--most", type=int, default=20_000, show_default=True, help="Bodies of the largest scene of --scaling.")
def study(scene: str | None, output: str | None, scaling: bool, most: int, full: bool, **settings: Any) -> None:
    """Say what accuracy costs in SCENE: one sentence soon, and a page on which its runs play side by side."""
    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.studies.job import find_job

    if scaling == (scene is not None):
        raise SceneError("study takes a SCENE, or --scaling", "give one of them")
    if scene is None:
        _study_scaling(most)
        return
    job = find_job(scene)
    if settings["duration"] is not None:
        job = job._replace(duration=settings["duration"])
    folder = Path(output or f"study_{job.name}")
    _glance_at(job, folder, settings["budget"], settings["peers"] or None, settings["view"])
    if full:
        _study_settings(job, folder, settings["budget"], settings["peers"])


def _glance_at(job: Job, folder: Path, budget: float | None, peers: tuple[str, ...] | None, view: bool) -> None:
    """Print the sentence as soon as it is known, and again if it has changed at the end; the page is written all the while."""
    from rigidimpulse.studies.glance.glance import BUDGET, glance
    from rigidimpulse.studies.glance.page import PAGE

    told: list[str] = []

    def changed(known: Glance) -> None:
        if not told:
            told.append("")
            click.echo(f"{folder / PAGE} shows the runs, and follows the study while it is open")
            if view:
                click.launch((folder / PAGE).resolve().as_uri())
        text = known.verdict.text() if known.verdict is not None else ""
        if text and (len(told) == 1 or (known.finished and text != told[-1])):
            told.append(text)
            click.echo(text if known.finished else f"{text}\n(still measuring)")

    known = glance(job, budget=min(budget or BUDGET, BUDGET), peers=peers, output=folder, changed=changed)
    for played in known.runs:
        if played.why_not:
            click.echo(f"{played.candidate.name}: {played.why_not}")
    if known.duration < known.asked:
        click.echo(f"this is about the first {known.duration:.3g} s of {known.asked:g} s; --budget allows more")


def _study_settings(job: Job, folder: Path, budget: float | None, peers: tuple[str, ...]) -> None:
    """Print the table of all settings and write its files."""
    from tqdm import tqdm

    from rigidimpulse.studies.work_precision import FULL_BUDGET, charts_are_installed
    from rigidimpulse.studies.work_precision import study as run_study

    with tqdm(total=100, disable=None, leave=False, bar_format="{desc} {percentage:3.0f} % of the budget |{bar}|") as bar:

        def progress(what: str, share: float) -> None:
            bar.set_description(what)
            bar.update(round(100.0 * share) - bar.n)

        result = run_study(job, settings="full", budget=budget or FULL_BUDGET, peers=peers, output=folder, progress=progress)
    click.echo(f"{result.name}, {result.duration:g} s; reference: {result.reference.describe()}")
    click.echo(result.table())
    if result.left:
        click.echo(f"{len(result.left)} more settings need a larger --budget; the same command goes on with them")
    click.echo(f"wrote {folder / 'study.csv'}")
    if not charts_are_installed():
        click.echo("charts need matplotlib and plotly: pip install 'rigidimpulse[study]', and run this again")
        return
    for name in ("study.png", "settings.html"):
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
        print_table(rows, right=(0, 1, 2, 3))
        click.echo(f"exponent of the cost a {SCENES[kind].unit}: {exponent(points):+.2f}")


@click.command()
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
    from rigidimpulse.studies.job import find_job

    words, job = (first, second), find_job(scene)
    comparison.check_words(words, output)
    recorded = {word: recording_with_shapes(Path(word), scene) for word in words if comparison.is_recording(word)}
    for run in recorded.values():
        job = job._replace(**comparison.frames_of(run))
    job = job._replace(**given_options(settings))
    for word in dict.fromkeys(words):
        if word not in recorded:
            recorded[word] = run_job(job._replace(accuracy=word))
            end_if_partial(recorded[word])
    runs = [recorded[word] for word in words]
    result = comparison.compare(runs[0], runs[1], comparison.labels_of(words), comparison.common_horizon(runs))
    click.echo(result.table())
    if output:
        path = result.export(output)
        click.echo(f"wrote {path} ({size_of(path)})")
    if view:
        show(result)


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
    print_table(rows, right=(2, 3, 4))
