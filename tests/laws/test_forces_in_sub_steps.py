"""Varying forces on sub-stepped islands: the force is that of the middle of what is stepped at once, so it is of second order.

Planted faults that these tests find: a force that acts from the start of what is stepped at once is wrong by half of what it changes by in
it; a torque that is left out; ties whose two ends are stepped apart; work of forces that the balance of energy takes for energy of nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rigidimpulse as ri

G = 9.81
SMOOTH = ri.Material(static_friction=0.0, dynamic_friction=0.0, restitution=0.0)


def on_floor(*bodies: ri.Body, material: ri.Material = SMOOTH) -> ri.Scene:
    """Bodies on a floor, all of one material."""
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    for body in bodies:
        scene.add(replace(body, material=material))
    return scene


def substepped(scene: ri.Scene, duration: float, step: float = 1 / 60) -> ri.Recording:
    """Run with every island sub-stepped; the books must balance."""
    run = ri.simulate(scene, duration, accuracy=ri.Accuracy(contact_solver="substepped", step=step))
    ledger = run.ledger
    total = ledger.kinetic + ledger.potential + sum(ledger.dissipated.values())
    assert np.abs(total - total[0]).max() < 1e-9 * max(1.0, float(np.abs(total).max()))
    assert run.status.ok, run.status.message
    assert run.plan.line("sub-stepped islands").counts["steps"] > 0
    return run


@pytest.mark.parametrize("step", [1 / 60, 1 / 240])
def test_drag_and_friction_stop_a_block(step: float) -> None:
    """v' = -mu g - c v / m until it stops: v = (v_0 + a) exp(-c t / m) - a, a = mu g m / c.

    The force of the start of each 1/120 s would be off by (c / m)^2 v / 240 a second: 7e-3 m/s. Of second order 4e-4 are left.
    """
    mass, drag, mu, first = 2.0, 1.5, 0.3, 3.0
    material = ri.Material(static_friction=mu, dynamic_friction=mu, restitution=0.0)
    block = ri.Body("block", ri.Shape.box((0.6, 0.6, 0.1)), mass=mass, position=(0, 0, 0.05), velocity=(first, 0, 0))
    scene = on_floor(block, material=material)
    scene.add(ri.Drag(linear=drag))
    run = substepped(scene, 1.2, step)
    a = mu * G * mass / drag
    stops = mass / drag * np.log((first + a) / a)
    expected = np.where(run.times < stops, (first + a) * np.exp(-drag * run.times / mass) - a, 0.0)
    assert np.abs(run.velocity("block")[:, 0] - expected).max() < 1e-3


def test_a_controller_twists_a_block_on_a_smooth_floor() -> None:
    """I a'' = -k a: a = a_0 cos(w t). Without the torque it would stay at a_0 = 0.6."""
    mass, stiffness, first = 2.0, 8.0, 0.6
    turned = (np.cos(first / 2), 0, 0, np.sin(first / 2))
    scene = on_floor(ri.Body("block", ri.Shape.box((0.6, 0.6, 0.1)), mass=mass, position=(0, 0, 0.05), orientation=turned))
    scene.add(ri.PDController("block", orientation=(1, 0, 0, 0), angular_stiffness=stiffness))
    run = substepped(scene, 2.0)
    w = np.sqrt(stiffness / (mass * 2 * 0.6**2 / 12))
    angle = 2 * np.arctan2(run.orientation("block")[:, 3], run.orientation("block")[:, 0])
    assert np.abs(angle - first * np.cos(w * run.times)).max() < 5e-3


def test_a_spring_ties_two_blocks() -> None:
    """d'' = -k (1/m_1 + 1/m_2) (d - l), and the momentum stays 0: both ends feel the same force at the same times."""
    stiffness, masses = 40.0, (1.0, 3.0)
    blocks = [ri.Body(name, ri.Shape.box(0.2), mass=m, position=(x, 0, 0.1)) for name, m, x in zip("ab", masses, (0.0, 1.0), strict=True)]
    scene = on_floor(*blocks)
    scene.add(ri.Spring("a", "b", anchor_a=(0, 0, 0.1), anchor_b=(1, 0, 0.1), stiffness=stiffness, rest_length=0.8))
    run = substepped(scene, 2.0)
    w = np.sqrt(stiffness * (1 / masses[0] + 1 / masses[1]))
    distance = run.position("b")[:, 0] - run.position("a")[:, 0]
    assert np.abs(distance - 0.8 - 0.2 * np.cos(w * run.times)).max() < 2e-3
    assert np.abs(masses[0] * run.velocity("a") + masses[1] * run.velocity("b"))[:, :2].max() < 1e-9


def test_a_spring_that_bears_half_of_the_weight_leaves_a_block_where_it_is() -> None:
    """It comes to rest; the spring gives m g t / 2 all the time, while it sleeps as well."""
    scene = on_floor(ri.Body("block", ri.Shape.box(0.2), mass=2.0, position=(0, 0, 0.1)), material=ri.Material())
    scene.add(ri.Spring(None, "block", anchor_a=(0, 0, 1), anchor_b=(0, 0, 0.2), stiffness=20.0, rest_length=0.8 - G / 20.0, name="spring"))
    run = substepped(scene, 2.0)
    # It rests a skin above the floor, 0.8 % of 0.1 m.
    assert np.abs(run.position("block") - run.position("block")[0]).max() < 1e-3
    assert np.abs(run.velocity("block")[-1]).max() == 0.0
    assert np.linalg.norm(run.impulses("block")["spring"][-1] - (0, 0, G * 2.0)) < 0.02 * G


def pile(drag: float) -> ri.Scene:
    """Twenty boxes above a floor."""
    rng, scene = np.random.default_rng(3), ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    for k in range(20):
        place = (0.25 * (k % 3) + rng.normal(0, 0.02), 0.25 * (k // 3 % 2), 0.3 + 0.3 * (k // 6))
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.2, 0.15, 0.1)), position=place, angular_velocity=rng.normal(0, 2, 3)))
    scene.add(ri.Drag(linear=drag, name="air"))
    return scene


def test_a_pile_under_drag_comes_to_rest_in_sub_steps_at_default_settings() -> None:
    """All that it had is in the ledger, the air took some of it, and it lies within its skins on the floor."""
    run = ri.simulate(pile(0.5), 2.0)
    assert run.status.ok, run.status.message
    assert run.plan.line("sub-stepped islands").counts["steps"] > 0
    assert run.ledger.dissipated["air"][-1] > 0.0
    assert max(np.linalg.norm(run.velocity(name)[-1]) for name in run.names if name != "floor") < 0.05


def test_joints_and_a_force_in_one_sub_stepped_island() -> None:
    """A chain that swings through air: exact contact and sub-steps agree to the second order of both."""
    ends = []
    for solver in ("newton", "substepped"):
        scene = ri.Scene(gravity=(0, 0, -G))
        for k in range(5):
            scene.add(ri.Body(f"link {k}", ri.Shape.box((0.1, 0.02, 0.02)), position=(0.05 + 0.1 * k, 0, 1)))
            scene.add(ri.BallJoint(None if k == 0 else f"link {k - 1}", f"link {k}", (0.1 * k, 0, 1)))
        scene.add(ri.Drag(linear=0.02, name="air"))
        run = ri.simulate(scene, 0.5, accuracy=ri.Accuracy(contact_solver=solver, step=1 / 240))
        assert run.status.ok, run.status.message
        ends.append((run.position("link 4")[-1], run.ledger.dissipated["air"][-1]))
    assert np.linalg.norm(ends[0][0] - ends[1][0]) < 5e-3
    assert ends[0][1] == pytest.approx(ends[1][1], rel=5e-3)


@pytest.mark.parametrize("accuracy", ["preview", "standard"])
def test_a_force_that_presses_a_rod_against_its_limit_does_no_work(accuracy: str) -> None:
    """W = integral of F.dx, from poses at 960 frames a second; the rod stands at its limit from 0.2 s on.

    The way of each sub-step leads into the limit, and back without the force: 0.08 J at "standard" and 0.4 J at "preview" were counted.
    """
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("rod", ri.Shape.box((0.05, 0.05, 0.4)), position=(0, 0, -0.2), mass=1.0))
    scene.add(ri.HingeJoint(None, "rod", anchor=(0, 0, 0), axis=(0, 1, 0), lower=-0.3, upper=0.3))
    scene.add(ri.HarmonicForce("rod", 10.0, 0.7, (1, 0, 0), point=(0, 0, -0.4), name="push"))
    run = ri.simulate(scene, 0.6, fps=960, accuracy=accuracy)
    q = run.orientation("rod")
    tip = run.position("rod")[:, 0] - 0.2 * 2 * (q[:, 1] * q[:, 3] + q[:, 0] * q[:, 2])
    force = 10.0 * np.sin(2 * np.pi * 0.7 * run.times)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(tip))])
    assert work[-1] == pytest.approx(0.652, abs=0.01)
    assert np.abs(-run.ledger.dissipated["push"] - work).max() < 0.03
