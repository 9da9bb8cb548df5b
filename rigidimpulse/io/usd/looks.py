"""What is seen of bodies of a USD file: geometry that is rendered, in the colours of its material or of `primvars:displayColor`.

Colours in USD are linear. A material has one, the diffuseColor of a UsdPreviewSurface, if that is no picture.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rigidimpulse.core.colors import seen_bytes, seen_of
from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.looks import Look
from rigidimpulse.io.usd.frames import Frames
from rigidimpulse.io.usd.library import Prim, SdfPath, Usd, UsdGeom, UsdShade
from rigidimpulse.io.usd.plain import is_seen
from rigidimpulse.io.usd.shapes import Shapes, corners_of, placed_in
from rigidimpulse.scene.shape import Shape


def looks_of(prim: Prim, others: set[SdfPath], frames: Frames, shapes: Shapes) -> list[Look]:
    """Return what is seen of a body, in the rigid frame of its prim.

    Args:
        prim: of the body. others: paths of other bodies, whose geometry is not its own. frames: of the file.
        shapes: reads geometry as it is drawn.

    """
    looks, walk = [], iter(Usd.PrimRange(prim, Usd.TraverseInstanceProxies()))
    for each in walk:
        if each != prim and each.GetPath() in others:
            walk.PruneChildren()
        elif each.IsA(UsdGeom.Gprim) and is_seen(each):
            try:
                made = shapes.of(each, frames.stretch(each) * frames.meters_per_unit)
            except SceneError:  # the loader has said so where it matters
                continue
            if made is not None:
                shape, place, turn = placed_in(made, frames.rigid(each), frames.rigid(prim))
                looks.append(_colored(each, shape, place, turn, frames.start))
    return looks


def _colored(prim: Prim, shape: Shape, place: np.ndarray, turn: np.ndarray, code: float) -> Look:
    """Return a shape at its place with the colours that its prim has."""
    color = _diffuse(prim)
    if color is not None:
        return Look(shape, place, turn, seen_of(color))
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
    values = np.array((primvar.ComputeFlattened(code) if primvar else None) or (), float).reshape(-1, 3)
    if not len(values) or not np.isfinite(values).all():
        return Look(shape, place, turn, None)
    if len(values) > 1 and shape.kind == "mesh" and prim.IsA(UsdGeom.Mesh):
        corners = _of_corners(prim, shape, values, str(primvar.GetInterpolation()))
        if corners is not None:
            return Look(replace(shape, colors=seen_bytes(corners)), place, turn, None)
    return Look(shape, place, turn, seen_of(values.mean(axis=0)))


def _of_corners(prim: Prim, shape: Shape, values: np.ndarray, interpolation: str) -> np.ndarray | None:
    """Return the colours (f, 3, 3) of the corners of a mesh, None where the values do not fit it."""
    polygons, corners = corners_of(UsdGeom.Mesh(prim))
    places: dict[str, Any] = {
        "vertex": shape.faces, "varying": shape.faces, "faceVarying": corners, "uniform": np.repeat(polygons[:, None], 3, axis=1)
    }  # fmt: skip
    index = places.get(interpolation)
    if index is None or shape.faces is None or index.shape != shape.faces.shape or int(index.max()) >= len(values):
        return None
    mirrored = interpolation == "faceVarying" and bool(np.any(shape.faces != _index(prim)[corners]))
    return values[index[:, ::-1] if mirrored else index]


def _index(prim: Prim) -> np.ndarray:
    return np.array(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get(), np.int64)


def _diffuse(prim: Prim) -> np.ndarray | None:
    """Return the diffuse colour (3,) of the material that is bound to a prim, None where it has none, or a picture."""
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    shader = material.ComputeSurfaceSource()[0] if material else None
    given = shader.GetInput("diffuseColor") if shader else None
    for attribute in given.GetValueProducingAttributes() if given else ():
        value = attribute.Get()
        if value is not None and len(value) == 3 and np.isfinite(value).all():
            return np.clip(np.array(value, float), 0.0, 1.0)
    return None
