"""Jointed bodies that touch nothing fly by a method of order 8 (`dynamics/constraints/joint_flight.py`): laws of long swings and fast tops.

What is recorded is off by round-off that grows with the number of flights, some 1e-13 each; the method of second order with a turn of
0.02 rad in a sub-step, which takes over where something touches, is off by 1e-5 to 1e-4 in each of these.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate

G = 9.81


def _energy(run: ri.Recording) -> np.ndarray:
    assert run.ledger is not None
    return run.ledger.kinetic + run.ledger.potential


@pytest.mark.parametrize(("length", "fps", "step"), [(1.0, 60.0, 1 / 60), (0.13, 48.0, 1 / 60), (7.0, 30.0, 1 / 25)])
def test_rod_on_a_hinge_follows_elliptic_functions(length: float, fps: float, step: float) -> None:
    """sin(a / 2) = k sn(K - w t, k), released at rest, w^2 = m g l / 2 I about the hinge. Energy keeps to 1e-11 of the swing."""
    scene, height, a0 = ri.Scene(gravity=(0, 0, -G)), 0.02 * length, np.radians(80.0)
    rod, axis = ri.Shape.box((height, height, length)), (0, 1, 0)
    middle = 0.5 * length * np.array([np.sin(a0), 0, -np.cos(a0)])
    turn = (np.cos(a0 / 2), 0, -np.sin(a0 / 2), 0)
    scene.add(ri.Body("rod", rod, position=middle, orientation=turn, mass=2.0))
    scene.add(ri.HingeJoint("rod", None, (0, 0, 0), axis))
    run = ri.simulate(scene, 12.0, fps=fps, accuracy=ri.Accuracy(step=step))
    inertia = 2.0 * (length**2 + height**2) / 12.0 + 2.0 * (0.5 * length) ** 2
    w, k = np.sqrt(2.0 * G * 0.5 * length / inertia), np.sin(a0 / 2)
    sn = ellipj(ellipk(k * k) - w * run.times, k * k)[0]
    angle = 2.0 * np.arcsin(k * sn)
    expected = 0.5 * length * np.column_stack([np.sin(angle), 0.0 * angle, -np.cos(angle)])
    np.testing.assert_allclose(run.position("rod"), expected, atol=1e-10 * length)
    swing = 2.0 * G * 0.5 * length * (1.0 - np.cos(a0))
    assert np.ptp(_energy(run)) < 1e-11 * swing
    assert run.status.ok


@pytest.mark.parametrize(("spin", "tilt"), [(300.0, 1.2), (60.0, 0.4)])
def test_heavy_top_keeps_its_three_integrals_and_nods_as_it_must(spin: float, tilt: float) -> None:
    """Lagrange's top: energy, L_z and L_3 are kept; its height follows u'^2 = f(u) (Goldstein, Classical Mechanics, 5.7)."""
    scene, arm = ri.Scene(gravity=(0, 0, -G)), 0.1
    shape = ri.Shape.cylinder(0.1, 0.02)
    lean = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    turn = (np.cos(tilt / 2), 0, np.sin(tilt / 2), 0)
    scene.add(ri.Body("top", shape, position=arm * lean, orientation=turn, angular_velocity=spin * lean, mass=1.3))
    scene.add(ri.BallJoint("top", None, (0, 0, 0)))
    run = ri.simulate(scene, 0.4, fps=250)
    along, across = 1.3 * 0.1**2 / 2.0, 1.3 * (3 * 0.1**2 + 0.02**2) / 12.0 + 1.3 * arm**2
    axis = run.position("top") / arm
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1.0, atol=1e-11)
    w = run.angular_velocity("top")
    w_axis = np.sum(w * axis, axis=1)
    momentum = across * (w - w_axis[:, None] * axis) + along * w_axis[:, None] * axis
    np.testing.assert_allclose(w_axis, spin, rtol=1e-10)
    np.testing.assert_allclose(momentum[:, 2], along * spin * np.cos(tilt), rtol=1e-10)
    assert np.ptp(_energy(run)) < 1e-10 * 1.3 * G * arm
    b = along * spin * np.cos(tilt) / across, along * spin / across

    def nod(_t: float, y: np.ndarray) -> list[float]:
        theta, rate, _ = y
        turning = (b[0] - b[1] * np.cos(theta)) / np.sin(theta) ** 2
        return [rate, np.sin(theta) * (turning * (turning * np.cos(theta) - b[1]) + 1.3 * G * arm / across), turning]

    known = solve_ivp(nod, (0.0, 0.4), [tilt, 0.0, 0.0], "DOP853", run.times, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(np.arccos(axis[:, 2]), known.y[0], atol=1e-9)
    around = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    np.testing.assert_allclose(around, known.y[2], atol=2e-9)


@pytest.mark.parametrize(("links", "length", "ratio"), [(2, 0.3, 1.0), (4, 0.3, 0.5), (5, 1.0, 2.0)])
def test_a_chain_that_whips_keeps_its_energy(links: int, length: float, ratio: float) -> None:
    """Small boxes on long arms, let go from the horizontal; masses grow by a ratio. The last one turns at 30 rad/s and more for moments.

    A double pendulum made 3e-4 of its energy where such moments were left to the method of second order.
    """
    scene = ri.Scene(gravity=(0, 0, -G))
    for k in range(links):
        size, place = (0.05 * length, 0.05 * length, 0.02 * length), (length * (k + 0.5), 0, 5)
        scene.add(ri.Body(f"link {k}", ri.Shape.box(size), position=place, mass=ratio**k))
        scene.add(ri.BallJoint(f"link {k - 1}" if k else None, f"link {k}", anchor=(length * k, 0, 5)))
    run = ri.simulate(scene, 5.0)
    assert run.status.ok and not len(run.impacts)
    assert np.ptp(_energy(run)) < 1e-11 * run.ledger.kinetic.max()


def test_two_rods_swing_as_lagrange_says() -> None:
    """A double pendulum of rods, against its own two equations: the angle of each to 1e-8 while it does not yet go wild."""
    scene, length = ri.Scene(gravity=(0, 0, -G)), 0.6
    rod = ri.Shape.box((length, 0.01, 0.01))
    scene.add(ri.Body("upper", rod, position=(0.5 * length, 0, 0), mass=1.0))
    scene.add(ri.Body("lower", rod, position=(1.5 * length, 0, 0), mass=2.5))
    scene.add(ri.HingeJoint("upper", None, (0, 0, 0), (0, 1, 0)))
    scene.add(ri.HingeJoint("upper", "lower", (length, 0, 0), (0, 1, 0)))
    run = ri.simulate(scene, 2.0)
    m, n, own = 1.0, 2.5, (length**2 + 0.01**2) / 12.0

    def rates(_t: float, y: np.ndarray) -> np.ndarray:
        a, b, p, q = y
        mass = np.array(
            [
                [m * own + m * length**2 / 4 + n * length**2, 0.5 * n * length**2 * np.cos(a - b)],
                [0.5 * n * length**2 * np.cos(a - b), n * own + n * length**2 / 4],
            ]
        )
        push = 0.5 * n * length**2 * np.sin(a - b)
        force = [-push * q * q - (0.5 * m + n) * G * length * np.sin(a), push * p * p - 0.5 * n * G * length * np.sin(b)]
        return np.concatenate([y[2:], np.linalg.solve(mass, force)])

    known = solve_ivp(rates, (0.0, 2.0), [np.pi / 2, np.pi / 2, 0.0, 0.0], "DOP853", run.times, rtol=1e-12, atol=1e-13)
    end = run.position("upper") + rotate(run.orientation("upper"), np.array([0.5 * length, 0, 0]))
    np.testing.assert_allclose(end, length * np.column_stack([np.sin(known.y[0]), 0 * run.times, -np.cos(known.y[0])]), atol=1e-8)
    lower = run.position("lower") - end
    np.testing.assert_allclose(lower, 0.5 * length * np.column_stack([np.sin(known.y[1]), 0 * run.times, -np.cos(known.y[1])]), atol=1e-8)


def test_ball_on_a_string_goes_round_as_a_conical_pendulum() -> None:
    """w^2 = g / (l cos a), on a rope that is taut: a row that only pulls."""
    length, a = 0.8, 0.7
    w = np.sqrt(G / (length * np.cos(a)))
    scene, radius = ri.Scene(gravity=(0, 0, -G)), length * np.sin(a)
    place = np.array([radius, 0, -length * np.cos(a)])
    scene.add(ri.Body("ball", ri.Shape.sphere(0.03), position=place, velocity=(0, w * radius, 0), mass=0.4))
    scene.add(ri.DistanceJoint(None, "ball", (0, 0, 0), place, upper=length, name="rope"))
    run = ri.simulate(scene, 5.0)
    turn = w * run.times
    expected = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(len(turn), place[2])])
    np.testing.assert_allclose(run.position("ball"), expected, atol=1e-9)
    pull = np.linalg.norm(run.reaction("rope")[:-1], axis=1)
    np.testing.assert_allclose(pull, 0.4 * G / np.cos(a), rtol=1e-8)


def _wheel(spin: float) -> ri.Scene:
    """A wheel on a pivot at the end of its axle."""
    scene, turn = ri.Scene(gravity=(0, 0, -G)), (np.sqrt(0.5), 0, np.sqrt(0.5), 0)
    wheel = {"position": (0.1, 0, 1), "orientation": turn, "angular_velocity": (spin, 0, 0)}
    scene.add(ri.Body("wheel", ri.Shape.cylinder(0.1, 0.02), mass=1.0, **wheel))
    scene.add(ri.BallJoint("wheel", None, (0, 0, 1)))
    return scene


def _beside_a_post(scene: ri.Scene) -> ri.Scene:
    """A rod stands 1 mm behind the rim of the wheel, which may touch it."""
    scene.add(ri.Body("post", ri.Shape.cylinder(0.01, 3.0), position=(0.1, 0.0, 2.601), motion="static"))
    return scene


def test_wheel_goes_the_same_way_alone_and_beside_what_it_may_touch() -> None:
    """Alone it is flown past from frame to frame; beside the post it goes from path to path."""
    alone, beside = ri.simulate(_wheel(250.0), 0.25), ri.simulate(_beside_a_post(_wheel(250.0)), 0.25)
    np.testing.assert_allclose(alone.position("wheel"), beside.position("wheel"), atol=1e-10)
    np.testing.assert_allclose(alone.angular_velocity("wheel"), beside.angular_velocity("wheel"), atol=1e-7)
    for run in (alone, beside):
        ledger = run.ledger
        assert ledger is not None and run.status.ok and len(run.impacts) == 0
        np.testing.assert_allclose(ledger.total, ledger.total[0], atol=1e-10 * ledger.kinetic[0])


def test_ball_hits_a_wheel_when_it_must_though_that_was_alone() -> None:
    """A ball of 40 m/s comes from 5 m away: it meets the rim between two frames, when it does beside the post."""
    runs = []
    for scene in (_wheel(200.0), _beside_a_post(_wheel(200.0))):
        thrown = {"position": (0.1, -5.0, 1.0), "velocity": (0, 40.0, 0.5)}
        scene.add(ri.Body("ball", ri.Shape.sphere(0.02), mass=0.1, **thrown))
        runs.append(ri.simulate(scene, 0.15))
    first = [run.impacts[0] for run in runs]
    assert 0.12 < first[0]["time"] < 0.125
    assert first[0]["time"] == pytest.approx(first[1]["time"], abs=1e-9)
    np.testing.assert_allclose(first[0]["impulse"], first[1]["impulse"], rtol=1e-5)


@pytest.mark.parametrize("spin", [0.0, 120.0])
def test_impulse_of_a_joint_is_what_changes_the_momentum(spin: float) -> None:
    """The time line of the hinge's impulse, with gravity's, is the change of momentum of the rod from frame to frame."""
    scene = ri.Scene(gravity=(0, 0, -G))
    rod = {"position": (0.5, 0, 2), "angular_velocity": (spin, 0, 0)}
    scene.add(ri.Body("rod", ri.Shape.box((1.0, 0.04, 0.07)), mass=1.7, **rod))
    scene.add(ri.BallJoint(None, "rod", (0, 0, 2), name="pin"))
    run = ri.simulate(scene, 1.5 if spin == 0.0 else 0.4)
    given = run.impulses("rod")
    assert set(given) >= {"gravity", "joint pin"}
    change = 1.7 * (run.velocity("rod") - run.velocity("rod")[0])
    np.testing.assert_allclose(given["gravity"] + given["joint pin"], change, atol=1e-10)


def test_joint_breaks_at_the_angle_where_its_force_is_reached() -> None:
    """A thin rod that falls from level: |F|^2 = (5/2 m g sin a)^2 + (m g cos a / 4)^2 at the angle a below it."""
    scene, mass, length = ri.Scene(gravity=(0, 0, -G)), 1.3, 1.0
    scene.add(ri.Body("rod", ri.Shape.box((length, 1e-4, 1e-4)), position=(0.5 * length, 0, 0), mass=mass))
    strong = 1.9 * mass * G
    scene.add(ri.HingeJoint(None, "rod", (0, 0, 0), (0, 1, 0), break_force=strong, name="pin"))
    run = ri.simulate(scene, 1.0)
    broke = [event for event in run.status.events if event.kind == "joint broke"]
    assert len(broke) == 1
    # (25/4 - 1/16) s^2 = 1.9^2 - 1/16, s = sin a
    sine = np.sqrt((1.9**2 - 1.0 / 16.0) / (25.0 / 4.0 - 1.0 / 16.0))

    def fall(_t: float, y: np.ndarray) -> list[float]:
        return [y[1], 1.5 * G / length * np.cos(y[0])]

    def there(_t: float, y: np.ndarray) -> float:
        return float(y[0] - np.arcsin(sine))

    there.terminal = True  # type: ignore[attr-defined]
    known = solve_ivp(fall, (0.0, 1.0), [0.0, 0.0], "DOP853", events=there, rtol=1e-12, atol=1e-13)
    # The force is a line over a flight: off by 1e-3 of a step.
    assert broke[0].time == pytest.approx(known.t_events[0][0], abs=1e-3 / 60)


def test_work_of_joints_is_never_called_that_of_contacts() -> None:
    """Varying forces leave no flight to a chain: its sub-steps are straight, and what these give and joints take back are both of joints.

    Their sum is small; by two names 1.2 J stood against -1.2 J.
    """
    scene = ri.Scene(gravity=(0, 0, -G))
    for k in range(3):
        scene.add(ri.Body(f"link {k}", ri.Shape.box((0.4, 0.05, 0.05)), position=(0.2 + 0.4 * k, 0, 3), mass=0.8))
        scene.add(ri.BallJoint(f"link {k - 1}" if k else None, f"link {k}", (0.4 * k, 0, 3)))
    scene.add(ri.Drag(linear=0.1))
    run = ri.simulate(scene, 2.0)
    assert set(run.ledger.dissipated) == {"joints", "drag"}
    # The method is of second order: 1e-4 of the energy that moves.
    assert np.abs(run.ledger.dissipated["joints"]).max() < 2e-3 * run.ledger.kinetic.max()
    np.testing.assert_allclose(run.ledger.total + sum(run.ledger.dissipated.values()), run.ledger.total[0], rtol=1e-9)
