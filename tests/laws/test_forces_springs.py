"""Springs against closed forms and a reference.

Laws. Two masses on a spring through their centres swing with w^2 = k (1 / m_a + 1 / m_b); damped, w_0^2 as that and z = c (1 / m_a + 1 /
m_b) / (2 w_0). A spring of length 0 and no rest length is the same oscillator in all directions. Off centre the reference integrates two
boxes. A block with friction mu on a floor: turning points come nearer to the middle by 2 mu m g / k each, and it stops where k |x| < mu m
g.
Tolerance: 1e-8 of the size inside each step, all steps of 3 s off to one side: 2e-6; 1e-7 m is asked, an oscillator off by 1e-6 of its
frequency would be at 2e-6. In contact a path may be off by 1e-6 of the size, 0.4 m, in each of 206 steps: 9e-5 m, of which 2e-5 is asked.
"""

from __future__ import annotations

import numpy as np
import pytest
from forced_reference import Start, box_inertia, matrices, reference

import rigidimpulse as ri

PATH = 1e-7
SIZE = {"a": (0.3, 0.5, 0.7), "b": (0.6, 0.2, 0.4)}
MASS = {"a": 1.3, "b": 2.9}


def pull_of(p, u, k: float, c: float, length: float) -> np.ndarray:
    """Force (3,) on the end b: p, u place and velocity of b's anchor against a's."""
    d = np.linalg.norm(p)
    return -(k * (d - length) + c * (p @ u) / d) * p / d


def assert_ledger_balances(run: ri.Recording, relative: float = 1e-8) -> None:
    total = run.ledger.total + sum(run.ledger.dissipated.values())
    np.testing.assert_allclose(total, total[0], rtol=0, atol=relative * (run.ledger.kinetic + np.abs(run.ledger.potential)).max())


@pytest.mark.parametrize("damping", [0.0, 0.35])
def test_two_masses_through_their_centres(damping: float) -> None:
    k, at_rest, longer = 40.0, 2.0, 0.6
    scene = ri.Scene(gravity=(0, 0, 0))
    along = np.array([2.0, 2.0, 1.0]) / 3.0
    for name, place in (("a", 0.0), ("b", at_rest + longer)):
        scene.add(ri.Body(name, ri.Shape.box(SIZE[name]), mass=MASS[name], position=place * along))
    scene.add(ri.Spring("a", "b", (0, 0, 0), (at_rest + longer) * along, k, damping, rest_length=at_rest))
    run = ri.simulate(scene, 3.0)
    assert run.status.ok, run.status.message
    square = k * sum(1.0 / m for m in MASS.values())
    decay = 0.5 * damping * square / k
    w, t = np.sqrt(square - decay**2), run.times
    x = longer * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    apart = (run.position("b") - run.position("a")) @ along
    np.testing.assert_allclose(apart, at_rest + x, rtol=0, atol=PATH)
    np.testing.assert_allclose(run.ledger.momentum, 0.0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(run.ledger.potential, 0.5 * k * x**2, rtol=0, atol=10.0 * k * PATH * longer)
    assert_ledger_balances(run)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rest_length", [None, 0.0, 1.5])
def test_two_boxes_off_centre_in_space(rest_length: float | None, seed: int) -> None:
    """With the inertia of boxes, but shapes so small that they do not meet: 90 steps off by 1e-8 rad are
    1e-6, and small differences grow here up to 50 times in 1.5 s; a lever arm left out of the damper is off by 1e-2."""
    random = np.random.default_rng(seed)
    starts, k, c = {}, 35.0, (0.0, 0.4, 2.0)[seed]
    for name, place in (("a", np.zeros(3)), ("b", np.array([2.5, 0, 0]))):
        q = random.normal(size=4)
        starts[name] = Start(
            MASS[name], box_inertia(MASS[name], SIZE[name]), place + random.normal(0.0, 0.2, 3), q / np.linalg.norm(q),
            random.normal(size=3), random.normal(0.0, 2.0, 3),
        )  # fmt: skip
    scene = ri.Scene(gravity=(0, 0, -9.81))
    for name, s in starts.items():
        state = {field: getattr(s, field) for field in ("position", "orientation", "velocity", "angular_velocity", "mass")}
        scene.add(ri.Body(name, ri.Shape.sphere(0.02), inertia=np.diag(s.inertia), **state))
    local = {name: random.uniform(-0.5, 0.5, 3) * SIZE[name] for name in SIZE}
    anchors = [matrices(starts[n].orientation) @ local[n] + starts[n].position for n in SIZE]
    scene.add(ri.Spring("a", "b", *anchors, k, c, rest_length))
    run = ri.simulate(scene, 1.5)
    assert run.status.ok and not len(run.impacts)
    length = float(np.linalg.norm(anchors[1] - anchors[0])) if rest_length is None else rest_length

    def wrench(t, x, turn, v, w):
        arm = np.einsum("nij,nj->ni", turn, np.array(list(local.values())))
        p, u = x + arm, v + np.cross(w, arm)
        f = pull_of(p[1] - p[0], u[1] - u[0], k, c, length)
        forces = np.array([-f, f])
        weight = np.array([[0, 0, -9.81 * MASS[n]] for n in SIZE])
        return np.hstack([forces + weight, np.cross(arm, forces)])

    motion = reference(list(starts.values()), wrench, run.times)
    for i, name in enumerate(SIZE):
        np.testing.assert_allclose(run.position(name), motion.position[:, i], rtol=0, atol=1e-5)
        np.testing.assert_allclose(matrices(run.orientation(name)), motion.rotation[:, i], rtol=0, atol=1e-5)
    assert_ledger_balances(run)


def test_the_angular_momentum_of_two_boxes_stays() -> None:
    """No gravity, off centre: momentum to rounding, angular momentum to what two lines of force leave, 1e-8 of it."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("a", ri.Shape.box(SIZE["a"]), mass=MASS["a"], angular_velocity=(1, 2, 3)))
    scene.add(ri.Body("b", ri.Shape.box(SIZE["b"]), mass=MASS["b"], position=(2, 0, 0), velocity=(0, 1, 0.5)))
    scene.add(ri.Spring("a", "b", (0.1, 0.2, 0.3), (1.8, 0.1, 0.2), 50.0, 0.5))
    run = ri.simulate(scene, 4.0)
    turned = run.ledger.angular_momentum
    np.testing.assert_allclose(run.ledger.momentum, np.broadcast_to(run.ledger.momentum[0], turned.shape), rtol=0, atol=1e-13)
    np.testing.assert_allclose(turned, np.broadcast_to(turned[0], turned.shape), rtol=0, atol=PATH)
    assert np.abs(run.ledger.angular_momentum[0]).max() > 3.0


def test_an_anchor_at_no_distance_pulls_nowhere_and_swings_through() -> None:
    """rest_length = 0, both anchors in one place: an oscillator in space, the anchors meet twice a swing."""
    m, k, v0 = 0.8, 20.0, np.array([0.6, -0.3, 0.9])
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), mass=m, velocity=v0))
    scene.add(ri.Spring(None, "ball", (0, 0, 0), (0, 0, 0), k, rest_length=0.0))
    run = ri.simulate(scene, 3.0)
    w = np.sqrt(k / m)
    np.testing.assert_allclose(run.position("ball"), np.sin(w * run.times)[:, None] * v0 / w, rtol=0, atol=PATH)


def test_a_spring_to_a_kinematic_body_that_moves_and_turns() -> None:
    """The end on the kinematic body goes where its point goes: m x'' = -k (x - p(t)), rest length 0, p at radius r, drifting with u."""
    m, k, r, spin, u = 0.7, 30.0, 0.4, 2.0, 0.3
    scene = ri.Scene(gravity=(0, 0, 0))
    turning = {"velocity": (u, 0, 0), "angular_velocity": (0, 0, spin)}
    scene.add(ri.Body("wheel", ri.Shape.cylinder(0.1, 0.1), motion="kinematic", position=(0, 0, 5), **turning))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), mass=m, position=(r, 0, 0)))
    scene.add(ri.Spring("wheel", "ball", (r, 0, 0), (r, 0, 0), k, rest_length=0.0))
    run = ri.simulate(scene, 3.0)

    def wrench(t, x, turn, v, w):
        p = np.array([r * np.cos(spin * t) + u * t, r * np.sin(spin * t), 0.0])
        return np.array([[*(-k * (x[0] - p)), 0, 0, 0]])

    motion = reference([Start(m, np.eye(3), (r, 0, 0))], wrench, run.times)
    np.testing.assert_allclose(run.position("ball"), motion.position[:, 0], rtol=0, atol=PATH)
    assert_ledger_balances(run)


@pytest.mark.parametrize("share", [3.4, 9.7])
def test_friction_takes_its_part_of_every_swing(share: float) -> None:
    """Released at x0 = share * mu m g / k; it turns every half swing, 2 mu m g / k nearer, until k |x| < mu m g; then it rests."""
    m, k, mu = 2.0, 60.0, 0.3
    rough = ri.Material(static_friction=mu, dynamic_friction=mu, restitution=0.0)
    bite = mu * m * 9.81 / k
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=rough))
    scene.add(ri.Body("block", ri.Shape.box((0.6, 0.6, 0.2)), mass=m, position=(share * bite, 0, 0.1), material=rough))
    scene.add(ri.Spring(None, "block", (-5, 0, 0.1), (share * bite, 0, 0.1), k, rest_length=5.0))
    half = np.pi * np.sqrt(m / k)
    run = ri.simulate(scene, 6.0 * half, fps=20.0 / half)
    assert run.status.ok, run.status.message
    x, t = run.position("block")[:, 0], run.times
    amplitude, expected = share * bite, np.empty_like(t)
    for n in range(7):
        here = (t >= (n - 1e-9) * half) & (t <= (n + 1 + 1e-9) * half)
        sign = (-1.0) ** n
        if amplitude <= bite:
            expected[t >= (n - 1e-9) * half] = sign * amplitude
            break
        expected[here] = sign * (bite + (amplitude - bite) * np.cos(np.pi * (t[here] / half - n)))
        amplitude -= 2.0 * bite
    np.testing.assert_allclose(x, expected, rtol=0, atol=2e-5)
    if share < 4.0:
        np.testing.assert_array_equal(run.velocity("block")[-20:], 0.0)
        assert len(set(x[-20:])) == 1
    # At the start it is lifted to the gap at which bodies touch, 6e-7 m.
    assert_ledger_balances(run, 1e-5)


def test_a_block_hung_on_a_spring_at_its_length_rests() -> None:
    """A body that stands under spring and weight on a floor rests to the bit: both are steady."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("block", ri.Shape.box(0.4), mass=2.0, position=(0, 0, 0.2)))
    scene.add(ri.Spring(None, "block", (0, 0, 1.4), (0, 0, 0.4), 10.0, rest_length=0.5))
    run = ri.simulate(scene, 1.0)
    np.testing.assert_array_equal(run.velocity("block")[-30:], 0.0)
    np.testing.assert_allclose(run.contact_force("block")[-1], (0, 0, 2.0 * 9.81 - 5.0), rtol=0, atol=1e-5)


def test_damping_along_a_held_direction_does_not_swing_up() -> None:
    """A block slides on a smooth floor in a field that damps its height alone, c h / 2 m = 4: the floor carries m g, nothing else.

    Forces of the middle of a sub-step that answered the floor's force of the one before would grow four times a sub-step.
    """
    smooth = ri.Material(static_friction=0.0, dynamic_friction=0.0, restitution=0.0)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=smooth))
    scene.add(ri.Body("block", ri.Shape.box(0.2), mass=0.1, position=(0, 0, 0.1), velocity=(1, 0, 0), material=smooth))
    scene.add(ri.ForceField(lambda t, x, v: -48.0 * v * (0.0, 0.0, 1.0)))
    run = ri.simulate(scene, 1.0, accuracy=ri.Accuracy(tolerance=1e-2))
    assert run.status.ok, run.status.message
    np.testing.assert_allclose(run.contact_force("block")[10:-1], np.broadcast_to((0, 0, 0.981), (50, 3)), rtol=0, atol=1e-6)
    np.testing.assert_allclose(run.position("block")[:, 0], run.times, rtol=0, atol=1e-12)


def test_a_stiff_spring_in_free_flight_is_never_handed_to_sub_steps() -> None:
    """x = cos(100 t): 1e-6 m. Where nothing touches anything it went to sub-steps, since forces are evaluated so often, and was lost."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("post", ri.Shape.sphere(0.01), motion="static", position=(-2, 0, 0)))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.05), mass=1.0, position=(1, 0, 0)))
    scene.add(ri.Spring("post", "ball", anchor_a=(-2, 0, 0), anchor_b=(1, 0, 0), stiffness=1e4, rest_length=2.0))
    run = ri.simulate(scene, 0.3)
    np.testing.assert_allclose(run.position("ball")[:, 0], np.cos(100.0 * run.times), rtol=0, atol=1e-6)
    assert not any(event.kind == "handed to sub-steps" for event in run.status.events)
