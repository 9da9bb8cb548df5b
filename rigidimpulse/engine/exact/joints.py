"""Joints in a run: what they remember, what they do when an island arrives, and how they hold it (see
`dynamics/constraints/joint_sub_step.py`)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.portable import dot, length
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.contact import ContactProblem
from rigidimpulse.dynamics.constraints.joint_impact import JointBlock, impact_rows, stop_at_limits
from rigidimpulse.dynamics.constraints.joint_limits import limit_side, next_switch
from rigidimpulse.dynamics.constraints.joint_sub_step import close_joints, fill_closing_rows, hold_jointed, stop_joints
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland, make_memory
from rigidimpulse.dynamics.constraints.rolling_friction import Rolling
from rigidimpulse.dynamics.constraints.rows import make_rows
from rigidimpulse.dynamics.energy import kinetic_energy, mechanical_energy
from rigidimpulse.engine.exact.trajectories import account_contact_work, work_of_forces
from rigidimpulse.engine.islands import is_alone
from rigidimpulse.engine.loads import load_over
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.model.island import Island, island_without_contacts
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring_all, refresh_pose
from rigidimpulse.motion.trajectory import FIXED
from rigidimpulse.recording.joint_log import JointLog
from rigidimpulse.scene.fastening import fastening
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.joint_coordinates import DISTANCE, RADIUS

if TYPE_CHECKING:
    from rigidimpulse.engine.flight_forces import FlightForces

BEYOND = TOLERANCES.sub_stepping.joints_open
"""By how much joints may be beyond a limit at the start, of the size of what they join, until that is reported."""
TURN = 0.02
"""rad, how far the bodies of a joint may turn against each other in a sub-step."""
SWAY = 0.7
"""rad, how far the fastest oscillation may go in a sub-step that the tension of joints keeps up across them; 2 is unstable."""
NOT_CLOSED = 1e3
"""How many times farther than allowed joints may be off before that is reported."""
MOST_SUB_STEPS, MOST_SWAYS, MOST_SWINGS = 4096, 256, 16
"""Sub-steps in a step, and those that bounds of rates may ask for while energy is kept: light links between heavy bodies mostly stand, and
what only swings about a fixed point has a far lower rate than its bound."""
DRIFT = TOLERANCES.joint.energy_drift
SHORT = TOLERANCES.joint.short_sub_step
CENTRED: float = 1e-6
"""Arm of a joint, over the length of its rod or string, up to which the body hangs at its centre."""
HALF = 0.5
"""Part of the forces of RATTLE's sub-steps that their end leaves."""
SURGE = 2.0
"""By how much forces that vary may grow while nobody looks at what they move."""
LANDING: float = 1e-9
"""Part of a flight by which it may miss the time at which a limit is reached."""
MOST_HALVED = 5
"""Times that a sub-step is halved whose joints do not close."""
MOST_CUTS = 20
"""Times a sub-step is cut to end where a limit is reached or lets go."""
STEEP = 1e3
"""Torque of a twist over that about a fixed axis, above which it counts as undefined: half a turn of swing, less 2e-3 rad."""


class JointState:
    """The joints of a run.

    Attributes:
        table: the rows of all joints. memory: what kernels remember.
        names: of the joints. whole: (j,) bool, not broken.
        moment: (j, 3) N s, impulse on b at the instant being worked on. shock: (j, 3) N s, by impacts, so far.
        pull: (j, 3) N, last force on b, and pull_rate (j, 3) N/s, its change. share: (j,) part of it that the end leaves.
        are_closed: whether the forces found last close the joints.
        drift: (j,) energy gained or lost in the last sub-step without contacts, as a part of the kinetic energy.
        flights: of islands that nothing touches. lands: (j,) s, end of the present flight, nan if it is none.
        began: (j,) s, start of the present sub-step. length: (j,) s, that of the one before.
        log: impulses on b, and forces on it at the ends of sub-steps.

    """

    def __init__(self, world: World, times: np.ndarray) -> None:
        """All joints whole and without load; times: (f,) s of the frames."""
        joints: list[Joint] = world.joints_of_scene
        self.table = world.joints
        self.memory = make_memory(world.joints, world.inertia)
        self.names = [joint.name or f"joint{j}" for j, joint in enumerate(joints)]
        self.break_force = np.array([joint.break_force for joint in joints])
        self.release_time = np.array([joint.release_time for joint in joints])
        self.whole = np.ones(len(joints), bool)
        self.moment = np.zeros((len(joints), 3))
        self.shock = np.zeros((len(joints), 3))
        self._accounted_shock = np.zeros((len(joints), 3))
        self.pull, self.pull_rate = np.zeros((2, len(joints), 3))
        self.share = np.full(len(joints), HALF)
        from rigidimpulse.engine.exact.joint_flights import JointFlights  # scipy's integrators come with it

        self.flights = JointFlights(world, self.table)
        self.lands = np.full(len(joints), np.nan)
        self.are_closed, self._open_by = True, 0.0
        self.drift = np.zeros(len(joints))
        self._energy = np.full(len(joints), np.nan)
        self.began = np.zeros(len(joints))
        self.length = np.zeros(len(joints))
        self.log = JointLog(times, self.names, np.column_stack([self.table.body_a, self.table.body_b]))
        self._allowed = TOLERANCES.joint.closed * world.joint_size
        self._joint_of_row = np.repeat(np.arange(len(joints)), np.diff(self.table.first))
        held = (self.table.coordinate < RADIUS) & np.isinf(self.table.stiffness) & np.isinf(self.table.lower) & np.isinf(self.table.upper)
        movable = [(i >= 0) & world.dynamic[i] for i in (self.table.body_a, self.table.body_b)]
        held_along = np.bincount(self._joint_of_row[held], minlength=len(joints))
        self._passive = np.bincount(self._joint_of_row[np.isfinite(self.table.stiffness)], minlength=len(joints)) == 0
        self._pins = (held_along == 3) & ~(movable[0] & movable[1])
        self._slides = (held_along == 1) | (held_along == 2)
        rods = np.where(self.table.coordinate == DISTANCE, self.table.target, 0.0)
        self._rod = np.zeros(len(joints))
        np.maximum.at(self._rod, self._joint_of_row, rods)
        self._arm = np.array([np.linalg.norm(anchor, axis=1) for anchor in (self.table.anchor_a, self.table.anchor_b)])
        self._least_inertia = world.inertia.min(axis=1)
        limits = self._joint_of_row[(self.table.lower == 0.0) != (self.table.upper == 0.0)]
        self._has_limit = np.bincount(limits, minlength=len(joints)) > 0
        self._limited = bool(self._has_limit.any())
        self._dynamic = world.dynamic
        self._of_body: dict[int, list[int]] = {}
        for j, pair in enumerate(zip(self.table.body_a.tolist(), self.table.body_b.tolist(), strict=True)):
            for i in pair:
                if i >= 0 and world.dynamic[i]:
                    self._of_body.setdefault(i, []).append(j)

    def carry_on(self, run: Run, earlier: Run) -> None:
        """Begin at the time of the run: turns of joints that an earlier run has, too, are counted on, and those that broke stay broken.

        They are the same joints if they are fastened at the same places; motors, limits and the like may be others.
        """
        self.began[:] = run.state.time
        before = earlier.joints
        if not isinstance(before, JointState):
            return
        known = {fastening(joint): k for k, joint in enumerate(earlier.world.joints_of_scene)}
        for j, joint in enumerate(run.world.joints_of_scene):
            k = known.get(fastening(joint))
            if k is None:
                continue
            self.whole[j] = before.whole[k]
            others = range(before.table.first[k], before.table.first[k + 1])
            angle = {int(before.table.coordinate[row]): float(before.memory.angle[row]) for row in others}
            for row in range(self.table.first[j], self.table.first[j + 1]):
                self.memory.angle[row] = angle.get(int(self.table.coordinate[row]), 0.0)

    def at(self, bodies: np.ndarray) -> np.ndarray:
        """Whole joints at any of the given dynamic bodies, in order."""
        asked = np.zeros(len(self._dynamic) + 1, bool)
        asked[bodies] = self._dynamic[bodies]
        # The world, -1, is asked for last.
        return np.flatnonzero(self.whole & (asked[self.table.body_a] | asked[self.table.body_b]))

    def links(self) -> np.ndarray:
        """Bodies (l, 2) that whole joints join."""
        both = np.column_stack([self.table.body_a, self.table.body_b])
        return both[self.whole & np.all(both >= 0, axis=1)]

    def joined(self) -> np.ndarray:
        """Dynamic bodies (n,) bool at whole joints."""
        mark = np.zeros(len(self._dynamic), bool)
        for ends in (self.table.body_a[self.whole], self.table.body_b[self.whole]):
            mark[ends[ends >= 0]] = True
        return mark & self._dynamic

    def movable_end(self, joint: int) -> int:
        """A dynamic body of a joint."""
        a, b = int(self.table.body_a[joint]), int(self.table.body_b[joint])
        return a if a >= 0 and self._dynamic[a] else b

    def bodies_of(self, joints: np.ndarray) -> np.ndarray:
        """Bodies of the joints, without the world."""
        both = {*self.table.body_a[joints].tolist(), *self.table.body_b[joints].tolist()}
        return np.array(sorted(both - {-1}), np.int64)

    def are_passive(self, which: np.ndarray) -> bool:
        """Whether joints are neither driven nor springs."""
        return bool(self._passive[which].all())

    def supports_of(self, which: np.ndarray) -> np.ndarray:
        """Ends of the joints that are not dynamic, in order, -1 for the world."""
        both = {*self.table.body_a[which].tolist(), *self.table.body_b[which].tolist()}
        ends = np.array(sorted(both), np.int64)
        return ends[(ends < 0) | ~self._dynamic[ends]]

    def moving_bodies(self, run: Run) -> np.ndarray:
        """Dynamic bodies with joints that do not rest."""
        bodies = np.array(sorted(self._of_body), np.int64)
        return bodies[run.state.trajectory.mode[bodies] != FIXED]

    def will_let_go(self, which: np.ndarray) -> bool:
        """Whether a joint has a time at which it lets go."""
        return bool(np.isfinite(self.release_time[which]).any())

    def project_velocities(self, run: Run, island: Island) -> None:
        """End the island's sub-steps: take half of the forces back, close what drifted, stop the joints."""
        state, now, memory = run.state, run.state.now, self.memory
        members, which = island.members, island.joints
        elapsed = np.zeros(len(self.whole))
        # Sub-steps of the other regime are noted up to their end, and may be cut short.
        elapsed[which] = np.maximum(island.time - self.began[which], 0.0)
        self.moment[which] = 0.0
        if len(which) and np.all(np.abs(self.lands[which] - island.time) <= 4.0 * np.spacing(island.time)):
            self._land(run, island, elapsed)
            return
        before = mechanical_energy(now, run.world.constants, members)
        arrived = np.hstack([now.velocity[members], now.angular_velocity[members]])
        held = memory.wrench[members] * self._longest(elapsed, which)[members, None]
        now.velocity[members] -= now.inv_mass[members, None] * held[:, :3]
        now.angular_velocity[members] -= dot(now.inv_inertia[members], held[:, None, 3:])
        jointed = self._jointed(run, island)
        if close_joints(jointed, island.contacts):
            refresh_pose(members, now, state.rotation, state.trajectory.inertia)
            island.moved = True
        stop_joints(jointed, elapsed, self.moment)
        self._record_impulses(which, island.time)
        state.correction[members] += np.hstack([now.velocity[members], now.angular_velocity[members]]) - arrived
        if self._limited:
            # An impact at this instant: what came before goes on unchanged.
            stop_at_limits(jointed, self.shock)
        memory.wrench[members] = 0.0
        self.length[which] = elapsed[which]
        after = mechanical_energy(now, run.world.constants, members)
        run.log.account(island.time, "joints", after - before)
        self._note_drift(which, after, kinetic_energy(now, run.world.constants, members))

    def _longest(self, elapsed: np.ndarray, which: np.ndarray) -> np.ndarray:
        """The longest of the times elapsed (j,) of the joints `which` of each body (n,), s: 0 where the only one has let go."""
        out = np.zeros(len(self._dynamic))
        for ends in (self.table.body_a[which], self.table.body_b[which]):
            np.maximum.at(out, ends[ends >= 0], elapsed[which][ends >= 0])
        return out

    def _land(self, run: Run, island: Island, elapsed: np.ndarray) -> None:
        """End the island's flight, as it was planned: its joints are closed and stopped already."""
        which, members, constants, now = island.joints, island.members, run.world.constants, run.state.now
        self._record_impulses(which, island.time)
        energy = mechanical_energy(now, constants, members)
        if self._limited:
            stop_at_limits(self._jointed(run, island), self.shock)
            landed, energy = energy, mechanical_energy(now, constants, members)
            run.log.account(island.time, "joints", energy - landed)
        self.length[which] = elapsed[which]
        self._note_drift(which, energy, kinetic_energy(now, constants, members))

    def _note_drift(self, which: np.ndarray, energy: float, kinetic: float) -> None:
        """What the sub-step that ends has made or lost of the energy that joints keep by themselves."""
        begun, self._energy[which] = self._energy[which], np.nan
        self.drift[which] = 0.0
        if len(which) and np.all(begun == begun[0]) and kinetic > 0.0:
            self.drift[which] = abs(energy - begun[0]) / kinetic

    def _record_impulses(self, which: np.ndarray, time: float) -> None:
        """Impulses on b of the sub-steps that end: what is left of their forces, and what stopped the joints."""
        lasted = which[time > self.began[which]]
        elapsed = (time - self.began[lasted])[:, None]
        mean = self.pull[lasted] + 0.5 * elapsed * self.pull_rate[lasted]
        force = self.share[lasted, None] * mean + self.moment[lasted] / elapsed
        self.log.add(lasted, self.began[lasted], np.full(len(lasted), time), force)
        self.log.add_at(which, time, self.shock[which] - self._accounted_shock[which])
        self._accounted_shock[which] = self.shock[which]

    def impact_block(self, run: Run, island: Island) -> JointBlock:
        """The joints' part in the impulses of an impact (`JointBlock`)."""
        return impact_rows(self._jointed(run, island), self.shock)

    def _jointed(self, run: Run, island: Island) -> JointedIsland:
        """The joints of an island and its bodies, as the kernels take them."""
        state = run.state
        return JointedIsland(
            self.table, island.joints, state.now, state.rotation, island.members, run.column, self.memory, self._allowed
        )

    def follow(self, run: Run, island: Island, contacts: Contacts) -> None:
        """Move what hangs on bodies that a position correction has moved as far: their joints are closed again.

        Forces would close them else, and their work on the way would be energy that nothing gave. Of the contacts around, those with bodies
        that move outside of the island are left to the next correction.
        """
        known = run.state.now.inv_mass == 0.0
        known[island.members] = True
        mine = select(contacts, np.flatnonzero(known[contacts.body_a] & known[contacts.body_b]))
        if close_joints(self._jointed(run, island), mine):
            refresh_pose(island.members, run.state.now, run.state.rotation, run.state.trajectory.inertia)

    def sub_step(self, run: Run, island: Island, h: float) -> float:
        """Length of the next sub-step: h, the rest of the step, or a part of it. Very short rests are planned as longer ones."""
        world, now, which = run.world, run.state.now, island.joints
        fastest = 0.0
        sways, swings = self._tension_rates(run, which)
        rates = max(sways, self._spring_rate(which))
        ends = [self.table.body_a[which], self.table.body_b[which]]
        if len(which):
            # The world stands still.
            spins = [np.where(i[:, None] >= 0, now.angular_velocity[i], 0.0) for i in ends]
            speeds = [np.where(i[:, None] >= 0, now.velocity[i], 0.0) for i in ends]
            fastest = float(length(spins[1] - spins[0]).max())
            # A string or rod turns without its bodies.
            rods = self._rod[which] > 0.0
            fastest = max(fastest, float((length(speeds[1] - speeds[0])[rods] / self._rod[which[rods]]).max(initial=0.0)))
        for j in which[self._slides[which]].tolist():
            a, b = int(self.table.body_a[j]), int(self.table.body_b[j])
            if min(a, b) >= 0:
                fastest = max(fastest, _slide_rate(now, a, b, world.accuracy.step))
        waits = self.release_time[which] - island.time
        h = min(h, float(waits[waits > 0.0].min(initial=np.inf)))
        step = world.accuracy.step
        drifts = self.drift[which].max(initial=0.0) > DRIFT
        pieces = max(
            math.ceil(fastest * step / TURN),
            min(math.ceil(rates * step / SWAY), MOST_SUB_STEPS if drifts else MOST_SWAYS),
            min(math.ceil(swings * step / SWAY), MOST_SUB_STEPS if drifts else MOST_SWINGS),
        )
        pieces = max(min(pieces, MOST_SUB_STEPS), 1)
        piece = step / pieces
        return piece if h > piece * (1.0 + SHORT) else max(h, SHORT * step)

    def _spring_rate(self, which: np.ndarray) -> float:
        """Fastest oscillation [rad/s] of soft rows that other joints pull at: alone they are exact at any length."""
        if len(which) < 2:
            return 0.0
        table, memory = self.table, self.memory
        works = np.isfinite(table.stiffness) & ~memory.slack & np.isin(self._joint_of_row, which)
        stiffness = table.stiffness[works]
        square = np.where(table.per_mass[works], stiffness, stiffness * memory.weight[works])
        return math.sqrt(square.max(initial=0.0))

    def _tension_rates(self, run: Run, which: np.ndarray) -> tuple[float, float]:
        """Bounds of the rates [rad/s] at which bodies sway across the forces f of their joints: w^2 = f (r / I + 1 / (m r)).

        Returns that of all others, and that of bodies that only swing about a point which cannot be moved.
        """
        world, table = run.world, self.table
        force, rod = np.linalg.norm(self.pull[which], axis=1), self._rod[which]
        bodies = np.concatenate([table.body_a[which], table.body_b[which]])
        arm = self._arm[:, which].ravel()
        # A body that hangs at its centre does not sway; files of single precision miss the centre by some 1e-8.
        sways = (bodies >= 0) & world.dynamic[bodies] & (arm > CENTRED * np.tile(rod, 2))
        i, r = bodies[sways], arm[sways]
        square = np.tile(force, 2)[sways] * (r / self._least_inertia[i] + world.inv_mass[i] / r)
        squares = np.bincount(i, square, minlength=world.num_bodies)
        swings = np.zeros(world.num_bodies, bool)
        for k in {self.movable_end(j) for j in which[self._pins[which]].tolist()}:
            swings[k] = len(self.at(np.array([k]))) == 1
        return math.sqrt(squares[~swings].max(initial=0.0)), math.sqrt(squares[swings].max(initial=0.0))

    def hold(
        self, run: Run, island: Island, contacts: Contacts, turning: np.ndarray, force: np.ndarray, rest: float, rolling: Rolling
    ) -> tuple[float, float]:
        """Forces into run.wrench over a sub-step of at most `rest`; returns (its length, the residual)."""
        state, memory = run.state, self.memory
        if not len(contacts.gap) and (flown := self._fly(run, island, rest)) > 0.0:
            return flown, 0.0
        others = self.bodies_of(island.joints)
        others = others[~run.world.dynamic[others]]
        h, cuts, halved = self.sub_step(run, island, rest), 0, 0
        while True:
            h = load_over(run, island, h)
            for i in others:
                memory.end_position[i], memory.end_rotation[i] = run.pose_matrix(i, island.time + h)
            moment = self.moment.copy()
            problem = ContactProblem(
                state.now, contacts, island.members, run.column, turning, run.acceleration, run.angular_acceleration
            )
            jointed = self._jointed(run, island)
            residual, worst = hold_jointed(run.solve_rows, problem, jointed, h, force, run.wrench, moment, rolling)
            self.pull[island.joints] = 2.0 * (moment[island.joints] - self.moment[island.joints]) / h
            self.pull_rate[island.joints], self.share[island.joints], self.lands[island.joints] = 0.0, HALF, np.nan
            shorter = self.sub_step(run, island, h)
            if shorter < 0.5 * h:
                # Only the forces show how short it has to be.
                h = shorter
                continue
            self.are_closed = worst <= NOT_CLOSED * self._allowed
            if not self.are_closed and halved < MOST_HALVED:
                # What whips round closes over a shorter time.
                h, halved = 0.5 * h, halved + 1
                continue
            if self._break(run, island):
                continue
            switch = next_switch(self.table, island.joints, memory, (h, h), self._allowed)
            if cuts == MOST_CUTS or switch >= h * (1.0 - SHORT):
                break
            h, cuts = max(switch, SHORT * run.world.accuracy.step), cuts + 1
        self.moment[:] = moment
        self._log(island, h)
        self._begin(run, island)
        self._open_by = worst
        return h, residual

    def _fly(self, run: Run, island: Island, rest: float) -> float:
        """Fly an island that touches nothing over at most `rest`, its forces into run.wrench; returns for how long, 0 if it cannot be."""
        flight, members = self.flights.flight, island.members
        waits, frames = self.release_time - island.time, run.recorder.times
        # What is recorded is exact: flights end at frames. Paths on the way are not as good as ends.
        next_frame = int(frames.searchsorted(island.time + SHORT * run.world.accuracy.step, "right"))
        frame = float(frames[next_frame]) - island.time if next_frame < len(frames) else np.inf
        whole, which = 0.0, island.joints
        if not self.flights.may_fly(which):
            return 0.0
        forces, end = None, island.time + rest
        if island.free is not None:
            forces = run.forces.of_flight(run, island)
            if forces is None:
                return 0.0
            frame = min(frame, forces.longest)
        frame -= self._fly_past(run, island, forces, min(rest, frame))
        rest = end - island.time
        for _ in range(MOST_CUTS):
            which = island.joints
            if not len(which):
                return 0.0
            if run.world.moving[self.bodies_of(which)].any() or np.any(waits[which] <= 0.0):
                return 0.0
            rest = max(min(rest, frame, float(waits[which].min())), SHORT * run.world.accuracy.step)
            lengths = rest, self.sub_step(run, island, rest)
            h = self.flights.fly(self._jointed(run, island), run.world.steady_acceleration, forces, lengths)
            if h == 0.0:
                if self.flights.too_short:
                    # They turn fast, and what drifts is not known.
                    self.drift[which] = np.inf
                return 0.0
            self.pull[which], self.pull_rate[which] = flight.start[which], 2.0 * (flight.mean[which] - flight.start[which]) / h
            self.share[which] = 1.0
            if self._break(run, island):
                continue
            # Where a limit is reached the flight is made shorter, and then longer again by what it was too short.
            whole = max(whole, h)
            ends = min(next_switch(self.table, which, self.memory, (h, whole), self._allowed), self._overload_time(which, whole))
            if forces is not None and (share := forces.share_until_break()) < 1.0:
                ends = min(ends, share * h)
            if abs(ends - h) <= LANDING * h or (h < rest and ends > h):
                break
            rest = max(ends, SHORT * run.world.accuracy.step)
        run.wrench[members], run.wrench_rate[members] = flight.value[members], flight.rate[members]
        if forces is not None:
            forces.keep()
            pushed, island.loaded = members[run.forces.acts[members]], True
            run.wrench[pushed] -= run.forces.value[pushed]
            run.wrench_rate[pushed] -= run.forces.rate[pushed]
        self.memory.wrench[members] = 0.0
        self.log.note(island.time, which, self.pull[which])
        self._begin(run, island)
        self.lands[which] = island.time + h
        self._open_by, self.are_closed = 0.0, True
        return h

    def _fly_past(self, run: Run, island: Island, forces: FlightForces | None, rest: float) -> float:
        """Move an island that is alone to the start of its last flight of `rest` s, where nothing else can happen to it; returns how far.

        What is recorded of the way is its mean force, and the work of the joints on each body.
        """
        which, members, time = island.joints, island.members, island.time
        eventful = self._has_limit[which] | np.isfinite(self.break_force[which]) | np.isfinite(self.release_time[which])
        watched = bool(run.plan.observe) or run.soft_bodies.moves or run.world.moving[self.bodies_of(which)].any()
        push = 0.0 if forces is None else SURGE * forces.push
        if watched or eventful.any() or not self.flights.is_longer(which, rest) or not is_alone(run, members, rest, push):
            return 0.0
        now, constants = run.state.now, run.world.constants
        for i in members.tolist():
            run.forces.log.end(i, time, now)
            account_contact_work(run, i, time)
        before = [mechanical_energy(now, constants, np.array([i])) - work_of_forces(run, i) for i in members.tolist()]
        past = self.flights.fly_past(self._jointed(run, island), run.world.steady_acceleration, forces, rest)
        if forces is not None and past > 0.0:
            forces.note(time + past)
        for i, begun in zip(members.tolist(), before, strict=True):
            after = mechanical_energy(now, constants, np.array([i])) - work_of_forces(run, i)
            run.log.add_stretch(time, time + past, i, begun, after - begun, True)
        self.log.add(which, np.full(len(which), time), np.full(len(which), time + past), self.flights.flight.mean[which])
        island.time = time + past
        return past

    def _overload_time(self, which: np.ndarray, whole: float) -> float:
        """When the first of these joints has the force that breaks it, within `whole` s; that if none has. Forces grow by their rates."""
        strong, time = self.break_force[which], whole
        for j in which[np.linalg.norm(self.pull[which] + whole * self.pull_rate[which], axis=1) > strong].tolist():
            square, along = float(dot(self.pull_rate[j], self.pull_rate[j])), float(dot(self.pull[j], self.pull_rate[j]))
            missing = float(dot(self.pull[j], self.pull[j])) - self.break_force[j] ** 2
            time = min(time, (math.sqrt(max(along * along - square * missing, 0.0)) - along) / square)
        return time

    def _begin(self, run: Run, island: Island) -> None:
        """A sub-step of an island's joints begins."""
        self.began[island.joints] = island.time
        if not len(island.contacts.gap) and island.free is None and self.are_passive(island.joints):
            self._energy[island.joints] = mechanical_energy(run.state.now, run.world.constants, island.members)
        self._report_steep(run, island)

    def let_go(self, island: Island) -> None:
        """Forget the forces of the island's joints, which are not to be used."""
        self.memory.wrench[island.members] = 0.0
        self.pull[island.joints] = 0.0
        for j in island.joints.tolist():
            self.memory.force[self.table.first[j] : self.table.first[j + 1]] = 0.0

    def report_start(self, run: Run) -> None:
        """Report joints that the scene places beyond their limits: bodies jump there in the first step."""
        state, table, members, limited = run.state, self.table, np.flatnonzero(run.world.dynamic), np.flatnonzero(self._has_limit)
        ends = np.union1d(table.body_a[limited], table.body_b[limited])
        bring_all(state.trajectory, ends[ends >= 0], state.time, state.now, state.rotation, run.acceleration, run.angular_acceleration)
        for j in limited.tolist():
            mine = range(int(table.first[j]), int(table.first[j + 1]))
            island = JointedIsland(table, np.array([j]), state.now, state.rotation, members, run.column, self.memory, self._allowed)
            rows = make_rows.py_func(len(mine))
            fill_closing_rows(island, rows, 0)
            past = [-limit_side.py_func(table, k) * x for k, x in zip(mine, rows.bias.tolist(), strict=True)]
            beyond = max((x for x, k in zip(past, mine, strict=True) if np.isinf(table.stiffness[k])), default=0.0)
            if beyond > BEYOND * run.world.joint_size:
                run.log.report(
                    state.time, "joint beyond its limit at the start", tuple(run.world.names[i] for i in self.bodies_of(np.array([j]))),
                    f"{self.names[j]} is {beyond:.4g} (m or rad) beyond a limit; its bodies are moved there before the first step, without "
                    "a change of velocity: place them within the limits to see no jump",
                )  # fmt: skip

    def report_open(self, run: Run, island: Island) -> None:
        """Report joints of an island that the forces found last do not close."""
        if not self.are_closed:
            names, worst = tuple(run.world.names[i] for i in island.members), self._open_by
            far = f"off by {worst:.1e}" if math.isfinite(worst) else "no pose closes them"
            run.log.report(island.time, "joints not closed", names, f"{far}; use a smaller step")

    def _report_steep(self, run: Run, island: Island) -> None:
        """Report joints that are near the singularity of a twist."""
        for j in island.joints.tolist():
            if self.memory.steepness[self.table.first[j] : self.table.first[j + 1]].max(initial=0.0) > STEEP:
                pair = tuple(run.world.names[i] for i in self.bodies_of(np.array([j])))
                run.log.report(
                    island.time, "singular joint", pair,
                    f"{self.names[j]}: its axis has swung by half a turn, where the twist about it is not defined; limit the swing",
                )

    def _break(self, run: Run, island: Island) -> bool:
        """Take out a joint whose time has come, or the most overloaded one, if there is one."""
        j = self._gone(run, island.joints, island.time)
        island.joints = island.joints[island.joints != j]
        return j >= 0

    def _gone(self, run: Run, which: np.ndarray, time: float) -> int:
        """The joint that is taken out at `time`, -1 if none is."""
        due = which[self.release_time[which] <= time]
        if len(due):
            return self._take_out(run, int(due[0]), time, "joint let go", "")
        load = np.linalg.norm(self.pull[which], axis=1) / self.break_force[which]
        if not len(which) or load.max() <= 1.0:
            return -1
        j = int(which[np.argmax(load)])
        return self._take_out(run, j, time, "joint broke", f": {length(self.pull[j]):.6g} N")

    def _take_out(self, run: Run, j: int, time: float, kind: str, why: str) -> int:
        """The joint is gone."""
        self.whole[j] = False
        bodies = self.bodies_of(np.array([j]))
        run.substepped.let_go(bodies)
        run.log.note(time, kind, tuple(run.world.names[i] for i in bodies), f"{self.names[j]}{why}")
        self.log.note(time, np.array([j]), np.zeros((1, 3)))
        return j

    def begin_sub_steps(self, run: Run, bodies: np.ndarray, time: float) -> None:
        """End what exact sub-steps do to bodies that come to a sub-stepped island: half of the forces is taken back, joints are stopped."""
        which = self.at(bodies)
        if len(which):
            members = self.bodies_of(which)
            members = members[self._dynamic[members]]
            now = run.state.now
            island = island_without_contacts(time, members, now.velocity[members], now.angular_velocity[members])
            island.joints = which
            self.project_velocities(run, island)

    def note_sub_steps(self, which: np.ndarray, force: np.ndarray, span: tuple[float, float]) -> None:
        """Note the mean forces (j, 3) N on b over a span [s] of sub-steps of the other regime."""
        time, end = span
        self.pull[which], self.moment[which], self.began[which], self.length[which] = force[which], 0.0, end, 0.0
        self.log.note(time, which, force[which])

    def account_sub_steps(self, which: np.ndarray, began: float, time: float) -> None:
        """Record the impulses of sub-steps that lasted from `began` to `time`, s."""
        self.log.add(which, np.full(len(which), began), np.full(len(which), time), self.pull[which])

    def break_at(self, run: Run, which: np.ndarray, time: float) -> np.ndarray:
        """Take out joints that are overloaded or due; returns those that stay."""
        while (j := self._gone(run, which, time)) >= 0:
            which = which[which != j]
        return which

    def next_release(self, which: np.ndarray, time: float) -> float:
        """Time after `time` at which the first of these joints lets go, inf if none does."""
        release = self.release_time[which]
        return float(release[release > time].min(initial=np.inf))

    def log_rest(self, island: Island) -> None:
        """Forces on b from here on, while the island sleeps."""
        self.log.note(island.time, island.joints, self.pull[island.joints])

    def _log(self, island: Island, h: float) -> None:
        """Forces on b at this instant: its impulses over half of the sub-steps on both sides."""
        which = island.joints
        self.log.note(island.time, which, self.moment[which] / (0.5 * (self.length[which, None] + h)))


def _slide_rate(now: BodyState, a: int, b: int, step: float) -> float:
    """sqrt(w u / r) [1/s] of a body that slides at u in the frame of another, which turns at w, at the distance r; w at most.

    The force of the guide, 2 m w u, turns with the frame: constant over h it makes or loses energy, of the order of (w h)^2 u / r a second.
    u: what it may be at the end of a step, by w^2 r.
    """
    spin, between = now.angular_velocity[a], now.position[b] - now.position[a]
    turn, distance = float(length(spin)), float(length(between))
    slide = float(length(now.velocity[b] - now.velocity[a] - np.cross(spin, between))) + turn * turn * distance * step
    return math.sqrt(turn * min(turn, slide / distance)) if distance > 0.0 else turn
