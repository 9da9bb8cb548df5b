"""Constant forces at the centre of mass against closed forms.

Laws. Free: x = x0 + v0 t + (g + F / m) t^2 / 2, whatever the body's rotation; momentum grows by the impulse (F + m g) t;
K - m g . x - F . x is constant. All are sums of a few terms, so rounding is some 1e-15 of the largest of them: bounds 1e-13
(an integrator of first order would be off by a h t / 2, 8e-3 here). Block on a floor: below mu m g it rests, to the bit; above
it x = (F / m - mu g) t^2 / 2, which the contact solver is to give to 1e-12 (a force left out of the load of the contact, or of
its start, moves it by percents). Lifting takes weight off: a = (F_x - mu (m g - F_z)) / m, and above m g the block flies.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

G, MASS, FRICTION = 9.81, 3.0, 0.5
ROUND_OFF = 1e-13


def block(*forces: tuple[float, float, float], velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> ri.Recording:
    """A block on a floor under constant forces, for 2 s."""
    material = ri.Material(static_friction=FRICTION, dynamic_friction=FRICTION)
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    scene.add(
        ri.Body("block", ri.Shape.box((0.4, 0.4, 0.1)), position=(0, 0, 0.05), velocity=velocity, mass=MASS, material=material)
    )
    for force in forces:
        scene.add(ri.ConstantForce("block", force))
    return ri.simulate(scene, 2.0)


def test_free_body_follows_the_parabola_and_turns_as_if_alone() -> None:
    def flight(*forces: ri.ConstantForce) -> ri.Recording:
        scene = ri.Scene(gravity=(0, 0, -G))
        start = {"position": (1.0, 2.0, 3.0), "velocity": (1.0, -2.0, 4.0), "angular_velocity": (0.1, 5.0, 0.2)}
        scene.add(ri.Body("body", ri.Shape.box((0.2, 0.4, 0.7)), mass=MASS, **start))
        for force in forces:
            scene.add(force)
        return ri.simulate(scene, 2.0)

    run, alone = flight(ri.ConstantForce("body", (6, 0, 9)), ri.ConstantForce("body", (0, -3, 0))), flight()
    force, t = np.array([6.0, -3.0, 9.0]), run.times[:, None]
    acceleration = force / MASS - (0, 0, G)
    path = (1.0, 2.0, 3.0) + t * (1.0, -2.0, 4.0) + 0.5 * t**2 * acceleration
    np.testing.assert_allclose(run.position("body"), path, rtol=0, atol=ROUND_OFF * np.abs(path).max())
    np.testing.assert_array_equal(run.orientation("body"), alone.orientation("body"))
    gained = run.ledger.momentum - run.ledger.momentum[0]
    np.testing.assert_allclose(gained, t * (force - (0, 0, MASS * G)), rtol=0, atol=ROUND_OFF * np.abs(gained).max())
    assert np.ptp(run.ledger.total) <= ROUND_OFF * run.ledger.kinetic.max()


def test_the_push_goes_on_between_impacts() -> None:
    """A ball between two walls, pushed to one of them, e = 1: it bounces there as under gravity, for ever to the same height."""
    scene, material = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=1.0)
    scene.add(ri.Body("wall", ri.Shape.half_space(normal=(1, 0, 0)), motion="static", material=material))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(1.1, 0, 0), mass=2.0, material=material))
    scene.add(ri.ConstantForce("ball", (-8.0, 0, 0)))
    run = ri.simulate(scene, 10.0)
    fall = np.sqrt(2 * 1.0 / 4.0)
    np.testing.assert_allclose(run.impacts["time"], fall * np.arange(1, 15, 2), rtol=1e-12)
    assert np.ptp(run.ledger.total) <= 1e-12 * run.ledger.kinetic.max()


@pytest.mark.parametrize("share", [0.5, 0.999])
def test_a_push_below_friction_moves_nothing(share: float) -> None:
    run = block((share * FRICTION * MASS * G, 0, 0))
    np.testing.assert_array_equal(run.velocity("block")[1:], 0.0)
    np.testing.assert_array_equal(run.position("block")[1:], [run.position("block")[1]] * (len(run.times) - 1))
    np.testing.assert_array_equal(run.position("block")[1, :2], 0.0)
    assert run.status.ok


@pytest.mark.parametrize("lift", [0.0, 0.5])
@pytest.mark.parametrize("share", [1.001, 3.0])
def test_a_push_above_friction_accelerates_by_what_is_left(share: float, lift: float) -> None:
    """The block touches at rest; a lift of half its weight halves the friction. The push is `share` of that friction."""
    friction = FRICTION * MASS * G * (1.0 - lift)
    run = block((share * friction, 0, 0), (0, 0, lift * MASS * G))
    way = 0.5 * (share - 1.0) * friction / MASS * run.times**2
    np.testing.assert_allclose(run.position("block")[:, 0], way, rtol=0, atol=1e-12 * share / (share - 1.0) * way[-1])
    # The solver leaves 1e-12 of the speed of a step, some 0.1 m/s at 0.2 m, a few times; a block that tips would be at 1e-1.
    assert np.abs(run.angular_velocity("block")).max() < 1e-11


def test_a_push_against_the_motion_stops_the_block_and_friction_holds_it_then() -> None:
    """v0 / (F / m + mu g) s after the start it stands; F is below mu m g, so it stays to the bit."""
    force, speed = 0.8 * FRICTION * MASS * G, 2.0
    run = block((-force, 0, 0), velocity=(speed, 0, 0))
    brake = force / MASS + FRICTION * G
    t = np.minimum(run.times, speed / brake)
    np.testing.assert_allclose(run.position("block")[:, 0], speed * t - 0.5 * brake * t**2, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(run.velocity("block")[run.times > speed / brake + 1 / 60], 0.0)


@pytest.mark.parametrize(("share", "flies"), [(0.999, False), (1.001, True), (2.0, True)])
def test_a_push_against_gravity(share: float, flies: bool) -> None:
    run = block((0, 0, share * MASS * G))
    height = run.position("block")[:, 2]
    if flies:
        # It is drawn touching: its gap of 0 is opened by the flight or, where that is slower, by the lift to the contact gap, 4e-7 m.
        np.testing.assert_allclose(height, 0.05 + 0.5 * (share - 1.0) * G * run.times**2, rtol=0, atol=5e-7)
        np.testing.assert_allclose(run.velocity("block")[:, 2], (share - 1.0) * G * run.times, rtol=1e-12, atol=1e-15)
    else:
        np.testing.assert_array_equal(run.velocity("block")[1:], 0.0)
        np.testing.assert_array_equal(height[1:], height[1])


def test_without_gravity_a_push_presses() -> None:
    """A body pushed against a wall by F and along it by 0.9 mu F stays; by 1.1 mu F it slides with 0.1 mu F / m."""
    for share in (0.9, 1.1):
        material = ri.Material(static_friction=FRICTION, dynamic_friction=FRICTION)
        scene = ri.Scene(gravity=(0, 0, 0))
        scene.add(ri.Body("wall", ri.Shape.half_space(normal=(1, 0, 0)), motion="static", material=material))
        scene.add(ri.Body("block", ri.Shape.box((0.1, 0.4, 0.4)), position=(0.05, 0, 0), mass=MASS, material=material))
        scene.add(ri.ConstantForce("block", (-10.0, 0, share * FRICTION * 10.0)))
        run = ri.simulate(scene, 2.0)
        way = 0.5 * max(share - 1.0, 0.0) * FRICTION * 10.0 / MASS * run.times**2
        np.testing.assert_allclose(run.position("block")[:, 2], way, rtol=0, atol=1e-11 * max(way[-1], 1e-300))


def test_the_plan_names_forces_only_where_they_act() -> None:
    def line(*forces: tuple[float, float, float]) -> tuple[bool, str]:
        return next((entry.included, entry.reason) for entry in block(*forces).plan.lines if entry.name == "constant forces")

    assert line() == (False, "no constant force acts")
    assert line((1, 0, 0), (-1, 0, 0)) == (False, "no constant force acts")
    included, reason = line((1, 0, 0))
    assert included and "block" in reason


@pytest.mark.parametrize(
    ("force", "words"),
    [
        (ri.ConstantForce("blok", (1, 0, 0)), "unknown body 'blok'; did you mean 'block'"),
        (ri.ConstantForce("floor", (1, 0, 0)), "body 'floor' is not dynamic"),
        (ri.ConstantForce("lift", (1, 0, 0)), "body 'lift' is not dynamic"),
        (ri.ConstantForce("block", (1, 0, float("nan"))), r"ConstantForce\('block'\).*force is"),
        (ri.ConstantForce("block", (1, 0)), "force is"),
    ],
)
def test_bad_forces_are_refused_by_name(force: ri.ConstantForce, words: str) -> None:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("lift", ri.Shape.box(1), position=(5, 0, 1), motion="kinematic", velocity=(0, 0, 1)))
    scene.add(ri.Body("block", ri.Shape.box(1), position=(0, 0, 1)))
    scene.add(force)
    with pytest.raises(ri.SceneError, match=words):
        ri.simulate(scene, 0.1)
