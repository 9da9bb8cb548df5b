"""Bodies under forces that vary.

Bodies that no contact and no joint holds take steps of Nystroem's method (`motion.force_step`), as long as its error allows. For bodies
that are held, or stepped by sub-steps, the force is constant over a piece of length h, and is the one at its middle:

    F = F(t + h/2, x(h/2), v(h/2)),    x, v: after h/2 under the last accelerations of the body, contacts included

This is of second order in h, as contact forces are, and a body at rest stays at rest. The piece is so short that the error of the path,
|F(h/2) - F| h^2 / (6 m)  with F at both ends, is within the tolerance. Jointed bodies that touch nothing ask for forces at the stages of
their flights (`flight_forces.py`).

Some forces act in a part of space only (`ForceTable.switches`). A step then uses the forces that act at its start. It ends where the set of
acting forces changes; that time is found by bisection along the trajectory, to round-off. So the steps keep their order. Steps of fixed
length (`Accuracy.integrator`) do not end early.

The impulse, the angular impulse about the world's origin and the work of each force are integrals of its line along the trajectory.

A body that is held until its release follows its own path. What forces do to it is the business of what holds it: no work is counted
until it is let go. Forces between it and others are evaluated where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import ForceTable, Instant
from rigidimpulse.dynamics.forces.force_log import ForceLog, ForceWork
from rigidimpulse.dynamics.forces.mass_flow import BurningForces, MassFlow
from rigidimpulse.engine.flight_forces import FlightForces
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island
from rigidimpulse.model.state import State
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import refresh_pose
from rigidimpulse.motion.force_step import Lines, Stage, Workspace, nystroem, semi_implicit
from rigidimpulse.motion.trajectory import Trajectories, state_at
from rigidimpulse.recording.recorder import Recorder

IN_FLIGHT, IN_CONTACT, IN_SUB_STEPS = 0.03, 3.0, 300.0
"""How far a path may be off, relative to the size, or in rad of turn: in roots of the accuracy's tolerance, inside a step of bodies that
fly, and for each step of the run of those in contact and of those that are sub-stepped. 1e-8, 1e-6 and 1e-4 by default."""
SHORTEST = 2.0**-14
"""Part of the run's step below which it is not split for forces."""
FIRST = 2.0**-6
"""Part of the run's step that the first sub-step of bodies takes that have just come to be held."""
SAFETY, LEAST_CHANGE, MOST_CHANGE = 0.9, 0.2, 5.0
"""How step lengths follow errors."""
ASIDE = TOLERANCES.force.aside

SWITCHED = TOLERANCES.force.switched
LEAST_PIECE = TOLERANCES.force.least_piece
MOST_SWITCHES = 20
"""Switches of forces in a step."""


class VaryingForces:
    """The varying forces of a run.

    Attributes:
        acts: (n,) bool, bodies that feel them.
        value, rate: (n, 6) force and torque on bodies at the start of their trajectories, and how they change a second.
        flow: masses that change, if there are any. log: what each force did.

    """

    def __init__(self, world: World, trajectory: Trajectories, times: np.ndarray, clocks: Mapping[str, Callable[[], Any]]) -> None:
        """clocks: lines of the plan by kind, which get the time that forces take; times (f,) s of the frames.

        Raises SceneError for forces of one name.
        """
        n = world.num_bodies
        self._world = world
        self._tables: list[ForceTable] = list(world.force_tables)
        self._clocks = [clocks[table.kind] for table in self._tables]
        self._first = np.cumsum([0, *(len(table.body) for table in self._tables)])
        self._body = np.concatenate([table.body for table in self._tables])
        self._always = np.zeros(n, bool)
        for table in self._tables:
            self._always[table.body] |= not table.comes_and_goes
        self._component = _components(n, np.concatenate([table.links for table in self._tables]))
        self.let_act(np.zeros(n, bool))
        self._restless = np.zeros(n, bool)
        for table in self._tables:
            self._restless[table.body] |= not table.is_steady
        self._carried = np.array([i for i, body in enumerate(world.scene.bodies) if body.release_time is not None], np.int64)
        self._trajectory = trajectory
        self._workspace = Workspace(trajectory, world.inv_mass)
        self._longest = np.full(n, world.accuracy.step)
        for table in self._tables:
            np.minimum.at(self._longest, table.body, table.longest_steps())
        self._plan = self._longest.copy()
        root = world.accuracy.tolerance**0.5
        self._in_flight, self._in_contact, self._in_sub_steps = IN_FLIGHT * root, IN_CONTACT * root, IN_SUB_STEPS * root
        self._size = np.minimum(world.bound_radius, world.size)
        self._switching = [table for table in self._tables if table.switches]
        self._cut = 0.0
        burners = [table for table in self._tables if isinstance(table, BurningForces)]
        self.flow = MassFlow(burners, world, trajectory) if burners else None
        self._last, self._held_until, self._was_held = np.zeros((n, 6)), np.full(n, -np.inf), np.zeros(n, bool)
        self.value, self.rate = np.zeros((n, 6)), np.zeros((n, 6))
        self.log = ForceLog(times, self._body, trajectory)

    def weigh(self, bodies: np.ndarray, time: float) -> None:
        """Let bodies whose mass changes have that of `time` [s]."""
        if self.flow is not None:
            self.flow.weigh(bodies, time)

    def carry_on(self, earlier: Run) -> None:
        """Leave out what broke in an earlier run."""
        before = {table.kind: table for table in earlier.world.force_tables}
        for table in self._tables:
            if table.kind in before:
                table.carry_on(before[table.kind])

    def links(self) -> np.ndarray:
        """Bodies (l, 2) that forces tie together: each with the first one of those that hang together by forces."""
        return self._links

    def let_act(self, bodies: np.ndarray) -> None:
        """From now on forces that come and go act on these bodies, (n,) bool, and on no others."""
        self.acts = self._always | bodies
        acting = np.flatnonzero(self.acts)
        _, first, label = np.unique(self._component[acting], return_index=True, return_inverse=True)
        self._links = np.column_stack([acting[first][label], acting])

    def present(self, table: ForceTable, time: float) -> np.ndarray:
        """Wrenches (k, 6) of the rows of a table at `time`, which lies within the present trajectory of every body."""
        first = self._first[self._tables.index(table)]
        return self.log.wrench(np.arange(first, first + len(table.body)), table.body, time)

    def may_rest(self, bodies: np.ndarray) -> bool:
        """Whether the forces on bodies at rest stay as they are."""
        return not self._restless[bodies].any() and not len(self._held_beside(bodies))

    def fly(self, run: Run, members: np.ndarray, time: float, end: float) -> np.ndarray:
        """Forces on members that nothing holds, from `time` to `end` at most, into `value` and `rate`; returns for how long, (m,) s."""
        state, now = run.state, run.state.now
        rest = min(end, self._next_break(time)) - time
        if rest <= 0.0:  # the end of the run
            return np.zeros(len(members))
        if self._world.accuracy.integrator != "exact":
            return self._fly_one_length(members, time, min(rest, self._world.accuracy.step), state)
        for table in self._switching:
            table.freeze(self._instant(np.full(len(self.acts), time), members, now, state.rotation))
        switches = 0
        h = np.zeros(len(self.acts))
        h[members] = _pieces(rest, self._together(members, self._plan[members], np.minimum))
        shortest = SHORTEST * self._world.accuracy.step
        todo, cut = members, False
        while len(todo):
            first = self._start(run, time, h, todo)

            def evaluate(share: float, bodies: BodyState, rotation: np.ndarray, todo: np.ndarray = todo) -> Stage:
                return self._evaluate(time + h * min(share, 1.0 - ASIDE), todo, bodies, rotation)

            rows, sums = nystroem(evaluate, self._workspace, first, todo, h, now, self._world.steady_acceleration)
            # A force that gives way within the step: the step ends there.
            share = 1.0 if cut else self.share_until_break(rows)
            if share < 1.0:
                cut, h[todo] = True, np.maximum(share * h[todo], shortest)
                continue
            error = self.errors(now, todo, sums.off, h[todo], 1.0 / 12.0) / self._in_flight
            error = self._together(todo, error, np.maximum)
            # The error inside the step is of order 4, and chooses h.
            grow = np.clip(SAFETY * np.maximum(error, 1e-30) ** -0.25, LEAST_CHANGE, MOST_CHANGE)
            done = (error <= 1.0) | (h[todo] <= shortest)
            if self._switching and done.all() and switches < MOST_SWITCHES:
                # Other forces act from some place on: the step ends where they begin or end.
                part, switches = self._switch(time, todo, now, sums, h), switches + 1
                if part < 1.0:
                    h[todo] *= part
                    continue
            ready = todo[done]
            follows = np.where(h[ready] < self._plan[ready], np.maximum(self._plan[ready], h[ready] * grow[done]), h[ready] * grow[done])
            self._plan[ready] = np.clip(follows, shortest, self._longest[ready])
            self._keep(ready, time, (rows, sums), h, now)
            self._report(run, time, ready[error[done] > 1.0], self._in_flight)
            todo, again = todo[~done], grow[~done]
            h[todo] = self._plan[todo] = _pieces(rest, np.maximum(h[todo] * again, shortest))
        for table in self._switching:
            table.freeze(None)
        self._cut = float(h[members[0]]) if switches > 1 else 0.0
        return h[members]

    def _fly_one_length(self, members: np.ndarray, time: float, length: float, state: State) -> np.ndarray:
        """The same in one step of a length, s, whatever its error."""
        h = np.zeros(len(self.acts))
        h[members] = length

        def evaluate(share: float, bodies: BodyState, rotation: np.ndarray) -> Stage:
            return self._evaluate(time + h * min(max(share, ASIDE), 1.0 - ASIDE), members, bodies, rotation)

        first = evaluate(0.0, state.now, state.rotation)
        if self._world.accuracy.integrator == "semi_implicit":
            rows, sums = semi_implicit(first)
        else:
            rows, sums = nystroem(evaluate, self._workspace, first, members, h, state.now, self._world.steady_acceleration)
        self._keep(members, time, (rows, sums), h, state.now)
        return h[members]

    def _switch(self, time: float, members: np.ndarray, now: BodyState, sums: Lines, h: np.ndarray) -> float:
        """Part of a step of h (n,) s, the same for all members, after which other forces act; 1 if that is its end, or never."""
        workspace, length = self._workspace, float(h[members[0]])
        workspace.follow(members, now, self._world.steady_acceleration, sums.value, sums.change / length)

        def differ(part: float) -> bool:
            workspace.look(members, part * length)
            at = self._instant(np.full(len(self.acts), time + part * length), members, workspace.bodies, workspace.rotation)
            return any(table.switched(at) for table in self._switching)

        if not differ(1.0):
            return 1.0
        # Forces that rise from nothing may come and go by round-off: pieces that follow each other grow, so that time goes on.
        step = self._world.accuracy.step
        least = max(LEAST_PIECE * step, 4.0 * np.spacing(time), min(2.0 * self._cut, SHORTEST * step)) / length
        low, high = 0.0, 1.0
        while high - low > least:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if differ(middle) else (middle, high)
        return 1.0 if high >= 1.0 - SWITCHED else max(high, least)

    def load(self, run: Run, island: Island, h: float) -> float:
        """Forces on an island that contacts or joints hold, over h s at most, into the accelerations and `value`; returns for how long."""
        state, now, world = run.state, run.state.now, self._world
        assert island.free is not None
        members = island.members[self.acts[island.members]]
        time, step = island.time, world.accuracy.step
        plan = float(self._plan[members].min())
        if not island.loaded:
            self._was_held[members] = self._held_until[members] >= time - ASIDE * step
        if not self._was_held[members].any():
            # Nobody knows yet what contacts and joints do: forces that answer the fall would throw what has just landed.
            h = min(h, FIRST * step)
        h = min(h, self._next_break(time) - time, plan)
        _, start = self._start(run, time, np.full(len(self.acts), h), members)
        if not island.loaded:
            pull = (state.trajectory.acceleration[members] - world.steady_acceleration[members]) * world.mass[members, None]
            self._last[members] = np.hstack([pull, state.trajectory.torque[members]])
        # Held bodies go on under the sum of what acted last: contacts and joints of the last sub-step beside forces of this one would not
        # balance each other, and what damps along a held direction would make that grow.
        last = np.where(self._was_held[:, None], self._last, start)
        h = self._hold(run, (time, h), members, (start, last), self._in_contact)
        self._held_until[members] = time + h
        island.loaded = True
        total = self.value
        run.acceleration[members] = island.free[0][self.acts[island.members]] + now.inv_mass[members, None] * total[members, :3]
        turned = np.einsum("ijk,ik->ij", now.inv_inertia[members], total[members, 3:])
        run.angular_acceleration[members] = island.free[1][self.acts[island.members]] + turned
        return h

    def of_flight(self, run: Run, island: Island) -> FlightForces | None:
        """Forces on an island that joints hold and nothing touches, over a flight; None where they do not let it fly.

        Steps of fixed length, masses that change and forces that begin and end where bodies are do not.
        """
        members, accuracy = island.members[self.acts[island.members]], self._world.accuracy
        acting = [table for table in self._switching if np.isin(table.body, members).any()]
        if accuracy.integrator != "exact" or self.flow is not None or acting:
            return None
        longest = min(self._next_break(island.time) - island.time, float(self._longest[members].min()))
        if longest <= 0.0:
            return None
        _, total = self._start(run, island.time, np.full(len(self.acts), longest), members)
        push = run.state.now.inv_mass[members] * np.sqrt((total[members, :3] ** 2).sum(1))
        return FlightForces(self, run, island, (longest, float(push.max())))

    def evaluate_within(
        self, time: float, h: float, share: float, members: np.ndarray, bodies: BodyState, rotation: np.ndarray
    ) -> Stage:
        """Forces of all rows (k, 6) and their sums (n, 6) on members after a share of a step of h s from `time` on, inside of it."""
        at = time + h * min(max(share, ASIDE), 1.0 - ASIDE)
        return self._evaluate(np.full(len(self.acts), at), members, bodies, rotation)

    def powers(self, rows: np.ndarray, bodies: BodyState) -> np.ndarray:
        """What forces of all rows (k, 6) do a second to bodies where they are: (k, 7) impulse, angular impulse, work."""
        x, v, w = bodies.position[self._body], bodies.velocity[self._body], bodies.angular_velocity[self._body]
        force, torque = rows[:, :3], rows[:, 3:]
        work = np.einsum("ij,ij->i", force, v) + np.einsum("ij,ij->i", torque, w)
        return np.column_stack([force, torque + cross_arrays(x, force), work])

    def keep_flight(self, members: np.ndarray, time: float, lines: tuple[Lines, Lines], h: float, now: BodyState) -> None:
        """From `time` on these lines, of rows and their sums, act on members that joints hold, for h s."""
        self._keep(members, time, lines, np.full(len(self.acts), h), now)
        self._held_until[members] = time + h

    def push(self, run: Run, members: np.ndarray, span: tuple[float, float], mean: np.ndarray) -> float:
        """Forces on sub-stepped members (k,) over a span [s] at most, into `value`; returns until when.

        mean: (n, 6) their mean acceleration and angular acceleration in the last piece, by contacts and all else.
        """
        (time, end), now, inertia = span, run.state.now, run.state.trajectory.inertia
        h = max(min(end, self._next_break(time)) - time, np.spacing(time))
        _, start = self._start(run, time, np.full(len(self.acts), h), members)
        last = np.zeros((len(self.acts), 6))
        last[members, :3] = self._world.mass[members, None] * (mean[members, :3] - self._world.steady_acceleration[members])
        along = np.einsum("mij,mi->mj", run.state.rotation[members], mean[members, 3:])
        last[members, 3:] = np.einsum("mij,mj->mi", run.state.rotation[members], inertia[members] * along)
        length = min(h, float(self._plan[members].min()))
        apart = np.setdiff1d(np.flatnonzero(np.isin(self._component, self._component[members])), members)
        if len(apart):
            self._workspace.stay(apart, now, run.state.rotation)
        held = self._hold(run, (time, length), members, (start, last), self._in_sub_steps)
        return end if held >= (end - time) * (1.0 - SWITCHED) else time + held

    def _hold(
        self, run: Run, piece: tuple[float, float], members: np.ndarray, wrenches: tuple[np.ndarray, np.ndarray], allowed: float
    ) -> float:
        """Take forces on members as constant from a time on for h s at most, and begin their lines; returns for how long.

        piece: time and h, s. wrenches: sums (n, 6) of forces at its start, and of all that acted on the members before, by which they are
        taken on. allowed: how far paths may be off in a step.
        """
        (time, h), (start, last), now, world, state = piece, wrenches, run.state.now, self._world, run.state
        step, given, plan = world.accuracy.step, h, float(self._plan[members].min())
        while True:
            if self.flow is not None:
                # What holds the members feels all their masses: those of the middle.
                self.flow.weigh(members, time + 0.5 * h)
                refresh_pose(members, now, state.rotation, state.trajectory.inertia)
            half = np.full(len(self.acts), 0.5 * h)
            self._workspace.fly(members, half, now, world.steady_acceleration, last)
            value, total = self._evaluate(time + half, members, self._workspace.bodies, self._workspace.rotation)
            self._workspace.fly(members, 2.0 * half, now, world.steady_acceleration, last)
            _, end = self._evaluate(time + 2.0 * (1.0 - ASIDE) * half, members, self._workspace.bodies, self._workspace.rotation)
            # On both sides of the middle: a path that turns comes back to its force.
            sides = [self.errors(now, members, total - f, 2.0 * half[members], 1.0 / 6.0).max() for f in (start, end)]
            error = max(sides) / (allowed * h / step)
            grow = min(max(SAFETY * max(error, 1e-30) ** -0.5, LEAST_CHANGE), MOST_CHANGE)
            if error <= 1.0 or h <= SHORTEST * step:
                break
            h = max(h * grow, SHORTEST * step)
        if np.any(still := ~np.any(now.velocity[members], axis=1) & ~np.any(now.angular_velocity[members], axis=1)):
            # What stands and rests bears the forces of where it is, not of where it would fall to without contacts.
            self._workspace.fly(members, half, now, world.steady_acceleration, last)
            self._workspace.stay(members[still], now, state.rotation)
            value, total = self._evaluate(time + half, members, self._workspace.bodies, self._workspace.rotation)
        if error > 1.0:
            self._report(run, time, members, allowed)
        # Where others made it shorter, what was planned still holds.
        follows = max(plan, h * grow) if h == given < plan and error <= 1.0 else h * grow
        self._plan[members] = np.minimum(follows, self._longest[members])
        rows, sums = (Lines(f, np.zeros_like(f), np.zeros_like(f)) for f in (value, total))
        self._keep(members, time, (rows, sums), np.full(len(self.acts), h), now)
        return h

    def _start(self, run: Run, time: float, h: np.ndarray, members: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces at the start of steps of h (n,) s, without those that give way there."""
        state = run.state
        forces = self._evaluate(time + ASIDE * h, members, state.now, state.rotation)
        gone = False
        for table, first in zip(self._tables, self._first[:-1], strict=True):
            for k in table.give_way(forces[0][first : first + len(table.body)], time):
                bodies = tuple(self._world.names[i] for i in table.body[table.cause == k])
                run.log.note(time, "force ended", bodies, f"{table.names[k]} exceeded its greatest force")
                gone = True
        return self._evaluate(time + ASIDE * h, members, state.now, state.rotation) if gone else forces

    def share_until_break(self, rows: Lines) -> float:
        """Share of a step after which a force gives way, 1 if none does."""
        parts = zip(self._tables, self._first[:-1], self._first[1:], strict=True)
        return min(table.share_until_break(rows.value[i:j], rows.change[i:j]) for table, i, j in parts)

    def _evaluate(self, time: np.ndarray, members: np.ndarray, bodies: BodyState, rotation: np.ndarray) -> Stage:
        """Forces of all rows (k, 6), 0 for those of other bodies, and their sums (n, 6) on bodies of the mass of now; time (n,) s."""
        value, asked = np.zeros((len(self._body), 6)), np.zeros(len(self.acts), bool)
        asked[members] = True
        at = self._instant(time, members, bodies, rotation)
        for table, first, clock in zip(self._tables, self._first[:-1], self._clocks, strict=True):
            rows = np.flatnonzero(asked[table.body])
            if len(rows):
                with clock():
                    value[first + rows] = table.wrench(at, rows)
        total = np.zeros((len(self.acts), 6))
        np.add.at(total, self._body, value)
        return value, total if self.flow is None else total * self.flow.since_weighed(time)[:, None]

    def _instant(self, time: np.ndarray, members: np.ndarray, bodies: BodyState, rotation: np.ndarray) -> Instant:
        """What forces on members are evaluated at; bodies that are held beside them are brought there."""
        for i in self._held_beside(members).tolist():
            mate = members[self._component[members] == self._component[i]][0]
            x, q, v, w = bodies.position[i], bodies.orientation[i], bodies.velocity[i], bodies.angular_velocity[i]
            state_at(self._trajectory, i, float(time[mate]), x, q, v, w)
            rotation[i] = to_matrix(q)
        return Instant(time, bodies, rotation, self._trajectory)

    def _held_beside(self, members: np.ndarray) -> np.ndarray:
        """Bodies that are held until their release, and that forces tie to members."""
        held = self._carried[~self._world.dynamic[self._carried]] if len(self._carried) else self._carried
        return held[np.isin(self._component[held], self._component[members])] if len(held) else held

    def errors(self, bodies: BodyState, members: np.ndarray, off: np.ndarray, h: np.ndarray, part: float) -> np.ndarray:
        """Errors (m,) of the members' poses by wrenches that are off by (n, 6) over h (m,) s, relative to the size."""
        square = part * h**2
        moved = square * bodies.inv_mass[members] * np.linalg.norm(off[members, :3], axis=1) / self._size[members]
        turned = square * np.linalg.norm(np.einsum("ijk,ik->ij", bodies.inv_inertia[members], off[members, 3:]), axis=1)
        return np.maximum(moved, turned)

    def _together(self, members: np.ndarray, values: np.ndarray, best: np.ufunc) -> np.ndarray:
        """The least or the largest (best) of the values (m,) of all members that forces tie, for each of them."""
        _, first, label = np.unique(self._component[members], return_index=True, return_inverse=True)
        common = values[first].copy()
        best.at(common, label, values)
        return common[label]

    def _keep(self, members: np.ndarray, time: float, lines: tuple[Lines, Lines], h: np.ndarray, now: BodyState) -> None:
        """From `time` on these lines, of rows and their sums, act on members, who are where they are now, for h (n,) s."""
        rows, sums = lines
        self.value[members] = sums.value[members]
        self.rate[members] = sums.change[members] / h[members, None]
        self.log.begin(members, time, (rows.value, rows.change), h, now)

    def finish(self, world: World, times: np.ndarray, recorder: Recorder) -> ForceWork:
        """What the forces did until the frames, and their potential energy there."""
        self.log.finish()
        starts = np.cumsum([0, *(len(table.names) for table in self._tables)])[:-1]
        names = [name for table in self._tables for name in table.names]
        cause = np.concatenate([first + table.cause for first, table in zip(starts, self._tables, strict=True)])
        potential = [table.potential(times, recorder.position, recorder.orientation) for table in self._tables]
        share = None if self.flow is None else self.flow.shares_at(times)
        return ForceWork(names, self._body, cause, self.log.at_frames, np.concatenate(potential, axis=1), share)

    def _next_break(self, time: float) -> float:
        return min(table.next_break(time * (1.0 + 1e-12) + 1e-300) for table in self._tables)

    def _report(self, run: Run, time: float, bodies: np.ndarray, allowed: float) -> None:
        for i in bodies.tolist():
            run.log.report(
                time, "forces change too fast", (self._world.names[i],),
                f"the path may be off by more than {allowed:.1g} of the size in a step; use a smaller step or soften the force",
            )


def _pieces(rest: float, h: np.ndarray) -> np.ndarray:
    """Lengths of equal pieces of the rest that are not longer than h, so that nothing short is left at the end."""
    return rest / np.maximum(np.ceil(rest / h * (1.0 - 1e-9)), 1.0)


def _components(n: int, links: np.ndarray) -> np.ndarray:
    """Label (n,) of each body: that of the first one it is linked with."""
    label = np.arange(n)
    changed = True
    while changed:
        least = label.copy()
        for a, b in links:
            least[a] = least[b] = min(least[a], least[b])
        changed, label = bool(np.any(least != label)), least
    return label
