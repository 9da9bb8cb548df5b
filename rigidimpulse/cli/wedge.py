"""The command that runs a scene many times."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from rigidimpulse.cli.jobs import CHECK_FAILED, print_table

if TYPE_CHECKING:
    from rigidimpulse.studies.wedges.take import Take


@click.command()
@click.argument("scene")
@click.option("--vary", multiple=True, required=True, metavar="NAME=VALUES", help="material.restitution=0.1:0.9:9, seed=0:15.")
@click.option("-o", "--output", help="Folder for the takes; a wedge found there is gone on with.  [default: wedge_SCENE]")
@click.option("--processes", type=click.IntRange(min=1), help="Takes at a time.  [default: one a core]")
@click.option("--scheduler", help="Run on a Dask scheduler, tcp://HOST:PORT, or 'local' for a cluster on this machine.")
@click.option("--retries", type=click.IntRange(min=0), default=2, show_default=True, help="How often a take is run again when it dies.")
@click.option("--duration", type=float, help="Time to simulate, s.")
@click.option("--fps", type=float, help="Frames per second.")
@click.option("--accuracy", help="preview, standard or exact.")
@click.option("--view", is_flag=True, help="Open the sheet of all takes in the browser.")
def wedge(
    scene: str, vary: tuple[str, ...], output: str | None, view: bool, processes: int | None, scheduler: str | None, retries: int,
    **settings: Any,
) -> None:  # fmt: skip
    """Run SCENE with all combinations of varied parameters; the exit code is 1 if a take fails."""
    from pathlib import Path

    from tqdm import tqdm

    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.studies.wedges.vary import combinations, parse_vary
    from rigidimpulse.studies.wedges.wedge import wedge as run_wedge
    from rigidimpulse.studies.wedges.workers import Workers

    pairs = [parse_vary(text) for text in vary]
    varied = dict(pairs)
    if len(varied) < len(pairs):
        raise SceneError("--vary names one parameter twice", "give all of its values at once: NAME=1,2,5:9:3")
    folder = Path(output or f"wedge_{Path(scene).stem}")
    with tqdm(total=len(combinations(varied)), unit="take", disable=None, leave=False) as bar:

        def progress(_take: Take) -> None:
            bar.update()

        result = run_wedge(scene, varied, folder, workers=Workers(processes, scheduler, retries), progress=progress, **settings)
    rows = result.rows()
    print_table([(*row[:-1], row[-1].splitlines()[0]) for row in rows], right=(0, *range(1, len(rows[0]) - 1)))
    click.echo(f"{len(result.takes) - len(result.failed)} of {len(result.takes)} takes done")
    click.echo(f"wrote {folder / 'wedge.csv'} and {folder / 'index.html'}")
    if view:
        click.launch((folder / "index.html").resolve().as_uri())
    if result.failed:
        sys.exit(CHECK_FAILED)
