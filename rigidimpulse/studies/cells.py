"""What a notebook shows of studies and wedges in a cell."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from rigidimpulse.studies.glance.page import page_of
from rigidimpulse.view.cells import frame, table

if TYPE_CHECKING:
    from rigidimpulse.studies.glance.known import Glance
    from rigidimpulse.studies.wedges.wedge import Wedge
    from rigidimpulse.studies.work_precision import Study


def study_cell(study: Study) -> str:
    """The rows of a study, cheapest first; what no other row beats is marked."""
    front = {row.name for row in study.front()}
    rows = [
        ("best" if row.name in front else "", row.name, f"{row.cost:.2g}", f"{row.whole.position:.2g}", row.status)
        for row in sorted(study.rows, key=lambda row: row.cost)
    ]
    return f"<p>{html.escape(repr(study))}</p>" + table(("", "setting", "cost, s", "error of places, m", "status"), rows)


def glance_cell(known: Glance) -> str:
    """The page of a study at a glance."""
    return frame(page_of(known), known.name)


def wedge_cell(wedge: Wedge) -> str:
    """The table of a wedge, and where its files are."""
    head, *rows = wedge.rows()
    return f"<p>{html.escape(repr(wedge))}</p>" + table(head, rows)
