"""Forces given over time against closed forms and a reference: law B1, momentum grows by the impulse.

Laws. Harmonic A sin(w t + phi) at the centre of mass, m = 1.7: I = A (cos phi - cos(w t + phi)) / w, and the path is its integral.
Sampled: the impulse is the trapezium rule's. A force at a point turns with nothing but its point; the reference integrates the box.
Tolerance: inside a step a path is off by at most 1e-8 of the size (docs/theory/forces.md), at its end by less than that, so 1e-8 m for each
second or period is asked: 60 steps that were off by as much as they may, all to one side, would be at 6e-7. A sampled force is a line
between its samples, which a path carries exactly: rounding, 1e-12. Frequencies taken for rad/s, or a phase left out, are off by 1.
"""

from __future__ import annotations

import numpy as np
import pytest
from forced_reference import Start, box_inertia, matrices, reference

import rigidimpulse as ri

MASS, SIZE = 1.7, (0.3, 0.5, 0.9)
PATH = 1e-8


def alone(*forces: object, duration: float = 2.0, gravity: float = 0.0, **start: object) -> ri.Recording:
    """A box under forces."""
    scene = ri.Scene(gravity=(0, 0, -gravity))
    scene.add(ri.Body("box", ri.Shape.box(SIZE), mass=MASS, **start))
    for force in forces:
        scene.add(force)
    run = ri.simulate(scene, duration)
    assert run.status.ok, run.status.message
    return run


def assert_ledger_balances(run: ri.Recording, relative: float = 1e-12) -> None:
    """Energy and all that was taken from it stay as they were."""
    total = run.ledger.total + sum(run.ledger.dissipated.values())
    scale = np.abs(run.ledger.kinetic).max() + np.abs(run.ledger.potential).max()
    np.testing.assert_allclose(total, total[0], rtol=0, atol=relative * scale)


@pytest.mark.parametrize("frequency", [0.3, 2.0, 25.0])
@pytest.mark.parametrize("phase", [0.0, 0.9])
def test_harmonic_impulse_and_path(frequency: float, phase: float) -> None:
    w, direction = 2.0 * np.pi * frequency, np.array([2.0, -1.0, 2.0]) / 3.0
    run = alone(ri.HarmonicForce("box", 4.0, frequency, 5.0 * direction, phase), velocity=(0.1, 0, 0), angular_velocity=(1, 2, 3))
    t = run.times
    impulse = 4.0 * (np.cos(phase) - np.cos(w * t + phase)) / w
    way = 4.0 / MASS * (np.cos(phase) * t - (np.sin(w * t + phase) - np.sin(phase)) / w) / w
    gained = run.ledger.momentum - run.ledger.momentum[0]
    np.testing.assert_allclose(gained, impulse[:, None] * direction, rtol=0, atol=PATH * t[-1] * MASS * max(w, w**2))
    found = run.position("box") - t[:, None] * (0.1, 0, 0)
    np.testing.assert_allclose(found, way[:, None] * direction, rtol=0, atol=PATH * t[-1] * max(frequency, 1.0))
    free = alone(angular_velocity=(1, 2, 3)).orientation("box")
    np.testing.assert_allclose(run.orientation("box"), free, rtol=0, atol=1e-13)
    assert_ledger_balances(run)


def test_a_fast_force_is_seen_between_the_steps() -> None:
    """50 Hz has a whole period in a step of 1/50: at its ends and middle it is zero. Velocities inside a step are off by some E / h."""
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("box", ri.Shape.box(SIZE), mass=MASS))
    scene.add(ri.HarmonicForce("box", 30.0, 50.0, (1, 0, 0)))
    run = ri.simulate(scene, 1.0, fps=333, accuracy=ri.Accuracy(step=0.02))
    w = 100.0 * np.pi
    np.testing.assert_allclose(run.velocity("box")[:, 0], 30.0 * (1.0 - np.cos(w * run.times)) / (w * MASS), rtol=0, atol=3.0 * PATH * w)


def test_a_harmonic_force_without_frequency_is_constant() -> None:
    run = alone(ri.HarmonicForce("box", 3.0, 0.0, (0, 0, 1), phase=0.5 * np.pi))
    np.testing.assert_allclose(run.position("box")[:, 2], 1.5 / MASS * run.times**2, rtol=0, atol=1e-13)


def trapezium(times: np.ndarray, forces: np.ndarray, until: float) -> np.ndarray:
    """Impulse (3,) until a time of a force that is linear between samples and zero outside."""
    inside = np.unique(np.clip(np.append(times, until), times[0], min(until, times[-1]) if until > times[0] else times[0]))
    values = np.array([np.interp(inside, times, forces[:, k]) for k in range(3)]).T
    return (0.5 * np.diff(inside)[:, None] * (values[1:] + values[:-1])).sum(0)


@pytest.mark.parametrize("seed", range(3))
def test_sampled_impulse_is_the_trapezium_rule(seed: int) -> None:
    """Knots where they like, some nearer than a step, first and last value not zero, so that the force jumps."""
    random = np.random.default_rng(seed)
    times = np.sort(random.uniform(0.05, 1.6, 40))
    times[7] = times[6] + 1e-7
    forces = random.normal(0.0, 20.0, (40, 3))
    run = alone(ri.SampledForce("box", times, forces))
    impulse = np.array([trapezium(times, forces, t) for t in run.times])
    np.testing.assert_allclose(run.ledger.momentum, impulse, rtol=0, atol=1e-12 * np.abs(impulse).max())
    assert_ledger_balances(run)


def test_a_blow_shorter_than_a_step_gives_its_impulse_and_its_way() -> None:
    """A triangle of 1 ms and 3 N s at 0.3 s: afterwards x = (I / m)(t - 0.3)."""
    run = alone(ri.SampledForce("box", [0.2995, 0.3, 0.3005], [(0, 0, 0), (0, 6000, 0), (0, 0, 0)]), duration=1.0)
    way = 3.0 / MASS * np.maximum(run.times - 0.3, 0.0)
    after = run.times > 0.31
    np.testing.assert_allclose(run.position("box")[after, 1], way[after], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(run.position("box")[run.times < 0.29], 0.0)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["constant", "harmonic", "sampled"])
def test_a_force_at_a_point_turns_the_body(kind: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    start = {
        "position": random.normal(size=3), "orientation": random.normal(size=4), "velocity": random.normal(size=3),
        "angular_velocity": random.normal(0.0, 2.0, 3),
    }  # fmt: skip
    point, pull = random.normal(size=3), random.normal(size=3)
    knots, values = np.array([-1.0, 0.71, 3.0]), np.array([-1.0, 2.0, 0.5])
    forces = {
        "constant": (ri.ConstantForce("box", pull, point), lambda _: 1.0),
        "harmonic": (ri.HarmonicForce("box", float(np.linalg.norm(pull)), 0.6, pull, 0.3, point), lambda t: np.sin(1.2 * np.pi * t + 0.3)),
        "sampled": (ri.SampledForce("box", knots, values[:, None] * pull, point), lambda t: np.interp(t, knots, values)),
    }
    force, strength = forces[kind]
    run = alone(force, gravity=9.81, **start)
    begin = Start(MASS, box_inertia(MASS, SIZE), **start)
    arm = matrices(start["orientation"]).T @ (point - start["position"])

    def wrench(t, x, turn, v, w):
        f = strength(t) * pull
        return np.array([[*(f - (0, 0, MASS * 9.81)), *np.cross(turn[0] @ arm, f)]])

    # The reference stops where the force has a kink.
    first = reference([begin], wrench, np.append(run.times[run.times < 0.71], 0.71))
    middle = Start(MASS, begin.inertia, first.position[-1, 0], _quaternion(first.rotation[-1, 0]), first.velocity[-1, 0], first.spin[-1, 0])
    late = run.times > 0.71
    last = reference([middle], wrench, np.append(0.71, run.times[late]))
    scale = run.times[-1] * (1.0 + np.abs(run.angular_velocity("box")).max())
    for found, begun, ended in (
        (run.position("box"), first.position, last.position),
        (matrices(run.orientation("box")), first.rotation, last.rotation),
        (run.velocity("box") / 10.0, first.velocity / 10.0, last.velocity / 10.0),
        (run.angular_velocity("box") / 10.0, first.spin / 10.0, last.spin / 10.0),
    ):
        np.testing.assert_allclose(found[~late], begun[:-1, 0], rtol=0, atol=PATH * scale)
        np.testing.assert_allclose(found[late], ended[1:, 0], rtol=0, atol=PATH * scale)
    assert_ledger_balances(run)


def _quaternion(rotation: np.ndarray) -> tuple[float, ...]:
    from scipy.spatial.transform import Rotation

    return tuple(Rotation.from_matrix(rotation).as_quat()[[3, 0, 1, 2]])
