"""From a scene to a world: shapes, masses, materials, joints and forces are checked and become arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Geometry, build_geometry, compile_shape
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix, multiply, rotate
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.constant import ConstantForce, push_of_forces
from rigidimpulse.model.joint_table import compile_joints
from rigidimpulse.model.world import World
from rigidimpulse.scene.accuracy import Accuracy, resolve_accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.collision_filter import pairs_filtered
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.mass import BodyMass, masses_of
from rigidimpulse.scene.material import combine, combine_rolling
from rigidimpulse.scene.scene import Scene, validate

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force import Force, ForceTable


def compile_scene(scene: Scene, accuracy: str | Accuracy = "standard", left_out: frozenset[str] = frozenset()) -> World:
    """Check a scene and compile it, without the effects whose names are in `left_out`.

    Raises:
        SceneError: naming the body, the value and the remedy.

    """
    validate(scene)
    bodies = list(scene.bodies)
    masses = masses_of(bodies)
    joints = [effect for effect in scene.effects if isinstance(effect, Joint) and "joints" not in left_out]
    dynamic = np.array([body.becomes_dynamic for body in bodies], bool)
    moving = np.array([body.motion == "kinematic" and _is_driven(body) for body in bodies], bool)
    start = _start(bodies, masses)
    shapes, shape_of_body = _compile_shapes(bodies, masses)
    geometry = build_geometry(shapes)
    size, radius = _extents(geometry, shape_of_body)
    low, high = world_boxes(geometry, shape_of_body, start["position"], start["orientation"])
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
        shapes=shapes,
        geometry=geometry,
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
        size=size,
        bound_radius=radius,
        static_min=low,
        static_max=high,
        material_of_body=material_of_body,
        coefficients=coefficients,
        rolling=rolling[:0, :0] if "rolling friction" in left_out else rolling,
        flat=_has_faces(geometry, shape_of_body),
        half_space=np.array([_all_half_spaces(geometry, k) for k in shape_of_body], bool),
        ball=np.array([_is_ball(geometry, k) for k in shape_of_body], bool),
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
    turns = {key: from_matrix(m.axes) for key, m in {id(m): m for m in masses}.items()}
    turn = np.array([turns[id(m)] for m in masses], float).reshape(-1, 4)
    origin = np.array([body.position for body in bodies], float).reshape(-1, 3)
    orientation = np.array([body.unit_orientation() for body in bodies], float).reshape(-1, 4)
    return {
        "offset": offset, "turn": turn,
        "position": origin + rotate(orientation, offset),
        "orientation": multiply(orientation, turn),
        "velocity": np.array([body.velocity for body in bodies], float).reshape(-1, 3),
        "angular_velocity": np.array([body.angular_velocity for body in bodies], float).reshape(-1, 3),
    }  # fmt: skip


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


def _compile_shapes(bodies: list[Body], masses: list[BodyMass]) -> tuple[list[CompiledShape], np.ndarray]:
    """Compile each shape once for each frame it is used in."""
    shapes: list[CompiledShape] = []
    known: dict[tuple, int] = {}
    index = np.zeros(len(bodies), np.int64)
    for i, (body, m) in enumerate(zip(bodies, masses, strict=True)):
        key = (body.shape.key, m.center_of_mass.tobytes(), m.axes.tobytes())
        if key not in known:
            known[key] = len(shapes)
            shapes.append(compile_shape(body.shape, m.center_of_mass, m.axes))
        index[i] = known[key]
    return shapes, index


def _primitives(geometry: Geometry, shape: int) -> range:
    return range(int(geometry.shape_first[shape]), int(geometry.shape_first[shape + 1]))


def _all_half_spaces(geometry: Geometry, shape: int) -> bool:
    return all(geometry.kind[p] == HALF_SPACE for p in _primitives(geometry, shape))


def _is_ball(geometry: Geometry, shape: int) -> bool:
    p, last = int(geometry.shape_first[shape]), int(geometry.shape_first[shape + 1])
    v = int(geometry.vertex_first[p])
    single = last == p + 1 and geometry.kind[p] == ROUND and geometry.vertex_first[p + 1] == v + 1
    return bool(single and not np.any(geometry.vertex[v]))


def _primitive_points(geometry: Geometry, p: int) -> tuple[np.ndarray, float]:
    """Points (k, 3) and the radius of the ball about each that enclose a finite primitive."""
    if geometry.kind[p] == CYLINDER:
        centre, axis, half = geometry.frame[p, :3], geometry.frame[p, 3:6], geometry.frame[p, 6]
        return np.array([centre - half * axis, centre + half * axis]), float(geometry.radius[p])
    return geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]], float(geometry.radius[p])


def _extents(geometry: Geometry, shape_of_body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest extent and bounding radius about the centre of mass, of every body."""
    size, radius = [], []
    for shape in range(len(geometry.shape_first) - 1):
        low, high, reach = np.full(3, np.inf), np.full(3, -np.inf), 0.0
        for p in _primitives(geometry, shape):
            if geometry.kind[p] == HALF_SPACE:
                low, high, reach = np.full(3, -np.inf), np.full(3, np.inf), np.inf
                break
            points, r = _primitive_points(geometry, p)
            low, high = np.minimum(low, points.min(0) - r), np.maximum(high, points.max(0) + r)
            reach = max(reach, float(np.linalg.norm(points, axis=1).max()) + r)
        size.append(float((high - low).max()))
        radius.append(reach)
    return np.array(size)[shape_of_body], np.array(radius)[shape_of_body]


def world_boxes(
    geometry: Geometry, shape_of_body: np.ndarray, position: np.ndarray, orientation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lows and highs (n, 3) m of the boxes of all bodies; position (n, 3) m and orientation (n, 4) of their principal frames."""
    low = np.full((len(shape_of_body), 3), np.inf)
    high = -low
    for i, shape in enumerate(shape_of_body):
        for p in _primitives(geometry, int(shape)):
            if geometry.kind[p] == HALF_SPACE:
                low[i], high[i] = _plane_box(geometry.frame[p], position[i], orientation[i])
                if len(_primitives(geometry, int(shape))) > 1:
                    low[i], high[i] = -np.inf, np.inf
                break
            points, r = _primitive_points(geometry, p)
            placed = rotate(orientation[i], points) + position[i]
            low[i] = np.minimum(low[i], placed.min(0) - r)
            high[i] = np.maximum(high[i], placed.max(0) + r)
    return low, high


def _plane_box(frame: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Box of a half space. Normal to an axis of the world it ends at the plane; else every body would be paired with every half space."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    normal = rotate(orientation, frame[:3])
    if np.count_nonzero(normal) == 1 and np.abs(normal).max() == 1.0:
        axis = int(np.argmax(np.abs(normal)))
        (high if normal[axis] > 0.0 else low)[axis] = position[axis] + normal[axis] * frame[3]
    return low, high


def _has_faces(geometry: Geometry, shape_of_body: np.ndarray) -> np.ndarray:
    """Polyhedra and cylinders: pairs of them need a gap for well-defined normals."""
    flat = [
        any(
            geometry.kind[p] == CYLINDER or (geometry.kind[p] == ROUND and geometry.radius[p] == 0.0)
            for p in _primitives(geometry, shape)
        )
        for shape in range(len(geometry.shape_first) - 1)
    ]
    return np.array(flat, bool)[shape_of_body]


def _materials(bodies: list[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index of each body's material, the coefficients of all pairs of materials, and their rolling friction (empty if none has any)."""
    unique = list(dict.fromkeys(body.material for body in bodies))
    index = np.array([unique.index(body.material) for body in bodies], np.int64)
    coefficients = np.array([[combine(a, b) for b in unique] for a in unique], float)
    rolling = np.array([[combine_rolling(a, b) for b in unique] for a in unique], float)
    k, rolls = len(unique), len(unique) if rolling.any() else 0
    return index, coefficients.reshape(k, k, 4), rolling.reshape(k, k, 2)[:rolls, :rolls]
