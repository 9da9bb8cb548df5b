"""How islands arrive at an instant: the forces that were constant over a sub-step end, and so do those of contacts that were left.

In this order, for all islands at once, since bodies that shared forces may be in several islands by now:

    velocities of contacts are projected (`velocity_projection`), islands one by one, and then those of bodies that nothing touches any more
    the energy with which bodies arrive is noted, from which the work of the contact forces follows
    joints are closed and stopped (`joints`), islands one by one
    energy that constant forces made is taken off (`energy_limit`)
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.engine.exact.energy_limit import limit_energy, note_end_energy
from rigidimpulse.engine.exact.trajectories import begin_trajectory
from rigidimpulse.engine.exact.velocity_projection import project_alone, project_velocities
from rigidimpulse.engine.islands import classify
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island

NOT_HELD = np.zeros(6), np.zeros(6)


def arrive(run: Run, islands: list[Island], time: float, bodies: np.ndarray) -> None:
    """End the sub-steps of all bodies that were brought to `time` with these islands."""
    if not len(bodies):
        return
    for island in islands:
        if project_velocities(run, island):
            classify(run, island)
    state, constants = run.state, run.world.constants
    project_alone(state.memory, run.motion, bodies, time, state.correction)
    pressed = bodies[state.under_contact[bodies]]
    if len(pressed):
        note_end_energy(state.limiter, state.now, constants, pressed)
    for island in islands:
        if len(island.joints):
            run.joints.project_velocities(run, island)
            classify(run, island)
    if not len(pressed):
        return
    slowed, changes = np.zeros(run.world.num_bodies, bool), np.empty(len(pressed))
    count = limit_energy(state.limiter, state.now, constants, state.trajectory, pressed, time, slowed, changes)
    for change in changes[:count].tolist():
        run.log.account(time, "energy correction", change)
    for island in islands:
        if count and slowed[island.members].any():
            classify(run, island)


def let_go(run: Run, pair_events: PairEvents, islands: list[Island], time: float, bodies: np.ndarray) -> None:
    """Let those of the bodies fly freely that still carry the forces of contacts they have left: they are in no island any more."""
    state = run.state
    bodies = bodies[state.under_contact[bodies]]
    if not len(bodies):
        return
    leaves = np.zeros(len(state.under_contact), bool)
    leaves[bodies] = True
    for island in islands:
        leaves[island.members] = False
    left = leaves.nonzero()[0]
    left = left[(state.trajectory.start[left] < time) & ~pair_events.inside[left]]
    for i in left.tolist():
        begin_trajectory(run, pair_events, i, time, NOT_HELD, rests=False)
