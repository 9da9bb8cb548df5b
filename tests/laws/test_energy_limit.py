"""The energy limiter takes off the energy that constant contact forces gave too much, and changes nothing else.

Laws. From bodies that only touch each other, energy E is taken off their motion against each other: their momentum sum m v and angular
momentum sum (x x m v + I w) stay, their kinetic energy falls by E, and never below that of the rigid body they would be. Where what stands
takes part it is all their motion: it falls by E, and momentum goes to the ground. Sums of ten terms of size 10 round to 1e-14 of
their parts; 1e-12 is asked. A common spin left out of the motion (W = 0) moves the angular momentum by a tenth and more, and so does one
found without the parts m r^2 of the inertia.

In a run the energy of two bodies that roll on each other, pressed together by steady forces, never grows from step to step but by rounding:
the limiter leaves alone what is below 1e-11 of the kinetic energy in a sub-step, and there are some hundred sub-steps: 1e-9. Without the
limiter it grows by 3e-7 of it and more here. An island taken for a grounded one would lose its common motion.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.engine.exact.energy_limit import Ground, note_hold, take_off
from rigidimpulse.engine.simulate import complete, prepare
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.model.state import EnergyLimiter, make_energy_limiter
from rigidimpulse.model.world import BodyConstants
from rigidimpulse.motion.body_state import BodyState

G = 9.81
BODIES = 6
MEMBERS = np.array([0, 2, 3, 5])
STANDS = (0.0, 0.0, 0.0)
NO_GROUND, SMOOTH_FLOOR, SMOOTH_CORNER, ROUGH_GROUND = (Ground(rank, STANDS, (0.0, 0.0, 1.0)) for rank in range(4))
"""Ground that pushes in no direction, along z, along x and y (across z), in all."""
ROUND_OFF = 1e-12
DRIFT = (0.6, -0.4, 0.2)
"""m/s, of all free bodies."""
ROUGH = ri.Material(static_friction=1.0, dynamic_friction=1.0, restitution=0.0)


def moving_bodies(seed: int) -> tuple[BodyState, SimpleNamespace, np.ndarray]:
    """Bodies of masses over three decades in full motion: their state, world and inertia tensors (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    mass = 10.0 ** rng.uniform(-1.5, 1.5, BODIES)
    axes = np.linalg.qr(rng.normal(size=(BODIES, 3, 3)))[0]
    inertia = np.einsum("n,nij,nj,nkj->nik", mass, axes, rng.uniform(0.5, 0.9, (BODIES, 3)), axes)
    x, v, w = rng.normal(scale=3.0, size=(3, BODIES, 3))
    now = BodyState(x, np.tile([1.0, 0, 0, 0], (BODIES, 1)), v, w + [5.0, -3.0, 2.0], 1.0 / mass, np.linalg.inv(inertia))
    return now, SimpleNamespace(mass=mass), inertia


def kept(now: BodyState, world, inertia) -> tuple[float, np.ndarray, np.ndarray]:
    """Kinetic energy, momentum and angular momentum about the origin of the members."""
    m, x, v, w = world.mass[MEMBERS, None], now.position[MEMBERS], now.velocity[MEMBERS], now.angular_velocity[MEMBERS]
    spin = np.einsum("nij,nj->ni", inertia[MEMBERS], w)
    kinetic = 0.5 * float((m * v * v).sum() + (w * spin).sum())
    return kinetic, (m * v).sum(axis=0), (np.cross(x, m * v) + spin).sum(axis=0)


def size_of(now: BodyState, world) -> float:
    """Sum of |m v| and of |x| |m v| of all bodies, the size of what cancels in the sums."""
    push = world.mass * np.linalg.norm(now.velocity, axis=1)
    return float(push @ (1.0 + np.linalg.norm(now.position, axis=1)))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [1e-8, 0.3])
def test_free_bodies_lose_the_energy_and_keep_both_momenta(seed: int, share: float) -> None:
    now, world, inertia = moving_bodies(seed)
    kinetic, momentum, angular = kept(now, world, inertia)
    others = np.setdiff1d(np.arange(BODIES), MEMBERS)
    before, speeds = size_of(now, world), now.velocity[others].copy()
    # Some of the energy is that of the common motion; of the rest, what bodies have against each other, a part is asked for.
    rest = kinetic - rigid_energy(now, world, inertia)
    take_off(now, world.mass, MEMBERS, share * rest, NO_GROUND)
    after = kept(now, world, inertia)
    assert kinetic - after[0] == pytest.approx(share * rest, rel=ROUND_OFF / share, abs=0.0)
    np.testing.assert_allclose(after[1], momentum, atol=ROUND_OFF * before)
    np.testing.assert_allclose(after[2], angular, atol=ROUND_OFF * before)
    np.testing.assert_array_equal(now.velocity[others], speeds)


def rigid_energy(now: BodyState, world, inertia) -> float:
    """Least kinetic energy with the momenta of the members: p^2 / 2 M + L.J^-1 L / 2 about their common centre."""
    m, x = world.mass[MEMBERS], now.position[MEMBERS]
    _, momentum, angular = kept(now, world, inertia)
    center = m @ x / m.sum()
    about = angular - np.cross(center, momentum)
    whole = sum(i + k * ((r @ r) * np.eye(3) - np.outer(r, r)) for i, k, r in zip(inertia[MEMBERS], m, x - center, strict=True))
    return 0.5 * float(momentum @ momentum / m.sum() + about @ np.linalg.solve(whole, about))


@pytest.mark.parametrize("seed", range(3))
def test_no_more_is_taken_than_free_bodies_have_against_each_other(seed: int) -> None:
    now, world, inertia = moving_bodies(seed)
    kinetic, momentum, angular = kept(now, world, inertia)
    least, before = rigid_energy(now, world, inertia), size_of(now, world)
    take_off(now, world.mass, MEMBERS, kinetic, NO_GROUND)
    after = kept(now, world, inertia)
    assert after[0] == pytest.approx(least, rel=ROUND_OFF * kinetic / least)
    np.testing.assert_allclose(after[1], momentum, atol=ROUND_OFF * before)
    np.testing.assert_allclose(after[2], angular, atol=ROUND_OFF * before)
    np.testing.assert_allclose(np.ptp(now.angular_velocity[MEMBERS], axis=0), 0.0, atol=ROUND_OFF * 10.0)


def test_on_smooth_ground_level_momentum_and_upright_spin_stay() -> None:
    now, world, inertia = moving_bodies(11)
    kinetic, momentum, angular = kept(now, world, inertia)
    before = size_of(now, world)
    take_off(now, world.mass, MEMBERS, 0.05 * kinetic, SMOOTH_FLOOR)
    after = kept(now, world, inertia)
    assert kinetic - after[0] == pytest.approx(0.05 * kinetic, rel=ROUND_OFF * 20)
    np.testing.assert_allclose(after[1][:2], momentum[:2], atol=ROUND_OFF * before)
    assert after[2][2] == pytest.approx(angular[2], abs=ROUND_OFF * before)
    # What the ground may change does change: slowing all by one factor would change the level momentum by 2.5 %.
    assert abs(after[1][2] - momentum[2]) > 0.01 * abs(momentum[2])


def test_in_a_smooth_corner_momentum_along_the_edge_stays() -> None:
    now, world, inertia = moving_bodies(12)
    kinetic, momentum, angular = kept(now, world, inertia)
    before = size_of(now, world)
    take_off(now, world.mass, MEMBERS, 0.05 * kinetic, SMOOTH_CORNER)
    after = kept(now, world, inertia)
    assert kinetic - after[0] == pytest.approx(0.05 * kinetic, rel=ROUND_OFF * 20)
    assert after[1][2] == pytest.approx(momentum[2], abs=ROUND_OFF * before)
    # Walls may turn bodies about every axis, and push across the edge: slowing them changes the rest by some per cent.
    assert np.all(np.abs(after[1][:2] - momentum[:2]) > 0.01 * np.abs(momentum[:2]))
    assert np.all(np.abs(after[2] - angular) > 0.001 * np.abs(angular))


@pytest.mark.parametrize(
    ("normals", "rank", "axis"),
    [
        ([(0, 0, 1), (0, 0, -1), (1e-7, 0, 1)], 1, (0, 0, 1)),
        ([(0, 0, 1), (1e-5, 0, 1)], 2, (0, 1, 0)),
        ([(0, 0, 1), (0.6, 0, 0.8), (-0.6, 1e-7, 0.8)], 2, (0, 1, 0)),
        ([(0, 0, 1), (0.6, 0, 0.8), (-0.6, 1e-5, 0.8)], 3, None),
    ],
)
def test_directions_that_differ_by_less_than_a_millionth_are_one(normals, rank: int, axis) -> None:
    """Sines of angles: 1e-7 counts as none, 1e-5 does not. Cosines would tell neither from 1."""
    limiter = ground_below(normals)
    assert limiter.closed[1] and limiter.ground_rank[1] == rank
    if axis is not None:
        np.testing.assert_allclose(np.abs(limiter.ground_axis[1]), axis, atol=2e-7)


def test_ground_that_turns_or_moves_apart_may_give_energy() -> None:
    up = [(0, 0, 1), (0, 0, 1)]
    assert ground_below(up).closed[1]
    assert not ground_below(up, spin=1.0).closed[1]
    assert not ground_below(up, passive=False).closed[1]
    # A floor that moves, alone and with the world, which stands.
    moving = ground_below(up, velocity=(1.0, 2.0, 3.0))
    assert moving.closed[1] and moving.ground_velocity[1].tolist() == [1.0, 2.0, 3.0]
    assert not ground_below(up, velocity=(1.0, 2.0, 3.0), supports=(-1,)).closed[1]
    # What joints hold to the world has no motion that nothing changes.
    assert ground_below(up, supports=(-1,)).ground_rank[1] == 3


def ground_below(normals, velocity=STANDS, spin=0.0, supports=(), passive=True) -> EnergyLimiter:
    """What is noted of the smooth bodies 1 and 2, that touch each other along x and body 0, which is not dynamic, along the normals."""
    m, zeros = len(normals) + 1, np.zeros((3, 3))
    normal = np.array([*normals, (1.0, 0.0, 0.0)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    body_a, body_b = np.array([0] * (m - 1) + [1]), np.array([1] * (m - 1) + [2])
    contacts = Contacts(body_a, body_b, np.zeros((m, 3)), np.zeros((m, 3)), normal, *np.zeros((5, m)))
    bodies = BodyState(zeros, np.zeros((3, 4)), zeros.copy(), zeros.copy(), np.ones(3), np.tile(np.eye(3), (3, 1, 1)))
    bodies.velocity[0], bodies.angular_velocity[0, 2] = velocity, spin
    ones, dynamic, number = np.ones(3), np.array([False, True, True]), np.zeros(3, np.int64)
    constants = BodyConstants(ones, np.ones((3, 3)), zeros, ones, ones, ones, dynamic, ~dynamic, dynamic, number, number)
    limiter = make_energy_limiter(3)
    note_hold(limiter, bodies, constants, contacts, np.array([1, 2]), np.array(supports, np.int64), passive)
    assert limiter.sharing[1:].tolist() == [1, 1]
    return limiter


def test_on_rough_ground_all_motion_is_slowed_by_one_factor() -> None:
    now, world, inertia = moving_bodies(7)
    kinetic, _, _ = kept(now, world, inertia)
    v, w = now.velocity.copy(), now.angular_velocity.copy()
    take_off(now, world.mass, MEMBERS, 0.19 * kinetic, ROUGH_GROUND)
    np.testing.assert_allclose(now.velocity[MEMBERS], 0.9 * v[MEMBERS], rtol=ROUND_OFF)
    np.testing.assert_allclose(now.angular_velocity[MEMBERS], 0.9 * w[MEMBERS], rtol=ROUND_OFF)
    take_off(now, world.mass, MEMBERS, 2.0 * kinetic, ROUGH_GROUND)
    assert not now.velocity[MEMBERS].any() and not now.angular_velocity[MEMBERS].any()


def pressed(shape: ri.Shape, below: ri.Shape, place) -> ri.Scene:
    """Two bodies in free space that steady forces press together, spinning against each other and drifting."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("below", below, mass=3.0, material=ROUGH, velocity=DRIFT, angular_velocity=(0, 0, 0.3)))
    scene.add(ri.Body("above", shape, position=place, mass=1.0, material=ROUGH, velocity=DRIFT, angular_velocity=(1.5, 1.3, 2.0)))
    scene.add(ri.ConstantForce("below", (0, 0, 10)))
    scene.add(ri.ConstantForce("above", (0, 0, -10)))
    return scene


def two_balls() -> ri.Scene:
    return pressed(ri.Shape.sphere(0.25), ri.Shape.sphere(0.5), (0.2, 0, np.sqrt(0.75**2 - 0.2**2)))


def egg_on_a_box() -> ri.Scene:
    egg = ri.Shape.convex_hull(np.asarray(trimesh.creation.icosphere(2).vertices) * (0.3, 0.3, 0.5))
    return pressed(egg, ri.Shape.box((1, 1, 1)), (0.2, 0.1, 1.001))


def rocking_egg() -> ri.Scene:
    """An egg that rocks on what stands."""
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    egg = ri.Shape.convex_hull(np.asarray(trimesh.creation.icosphere(2).vertices) * (0.3, 0.3, 0.5))
    scene.add(ri.Body("egg", egg, position=(0, 0, 0.501), mass=1.0, material=ROUGH, angular_velocity=(1.0, 0.5, 0.0)))
    return scene


def rise(run: ri.Recording) -> float:
    """Largest growth of the energy from an earlier frame to a later one, of the greatest kinetic energy."""
    total = run.ledger.total
    return float((total - np.minimum.accumulate(total)).max() / run.ledger.kinetic.max())


@pytest.mark.parametrize("scene", [two_balls, egg_on_a_box, rocking_egg])
def test_energy_never_grows_in_a_run(scene) -> None:
    guarded = ri.simulate(scene(), 1.0, fps=60)
    assert guarded.status.ok, guarded.status.message
    assert guarded.ledger.dissipated["energy correction"][-1] > 0.0
    assert rise(guarded) < 1e-9
    unlimited = prepare(scene(), guarded.times)
    unlimited.state.limiter = unlimited.state.limiter._replace(gain=np.inf)
    loose = complete(unlimited, 1.0)
    assert "energy correction" not in loose.ledger.dissipated
    assert rise(loose) > 1e-7


@pytest.mark.parametrize("scene", [two_balls, egg_on_a_box])
def test_free_bodies_keep_their_momentum_in_a_run(scene) -> None:
    run = ri.simulate(scene(), 1.0, fps=60)
    parts = 3.0 * np.abs(run.velocity("below")).max() + np.abs(run.velocity("above")).max()
    np.testing.assert_allclose(run.ledger.momentum, run.ledger.momentum[:1] + np.zeros((len(run.times), 1)), atol=ROUND_OFF * parts)


def test_a_support_that_moves_by_itself_may_give_energy() -> None:
    """A belt of speed V takes a block along: m V^2 / 2 within V / (mu g), none of which is a gain to be taken off."""
    speed, mu = 1.0, 0.5
    scene = ri.Scene(gravity=(0, 0, -G))
    rough = ri.Material(static_friction=mu, dynamic_friction=mu, restitution=0.0)
    belt = {"position": (0, 0, -0.5), "velocity": (speed, 0, 0)}
    scene.add(ri.Body("belt", ri.Shape.box((20, 2, 1)), motion="kinematic", material=rough, **belt))
    scene.add(ri.Body("block", ri.Shape.box((0.2, 0.2, 0.1)), position=(0, 0, 0.05), material=rough))
    run = ri.simulate(scene, 0.5)
    np.testing.assert_allclose(run.velocity("block")[:, 0], np.minimum(mu * G * run.times, speed), atol=1e-9)
    assert "energy correction" not in run.ledger.dissipated
