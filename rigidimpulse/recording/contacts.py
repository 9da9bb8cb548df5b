"""Contact forces of a run, as stretches of time over which each is constant.

The force of a lasting contact is constant over a sub-step, and over all the time that bodies rest. So it is kept once, with its first and
last instant, however many frames there are.
"""

from __future__ import annotations

import numpy as np

CONTACT_DTYPE = np.dtype(
    [
        ("start", np.float64),
        ("end", np.float64),
        ("body_a", np.int64),
        ("body_b", np.int64),
        ("point", np.float64, (3,)),
        ("normal", np.float64, (3,)),
        ("force", np.float64, (3,)),
    ]
)
"""One row a contact that bears load, start <= t < end: s, s (inf: to the end of the run), indices, m, unit (a to b), N on b."""


def forces_on(contacts: np.ndarray, body: int, times: np.ndarray) -> np.ndarray:
    """Sum of the contact forces on a body at the frame times, (f, 3) N."""
    total = np.zeros((len(times), 3))
    for side, sign in (("body_b", 1.0), ("body_a", -1.0)):
        mine = contacts[contacts[side] == body]
        first = np.searchsorted(times, mine["start"])
        count = np.searchsorted(times, mine["end"]) - first
        frames = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        for k in range(3):
            total[:, k] += sign * np.bincount(frames, np.repeat(mine["force"][:, k], count), len(times))
    return total
