"""A scene from an MJCF file, which MuJoCo itself compiles: inertias, frames and angles are those of its model, at qpos0.

    body                 a body with the frame of MuJoCo's; without joints it is fixed to the one above
    geoms of the world   static bodies
    joints of a body     one, or ways along orthogonal axes and then one turn along or across them: one `SixAxisJoint`;
                         else a chain of bodies in between, a ten-thousandth as heavy
    geoms that collide   contype and conaffinity, excluded pairs, groups of bodies that are fixed to each other; meshes by their hull
    friction             the first coefficient, of two bodies the greater; the others with condim 4 and 6

Sources: MuJoCo documentation, XML reference and computation.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.io.inertia import nearest_inertia
from rigidimpulse.io.looks import Look
from rigidimpulse.io.named_files import named_file
from rigidimpulse.io.pieces import Piece, Weight, sphere_points
from rigidimpulse.io.robots.links import Link, axis_drives, axis_frame, axis_limits, carried, filters, fixed
from rigidimpulse.io.robots.xml import read_xml
from rigidimpulse.scene.joint import BallJoint
from rigidimpulse.scene.joint_six_axis import AXES, Limit, SixAxisJoint
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.origin import FileOrigin
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

FREE, BALL, SLIDE, HINGE = range(4)
PLANE, FIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)
BETWEEN = 1e-4
"""Mass and inertia of bodies between the joints of one body, as a share of its own."""
PARENTS_COLLIDE = 1 << 10
"""Bit of MuJoCo's disableflags: who hangs from whom collides."""
GREY, HIDDEN_GROUP = 0.5, 3
"""Colour that stands for none; groups of geoms from this one on are not shown."""
ALONG = 1e-9
"""Sine of an angle that is none."""
FOLDERS = ("meshdir", "texturedir", "assetdir", "dir")
"""Attributes that name folders, in which files may lie."""
COUNTED = {"nu": "actuators", "ntendon": "tendons", "nflex": "flexible bodies", "nkey": "keyframes", "npair": "contact pairs"}
FIGURES = (
    "body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "body_iquat", "geom_pos", "geom_quat", "geom_size", "jnt_axis",
    "jnt_pos",
)  # fmt: skip
"""Arrays of a compiled model that say where things are and how heavy."""


def load_mjcf(path: Path, gravity: ArrayLike | None, allow_outside: bool) -> Scene:
    """Read an MJCF file; see `rigidimpulse.load_scene`."""
    where = repr(path.name)
    root = read_xml(path)
    if root.tag not in ("mujoco", "mujocoinclude"):
        raise SceneError(f"its root is <{root.tag}>", "give an MJCF file, with <mujoco>", where)
    if not allow_outside:
        _check_names(root, path.parent, where)
    try:
        import mujoco
    except ImportError as error:
        raise SceneError(f"MJCF files need the package mujoco ({error})", "pip install 'rigidimpulse[robot]'", where) from None
    notes: list[str] = []
    with warnings_in(notes, mujoco):
        return _read(path, gravity, notes, mujoco)


@contextmanager
def warnings_in(notes: list[str], mujoco: Any) -> Iterator[None]:
    """Take the warnings of MuJoCo as notes: it writes them to a file in the current folder else. mujoco: the module."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: notes.append(f"MuJoCo warns: {text}"))
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _read(path: Path, gravity: ArrayLike | None, notes: list[str], mujoco: Any) -> Scene:
    """The scene of a file that may be read."""
    where = repr(path.name)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        model = _with_possible_inertias(mujoco, path, notes)
        if model is None:
            raise SceneError(f"MuJoCo does not compile it: {error}", "correct it at that line", where) from None
    for name in FIGURES:
        if not np.all(np.isfinite(getattr(model, name))):
            raise SceneError(f"there are numbers in it that are not finite ({name} of the compiled model)", "correct them", where)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    try:
        return _Reader(model, data, notes).scene(gravity)
    except SceneError as error:
        raise error.within(where) from None


def _with_possible_inertias(mujoco: Any, path: Path, notes: list[str]) -> Any:
    """Return the model of a file whose given inertias are brought to possible ones, None where that is not what it lacks."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        for body in spec.bodies:
            if not body.explicitinertial:
                continue
            xx, yy, zz, xy, xz, yz = body.fullinertia
            full = bool(np.isfinite(xx))
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) if full else np.diag(body.inertia)
            found = nearest_inertia(body.name, tensor, notes)
            if found is None or found is tensor:
                continue
            if full:
                body.fullinertia = [*np.diag(found), found[0, 1], found[0, 2], found[1, 2]]
            else:
                body.inertia = np.diag(found)
        return spec.compile() if notes else None
    except ValueError:
        return None


def _check_names(root: Any, folder: Path, where: str) -> None:
    """Check the files and folders that a file and those that it includes name; raises a `SceneError` for those outside its folder."""
    waiting, included = [(root, where)], set()
    named: list[tuple[str, str]] = []
    folders = {""}
    while waiting:
        part, place = waiting.pop()
        for entry in part.iter():
            folders.update(name for key in FOLDERS if (name := entry.get(key)))
            named += [(name, f"{place}, <{entry.tag}>") for key in (*FOLDERS, "file") if (name := entry.get(key))]
            if entry.tag == "include" and entry.get("file"):
                name, by = named[-1]
                found = named_file(folder, name, False, by)
                if found not in included and found.is_file():
                    included.add(found)
                    waiting.append((read_xml(found), f"{where}, {name!r}"))
    for name, by in named:
        for below in folders:
            named_file(folder, name, False, by, folder / below / name)


class _Joint(NamedTuple):
    """A joint of one body in the world: kind, name, anchor (3,) m, axis (3,), and its index."""

    kind: int
    name: str
    anchor: np.ndarray
    axis: np.ndarray
    index: int


class _Reader:
    """A compiled model on its way to a scene."""

    def __init__(self, model: Any, data: Any, notes: list[str]) -> None:
        """notes: lines of the report so far."""
        self.model, self.data, self.notes = model, data, notes
        self._used: set[str] = set()
        self._meshes: dict[int, Shape] = {}
        self._drawn: dict[int, Shape] = {}
        self._chained: list[tuple[str, str]] = []
        self._only_seen: list[str] = []
        self.names = [self._name("body", k, model.body(k).name) if k else "world" for k in range(model.nbody)]
        for key, what in COUNTED.items():
            if getattr(model, key, 0):
                self.notes.append(f"{getattr(model, key)} {what} are not read")
        if np.any(model.dof_armature):
            self.notes.append("armature (rotor inertia of joints) is not read")
        if model.opt.density or model.opt.viscosity:
            self.notes.append("the medium (density, viscosity) is not read")

    def _name(self, kind: str, index: int, given: str) -> str:
        name = given or f"{kind}{index}"
        while name in self._used:
            name = f"{name} ({kind} {index})"
        self._used.add(name)
        return name

    def scene(self, gravity: ArrayLike | None) -> Scene:
        """Make the scene."""
        model = self.model
        links = {k: self._link(k) for k in range(1, model.nbody)}
        carrier: dict[int, str | None] = {0: None}
        joints: list[Any] = []
        between: list[Link] = []
        for k, link in links.items():
            above, own = int(model.body_parentid[k]), list(self._joints(k))
            parent = carrier[above]
            carrier[k] = link.name
            if not own:
                if parent is None or links[above].motion != "dynamic" or model.body_mocapid[k] >= 0:
                    link.motion = "kinematic" if model.body_mocapid[k] >= 0 else "static"
                    carrier[k] = link.name if link.pieces else None
                elif link.weight is None:
                    carrier[k] = parent
                    next(other for other in links.values() if other.name == parent).take(link)
                else:
                    joints.append(fixed(parent, link.name, link.position, f"weld of {link.name}"))
            elif own[0].kind == FREE:
                self._tell_unread(own[0], "free")
            else:
                joints += self._chain(parent, link, own, between)
        kept = [link for k, link in links.items() if carrier[k] == link.name]
        made = [*self._grounds(), *kept, *between]
        self.notes += carried({link.name: carrier[k] for k, link in links.items()})
        if self._only_seen:
            self.notes.append(f"geoms that collide with nothing are not read: {', '.join(dict.fromkeys(self._only_seen))}")
        apart = filters([link.name for link in made], self._apart(made))
        scene = Scene(np.array(model.opt.gravity) if gravity is None else gravity)
        for link in made:
            scene.add(link.body(apart[link.name], self.notes))
        for joint in (*joints, *self._equalities(carrier, {link.name for link in kept if link.motion == "dynamic"})):
            scene.add(joint)
        scene.origin = FileOrigin(tuple(dict.fromkeys(self.notes)))
        return scene

    def _link(self, k: int) -> Link:
        """Return the link of a body."""
        model, data = self.model, self.data
        weight = None
        if model.body_mass[k] > 0.0:
            axes = to_matrix(np.array(model.body_iquat[k]))
            weight = Weight(float(model.body_mass[k]), np.array(model.body_ipos[k]), axes @ np.diag(model.body_inertia[k]) @ axes.T)
        geoms = range(int(model.body_geomadr[k]), int(model.body_geomadr[k] + model.body_geomnum[k]))
        pieces = [piece for g in geoms if (piece := self._piece(g, np.array(model.geom_pos[g]), np.array(model.geom_quat[g]))) is not None]
        looks = [look for g in geoms if (look := self._look(g, np.array(model.geom_pos[g]), np.array(model.geom_quat[g]))) is not None]
        bits = {self._bits(g) for g in geoms if self._bits(g) != (0, 0)}
        if len(bits) > 1:
            self.notes.append(f"body {self.names[k]!r} has geoms with several contype and conaffinity: it collides where one of them does")
        return Link(
            self.names[k], np.array(data.xpos[k]), np.array(data.xquat[k]), pieces, weight,
            gravity_factor=1.0 - float(model.body_gravcomp[k]), looks=looks,
        )  # fmt: skip

    def _bits(self, geom: int) -> tuple[int, int]:
        return int(self.model.geom_contype[geom]), int(self.model.geom_conaffinity[geom])

    def _grounds(self) -> list[Link]:
        """Return a static link for each geom of the world."""
        model, made = self.model, []
        self.ground_bits: dict[str, tuple[int, int]] = {}
        for g in range(int(model.body_geomadr[0]), int(model.body_geomadr[0] + model.body_geomnum[0])):
            piece = self._piece(g, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
            if piece is not None:
                name = self._name("geom", g, model.geom(g).name)
                look = self._look(g, piece.position, piece.orientation)
                looks = [] if look is None else [look]
                made.append(Link(name, np.array(model.geom_pos[g]), np.array(model.geom_quat[g]), [piece], motion="static", looks=looks))
                self.ground_bits[name] = self._bits(g)
        return made

    def _piece(self, g: int, position: np.ndarray, orientation: np.ndarray) -> Piece | None:
        """Return a geom that collides as a piece, None for one that does not, or is not read."""
        if self._bits(g) == (0, 0):
            if self.model.geom_bodyid[g] and self._is_seen(g):
                return None
            self._only_seen.append(repr(self.model.geom(g).name or f"geom{g}"))
            return None
        shape = self._shape(g)
        if shape is None:
            self.notes.append(f"geom {self.model.geom(g).name or g}: height fields and planes of bodies that move are not read")
            return None
        slide, spin, roll = (float(x) for x in self.model.geom_friction[g])
        condim = int(self.model.geom_condim[g])
        if condim == 1:
            slide = 0.0
        material = Material(
            restitution=0.0, static_friction=slide, dynamic_friction=slide, friction_combine="maximum",
            spinning_friction=spin if condim >= 4 else None, rolling_friction=roll if condim >= 6 else None,
        )  # fmt: skip
        return Piece(shape, position, orientation, material, None)

    def _is_seen(self, g: int) -> bool:
        """Whether MuJoCo's viewer shows a geom, if nobody changes that."""
        return int(self.model.geom_group[g]) < HIDDEN_GROUP and float(self.model.geom_rgba[g][3]) > 0.0

    def _look(self, g: int, position: np.ndarray, orientation: np.ndarray) -> Look | None:
        """Return what is seen of a geom, None for one that is not seen, or not read."""
        model = self.model
        shape = self._drawn_mesh(int(model.geom_dataid[g])) if int(model.geom_type[g]) == MESH else self._shape(g)
        if shape is None or not self._is_seen(g):
            return None
        color, material = np.array(model.geom_rgba[g][:3], float), int(model.geom_matid[g])
        if np.all(color == GREY):
            color = np.array(model.mat_rgba[material][:3], float) if material >= 0 else None
        return Look(shape, position, orientation, None if color is None else np.clip(color, 0.0, 1.0))

    def _drawn_mesh(self, mesh: int) -> Shape:
        """Return the triangles of a mesh, of which only the hull collides."""
        if mesh not in self._drawn:
            model = self.model
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            start, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            vertices = np.array(model.mesh_vert[first : first + count], float)
            self._drawn[mesh] = Shape.mesh(vertices, np.array(model.mesh_face[start : start + number]))
        return self._drawn[mesh]

    def _shape(self, g: int) -> Shape | None:
        """Return the shape of a geom, None for one that is not read."""
        model, kind = self.model, int(self.model.geom_type[g])
        size = np.array(model.geom_size[g])
        if kind == PLANE:
            return Shape.half_space() if int(model.body_weldid[model.geom_bodyid[g]]) == 0 else None
        if kind == SPHERE:
            return Shape.sphere(size[0])
        if kind in (CAPSULE, CYLINDER):
            return (Shape.capsule if kind == CAPSULE else Shape.cylinder)(size[0], 2.0 * size[1])
        if kind == ELLIPSOID:
            self.notes.append(f"geom {model.geom(g).name or g}: an ellipsoid is taken as a convex hull of 162 points")
            return Shape.convex_hull(sphere_points() * size)
        if kind == BOX:
            return Shape.box(2.0 * size)
        if kind != MESH:
            return None
        mesh = int(model.geom_dataid[g])
        if mesh not in self._meshes:
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            self._meshes[mesh] = Shape.convex_hull(np.array(model.mesh_vert[first : first + count], float))
        return self._meshes[mesh]

    def _joints(self, k: int) -> Iterator[_Joint]:
        """Yield the joints of a body, in the world at the start."""
        model, turn = self.model, to_matrix(np.array(self.data.xquat[k]))
        for j in range(int(model.body_jntadr[k]), int(model.body_jntadr[k] + model.body_jntnum[k])):
            anchor = np.array(self.data.xpos[k]) + turn @ np.array(model.jnt_pos[j])
            yield _Joint(int(model.jnt_type[j]), model.jnt(j).name or f"joint{j}", anchor, turn @ np.array(model.jnt_axis[j]), j)

    def _chain(self, parent: str | None, link: Link, own: list[_Joint], between: list[Link]) -> list[SixAxisJoint]:
        """Return the joints of a body, and add the bodies between them."""
        made, above = [], parent
        while own:
            count = next(n for n in range(len(own), 0, -1) if n == 1 or _is_one(own[:n]))
            group, own = own[:count], own[count:]
            below = link.name
            if own:
                below = self._name("between", len(between), f"{link.name} below {group[-1].name}")
                between.append(_light(link, below))
                self.notes.append(f"body {link.name!r} has several joints: {below!r} is in between, with {BETWEEN:g} of its mass")
            made.append(self._joint(parent, below, group))
            parent = below
        if len(made) > 1 and above is not None:
            self._chained.append((above, link.name))
        return made

    def _joint(self, parent: str | None, below: str, group: list[_Joint]) -> SixAxisJoint:
        """Return one joint, or several that are one."""
        last, names = group[-1], "+".join(joint.name for joint in group)
        if last.kind == BALL:
            limits = [Limit("xyz", lower=0.0, upper=0.0)] if len(group) == 1 else []
            upper = self._bounds(last)[1]
            limits += [] if upper is None else [Limit(rotation="xyz", upper=upper)]
            # Its damping acts against the relative angular velocity, for which joints have no row: drives about three axes damp the
            # rates of twists, which differ from it where the joint is turned far.
            self._tell_unread(last, "ball")
            return SixAxisJoint(parent, below, anchor=last.anchor, axes=axis_frame(last.axis), limits=limits, name=names)
        if len(group) == 1:
            damping, friction, stiffness, rest = self._figures(last)
            linear = last.kind == SLIDE
            return SixAxisJoint(
                parent, below, anchor=last.anchor, axes=axis_frame(last.axis), limits=axis_limits(linear, *self._bounds(last)),
                drives=axis_drives(linear, damping, friction, stiffness, rest), name=names,
            )  # fmt: skip
        return self._several(parent, below, group, names)

    def _several(self, parent: str | None, below: str, group: list[_Joint], name: str) -> SixAxisJoint:
        """Return ways along orthogonal axes, and perhaps a turn about one of them, as one joint."""
        frame = [joint.axis for joint in group if joint.kind == SLIDE]
        if len(frame) == 1 and _parallel(frame[0], group[-1].axis):
            axes = axis_frame(frame[0])
        else:
            frame += [group[-1].axis] if len(frame) == 1 else []
            axes = np.array(frame if len(frame) == 3 else [*frame, np.cross(frame[0], frame[1])])
        if np.linalg.det(axes) < 0.0:
            axes[2] = -axes[2]
        limits, drives, free = [], [], {True: "", False: ""}
        for joint in group:
            linear = joint.kind == SLIDE
            k = int(np.argmax(np.abs(axes @ joint.axis)))
            sign = 1.0 if axes[k] @ joint.axis > 0.0 else -1.0
            free[linear] += AXES[k]
            lower, upper = self._bounds(joint)
            if lower is not None and upper is not None:
                low, high = sorted((sign * lower, sign * upper))
                limits.append(Limit(AXES[k] if linear else "", "" if linear else AXES[k], lower=low, upper=high))
            damping, friction, stiffness, rest = self._figures(joint)
            drives += axis_drives(linear, damping, friction, stiffness, sign * rest, AXES[k])
        for linear, letters in free.items():
            held = "".join(axis for axis in AXES if axis not in letters)
            if held:
                limits.append(Limit(held if linear else "", "" if linear else held, lower=0.0, upper=0.0))
        return SixAxisJoint(parent, below, anchor=group[-1].anchor, axes=axes, limits=limits, drives=drives, name=name)

    def _bounds(self, joint: _Joint) -> tuple[float | None, float | None]:
        """Return the bounds of a joint against where it is at the start, m or rad."""
        model, j = self.model, joint.index
        if not model.jnt_limited[j]:
            return None, None
        start = 0.0 if joint.kind == BALL else float(model.qpos0[model.jnt_qposadr[j]])
        lower, upper = (float(x) - start for x in model.jnt_range[j])
        return lower, upper

    def _figures(self, joint: _Joint) -> tuple[float, float, float, float]:
        """Return damping, dry friction, stiffness of a joint and where its spring is at rest, against the start."""
        model, j = self.model, joint.index
        dof, at = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
        rest = float(model.qpos_spring[at] - model.qpos0[at])
        return float(model.dof_damping[dof]), float(model.dof_frictionloss[dof]), float(model.jnt_stiffness[j]), rest

    def _tell_unread(self, joint: _Joint, kind: str) -> None:
        """Note what a joint says that no joint of a scene can do; kind: what the line calls it."""
        model, j = self.model, joint.index
        dof = int(model.jnt_dofadr[j])
        figures = {"damping": model.dof_damping[dof], "stiffness": model.jnt_stiffness[j], "frictionloss": model.dof_frictionloss[dof]}
        unread = ", ".join(f"{name} = {value:g}" for name, value in figures.items() if value)
        if unread:
            self.notes.append(f"joint {joint.name!r}: {unread} of a {kind} joint is not read: it moves without")

    def _apart(self, links: list[Link]) -> list[tuple[str, str]]:
        """Return pairs of links that do not collide: by contype and conaffinity, excluded pairs, and what is fixed to each other."""
        model, bits = self.model, dict(self.ground_bits)
        for k in range(1, model.nbody):
            geoms = range(int(model.body_geomadr[k]), int(model.body_geomadr[k] + model.body_geomnum[k]))
            pairs = [self._bits(g) for g in geoms]
            types, affinities = np.bitwise_or.reduce(np.array(pairs, int).reshape(-1, 2), axis=0).tolist()
            bits[self.names[k]] = types, affinities
        named = [link.name for link in links if link.pieces]
        apart = [
            (a, b) for j, b in enumerate(named) for a in named[:j] if not (bits[a][0] & bits[b][1] or bits[b][0] & bits[a][1])
        ]  # fmt: skip
        apart += [*self._chained, *self._in_one_group()]
        for signature in model.exclude_signature.tolist():
            apart.append((self.names[signature >> 16], self.names[signature & 0xFFFF]))
        known = set(named)
        return [(a, b) for a, b in apart if a in known and b in known]

    def _in_one_group(self) -> list[tuple[str, str]]:
        """Return pairs of bodies that are fixed to each other, or the one to a body that the other one's group hangs from by a joint.

        MuJoCo's contacts leave these out (Computation, Collision detection), so that robots may be drawn with parts that overlap. What
        hangs from the world does collide with all that is fixed to the world.
        """
        model, pairs = self.model, []
        group = model.body_weldid.tolist()
        above = [group[parent] for parent in model.body_parentid[group].tolist()]
        by_parent = not model.opt.disableflags & PARENTS_COLLIDE
        for b in range(1, model.nbody):
            for a in range(1, b):
                hangs = by_parent and group[a] != 0 != group[b] and (group[a] == above[b] or group[b] == above[a])
                if hangs or group[a] == group[b]:
                    pairs.append((self.names[a], self.names[b]))
        return pairs

    def _equalities(self, carrier: dict[int, str | None], moving: set[str]) -> Iterator[Any]:
        """Yield joints for the equality constraints connect and weld of bodies; list the others. moving: names of bodies that do."""
        model = self.model
        for e in range(model.neq):
            kind, first, second = int(model.eq_type[e]), int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
            name = model.eq(e).name or f"equality{e}"
            if not model.eq_active0[e] or kind > 1 or int(model.eq_objtype[e]) != 1:
                self.notes.append(f"equality constraint {name!r} is not read: of those only active connect and weld of bodies are")
                continue
            a, b = carrier[first], carrier[second]
            if a == b or not moving & {a, b}:
                self.notes.append(f"equality constraint {name!r} is not read: its bodies do not move against each other")
                continue
            anchor = np.array(self.data.xpos[first]) + to_matrix(np.array(self.data.xquat[first])) @ np.array(model.eq_data[e][:3])
            yield BallJoint(a, b, anchor, name=name) if kind == 0 else self._weld(e, (first, second), carrier, name)

    def _weld(self, e: int, sides: tuple[int, int], carrier: dict[int, str | None], name: str) -> SixAxisJoint:
        """Return the joint of a weld, which holds body 2 in body 1 as `relpose` says, else as they are at the start; sides: the two.

        Body 2 turned by Q and displaced by d in body 1: MuJoCo keeps Q, and the place d + Q s of the weld's anchor s in body 2.
        """
        figures = np.array(self.model.eq_data[e])
        turn = to_matrix(figures[6:10])
        way = figures[3:6] - turn @ figures[:3]
        first, second = sides
        if carrier[second] is None:
            # A joint has the world as its first body: that of body 1 in body 2 is the inverse pose.
            first, second, turn = second, first, turn.T
            way = -turn @ way
        a, b = carrier[first], carrier[second]
        assert b is not None
        if figures[10] == 0.0:
            self.notes.append(f"equality constraint {name!r}: torquescale = 0 is not read: it holds the rotation too")
        frame, own = to_matrix(np.array(self.data.xquat[first])), to_matrix(np.array(self.data.xquat[second]))
        position = np.array(self.data.xpos[second])
        axes, anchor = frame @ turn, np.array(self.data.xpos[first]) + frame @ way
        joint = fixed(a, b, position, name)
        if np.allclose(axes, own, 0.0, ALONG) and np.allclose(anchor, position, ALONG, ALONG):
            return joint
        self.notes.append(f"equality constraint {name!r}: relpose is not as the bodies are at qpos0: they are moved there at the start")
        return replace(joint, anchor=anchor, axes=axes.T, anchor_b=position, axes_b=own.T)


def _parallel(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two unit vectors, which are along or across each other, are along each other."""
    return abs(float(a @ b)) > 0.5


def _is_one(group: list[_Joint]) -> bool:
    """Whether joints are one: ways along orthogonal axes, and then at most a turn about one of these or across two of them."""
    slides = [joint.axis for joint in group if joint.kind == SLIDE]
    last = group[-1]
    if not slides or any(joint.kind != SLIDE for joint in group[:-1]) or last.kind == BALL:
        return False
    axes = [*slides, last.axis] if last.kind == HINGE else slides
    products = np.abs(np.array(slides) @ np.array(axes).T)
    square = products[:, : len(slides)] - np.eye(len(slides))
    return len(slides) <= 3 and np.abs(square).max() < ALONG and np.abs(products * (1.0 - products)).max() < ALONG


def _light(link: Link, name: str) -> Link:
    """Return a link between two joints of a body."""
    weight = link.weight or Weight(1e-3, np.zeros(3), 1e-6 * np.eye(3))
    even = BETWEEN * np.trace(weight.inertia) / 3.0 * np.eye(3)
    return Link(name, link.position, link.orientation, weight=Weight(BETWEEN * weight.mass, weight.center_of_mass, even), is_between=True)
