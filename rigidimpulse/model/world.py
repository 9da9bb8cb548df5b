"""The compiled scene: constant arrays that the stages read. People's body frames end here; inside, everything is principal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Geometry, build_geometry, compile_shape
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix, multiply, rotate
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.constant import ConstantForce, push_of_forces
from rigidimpulse.model.joint_table import Joints, compile_joints
from rigidimpulse.scene.accuracy import Accuracy, resolve_accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.collision_filter import pairs_filtered
from rigidimpulse.scene.frames import own_pose
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.mass import BodyMass, masses_of
from rigidimpulse.scene.material import combine, combine_rolling
from rigidimpulse.scene.scene import Scene, validate

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force import ForceTable


@dataclass(frozen=True, eq=False)
class World:
    """Constant arrays of n bodies; see the head of `state.py` for what varies.

    Attributes:
        scene: the scene as written.
        accuracy: settings of the run.
        names: body names in order of index.
        dynamic: (n,) bool, those that will be (see `Carried`) included. moving: (n,) bool, kinematic ones with a velocity or keyframes.
        mass, inv_mass: (n,) kg, 1/kg (0 for immovable). inertia: (n, 3) kg m2, principal (1 for immovable).
        offset: (n, 3) m, centre of mass in the body frame. turn: (n, 4), principal axes in the body frame.
        position, orientation, velocity, angular_velocity: principal-frame state at time 0.
        gravity, push: (n, 3) m/s2, of gravity and of constant forces. steady_acceleration: (n, 3) m/s2, their sum.
        shape_of_body: (n,). size: (n,) m, largest extent, inf for half spaces. bound_radius: (n,) m about the centre of mass.
        static_min, static_max: (n, 3) m, world boxes of bodies where they start.
        material_of_body: (n,). coefficients: (k, k, 4), see material.combine.
        rolling: (k, k, 2) m, rolling and spinning friction, see material.combine_rolling; None where there is none.
        flat: (n,) bool, has faces or rims that must not touch those of another at gap 0.
        half_space, ball: (n,) bool, the shape is half spaces only; one sphere about the centre of mass.
        impact_margin: gap at which faces and rims meet, as a fraction of the smaller body's size.
        apart: (p,) pairs a * n + b, a < b, ascending, that do not touch each other by a joint or by their collision filters.
        joints_of_scene: the joints as written. left_out: names of effects that the caller leaves out.
        contact_margin: gap at which lasting contacts are held, as a fraction of the smaller body's size.

    """

    scene: Scene
    accuracy: Accuracy
    names: list[str]
    shapes: list[CompiledShape]
    geometry: Geometry
    dynamic: np.ndarray
    moving: np.ndarray
    mass: np.ndarray
    inv_mass: np.ndarray
    inertia: np.ndarray
    offset: np.ndarray
    turn: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    gravity: np.ndarray
    push: np.ndarray
    steady_acceleration: np.ndarray
    shape_of_body: np.ndarray
    size: np.ndarray
    bound_radius: np.ndarray
    static_min: np.ndarray
    static_max: np.ndarray
    material_of_body: np.ndarray
    coefficients: np.ndarray
    rolling: np.ndarray | None
    flat: np.ndarray
    half_space: np.ndarray
    ball: np.ndarray
    contact_margin: float
    impact_margin: float
    apart: np.ndarray
    joints_of_scene: list[Joint]
    left_out: frozenset[str]

    @property
    def num_bodies(self) -> int:
        """Number of bodies."""
        return len(self.names)

    @cached_property
    def cylinders(self) -> int | None:
        """None where no shape is a cylinder: kernels then leave their part out, also when they are compiled."""
        return 1 if np.any(self.geometry.kind == CYLINDER) else None

    @cached_property
    def steady_strength(self) -> np.ndarray:
        """(n,) m/s2, magnitude of the steady acceleration."""
        return np.linalg.norm(self.steady_acceleration, axis=1)

    @cached_property
    def largest_contact_margin(self) -> float:
        """Largest gap at which any contact is held, m."""
        finite = self.size[np.isfinite(self.size)]
        return self.contact_margin * float(finite.max()) if len(finite) else 0.0

    @cached_property
    def force_tables(self) -> list[ForceTable]:
        """The forces that vary, by class."""
        steady = _steady_forces(self.scene)
        forces = [effect for effect in self.scene.effects if effect.stage == "forces" and effect not in steady]
        classes = dict.fromkeys(type(force) for force in forces if force.kind not in self.left_out)
        tables = [c.compile([force for force in forces if type(force) is c], self) for c in classes]
        if self.accuracy.response == "penalty":
            from rigidimpulse.dynamics.penalty.penalty import penalty_tables

            tables += penalty_tables(self)
        if tables:
            from rigidimpulse.dynamics.forces.force import check_names

            check_names(tables)
        return tables

    @cached_property
    def joints(self) -> Joints:
        """The table of joints."""
        return compile_joints(self.joints_of_scene, self)

    @cached_property
    def joint_size(self) -> float:
        """Size of the smallest body that a joint joins, m."""
        ends = np.concatenate([self.joints.body_a, self.joints.body_b])
        return float(self.size[ends[ends >= 0]].min(initial=np.inf))

    @cached_property
    def triggers(self) -> list:
        """Effects of the stage observe: volumes that report overlap."""
        return [] if "triggers" in self.left_out else [effect for effect in self.scene.effects if effect.stage == "observe"]

    @property
    def can_collide(self) -> bool:
        """Whether any two bodies may ever come to an impact: a dynamic one and another, unless springs push them apart."""
        return bool(self.dynamic.any()) and self.num_bodies > 1 and self.accuracy.response != "penalty"

    @property
    def why_no_impacts(self) -> str:
        """What `explain` says where `can_collide` is false."""
        return "springs push bodies apart, see penalty forces" if self.accuracy.response == "penalty" else "nothing can collide"

    @property
    def can_press(self) -> bool:
        """Whether anything but impacts can press bodies together: steady forces, a moving support, the spin of what is no ball."""
        return bool(self.force_tables or np.any(self.steady_acceleration) or np.any(self.moving) or not np.all(self.ball[self.dynamic]))

    def may_collide(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs take part in contact at all: at least one of the bodies is dynamic."""
        may = (self.dynamic[a] | self.dynamic[b]) & self.can_collide
        return may & ~self.is_apart(a, b) if len(self.apart) else may

    def is_apart(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs a < b are among those that do not touch each other by order."""
        key = a * self.num_bodies + b
        place = np.searchsorted(self.apart, key)
        return (self.apart[np.minimum(place, len(self.apart) - 1)] == key) if len(self.apart) else np.zeros(np.shape(key), bool)

    def least_impact_margin(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Gap at which contact of new pairs is declared, m: 0 where normals are well defined at gap 0."""
        size = np.minimum(self.size[a], self.size[b])
        return np.where(self.flat[a] & self.flat[b], self.impact_margin * size, 0.0)

    def body_pose(self, i: int, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose of the body's own origin and axes from principal-frame poses (f, 3), (f, 4)."""
        return own_pose(position, orientation, self.offset[i], self.turn[i])


def compile_scene(scene: Scene, accuracy: str | Accuracy = "standard", left_out: frozenset[str] = frozenset()) -> World:
    """Check a scene and compile it, but for the effects of the names that are left out.

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
    low, high = _world_boxes(geometry, shape_of_body, start["position"], start["orientation"])
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
        rolling=None if "rolling friction" in left_out else rolling,
        flat=_has_faces(geometry, shape_of_body),
        half_space=np.array([_all_half_spaces(geometry, k) for k in shape_of_body], bool),
        ball=np.array([_is_ball(geometry, k) for k in shape_of_body], bool),
        contact_margin=TOLERANCES.contact.margin,
        impact_margin=TOLERANCES.contact.impact_margin,
        apart=_pairs_apart(joints, bodies, dynamic),
        joints_of_scene=joints,
        left_out=left_out,
    )
    if not world.force_tables or world.can_collide or joints:  # bad forces are refused here
        _refuse_fixed_steps(world.accuracy)
    return world


def _start(bodies: list[Body], masses: list[BodyMass]) -> dict[str, np.ndarray]:
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


def _is_driven(body) -> bool:
    return body.keyframes is not None or bool(np.any(body.velocity) or np.any(body.angular_velocity))


def _compile_shapes(bodies, masses) -> tuple[list[CompiledShape], np.ndarray]:
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


def _world_boxes(geometry, shape_of_body, position, orientation) -> tuple[np.ndarray, np.ndarray]:
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
    """Box of a half space; it ends at the plane if that lies across an axis of the world, or every body would be paired with every wall."""
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


def _materials(bodies) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Index of each body's material, the combined coefficients of all pairs of materials, and their rolling friction."""
    unique = list(dict.fromkeys(body.material for body in bodies))
    index = np.array([unique.index(body.material) for body in bodies], np.int64)
    coefficients = np.array([[combine(a, b) for b in unique] for a in unique], float)
    rolling = np.array([[combine_rolling(a, b) for b in unique] for a in unique], float)
    k = len(unique)
    return index, coefficients.reshape(k, k, 4), rolling.reshape(k, k, 2) if rolling.any() else None
