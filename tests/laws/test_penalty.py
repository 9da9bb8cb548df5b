"""A2, the penalty method, against closed forms; and what it cannot do, beside impulses, which can.

Laws (w = sqrt(k / m), z = c / (2 sqrt(k m))): contact lasts pi / w and is v / w deep; with damping it ends, without pull, after
(pi - 2 asin z) / (w sqrt(1 - z^2)) with e = exp(-z (pi - 2 asin z) / sqrt(1 - z^2)); a block on four corners sinks by m g / (4 k); it slows
by mu g. Steps are of order 4 and end where contact begins and ends, each off by 1e-8 of the size at most and some hundred of them in a
contact, most of it far below: bounds 1e-6. Steps that ran across the beginning of contact with damping would be off by c h / m, 1e-2.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate

G, RADIUS, SPEED, GAP = 9.81, 0.1, 2.0, 0.05
START = GAP / SPEED


def penalty(**settings) -> ri.Accuracy:
    return ri.Accuracy(response="penalty", **settings)


def bounce(time: float, accuracy: ri.Accuracy, mass: float = 1.0, e: float = 1.0, speed: float = SPEED) -> ri.Recording:
    """A ball against a plane, without gravity and friction; frames at the start and at `time`."""
    scene, material = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=e, static_friction=0.0)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    place = {"position": (0, 0, RADIUS + GAP), "velocity": (0, 0, -speed)}
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), mass=mass, material=material, **place))
    return ri.simulate(scene, time, fps=1.0 / time, accuracy=accuracy)


def height(run: ri.Recording) -> float:
    """Of the ball's lowest point at the end, m."""
    return float(run.position("ball")[-1, 2]) - RADIUS


def speed(run: ri.Recording) -> float:
    return float(run.velocity("ball")[-1, 2])


@pytest.mark.parametrize(("stiffness", "mass"), [(1e3, 0.1), (1e4, 1.0), (1e6, 3.0), (1e5, 40.0)])
def test_contact_lasts_and_sinks_as_a_spring(stiffness: float, mass: float) -> None:
    w, accuracy = math.sqrt(stiffness / mass), penalty(penalty_stiffness=stiffness, penalty_damping=0.0)
    deepest = bounce(START + 0.5 * math.pi / w, accuracy, mass)
    assert height(deepest) == pytest.approx(-SPEED / w, rel=1e-6)
    assert abs(speed(deepest)) < 1e-6 * SPEED
    end = START + math.pi / w + 0.02
    after = bounce(end, accuracy, mass)
    assert end - START - height(after) / speed(after) == pytest.approx(math.pi / w, rel=1e-6)
    assert speed(after) == pytest.approx(SPEED, rel=1e-6)


@pytest.mark.parametrize("z", [0.01, 0.1, 0.3, 0.7, 0.99, 1.5])
def test_a_damper_that_never_pulls(z: float) -> None:
    w, mass = 100.0, 2.0
    run = bounce(0.4, penalty(penalty_stiffness=w * w * mass, penalty_damping=2.0 * z * w * mass), mass)
    if z < 1.0:
        root = math.sqrt(1.0 - z * z)
        e, lasts = math.exp(-z * (math.pi - 2.0 * math.asin(z)) / root), (math.pi - 2.0 * math.asin(z)) / (w * root)
        # Where the push ends the ball still is inside, k d = c e v.
        left = -2.0 * z * e * SPEED / w
        assert height(run) == pytest.approx(left + e * SPEED * (0.4 - START - lasts), rel=1e-6)
    else:
        e = math.exp(-2.0 * z * math.acosh(z) / math.sqrt(z * z - 1.0))
    assert speed(run) == pytest.approx(e * SPEED, abs=1e-6 * SPEED)


def test_the_textbook_restitution_is_that_of_little_damping() -> None:
    """exp(-pi z / sqrt(1 - z^2)) is that of a damper that pulls at the end; without pull e is larger by 2 z^2 of it, to first order."""
    w, z = 100.0, 0.02
    e = speed(bounce(0.2, penalty(penalty_stiffness=w * w, penalty_damping=2.0 * z * w))) / SPEED
    textbook = math.exp(-math.pi * z / math.sqrt(1.0 - z * z))
    assert e / textbook - 1.0 == pytest.approx(2.0 * z * z, rel=0.01)


@pytest.mark.parametrize("e", [1.0, 0.8, 0.5, 0.2, 0.05])
def test_left_to_itself_it_finds_stiffness_and_damping(e: float) -> None:
    """The damping gives the pair's restitution; the stiffness lets the ball in by 2 % of its size at the speed of the start."""
    run = bounce(0.1, penalty(), e=e)
    assert speed(run) == pytest.approx(e * SPEED, abs=1e-6 * SPEED)
    assert height(bounce(START + 0.5 * math.pi * 0.02 * 2.0 * RADIUS / SPEED, penalty(), e=1.0)) == pytest.approx(-0.004, rel=1e-6)
    assert "N/m" in run.plan.line("penalty forces").reason and len(run.impacts) == 0 and run.status.ok
    lost = 0.5 * SPEED**2 * (1.0 - e * e)
    assert run.ledger.dissipated["penalty"][-1] == pytest.approx(lost, abs=1e-6)


def off_centre(accuracy: ri.Accuracy, friction: float = 0.0) -> ri.Recording:
    """A ball hits a box in flight off its centre, e = 1."""
    scene, material = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=1.0, static_friction=friction)
    scene.add(ri.Body("box", ri.Shape.box((0.2, 0.6, 0.4)), mass=2.0, material=material))
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), position=(-0.4, 0.2, 0.1), velocity=(3, -0.5, 0.2), mass=1.0, material=material))
    return ri.simulate(scene, 0.2, accuracy=accuracy)


def test_two_bodies_keep_their_momenta() -> None:
    """To round-off, and angular momentum to the error of the steps; without friction energy, too."""
    ledger = off_centre(penalty(penalty_stiffness=1e5), friction=0.4).ledger
    assert np.ptp(ledger.momentum, axis=0).max() < 1e-13
    assert np.ptp(ledger.angular_momentum, axis=0).max() < 1e-6
    assert ledger.dissipated["penalty"][-1] > 1e-3
    smooth = off_centre(penalty(penalty_stiffness=1e5)).ledger
    assert smooth.total[-1] == pytest.approx(smooth.total[0], rel=1e-5)


def test_stiff_springs_tend_to_the_impulse() -> None:
    """Off the impulse's velocities by what turns during contact, as pi / w: ten times less at a hundred times the stiffness."""
    exact = off_centre(ri.Accuracy())
    assert len(exact.impacts) == 1
    errors = []
    for stiffness in (1e5, 1e7):
        run = off_centre(penalty(penalty_stiffness=stiffness))
        errors.append(max(np.abs(run.velocity(n)[-1] - exact.velocity(n)[-1]).max() for n in ("ball", "box")))
    assert errors[0] < 0.1 and 8.0 < errors[0] / errors[1] < 12.0


def block(accuracy: ri.Accuracy, speed: float, time: float, sunk: float = 0.0) -> ri.Recording:
    """A block of 2 kg on a floor, mu = 0.4."""
    scene, material = ri.Scene(gravity=(0, 0, -G)), ri.Material(static_friction=0.4, restitution=0.3)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    place = {"position": (0, 0, 0.05 - sunk), "velocity": (speed, 0, 0)}
    scene.add(ri.Body("block", ri.Shape.box((0.4, 0.4, 0.1)), mass=2.0, material=material, **place))
    return ri.simulate(scene, time, accuracy=accuracy)


def test_a_block_sinks_at_rest_by_its_weight() -> None:
    """To what steps may be off, 1e-8 of the size; with one corner more or less under load it would be off by 1e-5 m."""
    stiffness = 1e5
    run = block(penalty(penalty_stiffness=stiffness), 0.0, 1.0)
    depth = 2.0 * G / (4.0 * stiffness)
    assert 0.05 - run.position("block")[-1, 2] == pytest.approx(depth, abs=5e-9)
    assert run.ledger.potential[-1] - 2.0 * G * run.position("block")[-1, 2] == pytest.approx(2.0 * stiffness * depth**2, rel=1e-4)
    impulses = block(ri.Accuracy(), 0.0, 1.0)
    assert impulses.position("block")[-1, 2] >= 0.05


def test_friction_slows_by_mu_g() -> None:
    """Friction is a damper below mu N / c_t, with m = 1 / n.K n = 0.27 kg at a corner, 6e-3 m/s: at 2 m/s that is 5e-6 of the force.

    The load moves to the front corners by mu h / w of it and swings: 1e-3. Without mu or its load the error would be all of mu g t."""
    stiffness, v = 1e5, 3.0
    run = block(penalty(penalty_stiffness=stiffness), v, 0.25, sunk=2.0 * G / (4.0 * stiffness))
    lost = v - run.velocity("block")[-1, 0]
    assert lost == pytest.approx(0.4 * G * 0.25, rel=1e-3)
    stopped = block(penalty(penalty_stiffness=stiffness), 0.3, 0.5)
    assert abs(stopped.velocity("block")[-1, 0]) < 1e-4


def ground(kind: str) -> ri.Shape:
    """A floor, its top 0.5 m above its origin."""
    if kind == "half space":
        return ri.Shape.half_space((0, 0, 1), 0.5)
    if kind == "box":
        return ri.Shape.box((10, 10, 1))
    corners = [(a, b, c) for a in (-5.0, 5.0) for b in (-5.0, 5.0) for c in (-0.5, 0.5)]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return ri.Shape.mesh(corners, [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))])


@pytest.mark.parametrize("kind", ["half space", "box", "mesh"])
@pytest.mark.parametrize("spin", [0.0, 10.0])
def test_balls_and_capsules_come_to_roll(kind: str, spin: float) -> None:
    """Angular momentum about the line of contact is kept, w = v / r at the end: v = (v0 + i r w0) / (1 + i), i = I / (m r^2).

    A ball that slides at 1 m/s ends with 5/7 m/s, one that rolls (w0 = 10 rad/s, r = 0.1 m) goes on with 1 m/s. Below a slip of about
    mu N / c_t friction is a damper: what is left of the slip after 0.5 s is less than 1e-3. With friction at the centre, both stood still.
    What presses is the weight alone: they sink by m g / k at each point, a capsule has two.
    """
    stiffness, mass, length = 1e5, 1.0, 0.4
    tube, caps = math.pi * RADIUS**2 * length, 4.0 / 3.0 * math.pi * RADIUS**3
    scene, material = ri.Scene(gravity=(0, 0, -G)), ri.Material(static_friction=0.5)
    scene.add(ri.Body("floor", ground(kind), position=(0, 0, -0.5), motion="static", material=material))
    moving = {"velocity": (1, 0, 0), "mass": mass, "material": material}
    scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), position=(0, 0, RADIUS), angular_velocity=(0, spin, 0), **moving))
    across = {"position": (0, 2, RADIUS), "orientation": (math.sqrt(0.5), math.sqrt(0.5), 0, 0), "angular_velocity": (0, spin, 0)}
    scene.add(ri.Body("roller", ri.Shape.capsule(RADIUS, length), **across, **moving))
    run = ri.simulate(scene, 0.5, accuracy=penalty(penalty_stiffness=stiffness))
    for name, i, points in (("ball", 0.4, 1), ("roller", (0.5 * tube + 0.4 * caps) / (tube + caps), 2)):
        law = (1.0 + i * RADIUS * spin) / (1.0 + i)
        assert run.velocity(name)[-1, 0] == pytest.approx(law, abs=1e-3)
        assert run.angular_velocity(name)[-1, 1] * RADIUS == pytest.approx(law, abs=1e-3)
        assert RADIUS - run.position(name)[-1, 2] == pytest.approx(mass * G / (points * stiffness), rel=1e-3)


def shot(accuracy: ri.Accuracy) -> ri.Recording:
    """A ball of 100 m/s and a wall of 1 cm."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("wall", ri.Shape.box((0.01, 2, 2)), motion="static", position=(2.0, 0, 0)))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.02), velocity=(100, 0, 0), mass=0.1))
    return ri.simulate(scene, 0.1, accuracy=accuracy)


@pytest.mark.parametrize("integrator", ["exact", "runge_kutta", "semi_implicit"])
def test_thin_things_are_passed_through(integrator: str) -> None:
    """1.67 m a step of 1/60 s: the ball is never seen inside. Impulses, found along the path, stop it."""
    assert shot(penalty(integrator=integrator)).position("ball")[-1, 0] > 5.0
    assert shot(ri.Accuracy()).position("ball")[-1, 0] < 2.0


def test_fast_points_take_several_steps_to_be_pushed_back() -> None:
    """pi / (w h) steps inside, w h = 0.5: six or seven frames. Impulses let it in nowhere."""
    step, w = 1e-3, 500.0
    frames = {}
    for name, accuracy in (
        ("penalty", penalty(integrator="semi_implicit", step=step, penalty_stiffness=w * w)), ("impulse", ri.Accuracy(step=step)),
    ):
        scene, material = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=1.0)
        scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
        scene.add(ri.Body("ball", ri.Shape.sphere(RADIUS), position=(0, 0, 0.12), velocity=(0, 0, -10), mass=1.0, material=material))
        run = ri.simulate(scene, 0.03, fps=1.0 / step, accuracy=accuracy)
        frames[name] = int(np.sum(run.position("ball")[:, 2] < RADIUS - 1e-9))
        assert run.velocity("ball")[-1, 2] > 8.0
    assert frames["penalty"] in (6, 7) and frames["impulse"] == 0


@pytest.mark.parametrize(("integrator", "order"), [("runge_kutta", 4), ("semi_implicit", 1)])
def test_order_of_steps_of_one_length(integrator: str, order: int) -> None:
    """A mass on a spring alone, w = 10: x = cos w t."""
    def error(step: float) -> float:
        scene = ri.Scene(gravity=(0, 0, 0))
        scene.add(ri.Body("mass", ri.Shape.sphere(0.1), position=(1, 0, 0), mass=1.0))
        scene.add(ri.Spring(None, "mass", (0, 0, 0), (1, 0, 0), stiffness=100.0, rest_length=0.0))
        run = ri.simulate(scene, 0.5, fps=2, accuracy=ri.Accuracy(integrator=integrator, step=step))
        return abs(float(run.position("mass")[-1, 0]) - math.cos(5.0))

    assert math.log2(error(1 / 64) / error(1 / 128)) == pytest.approx(order, abs=0.2)


def test_long_steps_are_unstable() -> None:
    """Euler's semi-implicit rule holds a spring up to w h = 2; beyond, its energy grows without end."""
    def most(step: float) -> float:
        stiffness = 1e4
        run = block(penalty(integrator="semi_implicit", step=step, penalty_stiffness=stiffness, penalty_damping=0.0), 0.0, 1.0)
        return float(run.ledger.kinetic.max())

    w = math.sqrt(4.0 * 1e4 / 2.0)
    assert most(0.5 / w) < 0.01 < 10.0 < most(8.0 / w)


def test_crossed_bars_and_flush_boxes_hold() -> None:
    """Edges that cross with no corner inside push; a box that stands flush on another stays on it, straight."""
    scene, smooth = ri.Scene(gravity=(0, 0, 0)), ri.Material(restitution=1.0, static_friction=0.0)
    bar = ri.Shape.box((0.02, 0.4, 0.02))
    scene.add(ri.Body("a", bar, position=(-0.2, 0, 0), velocity=(2, 0, 0), material=smooth))
    scene.add(ri.Body("b", bar, orientation=(1, 1, 0, 0), material=smooth))
    run = ri.simulate(scene, 0.3, accuracy=penalty())
    # Equal masses through the centres, e = 1: they swap their speeds.
    np.testing.assert_allclose([run.velocity(n)[-1, 0] for n in "ab"], [0.0, 2.0], atol=1e-5)
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(2):
        scene.add(ri.Body(f"box{k}", ri.Shape.box((0.2, 0.2, 0.2)), position=(0, 0, 0.1 + 0.2 * k)))
    run = ri.simulate(scene, 0.5, accuracy=penalty())
    upper = run.position("box1")[-1]
    assert np.abs(upper - (0, 0, 0.3)).max() < 1e-3 and rotate(run.orientation("box1")[-1], np.array([0.0, 0.0, 1.0]))[2] > 1.0 - 1e-6


def test_integrators_are_refused_where_they_do_not_act() -> None:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 0, 1)))
    with pytest.raises(ri.SceneError, match="response='penalty'"):
        ri.simulate(scene, 0.1, accuracy=ri.Accuracy(integrator="runge_kutta"))
    with pytest.raises(ri.SceneError, match="penalty_stiffness"):
        penalty(penalty_stiffness=-1.0)


def test_bodies_that_cannot_touch_have_no_springs():
    # Two links of a chain that hangs from the world: joints leave out the contact of what they join.
    scene = ri.Scene(gravity=(0, 0, -9.81))
    for k in range(2):
        scene.add(ri.Body(f"link {k}", ri.Shape.box((0.4, 0.1, 0.1)), position=(0.2 + 0.4 * k, 0, 0)))
    scene.add(ri.HingeJoint(None, "link 0", (0, 0, 0), (0, 1, 0)))
    scene.add(ri.HingeJoint("link 0", "link 1", (0.4, 0, 0), (0, 1, 0)))
    pushed, hit = (ri.simulate(scene, 0.5, accuracy=ri.Accuracy(response=response)) for response in ("penalty", "sequential"))
    assert np.array_equal(pushed.positions, hit.positions)
