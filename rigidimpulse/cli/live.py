"""The command that shows a scene while it is computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rigidimpulse.cli.jobs import given_options


@click.command()
@click.argument("scene")
@click.option("--duration", type=float, help="Time to simulate, s.")
@click.option("--fps", type=float, help="Frames per second.")
@click.option("--accuracy", help="preview, standard or exact.")
@click.option("--open/--no-open", "open_browser", default=True, show_default=True, help="Open the page in the browser.")
def live(scene: str, open_browser: bool, **settings: Any) -> None:
    """Show SCENE on a live page while it is computed, until Ctrl-C.

    Sliders on the page change the scene, a body that is dragged there is thrown, and a file that is saved runs again. The arguments of
    scene() in a file.py are sliders: def scene(height: float = 2.0).
    """
    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.studies.job import find_job
    from rigidimpulse.studies.live.session import live as show_live

    # What is wrong inside a file is shown on the page, and may be corrected while it is up.
    if not Path(scene).suffix:
        find_job(scene)
    elif not Path(scene).is_file():
        raise SceneError("there is no such file", "check the path", f"scene file {scene!r}")
    show_live(scene, open_browser=open_browser, **given_options(settings)).wait()
