"""The command that writes the gallery as pages."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rigidimpulse.cli.jobs import CHECK_FAILED

if TYPE_CHECKING:
    from rigidimpulse.studies.hard_cases import CaseResult


@click.command()
@click.argument("names", nargs=-1)
@click.option("-o", "--output", default="site", show_default=True, help="Folder for the pages; index.html is where to begin.")
@click.option("--jobs", type=int, default=1, show_default=True, help="Scenes that run at a time.")
@click.option("--limit", type=float, default=900.0, show_default=True, help="Time for a scene, s; one that takes longer has failed.")
def gallery(names: tuple[str, ...], output: str, jobs: int, limit: float) -> None:
    """Write pages of all gallery scenes, or of the scenes NAMES: pictures, checks, sources, and each to play.

    Scenes whose pages are newer than the package are kept. The exit code is 1 if a scene fails.
    """
    from tqdm import tqdm

    from rigidimpulse.gallery import names as all_names
    from rigidimpulse.studies.site import make_site

    with tqdm(total=len(set(names)) or len(all_names()), unit="scene", disable=None, leave=False) as bar:

        def report(result: CaseResult, kept: bool) -> None:
            bar.update()
            with tqdm.external_write_mode():
                mark = "kept" if kept else f"{result.seconds:.1f} s"
                click.echo(f"{'ok' if result.passed else result.outcome.upper():8}{result.name}, {mark}")

        results = make_site(Path(output), names, jobs, limit, report)
    passed = sum(result.passed for result in results)
    click.echo(f"{passed} of {len(results)} passed; wrote {Path(output) / 'index.html'}")
    if passed < len(results):
        sys.exit(CHECK_FAILED)
