"""Jointed bodies that touch nothing fly by a method of order 8 under forces that vary, and with springs, dampers and drives of joints.

The references are the equations of the angles, integrated by scipy. With forces that were constant over sub-steps of order 2, as they were,
the errors below are 1e-5 to 1e-3 m, and each takes two to ten times as long.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rigidimpulse as ri

G = 9.81
LENGTH, WIDTH, MASS = 0.4, 0.06, 1.5
INERTIA = MASS * (LENGTH**2 + WIDTH**2) / 12.0


def solved(rate, start, times) -> np.ndarray:
    """States (f, k) of y' = rate(t, y)."""
    return solve_ivp(rate, (times[0], times[-1]), start, "DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y.T


def chain(number: int, motor: ri.Motor | None = None) -> ri.Scene:
    """Bars side by side along x, on hinges about y: their centres are half a length beyond each hinge."""
    scene = ri.Scene(gravity=(0, 0, -G))
    for k in range(number):
        scene.add(ri.Body(f"bar{k}", ri.Shape.box((LENGTH, WIDTH, WIDTH)), mass=MASS, position=((k + 0.5) * LENGTH, 0, 0)))
        above = f"bar{k - 1}" if k else None
        scene.add(ri.HingeJoint(above, f"bar{k}", (k * LENGTH, 0, 0), (0, 1, 0), motor))
    return scene


def bars(angle: np.ndarray) -> list[np.ndarray]:
    """Centres (f, 3) of bars whose angles (f, k) below x are given."""
    ends, out = np.zeros((len(angle), 3)), []
    for k in range(angle.shape[1]):
        along = LENGTH * np.column_stack([np.cos(angle[:, k]), np.zeros(len(angle)), -np.sin(angle[:, k])])
        out.append(ends + 0.5 * along)
        ends = ends + along
    return out


def accelerations(angle: np.ndarray, rate: np.ndarray, torque: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Angular accelerations (2,) of two bars; torque (2,) on each, force (2, 2) at their centres along x and z, both without gravity."""
    s, c = np.sin(angle), np.cos(angle)
    # How the centres move with the angles: (2 bars, x and z, 2 angles).
    first = 0.5 * LENGTH * np.array([-s[0], -c[0]])
    last = 0.5 * LENGTH * np.array([-s[1], -c[1]])
    moves = np.array([np.column_stack([first, np.zeros(2)]), np.column_stack([2.0 * first, last])])
    bend_first = -0.5 * LENGTH * rate[0] ** 2 * np.array([c[0], -s[0]])
    bend_last = -0.5 * LENGTH * rate[1] ** 2 * np.array([c[1], -s[1]])
    bends = np.array([bend_first, 2.0 * bend_first + bend_last])
    matrix = INERTIA * np.eye(2) + MASS * np.einsum("bci,bcj->ij", moves, moves)
    pushed = force + MASS * (np.array([0.0, -G]) - bends)
    return np.linalg.solve(matrix, torque + np.einsum("bci,bc->i", moves, pushed))


def test_a_pendulum_in_drag_follows_its_equation() -> None:
    """Quadratic drag at the centre of the bar, without torque. Off by 1.4e-5 m before."""
    scene = chain(1)
    scene.add(ri.Drag(quadratic=2.0))
    run = ri.simulate(scene, 2.0, fps=50)
    arm = 0.5 * LENGTH

    def rate(_t, y):
        speed = arm * y[1]
        pull = MASS * G * np.cos(y[0]) - 2.0 * speed * abs(speed)
        return [y[1], arm * pull / (INERTIA + MASS * arm * arm)]

    (true,) = bars(solved(rate, [0.0, 0.0], run.times)[:, :1])
    error = np.abs(run.position("bar0") - true).max()
    assert run.status.ok
    assert error < 1e-9, error
    # The ledger: drag took what is missing, and joints nothing.
    lost = run.ledger.kinetic + run.ledger.potential + run.ledger.dissipated["drag"]
    swing = np.ptp(run.ledger.potential)
    assert np.abs(lost - lost[0]).max() < 1e-6 * swing
    assert np.abs(run.ledger.dissipated["joints"]).max() < 1e-6 * swing


@pytest.mark.parametrize(("stiffness", "damping"), [(30.0, 0.0), (6.0, 0.3), (400.0, 0.1)])
def test_two_bars_with_springs_in_their_hinges(stiffness: float, damping: float) -> None:
    """Springs and dampers of hinges, from soft to stiff; very stiff ones are left to sub-steps. Off by 1e-6 to 1e-5 m before."""
    run = ri.simulate(chain(2, ri.Motor(stiffness=stiffness, damping=damping, target=0.3)), 1.0, fps=50)

    def rate(_t, y):
        angle, speed = y[:2], y[2:]
        turned, turning = np.array([angle[0], angle[1] - angle[0]]), np.array([speed[0], speed[1] - speed[0]])
        pull = stiffness * (0.3 - turned) - damping * turning
        torque = np.array([pull[0] - pull[1], pull[1]])
        return [*speed, *accelerations(angle, speed, torque, np.zeros((2, 2)))]

    true = bars(solved(rate, np.zeros(4), run.times)[:, :2])
    errors = [np.abs(run.position(f"bar{k}") - true[k]).max() for k in range(2)]
    assert run.status.ok
    assert max(errors) < 1e-8, errors


def test_a_force_at_a_point_and_one_that_jumps() -> None:
    """A force at the end of two bars, and one that sets in between two steps. Off by 1e-4 m before."""
    force = np.array([6.0, 0.0, 15.0])
    scene = chain(2)
    scene.add(ri.ConstantForce("bar1", force, point=(2.0 * LENGTH, 0, 0)))
    scene.add(ri.SampledForce("bar0", [0.3, 2.0], [[0.0, 0.0, -4.0]] * 2))
    run = ri.simulate(scene, 1.0, fps=50)

    def rate(t, y):
        angle = y[:2]
        beside = 0.5 * LENGTH * np.array([np.cos(angle[1]), -np.sin(angle[1])])
        # About y: r_z F_x - r_x F_z, and angles grow downwards.
        torque = np.array([0.0, beside[1] * force[0] - beside[0] * force[2]])
        pull = np.array([[0.0, -4.0 if t >= 0.3 else 0.0], [force[0], force[2]]])
        return [*y[2:], *accelerations(angle, y[2:], torque, pull)]

    early, late = run.times[run.times <= 0.3], run.times[run.times >= 0.3]
    first = solved(rate, np.zeros(4), early)
    true = bars(np.vstack([first, solved(rate, first[-1], late)[1:]])[:, :2])
    errors = [np.abs(run.position(f"bar{k}") - true[k]).max() for k in range(2)]
    assert run.status.ok
    assert max(errors) < 1e-8, errors


def test_a_spring_that_breaks_lets_a_pendulum_go_at_its_greatest_force() -> None:
    """The tie holds the bar until it pulls with 12 N: the angle at that instant is where the equation of the tied bar has that force."""
    scene = chain(1)
    scene.add(ri.Spring(None, "bar0", (LENGTH, 0, 0.5), (LENGTH, 0, 0), 200.0, 0.0, break_force=12.0))
    run = ri.simulate(scene, 0.5, fps=50)
    inertia = INERTIA + MASS * (0.5 * LENGTH) ** 2

    def pull(angle):
        tip = LENGTH * np.array([np.cos(angle), -np.sin(angle)])
        away = np.array([LENGTH, 0.5]) - tip
        size = np.linalg.norm(away)
        strength = 200.0 * (size - 0.5)
        fx, fz = strength * away / size
        return strength, tip[1] * fx - tip[0] * fz

    def rate(_t, y):
        return [y[1], (MASS * G * 0.5 * LENGTH * np.cos(y[0]) + pull(y[0])[1]) / inertia]

    def breaks(_t, y):
        return pull(y[0])[0] - 12.0

    breaks.terminal = True
    tied = solve_ivp(rate, (0.0, 0.5), [0.0, 0.0], "DOP853", events=breaks, rtol=1e-13, atol=1e-13)
    (gone,) = [event.time for event in run.status.events if event.kind == "force ended"]
    assert tied.status == 1
    assert gone == pytest.approx(tied.t[-1], abs=1e-5)


def test_bars_of_a_scene_with_a_floor_fly_as_they_do_without_one() -> None:
    """With something to hit far away nobody looks at the bars between frames; near by, their paths are laid: both are the same motion."""
    runs = []
    for depth in (None, 20.0, 0.9):
        scene = chain(2, ri.Motor(stiffness=3.0, damping=0.1))
        scene.add(ri.Drag(linear=0.3))
        if depth is not None:
            scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", position=(0, 0, -depth)))
        runs.append(ri.simulate(scene, 1.0, fps=50))
    for run in runs[1:]:
        assert run.status.ok
        assert np.abs(run.position("bar1") - runs[0].position("bar1")).max() < 1e-9
        assert run.ledger.dissipated["drag"] == pytest.approx(runs[0].ledger.dissipated["drag"], abs=1e-7)
