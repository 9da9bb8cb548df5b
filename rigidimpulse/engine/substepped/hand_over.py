"""Exact islands that cost more than they advance, and are handed to sub-steps in the middle of a step.

It is counted how often the exact regime deals with each body in a step. An island of k bodies runs away where a count is above
`most_solves(k)`: it is sub-stepped from that instant on. So are bodies that no impulse keeps apart, at once. Not handed over are

    bodies that touch nothing and that no joint holds, however often stiff forces are evaluated on their way: that is not counted,
    islands in which much rebounds, or whose neighbours are too unlike in mass for sub-steps, until they are dealt with much more often,
    islands pressed by what has a path of its own: sub-steps would shoot out what is squeezed,
    bodies whose joints sub-steps did not close before.

The count of bodies that are looked at once and left to the exact regime is NEVER until the end of the step.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.engine.cheapest import CheapestRegime
from rigidimpulse.engine.exact.step_begin import begin_counts, make_counts
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.pair_table import NEVER, RUNAWAY, USED, most_solves
from rigidimpulse.engine.regime import ASK, REBOUND, most_solves_of_all, roll, unlike
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island
from rigidimpulse.model.world import World

MOST_REBOUNDS = 30000.0
"""Times in a step that bodies which rebound by more than REBOUND may be dealt with beyond RUNAWAY: about a second of the compiled loop."""
MOST_UNLIKE = 6000.0
"""The same for neighbours of unlike masses (`regime.unlike`), over the number of bodies of their island, since each time deals with all of
them: a load that presses a light tilted disc flat needs hundreds."""
FORCED = 5.0
"""Times in place of one that an island counts to be dealt with on which varying forces act: forces are evaluated outside of kernels."""
HANDED = "exact contact cost more than it advanced: sub-steps hold these bodies, which may sink in by a skin, 0.8 % of the inner radius"
ROLLING = "; they have no rolling and no spinning friction there"
"""What is added where those act."""


class HandOver:
    """How often the exact regime deals with n bodies, and which of them it hands over.

    Attributes:
        counts: how often the exact regime deals with the bodies.
        open: (n,) bool, bodies whose joints sub-steps did not close.
        cheapest: what judges by cost, with contact_solver="cheapest" only.

    """

    def __init__(self, world: World, jointed: np.ndarray, cheapest: CheapestRegime | None) -> None:
        """jointed (n,) bool: bodies with joints."""
        self._world, self._jointed, self.cheapest = world, jointed, cheapest
        self._auto = world.accuracy.contact_solver == "auto"
        self.open = np.zeros(world.num_bodies, bool)
        # Nothing is handed over where everything is sub-stepped.
        first, most = 0.0 if self._auto or cheapest else NEVER, most_solves_of_all(world) if self._auto else ASK
        if cheapest is not None:
            most = cheapest.most_solves(int(np.count_nonzero(world.dynamic)), jointed) or ASK
        self.counts = make_counts(world.num_bodies, first, most)
        self._handed: dict[tuple[str, ...], int] = {}

    @property
    def solve_count(self) -> np.ndarray:
        """How often the exact regime has dealt with each body in the step, (n,)."""
        return self.counts.solves

    def carry_on(self, earlier: HandOver, old: np.ndarray, new: np.ndarray) -> None:
        """Know of exact bodies `new` (k,) what an earlier run knew of them as `old` (k,)."""
        self.counts.mean[new], self.open[new] = earlier.counts.mean[old], earlier.open[old]
        if self.cheapest is not None and earlier.cheapest is not None:
            self.cheapest.carry_on(earlier.cheapest, old, new)

    def begin_step(self, end: float) -> np.ndarray:
        """Count from nought in the step that ends at `end`; returns the counts (n,) before, by which its islands are judged."""
        last = np.maximum(self.solve_count, 0.0)
        if end > self.counts.step_end[0]:
            begin_counts(self.counts, end)
        # One step with many events is no reason to leave the exact regime with a mechanism: it stays out of it for long.
        return np.where(self._jointed & self._auto, self.counts.mean, last)

    def may_take(self, bodies: np.ndarray) -> bool:
        """Whether islands of bodies that no impulse keeps apart are handed over; they are, when they are looked at next."""
        mine = bodies[self._world.dynamic[bodies]]
        if np.any(self.solve_count[mine] == NEVER) or self.open[mine].any():
            return False
        self.solve_count[mine] = np.inf
        return True

    def count(self, islands: list[Island]) -> None:
        """Count that the exact regime deals with these islands; not with bodies that fly under varying forces, which touch nothing."""
        for island in islands:
            if len(island.place) or len(island.joints):
                self.solve_count[island.members] += 1.0

    def runs_away(self, run: Run, island: Island) -> bool:
        """Whether a member was dealt with more often than the island is worth; sub-steps have nothing to hold where nothing touches."""
        if not len(island.place) and not len(island.joints):
            return False
        weight = FORCED if run.forces.acts[island.members].any() else 1.0
        return bool(np.any(weight * self.solve_count[island.members] > most_solves.py_func(len(island.members))))

    def hands_over(self, run: Run, pair_events: PairEvents, island: Island) -> bool:
        """Whether an exact island that runs away is sub-stepped from its instant on; then it is said so."""
        members, rebound = island.members, float(island.contacts.restitution.max(initial=0.0))
        stuck, pressed = bool(np.isposinf(self.solve_count[members]).any()), bool(pair_events.pressed()[members].any())
        # Many impacts are what some scenes are about. Where joints are, each takes a thousand times as long.
        spared = self.cheapest is None and not stuck and not self._jointed[members].any() and not self.counts.spared[members].all()
        more = MOST_REBOUNDS if rebound > REBOUND else MOST_UNLIKE / len(members) if self._is_unlike(pair_events, members) else 0.0
        if spared and more > 0.0:
            self.counts.spared[members], self.solve_count[members] = True, -more
            return False
        if pressed or self.open[members].any():
            # Looked at, and left to the exact regime until the end of the step.
            self.solve_count[members] = NEVER
            if pressed and stuck:
                pair_events.report_squeezed(island)
            return False
        self.solve_count[members] = 0.0
        if self.cheapest is not None:
            self.cheapest.handed_over(members, RUNAWAY)
        names = tuple(run.world.names[i] for i in members.tolist())
        if names not in self._handed:
            run.log.note(island.time, "handed to sub-steps", names, HANDED + ROLLING * self._rolls(island))
        self._handed[names] = self._handed.get(names, 0) + 1
        return True

    def _rolls(self, island: Island) -> bool:
        """Whether rolling or spinning friction acts between members."""
        return self._world.rolling.size > 0 and bool(roll(self._world, island.contacts.body_a, island.contacts.body_b).any())

    def _is_unlike(self, pair_events: PairEvents, members: np.ndarray) -> bool:
        """Whether members met something in this step that is too unlike them in mass for sub-steps."""
        pairs = pair_events.table.pairs[: pair_events.table.number[USED]]
        a, b = pairs["a"], pairs["b"]
        met = (np.isin(a, members) | np.isin(b, members)) & (self.solve_count[a] != 0.0) & (self.solve_count[b] != 0.0)
        return bool(unlike(self._world, a[met], b[met]).any())

    def lost(self, pair_events: PairEvents, islands: list[Island], exact: np.ndarray) -> np.ndarray:
        """Exact bodies, (n,) bool, that no impulse keeps apart and whose contacts the exact regime does not see: they are handed over."""
        lost = np.flatnonzero(np.isposinf(self.solve_count) & exact)
        if not len(lost):
            return lost
        for island in islands:
            lost = np.setdiff1d(lost, island.members)
        self.solve_count[lost] = NEVER
        return lost[~pair_events.pressed()[lost]]

    def leave(self, members: np.ndarray) -> None:
        """Leave members, whose joints no sub-steps close, to the exact regime until the end of the run."""
        self.open[members] = True
        self.solve_count[members] = NEVER

    def times_handed_over(self) -> int:
        """How often islands were handed over in the run."""
        return sum(self._handed.values())
