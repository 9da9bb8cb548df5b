"""A scene from a URDF file: links are bodies, joints are `SixAxisJoint`s, all joints at 0 at the start.

    pose of a child    that of its parent times the origin of the joint (xyz, rpy: R = R_z R_y R_x)
    revolute, continuous, prismatic    one axis, see `links`         fixed       all locked; links without mass are parts of the parent
    planar             two ways across the axis and the turn about it    floating    no joint

Format: http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.collision.geometry import compile_shape
from rigidimpulse.core.conventions import STANDARD_GRAVITY
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import multiply, quaternion_from_rotation_vector, rotate, to_matrix
from rigidimpulse.io.looks import Look
from rigidimpulse.io.pieces import Piece, Weight, joined
from rigidimpulse.io.robots.links import Link, axis_drives, axis_frame, axis_limits, carried, filters, fixed
from rigidimpulse.io.robots.xml import read_xml, robot_file
from rigidimpulse.scene.joint_six_axis import Limit, SixAxisJoint
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.origin import FileOrigin
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

LARGEST = 1e9
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
LINK_PARTS = {"inertial", "visual", "collision"}
JOINT_PARTS = {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"}
WORLD = "world"
"""Name of a root link that is the world itself."""


def load_urdf(path: Path, gravity: ArrayLike | None, allow_outside: bool, fixed_base: bool | None) -> Scene:
    """Read a .urdf file; see `rigidimpulse.load_scene`."""
    try:
        reader = _Reader(read_xml(path), path.parent, allow_outside)
        return reader.scene(STANDARD_GRAVITY if gravity is None else gravity, fixed_base)
    except SceneError as error:
        raise error if path.name in error.where else error.within(repr(path.name)) from None


class _Reader:
    """One file on its way to a scene."""

    def __init__(self, root: Any, folder: Path, allow_outside: bool) -> None:
        if root.tag != "robot":
            raise SceneError(f"its root is <{root.tag}>", "give a URDF file, with <robot>")
        self.folder, self.allow_outside = folder, allow_outside
        self.notes: list[str] = []
        self._meshes: dict[tuple, Shape] = {}
        self.links = _named(root, "link")
        self.joints = _named(root, "joint")
        self.joint_of = self._tree()
        named = [*root.findall("material"), *root.iterfind("link/visual/material")]
        self._colors = {entry.get("name"): color for entry in named if (color := entry.find("color")) is not None}
        others = Counter(entry.tag for entry in root if entry.tag not in ("link", "joint", "material"))
        self.notes += [f"<{tag}>, {count} times, is not read" for tag, count in sorted(others.items())]

    def _tree(self) -> dict[str, str]:
        """Return the joint above each link, by name; all links hang from one root."""
        joint_of: dict[str, str] = {}
        for name, joint in self.joints.items():
            where = f"joint {name!r}"
            if joint.get("type") not in KINDS:
                raise SceneError(f"its type is {joint.get('type')!r}", f"give one of {', '.join(KINDS)}", where)
            for side in ("parent", "child"):
                entry = joint.find(side)
                link = None if entry is None else entry.get("link")
                if link not in self.links:
                    raise SceneError(f"its {side} is {link!r}", f"name a link: {', '.join(self.links)}", where)
            child = joint.find("child").get("link")
            if child in joint_of:
                raise SceneError(f"link {child!r} has two parents", "URDF has trees only", where)
            joint_of[child] = name
        roots = [name for name in self.links if name not in joint_of]
        if len(roots) != 1:
            raise SceneError(f"it has {len(roots)} root links ({', '.join(roots)})", "give it one, and joints without circles")
        self.root = roots[0]
        self.order, seen = [self.root], {self.root}
        for name in self.order:
            below = [self._side(joint, "child") for joint in self.joints.values() if self._side(joint, "parent") == name]
            self.order += below
            seen.update(below)
        if len(seen) < len(self.links):
            raise SceneError(f"link {next(name for name in self.links if name not in seen)!r} hangs in a circle", "give a tree")
        return joint_of

    @staticmethod
    def _side(joint: Any, side: str) -> str:
        return joint.find(side).get("link")

    def scene(self, gravity: ArrayLike, fixed_base: bool | None) -> Scene:
        """Make the scene."""
        made: dict[str, Link] = {}
        for name in self.order:
            made[name] = self._link(name, made)
        joints, carrier = self._join(made, self._is_fixed(made) if fixed_base is None else fixed_base)
        kept = [name for name in self.order if carrier[name] == name]
        self.notes += carried({name: other for name, other in carrier.items() if name != WORLD or other is not None})
        apart = self._overlaps([made[name] for name in kept], joints)
        barred = filters(kept, apart)
        scene = Scene(gravity)
        for name in kept:
            scene.add(made[name].body(barred[name], self.notes))
        for joint in joints:
            scene.add(joint)
        scene.origin = FileOrigin(tuple(dict.fromkeys(self.notes)))
        return scene

    def _is_fixed(self, made: dict[str, Link]) -> bool:
        """Whether the root stands: it is the world, or others move against it, and neither it nor what is fixed to it has mass."""
        if self.root == WORLD:
            return True
        light, heavy = self._root_group(made)
        moving = any(joint.get("type") != "fixed" and self._side(joint, "parent") in light for joint in self.joints.values())
        return not heavy and moving

    def _root_group(self, made: dict[str, Link]) -> tuple[list[str], list[str]]:
        """Return the links without mass that are the root or fixed to it, also one by the other, and those with mass fixed to these."""
        fast = {self._side(joint, "child"): self._side(joint, "parent") for joint in self.joints.values() if joint.get("type") == "fixed"}
        light: list[str] = []
        heavy: list[str] = []
        for name in self.order:
            if name == self.root or fast.get(name) in light:
                (light if made[name].weight is None else heavy).append(name)
        return light, heavy

    def _join(self, made: dict[str, Link], base: bool) -> tuple[list[SixAxisJoint], dict[str, str | None]]:
        """Return the joints, and the link that carries each link: itself, another one that it is a part of, None for the world."""
        root = made[self.root]
        carrier: dict[str, str | None] = {self.root: self.root}
        if base:
            root.motion = "static"
            carrier[self.root] = self.root if root.pieces else None
        elif root.weight is None:
            # Frames below the robot: the first link with mass that is fixed to them carries them.
            light, heavy = self._root_group(made)
            if heavy:
                carrier[heavy[0]] = heavy[0]
                for name in light:
                    made[heavy[0]].take(made[name])
                    carrier[name] = heavy[0]
        joints: list[SixAxisJoint] = []
        for name in self.order:
            if name in carrier:
                continue
            joint, link = self.joints[self.joint_of[name]], made[name]
            parent = carrier[self._side(joint, "parent")]
            if joint.get("type") == "fixed":
                stands = parent is None or made[parent].motion == "static"
                if parent is not None and (stands or link.weight is None):
                    made[parent].take(link)
                    carrier[name] = parent
                    continue
                if stands:
                    link.motion = "static"
                    carrier[name] = name if link.pieces else None
                    continue
            carrier[name] = name
            joints += self._joint(joint, parent, link)
        return joints, carrier

    def _link(self, name: str, made: dict[str, Link]) -> Link:
        """Return a link in the world, all joints at 0; made: those above it."""
        entry, where = self.links[name], f"link {name!r}"
        position, orientation = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        if name in self.joint_of:
            joint = self.joints[self.joint_of[name]]
            above = made[self._side(joint, "parent")]
            way, turn = _origin(joint, f"joint {self.joint_of[name]!r}")
            position = above.position + rotate(above.orientation, way)
            orientation = multiply(above.orientation, turn)
        parts = Counter(part.tag for part in entry if part.tag not in LINK_PARTS)
        self.notes += [f"{where}: <{tag}> is not read" for tag in parts]
        drawn = entry.findall("collision")
        if not drawn and entry.findall("visual"):
            drawn = entry.findall("visual")
            self.notes.append(f"{where} has no collision: what is seen of it collides")
        pieces = [Piece(self._shape(part, where), *_origin(part, where), Material(), None) for part in drawn]
        weight, looks = self._weight(entry.find("inertial"), where), self._looks(entry, where)
        return Link(name, position, orientation, pieces, weight, looks=looks)

    def _looks(self, entry: Any, where: str) -> list[Look]:
        """Return what is seen of a link; what cannot be read is listed, and its colliders are seen."""
        looks = []
        for part in entry.findall("visual"):
            try:
                looks.append(Look(self._shape(part, where), *_origin(part, where), self._color(part, where)))
            except SceneError as error:
                self.notes.append(f"{where}: a <visual> is not read ({error.problem})")
                return []
        return looks

    def _color(self, part: Any, where: str) -> np.ndarray | None:
        """Return the colour of a visual element, None where it names none."""
        given = part.find("material")
        if given is None:
            return None
        color = given.find("color")
        if color is None:
            color = self._colors.get(given.get("name"))
        return None if color is None else np.clip(_numbers(color.get("rgba"), 4, "rgba", where)[:3], 0.0, 1.0)

    def _weight(self, entry: Any, where: str) -> Weight | None:
        """Return the mass properties of a link, None where it has no mass."""
        if entry is None or entry.find("mass") is None:
            return None
        mass = _number(entry.find("mass").get("value"), "mass", where)
        if mass < 0.0:
            raise SceneError(f"mass is {mass:g} kg", "give a mass > 0", where)
        if mass == 0.0:
            return None
        centre, turn = _origin(entry, where)
        given = entry.find("inertia")
        ixx, ixy, ixz, iyy, iyz, izz = (
            _number("0" if given is None else given.get(key, "0"), key, where) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        axes, inertia = to_matrix(turn), np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        return Weight(mass, centre, axes @ inertia @ axes.T)

    def _shape(self, part: Any, where: str) -> Shape:
        """Return the shape of a collision or visual element."""
        geometry = part.find("geometry")
        given = None if geometry is None else next(iter(geometry), None)
        if given is None:
            raise SceneError("it has a shape without geometry", "give box, cylinder, sphere, capsule or mesh", where)
        if given.tag == "box":
            return Shape.box(_numbers(given.get("size"), 3, "size", where))
        if given.tag == "sphere":
            return Shape.sphere(_number(given.get("radius"), "radius", where))
        if given.tag in ("cylinder", "capsule"):
            radius, length = (_number(given.get(key), key, where) for key in ("radius", "length"))
            return Shape.cylinder(radius, length) if given.tag == "cylinder" else Shape.capsule(radius, length)
        if given.tag != "mesh":
            raise SceneError(f"its geometry is <{given.tag}>", "give box, cylinder, sphere, capsule or mesh", where)
        scale = _numbers(given.get("scale", "1 1 1"), 3, "scale", where)
        path = robot_file(self.folder, given.get("filename", ""), self.allow_outside, where)
        key = (path, scale.tobytes())
        if key not in self._meshes:
            shape = Shape.from_file(path)
            assert shape.vertices is not None and shape.faces is not None
            mirrored = np.prod(scale) < 0.0
            turned = slice(None, None, -1 if mirrored else 1)
            scaled = Shape.mesh(shape.vertices * scale, shape.faces[:, turned])
            self._meshes[key] = scaled if shape.colors is None else replace(scaled, colors=shape.colors[:, turned])
        return self._meshes[key]

    def _joint(self, joint: Any, parent: str | None, link: Link) -> list[SixAxisJoint]:
        """Return the joint above a link, none for one that floats."""
        kind, name = joint.get("type"), joint.get("name")
        where = f"joint {name!r}"
        self.notes += [f"{where}: <{part.tag}> is not read" for part in joint if part.tag not in JOINT_PARTS]
        if kind == "floating":
            return []
        if kind == "fixed":
            return [fixed(parent, link.name, link.position, name)]
        if joint.find("mimic") is not None:
            self.notes.append(f"{where} does not mimic another: it is free")
        given = joint.find("axis")
        axis = _numbers("1 0 0" if given is None else given.get("xyz"), 3, "axis", where)
        if not np.linalg.norm(axis) > 1e-9:
            raise SceneError("its axis is (0, 0, 0)", "give a direction", where)
        axes = axis_frame(rotate(link.orientation, axis / np.linalg.norm(axis)))
        common = {"anchor": link.position, "axes": axes, "name": name}
        if kind == "planar":
            limits = [Limit("x", lower=0.0, upper=0.0), Limit(rotation="yz", lower=0.0, upper=0.0)]
            return [SixAxisJoint(parent, link.name, limits=limits, **common)]
        linear, dynamics = kind == "prismatic", joint.find("dynamics")
        damping, friction = (
            _number("0" if dynamics is None else dynamics.get(key, "0"), key, where) for key in ("damping", "friction")
        )
        limits = axis_limits(linear, *self._bounds(joint, kind, where))
        return [SixAxisJoint(parent, link.name, limits=limits, drives=axis_drives(linear, damping, friction), **common)]

    def _bounds(self, joint: Any, kind: str, where: str) -> tuple[float | None, float | None]:
        """Return the bounds of a joint, m or rad."""
        entry = joint.find("limit")
        if entry is not None and any(_number(entry.get(key, "0"), key, where) > 0.0 for key in ("effort", "velocity")):
            self.notes.append("limits of effort and velocity are not read: no motor acts")
        if kind == "continuous":
            return None, None
        if entry is None:
            self.notes.append(f"{where} is {kind} and has no <limit>: it has no bounds")
            return None, None
        lower, upper = (_number(entry.get(key, "0"), key, where) for key in ("lower", "upper"))
        if lower > upper:
            raise SceneError(f"lower = {lower:g} is above upper = {upper:g}", "exchange them", where)
        if not lower <= 0.0 <= upper:
            self.notes.append(f"{where} is not within its bounds at 0: it is moved there at the start")
        return lower, upper

    def _overlaps(self, links: list[Link], joints: list[SixAxisJoint]) -> list[tuple[str, str]]:
        """Return pairs of links that overlap at the start and are not joined: robots are drawn so, and they do not collide."""
        solid = [link for link in links if link.pieces]
        shapes = [compile_shape(joined(link.pieces), np.zeros(3), np.eye(3)) for link in solid]
        narrow, pairs = Narrowphase(shapes), []
        together = {frozenset((joint.a, joint.b)) for joint in joints}
        for j, b in enumerate(solid):
            for i, a in enumerate(solid[:j]):
                still = a.motion == b.motion == "static"
                if still or frozenset((a.name, b.name)) in together:
                    continue
                if narrow.overlap(i, (a.position, a.orientation), j, (b.position, b.orientation)):
                    pairs.append((a.name, b.name))
        self.notes += [f"links {a!r} and {b!r} overlap at the start: they do not collide" for a, b in pairs]
        return pairs


def _named(root: Any, tag: str) -> dict[str, Any]:
    """Return the elements of a kind by name."""
    found: dict[str, Any] = {}
    for entry in root.findall(tag):
        name = entry.get("name")
        if not name or name in found:
            raise SceneError(f"a {tag} is called {name!r}", "give each a name of its own")
        found[name] = entry
    if tag == "link" and not found:
        raise SceneError("it has no links", "give it one")
    return found


def _number(text: str | None, what: str, where: str) -> float:
    return float(_numbers(text, 1, what, where)[0])


def _numbers(text: str | None, count: int, what: str, where: str) -> np.ndarray:
    """Return numbers of an attribute (count,)."""
    try:
        numbers = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.shape != (count,) or not np.abs(numbers).max() <= LARGEST:
        raise SceneError(f"{what} is {str(text)[:60]!r}", f"give {count} finite {'numbers' if count > 1 else 'number'}", where)
    return numbers


def _origin(entry: Any, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,) m and quaternion (4,) wxyz of the <origin> of an element."""
    origin = entry.find("origin")
    if origin is None:
        return np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    x = _numbers(origin.get("xyz", "0 0 0"), 3, "xyz", where)
    roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"), 3, "rpy", where)
    turns = [quaternion_from_rotation_vector(angle * axis) for angle, axis in zip((roll, pitch, yaw), np.eye(3), strict=True)]
    return x, multiply(turns[2], multiply(turns[1], turns[0]))
