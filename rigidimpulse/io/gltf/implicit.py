"""Shapes of colliders: implicit shapes and meshes of nodes, with the scale K (3, 3) of the node, as shapes of the engine.

    sphere              K = s 1: radius |s| r; any other: the hull of 162 points of the ellipsoid
    box                 K diagonal: sizes |k_i| s_i; with shear: the hull of its corners
    capsule             K = s 1 and equal radii; any other, and unequal radii: the hull of two such spheres
    cylinder            K = diag(s, h, s) and equal radii; any other: the hull of two rims of 48 points, or of one and a tip
    plane               half space; with sizes: two triangles, which stop bodies from both sides
    mesh                its triangles, K applied exactly, turned inside out where K mirrors; or their hull

A negative scale counts as its magnitude, except for meshes. Hulls have their points on the surface and lie inside it: by
1.8 % of the radius for spheres, 0.2 % for rims. glTF's capsules and cylinders stand along Y, those of `Shape` along z.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import multiply
from rigidimpulse.io.gltf.container import GltfFile
from rigidimpulse.io.gltf.geometry import Meshes, stays_finite
from rigidimpulse.io.gltf.schema import Geometry, ImplicitShape, Tapered
from rigidimpulse.io.pieces import EQUAL, rim_points, sphere_points
from rigidimpulse.scene.shape import Shape

Y_FROM_Z = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
"""Quaternion wxyz that takes z to Y."""
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])

Placed = tuple[Shape, np.ndarray]
"""A shape and how it is turned in the frame of its node, wxyz."""


class Shapes:
    """Shapes of the colliders of a file; those that are equal are one. notes: what is not as the file says."""

    def __init__(self, file: GltfFile, meshes: Meshes) -> None:
        """Nothing is made before it is asked for."""
        self.file, self.meshes = file, meshes
        self.notes: list[str] = []
        self._known: dict[tuple, Placed] = {}

    def of(self, geometry: Geometry, scale: np.ndarray, owner: str) -> Placed:
        """Return the shape of a geometry under a scale K (3, 3).

        Raises:
            SceneError: there is none, or it has no extent; `owner` is what the message names.

        """
        if (geometry.shape is None) == (geometry.node is None):
            raise self.file.error("its geometry names not one of shape and node", "give one", owner)
        source = ("shape", geometry.shape) if geometry.node is None else self._mesh_key(geometry.node)
        key = (source, geometry.convex_hull, scale.tobytes())
        if key not in self._known:
            try:
                placed = self._made(geometry, scale, owner)
                placed[0].check()
            except SceneError as error:
                raise error.within(f"{self.file.path.name!r}, {owner}") if not error.where.startswith("'") else error from None
            self._known[key] = placed
        return self._known[key]

    def _mesh_key(self, node: int) -> tuple:
        """What tells meshes of nodes apart."""
        entry = self.file.entry(self.file.document.nodes, node, "node")
        plain = entry.skin is None and not entry.weights
        return ("mesh", entry.mesh) if plain else ("node", node)

    def _made(self, geometry: Geometry, scale: np.ndarray, owner: str) -> Placed:
        if geometry.node is not None:
            vertices, faces = self.meshes.of_node(geometry.node)
            vertices = stays_finite(self.file, vertices @ scale.T, owner)
            if geometry.convex_hull:
                return Shape.convex_hull(vertices), NO_TURN
            return Shape.mesh(vertices, faces[:, ::-1] if np.linalg.det(scale) < 0.0 else faces), NO_TURN
        assert geometry.shape is not None
        shape = self.file.entry(self.file.document.extensions.implicit.shapes, geometry.shape, "implicit shape")
        sheared = np.abs(scale - np.diag(np.diag(scale))).max() > EQUAL * np.abs(scale).max()
        squared = scale.T @ scale
        # A ball that is turned or mirrored is the same ball.
        even = shape.type == "sphere" and np.abs(squared - squared[0, 0] * np.eye(3)).max() <= EQUAL * squared[0, 0]
        sheared = sheared and not even
        matrix = scale if sheared else np.diag(np.sqrt(np.diag(squared)) if even else np.abs(np.diag(scale)))
        made = self._exact(shape, np.diag(matrix)) if not sheared else None
        if made is None:
            made = Shape.convex_hull(stays_finite(self.file, self._points(shape, owner) @ matrix.T, owner)), NO_TURN
            self.notes.append(f"{owner}: {_what(shape)} is taken as a convex hull")
        return made

    def _exact(self, shape: ImplicitShape, scale: np.ndarray) -> Placed | None:
        """The shape where the engine has it, None where it has not."""
        even, round_y = np.ptp(scale) <= EQUAL * scale.max(), abs(scale[0] - scale[2]) <= EQUAL * scale.max()
        along = scale[1]
        if shape.type == "box":
            return Shape.box(np.array(shape.box.size) * scale), NO_TURN
        if shape.type == "sphere" and even:
            return Shape.sphere(shape.sphere.radius * along), NO_TURN
        if shape.type == "capsule" and even and _is_straight(shape.capsule):
            return Shape.capsule(shape.capsule.radius_top * along, shape.capsule.height * along), Y_FROM_Z
        if shape.type == "cylinder" and round_y and _is_straight(shape.cylinder):
            return Shape.cylinder(shape.cylinder.radius_top * scale[0], shape.cylinder.height * along), Y_FROM_Z
        if shape.type == "plane":
            return self._plane(shape, scale)
        return None

    def _plane(self, shape: ImplicitShape, scale: np.ndarray) -> Placed:
        plane = shape.plane
        if plane.size_x is None and plane.size_z is None:
            if plane.double_sided:
                self.notes.append("an endless plane has two sides: what is below it is solid")
            return Shape.half_space((0.0, 1.0, 0.0)), NO_TURN
        if plane.size_x is None or plane.size_z is None:
            raise SceneError("a plane is endless along one axis only", "give it both sizes, or none")
        x, z = 0.5 * plane.size_x * scale[0], 0.5 * plane.size_z * scale[2]
        corners = np.array([[-x, 0.0, -z], [-x, 0.0, z], [x, 0.0, z], [x, 0.0, -z]])
        return Shape.mesh(corners, [[0, 1, 2], [0, 2, 3]]), NO_TURN

    def _points(self, shape: ImplicitShape, owner: str) -> np.ndarray:
        """Points (p, 3) whose hull stands for a shape."""
        if shape.type == "box":
            return np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * shape.box.size
        if shape.type == "sphere":
            return shape.sphere.radius * sphere_points()
        if shape.type in ("capsule", "cylinder"):
            figures = shape.capsule if shape.type == "capsule" else shape.cylinder
            ends = [(figures.radius_bottom, -0.5 * figures.height), (figures.radius_top, 0.5 * figures.height)]
            points = sphere_points() if shape.type == "capsule" else rim_points()
            return np.concatenate([(radius * points if radius > 0.0 else np.zeros((1, 3))) + [0.0, y, 0.0] for radius, y in ends])
        raise self.file.error(f"its shape is {shape.type[:40]!r}", "use sphere, box, capsule, cylinder, plane or a mesh", owner)


def _is_straight(figures: Tapered) -> bool:
    return abs(figures.radius_top - figures.radius_bottom) <= EQUAL * max(figures.radius_top, figures.radius_bottom)


def _what(shape: ImplicitShape) -> str:
    figures = {"capsule": shape.capsule, "cylinder": shape.cylinder}.get(shape.type)
    if figures is not None and not _is_straight(figures):
        return f"a {shape.type} with radii {figures.radius_bottom:g} and {figures.radius_top:g} m"
    return f"a {shape.type} of uneven scale"


def placed_in_body(placed: Placed, position: np.ndarray, rotation: np.ndarray) -> tuple[Shape, np.ndarray, np.ndarray]:
    """Return shape, position and orientation of a shape whose node stands there in the frame of its body."""
    shape, turn = placed
    orientation = multiply(rotation, turn)
    near = np.round(orientation)
    exact = np.abs(orientation - near).max() <= 1e-9 and np.count_nonzero(near) == 1
    return shape, position, np.abs(near) if exact and near[0] else (near if exact else orientation)
