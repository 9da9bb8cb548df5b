"""Collisions of smooth balls, disks and cars against the closed forms of the dynamics notes (B4, B5, B9 to B16), at random numbers.

    v_a' = v_a + (1 + e) m_b / (m_a + m_b) [(v_b - v_a).n] n, the mirror for b;    energy lost (1 - e^2) mu [(v_b - v_a).n]^2 / 2
    fixed wall: v' = v - (1 + e) (v.n) n
    recoil: M V = m v
    rear-end crash: V = (1 + m_b / m_a) sqrt(2 mu g d m_b / (m_a + m_b))

mu = m_a m_b / (m_a + m_b). n is that of the centres where they touch, a root of a quadratic: 1e-12 relative. An impulse without the
reduced mass, or n from the end of a step, is off by percents.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.gallery.event_driven import DisksInRectangle

SMOOTH = {"static_friction": 0.0, "dynamic_friction": 0.0}


def touch_time(x: np.ndarray, v: np.ndarray, reach: float) -> float:
    """First root of |x + v t| = reach."""
    b, a = x @ v, v @ v
    return float((-b - np.sqrt(b * b - a * (x @ x - reach * reach))) / a)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", ["sphere", "disk"])
def test_two_smooth_bodies_meet_anywhere(seed: int, kind: str) -> None:
    """Spheres in space (B9, B10, B13) and upright cylinders in the plane, off centre (B14)."""
    rng = np.random.default_rng(seed)
    plane = np.array([1, 1, kind == "sphere"])
    m, r, e = 10.0 ** rng.uniform(-2, 2, 2), rng.uniform(0.1, 1.0, 2), rng.uniform()
    x = np.array([rng.normal(size=3), rng.normal(size=3) + 4.0]) * plane
    v = np.array([rng.normal(size=3), rng.normal(size=3)]) * plane
    aim = rng.normal(size=3) * 0.3 * r.sum() * plane
    v[0] = v[1] + 3.0 * (x[1] + aim - x[0]) / np.linalg.norm(x[1] - x[0])
    time = touch_time(x[1] - x[0], v[1] - v[0], r.sum())
    scene = ri.Scene(gravity=(0, 0, 0))
    for k in range(2):
        shape = ri.Shape.sphere(r[k]) if kind == "sphere" else ri.Shape.cylinder(r[k], 0.3)
        scene.add(ri.Body("ab"[k], shape, position=x[k], velocity=v[k], mass=m[k], material=ri.Material(restitution=e, **SMOOTH)))
    run = ri.simulate(scene, time + 0.5)
    n = x[1] - x[0] + (v[1] - v[0]) * time
    n /= np.linalg.norm(n)
    u = (v[1] - v[0]) @ n
    after = v + (1.0 + e) * u * np.outer(m[::-1] / m.sum() * [1, -1], n)
    assert run.impacts["time"][0] == pytest.approx(time, rel=1e-9)
    # Cylinders meet at 1e-10 of their size: n turns by that over their size, tens of times that in a graze.
    bound = 1e-12 if kind == "sphere" else 1e-8
    np.testing.assert_allclose(run.velocities[-1], after, atol=bound * np.abs(v).max() * max(1.0, (m / m[::-1]).max() ** 0.5))
    lost = 0.5 * m.prod() / m.sum() * (1.0 - e * e) * u * u
    assert run.ledger.kinetic[0] - run.ledger.kinetic[-1] == pytest.approx(lost, abs=bound * run.ledger.kinetic[0])


@pytest.mark.parametrize("seed", range(5))
def test_a_fixed_wall_turns_the_normal_part_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, e, mass = rng.normal(size=3), rng.uniform(), 10.0 ** rng.uniform(-3, 3)
    n /= np.linalg.norm(n)
    v = rng.normal(size=3)
    v -= (abs(v @ n) + v @ n + 1.0) * n
    scene = ri.Scene(gravity=(0, 0, 0), bodies=[ri.Body("wall", ri.Shape.half_space(normal=n), motion="static")])
    scene.add(ri.Body("ball", ri.Shape.sphere(0.2), position=n, velocity=v, mass=mass, material=ri.Material(restitution=e, **SMOOTH)))
    run = ri.simulate(scene, 1.0 / abs(v @ n))
    np.testing.assert_allclose(run.velocity("ball")[-1], v - (1.0 + e) * (v @ n) * n, atol=1e-13 * np.linalg.norm(v))


@pytest.mark.parametrize(("mass", "shot", "speed"), [(3.2, 0.01, 820.0), (0.9, 0.5, 12.0)])
def test_a_gun_recoils_with_the_momentum_of_its_shot(mass: float, shot: float, speed: float) -> None:
    """The charge is an impact with e = (v / u) (1 + m / M), which parts what comes together with u (B5)."""
    u = 0.25
    e = speed / u * (1.0 + shot / mass)
    charge = ri.Material(restitution=e, restitution_combine="minimum", any_restitution=True, **SMOOTH)
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(
        ri.Body("gun", ri.Shape.box((0.8, 0.1, 0.1)), velocity=(u * shot / (mass + shot), 0, 0), mass=mass, material=ri.Material(**SMOOTH))
    )
    scene.add(
        ri.Body(
            "shot", ri.Shape.sphere(0.02), position=(0.43, 0, 0), velocity=(-u * mass / (mass + shot), 0, 0), mass=shot, material=charge
        )
    )
    run = ri.simulate(scene, 0.2)
    assert run.velocity("shot")[-1, 0] == pytest.approx(speed, rel=1e-12)
    assert -mass * run.velocity("gun")[-1, 0] == pytest.approx(shot * speed, rel=1e-12)


@pytest.mark.parametrize(("mass_a", "mass_b", "speed", "friction"), [(800.0, 2400.0, 25.0, 0.5), (9000.0, 1000.0, 11.0, 0.9)])
def test_skid_marks_tell_the_speed_of_a_rear_end_crash(mass_a: float, mass_b: float, speed: float, friction: float) -> None:
    """Two boxes, the struck one rough; level with their centres the blow tips nothing. The contact margin is 1e-6 of a box (B12)."""
    g, box = 9.81, ri.Shape.box((2.0, 1.0, 1.0))
    scene = ri.Scene(gravity=(0, 0, -g), bodies=[ri.Body("road", ri.Shape.half_space(), motion="static")])
    for name, x, v, mass, mu in (("a", 0.0, speed, mass_a, 0.0), ("b", 3.0, 0.0, mass_b, friction)):
        material = ri.Material(static_friction=mu, friction_combine="minimum", restitution=0.0)
        scene.add(ri.Body(name, box, position=(x, 0, 0.5), velocity=(v, 0, 0), mass=mass, material=material))
    common, slowing = mass_a * speed / (mass_a + mass_b), friction * g * mass_b / (mass_a + mass_b)
    run = ri.simulate(scene, 1.0 / speed + 1.2 * common / slowing)
    d = run.position("b")[-1, 0] - 3.0
    found = (1.0 + mass_b / mass_a) * np.sqrt(2.0 * friction * g * d * mass_b / (mass_a + mass_b))
    assert found == pytest.approx(speed, rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_internal_forces_cancel(seed: int) -> None:
    """Rough bodies of all shapes collide under an oblique gravity: p = p0 + M g t to rounding, angular momentum to the margin (B4)."""
    rng = np.random.default_rng(seed)
    g, scene = np.array([0.5, -1.0, 2.0]), ri.Scene(gravity=(0.5, -1.0, 2.0))
    shapes = [ri.Shape.sphere(0.3), ri.Shape.box((0.5, 0.4, 0.3)), ri.Shape.capsule(0.2, 0.4), ri.Shape.cylinder(0.3, 0.3)]
    masses = 10.0 ** rng.uniform(-1, 1, 12)
    for k, mass in enumerate(masses):
        out = rng.normal(size=3)
        out /= np.linalg.norm(out)
        place, spin = (1.2 + 0.4 * k) * out, rng.normal(size=3)
        material = ri.Material(restitution=rng.uniform(0.2, 1), static_friction=rng.uniform(0, 1))
        motion = {"velocity": -2.0 * out, "angular_velocity": spin, "orientation": rng.normal(size=4)}
        scene.add(ri.Body(f"{k}", shapes[k % 4], position=place, mass=mass, material=material, **motion))
    run = ri.simulate(scene, 3.0)
    t, total, start = run.times[:, None], masses.sum(), masses @ run.centers[0] / masses.sum()
    moving = 2.0 * total
    assert len(run.impacts) > 5
    p0, l0 = run.ledger.momentum[0], run.ledger.angular_momentum[0]
    np.testing.assert_allclose(run.ledger.momentum, p0 + total * g * t, atol=1e-12 * moving)
    expected = l0 + total * np.cross(start * t + 0.5 * p0 / total * t**2, g)
    np.testing.assert_allclose(run.ledger.angular_momentum, expected, atol=1e-7 * moving)


def test_disks_in_another_box_against_the_event_driven_run() -> None:
    """Four disks in a rectangle, e = 0.9 between them, 0.8 at walls (B16): each impact of disks multiplies rounding by ten or so."""
    x = [(-2.0, 1.0), (1.5, 1.3), (0.2, -1.4), (2.5, -1.1)]
    v = [(1.7, -0.4), (-0.9, -1.2), (0.6, 2.1), (-1.3, 0.8)]
    exact = DisksInRectangle.of(x, v, 0.5, (3.5, 2.5), 0.9, 0.8)
    events = exact.advance(8.0)
    scene = ri.Scene(gravity=(0, 0, 0))
    for k, (normal, side) in enumerate((((1, 0, 0), 3.5), ((-1, 0, 0), 3.5), ((0, 1, 0), 2.5), ((0, -1, 0), 2.5))):
        wall = ri.Material(restitution=0.8, restitution_combine="minimum", **SMOOTH)
        scene.add(ri.Body(f"wall {k}", ri.Shape.half_space(normal=normal, offset=-side), motion="static", material=wall))
    disk = ri.Material(restitution=0.9, restitution_combine="minimum", **SMOOTH)
    for k in range(4):
        scene.add(ri.Body(f"disk {k}", ri.Shape.sphere(0.5), position=(*x[k], 0), velocity=(*v[k], 0), mass=1.0, material=disk))
    run = ri.simulate(scene, 8.0)
    between = sum(event.b >= 0 for event in events)
    assert between >= 4 and len(run.impacts) == len(events)
    np.testing.assert_allclose(run.impacts["time"], [float(event.time) for event in events], atol=1e-16 * 10.0 ** (between + 1))
    home = [[float(c) for c in place] for place in exact.positions]
    np.testing.assert_allclose(run.positions[-1, 4:, :2], home, atol=1e-16 * 10.0 ** (between + 2))
