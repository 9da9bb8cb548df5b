"""Loads: accelerations of the bodies of an island without contacts and joints, by gravity, constant forces and the gyroscopic term.

    a = factor g + sum F / m,    alpha = -I^-1 (w x I w)

Forces that vary are added where the length of the sub-step is known (`VaryingForces.load`).
"""

from __future__ import annotations

from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island
from rigidimpulse.motion.evaluate import bring_gyroscopic


def set_steady_load(run: Run, _pair_events: PairEvents, island: Island) -> None:
    """Gravity and constant forces."""
    run.acceleration[island.members] = run.world.steady_acceleration[island.members]
    run.angular_acceleration[island.members] = 0.0


def add_gyroscopic_term(run: Run, _pair_events: PairEvents, island: Island) -> None:
    """Gyroscopic term of the members."""
    state = run.state
    bring_gyroscopic(island.members, state.now, state.rotation, state.trajectory.inertia, run.angular_acceleration)


def keep_steady_load(run: Run, _pair_events: PairEvents, island: Island) -> None:
    """Keep the members' accelerations without varying forces, if these act on one of them."""
    if run.forces.acts[island.members].any():
        island.free = run.acceleration[island.members], run.angular_acceleration[island.members]


def load_over(run: Run, island: Island, h: float) -> float:
    """Take varying forces as constant over a sub-step of h s at most; returns how long it may be."""
    return h if island.free is None else run.forces.load(run, island, h)
