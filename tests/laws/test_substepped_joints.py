"""Laws of joints in sub-stepped islands (`contact_solver="substepped"`), where contacts and joints are solved together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate
from rigidimpulse.engine.measure.measure import record_of_recording
from rigidimpulse.engine.measure.momentum import momentum_drifts

SUBSTEPPED = ri.Accuracy(contact_solver="substepped")
ROD, LINK = 1.0, 0.1


def hinged_rod() -> ri.Scene:
    """A rod that is let go level, on a hinge at its end."""
    scene = ri.Scene(bodies=[ri.Body("rod", ri.Shape.box((ROD, 0.05, 0.05)), position=(0.5 * ROD, 0.0, 0.0), mass=2.0)])
    scene.add(ri.HingeJoint("rod", None, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="pin"))
    return scene


def chain(links: int, ratio: float) -> ri.Scene:
    """A chain let go at 45 degrees, with a ball of `ratio` times the mass of a link at its end."""
    scene, way, at, before = ri.Scene(), np.array([np.sin(np.pi / 4), 0.0, -np.cos(np.pi / 4)]), np.zeros(3), None
    turn = (np.cos(np.pi / 8), 0.0, -np.sin(np.pi / 8), 0.0)
    for k in range(links):
        scene.add(ri.Body(f"link {k}", ri.Shape.capsule(0.01, 0.08), position=at + 0.05 * way, orientation=turn, mass=0.1))
        scene.add(ri.BallJoint(before, f"link {k}", at))
        before, at = f"link {k}", at + LINK * way
    scene.add(ri.Body("ball", ri.Shape.sphere(0.05), position=at + 0.05 * way, mass=0.1 * ratio))
    scene.add(ri.BallJoint(before, "ball", at))
    return scene


def stepped(run: ri.Recording) -> bool:
    """Whether sub-steps moved the bodies."""
    return run.plan.line("sub-stepped islands").counts["steps"] > 0


def energy(run: ri.Recording) -> np.ndarray:
    """(f,) J."""
    return run.ledger.kinetic + run.ledger.potential


def test_the_pendulum_is_of_second_order() -> None:
    """Against its equation, to 1e-12: halving the step divides the error by 4 (a method of order 1 by 2, of order 3 by 8)."""
    inertia = 2.0 * (ROD**2 / 3.0 + 0.05**2 / 12.0)

    def equation(_time: float, state: np.ndarray) -> list[float]:
        return [state[1], 2.0 * 9.81 * 0.5 * ROD * np.cos(state[0]) / inertia]

    true = solve_ivp(equation, (0.0, 1.0), [0.0, 0.0], rtol=1e-12, atol=1e-12).y[0, -1]
    errors = []
    for step in (1 / 60, 1 / 120, 1 / 240):
        run = ri.simulate(hinged_rod(), 1.0, accuracy=ri.Accuracy(contact_solver="substepped", step=step))
        place = run.position("rod")[-1]
        errors.append(abs(np.arctan2(-place[2], place[0]) - true))
        assert stepped(run)
    assert errors[0] < 1e-3
    assert 3.5 < errors[0] / errors[1] < 4.5 and 3.5 < errors[1] / errors[2] < 4.5


def test_the_pendulum_keeps_its_energy() -> None:
    """Over 20 s; what first-order damping would take is half of it."""
    run = ri.simulate(hinged_rod(), 20.0, fps=30, accuracy=SUBSTEPPED)
    swing = run.ledger.kinetic.max()
    assert run.status.ok, run.status.message
    assert np.abs(energy(run) - energy(run)[0]).max() < 1e-3 * swing
    assert abs(energy(run)[-60:].mean() - energy(run)[:60].mean()) < 1e-5 * swing


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e5])
def test_a_chain_bears_any_weight(ratio: float) -> None:
    """Gaps stay at what counts as closed, 1e-8 of the smallest body; 8 sweeps over joints one by one leave mm at 1, and explode at 1e3."""
    links = 12
    run = ri.simulate(chain(links, ratio), 1.0, accuracy=SUBSTEPPED)
    ends = [
        run.position(f"link {k}") + side * 0.5 * LINK * rotate(run.orientation(f"link {k}"), np.array([0.0, 0.0, 1.0]))
        for k in range(links)
        for side in (1.0, -1.0)
    ]
    gaps = [np.linalg.norm(ends[2 * k + 1] - ends[2 * k + 2], axis=1).max() for k in range(links - 1)]
    assert run.status.ok and stepped(run), run.status.message
    assert max(gaps) < 1e-8
    assert np.abs(energy(run) - energy(run)[0]).max() < 1e-3 * run.ledger.kinetic.max()


def test_what_tumbles_keeps_its_momenta() -> None:
    """Four boxes on ball joints, no gravity: to the round-off of closing. A solver that leaves joints open by 1e-3 loses 1e-3 of L."""
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0))
    for k in range(4):
        spin = (3.0 * k, 1.0, 2.0)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.3, 0.1, 0.2)), position=(0.31 * k, 0.0, 0.0), angular_velocity=spin, mass=1.0 + k))
        if k:
            scene.add(ri.BallJoint(f"box {k - 1}", f"box {k}", (0.31 * k - 0.155, 0.0, 0.0)))
    run = ri.simulate(scene, 1.0, accuracy=SUBSTEPPED)
    turns = run.ledger.angular_momentum
    assert run.status.ok and stepped(run), run.status.message
    assert np.linalg.norm(run.ledger.momentum - run.ledger.momentum[0], axis=1).max() < 1e-10 * np.abs(turns).max()
    assert np.linalg.norm(turns - turns[0], axis=1).max() < 1e-6 * np.linalg.norm(turns[0])


@pytest.mark.parametrize("fps", [110.0, 240.0, 960.0])
def test_slow_motion_of_what_tumbles_shows_its_momenta(fps: float) -> None:
    """Frames inside steps: a chain that is thrown at "preview". Its angular momentum was off by 1e-5 to 4e-5 of what moves there."""
    scene, dice = ri.Scene(), np.random.default_rng(2)
    for k in range(5):
        speeds = dice.normal(size=3), 8.0 * dice.normal(size=3)
        shape = ri.Shape.box((0.11, 0.05, 0.04))
        scene.add(ri.Body(f"link {k}", shape, position=(0.13 * k, 0.0, 5.0), velocity=speeds[0], angular_velocity=speeds[1]))
        if k:
            scene.add(ri.BallJoint(f"link {k - 1}", f"link {k}", (0.13 * k - 0.065, 0.0, 5.0)))
    run = ri.simulate(scene, 0.5, fps=fps, accuracy="preview")
    assert run.status.ok and stepped(run), run.status.message
    assert momentum_drifts(record_of_recording(run)).angular.max() < 1e-9


def test_the_pin_of_a_hanging_rod_carries_its_weight() -> None:
    """m g of two bodies of 3 kg and 300 kg, at rest, to the round-off of the solver."""
    scene = ri.Scene(bodies=[ri.Body("rod", ri.Shape.box((0.05, 0.05, 1.0)), position=(0.0, 0.0, -0.5), mass=3.0)])
    scene.add(ri.Body("weight", ri.Shape.sphere(0.2), position=(0.0, 0.0, -1.2), mass=300.0))
    scene.add(ri.BallJoint(None, "rod", (0.0, 0.0, 0.0), name="hook"))
    scene.add(ri.BallJoint("rod", "weight", (0.0, 0.0, -1.0)))
    run = ri.simulate(scene, 0.5, accuracy=SUBSTEPPED)
    assert run.reaction("hook")[1:-1, 2] == pytest.approx(303.0 * 9.81, rel=1e-6)


def test_a_heavy_box_rests_on_a_bridge_of_light_planks() -> None:
    """A box of 100 kg on 6 planks of 0.5 kg, from a pin to a rope: it stays on them, and no energy is made."""
    wood = ri.Material(static_friction=0.6, dynamic_friction=0.5)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(offset=-1.0), motion="static")])
    for k in range(6):
        scene.add(ri.Body(f"plank {k}", ri.Shape.box((0.28, 0.6, 0.04)), position=(0.3 * k, 0.0, 0.0), mass=0.5, material=wood))
        scene.add(ri.HingeJoint(f"plank {k - 1}" if k else None, f"plank {k}", (0.3 * k - 0.15, 0.0, 0.0), (0.0, 1.0, 0.0)))
    # A straight row of planks between two pins could not give way: a rope lets it sag.
    scene.add(ri.DistanceJoint("plank 5", None, (1.65, 0.0, 0.0), (1.75, 0.0, 0.3)))
    scene.add(ri.Body("box", ri.Shape.box((0.3, 0.3, 0.3)), position=(0.75, 0.0, 0.25), mass=100.0, material=wood))
    run = ri.simulate(scene, 1.5, accuracy=SUBSTEPPED)
    assert run.status.ok and stepped(run), run.status.message
    assert run.position("box")[-1, 2] > -0.6
    loss = energy(run)[1:] - energy(run)[:-1]
    assert loss.max() < 1e-3 * run.ledger.kinetic.max()


def test_a_motor_turns_and_its_work_is_booked() -> None:
    """A drive of 4 rad/s: the wheel gets there, and the change of energy is the one booked for joints."""
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0), bodies=[ri.Body("wheel", ri.Shape.box((0.3, 0.3, 0.1)), mass=2.0)])
    scene.add(ri.HingeJoint("wheel", None, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), motor=ri.Motor(velocity=-4.0, damping=1.0)))
    run = ri.simulate(scene, 1.5, accuracy=SUBSTEPPED)
    assert stepped(run)
    assert abs(run.angular_velocity("wheel")[-1, 2]) == pytest.approx(4.0, rel=1e-3)
    given = np.sum([run.ledger.dissipated[cause] for cause in run.ledger.dissipated], axis=0)
    assert -given[-1] == pytest.approx(energy(run)[-1] - energy(run)[0], rel=1e-9)
    assert -run.ledger.dissipated["joints"][-1] == pytest.approx(energy(run)[-1], rel=1e-6)


def test_limits_hold_and_joints_let_go() -> None:
    """A rod falls to its limit and stays there; at 0.6 s its pin lets go, and it falls freely."""
    scene = ri.Scene(bodies=[ri.Body("rod", ri.Shape.box((ROD, 0.05, 0.05)), position=(0.5 * ROD, 0.0, 0.0), mass=2.0)])
    scene.add(ri.HingeJoint("rod", None, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), lower=-0.3, upper=0.3, release_time=0.6))
    run = ri.simulate(scene, 1.0, accuracy=SUBSTEPPED)
    angle = np.arctan2(-run.position("rod")[:, 2], run.position("rod")[:, 0])
    held = (run.times > 0.4) & (run.times < 0.59)
    assert stepped(run)
    assert angle[held] == pytest.approx(0.3, abs=1e-3)
    fall = run.position("rod")[-1, 2] - run.position("rod")[36, 2]
    assert fall == pytest.approx(-0.5 * 9.81 * (run.times[-1] - 0.6) ** 2, rel=0.02)
    assert run.status.ok and [event.kind for event in run.status.events] == ["joint let go"]


@pytest.mark.parametrize("links", [4, 8, 14])
def test_a_chain_that_lands_is_stepped_where_it_is_expensive(links: int) -> None:
    """At "standard" all go to sub-steps; what is left of their energy is the same within 2 %, their places within 5 mm.

    With a limit of 48 solves a step all three stay exact, with one of 16 for less than 8 bodies the first one does.
    """
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    for k in range(links):
        place = (0.1 * k, 0.0, 0.1 + 0.02 * k)
        turn = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
        scene.add(ri.Body(f"link {k}", ri.Shape.capsule(0.02, 0.06), position=place, orientation=turn, mass=0.1))
        if k:
            scene.add(ri.BallJoint(f"link {k - 1}", f"link {k}", (0.1 * k - 0.05, 0.0, 0.09 + 0.02 * k)))
    run, exact = ri.simulate(scene, 1.0), ri.simulate(scene, 1.0, accuracy=ri.Accuracy(contact_solver="newton"))
    assert run.status.ok and stepped(run)
    assert np.all(np.diff(energy(run)) <= 1e-9)
    np.testing.assert_allclose(energy(run)[-1], energy(exact)[-1], rtol=0.02)
    ends = [np.array([of.position(f"link {k}")[-1] for k in range(links)]) for of in (run, exact)]
    np.testing.assert_allclose(*ends, atol=5e-3)


@pytest.mark.parametrize("preset", ["substepped", "preview"])
@pytest.mark.parametrize("kind", ["sphere", "capsule", "cylinder"])
def test_what_rolls_off_a_plank_leaves_it_at_its_end(kind: str, preset: str) -> None:
    """It keeps its height to the skin as far as the plank goes, then goes round the edge, never nearer than its radius less two skins.

    Of a plank shrunk by 1.2 %, 12 mm here, a capsule was 0.1 mm too low 5 mm before the end, and a ball got into the edge by 5 mm.
    """
    length, thick, radius = 2.0, 0.02, 0.02
    smooth, skin = ri.Material(restitution=0.0, static_friction=0.0, dynamic_friction=0.0), 0.008 * 0.5 * 0.02
    scene = ri.Scene(bodies=[ri.Body("plank", ri.Shape.box((length, 0.2, thick)), mass=0.4, material=smooth)])
    scene.add(ri.FixedJoint(None, "plank"))
    shape = ri.Shape.sphere(radius) if kind == "sphere" else getattr(ri.Shape, kind)(radius, 0.05)
    lying = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    place, way = (0.5 * length - 0.02, 0.0, 0.5 * thick + radius + skin), (0.05, 0.0, 0.0)
    scene.add(ri.Body("roller", shape, position=place, orientation=lying, mass=0.16, velocity=way, material=smooth))
    run = ri.simulate(scene, 0.6, accuracy=SUBSTEPPED if preset == "substepped" else preset)
    assert run.status.ok and stepped(run)
    beyond, _, height = (run.position("roller") - (0.5 * length, 0.0, 0.5 * thick)).T
    assert np.all(height[beyond <= 0.0] > radius - 1e-9) and np.all(height < radius + skin + 1e-9)
    assert np.all(np.hypot(beyond, height)[beyond > 0.0] > radius - 2.0 * skin)
    assert beyond[-1] > 0.02 and height[-1] < 0.01
    assert np.all(np.diff(energy(run)) <= 1e-9)


@pytest.mark.parametrize("preset", ["substepped", "preview"])
@pytest.mark.parametrize("thickness", [0.01, 0.05])
def test_a_ball_rolls_along_a_plank_that_joints_hold(thickness: float, preset: str) -> None:
    """It keeps its height to the skin and its speed to 1e-6, 30 cm from the middle of the plank as over the middle.

    With the foot of the ball on the plank shrunk by 1 %, it lay 3 mm aside, and the spin of 30 rad/s moved it: the ball sank in by 1 cm.
    """
    grip, radius = ri.Material(restitution=0.0, static_friction=0.6, dynamic_friction=0.5), 0.025
    accuracy = SUBSTEPPED if preset == "substepped" else "preview"
    height = 0.5 * thickness + radius + 0.008 * 0.5 * thickness
    scene = ri.Scene(bodies=[ri.Body("plank", ri.Shape.box((0.7, 0.1, thickness)), mass=0.4, material=grip)])
    scene.add(ri.FixedJoint(None, "plank"))
    roll = {"velocity": (0.75, 0.0, 0.0), "angular_velocity": (0.0, 30.0, 0.0)}
    scene.add(ri.Body("ball", ri.Shape.sphere(radius), position=(-0.3, 0.0, height), mass=0.16, material=grip, **roll))
    run = ri.simulate(scene, 0.7, accuracy=accuracy)
    assert run.status.ok and stepped(run)
    np.testing.assert_allclose(run.position("ball")[:, 2], height, atol=0.008 * 0.5 * thickness + 1e-9)
    np.testing.assert_allclose(run.velocity("ball")[-1], (0.75, 0.0, 0.0), atol=1e-6)
