"""How places of contact and normals move, against contacts found on the very paths of the bodies a moment later.

Law. r_a', r_b' and n' are the rates of arms and normal; with a the accelerations of free bodies the gap g changes by

    g'' = n.turning + n.(alpha_b x r_b - alpha_a x r_a)

Reference. Contacts of the detector at 0, h, 2 h and 3 h; one-sided differences: r' of order h^2, g'' of order h^2 and the rounding of g
over h^2. With h = 1e-4 s, rates of 1 to 5 rad/s and a gap of 1e-6 m: 2e-5 of r' and n', and 1e-3 of g''. A vertex in the place of a rim
is off by 100 % in g'', a face in the place of an edge by 30 % and more in n'.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.collision.contact_buffer import Question
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.dispatch import PairQuery
from rigidimpulse.core.quaternion import multiply, quaternion_from_axis_angle
from rigidimpulse.dynamics.constraints.contact_motion import contact_motion
from rigidimpulse.engine.begin import start_trajectories
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.touching import fill_contacts
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.model.plan import Plan
from rigidimpulse.motion.evaluate import bring_all
from rigidimpulse.motion.trajectory import begin
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder

STEP, GAP, MARGIN = 1e-4, 1e-6, 1e-2
EDGE = np.sqrt(0.5)
"""Height of the edge of a unit cube that stands on one."""
V, W = (0.7, -0.4, 0.1), (1.0, -2.0, 3.0)
TURN_X, TURN_Y = (quaternion_from_axis_angle(axis, 0.25 * np.pi) for axis in ((1, 0, 0), (0, 1, 0)))
TURN_SIDE = quaternion_from_axis_angle((1, 0, 0), 0.5 * np.pi)


def body(name, shape, position, orientation=(1, 0, 0, 0), velocity=(0, 0, 0), spin=(0, 0, 0)) -> ri.Body:
    return ri.Body(name, shape, position=position, orientation=orientation, velocity=velocity, angular_velocity=spin, mass=1.0)


def leaning(lean: float):
    """Orientation of a leaning cylinder of radius 0.3 and height 0.2, and how high its centre is over a floor."""
    return quaternion_from_axis_angle((1, 0, 0), lean), 0.3 * np.sin(lean) + 0.1 * np.cos(lean)


def pair(name: str) -> list[ri.Body]:
    """Two bodies a gap apart; the first is a floor, or moves."""
    floor = ri.Body("floor", ri.Shape.half_space(), motion="static")
    ball, cube, disk = ri.Shape.sphere(0.2), ri.Shape.box((1, 1, 1)), ri.Shape.cylinder(0.3, 0.2)
    moving = {"velocity": (0.2, 0.1, 0.3), "spin": (0.5, 1.0, -1.5)}
    moved = {"velocity": V, "spin": W}
    q, height = leaning(0.6)
    diagonal = np.array([1.0, 0.0, 1.0]) * EDGE * (0.2 + GAP)
    corner = np.array([1.0, 1.0, 1.0]) / np.sqrt(3.0) * (0.2 + GAP)
    along_x = multiply(quaternion_from_axis_angle((0, 0, 1), 0.2), quaternion_from_axis_angle((0, 1, 0), 0.5 * np.pi))
    dumbbell = ri.Shape.compound([(ball, (0.3, 0, 0), (1, 0, 0, 0)), (ri.Shape.sphere(0.1), (-0.3, 0, 0), (1, 0, 0, 0))])
    return {
        "ball on a floor": [floor, body("b", ball, (0, 0, 0.2 + GAP), **moved)],
        "ball on a ball": [body("a", ri.Shape.sphere(0.5), (0, 0, 0), **moving), body("b", ball, (0, 0, 0.7 + GAP), **moved)],
        "vertex on a floor": [floor, body("b", ri.Shape.box((0.2, 0.3, 0.4)), (0, 0, _lowest() + GAP), _tilt(), **moved)],
        "rim on a floor": [floor, body("b", disk, (0, 0, height + GAP), q, **moved)],
        "rim on a moving face": [body("a", cube, (0, 0, -0.5), **moving), body("b", disk, (0, 0, height + GAP), q, **moved)],
        "moving face on a rim": [body("a", disk, (0, 0, height + GAP), q, **moved), body("b", cube, (0, 0, -0.5), **moving)],
        "ball on an edge": [body("a", cube, (-0.5, 0, -0.5), **moving), body("b", ball, diagonal, **moved)],
        "ball on a corner": [body("a", cube, (-0.5, -0.5, -0.5), **moving), body("b", ball, corner, **moved)],
        "edges": [body("a", cube, (0, 0, -EDGE), TURN_Y, **moving), body("b", cube, (0.1, 0.05, EDGE + GAP), TURN_X, **moved)],
        "capsule on an edge": [
            body("a", cube, (0, 0, -EDGE), TURN_Y, **moving), body("b", ri.Shape.capsule(0.1, 0.6), (0, 0, 0.1 + GAP), along_x, **moved)
        ],
        "cylinder on an edge": [body("a", cube, (0, 0, -EDGE), TURN_Y, **moving), body("b", disk, (0, 0, 0.3 + GAP), along_x, **moved)],
        "ball on a cap": [body("a", disk, (0, 0, -0.1), **moving), body("b", ball, (0.1, 0.05, 0.2 + GAP), **moved)],
        "crossed cylinders": [
            body("a", disk, (0, 0, -0.3), TURN_SIDE, **moving), body("b", ri.Shape.cylinder(0.2, 0.5), (0, 0, 0.2 + GAP), along_x, **moved)
        ],
        "ball of a compound": [floor, body("b", dumbbell, _dumbbell(), **moved)],
    }[name]  # fmt: skip


def _tilt() -> np.ndarray:
    return quaternion_from_axis_angle((1.0, 2.0, 0.5), 0.8)


def _lowest() -> float:
    """Height of the centre of the tilted box over its lowest corner."""
    from rigidimpulse.core.quaternion import rotate

    corners = 0.5 * np.array([[x, y, z] for x in (-0.2, 0.2) for y in (-0.3, 0.3) for z in (-0.4, 0.4)])
    return -float(rotate(np.tile(_tilt(), (8, 1)), corners)[:, 2].min())


def _dumbbell():
    return (0.0, 0.0, 0.2 + GAP)


NAMES = (
    "ball on a floor", "ball on a ball", "vertex on a floor", "rim on a floor", "rim on a moving face", "moving face on a rim",
    "ball on an edge", "ball on a corner", "edges", "capsule on an edge", "cylinder on an edge",
    "ball on a cap", "crossed cylinders", "ball of a compound",
)  # fmt: skip


def contact_at(run: Run, time: float):
    """The nearest contact of the pair at a time: contacts of one, kinds and features."""
    world, state = run.world, run.state
    bring_all(state.trajectory, np.arange(2), time, state.now, state.rotation, run.acceleration, run.angular_acceleration)
    buffer = run.contact_buffer
    query = PairQuery(np.array([0]), np.array([1]), np.array([MARGIN]))
    shapes = Shapes(world.geometry, world.shape_of_body)
    count = buffer.find(Question(shapes, state.now, state.rotation, query))
    nearest = np.array([np.argmin(buffer.real[:count, 9])])
    one = Contacts(*(np.empty(1, np.int64) for _ in range(2)), *(np.empty((1, 3)) for _ in range(3)), *(np.empty(1) for _ in range(5)))
    fill_contacts(state.now, buffer.real, buffer.integer, nearest, world.material_of_body, world.coefficients, one)
    row = buffer.integer[nearest]
    return one, row[:, 2].copy(), row[:, 3:5].copy()


def keep_gap(run: Run) -> None:
    """Take off the velocity along the normal: what lasts neither opens nor closes, and both arms end at one place."""
    first, now, trajectory = contact_at(run, 0.0)[0], run.state.now, run.state.trajectory
    n = first.normal[0]
    at = [now.velocity[i] + np.cross(now.angular_velocity[i], arm[0]) for i, arm in enumerate((first.arm_a, first.arm_b))]
    trajectory.velocity[1] -= n * (n @ (at[1] - at[0]))
    begin(trajectory, 1)


@pytest.mark.parametrize("name", NAMES)
def test_places_of_contact_move_as_found_a_moment_later(name: str) -> None:
    scene = ri.Scene(gravity=(0.0, 0.0, 0.0), bodies=pair(name))
    world = compile_scene(scene)
    run = Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog())
    start_trajectories(run)
    keep_gap(run)
    found = [contact_at(run, k * STEP)[0] for k in range(4)]
    first, kinds, features = contact_at(run, 0.0)
    assert first.gap[0] == pytest.approx(GAP, abs=1e-12)
    world, state = run.world, run.state
    motion = contact_motion(world.geometry, world.shape_of_body, state.rotation, state.now, first, kinds, features)

    def rate(values) -> np.ndarray:
        return (-3.0 * values[0] + 4.0 * values[1] - values[2]) / (2.0 * STEP)

    for side, ours in (("arm_a", motion.arm_rate_a), ("arm_b", motion.arm_rate_b)):
        if not (name.endswith("floor") or name.endswith("compound")) or side == "arm_b":
            np.testing.assert_allclose(ours[0], rate([getattr(c, side)[0] for c in found]), atol=2e-5)
    np.testing.assert_allclose(motion.normal_rate[0], rate([c.normal[0] for c in found]), atol=2e-5)
    gaps = [float(c.gap[0]) for c in found]
    second = (2.0 * gaps[0] - 5.0 * gaps[1] + 4.0 * gaps[2] - gaps[3]) / STEP**2
    spin = run.angular_acceleration
    turned = np.cross(spin[1], first.arm_b[0]) - np.cross(spin[0], first.arm_a[0])
    assert first.normal[0] @ (motion.turning[0] + turned) == pytest.approx(second, abs=1e-3 * max(1.0, abs(second)))
