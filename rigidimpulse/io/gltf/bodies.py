"""Bodies from the colliders of a node and its motion: shape, mass, velocities, keyframes, and what holds infinite masses."""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import rotate, to_matrix
from rigidimpulse.io.gltf.animation import Animations
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.io.gltf.schema import LARGEST, Motion
from rigidimpulse.io.inertia import with_possible_inertia
from rigidimpulse.io.pieces import DENSITY, GHOST, Piece, fill_mass, joined
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.joint import FixedJoint
from rigidimpulse.scene.joint_six_axis import AXES, Limit, SixAxisJoint
from rigidimpulse.scene.shape import Shape


class BodyMaker:
    """Makes bodies and the joints that hold them.

    Attributes:
        bodies, joints: what was made. name_of: body of each node. parts: names of bodies welded to another one.

    """

    def __init__(self, hierarchy: Hierarchy, animations: Animations, notes: list[str]) -> None:
        """notes: where lines of the report go."""
        self.hierarchy, self.animations, self.notes = hierarchy, animations, notes
        self.bodies: list[Body] = []
        self.joints: list[Any] = []
        self.name_of: dict[int, str] = {}
        self.parts: list[str] = []

    def add(self, node: int, motion: Motion | None, pieces: list[Piece]) -> None:
        """Add the body of a node. Without motion it is static, or follows its animation."""
        name = self.hierarchy.names[node]
        self.name_of[node] = name
        if not pieces:
            self.notes.append(f"body {name!r} has no collider: it touches nothing")
            pieces = [GHOST]
        groups: dict[CollisionFilter | None, list[Piece]] = {}
        for piece in pieces:
            groups.setdefault(piece.collision_filter, []).append(piece)
        shape = joined(pieces)
        common = self._common(node, name, motion, shape)
        if len(groups) == 1 or common["motion"] == "static":
            for number, (filter_, group) in enumerate(groups.items()):
                title = name if number == 0 else self._part_name(name, number)
                self._add(title, joined(group), group, filter_, common)
            return
        self._add_welded(name, motion, groups, shape, common)

    def _add(self, name: str, shape: Shape, pieces: list[Piece], filter_: CollisionFilter | None, values: dict[str, Any]) -> None:
        if any(piece.material != pieces[0].material for piece in pieces):
            self.notes.append(f"body {name!r} has colliders of several materials: that of the first counts")
        body = Body(name, shape, material=pieces[0].material, collision_filter=filter_, **values)
        self.bodies.append(with_possible_inertia(body, self.notes))

    def _part_name(self, name: str, number: int) -> str:
        title = f"{name} part {number + 1}"
        self.parts.append(title)
        return title

    def _add_welded(self, name: str, motion: Motion | None, groups: dict, shape: Shape, common: dict[str, Any]) -> None:
        """Add one body for each filter, all of them with the motion of the whole."""
        self.notes.append(f"body {name!r} has colliders with several filters: each is a body, welded to the first")
        if any(common.get(key) is not None for key in ("inertia", "center_of_mass")):
            self.notes.append(f"body {name!r}: its centre of mass and inertia are those of its colliders")
        values = {key: value for key, value in common.items() if key not in ("inertia", "center_of_mass", "mass")}
        centre, velocity = shape.solid().centroid, np.asarray(common.get("velocity", np.zeros(3)))
        turn = np.asarray(common["orientation"])
        for number, (filter_, group) in enumerate(groups.items()):
            own, title = joined(group), name if number == 0 else self._part_name(name, number)
            arm = rotate(turn, own.solid().centroid - centre)
            if common.get("keyframes") is None:
                values["velocity"] = velocity + np.cross(common["angular_velocity"], arm)
            if common.get("mass") is not None:
                values["mass"] = common["mass"] * own.solid().volume / shape.solid().volume
            self._add(title, own, group, filter_, values)
            if number and common["motion"] == "dynamic":
                self.joints.append(FixedJoint(name, title, name=f"weld of {title}"))

    def _common(self, node: int, name: str, motion: Motion | None, shape: Shape) -> dict[str, Any]:
        """Return the arguments of the body, without shape, material and filter."""
        turn = self.hierarchy.turn[node]
        values: dict[str, Any] = {"position": self.hierarchy.position(node).copy(), "orientation": turn, "motion": "static"}
        release = release_of(self.hierarchy, node)
        if self.animations.moves(node) and (motion is None or motion.is_kinematic or release is not None):
            keys = self.animations.keyframes(node)
            _, places, turns = keys.arrays()
            # Before its first key a node is where that has it.
            values |= {"position": places[0], "orientation": turns[0]}
            if release is not None:
                values = self._with_mass(node, name, motion or Motion(), shape, values) | {"release_time": release}
            return {**values, "motion": "kinematic", "keyframes": keys}
        if motion is None:
            return values
        if self.animations.moves(node):
            self.notes.append(
                f"body {name!r} is animated and moved by physics: its animation is not read; give its node the extra release_time, in s, "
                "until which it follows that"
            )
        assert motion is not None
        axes, hand = self.hierarchy.axes(node)
        # In a mirror a turn has the other sense.
        velocity, spin = axes @ np.array(motion.linear_velocity), hand * axes @ np.array(motion.angular_velocity)
        values |= {"velocity": rotate(turn, velocity), "angular_velocity": rotate(turn, spin)}
        if motion.center_of_mass is not None:
            stretch = to_matrix(turn).T @ self.hierarchy.world[node, :3, :3]
            values["center_of_mass"] = stretch @ np.array(motion.center_of_mass)
        if motion.is_kinematic and release is not None:
            return self._with_mass(node, name, motion, shape, values) | {"motion": "kinematic", "release_time": release}
        if motion.is_kinematic:
            return {**values, "motion": "kinematic"}
        return self._with_mass(node, name, motion, shape, values)

    def _with_mass(self, node: int, name: str, motion: Motion, shape: Shape, values: dict[str, Any]) -> dict[str, Any]:
        """Add the mass properties of a dynamic body, and the joints that make them infinite."""
        moments = motion.inertia_diagonal
        free = [k for k in range(3) if moments is not None and moments[k] > 0.0]
        if motion.mass == 0.0 and not free:
            self.notes.append(f"body {name!r} has infinite mass and inertia: it keeps its velocities")
            return {**values, "motion": "kinematic"}
        values |= {"motion": "dynamic", "gravity_factor": motion.gravity_factor}
        if motion.mass:
            values["mass"] = motion.mass
        if moments is not None and free:
            x, y, z, w = motion.inertia_orientation
            axes = self.hierarchy.axes(node)[0] @ to_matrix(np.array([w, x, y, z]) / max(float(np.linalg.norm((w, x, y, z))), 1e-9))
            finite = [moments[k] if k in free else max(moments) for k in range(3)]
            values["inertia"] = axes @ np.diag(finite) @ axes.T
        fill_mass(name, shape, values, self.notes)
        locked = [k for k in range(3) if moments is not None and k not in free]
        if motion.mass == 0.0 or locked:
            self._hold(node, name, motion, shape, values, locked)
        return values

    def _hold(self, node: int, name: str, motion: Motion, shape: Shape, values: dict[str, Any], locked: list[int]) -> None:
        """Lock what is infinite by a joint to the world: the centre of mass, and turns about the axes of infinite inertia."""
        turn = values["orientation"]
        x, y, z, w = motion.inertia_orientation if motion.inertia_diagonal and any(motion.inertia_diagonal) else (0.0, 0.0, 0.0, 1.0)
        own, hand = self.hierarchy.axes(node)
        axes = hand * to_matrix(turn) @ own @ to_matrix(np.array([w, x, y, z]) / max(float(np.linalg.norm((w, x, y, z))), 1e-9))
        limits = []
        if motion.mass == 0.0:
            values |= {"gravity_factor": 0.0, "mass": _mass_of(shape)}
            limits.append(Limit("xyz", lower=0.0, upper=0.0))
            if np.any(values["velocity"]):
                self.notes.append(f"body {name!r} has infinite mass but finite inertia: its velocity is not read, it is held in place")
                values["velocity"] = np.zeros(3)
        if locked:
            limits.append(Limit(rotation="".join(AXES[k] for k in locked), lower=0.0, upper=0.0))
            spin = axes.T @ values["angular_velocity"]
            if np.any(spin[locked]):
                self.notes.append(f"body {name!r} has infinite inertia: its angular velocity about those axes is not read")
                spin[locked] = 0.0
                values["angular_velocity"] = axes @ spin
        what = "mass" if motion.mass == 0.0 else "inertia"
        self.notes.append(f"body {name!r} has infinite {what}: a joint to the world holds it")
        centre = values.get("center_of_mass")
        if centre is None:
            centre = _centroid(shape)
        anchor = values["position"] + rotate(turn, np.asarray(centre))
        self.joints.append(SixAxisJoint(None, name, anchor=anchor, axes=axes.T, limits=limits, name=f"{name} infinite {what}"))


def _centroid(shape: Shape) -> np.ndarray:
    try:
        return shape.solid().centroid
    except SceneError:
        return np.zeros(3)


def _mass_of(shape: Shape) -> float:
    """A mass for a body that joints hold: any will do."""
    try:
        return DENSITY * shape.solid().volume
    except SceneError:
        return 1.0


def release_of(hierarchy: Hierarchy, node: int) -> float | None:
    """The time from when on a node's body is dynamic, s; None if its extras have none.

    Raises:
        SceneError: it is no time.

    """
    extras = hierarchy.nodes[node].extras
    value = extras.get("release_time") if isinstance(extras, dict) else None
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value <= LARGEST:
        raise hierarchy.file.error(
            f"release_time is {str(value)[:40]!r}", "give a time in s, > 0", f"extras of node {hierarchy.names[node]!r}"
        )
    return float(value)
