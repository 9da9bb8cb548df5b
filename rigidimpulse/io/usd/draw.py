"""Bodies as prims: what is seen of scenes that come from no USD file.

A body is an Xform with its shapes below it: Sphere, Cube, Capsule, Cylinder, else Mesh. Meshes that several bodies have are
written once, below a class, and referenced by instances. Half spaces are squares.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.io.usd.layer import TYPES, attribute, define, extent, mesh, order, paint, paint_vertices, place
from rigidimpulse.io.usd.library import Gf, Layer, PrimSpec, Sdf, SdfPath, Vt
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.shape import Part, Shape
from rigidimpulse.view.display import display_mesh, display_square
from rigidimpulse.view.materials import PALETTE, surface

SHAPES = "/_Shapes"
"""Class whose children are meshes that bodies share; what is below a class is not drawn."""
NO_TURN = np.array([1.0, 0.0, 0.0, 0.0])
CORNERS = np.array([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]])


class Drawing:
    """Prims of bodies in a layer."""

    def __init__(self, layer: Layer, half: float, bodies: Iterable[Body]) -> None:
        """half: m, half side of squares. bodies: those that will be drawn."""
        self.layer, self.half = layer, half
        parts = [part.shape.drawn_key for body in bodies for part in body.drawn_shape.parts_flat() if part.shape.kind == "mesh"]
        self._uses = Counter(parts)
        self._shared: dict[tuple[bytes, bool], SdfPath] = {}

    def body(self, path: SdfPath, body: Body, number: int) -> PrimSpec:
        """Return the prim of a body with its shapes, in the colour of the moving body `number`."""
        prim = define(self.layer, path)
        prim.SetInfo("displayName", body.name)
        paint(prim, surface(number % len(PALETTE), body, None)["color"])
        parts = body.drawn_shape.parts_flat()
        for k, part in enumerate(parts):
            # Blender makes one object of an Xform and a shape that is alone in it and has no operations, and names it after the shape.
            single = len(parts) == 1 and not self._is_placed(part)
            self._part(path.AppendChild(path.name if single else f"{path.name}_shape{k}"), part, body.shows_own_colors)
        return prim

    def _is_placed(self, part: Part) -> bool:
        """Whether the prim of a part has operations, or is an instance."""
        moved = bool(np.any(part.position)) or not np.array_equal(part.rotation, np.eye(3))
        return moved or part.shape.kind == "box" or self._uses[part.shape.drawn_key] > 1

    def _part(self, path: SdfPath, part: Part, painted: bool) -> None:
        """Write a part; painted: in the colours that its mesh has."""
        shape = part.shape
        if shape.kind == "mesh" and self._uses[shape.drawn_key] > 1:
            prim = define(self.layer, path)
            prim.referenceList.Prepend(Sdf.Reference(primPath=self._class(shape, painted)))
            prim.instanceable = True
        else:
            prim = self._geometry(path, shape, painted)
        names: list[str] = []
        turn = NO_TURN if np.array_equal(part.rotation, np.eye(3)) else from_matrix(part.rotation)
        if np.any(part.position) or np.any(turn[1:]):
            names += place(prim, part.position, turn)
        if shape.kind == "box":
            attribute(prim, "xformOp:scale", TYPES.Double3, Gf.Vec3d(*np.asarray(shape.size).tolist()))
            names.append("xformOp:scale")
        if names:
            order(prim, names)

    def _class(self, shape: Shape, painted: bool) -> SdfPath:
        """Path of the class of a mesh that several bodies have."""
        key = shape.drawn_key, painted
        if key not in self._shared:
            path = Sdf.Path(SHAPES).AppendChild(f"mesh{len(self._shared)}")
            define(self.layer, path)
            self.layer.GetPrimAtPath(SHAPES).specifier = Sdf.SpecifierClass
            self._geometry(path.AppendChild("mesh"), shape, painted)
            self._shared[key] = path
        return self._shared[key]

    def _geometry(self, path: SdfPath, shape: Shape, painted: bool) -> PrimSpec:
        """Return the prim of a single shape in its own frame."""
        if shape.kind == "half_space":
            return self._square(path, *shape.plane())
        if shape.kind in ("mesh", "compound"):
            drawn = display_mesh(shape)
            assert drawn is not None
            prim = define(self.layer, path, "Mesh")
            mesh(prim, drawn.vertices, drawn.faces, drawn.normals)
            if painted and drawn.colors is not None:
                paint_vertices(prim, drawn.colors)
            return prim
        prim = define(self.layer, path, {"box": "Cube"}.get(shape.kind, shape.kind.capitalize()))
        if shape.kind == "box":
            attribute(prim, "size", TYPES.Double, 1.0)
            attribute(prim, "extent", TYPES.Float3Array, extent(CORNERS))
            return prim
        attribute(prim, "radius", TYPES.Double, float(shape.radius))
        figures = np.full(3, shape.radius)
        if shape.kind != "sphere":
            attribute(prim, "height", TYPES.Double, float(shape.height))
            attribute(prim, "axis", TYPES.Token, "Z", uniform=True)
            figures[2] = 0.5 * shape.height + (shape.radius if shape.kind == "capsule" else 0.0)
        attribute(prim, "extent", TYPES.Float3Array, extent(np.array([-figures, figures])))
        return prim

    def _square(self, path: SdfPath, normal: np.ndarray, offset: float) -> PrimSpec:
        prim, square = define(self.layer, path, "Mesh"), display_square(normal, offset, self.half)
        mesh(prim, square.vertices, square.faces)
        return prim


def draw_soft_body(layer: Layer, path: SdfPath, track: Any, codes: list[float], color: str) -> None:
    """Write a flexible body: a mesh whose points have time samples.

    Args:
        layer, path: where. track: frames of the body. codes: (f,) time codes of the frames. color: "#rrggbb".

    """
    prim = define(layer, path, "Mesh")
    prim.SetInfo("displayName", track.name)
    mesh(prim, track.vertices[0], track.faces)
    paint(prim, color)
    points, boxes = prim.path.AppendProperty("points"), prim.path.AppendProperty("extent")
    for code, frame in zip(codes, track.vertices, strict=True):
        layer.SetTimeSample(points, code, Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(frame, np.float32)))
        layer.SetTimeSample(boxes, code, extent(frame))
