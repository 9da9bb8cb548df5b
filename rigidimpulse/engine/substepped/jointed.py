"""Sub-stepped islands with joints: contacts and joints are solved together, see `dynamics/solvers/time_stepping`.

An island with joints is stepped by itself, with all bodies that its joints and contacts connect. What it needs of bodies and contacts is
the stepper's (`contact_forces`): poses, contact table, and the balance of energy. Few bodies without joints are stepped so, too, where the
sub-steps of others do not find their forces: balls that a funnel wedges made 40 times the energy that they had.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.known_calls import MOST
from rigidimpulse.core.simd import ROW
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland
from rigidimpulse.dynamics.solvers.tgs_soft.energy_balance import MOST_TAKEN
from rigidimpulse.dynamics.solvers.time_stepping.solver import GAP, HALVED, Kept, step_island, stop_island
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import ContactStepper, Fineness, Outcome
from rigidimpulse.engine.substepped.given_impulses import log_given
from rigidimpulse.engine.substepped.island_step import compare_energies
from rigidimpulse.engine.substepped.trajectories import stray_of
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.waypoints import make_waypoints

SUB_STEPS, MOST_SUB_STEPS = 8, 64
"""Sub-steps of a whole step, at least, and at most for what turns fast. With 5 at "preview" a chain gained 0.4 % when its anchor struck."""
FINER = (1, 2, 4, 8)
"""In how many parts each sub-step is made, from try to try, where an island gained energy or joints stayed open. Light arms of a ragdoll
that whipped round after an impact gained 1.7e-3 of what moves in a step of 18 sub-steps."""
SPUN_UP = 2.0
"""Times as many sub-steps that bodies would need for how they turn at the end of a step, from which on it is stepped again with those. A
ball of 3.8 m/s that hit a link of a chain off its centre set it turning 36 times as fast, and entered it by 1 % of its size."""
MOST_WAYPOINTS = 256
"""Sub-steps of a step that frames may show; where more are made, because they were halved, those at its begin."""
BEND = 0.15
"""Skins by which the path of a point may bend in a sub-step, over 8 and over the square of `Accuracy.substep_motion`: contacts close along
straight lines, so bodies enter by as much."""
MOTION = 1.0
"""Parts of `Accuracy.substep_motion` that touching bodies move until their contacts are looked for again."""
GAINED: float = 1e-4
"""Part of what moves by which the energy of an island may rise in a step: what the method makes, it takes back; a whip makes ever more."""
CLOSED, OPEN = TOLERANCES.sub_stepping.joints_closed, TOLERANCES.sub_stepping.joints_open


class _Tried(NamedTuple):
    """A step that was tried."""

    joints: np.ndarray  # (k,) of the island
    moment: np.ndarray  # (j, 3) N s that joints gave
    given: np.ndarray  # (p, 10) what contacts gave, by pair
    outcome: Outcome


class JointedStepper:
    """Steps islands with joints, one by one.

    Attributes:
        halved: sub-steps that were halved, so far.

    """

    def __init__(self, run: Run, stepper: ContactStepper) -> None:
        """Bodies by rank; joints with the ranks of their bodies."""
        world, bodies, n = run.world, stepper.bodies, run.world.num_bodies
        self._stepper, self._world = stepper, world
        inv_mass = np.concatenate([world.inv_mass[stepper.order], np.zeros(1)])
        self._now = BodyState(
            bodies.position, bodies.orientation, np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), inv_mass, np.zeros((n + 1, 3, 3))
        )
        table, rank = world.joints, stepper.rank
        self._joints = table._replace(body_a=_by_rank(table.body_a, rank), body_b=_by_rank(table.body_b, rank))
        self._driven_joints = _driven(world)
        self._stiffening, self._column = np.zeros(n + 1), np.zeros(n + 1, np.int64)
        self._driven, self.halved = np.zeros(n + 1, bool), 0
        self._allowed, self._open = CLOSED * world.joint_size, OPEN * world.joint_size
        self._near, self._energies = np.zeros(n, bool), np.zeros(4)
        self._waypoints, self._no_waypoints = make_waypoints(MOST_WAYPOINTS, n), make_waypoints(0, n)
        # The same tuples for the same islands: calls of kernels are quicker by it.
        self._islands: dict[tuple[bytes, bytes], JointedIsland] = {}
        self._kept: dict[tuple[int, bool], Kept] = {}

    def step(self, run: Run, members: np.ndarray, span: tuple[float, float], set_up: Callable[[Fineness], None]) -> Outcome | None:
        """Step an island, whose bodies have joints, over a span (begin, end), s, as finely as it asks for; None if no sub-steps hold it.

        It is stepped again, more finely, where it was not held: joints stayed open, or bodies gained energy that nothing gave, or had much
        of it taken back. Light links between heavy bodies may whip. And it is stepped once more where a hit in it has set bodies turning.
        set_up: puts the members before the solver, to be stepped so finely.
        """
        before, stray, finer = self._stray(members, run.state.now.angular_velocity[members]), 0.0, iter(FINER)
        part = next(finer, None)
        while part is not None:
            set_up(self._fineness(max(before, stray), part))
            tried = self._try(run, *span)
            if tried is not None:
                if stray == 0.0 and (stray := self._spun_up(tried.outcome)) > 0.0:
                    continue
                # Without joints smaller sub-steps are no better: contacts are pushed apart the faster.
                free = not len(tried.joints) or self._driven[self._stepper.rank[self._stepper.members]].any()
                if free or self._keeps_energy(run, tried.outcome):
                    return self._keep(run, tried, span)
            part = next(finer, None)
        return None

    def _stray(self, members: np.ndarray, spin: np.ndarray) -> float:
        """How often in a second sub-steps must begin for members (k,) that turn so, (k, 3) rad/s, 1/s."""
        stepper, near = self._stepper, self._near
        allowed = BEND * self._world.accuracy.substep_motion**2
        return float(stray_of(members, spin, stepper.table.pairs, stepper.order, (stepper.reach, stepper.skin, allowed), near))

    def _fineness(self, stray: float, finer: int) -> Fineness:
        """How finely members are stepped; stray: how often sub-steps must begin, 1/s, finer: in how many parts each of them is made."""
        accuracy = self._world.accuracy
        pieces = min(max(stray * accuracy.step, SUB_STEPS), MOST_SUB_STEPS)
        return Fineness(accuracy.step / (pieces * finer), MOTION * accuracy.substep_motion)

    def _spun_up(self, out: Outcome) -> float:
        """How often in a second sub-steps must begin for how members turn at the end, 1/s; 0 if they began about as often."""
        # A part of wider rows would be another type.
        stray, step = self._stray(out.members, np.ascontiguousarray(out.velocity[:, 3:])), self._world.accuracy.step
        wanted = min(stray * step, MOST_SUB_STEPS)
        return stray if wanted * self._stepper.sub_step_length > SPUN_UP * step else 0.0

    def _try(self, run: Run, time: float, end: float) -> _Tried | None:
        """Step the island that is set up from `time` to `end`; None if joints stay open."""
        stepper, which = self._stepper, run.joints.at(self._stepper.members)
        island = self._island(run, which)
        kept = self._kept_from(stepper.begin_step(run, time, end))
        of_world = self._world.coefficients, stepper.balance
        stepper.step_by(run, lambda some, h: step_island(island, stepper.bodies, stepper.table.arrays, *of_world, kept, some, h))
        self.halved += int(kept.reached[HALVED])
        if not kept.reached[GAP] <= self._open:
            return None
        stop_island(island, stepper.bodies, stepper.table.arrays, *of_world, kept)
        return _Tried(which, kept.moment, kept.given, stepper.end_step(kept.waypoints if len(kept.waypoints.time) else None))

    def _kept_from(self, has_frames: bool) -> Kept:
        """What is kept from sub-step to sub-step, at the start of a step; has_frames: whether frames fall into it."""
        key = len(self._stepper.table.pairs.first), has_frames
        if key not in self._kept:
            if len(self._kept) == MOST:
                self._kept.clear()
            moment, given = np.zeros((len(self._joints.body_a), 3)), np.zeros((key[0], 10))
            waypoints = self._waypoints if has_frames else self._no_waypoints
            self._kept[key] = Kept(self._stiffening, moment, self._driven, np.zeros(1), given, np.zeros(3), waypoints)
        kept = self._kept[key]
        for array in (kept.moment, kept.before, kept.given, kept.reached, kept.waypoints.number):
            array[:] = 0
        return kept

    def _keep(self, run: Run, tried: _Tried, span: tuple[float, float]) -> Outcome:
        """Note what joints and contacts did in a step that is taken; returns its outcome."""
        stepper, (time, end) = self._stepper, span
        stepper.pressed[stepper.members] = True
        log_given(run, stepper, tried.given, span)
        if len(tried.joints):
            run.joints.note_sub_steps(tried.joints, tried.moment / (end - time), span)
        return tried.outcome

    def _island(self, run: Run, which: np.ndarray) -> JointedIsland:
        """The joints `which` and the bodies that are set up, at the start of the step."""
        stepper, now, world = self._stepper, self._now, self._world
        members = np.sort(stepper.rank[stepper.members])
        velocity = stepper.bodies.velocity.reshape(-1, ROW)
        now.velocity[:], now.angular_velocity[:] = velocity[:, :3], velocity[:, 3:6]
        # What is no member does not give way.
        now.inv_mass[:] = 0.0
        now.inv_mass[members] = world.inv_mass[stepper.order[members]]
        self._driven[:] = bool(world.moving.any()) or bool(self._driven_joints[which].any())
        key = which.tobytes(), members.tobytes()
        if key not in self._islands:
            if len(self._islands) == MOST:
                self._islands.clear()
            self._islands[key] = JointedIsland(
                self._joints, which, now, stepper.bodies.rotation, members, self._column, run.joints.memory, self._allowed
            )
        return self._islands[key]

    def _keeps_energy(self, run: Run, out: Outcome) -> bool:
        """Whether members have no more energy than before, up to GAINED of what moves and a rise by the margin; no if it is no number.

        They have not kept it either where the balance had to take more than MOST_TAKEN of what moves, and that rise.
        """
        energies, constants, members = self._energies, self._world.constants, out.members
        if self._world.force_tables:
            constants = constants._replace(steady_acceleration=run.acceleration)
        compare_energies(run.state.now, constants, members, (out.position, out.orientation, out.velocity), energies)
        before, after, moved_before, moves_after = energies.tolist()
        twisted = float(self._stepper.bodies.work[out.rank].sum())
        moves, gained = max(moved_before, moves_after), after - before - float(out.raised.sum()) - twisted
        rise = float(np.sum(constants.mass[members] * constants.steady_strength[members] * self._stepper.skin[members]))
        # Comparisons with what is no number are false.
        return gained <= GAINED * moves + rise and float(out.taken.sum()) <= MOST_TAKEN * moves + rise


def _by_rank(bodies: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Ranks of bodies (j,); the world stays -1."""
    return np.where(bodies >= 0, rank[bodies], -1)


def _driven(world: World) -> np.ndarray:
    """Which joints (j,) have springs, drives, or an end on a moving body that is not dynamic."""
    table = world.joints
    soft = np.add.reduceat(np.isfinite(table.stiffness).astype(np.int64), table.first[:-1]) > 0
    moving = [(ends >= 0) & world.moving[ends] for ends in (table.body_a, table.body_b)]
    return soft | moving[0] | moving[1]
