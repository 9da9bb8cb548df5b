"""The rule of contact_solver = "cheapest": each island by the regime that takes less time, as far as its last steps tell.

Times are counted in parts of about 0.1 ms: from numbers of solves, pieces and looks, never by a clock, so that runs repeat to the last bit.

    exact       s e(m)          m bodies that touch, solved s times in a step, 1 time at least
                J s e(m)        where joints are: their events go through Python; less, F, where nothing touches them
    sub-steps   P p + L l       p pieces of the step, l looks at contacts in them, for all islands without joints together
                Q p             for each island with joints

with e(m) = (1 + m / 2)^1.5. The constants were fitted to scenes of the gallery and of the bench of 1 to 60 bodies. They are right to a
factor of two or so, which is enough: where the regimes cost about the same it does not matter which is taken.

Few bodies, without joints, of which neighbours have masses beyond RATIO : 1 stay exact at any cost. A ball of 300 times the mass of a ring
on which it fell pressed it 5 % of its size into the floor, or the island gained energy; the exact regime takes one to three times as long.

What sub-steps will cost is not known before they are taken: FIRST is expected. Where they turn out to cost more than WORSE times what the
exact regime did, fewer than FEW bodies are given back, and what was measured is expected from then on. It fades by FADING a step. So a
fast spinning top, which needs many pieces, stays exact, and a coin that rings down does not.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays

PIECE, LOOK, JOINTED_PIECE = 15.0, 2.5, 40.0
JOINTED_SOLVE, FLIGHT = 13.0, 4.0
FIRST, FIRST_JOINTED = PIECE + LOOK, JOINTED_PIECE
WORSE, FADING, FEW = 1.5, 0.98, 8
NOT_REFUSED, ALONE, CHEAP, SUBSTEPS_COST_MORE, UNLIKE = map(np.int64, range(5))
"""Why an island stays exact, or becomes so again."""
REASONS = ("", "alone", "the exact regime costs less", "sub-steps cost more", "mass ratio")
"""The same in words."""
APART, TOGETHER = -1, -2
"""What is refused by itself, and all islands without joints, which are stepped together; islands with joints go by their root."""


class Costs(NamedTuple):
    """What is known of the costs of both regimes, of n bodies, in parts of about 0.1 ms."""

    first: np.ndarray  # (n,) what sub-steps are expected to cost at first
    limit: np.ndarray  # (n,) what they are expected to cost now
    exact: np.ndarray  # (n,) what the exact regime took for the body's island when that began to be sub-stepped
    pieces: np.ndarray  # (n,) pieces of the last step that the body was stepped in
    looks: np.ndarray  # (n,) looks at contacts in them


class Near(NamedTuple):
    """What islands are near to, and made of, by the root of each of n bodies."""

    touches: np.ndarray  # (n,) bool, something is near
    unlike: np.ndarray  # (n,) bool, neighbours have masses beyond `regime.RATIO` : 1


@jit
def exact_cost(solves, size):
    """What an island costs the exact regime in a step: the solves of a body in the mean, and the bodies."""
    m = 1.0 + 0.5 * size
    return solves * m * sqrt(m)


@jit
def _judge_together(costs, root, cost, was_substepped, judged_with, which, reason):
    """Judge the islands (n,) whose `judged_with` is `which`: they are stepped together. Writes the reason of those that are refused."""
    inside, before, total, pieces, looks, limit, exact = 0, False, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(root.shape[0]):
        if judged_with[r] == which:
            total += cost[r]
    for i in range(root.shape[0]):
        r = root[i]
        if r < 0 or judged_with[r] != which:
            continue
        inside += 1
        limit = max(limit, costs.limit[i])
        if was_substepped[r]:
            before = True
            pieces, looks, exact = max(pieces, costs.pieces[i]), max(looks, costs.looks[i]), max(exact, costs.exact[i])
    spent = PIECE * pieces + LOOK * looks if which == TOGETHER else JOINTED_PIECE * pieces
    # What came to them since then would have cost the exact regime, too.
    saved = max(exact, total) if before else total
    stays = spent <= WORSE * saved or inside >= FEW if before else total > limit
    why = NOT_REFUSED if stays else SUBSTEPS_COST_MORE if before else CHEAP
    for i in range(root.shape[0]):
        r = root[i]
        if r < 0 or judged_with[r] != which:
            continue
        reason[r] = why
        if stays:
            costs.exact[i] = saved
        elif before:
            costs.limit[i] = spent


@jit_making_arrays
def judge_islands(costs, root, label, joined, near, solve_count, reason):
    """Write the reason (n,), by root, of islands that stay exact, or become so again; returns how many there are.

    root: (n,) of every body, -1 for those in no island. label: (n,) the sub-stepped island that a body was in, -1 for none.
    joined: (n,) bool. near: `Near`. solve_count: (n,) how often the exact solver dealt with each body in the last step.
    """
    number, refused, touches = root.shape[0], 0, near.touches
    size, judged_with, cost = np.zeros(number, np.int64), np.full(number, APART, np.int64), np.zeros(number)
    has_joints, was_substepped = np.zeros(number, np.bool_), np.zeros(number, np.bool_)
    for i in range(number):
        r = root[i]
        reason[i] = NOT_REFUSED
        if r >= 0:
            size[r] += 1
            cost[r] += solve_count[i]
            has_joints[r] = has_joints[r] or joined[i]
            was_substepped[r] = was_substepped[r] or label[i] >= 0
    for r in range(number):
        if size[r] > 0:
            factor = 1.0 if not has_joints[r] else JOINTED_SOLVE if touches[r] else FLIGHT
            cost[r] = factor * exact_cost(max(cost[r] / size[r], 1.0), size[r])
            stays = near.unlike[r] and size[r] < FEW
            judged_with[r] = r if has_joints[r] else TOGETHER if touches[r] and not stays else APART
            reason[r] = NOT_REFUSED if judged_with[r] != APART else UNLIKE if touches[r] else ALONE
    _judge_together(costs, root, cost, was_substepped, judged_with, TOGETHER, reason)
    for r in range(number):
        if judged_with[r] == r:
            _judge_together(costs, root, cost, was_substepped, judged_with, r, reason)
    for i in range(number):
        costs.pieces[i] = costs.looks[i] = 0.0
        costs.limit[i] = max(FADING * costs.limit[i], costs.first[i])
        refused += reason[i] != NOT_REFUSED
    return refused


class CheapestRegime:
    """What is known of the costs of both regimes, of n bodies.

    Attributes:
        costs: the same in numbers.

    """

    def __init__(self, joined: np.ndarray) -> None:
        """Nothing is known yet; joined (n,) bool: bodies with joints."""
        first, none = np.where(joined, FIRST_JOINTED, FIRST), np.zeros((3, len(joined)))
        self.costs = Costs(first, first.copy(), *none)
        self._reason = np.zeros(len(joined), np.int64)

    def carry_on(self, earlier: CheapestRegime, old: np.ndarray, new: np.ndarray) -> None:
        """Know of bodies `new` (k,) what is known there of `old` (k,)."""
        for mine, theirs in zip(self.costs[1:], earlier.costs[1:], strict=True):
            mine[new] = theirs[old]

    def note(self, members: np.ndarray, looks: int) -> None:
        """Members were stepped together over a piece of a step, with this number of looks at their contacts."""
        self.costs.pieces[members] += 1.0
        self.costs.looks[members] += looks

    def handed_over(self, members: np.ndarray, solves: float) -> None:
        """Members were handed to sub-steps in the middle of a step, when the exact regime had solved one that often."""
        self.costs.exact[members] = exact_cost.py_func(solves, len(members))

    def may_begin(self, solve_count: np.ndarray, moving: int, joined: np.ndarray) -> bool:
        """Whether any island may be worth sub-steps; moving: how many bodies can move, joined (n,) bool: have joints."""
        with_joints = FLIGHT if np.count_nonzero(joined) == 1 else JOINTED_SOLVE
        for bodies, factor in ((~joined, 1.0), (joined, with_joints)):
            size = min(moving, int(np.count_nonzero(bodies)))
            limit = self.costs.limit[bodies]
            if size and factor * exact_cost.py_func(max(float(solve_count[bodies].max()), 1.0), size) > float(limit.min()):
                return True
        return False

    def most_solves(self, moving: int, joined: np.ndarray) -> float:
        """How often the exact solver may deal with all bodies in a step before `may_begin` can say yes; 0 where it always can."""
        most = FIRST / float(exact_cost.py_func(1.0, moving))
        return 0.0 if joined.any() or most < 1.0 else most

    def refusals(
        self, root: np.ndarray, label: np.ndarray, joined: np.ndarray, near: Near, solve_count: np.ndarray
    ) -> dict[int, str]:
        """Why islands stay exact, or become so again, by their root; see `judge_islands`."""
        if not judge_islands(self.costs, root, label, joined, near, solve_count, self._reason):
            return {}
        return {r: REASONS[self._reason[r]] for r in np.flatnonzero(self._reason).tolist()}
