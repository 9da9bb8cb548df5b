"""What a page shows over time beside the motion: impacts along the time line, forces of lasting contacts, energy and momentum.

Marks: the run is cut into `MARK_BINS` equal parts; each has the number n of its impacts and the height of the strongest one,
sqrt(j / j_max), the share of the longest arrow that its impulse j has (`arrows`).

Contact rows: the force F of a contact acts on body b, -F on a. The arrow is that on the dynamic body; where both are, that on the
one that it carries, so that the arrows in a pile point up. Its length grows with the square root of |F|, as those of impulses do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rigidimpulse.view.arrows import LEAST_LENGTH

MARK_BINS = 2048
"""Parts of the time line: more than it has pixels on most screens."""
CONTACT_ROW = 8
"""Numbers of a contact: first frame, frame after the last, point (3), arrow (3)."""
MOST_CONTACT_ROWS = 200_000
"""Contacts kept, the strongest first."""
LONGEST_SHARE = 0.6
"""Longest arrow of a contact, as a share of the longest arrow of an impact."""
LEAST_SPAN = 1e-3
"""Least range of the plot of energies, relative to the largest energy; potential energy there from the world's origin."""
STRONG = 98.0
"""Percentile of the forces from which arrows are as long as they can be: one hard stop must not shrink all others."""


def impact_marks(impacts: npt.NDArray[Any], start: float, end: float) -> npt.NDArray[np.float32]:
    """Return (2, MARK_BINS): numbers of impacts, then heights in [0, 1], in equal parts of the run from `start` to `end`, s."""
    impulse = impacts["impulse"][:, None] * impacts["normal"] + impacts["tangent_impulse"]
    size = np.linalg.norm(np.asarray(impulse, dtype=np.float64).reshape(-1, 3), axis=1)
    seen = np.isfinite(size) & (size > 0.0) & (end > start)
    marks = np.zeros((2, MARK_BINS), dtype=np.float32)
    if seen.any():
        share = (np.asarray(impacts["time"])[seen] - start) / (end - start)
        place = np.clip((share * MARK_BINS).astype(np.int64), 0, MARK_BINS - 1)
        marks[0] = np.bincount(place, minlength=MARK_BINS)
        np.maximum.at(marks[1], place, np.sqrt(size[seen] / size[seen].max()))
    return marks


def contact_rows(
    contacts: npt.NDArray[Any], times: npt.NDArray[np.float64], dynamic: Sequence[bool], up: npt.NDArray[np.float64], longest: float
) -> npt.NDArray[np.float32]:
    """Return the contacts (k, 8) that a frame sees, sorted by their first frame; see `CONTACT_ROW`.

    Args:
        contacts: structured array of a recording, see `recording.contacts.CONTACT_DTYPE`.
        times: (f,) s, of the frames.
        dynamic: for each body whether it can be pushed.
        up: (3,) unit vector.
        longest: length of the longest arrow of an impact, m.

    """
    force = np.asarray(contacts["force"], dtype=np.float64).reshape(-1, 3)
    size = np.linalg.norm(force, axis=1)
    first, after = (np.searchsorted(times, contacts[key]) for key in ("start", "end"))
    pushed = np.asarray(dynamic, dtype=bool)
    on_a, on_b = pushed[contacts["body_a"]], pushed[contacts["body_b"]]
    seen = np.flatnonzero(np.isfinite(size) & (size > 0.0) & (first < after) & (on_a | on_b))
    if len(seen) > MOST_CONTACT_ROWS:
        seen = np.sort(seen[np.argsort(-size[seen], kind="stable")[:MOST_CONTACT_ROWS]])
    rows = np.zeros((len(seen), CONTACT_ROW))
    if len(seen):
        strongest = float(np.percentile(size[seen], STRONG))
        length = LONGEST_SHARE * longest * np.clip(np.sqrt(size[seen] / strongest), LEAST_LENGTH, 1.0)
        turned = np.where(on_a & on_b, force @ up < 0.0, on_a)[seen]
        rows[:, 0], rows[:, 1] = first[seen], after[seen]
        rows[:, 2:5] = contacts["point"][seen]
        rows[:, 5:8] = np.where(turned, -1.0, 1.0)[:, None] * force[seen] * (length / size[seen])[:, None]
    return rows[np.argsort(rows[:, 0], kind="stable")].astype(np.float32)


def energy_span(ledger: Any) -> float:
    """Return the least range of a plot of the ledger's energies, J: a change far below the energies themselves must not look like one."""
    return LEAST_SPAN * float(np.max(np.abs(ledger.kinetic) + np.abs(ledger.potential), initial=0.0))


def ledger_curves(ledger: Any) -> npt.NDArray[np.float32] | None:
    """Return (6, f): kinetic, potential and total energy [J], then momentum [kg m/s]; None without a ledger, or if it is not finite.

    The potential energy, whose zero means nothing, is measured from its least value.
    """
    if ledger is None:
        return None
    potential = ledger.potential - ledger.potential.min(initial=np.inf)
    curves = np.stack([ledger.kinetic, potential, ledger.kinetic + potential, *np.asarray(ledger.momentum).T])
    return curves.astype(np.float32) if np.isfinite(curves).all() else None
