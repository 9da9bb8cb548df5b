"""From a scene to a world: shapes, masses, materials, joints and forces are checked and become arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import conjugate, multiply, quaternion_from_rotation_vector, rotate, rotation_vector
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.constant import ConstantForce, push_of_forces
from rigidimpulse.engine.compile_shapes import compile_shapes, world_boxes
from rigidimpulse.model.joint_table import compile_joints
from rigidimpulse.model.world import World
from rigidimpulse.scene.accuracy import Accuracy, resolve_accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.collision_filter import pairs_filtered
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.mass import BodyMass
from rigidimpulse.scene.material import combine, combine_rolling
from rigidimpulse.scene.scene import Scene, validate

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force import Force, ForceTable


def compile_scene(scene: Scene, accuracy: str | Accuracy = "standard", left_out: frozenset[str] = frozenset()) -> World:
    """Check a scene and compile it, without the effects whose names are in `left_out`.

    Raises:
        SceneError: naming the body, the value and the remedy.

    """
    masses, bodies = validate(scene), list(scene.bodies)
    joints = [effect for effect in scene.effects if isinstance(effect, Joint) and "joints" not in left_out]
    dynamic = np.array([body.becomes_dynamic for body in bodies], bool)
    moving = np.array([body.motion == "kinematic" and _is_driven(body) for body in bodies], bool)
    start = _start(bodies, masses)
    known, shape_of_body = compile_shapes(bodies, masses)
    low, high = world_boxes(known.geometry, shape_of_body, start["position"], start["orientation"])
    material_of_body, coefficients, rolling = _materials(bodies)
    mass = np.array([m.mass for m in masses], float)
    inv_mass = np.where(dynamic, 1.0 / mass, 0.0)
    if "friction" in left_out:
        coefficients[:, :, 1:3] = 0.0
    gravity, push = _steady_pull(scene, inv_mass, left_out)
    world = World(
        scene=scene,
        accuracy=resolve_accuracy(accuracy),
        names=[body.name for body in bodies],
        shapes=known.shapes,
        geometry=known.geometry,
        dynamic=dynamic,
        moving=moving,
        mass=mass,
        inv_mass=inv_mass,
        inertia=np.where(dynamic[:, None], np.array([m.moments for m in masses], float).reshape(-1, 3), 1.0),
        **start,
        gravity=gravity,
        push=push,
        steady_acceleration=gravity + push,
        shape_of_body=shape_of_body,
        size=known.size[shape_of_body],
        bound_radius=known.radius[shape_of_body],
        static_min=low,
        static_max=high,
        material_of_body=material_of_body,
        coefficients=coefficients,
        rolling=rolling[:0, :0] if "rolling friction" in left_out else rolling,
        flat=known.flat[shape_of_body],
        half_space=known.half_space[shape_of_body],
        ball=known.ball[shape_of_body],
        contact_margin=TOLERANCES.contact.margin,
        impact_margin=TOLERANCES.contact.impact_margin,
        apart=_pairs_apart(joints, bodies, dynamic),
        joints_of_scene=joints,
        left_out=left_out,
    )
    world.joints = compile_joints(joints, world)
    world.force_tables = compile_forces(world, [(world, varying_forces(world))])
    if not world.force_tables or world.can_collide or joints:
        _refuse_fixed_steps(world.accuracy)
    return world


def varying_forces(world: World) -> list[Force]:
    """Return the forces of a scene that vary."""
    steady = _steady_forces(world.scene)
    forces = [effect for effect in world.scene.effects if effect.stage == "forces" and effect not in steady]
    return [force for force in forces if force.kind not in world.left_out]


def compile_forces(world: World, fastened: Sequence[tuple[World, Sequence[Force]]]) -> list[ForceTable]:
    """Return the tables of forces that vary, by class; fastened: forces, and the world with bodies where they are fastened to these."""
    tables: list[ForceTable] = []
    for where, forces in fastened:
        classes = dict.fromkeys(type(force) for force in forces)
        tables += [c.compile([force for force in forces if type(force) is c], where) for c in classes]
    if world.accuracy.response == "penalty":
        from rigidimpulse.dynamics.penalty.penalty import penalty_tables

        tables += penalty_tables(world)
    if tables:
        from rigidimpulse.dynamics.forces.force import check_names

        check_names(tables)
    return tables


def _start(bodies: list[Body], masses: list[BodyMass]) -> dict[str, Any]:
    """Centres of mass and principal axes in the body frames, where these are and how they move at the start; see `World`."""
    offset = np.array([m.center_of_mass for m in masses], float).reshape(-1, 3)
    turn = np.array([m.turn for m in masses], float).reshape(-1, 4)
    poses = [_pose_at_start(body) for body in bodies]
    origin = np.array([place for place, _ in poses], float).reshape(-1, 3)
    orientation = np.array([turned for _, turned in poses], float).reshape(-1, 4)
    return {
        "offset": offset, "turn": turn,
        "position": origin + rotate(orientation, offset),
        "orientation": multiply(orientation, turn),
        "velocity": np.array([body.velocity for body in bodies], float).reshape(-1, 3),
        "angular_velocity": np.array([body.angular_velocity for body in bodies], float).reshape(-1, 3),
    }  # fmt: skip


def _pose_at_start(body: Body) -> tuple[ArrayLike, np.ndarray]:
    """Position [m] and orientation of a body's frame at time 0: with keyframes it is where they have it, before the first one at that."""
    if body.keyframes is None:
        return body.position, body.unit_orientation()
    times, positions, turned = body.keyframes.arrays(body.orientation)
    k = max(int(np.searchsorted(times, 0.0, "right")) - 1, 0)
    if times[k] >= 0.0 or k + 1 == len(times):
        return positions[k], turned[k]
    share = -times[k] / (times[k + 1] - times[k])
    turn = share * rotation_vector(multiply(turned[k + 1], conjugate(turned[k])))
    return positions[k] + share * (positions[k + 1] - positions[k]), multiply(quaternion_from_rotation_vector(turn), turned[k])


def _refuse_fixed_steps(accuracy: Accuracy) -> None:
    """Raise a SceneError for an integrator of fixed steps, of a scene in which forces vary not at all or not alone."""
    if accuracy.integrator != "exact":
        raise SceneError(
            f"integrator is {accuracy.integrator!r}, for bodies that nothing but forces that vary moves",
            "use integrator='exact', or response='penalty' without joints",
            "accuracy",
        )


def _steady_pull(scene: Scene, inv_mass: np.ndarray, left_out: frozenset[str]) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (n, 3) by gravity and by constant forces."""
    factor = np.array([0.0 if "gravity" in left_out else body.gravity_factor for body in scene.bodies], float)
    gravity = factor[:, None] * np.asarray(scene.gravity, float) * (inv_mass > 0.0)[:, None]
    steady = [] if "constant forces" in left_out else _steady_forces(scene)
    return gravity, push_of_forces(steady, [body.name for body in scene.bodies], inv_mass)


def _steady_forces(scene: Scene) -> list[ConstantForce]:
    """Constant forces at the centres of mass of bodies whose mass stays."""
    losing = {effect.body for effect in scene.effects if getattr(effect, "takes_mass", False)}
    forces = [effect for effect in scene.effects if isinstance(effect, ConstantForce)]
    return [force for force in forces if force.point is None and force.body not in losing]


def _pairs_apart(joints: list[Joint], bodies: list[Body], dynamic: np.ndarray) -> np.ndarray:
    """Keys, ascending, of the pairs of bodies that do not touch each other, since they are joined or by their filters."""
    names = [body.name for body in bodies]
    pairs = {
        tuple(sorted((names.index(joint.a), names.index(joint.b))))
        for joint in joints
        if joint.a in names and joint.b in names and not joint.collide
    }
    joined = np.array(sorted(a * len(names) + b for a, b in pairs), np.int64)
    return np.union1d(joined, pairs_filtered((body.collision_filter for body in bodies), dynamic))


def _is_driven(body: Body) -> bool:
    return body.keyframes is not None or bool(np.any(body.velocity) or np.any(body.angular_velocity))


def _materials(bodies: list[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index of each body's material, the coefficients of all pairs of materials, and their rolling friction (empty if none has any)."""
    unique = list(dict.fromkeys(body.material for body in bodies))
    index = np.array([unique.index(body.material) for body in bodies], np.int64)
    coefficients = np.array([[combine(a, b) for b in unique] for a in unique], float)
    rolling = np.array([[combine_rolling(a, b) for b in unique] for a in unique], float)
    k, rolls = len(unique), len(unique) if rolling.any() else 0
    return index, coefficients.reshape(k, k, 4), rolling.reshape(k, k, 2)[:rolls, :rolls]
