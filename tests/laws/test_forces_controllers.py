"""Controllers against the step response of a second-order system, and energy terms as forces (laws A15, A16).

Laws. m x'' + c x' + k x = k x*: z = c / (2 sqrt(k m)), w_0 = sqrt(k / m), w_d = w_0 sqrt(1 - z^2), x = x* [1 - exp(-z w_0 t)(cos w_d t +
z w_0 / w_d sin w_d t)] from rest, overshoot exp(-pi z / sqrt(1 - z^2)). The same about a principal axis with J, k_r, c_r. Velocity alone:
v = v* + (v_0 - v*) exp(-c t / m). Saturated: F_max / m. On keyframes of constant speed with a damping the lag dies out. A pin of weight k
is a spring of no length; a shape term keeps momentum, angular momentum and energy; with drag the bodies end where `settle` has the
minimum. Handgun, B6: M = (m v)^2 / (k d^2).
Tolerance: 1e-8 of the size inside each step, for 3 s 180 steps: 1e-7. A controller a step late is off by w_0 h, 1e-1.
"""

from __future__ import annotations

import numpy as np
import pytest
from forced_reference import Start, box_inertia, matrices, reference
from scipy.spatial.transform import Rotation

import rigidimpulse as ri

PATH = 1e-7
MASS, SIZE = 1.6, (0.4, 0.3, 0.7)
INERTIA = box_inertia(MASS, SIZE)


def held(*forces: object, duration: float = 3.0, gravity: float = 0.0, **start: object) -> ri.Recording:
    """A box under controllers."""
    scene = ri.Scene(gravity=(0, 0, -gravity))
    scene.add(ri.Body("box", ri.Shape.box(SIZE), mass=MASS, **start))
    for force in forces:
        scene.add(force)
    run = ri.simulate(scene, duration)
    assert run.status.ok, run.status.message
    return run


def step_response(t: np.ndarray, frequency: float, ratio: float) -> np.ndarray:
    """From 0 at rest to 1."""
    if ratio == 1.0:
        return 1.0 - np.exp(-frequency * t) * (1.0 + frequency * t)
    damped = frequency * np.sqrt(abs(1.0 - ratio**2))
    cos, sin = (np.cos, np.sin) if ratio < 1.0 else (np.cosh, np.sinh)
    return 1.0 - np.exp(-ratio * frequency * t) * (cos(damped * t) + ratio * frequency / damped * sin(damped * t))


@pytest.mark.parametrize("ratio", [0.0, 0.2, 1.0, 2.5])
def test_step_response_of_place_and_turn(ratio: float) -> None:
    """At once along a diagonal and about the third axis, with frequencies of their own."""
    k, k_r, aim, angle = 90.0, 3.0, np.array([0.6, -0.4, 0.5]), 2.0
    c, c_r = 2.0 * ratio * np.sqrt(k * MASS), 2.0 * ratio * np.sqrt(k_r * INERTIA[2, 2])
    turn = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
    hand = ri.PDController(
        "box", position=aim, orientation=turn, stiffness=k, damping=c, angular_stiffness=k_r, angular_damping=c_r
    )
    run = held(hand)
    x = step_response(run.times, np.sqrt(k / MASS), ratio)
    np.testing.assert_allclose(run.position("box"), x[:, None] * aim, rtol=0, atol=PATH)
    about = Rotation.from_quat(run.orientation("box")[:, [1, 2, 3, 0]]).as_rotvec()[:, 2]
    expected = angle * step_response(run.times, np.sqrt(k_r / INERTIA[2, 2]), ratio)
    np.testing.assert_allclose(np.angle(np.exp(1j * (about - expected))), 0.0, rtol=0, atol=10.0 * PATH)
    if ratio == 0.2:
        over = (run.position("box") @ aim).max() / (aim @ aim) - 1.0
        assert over == pytest.approx(np.exp(-np.pi * ratio / np.sqrt(1.0 - ratio**2)), abs=2e-3)


def test_any_turn_against_the_reference() -> None:
    """Torque k_r theta in space, about no principal axis, far from small angles."""
    k_r, c_r = 2.0, 0.05
    aim, start = Rotation.from_rotvec([1.2, -0.7, 0.9]), Rotation.from_rotvec([-0.4, 0.3, 0.8])
    q = start.as_quat()[[3, 0, 1, 2]]
    spin = (0.5, 1.0, -1.5)
    hand = ri.PDController("box", orientation=aim.as_quat()[[3, 0, 1, 2]], angular_stiffness=k_r, angular_damping=c_r)
    run = held(hand, orientation=q, angular_velocity=spin)

    def wrench(t, x, turn, v, w):
        return np.array([[0, 0, 0, *(k_r * (aim * Rotation.from_matrix(turn[0]).inv()).as_rotvec() - c_r * w[0])]])

    motion = reference([Start(MASS, INERTIA, orientation=tuple(q), angular_velocity=spin)], wrench, run.times)
    np.testing.assert_allclose(matrices(run.orientation("box")), motion.rotation[:, 0], rtol=0, atol=10.0 * PATH)


def test_the_centre_of_mass_away_from_the_origin() -> None:
    """The pose wished for is that of the body; force and torque act on its centre of mass, 0.2 m off, and it comes to the pose."""
    aim, turn = (0.5, 0.2, -0.3), (0.9, 0.1, 0.4, -0.2)
    gains = {"stiffness": 90.0, "damping": 20.0, "angular_stiffness": 8.0, "angular_damping": 1.5}
    hand = ri.PDController("box", position=aim, orientation=turn, **gains)
    run = held(hand, duration=6.0, center_of_mass=(0.1, 0.05, 0.2))
    np.testing.assert_allclose(run.position("box")[-1], aim, rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.abs(run.orientation("box")[-1] @ turn / np.linalg.norm(turn)), 1.0, rtol=0, atol=1e-9)


def test_velocity_alone() -> None:
    """A thermostat of speed: v* + (v_0 - v*) exp(-c t / m); spin about a principal axis likewise."""
    aim, v0, c, c_r = np.array([2.0, 0.0, -1.0]), np.array([-1.0, 3.0, 0.5]), 2.2, 0.06
    hand = ri.PDController("box", velocity=aim, angular_velocity=(0, 3, 0), damping=c, angular_damping=c_r)
    run = held(hand, velocity=v0, angular_velocity=(0, -1, 0))
    np.testing.assert_allclose(run.velocity("box"), aim + np.exp(-c * run.times / MASS)[:, None] * (v0 - aim), rtol=0, atol=PATH)
    spin = 3.0 - 4.0 * np.exp(-c_r * run.times / INERTIA[1, 1])
    np.testing.assert_allclose(run.angular_velocity("box")[:, 1], spin, rtol=0, atol=PATH)


def test_a_weak_hand_pulls_with_all_it_has() -> None:
    """max_force = 2 N, k 5 m away: x = F t^2 / 2 m until the spring is weaker; under gravity it cannot hold 16 N."""
    run = held(ri.PDController("box", position=(5, 0, 0), stiffness=100.0, max_force=2.0), duration=2.5)
    np.testing.assert_allclose(run.position("box")[:, 0], 1.0 / MASS * run.times**2, rtol=0, atol=1e-12)
    falls = held(ri.PDController("box", position=(0, 0, 0), stiffness=1e4, damping=100.0, max_force=2.0), gravity=9.81, duration=1.0)
    assert falls.velocity("box")[-1, 2] == pytest.approx(-(9.81 - 2.0 / MASS), abs=0.05)


def test_it_follows_keyframes() -> None:
    """Up a ramp of constant speed: the lag of an undamped start is the step response of speed; the reference has the kinks."""
    k, c, times = 60.0, 8.0, [0.0, 1.0, 2.0]
    path = ri.Keyframes(times, [(0, 0, 0), (1, 0, 0), (1, 2, 0)])
    run = held(ri.PDController("box", position=path, stiffness=k, damping=c))

    def part(begin: Start, after: np.ndarray, corner: tuple, speed: np.ndarray):
        def wrench(t, x, turn, v, w):
            return np.array([[*(k * (corner + (t - after[0]) * speed - x[0]) + c * (speed - v[0])), 0, 0, 0]])

        return reference([begin], wrench, after)

    begin = Start(MASS, INERTIA)
    for j, (corner, speed) in enumerate([((0, 0, 0), (1, 0, 0)), ((1, 0, 0), (0, 2, 0)), ((1, 2, 0), (0, 0, 0))]):
        frames = slice(60 * j, 60 * j + 61)
        motion = part(begin, run.times[frames], corner, np.array(speed))
        np.testing.assert_allclose(run.position("box")[frames], motion.position[:, 0], rtol=0, atol=PATH)
        begin = begin._replace(position=motion.position[-1, 0], velocity=motion.velocity[-1, 0])


def test_a_pin_is_a_spring_without_length_and_stores_energy() -> None:
    k, aim = 50.0, np.array([0.3, 0.5, -0.2])
    run = held(ri.EnergyForce(ri.PinPoints(None, "box", aim, (0, 0, 0), k)))
    x = (1.0 - np.cos(np.sqrt(k / MASS) * run.times))[:, None] * aim
    np.testing.assert_allclose(run.position("box"), x, rtol=0, atol=PATH)
    np.testing.assert_allclose(run.ledger.total, 0.5 * k * aim @ aim, rtol=0, atol=k * PATH)


def three_boxes(*forces: object, duration: float = 3.0) -> ri.Recording:
    """Three boxes that fly apart and tumble."""
    random = np.random.default_rng(5)
    scene = ri.Scene(gravity=(0, 0, 0))
    for k, name in enumerate("abc"):
        scene.add(
            ri.Body(
                name, ri.Shape.box((0.2, 0.3, 0.4)), mass=0.5 + k, position=(1.0 * k, 0.5 * k**2, 0), velocity=random.normal(size=3),
                angular_velocity=random.normal(size=3),
            )
        )  # fmt: skip
    for force in forces:
        scene.add(force)
    return ri.simulate(scene, duration)


def test_a_shape_that_is_restored_keeps_momentum_and_energy() -> None:
    run = three_boxes(ri.EnergyForce(ri.RestoreShape(["a", "b", "c"], 40.0), name="shape"))
    assert run.status.ok and not len(run.impacts)
    for kept, bound in ((run.ledger.momentum, 1e-12), (run.ledger.angular_momentum, 10.0 * PATH)):
        np.testing.assert_allclose(kept, np.broadcast_to(kept[0], kept.shape), rtol=0, atol=bound)
    np.testing.assert_allclose(run.ledger.total, run.ledger.total[0], rtol=0, atol=10.0 * PATH * run.ledger.kinetic.max())
    assert run.ledger.potential.max() > 0.1


def test_with_drag_a_chain_ends_where_settle_has_it() -> None:
    """Two rods on soft pins under gravity; equilibrium is the minimum of the same energies, to what motion is left, 1e-6."""
    pins = [ri.PinPoints(None, "one", (0, 0, 3), (0, 0, 3), 400.0), ri.PinPoints("one", "two", (0, 0, 2), (0, 0, 2), 300.0)]
    scene = ri.Scene(gravity=(0, 0, -9.81))
    for name, z in (("one", 2.5), ("two", 1.4)):
        scene.add(ri.Body(name, ri.Shape.capsule(0.05, 0.7), mass=1.0, position=(0, 0, z)))
    settled, report = ri.settle(scene, [*pins, ri.GravityPotential()])
    assert report.ok
    for pin in pins:
        scene.add(ri.EnergyForce(pin))
    scene.add(ri.Drag(linear=4.0))
    run = ri.simulate(scene, 8.0)
    for name in ("one", "two"):
        np.testing.assert_allclose(run.position(name)[-1], settled[name].position, rtol=0, atol=1e-6)
        assert abs(run.position(name)[-1, 2] - run.position(name)[0, 2]) > 0.02


@pytest.mark.parametrize("mass", [0.6, 2.0])
def test_handgun_in_a_hand_that_is_a_spring(mass: float) -> None:
    """Recoil m_b v_b, then a quarter of a swing: d = m_b v_b / sqrt(k M), so M = (m_b v_b)^2 / (k d^2)."""
    k, shot = 200.0, 0.0075 * 350.0
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("gun", ri.Shape.box((0.2, 0.03, 0.12)), mass=mass, velocity=(-shot / mass, 0, 0)))
    scene.add(ri.PDController("gun", position=(0, 0, 0), stiffness=k))
    quarter = 0.5 * np.pi * np.sqrt(mass / k)
    run = ri.simulate(scene, quarter, fps=64.0 / quarter)
    d = -run.position("gun")[-1, 0]
    assert shot**2 / (k * d**2) == pytest.approx(mass, rel=PATH)
    assert abs(run.velocity("gun")[-1, 0]) < 10.0 * PATH
