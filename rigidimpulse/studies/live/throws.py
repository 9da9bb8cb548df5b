"""Bodies whose velocity is set while a run goes on, between two steps, as bodies with keyframes are let go.

The run is the same, to the bit, until the first throw. A throw takes the place of the keyframes among the run's participants and lets them
go on.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.participants import Keyframed
from rigidimpulse.engine.recording_of import finish_sub_steps
from rigidimpulse.engine.run import Run
from rigidimpulse.motion.trajectory import FREE, begin, state_at
from rigidimpulse.studies.live.request import Throw

NO_CORRECTION = np.zeros(6)


class Throws:
    """The throws of a run, and the keyframes of its scene."""

    def __init__(self, run: Run, throws: tuple[Throw, ...]) -> None:
        """Take those of bodies that the scene has and that are dynamic; of other ones there are none."""
        names, dynamic = run.world.names, run.world.dynamic
        self._keyframes: Keyframed = run.keyframes
        known = [throw for throw in throws if throw.body in names and dynamic[names.index(throw.body)]]
        self._left = sorted(known, key=lambda throw: throw.time)

    def next_key(self, time: float) -> float:
        """The first time after `time` at which a step must end, inf if there is none."""
        later = [throw.time for throw in self._left if throw.time > time]
        return min([self._keyframes.next_key(time), *later])

    def start_segments(self, run: Run, time: float) -> None:
        """Throw the bodies whose time it is."""
        self._keyframes.start_segments(run, time)
        while self._left and self._left[0].time <= time:
            throw = self._left.pop(0)
            finish_sub_steps(run, time)
            _throw(run, run.world.names.index(throw.body), np.asarray(throw.velocity, float), time)


def _throw(run: Run, i: int, velocity: np.ndarray, time: float) -> None:
    """Body i goes on from `time` with another velocity (3,) m/s, free of the contacts that it has."""
    world, state = run.world, run.state
    trajectory, now, one = state.trajectory, state.now, np.array([i])
    run.recorder.flush(trajectory, i, time, NO_CORRECTION)
    state_at(trajectory, i, time, now.position[i], now.orientation[i], now.velocity[i], now.angular_velocity[i])
    before = mechanical_energy(now, world.constants, one)
    run.impulses.add_at("throw", -1, i, time, world.mass[i] * (velocity - now.velocity[i]))
    now.velocity[i] = velocity
    run.log.account(time, "let go", mechanical_energy(now, world.constants, one) - before)
    state.under_contact[i] = False
    trajectory.position[i], trajectory.orientation[i] = now.position[i], now.orientation[i]
    trajectory.velocity[i], trajectory.angular_velocity[i] = now.velocity[i], now.angular_velocity[i]
    trajectory.acceleration[i], trajectory.start[i], trajectory.mode[i] = world.steady_acceleration[i], time, FREE
    begin(trajectory, i)
