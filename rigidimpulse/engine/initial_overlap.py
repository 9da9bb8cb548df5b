"""Overlap at the start: found with FCL before the first frame, reported, and removed by moving bodies apart.

Bodies that merely touch do not overlap, but FCL's yes-or-no answer counts touching. Therefore a pair overlaps only if FCL says so, too,
when one body is moved by DEPTH of its size along each axis. Bodies that only touch are free in one of the six directions.

The depth of a pair is the least displacement s of b along a direction n after which the gap is that of lasting contacts. These
directions are tried: the line of the centres and the principal axes of both bodies. From the best of them the search descends: it takes
the normal where the bodies then touch, as long as that is better (expanding polytopes, van den Bergen 2001). Of equally good directions
the one nearest to the line of the centres is taken, else the first axis of a. Then

    min sum of m |D|^2 / 2    with    n.(D_b - D_a) >= s   for all pairs that overlap, or did so after an earlier round

gives the displacements D of all bodies. This is repeated until no pair overlaps. Bodies do not turn, so jointed bodies move together.
Velocities stay. The change of potential energy is in the ledger as "overlap". Pairs for which there is no space are reported and do not
collide in that run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rigidimpulse.collision.distance.fcl import Narrowphase, Separation
from rigidimpulse.core.quaternion import rotate, to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.rows import BOUNDED, Rows, make_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import begin

DEPTH = TOLERANCES.initial_overlap.depth
DIRECTIONS = np.vstack([np.eye(3), -np.eye(3)])
MAX_ROUNDS = 40
MAX_APPROACHES = 40
MAX_DESCENTS = 4
EQUAL = TOLERANCES.initial_overlap.equal_ways
SOFTNESS = TOLERANCES.initial_overlap.softness
SURE = 1.0 + TOLERANCES.initial_overlap.surely_apart
STALLED = 5
"""Rounds without a smaller overlap after which the search gives up."""


@dataclass
class _Demand:
    """Pair a < b with the direction (3,) from a to b in which it is taken apart, and the way that is left, m."""

    a: int
    b: int
    direction: np.ndarray
    way: float


def resolve_overlaps(run: Run) -> None:
    """Report pairs that overlap by more than DEPTH of the smaller body's size where the run starts, and take them apart."""
    world = run.world
    if not world.can_collide:
        return
    search = _Search(run)
    demands = search.new_demands({})
    if not demands:
        return
    for demand in demands.values():
        run.log.report(
            run.state.time, "overlap at the start", (world.names[demand.a], world.names[demand.b]),
            f"the bodies are inside each other by {demand.way:.4g} m; where there is space they are moved apart before the "
            "first step, without a change of velocity: move them apart in the scene to see no jump",
        )
    _take_apart(search, demands)
    stuck = sorted(search.overlapping())
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


def _take_apart(search: _Search, demands: dict[tuple[int, int], _Demand]) -> None:
    """Move the bodies until no pair overlaps, or it does not get better any more."""
    least, stalled = np.inf, 0
    for _ in range(MAX_ROUNDS):
        search.move_to(search.least_displacement(demands))
        for demand in demands.values():
            search.measure(demand)
        fresh = search.new_demands(demands)
        worst = max(d.way / search.size(d.a, d.b) for d in (*demands.values(), *fresh.values()))
        if not fresh and worst <= 0.5 * search.world.contact_margin:
            return
        stalled = 0 if fresh or worst < 0.99 * least else stalled + 1
        least = min(least, worst)
        if stalled == STALLED:
            return
        demands.update(fresh)


class _Search:
    """Overlaps at the present positions.

    Attributes:
        position: (n, 3) m, centres of mass.
        cluster: (n,) bodies that joints join have the same number. inv_mass: (k,) 1/kg of the clusters, 0 if one cannot move.

    """

    def __init__(self, run: Run) -> None:
        self.run = run
        self.world = run.world
        self.position = run.world.position.copy()
        self.narrowphase = Narrowphase(run.world.shapes, run.world.geometry)
        self.cluster, self.inv_mass = _clusters(run.world)

    def size(self, a: int, b: int) -> float:
        """Size of the smaller body of a pair, m."""
        return float(min(self.world.size[a], self.world.size[b]))

    def separation(self, a: int, b: int, shift: np.ndarray) -> Separation:
        """Separation of a pair whose b is shifted, (3,) m."""
        world = self.world
        return self.narrowphase.separation(
            int(world.shape_of_body[a]), (self.position[a], world.orientation[a]),
            int(world.shape_of_body[b]), (self.position[b] + shift, world.orientation[b]),
        )

    def overlapping(self) -> set[tuple[int, int]]:
        """Pairs that overlap."""
        pair_events = PairEvents(self.run, self.run.state.time)
        pair_events.find_pairs()
        a, b = pair_events.pairs["a"], pair_events.pairs["b"]
        near = ~self._surely_apart(a, b)
        pairs = zip(a[near].tolist(), b[near].tolist(), strict=True)
        return {pair for pair in pairs if self._overlaps(*pair)}

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

    def _overlaps(self, a: int, b: int) -> bool:
        world = self.world
        shape_a, shape_b = int(world.shape_of_body[a]), int(world.shape_of_body[b])
        pose_a, moved = (self.position[a], world.orientation[a]), DEPTH * self.size(a, b)
        return all(
            self.narrowphase.overlap(shape_a, pose_a, shape_b, (self.position[b] + moved * d, world.orientation[b]))
            for d in np.vstack([np.zeros(3), DIRECTIONS])
        )

    def new_demands(self, known: dict[tuple[int, int], _Demand]) -> dict[tuple[int, int], _Demand]:
        """Demands of the overlapping pairs that have none yet."""
        return {pair: self._demand(*pair) for pair in sorted(self.overlapping() - set(known))}

    def measure(self, demand: _Demand) -> None:
        """Bring the way of a demand up to date; negative if the bodies are apart, inf if it cannot be found."""
        a, b = demand.a, demand.b
        if self._is_endless(a, b):
            found = self.separation(a, b, np.zeros(3))
            known = bool(np.all(np.isfinite(found.normal)))
            demand.direction = found.normal if known else np.zeros(3)
            demand.way = self._contact_margin(a, b) - found.gap if known else np.inf
        elif np.any(demand.direction):
            demand.way = self._way(a, b, demand.direction)

    def _is_endless(self, a: int, b: int) -> bool:
        """Whether a pair has a half space, which knows its depth and has no far side to come from."""
        return not np.isfinite(self.world.bound_radius[a] + self.world.bound_radius[b])

    def _contact_margin(self, a: int, b: int) -> float:
        return self.world.contact_margin * self.size(a, b)

    def _demand(self, a: int, b: int) -> _Demand:
        """The least way out of an overlap."""
        demand = _Demand(a, b, np.zeros(3), np.inf)
        if self._is_endless(a, b):
            self.measure(demand)
            return demand
        apart, equal = self.position[b] - self.position[a], EQUAL * self.size(a, b)
        best, nearest = np.inf, 0.0
        for n in self._directions(a, b, apart):
            way, along = self._way(a, b, n), float(n @ apart)
            if way < best - equal or (way <= best + equal and along > nearest + equal):
                best, nearest, demand.direction = way, along, n
        for _ in range(MAX_DESCENTS):
            n = self.separation(a, b, (best + equal) * demand.direction).normal
            way = self._way(a, b, n) if np.all(np.isfinite(n)) else np.inf
            if not way < best - equal:
                break
            best, demand.direction = way, n
        demand.way = best
        return demand

    def _directions(self, a: int, b: int, apart: np.ndarray) -> list[np.ndarray]:
        """Directions to try: of the centres, which is enough for two balls, and of the axes of both bodies."""
        distance = float(np.linalg.norm(apart))
        directions = [apart / distance] if distance > EQUAL * self.size(a, b) else []
        if directions and self.world.ball[a] and self.world.ball[b]:
            return directions
        for i in (a, b):
            axes = to_matrix(self.world.orientation[i]).T
            directions += [*axes, *-axes]
        return directions

    def _way(self, a: int, b: int, n: np.ndarray) -> float:
        """How far b has to move along n from where it is until it is apart from a; inf where that cannot be found."""
        reach = float(self.world.bound_radius[a] + self.world.bound_radius[b])
        way, gap = reach - float(n @ (self.position[b] - self.position[a])), self._contact_margin(a, b)
        free, careful = np.inf, False
        for _ in range(MAX_APPROACHES):
            found = self.separation(a, b, way * n)
            left = found.gap - gap
            if not np.all(np.isfinite(found.normal)):
                # One step too far, which a concave body does not forgive: the gap itself is always safe.
                way, careful = free, True
                if not np.isfinite(way):
                    return np.inf
                continue
            free = way
            rate = float(n @ found.normal)
            # Along a surface that is nearly parallel to n the rate tells nothing: steps of 1e10 m came of it.
            way -= left if careful or abs(left) >= 2.0 * reach * rate else left / rate
            if abs(left) <= 0.1 * gap:
                break
        return way

    def least_displacement(self, demands: dict[tuple[int, int], _Demand]) -> np.ndarray:
        """D (n, 3) of all bodies from where they were given."""
        given = [d for d in demands.values() if self.cluster[d.a] != self.cluster[d.b] and np.isfinite(d.way)]
        given = [d for d in given if self.inv_mass[self.cluster[d.a]] + self.inv_mass[self.cluster[d.b]] > 0.0]
        moved = self.position - self.world.position
        first, second = (self.cluster[[getattr(d, side) for d in given]] for side in "ab")
        n = np.array([d.direction for d in given]).reshape(-1, 3)
        # Ways are left from the present positions, displacements count from the given ones.
        asked = np.array([d.way + d.direction @ (moved[d.b] - moved[d.a]) for d in given])
        rows = displacement_rows(self.inv_mass, (first, second), n, asked, SOFTNESS)
        if len(given):
            solve_newton(rows, len(self.inv_mass), EQUAL * min(self.size(d.a, d.b) for d in given))
        shift = np.zeros((len(self.inv_mass), 3))
        np.add.at(shift, first, -rows.impulse[:, None] * n)
        np.add.at(shift, second, rows.impulse[:, None] * n)
        return (self.inv_mass[:, None] * shift)[self.cluster]

    def move_to(self, displacement: np.ndarray) -> None:
        """Put the bodies where they were given plus D (n, 3)."""
        trajectory = self.run.state.trajectory
        self.position = self.world.position + displacement
        for i in np.flatnonzero(np.any(trajectory.position != self.position, axis=1)).tolist():
            trajectory.position[i] = self.position[i]
            begin(trajectory, i)


def displacement_rows(
    inv_mass: np.ndarray, pair: tuple[np.ndarray, np.ndarray], n: np.ndarray, asked: np.ndarray, softness: float
) -> Rows:
    """Rows of n.(D_b - D_a) >= asked, of which the solution makes the sum of m |D|^2 / 2 least.

    inv_mass (k,) 1/kg, 0 for what cannot move; pair: a and b (r,) of each row; n (r, 3); asked (r,) m; softness: relative.
    """
    (first, second), root, rows = pair, np.sqrt(inv_mass), make_rows.py_func(len(asked))
    rows.first[:], rows.second[:] = np.where(root[first] > 0.0, first, -1), np.where(root[second] > 0.0, second, -1)
    # In coordinates scaled by the root of the mass.
    rows.jacobian[:, :3], rows.jacobian[:, 6:9] = -root[first, None] * n, root[second, None] * n
    rows.kind[:], rows.lower[:], rows.bias[:] = BOUNDED, 0.0, -asked
    rows.softness[:] = softness * (inv_mass[first] + inv_mass[second])
    return rows


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
