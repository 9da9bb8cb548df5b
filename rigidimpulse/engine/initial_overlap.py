"""Overlap at the start: found with FCL before the first frame, reported, and removed by moving bodies apart.

Bodies that merely touch do not overlap, but FCL's yes-or-no answer counts touching. Therefore a pair overlaps only if FCL says so, too,
when one body is moved by DEPTH of its size along each axis. Bodies that only touch are free in one of the six directions.

Each pair that overlaps demands to be taken apart in a direction n (`ways_out`): with c from a to b as given, displacements D must have

    n.(D_b - D_a) >= level - n.c

and the least ones that meet all demands are taken (`constraints.displacement`). Bodies do not turn, so jointed bodies move together.
Pairs that overlap then, but did not as given, demand to stay on their sides. This is repeated until no pair overlaps.

Velocities stay. The change of potential energy is in the ledger as "overlap". Pairs for which there is no space are reported and do not
collide in that run.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from rigidimpulse.core.portable import dot
from rigidimpulse.core.quaternion import rotate, to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.displacement import displacement_rows, sweep
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.engine.measure.depth import Posed
from rigidimpulse.engine.measure.overlap import MeasuredShapes
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.ways_out import DEPTH, EQUAL, Demand, WaysOut
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import begin

MAX_ROUNDS = 40
SOFTNESS = TOLERANCES.initial_overlap.softness
SURE = 1.0 + TOLERANCES.initial_overlap.surely_apart
SWEPT = 0.1
"""Part of the residual asked for that a sweep may change: what it changes after a demand is not in the residual of that one."""
STALLED = 5
"""Rounds without a smaller overlap after which the search gives up."""
SHALLOW = 0.5
"""Part of DEPTH by which one body may be behind a face of the other and is surely no deeper in it: along one of three axes a way of DEPTH
leads out of the face by more than half of that (1 / sqrt(3))."""
MOST_PLANES = 4
"""Demands that do not last of one pair: the last ones are kept."""


def resolve_overlaps(run: Run) -> None:
    """Report pairs that overlap by more than DEPTH of the smaller body's size where the run starts, and take them apart."""
    world = run.world
    if not world.can_collide:
        return
    search = _Search(run)
    search.add_demands()
    if not search.demands:
        return
    for demand in search.of_all_pairs():
        run.log.report(
            run.state.time, "overlap at the start", (world.names[demand.a], world.names[demand.b]),
            f"the bodies are inside each other by {search.way(demand):.4g} m; where there is space they are moved apart before the "
            "first step, without a change of velocity: move them apart in the scene to see no jump",
        )
    _take_apart(search)
    stuck = search.overlapping()
    for a, b in stuck:
        run.log.report(
            run.state.time, "overlap not resolved", (world.names[a], world.names[b]),
            "there is no space to move the bodies apart, or joints hold them: in this run they do not touch each other; "
            "give them space",
        )
    if stuck:
        keys = np.array([a * world.num_bodies + b for a, b in stuck])
        run.world = replace(world, apart=np.union1d(world.apart, keys))
    moved = search.position - world.position
    gained = -float(np.sum(np.where(world.dynamic, world.mass, 0.0)[:, None] * world.steady_acceleration * moved))
    # Frame 0 is the state as given: the ledger changes right after it.
    run.log.account(float(np.nextafter(run.state.time, np.inf)), "overlap", gained)


def _take_apart(search: _Search) -> None:
    """Move the bodies until no pair overlaps, or it does not get better any more."""
    least, stalled, number = np.inf, 0, 0
    for _ in range(MAX_ROUNDS):
        search.move_to(search.least_displacement())
        changed = search.add_demands()
        worst = max(search.way(d) / search.ways_out.size(d.a, d.b) for d in search.of_all_pairs())
        if not changed and worst <= 0.5 * search.world.contact_margin:
            return
        stalled = 0 if len(search.demands) > number or worst < 0.99 * least else stalled + 1
        least, number = min(least, worst), len(search.demands)
        if stalled == STALLED:
            return


class _Search:
    """Overlaps at the present positions.

    Attributes:
        position: (n, 3) m, centres of mass.
        demands: of each pair a < b that overlaps, or did so before it was moved apart: one that lasts, or some that do not.
        cluster: (n,) bodies that joints join have the same number. inv_mass: (k,) 1/kg of the clusters, 0 if one cannot move.

    """

    def __init__(self, run: Run) -> None:
        self.run = run
        self.world = run.world
        self.position = run.world.position.copy()
        self.demands: dict[tuple[int, int], list[Demand]] = {}
        self.cluster, self.inv_mass = _clusters(run.world)
        self._shapes, self._turn = MeasuredShapes(run.world), to_matrix(run.world.orientation)

    @cached_property
    def ways_out(self) -> WaysOut:
        """Made where two bodies are near each other."""
        return WaysOut(self.world)

    def of_all_pairs(self) -> list[Demand]:
        """All demands."""
        return [demand for demands in self.demands.values() for demand in demands]

    def way(self, demand: Demand) -> float:
        """The way that is left, m: negative if the bodies are farther apart than is asked, inf if none is known."""
        return demand.level - float(dot(demand.direction, self._beside(demand.a, demand.b)))

    def overlapping(self) -> list[tuple[int, int]]:
        """Pairs that overlap, in order."""
        return [(a, b) for a, b in self._near(only_deep=True) if self.ways_out.overlaps(a, b, self._beside(a, b))]

    def add_demands(self) -> bool:
        """Add demands of pairs that overlap: those that have none, and those whose demands do not last; returns whether there are any."""
        changed = False
        for (a, b), known in self.demands.items():
            if known[0].lasting:
                continue
            before, c = self._beside_as_given(a, b), self._beside(a, b)
            if not self.ways_out.meets(a, b, c):
                for demand in known:
                    # Where they are is allowed.
                    demand.level = min(demand.level, float(dot(demand.direction, c)))
                continue
            # A wedge has several planes.
            new, changed = self.ways_out.again(a, b, before, c, len(known)), True
            known[:] = [new] if new.lasting else [*known[-MOST_PLANES + 1 :], new]
        # At first they are where they were given: those count that are deep.
        for a, b in self._near(only_deep=np.array_equal(self.position, self.world.position)):
            if (a, b) in self.demands or not self.ways_out.meets(a, b, self._beside(a, b)):
                continue
            before, c = self._beside_as_given(a, b), self._beside(a, b)
            if not (np.array_equal(before, c) or self.ways_out.meets(a, b, before)):
                self.demands[a, b], changed = [self.ways_out.on_its_side(a, b, before, c)], True
            elif self.ways_out.is_deep(a, b, c):
                self.demands[a, b], changed = [self.ways_out.least(a, b, c)], True
        return changed

    def _beside(self, a: int, b: int) -> np.ndarray:
        """From a to b, (3,) m."""
        return self.position[b] - self.position[a]

    def _beside_as_given(self, a: int, b: int) -> np.ndarray:
        return self.world.position[b] - self.world.position[a]

    def _near(self, only_deep: bool) -> list[tuple[int, int]]:
        """Pairs that may overlap, in order; only_deep: without those that are surely inside each other by less than DEPTH of a size."""
        pair_events = PairEvents(self.run, self.run.state.time)
        pair_events.find_pairs()
        a, b = pair_events.pairs["a"], pair_events.pairs["b"]
        apart, shape = self._surely_apart(a, b), self.world.shape_of_body
        # A face of one in front of which all of the other is tells more than their spheres, and much sooner than FCL.
        for i, j in ((a, b), (b, a)):
            asked = np.flatnonzero(~apart)
            i, j = i[asked], j[asked]
            allowed = SHALLOW * DEPTH * np.minimum(self.world.size[i], self.world.size[j]) if only_deep else None
            apart[asked] = self._shapes.surely_apart(shape[i], shape[j], self._seen_from(i, j), allowed)
        return sorted(set(zip(a[~apart].tolist(), b[~apart].tolist(), strict=True)))

    def _seen_from(self, i: np.ndarray, j: np.ndarray) -> Posed:
        """Poses of bodies i (k,) in the frames of bodies j (k,)."""
        back = self._turn[j].swapaxes(1, 2)
        return Posed(back @ self._turn[i], (back @ (self.position[i] - self.position[j])[:, :, None])[:, :, 0])

    def _surely_apart(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs have bounding spheres apart, or one apart from the half space that is all of the other body."""
        world, geometry = self.world, self.world.geometry
        apart = np.linalg.norm(self.position[b] - self.position[a], axis=1) > SURE * (world.bound_radius[a] + world.bound_radius[b])
        first = geometry.shape_first[world.shape_of_body]
        plane = world.half_space & (geometry.shape_first[world.shape_of_body + 1] == first + 1)
        for half, other in ((a, b), (b, a)):
            which = np.flatnonzero(plane[half] & np.isfinite(world.bound_radius[other]))
            i, j = half[which], other[which]
            frame = geometry.frame[first[i]]
            height = (rotate(world.orientation[i], frame[:, :3]) * (self.position[j] - self.position[i])).sum(axis=1) - frame[:, 3]
            apart[which] |= height > SURE * world.bound_radius[j]
        return apart

    def least_displacement(self) -> np.ndarray:
        """D (n, 3) of all bodies from where they were given."""
        given = [d for d in self.of_all_pairs() if self.cluster[d.a] != self.cluster[d.b] and np.isfinite(d.level)]
        given = [d for d in given if self.inv_mass[self.cluster[d.a]] + self.inv_mass[self.cluster[d.b]] > 0.0]
        a, b = (np.array([getattr(d, side) for d in given], int) for side in "ab")
        n = np.array([d.direction for d in given]).reshape(-1, 3)
        asked = np.array([d.level for d in given]) - ((self.world.position[b] - self.world.position[a]) * n).sum(axis=1)
        first, second = self.cluster[a], self.cluster[b]
        rows = displacement_rows(self.inv_mass, (first, second), n, asked, SOFTNESS)
        # What was pushed before is nearly right; what softness took of it is asked for once more.
        rows.impulse[:] = [d.push for d in given]
        rows.bias[:] -= rows.softness * rows.impulse
        if len(given):
            target = EQUAL * min(self.ways_out.size(d.a, d.b) for d in given)
            sweep(rows, len(self.inv_mass), SWEPT * target)
            solve_newton(rows, len(self.inv_mass), target)
        for demand, push in zip(given, rows.impulse.tolist(), strict=True):
            demand.push = push
        shift = np.zeros((len(self.inv_mass), 3))
        np.add.at(shift, first, -rows.impulse[:, None] * n)
        np.add.at(shift, second, rows.impulse[:, None] * n)
        return (self.inv_mass[:, None] * shift)[self.cluster]

    def move_to(self, displacement: np.ndarray) -> None:
        """Put the bodies where they were given plus D (n, 3)."""
        trajectory, before = self.run.state.trajectory, self.position
        self.position = self.world.position + displacement
        for i in np.flatnonzero(np.any(self.position != before, axis=1)).tolist():
            trajectory.position[i] = self.position[i]
            begin(trajectory, i)


def _clusters(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Number of the cluster of each body (n,), and inverse masses of clusters (k,), 0 with a body or the world that cannot move."""
    number = np.arange(world.num_bodies)
    fixed = ~world.dynamic
    if world.joints_of_scene:
        for a, b in zip(world.joints.body_a.tolist(), world.joints.body_b.tolist(), strict=True):
            if a < 0 or b < 0:
                fixed[max(a, b)] = True
            elif fixed[a] != fixed[b] and not (world.dynamic[a] and world.dynamic[b]):
                fixed[[a, b]] = True
            else:
                number[number == number[b]] = number[a]
    _, cluster = np.unique(number, return_inverse=True)
    mass = np.bincount(cluster, np.where(world.dynamic, world.mass, 0.0))
    held = np.bincount(cluster, fixed) > 0
    return cluster, np.where(held, 0.0, 1.0 / np.where(held, 1.0, mass))
