"""Shapes: what a body looks like to contacts, as plain data in the body's own frame.

Values are checked when the scene is compiled (`Shape.check`), so that the message can name the body; only what cannot
be turned into numbers, or read from a file, is refused at once.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.colors import bytes_of
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import load_mesh
from rigidimpulse.core.mesh_colors import colors_of_trimesh, joined_colors
from rigidimpulse.core.numeric import is_number, number_of, numbers_of
from rigidimpulse.core.portable import dot, length, matmul
from rigidimpulse.scene.solid import Solid, compute_solid
from rigidimpulse.scene.surface import Surface, clean_surface

if TYPE_CHECKING:
    from trimesh import Trimesh

_BOX_CORNERS = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
_BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


class Part(NamedTuple):
    """A shape placed in the frame of a compound: position (3,) m, rotation (3, 3) from the part's frame to it."""

    shape: Shape
    position: np.ndarray
    rotation: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class Shape:
    """An immutable shape. Make one with the constructors below; the fields each kind uses are those of its constructor.

    Lengths are in metres. Arrays are read-only. Shapes can be shared by any number of bodies. `whole` is the shape that convex parts stand
    for: it has the mass, and is drawn.
    """

    kind: str
    radius: float = 0.0
    height: float = 0.0
    size: np.ndarray | None = None
    normal: np.ndarray | None = None
    offset: float = 0.0
    vertices: np.ndarray | None = None
    faces: np.ndarray | None = None
    colors: np.ndarray | None = None
    parts: tuple[tuple[Shape, np.ndarray, np.ndarray], ...] = ()
    whole: Shape | None = None
    source: str = ""

    @staticmethod
    def half_space(normal: ArrayLike = (0.0, 0.0, 1.0), offset: float = 0.0) -> Shape:
        """Everything below a plane: solid where normal . x <= offset. It cannot be dynamic.

        Args:
            normal: (3,) points out of the solid; its length counts in the rule above.
            offset: m for a unit normal.

        """
        return Shape("half_space", normal=_array("normal", normal), offset=_number("offset", offset))

    @staticmethod
    def sphere(radius: float) -> Shape:
        """Return a sphere about the origin."""
        return Shape("sphere", radius=_number("radius", radius))

    @staticmethod
    def box(size: ArrayLike) -> Shape:
        """Return a box about the origin with full edge lengths `size` (3,), or a cube for one number."""
        edges = _array("size", size)
        return Shape("box", size=_array("size", np.full(3, edges)) if edges.ndim == 0 else edges)

    @staticmethod
    def capsule(radius: float, height: float) -> Shape:
        """Return a capsule about the origin along z; `height` is the distance between the centres of its caps.

        From tip to tip it is height + 2 radius long (as in glTF's KHR_implicit_shapes, and in trimesh).
        """
        return Shape("capsule", radius=_number("radius", radius), height=_number("height", height))

    @staticmethod
    def cylinder(radius: float, height: float) -> Shape:
        """Return a cylinder about the origin along z, `height` from end to end."""
        return Shape("cylinder", radius=_number("radius", radius), height=_number("height", height))

    @staticmethod
    def mesh(vertices: ArrayLike, faces: ArrayLike, colors: ArrayLike | None = None) -> Shape:
        """Return a triangle mesh, convex or not, of one or several pieces.

        Args:
            vertices: (v, 3) m.
            faces: (f, 3) indices, counter-clockwise seen from outside.
            colors: (f, 3) of each face, or (f, 3, 3) of each corner of each face: red, green, blue in [0, 1], as people see them (sRGB).
                They are only drawn. None: the mesh has no colours of its own.

        Vertices at the same place are joined when the mesh is used. A body whose mass is asked for needs a closed
        mesh; a static or kinematic one may be open.

        """
        index = _array("faces", faces)
        if not np.all(np.isfinite(index) & (np.floor(index) == index)):
            raise SceneError("faces are not whole numbers", "give vertex indices, an integer array (f, 3)", "mesh")
        faces_read_only = index.astype(np.int64)
        faces_read_only.setflags(write=False)
        return Shape(
            "mesh", vertices=_array("vertices", vertices), faces=faces_read_only,
            colors=None if colors is None else _corner_colors(colors, len(faces_read_only)),
        )  # fmt: skip

    @staticmethod
    def from_file(path: str | os.PathLike[str], scale: float = 1.0) -> Shape:
        """Return the mesh in a file of any format that trimesh reads (.obj, .stl, .ply, .glb, ...).

        All geometries of the file are taken together, each at its place; seams of texture or normals are joined. Colours of its
        vertices, faces and materials are drawn, and textures as coarse as the triangles are; `Body.visual` draws others.

        Args:
            path: the file.
            scale: metres per unit of the file, > 0.

        Raises:
            SceneError: no such file, not readable, no triangles in it, or a bad scale.

        """
        where = f"shape file {os.fspath(path)!r}"
        factor = _number("scale", scale)
        if not (np.isfinite(factor) and factor > 0.0):
            raise SceneError(f"scale is {scale}", "give metres per unit of the file, > 0", where)
        mesh = load_mesh(Path(path), where)
        shape = Shape.mesh(mesh.vertices * factor, mesh.faces, mesh.colors)
        return replace(shape, source=os.fspath(path))

    @staticmethod
    def from_trimesh(mesh: Trimesh) -> Shape:
        """Return the mesh of a `trimesh.Trimesh`, in metres, with its colours; a `trimesh.Scene` is taken as one mesh."""
        if hasattr(mesh, "to_mesh"):
            mesh = mesh.to_mesh()  # pyright: ignore[reportAttributeAccessIssue]
        if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
            raise SceneError(f"a {type(mesh).__name__} is no trimesh", "give a trimesh.Trimesh", "mesh")
        return Shape.mesh(mesh.vertices, mesh.faces, joined_colors([colors_of_trimesh(mesh)], [len(mesh.faces)]))

    @staticmethod
    def convex_hull(points_or_shape: ArrayLike | Shape) -> Shape:
        """Return the convex hull of points (p, 3) in metres, or of a shape.

        Spheres, boxes, capsules and cylinders are their own hull; a compound that has round parts has none here.

        Raises:
            SceneError: fewer than four points, points in a plane, or values that are not finite.

        """
        if isinstance(points_or_shape, Shape):
            shape = points_or_shape
            if shape.kind in ("sphere", "box", "capsule", "cylinder"):
                return shape
            shape.check()
            points = np.concatenate([part.position + matmul(_corners(part.shape), part.rotation.T)
                                     for part in shape.parts_flat()])  # fmt: skip
        else:
            points = _array("points", points_or_shape)
        return _hull(points)

    @staticmethod
    def compound(parts: Sequence[tuple[Shape, ArrayLike, ArrayLike]]) -> Shape:
        """Return several shapes that move as one.

        Args:
            parts: (shape, position (3,) m, orientation (w, x, y, z)) each; orientations are normalised. The masses
                of parts that overlap add up.

        """
        placed = []
        for index, entry in enumerate(parts):
            if not (isinstance(entry, tuple | list) and len(entry) == 3 and isinstance(entry[0], Shape)):
                raise SceneError(
                    f"part {index} is {type(entry).__name__}",
                    "give (shape, position, orientation), for example (Shape.sphere(1), (0, 0, 1), (1, 0, 0, 0))",
                    "compound",
                )
            placed.append((entry[0], _array("position", entry[1]), _array("orientation", entry[2])))
        return Shape("compound", parts=tuple(placed))

    def convex_parts(self, concavity: float = 0.05, most: int | None = None) -> Shape:
        """Return the shape as a compound of convex hulls that collides nearly like it, many times faster.

        Contacts of convex parts are found by the fast kernels of sub-stepped islands: use them with `accuracy="preview"`, and for crowds.
        Mass and inertia stay those of this shape, and it is what is drawn. Parts are found once for each mesh and kept in the user's
        cache, so that the next program has them at once. A shape that is convex is returned as it is.

        Args:
            concavity: how far hulls may stand out of the surface, over half of the longest side of the mesh, from 0.01 to 1. Less gives
                more parts and takes longer: halves of it cost about twice the parts.
            most: greatest number of parts of a mesh; None: as many as the concavity asks for.

        Raises:
            SceneError: the package coacd is not there (`pip install 'rigidimpulse[parts]'`), the mesh is open, or an argument is none.

        Source: Wei, Liu, Ling and Su, ACM Trans. Graph. 41(4), 2022.

        """
        from rigidimpulse.core.quaternion import from_matrix
        from rigidimpulse.scene.convex_parts import hulls_of

        self.check()
        parts: list[tuple[Shape, np.ndarray, np.ndarray]] = []
        kept = self.parts_flat()
        for part in kept:
            is_mesh = part.shape.kind == "mesh"
            hulls = hulls_of(part.shape.surface(), part.shape.label, _number("concavity", concavity), most) if is_mesh else []
            parts += [(_hull(part.position + matmul(corners, part.rotation.T)), np.zeros(3), np.eye(4)[0]) for corners in hulls]
            if not hulls:
                parts.append((part.shape, part.position, from_matrix(part.rotation)))
        is_convex = all(one is part.shape for (one, _, _), part in zip(parts, kept, strict=False))
        return self if is_convex else Shape("compound", parts=tuple(parts), whole=self)

    def __repr__(self) -> str:
        """Return the kind and its main figures."""
        if self.kind == "mesh" and self.vertices is not None and self.faces is not None:
            name = f", {self.source!r}" if self.source else ""
            return f"Shape.mesh({len(self.vertices)} vertices, {len(self.faces)} faces{name})"
        if self.kind == "compound":
            return f"Shape.compound({len(self.parts)} parts)"
        names = {"half_space": ("normal", "offset"), "sphere": ("radius",), "box": ("size",)}
        figures = [getattr(self, name) for name in names.get(self.kind, ("radius", "height"))]
        return f"Shape.{self.kind}({', '.join(str(f.tolist() if isinstance(f, np.ndarray) else f) for f in figures)})"

    @cached_property
    def key(self) -> bytes:
        """A digest of all data of the shape except its colours and the file it is from: the same for shapes that collide alike."""
        from hashlib import blake2b

        digest = blake2b(f"{self.kind} {self.radius!r} {self.height!r} {self.offset!r}".encode(), digest_size=16)
        arrays = [self.size, self.normal, self.vertices, self.faces]
        for shape, position, orientation in self.parts:
            digest.update(shape.key)
            arrays += [position, orientation]
        if self.whole is not None:
            digest.update(self.whole.key)
        for array in arrays:
            digest.update(b"none" if array is None else repr(array.shape).encode() + array.tobytes())
        return digest.digest()

    @cached_property
    def drawn_key(self) -> bytes:
        """The same for shapes that look alike as well, colours included."""
        from hashlib import blake2b

        digest = blake2b(self.key, digest_size=16)
        for part in self.parts_flat():
            digest.update(b"none" if part.shape.colors is None else part.shape.colors.tobytes())
        return digest.digest()

    @property
    def label(self) -> str:
        """What messages call the shape: its kind, and its file if it has one."""
        return f"mesh {self.source!r}" if self.source else self.kind.replace("_", " ")

    def check(self) -> None:
        """Raise a `SceneError` if the shape has no valid surface; open and inside-out meshes have one."""
        _ = self._is_valid

    @cached_property
    def _is_valid(self) -> bool:
        # Many bodies may have one shape of many parts.
        try:
            if self.kind == "compound":
                self._check_parts()
            elif self.kind == "mesh":
                self.surface()
            elif self.kind == "half_space":
                self.plane()
            else:
                self._check_lengths()
        except SceneError as error:
            raise error.within(self.label) from None
        return True

    def surface(self) -> Surface:
        """Return the clean triangle surface of a mesh or box."""
        return self._surface

    def solid(self) -> Solid:
        """Return volume, centroid and inertia of the shape filled with density 1.

        Raises:
            SceneError: it encloses no volume (see `rigidimpulse.scene.solid.compute_solid`).

        """
        return self._solid

    def plane(self) -> tuple[np.ndarray, float]:
        """Return unit normal (3,) and offset (m) of a half space."""
        assert self.normal is not None
        if self.normal.shape != (3,) or not np.all(np.isfinite(self.normal)) or not np.any(self.normal):
            raise SceneError(f"normal is {self.normal.tolist()}", "give three finite numbers, not all zero")
        if not np.isfinite(self.offset):
            raise SceneError(f"offset is {self.offset}", "give a finite distance in metres")
        size = float(length(self.normal))
        return self.normal / size, self.offset / size

    def parts_flat(self) -> list[Part]:
        """Return the single shapes of a compound, nested ones included; of any other shape the shape itself."""
        return list(self._parts_flat)

    def solids_flat(self) -> list[Part]:
        """Return the same with the shape that convex parts stand for in their place: what has the mass."""
        return self._flat(to_whole=True)

    @cached_property
    def _parts_flat(self) -> list[Part]:
        return self._flat(to_whole=False)

    def _flat(self, to_whole: bool) -> list[Part]:
        if to_whole and self.whole is not None:
            return self.whole._flat(to_whole)
        if self.kind != "compound":
            return [Part(self, np.zeros(3), np.eye(3))]
        flat = []
        for shape, position, orientation in self.parts:
            rotation = rotation_matrix(orientation)
            for part in shape._flat(to_whole):
                flat.append(Part(part.shape, position + dot(rotation, part.position), matmul(rotation, part.rotation)))
        return flat

    @cached_property
    def _surface(self) -> Surface:
        if self.kind == "box":
            assert self.size is not None
            return Surface(_BOX_CORNERS * self.size, _BOX_FACES, 0, 0)
        assert self.vertices is not None and self.faces is not None
        return clean_surface(self.vertices, self.faces)

    @cached_property
    def _solid(self) -> Solid:
        return compute_solid(self)

    def _check_lengths(self) -> None:
        """Check the lengths of a sphere, box, capsule or cylinder."""
        lengths: dict[str, Any] = {"radius": self.radius}
        if self.kind == "box":
            lengths = {"size": self.size}
        elif self.kind in ("capsule", "cylinder"):
            lengths["height"] = self.height
        for name, value in lengths.items():
            length = np.asarray(value)
            if length.shape != ((3,) if name == "size" else ()):
                raise SceneError(f"{name} is {length.tolist()}", "give three lengths in metres, or one for a cube")
            if not np.all(np.isfinite(length)) or np.any(length <= 0.0):
                raise SceneError(f"{name} is {length.tolist()} m", "lengths must be finite and > 0")

    def _check_parts(self) -> None:
        """Check the parts of a compound and their poses."""
        if not self.parts:
            raise SceneError("it has no parts", "give at least one (shape, position, orientation)")
        for index, (shape, position, orientation) in enumerate(self.parts):
            where = f"part {index}"
            if position.shape != (3,) or not np.all(np.isfinite(position)):
                raise SceneError(f"position is {position.tolist()}", "give three finite numbers, in metres", where)
            check_orientation(orientation, where)
            try:
                shape.check()
            except SceneError as error:
                raise error.within(where) from None


def check_orientation(quaternion: np.ndarray, where: str = "") -> None:
    """Raise a `SceneError` unless (w, x, y, z) can be normalised to a rotation."""
    if quaternion.shape != (4,) or not np.all(np.isfinite(quaternion)) or not np.any(quaternion):
        raise SceneError(
            f"orientation is {quaternion.tolist()}",
            "give a quaternion (w, x, y, z) of four finite numbers, not all zero; (1, 0, 0, 0) turns nothing. Of angles: "
            "scipy's Rotation.from_euler('xyz', angles).as_quat(scalar_first=True)",
            where,
        )


def normalized_quaternion(quaternion: ArrayLike) -> np.ndarray:
    """Return the unit quaternion (4,) along a non-zero one; one that is a unit quaternion up to rounding is only rescaled."""
    q = np.asarray(quaternion, dtype=np.float64)
    q = q / np.max(np.abs(q))  # keeps tiny and huge ones from under- or overflowing
    return q / np.sqrt(np.sum(q * q))


def rotation_matrix(quaternion: ArrayLike) -> np.ndarray:
    """Return the rotation (3, 3) of a non-zero quaternion (w, x, y, z); for compiling, kernels have their own."""
    w, x, y, z = normalized_quaternion(quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _hull(points: np.ndarray) -> Shape:
    """Return the convex hull of points as a mesh with outward faces."""
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise SceneError(f"points have the form {points.shape}", "give at least four points (p, 3)", "convex hull")
    if not np.all(np.isfinite(points)):
        raise SceneError("a point is not finite", "remove such points", "convex hull")
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        raise SceneError(
            "the points lie in a plane, a line or a point",
            "give points that enclose a volume, or give the sheet a thickness",
            "convex hull",
        ) from None
    faces = hull.simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    used, index = np.unique(faces, return_inverse=True)
    return Shape.mesh(points[used], index.reshape(-1, 3))


def _corners(shape: Shape) -> np.ndarray:
    """Return the vertices of a mesh or box, for its hull."""
    if shape.kind == "mesh" or shape.kind == "box":
        return shape.surface().vertices
    raise SceneError(
        f"a {shape.label} has no corners", "use it as it is, or give Shape.convex_hull points on it", "convex hull"
    )


def _number(name: str, value: object) -> float:
    """Return a value as a float, whatever it is; a `SceneError` if it is none."""
    if not is_number(value):
        raise SceneError(f"{name} is {value!r}", "give a number", "shape")
    return number_of(value)


def _corner_colors(colors: ArrayLike, num_faces: int) -> np.ndarray:
    """Return the colours of faces or of their corners as those of corners (f, 3, 3), uint8, read-only."""
    values = _array("colors", colors)
    if values.shape not in ((num_faces, 3), (num_faces, 3, 3)):
        raise SceneError(
            f"colors have the form {values.shape}", f"give (f, 3) or (f, 3, 3) with f = {num_faces}; of vertices: colors[faces]", "mesh"
        )
    if not np.all((values >= 0.0) & (values <= 1.0)):
        raise SceneError("colors are not all from 0 to 1", "divide whole numbers of 0..255 by 255", "mesh")
    corners = np.broadcast_to(bytes_of(values if values.ndim == 3 else values[:, None]), (num_faces, 3, 3)).copy()
    corners.setflags(write=False)
    return corners


def _array(name: str, value: ArrayLike) -> np.ndarray:
    """Return a read-only float copy of an array; a `SceneError` if it has none."""
    array = numbers_of(value)
    if array.ndim == 0 and not is_number(value):
        raise SceneError(f"{name} is {value!r}", "give numbers in a regular array", "shape")
    array.setflags(write=False)
    return array
