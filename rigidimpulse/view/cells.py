"""What a notebook shows of an object in a cell: a picture of a scene, the player of a run, tables; as HTML in one piece."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.recording.status import Status
from rigidimpulse.scene.mass import body_mass
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import rotation_matrix
from rigidimpulse.view.page import render_page
from rigidimpulse.view.picture import draw_picture, png

HEIGHT = 540
"""Pixels of a page in a cell."""
MOST_PAGE = 24_000_000
"""Characters of a page up to which it is put into a cell: the notebook keeps them."""
MOST_ROWS = 60
"""Rows of a table; the rest is counted."""
WIDE, TALL = 640, 360
"""Pixels of the picture of a scene."""


@dataclass(frozen=True)
class _Start:
    """A scene before anything moves, as `draw_picture` wants it."""

    scene: Scene
    times: np.ndarray
    impacts: np.ndarray
    contacts: np.ndarray
    status: Status
    soft_bodies: tuple[()] = ()
    ledger: None = None
    reactions: dict[str, np.ndarray] = field(default_factory=dict)

    def position(self, name: str, /) -> np.ndarray:
        """Origin of a body (1, 3), m."""
        body = self.scene[name]
        return np.array(body.position if body.keyframes is None else body.keyframes.arrays()[1][0], float)[None]

    def orientation(self, name: str, /) -> np.ndarray:
        """Frame of a body (1, 4)."""
        body = self.scene[name]
        return (body.unit_orientation() if body.keyframes is None else body.keyframes.arrays(body.orientation)[2][0])[None]

    def center_of_mass(self, name: str, /) -> np.ndarray:
        """Where it is (1, 3), m; of a body that is not dynamic the origin."""
        body = self.scene[name]
        if body.motion != "dynamic":
            return self.position(name)
        return self.position(name) + rotation_matrix(self.orientation(name)[0]) @ body_mass(body).center_of_mass


def scene_cell(scene: Scene) -> str:
    """A picture of the rigid bodies of a scene where they start, and how many there are; the words alone where it cannot be drawn."""
    words = f"<p>{html.escape(repr(scene))}</p>"
    nothing = np.zeros(0, IMPACT_DTYPE)
    try:
        picture = png(draw_picture(_Start(scene, np.zeros(1), nothing, nothing, Status(True, "finished")), WIDE, TALL, 0))
    except (SceneError, ValueError) as error:
        return f"{words}<p>no picture: {html.escape(str(error))}</p>"
    data = base64.b64encode(picture).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" width="{WIDE}" height="{TALL}" alt="{html.escape(repr(scene))}">{words}'


def recording_cell(recording: Any) -> str:
    """The player of a run; the words alone for a run without its scene, or one whose page is too large for a cell."""
    words = f"<p>{html.escape(repr(recording))}</p>"
    if recording.scene is None:
        return words
    page = render_page(recording)
    if len(page) > MOST_PAGE:
        return f"{words}<p>its page has {len(page) / 1e6:.0f} MB: write it with run.export(&quot;run.html&quot;)</p>"
    return frame(page, repr(recording))


def plan_cell(plan: Any) -> str:
    """The effects of a plan: those that are in first, with the reason of each."""
    lines = sorted(plan.lines, key=lambda line: not line.included)
    rows = [(line.stage, line.name, "in" if line.included else "out", line.reason) for line in lines]
    forecast = f"<p>{html.escape(plan.forecast)}</p>" if plan.forecast else ""
    return table(("stage", "effect", "", "why"), rows) + forecast


def frame(page: str, title: str) -> str:
    """A page in a frame of its own."""
    style = f"width: 100%; height: {HEIGHT}px; border: none; border-radius: 12px"
    return f'<iframe srcdoc="{html.escape(page)}" style="{style}" title="{html.escape(title)}" loading="lazy"></iframe>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Rows of text below a head."""
    rows = list(rows)
    lines = [_line(head, "th"), *(_line(row, "td") for row in rows[:MOST_ROWS])]
    left = f"<p>and {len(rows) - MOST_ROWS} more</p>" if len(rows) > MOST_ROWS else ""
    return f"<table>{''.join(lines)}</table>{left}"


def _line(cells: Sequence[str], tag: str) -> str:
    return "<tr>" + "".join(f'<{tag} style="text-align: left">{html.escape(cell)}</{tag}>' for cell in cells) + "</tr>"
