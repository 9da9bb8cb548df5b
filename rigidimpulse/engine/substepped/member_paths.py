"""The paths of members from the begin to the end of what is stepped at once, and what the solver took off their energy on them.

A path may end early: where something hits its island. Then it has had its share of what the balance of energy gave and took.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.sorted_values import place_in
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import ContactStepper, Outcome
from rigidimpulse.engine.substepped.island_step import add_mechanical_energies, energies_of_islands
from rigidimpulse.engine.substepped.trajectories import end_trajectories
from rigidimpulse.engine.substepped.waypoints import Way, part_of, write_frames
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import FIXED
from rigidimpulse.recording.recorder import sample_paths

NO_JOINTS = np.zeros(0, np.int64)


class _Began(NamedTuple):
    """The step that an island is in."""

    time: float  # s, of its start
    end: float  # s
    energy: float  # J, at its start, less the work of varying forces so far
    taken: float  # J that the balance of energy takes off until its end
    raised: float  # J that bodies gain until then by rising out of each other, and cannot pay
    given: float  # J that drives and moving supports give by joints and the contacts beside them
    joints: np.ndarray  # of the members
    way: Way | None  # of all that were stepped together, if frames fall into it


@jit
def _end_paths(motion, constants, members, time, frames, written, label, energy):
    """Write the frames of members before `time`, bring them there, and write the energy (n,) J of their islands, by label."""
    now = motion.now
    sample_paths(motion.trajectory, members, place_in(frames.times, time), written, frames)
    end_trajectories(
        motion.trajectory, members, time, constants.steady_acceleration, now, motion.rotation, motion.acceleration,
        motion.angular_acceleration,
    )  # fmt: skip
    for i in range(energy.shape[0]):
        energy[i] = 0.0
    add_mechanical_energies(now, constants, members, label, energy)


class MemberPaths:
    """The paths of the members of all islands.

    Attributes:
        ends: when those of each island end, s, by its label.
        ended_at: when paths were last ended, s.
        steps: pieces of steps that were stepped so far. most: members of the largest of them.

    """

    def __init__(self, world: World, label: np.ndarray) -> None:
        """There are none yet; label (n,): the island that a body belongs to, -1 for none."""
        self._world, self._label = world, label
        self._energies, self._energy = np.zeros((4, world.num_bodies)), np.zeros(world.num_bodies)
        self._began: dict[int, _Began] = {}
        self.ends: dict[int, float] = {}
        self.ended_at = -np.inf
        self.steps = self.most = 0

    def labels_of(self, members: np.ndarray) -> list[int]:
        """Labels of the islands of members, ascending."""
        return sorted(set(self._label[members].tolist()))

    def begin(self, run: Run, out: Outcome, span: tuple[float, float], joints: np.ndarray, way: Way | None) -> None:
        """Know what the step of an outcome will have done; span: of its time, s, joints: of its members, way: theirs, if frames fall in."""
        energies_of_islands(run.state.now, run.world.constants, out.members, self._label, out.energies, self._energies)
        self._leave_out_forces(run, out.members, self._energies[0])
        self.know(out.members, self._energies, span, joints, way)

    def know(
        self, members: np.ndarray, energies: np.ndarray, span: tuple[float, float], joints: np.ndarray, way: Way | None
    ) -> None:
        """The same where the energies (4, n) J of the islands of members are known, see `energies_of_islands`."""
        for label in self.labels_of(members):
            self.ends[label] = span[1]
            energy, taken, raised, given = energies[:, label].tolist()
            self._began[label] = _Began(*span, energy, taken, raised, given, joints, way)

    def arrive(self, run: Run, members: np.ndarray, time: float) -> None:
        """Bring members to the begin of a step, unless that was done."""
        if self.ended_at != time:
            self.end(run, members, time)

    def end(self, run: Run, members: np.ndarray, time: float) -> None:
        """Bring members to `time`, the end of their paths; account for what the step took of their energy."""
        self.ended_at = time
        if not len(members):
            return
        world, labels = self._world, self.labels_of(members)
        on_way: dict[int, list[int]] = {}
        for label in labels:
            if (began := self._began.get(label)) is not None and began.way is not None:
                on_way.setdefault(id(began.way), []).append(label)
        for on_it in on_way.values():
            whole = self._began[on_it[0]].way
            assert whole is not None
            # An island that was hit is on a way of its own from there, and others that were stepped with it are still on theirs.
            way = part_of(whole, members[np.isin(self._label[members], on_it)])
            write_frames(run.recorder, way, time, world.inertia[way.bodies])
        if world.force_tables:
            for i in members.tolist():
                run.forces.log.end(i, time)
        _end_paths(run.motion, world.constants, members, time, run.recorder.frames, run.recorder.written, self._label, self._energy)
        self._leave_out_forces(run, members, self._energy)
        for label in labels:
            if label in self._began:
                self._account(run, self._began.pop(label), float(self._energy[label]), time)

    def _leave_out_forces(self, run: Run, members: np.ndarray, energy: np.ndarray) -> None:
        """Take the work that varying forces have done on members off the energies (n,) J of their islands, by label."""
        if run.world.force_tables:
            in_island = members[self._label[members] >= 0]
            np.subtract.at(energy, self._label[in_island], run.forces.log.work[in_island])

    def _account(self, run: Run, began: _Began, energy: float, time: float) -> None:
        """Account for a step that ends at `time` with an energy, J."""
        change = energy - began.energy
        # Trajectories that end early have had their share of it.
        share = (time - began.time) / (began.end - began.time)
        run.log.account_over(began.time, time, "energy correction", -began.taken * share)
        run.log.account_over(began.time, time, "position correction", began.raised * share)
        run.log.account_over(began.time, time, "joints", began.given * share)
        run.log.account_over(began.time, time, "sub-stepping", change - (began.raised - began.taken + began.given) * share)
        if len(began.joints) and time > began.time:
            run.joints.account_sub_steps(began.joints, began.time, time)

    def put_to_sleep(self, run: Run, stepper: ContactStepper, members: np.ndarray, time: float) -> None:
        """Let members, who have arrived, stay where they are."""
        trajectory, now, constants = run.state.trajectory, run.state.now, run.world.constants
        if not len(members):
            return
        before = mechanical_energy(now, constants, members)
        run.recorder.flush_all(trajectory, members, time)
        now.velocity[members] = now.angular_velocity[members] = 0.0
        trajectory.mode[members], trajectory.start[members] = FIXED, time
        trajectory.velocity[members] = trajectory.angular_velocity[members] = 0.0
        stepper.report_crossed(run, members, time)
        run.log.account(time, "sub-stepping", mechanical_energy(now, constants, members) - before)
