"""Assertions for tests of other projects: what a run of a scene must keep, whatever the scene.

    from rigidimpulse import testing

    def test_my_scene():
        run = ri.simulate(my_scene(), 4.0)
        testing.assert_finite(run)
        testing.assert_energy_never_grows(run)
        testing.assert_no_penetration(run)
        testing.assert_comes_to_rest(run, by=3.0)

Each raises an AssertionError that names bodies, time and value.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.recording.recording import Recording

ROUNDING = 1e-12
"""Of the energy that moves."""
PULLED = 1e-5
"""Of the energy that moves, that lasting contacts of round and turning bodies may make between impacts."""
DEPTH = 1e-6
"""Of a body's size: deeper overlaps are found."""


def assert_finite(run: Recording) -> None:
    """Every number of every frame is finite."""
    for what in ("positions", "orientations", "velocities", "angular_velocities"):
        finite = np.isfinite(getattr(run, what)).all(axis=2)
        if not finite.all():
            frame, body = np.argwhere(~finite)[0]
            raise AssertionError(f"{what} of {run.names[body]!r} are not finite from {run.times[frame]:.6g} s on: {run.status.message}")


def assert_energy_never_grows(run: Recording, tolerance: float = PULLED) -> None:
    """Kinetic and potential energy together never rise above what they were: for scenes in which nothing feeds energy in.

    Args:
        run: with a ledger, of bodies that gravity and constant forces move, without motors, thrusters or moving supports.
        tolerance: allowed rise, of the energy that moves. The energy that raises bodies to their contact
            margins (1e-6 of a size each) is allowed, too.

    """
    ledger = run.ledger
    if ledger is None:
        raise SceneError("a loaded recording has no ledger", "ask the run that simulate() returned")
    total = ledger.total
    rise = total - np.minimum.accumulate(total)
    moved = float(ledger.kinetic.max() + np.ptp(ledger.potential))
    allowed = max(tolerance, ROUNDING) * moved + _rises(run)
    if rise.max() > allowed:
        at = run.times[int(np.argmax(rise))]
        share = rise.max() / moved if moved > 0.0 else np.inf
        grown = f"energy grew by {rise.max():.3g} J until {at:.6g} s"
        raise AssertionError(f"{grown}, {share:.2g} of what moves; allowed {allowed:.2g} J")


def _rises(run: Recording) -> float:
    """Work against gravity of lifting every dynamic body by its contact margin and those of all below it, J."""
    if run.scene is None:
        return 0.0
    from rigidimpulse.engine.compile_scene import compile_scene

    world = compile_scene(run.scene)
    weight = np.where(world.dynamic, world.mass, 0.0) * np.linalg.norm(world.steady_acceleration, axis=1)
    gaps = TOLERANCES.contact.margin * float(world.size[world.dynamic].sum())
    return 2.0 * gaps * float(weight.sum())


def assert_no_penetration(run: Recording, depth: float | None = None) -> None:
    """No two bodies are inside each other, in up to 120 frames that are looked at.

    Args:
        run: with its scene.
        depth: m, allowed; 1e-6 of the smallest dynamic body's size by default.

    """
    from rigidimpulse.engine.compile_scene import compile_scene
    from rigidimpulse.studies.measures import penetration

    world = compile_scene(_scene_of(run))
    allowed = depth if depth is not None else DEPTH * float(world.size[world.dynamic].min(initial=1.0))
    found = np.nan_to_num(penetration(world, run))
    if found.max() > allowed:
        at = run.times[int(np.argmax(found > allowed))]
        raise AssertionError(f"bodies are inside each other by up to {found.max():.3g} m, first at {at:.6g} s; allowed {allowed:.2g} m")


def assert_comes_to_rest(run: Recording, by: float | None = None, speed: float = 0.0, bodies: list[str] | None = None) -> None:
    """Bodies stand still from a time on until the end.

    Args:
        run: a recording.
        by: s; the last frame if None.
        speed: m/s of the centre of mass, and rad/s, that count as rest; bodies at rest have exactly 0.
        bodies: names; all dynamic ones if None.

    """
    time = float(run.times[-1]) if by is None else by
    names = bodies if bodies is not None else [body.name for body in _scene_of(run).bodies if body.motion == "dynamic"]
    seen = run.times >= time
    if not seen.any():
        raise AssertionError(f"the run ends at {run.times[-1]:.6g} s, before {time:.6g} s")
    for name in names:
        fast = np.maximum(np.linalg.norm(run.velocity(name), axis=1), np.linalg.norm(run.angular_velocity(name), axis=1))[seen]
        if not fast.max() <= speed:
            at = run.times[seen][int(np.argmax(fast > speed))]
            raise AssertionError(f"{name!r} still moves at {at:.6g} s, with {fast.max():.3g} m/s or rad/s")


def assert_same_motion(run: Recording, other: Recording | str) -> None:
    """Two runs agree in every bit, or a run has the hash (`Recording.state_hash`) that was written down."""
    expected = other if isinstance(other, str) else other.state_hash()
    if run.state_hash() == expected:
        return
    if isinstance(other, str):
        raise AssertionError(f"the motion has the hash {run.state_hash()}, not {expected}")
    from rigidimpulse.studies.deviation import deviation

    apart = deviation(run, other)
    frame, body = np.unravel_index(int(np.argmax(apart.distance)), apart.distance.shape)
    far = f"{apart.distance[frame, body]:.3g} m at {run.times[frame]:.6g} s, {run.names[int(body)]!r}"
    raise AssertionError(f"the motions differ, most by {far}")


def _scene_of(run: Recording):
    if run.scene is None:
        raise SceneError("a loaded recording has no shapes", "ask the run that simulate() returned")
    return run.scene
