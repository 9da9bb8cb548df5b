"""One step: the whole order of what happens.

Every body has a trajectory: its exact path since something last acted on it. A step goes from contact to contact. At the earliest time at
which a pair of bodies touches, the island of bodies that touch there is brought to that time and advanced from it; bodies elsewhere do not
notice. An island is advanced by one of two regimes, `exact/` from event to event or `substepped/` by sub-steps to the end of the step.
After `arrive` both have the same four verbs: impacts, loads, contact forces, trajectories.

What takes part in a verb stands in a list of the plan: an effect that the scene does not call for is in none. `effects.py` says which
functions it binds. Keyframes, soft bodies and the kernel of balls act before a step (`loop.py`).

The same order stands once more in `exact/event_loop.py`, compiled, for islands that need nothing but exact contact. `run.compiled` deals
with those, and leaves to this loop what is in the others at the first event that has such. The results are the same bits.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.engine.exact.advance import arrive, let_go
from rigidimpulse.engine.islands import touching_islands
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island


def step(run: Run, end: float, until: float) -> None:
    """Advance all trajectories to `end` [s], or by whole steps as far as `until` [s] where events need nothing but exact contact."""
    pair_events = PairEvents(run, end)
    run.plan.perform(run.plan.pairs, run, pair_events)  # sub-stepped islands, which of them sleep; broad phase
    finish_step(run, pair_events, until)


def finish_step(run: Run, pair_events: PairEvents, until: float) -> None:
    """The rest of a step whose pairs are known."""
    if pair_events.substepped_begun:  # members have been stepped from its begin on
        time, bodies = next_event(run, pair_events)
    else:
        time, bodies = pair_events.begin, pair_events.active_bodies()  # load: resting, jointed, pushed, sub-stepped
    while time < pair_events.end:
        time, bodies = run.compiled.advance(run, pair_events, (time, bodies), until)  # what needs nothing but exact contact
        if time < pair_events.end:
            react(run, pair_events, time, bodies)
            time, bodies = next_event(run, pair_events)
    run.state.time = pair_events.end
    run.plan.perform(run.plan.observe, run, pair_events.begin, pair_events.end)  # triggers


def go_on(run: Run, begin: float, end: float, may_leave: bool) -> None:
    """Advance all trajectories from the middle of a step, where the kernel of balls stopped, to its end; begin, end: of the step, s.

    may_leave: whether to end earlier, at an instant from which on all bodies fly freely again.
    """
    pair_events = PairEvents(run, end)
    run.plan.perform(run.plan.pairs, run, pair_events)
    pair_events.recall(begin)
    time, bodies = next_event(run, pair_events)
    while time < end:
        react(run, pair_events, time, bodies)
        if may_leave and pair_events.is_plain(time):
            run.state.time = time
            return
        time, bodies = next_event(run, pair_events)
    run.state.time = end


def next_event(run: Run, pair_events: PairEvents) -> tuple[float, np.ndarray]:
    """Time of the next event, that of the step's end if there is none, and the bodies to which it happens."""
    run.plan.perform(run.plan.time_of_impact, run, pair_events)  # of pairs of which a body has a new trajectory
    time = pair_events.next_time()  # an impact, or the end of a sub-step
    if time >= pair_events.end:
        return pair_events.end, np.zeros(0, np.int64)
    bodies = pair_events.bodies_at(time)
    pair_events.count_contacts(time)
    return time, bodies


def react(run: Run, pair_events: PairEvents, time: float, bodies: np.ndarray) -> None:
    """Everything that happens at `time` to the islands of the given bodies."""
    pair_events.wake[bodies] = np.inf
    islands, reached = touching_islands(run, pair_events, time, bodies)  # the contact graph at that instant
    arrive(run, islands, time, reached)  # sub-steps end: velocities are projected, joints closed, energy limited
    islands = run.substepped.join(run, pair_events, time, islands)  # with sub-stepped islands that they touch; says which regime
    let_go(run, pair_events, islands, time, reached)  # bodies that have left what they touched
    for island in islands:
        advance(run, pair_events, island)
    pair_events.settle(time)  # pairs that met without consequence


def advance(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Advance an island from its instant; the only place that knows both regimes."""
    plan = run.plan
    regime = plan.exact if island.is_exact else plan.substepped
    plan.perform(regime.impacts, run, pair_events, island)  # restitution, friction impulses
    plan.perform(regime.loads, run, pair_events, island)  # gravity, constant and varying forces, gyroscopic terms
    plan.perform(regime.contact_forces, run, pair_events, island)  # sub-step size; rows of contacts, joints, motors; sleep
    plan.perform(regime.trajectories, run, pair_events, island)  # along which path, until when; its pairs are swept again
