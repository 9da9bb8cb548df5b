"""Flexible bodies as people write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.portable import matmul
from rigidimpulse.core.triangles import unique_edges
from rigidimpulse.dynamics.soft_body.mass_spring import SpringMesh, sheet
from rigidimpulse.scene.body import DEFAULT_MATERIAL, number, vector
from rigidimpulse.scene.effect import SceneEffect
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.shape import Shape, check_orientation, rotation_matrix
from rigidimpulse.scene.surface import check_triangles

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force import ForceTable
    from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class FlexibleBody(SceneEffect):
    """A body of point masses, springs and dampers made from a triangle mesh, open (cloth) or closed (jelly).

    It is at rest in the shape in which it is given. Values are checked when the scene is compiled; errors name the body.

    Attributes:
        name: unique in its scene.
        mesh: (v, 3) m vertices, a box or mesh `Shape`, or a `trimesh.Trimesh`.
        faces: (f, 3), where `mesh` is vertices; counter-clockwise seen from outside if it is closed.
        stiffness: E_s, N/m: force per width and strain of the sheet (Young's modulus times thickness), whatever the mesh.
        bending: B, N m: flexural rigidity of the sheet.
        inner_stiffness: E_v, Pa: Young's modulus of struts through the inside of a closed mesh.
        damping: tau, s: a mode of frequency w rad/s is damped by the ratio tau w / 2.
        mass: kg; by default `area_density` times the area, else the volume of a closed mesh times the material's density.
        area_density: kg/m^2.
        pinned: vertices that stay where they are in the world.
        attached: vertices by the name of the body that they are fastened to.
        material: density and friction. Restitution is 0: a soft body rebounds by its own elasticity only.
        position: (3,) m, orientation: (w, x, y, z): pose of the mesh's own frame at the start.
        velocity: (3,) m/s, angular_velocity: (3,) rad/s about the origin of that frame, world axes.
        gravity_factor: scales the scene's gravity for this body.

    """

    name: str
    mesh: Any
    faces: ArrayLike | None = None
    _: KW_ONLY
    stiffness: float
    bending: float = 0.0
    inner_stiffness: float = 0.0
    damping: float = 0.0
    mass: float | None = None
    area_density: float | None = None
    pinned: Sequence[int] = ()
    attached: Mapping[str, Sequence[int]] = field(default_factory=dict)
    material: Material = DEFAULT_MATERIAL
    position: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    velocity: ArrayLike = (0.0, 0.0, 0.0)
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0)
    gravity_factor: float = 1.0
    stage: ClassVar[str] = "forces"
    kind: ClassVar[str] = "flexible bodies"
    is_body: ClassVar[bool] = True

    @classmethod
    def compile(cls, _bodies: Sequence[Self], world: World) -> ForceTable:
        """Return what all soft bodies of a compiled scene do to its rigid bodies.

        Raises:
            SceneError: naming the body, the value and the remedy.

        """
        from rigidimpulse.dynamics.soft_body.forces import SoftBodyForces

        return SoftBodyForces(world)

    @property
    def label(self) -> str:
        """What errors call it."""
        return f"flexible body {self.name!r}"

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Return its vertices (v, 3) m, in its own frame, and faces (f, 3).

        Raises:
            SceneError: no triangle surface, or vertices in no face.

        """
        try:
            vertices, faces = self._triangles()
            check_triangles(vertices, faces)
            self._check_faces(vertices, faces)
        except SceneError as error:
            raise error.within(self.label) from None
        return vertices, faces

    def build(self) -> SpringMesh:
        """Return its mass-spring mesh, in its rest shape, placed where it starts.

        Raises:
            SceneError: naming the body, the value and the remedy.

        """
        vertices, faces = self.surface()
        try:
            stiffness, bending, inner, damping = self._moduli()
            if inner > 0.0 and not _is_closed(vertices, faces):
                raise SceneError("inner_stiffness is given, but the mesh is open", "close the mesh, or leave it out")
            mass = self._mass(vertices, faces)
            self._check_start(len(vertices))
        except SceneError as error:
            raise error.within(self.label) from None
        rotation, origin = rotation_matrix(self.orientation), np.asarray(self.position, float)
        placed = matmul(vertices, rotation.T) + origin
        return sheet(placed, faces, mass, stiffness, bending, inner, damping)

    def start_velocity(self, placed: np.ndarray) -> np.ndarray:
        """Velocities (v, 3) m/s of the vertices placed (v, 3) m."""
        arms = placed - np.asarray(self.position, float)
        return np.asarray(self.velocity, float) + np.cross(np.asarray(self.angular_velocity, float), arms)

    def fastenings(self, names: Sequence[str]) -> dict[int, int]:
        """Return the index of the body by each vertex that is fastened to one, -1 for the world.

        Raises:
            SceneError: an unknown body, a vertex that is not there or fastened twice.

        """
        num_vertices = len(self.surface()[0])
        held: dict[int, int] = {}
        for body, vertices in [(None, self.pinned), *self.attached.items()]:
            if body is not None and body not in names:
                raise unknown_name("body", body, names, self.label)
            where = "pinned" if body is None else f"attached to {body!r}"
            for vertex in np.asarray(vertices).ravel().tolist():
                if vertex != int(vertex) or not 0 <= vertex < num_vertices:
                    remedy = f"give whole numbers from 0 to {num_vertices - 1}"
                    raise SceneError(f"vertex {vertex} is {where}, but there are {num_vertices}", remedy, self.label)
                if int(vertex) in held:
                    raise SceneError(f"vertex {vertex} is fastened twice", "fasten it once", self.label)
                held[int(vertex)] = -1 if body is None else list(names).index(body)
        return held

    def _triangles(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices and faces as they are given."""
        if isinstance(self.mesh, Shape):
            if self.mesh.kind not in ("box", "mesh"):
                raise SceneError(f"its shape is a {self.mesh.kind}", "give a box, a mesh, or vertices and faces")
            surface = self.mesh.surface()
            return surface.vertices, surface.faces
        if hasattr(self.mesh, "vertices") and hasattr(self.mesh, "faces"):
            return np.asarray(self.mesh.vertices, float), np.asarray(self.mesh.faces, np.int64)
        if self.faces is None:
            raise SceneError("vertices are given without faces", "give faces, triangles (f, 3) of vertex indices")
        shape = Shape.mesh(self.mesh, self.faces)
        assert shape.vertices is not None and shape.faces is not None
        return shape.vertices, shape.faces

    def _check_faces(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        used = np.bincount(faces.ravel(), minlength=len(vertices)) > 0
        if not used.all():
            raise SceneError(f"vertex {int(np.argmin(used))} is in no face", "leave vertices out that no face uses")
        corners = vertices[faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        if not np.all(area > 0.0):
            raise SceneError(f"face {int(np.argmin(area > 0.0))} has no area", "leave such faces out")

    def _moduli(self) -> tuple[float, float, float, float]:
        values = []
        units = {"stiffness": "N/m", "bending": "N m", "inner_stiffness": "Pa", "damping": "s"}
        for name, unit in units.items():
            value = number(getattr(self, name), name, unit)
            if value < 0.0 or (name == "stiffness" and value == 0.0):
                raise SceneError(f"{name} is {value} {unit}", f"give a value {'> 0' if name == 'stiffness' else '>= 0'}")
            values.append(value)
        return values[0], values[1], values[2], values[3]

    def _mass(self, vertices: np.ndarray, faces: np.ndarray) -> float:
        for name, unit in (("mass", "kg"), ("area_density", "kg/m^2")):
            given = getattr(self, name)
            if given is not None and number(given, name, unit) <= 0.0:
                raise SceneError(f"{name} is {given} {unit}", "give a value > 0")
        if self.mass is not None:
            return float(self.mass)
        corners = vertices[faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if self.area_density is not None:
            return float(self.area_density) * 0.5 * float(np.linalg.norm(normal, axis=1).sum())
        volume = float(np.sum((corners[:, 0] - vertices.mean(0)) * normal)) / 6.0
        if not _is_closed(vertices, faces) or volume <= 0.0:
            raise SceneError("its mesh encloses no volume to take a mass from", "give mass= or area_density=")
        return volume * self.material.density

    def _check_start(self, num_vertices: int) -> None:
        self.material.check()
        for name, unit in (("position", "m"), ("velocity", "m/s"), ("angular_velocity", "rad/s")):
            vector(getattr(self, name), name, unit)
        check_orientation(np.asarray(self.orientation, float))
        number(self.gravity_factor, "gravity_factor", "")
        if len(self.pinned) > num_vertices:
            raise SceneError(f"{len(self.pinned)} vertices are pinned, but there are {num_vertices}", "pin each once")


def _is_closed(vertices: np.ndarray, faces: np.ndarray) -> bool:
    return bool(np.all(unique_edges(faces, len(vertices)).balance == 0))
