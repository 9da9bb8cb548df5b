"""A scene as a glTF file with physics, which `load_scene` reads back.

Every body is a node with its pose and mass properties, and with its shape as colliders: on the node itself, or on children
where parts of the shape are placed or stand along z, since glTF's capsules and cylinders stand along Y. Joints are pairs of
nodes, one on each body, with limits and drives; keyframes are an animation. Velocities are in node space: v_node = Q^T v.

What only we read is in `extras`: gravity, densities, and which coefficients a material leaves unstated. Positions in meshes
and times of keyframes have single precision, all else double. What cannot be said is returned as lines.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import conjugate, from_matrix, multiply, rotate, rotate_inverse
from rigidimpulse.engine.triggers import Trigger
from rigidimpulse.io.gltf.container import Builder
from rigidimpulse.io.gltf.draw import Drawing, new_file, node_pose, stage
from rigidimpulse.io.gltf.implicit import Y_FROM_Z
from rigidimpulse.io.gltf.own_materials import NOTE, STATIC, material_entry
from rigidimpulse.io.gltf.schema import IMPLICIT_SHAPES, RIGID_BODIES
from rigidimpulse.io.gltf.write_joints import joint_entry
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.mass import body_mass
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.scene.scene import Scene, validate
from rigidimpulse.scene.shape import Part, Shape

NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])


def write_physics(scene: Scene, target: Path) -> list[str]:
    """Write a .glb or .gltf file with physics; return what is not in it, a line each.

    Raises:
        SceneError: the scene is not valid.

    """
    validate(scene)
    writer = _Writer(scene)
    number = 0
    for body in bodies_as_seen(scene):
        writer.add_body(body, number)
        number += body.motion != "static"
    for effect in scene.effects:
        writer.add_effect(effect)
    writer.finish().write(target)
    return writer.left_out


class _Writer:
    """A file that is being made of a scene."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.builder, self.left_out = scene, new_file(), []
        self.builder.tree["scenes"][0]["extras"] = {NOTE: {"gravity": [float(x) for x in np.asarray(scene.gravity, float)]}}
        self.parents, turn = stage(self.builder, scene.gravity, "world")
        if np.any(turn[1:]):
            gravity = rotate(turn, np.asarray(scene.gravity, float))
            self.builder.tree["scenes"][0]["extras"][NOTE]["gravity"] = (np.round(gravity, 12) + 0.0).tolist()
        places = np.array([body.position for body in scene.bodies], float)
        self.drawing = Drawing(self.builder, 2.0 * float(np.abs(places).max(initial=0.0)))
        self.node_of: dict[str, int] = {}
        self.shared: dict[str, list[Any]] = {"shapes": [], "physicsMaterials": [], "collisionFilters": [], "physicsJoints": []}
        self._index: dict[Any, int] = {}
        # Nodes of bodies come first, so that their names are theirs whatever their children are called.
        for body in scene.bodies:
            pose = node_pose(np.asarray(body.position, float), body.unit_orientation())
            self.node_of[body.name] = self.builder.add("nodes", {"name": body.name, **pose})
            self.parents.append(self.node_of[body.name])

    def _entry(self, kind: str, key: Any, entry: dict[str, Any]) -> int:
        """Index of an entry of a list, which equal things share."""
        if (kind, key) not in self._index:
            self.shared[kind].append(entry)
            self._index[kind, key] = len(self.shared[kind]) - 1
        return self._index[kind, key]

    def _child(self, parent: str | None, entry: dict[str, Any]) -> int:
        """A new node below the node of a body, or of the scene."""
        index = self.builder.add("nodes", entry)
        (self.parents if parent is None else self.builder.tree["nodes"][self.node_of[parent]].setdefault("children", [])).append(index)
        return index

    def _physics(self, node: int) -> dict[str, Any]:
        return self.builder.tree["nodes"][node].setdefault("extensions", {}).setdefault(RIGID_BODIES, {})

    def add_body(self, body: Body, number: int) -> None:
        """Add motion and colliders of a body; number: of the bodies that move before it."""
        node = self.node_of[body.name]
        if body.motion != "static":
            self._physics(node)["motion"] = self._motion(body)
        if body.release_time is not None:
            self.builder.tree["nodes"][node]["extras"] = {"release_time": float(body.release_time)}
        if body.keyframes is not None:
            self._animate(body, node)
        material, lines = material_entry(body.material, body.name)
        self.left_out += lines
        collider = {"physicsMaterial": self._entry("physicsMaterials", body.material, material)}
        if body.collision_filter is not None:
            collider["collisionFilter"] = self._filter(body.collision_filter)
        parts, looks_else = body.shape.parts_flat(), body.drawn_shape is not body.shape
        if looks_else and any(part.shape.kind == "mesh" for part in parts):
            # The mesh of a collider is that of its node, which is seen.
            self.left_out.append(f"body {body.name!r}: its visual shape, beside a mesh that collides")
            looks_else = False
        if looks_else:
            self.builder.tree["nodes"][self._child(body.name, {"name": f"{body.name} visual"})]["mesh"] = self.drawing.mesh(body, number)
        for k, part in enumerate(parts):
            place, turn, geometry, shape = self._geometry(part)
            if body.motion == "static" and (len(parts) > 1 or np.any(place) or np.any(turn[1:])):
                self.builder.tree["nodes"][node]["extras"] = {NOTE: {STATIC: True}}
            if len(parts) == 1 and not np.any(place) and not np.any(turn[1:]):
                where = node
            else:
                where = self._child(body.name, {"name": f"{body.name} collider {k}", **node_pose(place, turn)})
            if geometry is None:
                geometry = {"node": where}
            self._physics(where)["collider"] = {"geometry": geometry, **collider}
            if not looks_else:
                self.builder.tree["nodes"][where]["mesh"] = self.drawing.mesh(body, number, shape)

    def _geometry(self, part: Part) -> tuple[np.ndarray, np.ndarray, dict[str, Any] | None, Shape]:
        """Place, turn, geometry (None: the mesh of the node) and what is seen of a part, in glTF's axes."""
        shape, turn = part.shape, from_matrix(part.rotation) if np.any(part.rotation != np.eye(3)) else NO_TURN
        if shape.kind == "mesh":
            return part.position, turn, None, shape
        if shape.kind == "half_space":
            normal, offset = shape.plane()
            up = _turn_from_y(part.rotation @ normal)
            entry = {"type": "plane", "plane": {}}
            return part.position + part.rotation @ normal * offset, up, self._shape(("plane",), entry), Shape.half_space((0.0, 1.0, 0.0))
        if shape.kind in ("sphere", "box"):
            assert shape.kind == "sphere" or shape.size is not None
            figures = {"radius": shape.radius} if shape.kind == "sphere" else {"size": np.asarray(shape.size).tolist()}
            return part.position, turn, self._shape((shape.kind, str(figures)), {"type": shape.kind, shape.kind: figures}), shape
        figures = {"height": shape.height, "radiusBottom": shape.radius, "radiusTop": shape.radius}
        standing = Shape.compound([(shape, (0.0, 0.0, 0.0), Y_FROM_Z)])
        index = self._shape((shape.kind, shape.radius, shape.height), {"type": shape.kind, shape.kind: figures})
        return part.position, multiply(turn, conjugate(Y_FROM_Z)), index, self._known(("standing", shape.kind, str(figures)), standing)

    def _known(self, key: Any, shape: Shape) -> Shape:
        """The same object for equal shapes, so that they share a mesh."""
        return self._index.setdefault(key, shape)  # pyright: ignore[reportArgumentType, reportReturnType]

    def _shape(self, key: Any, entry: dict[str, Any]) -> dict[str, Any]:
        return {"shape": self._entry("shapes", key, entry)}

    def _filter(self, given: CollisionFilter) -> int:
        entry: dict[str, Any] = {"collisionSystems": list(given.systems)} if given.systems else {}
        if given.collide_with is not None:
            entry["collideWithSystems"] = list(given.collide_with)
            if given.not_collide_with:
                self._leave_out("a collision filter has both collide_with and not_collide_with: the second is not written")
        elif given.not_collide_with:
            entry["notCollideWithSystems"] = list(given.not_collide_with)
        return self._entry("collisionFilters", given, entry)

    def _motion(self, body: Body) -> dict[str, Any]:
        mass, orientation = body_mass(body), body.unit_orientation()
        motion: dict[str, Any] = {"isKinematic": True} if body.motion == "kinematic" else {}
        for name, value in (("linearVelocity", body.velocity), ("angularVelocity", body.angular_velocity)):
            if np.any(value):
                motion[name] = rotate_inverse(orientation, np.asarray(value, float)).tolist()
        if not body.becomes_dynamic:
            return motion | {"centerOfMass": mass.center_of_mass.tolist()}
        motion |= {"mass": mass.mass, "centerOfMass": mass.center_of_mass.tolist(), "inertiaDiagonal": mass.moments.tolist()}
        if np.any(mass.axes != np.eye(3)):
            motion["inertiaOrientation"] = from_matrix(mass.axes)[[1, 2, 3, 0]].tolist()
        return motion | ({"gravityFactor": float(body.gravity_factor)} if body.gravity_factor != 1.0 else {})

    def _animate(self, body: Body, node: int) -> None:
        """Add the keyframes of a body."""
        assert body.keyframes is not None
        times, positions, orientations = body.keyframes.arrays(body.unit_orientation())
        single = times.astype(np.float32)
        if times[0] < 0.0 or np.any(np.diff(single) <= 0.0):
            self._leave_out(f"body {body.name!r} has keyframes before time 0, or too close together: they are not written")
            return
        keys = self.builder.array(single, "SCALAR", bounds=True)
        values = (("translation", positions, "VEC3"), ("rotation", orientations[:, [1, 2, 3, 0]], "VEC4"))
        samplers = [{"input": keys, "output": self.builder.array(data, kind)} for _, data, kind in values]
        channels = [{"sampler": k, "target": {"node": node, "path": path}} for k, (path, _, _) in enumerate(values)]
        self.builder.add("animations", {"name": body.name, "samplers": samplers, "channels": channels})

    def _leave_out(self, line: str) -> None:
        if line not in self.left_out:
            self.left_out.append(line)

    def add_effect(self, effect: Any) -> None:
        """Add a joint or a trigger; list anything else."""
        if isinstance(effect, Joint):
            self._add_joint(effect)
        elif isinstance(effect, Trigger):
            self._add_trigger(effect)
        else:
            self._leave_out(f"{type(effect).__name__} cannot be said in glTF: not written")

    def _add_joint(self, joint: Joint) -> None:
        from rigidimpulse.engine.compile_scene import compile_scene

        if not hasattr(self, "_world"):
            self._world = compile_scene(self.scene)
        entry, anchors, frames, lines = joint_entry(joint, self._world)
        self.left_out += lines
        name = joint.name or f"joint{len(self.shared['physicsJoints'])}"
        self.shared["physicsJoints"].append(entry)
        nodes = []
        for body, anchor, frame, title in zip((joint.a, joint.b), anchors, frames, (name, f"{name} end"), strict=True):
            position, orientation = anchor, from_matrix(frame)
            if body is not None:
                place, turn = self.scene[body].position, self.scene[body].unit_orientation()
                position = rotate_inverse(turn, anchor - np.asarray(place, float))
                orientation = multiply(conjugate(turn), orientation)
            nodes.append(self._child(body, {"name": title, **node_pose(position, orientation)}))
        collides = {"enableCollision": True} if joint.collide else {}
        number = len(self.shared["physicsJoints"]) - 1
        self._physics(nodes[0])["joint"] = {"connectedNode": nodes[1], "joint": number, **collides}

    def _add_trigger(self, trigger: Trigger) -> None:
        pose = node_pose(np.asarray(trigger.position, float), np.asarray(trigger.orientation, float))
        node = self._child(trigger.body, {"name": trigger.name, **pose})
        more = {} if trigger.collision_filter is None else {"collisionFilter": self._filter(trigger.collision_filter)}
        parts, nodes = trigger.shape.parts_flat(), []
        standing = Body(trigger.name, trigger.shape, motion="static")
        for k, part in enumerate(parts):
            place, turn, geometry, shape = self._geometry(part)
            where = node
            if len(parts) > 1 or np.any(place) or np.any(turn[1:]):
                where = self.builder.add("nodes", {"name": f"{trigger.name} volume {k}", **node_pose(place, turn)})
                self.builder.tree["nodes"][node].setdefault("children", []).append(where)
                nodes.append(where)
            if geometry is None:
                geometry = {"node": where}
                self.builder.tree["nodes"][where]["mesh"] = self.drawing.mesh(standing, 0, shape)
            self._physics(where)["trigger"] = {"geometry": geometry, **more}
        if nodes:
            self._physics(node)["trigger"] = {"nodes": nodes}

    def finish(self) -> Builder:
        """Put the shared lists into the file."""
        tree = self.builder.tree
        physics = {key: value for key, value in self.shared.items() if value and key != "shapes"}
        tree["extensionsUsed"] = [RIGID_BODIES]
        tree["extensions"] = {RIGID_BODIES: physics} if physics else {}
        if self.shared["shapes"]:
            tree["extensionsUsed"].append(IMPLICIT_SHAPES)
            tree["extensions"][IMPLICIT_SHAPES] = {"shapes": self.shared["shapes"]}
        if not tree["extensions"]:
            del tree["extensions"]
        if self.left_out:
            tree["asset"]["extras"] = {NOTE: {"notWritten": self.left_out}}
        return self.builder


def _turn_from_y(normal: np.ndarray) -> np.ndarray:
    """Shortest turn, wxyz, that takes Y to a unit vector."""
    x, y, z = normal
    if y < -1.0 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    q = np.array([1.0 + y, z, 0.0, -x])
    return q / np.linalg.norm(q)
