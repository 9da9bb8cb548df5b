"""The rule of contact_solver = "cheapest": each island by the regime that takes less time, as far as its last steps tell.

Times are counted in parts of about 0.1 ms: from numbers of solves, pieces and looks, never by a clock, so that runs repeat to the last bit.

    exact       s e(m)          m bodies that touch, solved s times in a step, 1 time at least
                J s e(m)        where joints are: their events go through Python; less, F, where nothing touches them
    sub-steps   P p + L l       p pieces of the step, l looks at contacts in them, for all islands without joints together
                Q p             for each island with joints

with e(m) = (1 + m / 2)^1.5. The constants were fitted to scenes of the gallery and of the bench of 1 to 60 bodies. They are right to a
factor of two or so, which is enough: where the regimes cost about the same it does not matter which is taken.

What sub-steps will cost is not known before they are taken: FIRST is expected. Where they turn out to cost more than WORSE times what the
exact regime did, fewer than FEW bodies are given back, and what was measured is expected from then on. It fades by FADING a step. So a
fast spinning top, which needs many pieces, stays exact, and a coin that rings down does not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

PIECE, LOOK, JOINTED_PIECE = 15.0, 2.5, 40.0
JOINTED_SOLVE, FLIGHT = 13.0, 4.0
FIRST, FIRST_JOINTED = PIECE + LOOK, JOINTED_PIECE
WORSE, FADING, FEW = 1.5, 0.98, 8
CHEAP, SUBSTEPS_COST_MORE = "the exact regime costs less", "sub-steps cost more"


def exact_cost(solves: Any, size: Any) -> Any:
    """What islands cost the exact regime in a step: the solves of a body in the mean, and the bodies."""
    return solves * (1.0 + 0.5 * size) ** 1.5


class CheapestRegime:
    """What is known of the costs of both regimes, of n bodies."""

    def __init__(self, joined: np.ndarray) -> None:
        """Nothing is known yet; joined (n,) bool: bodies with joints."""
        self._first = np.where(joined, FIRST_JOINTED, FIRST)
        self._limit = self._first.copy()
        self._exact = np.zeros(len(joined))
        self._pieces, self._looks = np.zeros((2, len(joined)))

    def carry_on(self, earlier: CheapestRegime, old: np.ndarray, new: np.ndarray) -> None:
        """Know of bodies `new` (k,) what is known there of `old` (k,)."""
        for name in ("_limit", "_exact", "_pieces", "_looks"):
            getattr(self, name)[new] = getattr(earlier, name)[old]

    def note(self, members: np.ndarray, looks: int) -> None:
        """Members were stepped together over a piece of a step, with this number of looks at their contacts."""
        self._pieces[members] += 1.0
        self._looks[members] += looks

    def handed_over(self, members: np.ndarray, solves: float) -> None:
        """Members were handed to sub-steps in the middle of a step, when the exact regime had solved one that often."""
        self._exact[members] = exact_cost(solves, len(members))

    def may_begin(self, solve_count: np.ndarray, moving: int, joined: np.ndarray) -> bool:
        """Whether any island may be worth sub-steps; moving: how many bodies can move, joined (n,) bool: have joints."""
        with_joints = FLIGHT if np.count_nonzero(joined) == 1 else JOINTED_SOLVE
        for bodies, factor in ((~joined, 1.0), (joined, with_joints)):
            size = min(moving, int(np.count_nonzero(bodies)))
            if size and factor * exact_cost(max(float(solve_count[bodies].max()), 1.0), size) > float(self._limit[bodies].min()):
                return True
        return False

    def refusals(
        self, root: np.ndarray, was: np.ndarray, joined: np.ndarray, touches: np.ndarray, solve_count: np.ndarray
    ) -> dict[int, str]:
        """Why islands stay exact, or become so again, by their root.

        Args:
            root: (n,) of every body, -1 for those in no island. was: (n,) bool, members of sub-stepped islands. joined: (n,) bool.
            touches: (n,) bool by root. solve_count: (n,) how often the exact solver dealt with each body in the last step.

        """
        members = np.flatnonzero(root >= 0)
        size = np.bincount(root[members], minlength=len(root))
        solves = np.bincount(root[members], weights=solve_count[members], minlength=len(root)) / np.maximum(size, 1)
        has_joints, was_substepped = np.zeros((2, len(root)), bool)
        has_joints[root[members[joined[members]]]] = True
        was_substepped[root[members[was[members]]]] = True
        factor = np.where(has_joints, np.where(touches, JOINTED_SOLVE, FLIGHT), 1.0)
        cost = factor * exact_cost(np.maximum(solves, 1.0), size)
        out = dict.fromkeys(np.flatnonzero((size > 0) & ~touches & ~has_joints).tolist(), "alone")
        plain = (size > 0) & touches & ~has_joints
        for together in (plain, *(np.arange(len(root)) == r for r in np.flatnonzero((size > 0) & has_joints).tolist())):
            if together.any():
                out.update(self._refused(together, root, cost, was_substepped, bool(has_joints[together].any())))
        self._pieces[:] = self._looks[:] = 0.0
        self._limit = np.maximum(FADING * self._limit, self._first)
        return out

    def _refused(self, together: np.ndarray, root: np.ndarray, cost: np.ndarray, was: np.ndarray, jointed: bool) -> dict[int, str]:
        """The same for islands that are stepped together, (n,) bool by root."""
        inside = (root >= 0) & together[root]
        before = inside & was[root]
        if not before.any():
            total = float(cost[together].sum())
            if total <= float(self._limit[inside].max()):
                return dict.fromkeys(np.flatnonzero(together).tolist(), CHEAP)
            self._exact[inside] = total
            return {}
        pieces, looks = float(self._pieces[before].max()), float(self._looks[before].max())
        spent = JOINTED_PIECE * pieces if jointed else PIECE * pieces + LOOK * looks
        # What came to them since then would have cost the exact regime, too.
        saved = max(float(self._exact[before].max()), float(cost[together].sum()))
        if spent <= WORSE * saved or np.count_nonzero(inside) >= FEW:
            self._exact[inside] = saved
            return {}
        self._limit[inside] = spent
        return dict.fromkeys(np.flatnonzero(together).tolist(), SUBSTEPS_COST_MORE)
