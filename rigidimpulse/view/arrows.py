"""Impact arrows: what the page needs to draw the impulse of every impact.

An arrow starts at the point of contact and shows the impulse on a dynamic body: +j on b, -j on a; an impact of two
dynamic bodies has both. All arrows of a run have one scale, in m an N s, so that they add up as impulses do: the normal and the friction
part of an arrow are its sides. Weaker ones than that of `LEAST_LENGTH` are drawn alike, so that they can be seen and picked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

ROW = 12
"""Numbers of an arrow: time, point (3), direction (3), contact normal (3), length, number of its card (-1: none)."""
MOST_ROWS = 20_000
"""Arrows kept, the largest first: a page of a long stacking run would otherwise be mostly arrows."""
LEAST_LENGTH = 0.06
"""Shortest arrow, as a share of the longest."""
NO_CARD = np.zeros(0, np.int64)
"""No impact has a card."""
FADE = 0.4
"""How long an arrow is seen, s, unless the whole run is short."""
FADE_SHARE = 0.15
"""Longest time an arrow is seen, as a share of the run."""


def arrow_rows(
    impacts: npt.NDArray[Any], dynamic: Sequence[bool], longest: float, with_card: npt.NDArray[np.int64]
) -> npt.NDArray[np.float32]:
    """Return the arrows (k, 12) sorted by time.

    Args:
        impacts: structured array of a recording.
        dynamic: for each body whether it can be pushed.
        longest: length of the arrow of the largest impulse, m.
        with_card: rows of the impacts that have a card, in its order.

    """
    rows = impulse_rows(impacts, dynamic, with_card)
    if len(rows) > MOST_ROWS:
        rows = rows[np.sort(np.argsort(-rows[:, 10], kind="stable")[:MOST_ROWS])]
    rows[:, 10] = np.maximum(arrow_scale(impacts, longest) * rows[:, 10], LEAST_LENGTH * longest)
    return rows.astype(np.float32)


def impulse_rows(
    impacts: npt.NDArray[Any], dynamic: Sequence[bool], with_card: npt.NDArray[np.int64] = NO_CARD
) -> npt.NDArray[np.float64]:
    """Return all arrows (k, 12) sorted by time, with the size of their impulse [N s] in the place of a length; see `arrow_rows`."""
    impulse, size = _impulses(impacts), _sizes(impacts)
    card = np.full(len(impacts), -1)
    card[with_card] = np.arange(len(with_card))
    pushed = np.asarray(dynamic, dtype=bool)
    parts = []
    for sign, body in ((1.0, impacts["body_b"]), (-1.0, impacts["body_a"])):
        chosen = np.flatnonzero((size > 0.0) & pushed[body])
        rows = np.empty((len(chosen), ROW))
        rows[:, 0] = impacts["time"][chosen]
        rows[:, 1:4] = impacts["point"][chosen]
        rows[:, 4:7] = sign * impulse[chosen] / size[chosen, None]
        rows[:, 7:10] = impacts["normal"][chosen]
        rows[:, 10] = size[chosen]
        rows[:, 11] = card[chosen]
        parts.append(rows)
    rows = np.concatenate(parts)
    return rows[np.argsort(rows[:, 0], kind="stable")]


def arrow_scale(impacts: npt.NDArray[Any], longest: float) -> float:
    """Return the length of an arrow of 1 N s, m, where that of the largest impulse is `longest`; 0 where there is no impulse."""
    largest = float(_sizes(impacts).max(initial=0.0))
    return longest / largest if largest > 0.0 else 0.0


def _impulses(impacts: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return the impulses (k, 3) on the second bodies, N s."""
    along = np.asarray(impacts["impulse"], dtype=np.float64)[:, None] * impacts["normal"]
    return (along + impacts["tangent_impulse"]).reshape(-1, 3)


def _sizes(impacts: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return the sizes (k,) of the impulses, N s; 0 where they are not finite."""
    size = np.linalg.norm(_impulses(impacts), axis=1)
    return np.where(np.isfinite(size), size, 0.0)


def fade_time(duration: float) -> float:
    """Return how long an arrow is seen, s, in a run of `duration` s; never 0."""
    return min(FADE, FADE_SHARE * duration) if duration > 0.0 else FADE


def longest_arrow(action_radius: float, body_radius: float) -> float:
    """Return the length of the longest arrow, m: a few body sizes, but neither lost in the picture nor filling it."""
    return float(np.clip(3.0 * body_radius, 0.14 * action_radius, 0.42 * action_radius))
