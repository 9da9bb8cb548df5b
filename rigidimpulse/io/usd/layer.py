"""Prims and their values written straight into a layer: many times quicker than through a stage, which answers to every value.

Call within a `Sdf.ChangeBlock`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.core.colors import linear_of, seen_of_hex
from rigidimpulse.io.usd.library import Gf, Layer, PrimSpec, Sdf, SdfPath, Tf, Vt

TYPES = Sdf.ValueTypeNames


def valid_name(name: str, used: set[str]) -> str:
    """Return a name for a prim, unlike the used ones, which it joins."""
    made = wanted = Tf.MakeValidIdentifier(f"_{name}" if name[0].isdigit() else name)
    number = 2
    while made in used:
        made, number = f"{wanted}_{number}", number + 1
    used.add(made)
    return made


def define(layer: Layer, path: SdfPath, kind: str = "Xform", over: bool = False) -> PrimSpec:
    """Return a new prim of a type, or (`over`) an opinion on one that is there, in this layer or below."""
    known = layer.GetPrimAtPath(path)
    if over and known is not None:
        return known
    prim = Sdf.CreatePrimInLayer(layer, path)
    prim.specifier = Sdf.SpecifierOver if over else Sdf.SpecifierDef
    if not over:
        prim.typeName = kind
    return prim


def attribute(prim: PrimSpec, name: str, kind: Any, value: Any = None, uniform: bool = False) -> Any:
    """Return an attribute of a prim with a value."""
    spec = prim.attributes.get(name)
    if spec is None:
        spec = Sdf.AttributeSpec(prim, name, kind, Sdf.VariabilityUniform if uniform else Sdf.VariabilityVarying)
    if value is not None:
        spec.default = value
    return spec


def quaternions(orientations: np.ndarray) -> Any:
    """Return orientations (k, 4) wxyz as USD has them, in double precision.

    USD takes the angle from the real part alone: rounded to single precision it loses turns below 1e-3 rad.
    """
    turned = np.asarray(orientations, float)[:, [1, 2, 3, 0]]
    return Vt.QuatdArray.FromNumpy(np.ascontiguousarray(turned / np.linalg.norm(turned, axis=1, keepdims=True)))


def vectors(points: np.ndarray) -> Any:
    """Return points (k, 3) as USD has them, in double precision."""
    return Vt.Vec3dArray.FromNumpy(np.ascontiguousarray(points, float))


def place(prim: PrimSpec, position: np.ndarray, orientation: np.ndarray, suffix: str = "") -> tuple[str, str]:
    """Give a prim a position and an orientation wxyz, and return the names of their operations."""
    names = f"xformOp:translate{suffix}", f"xformOp:orient{suffix}"
    attribute(prim, names[0], TYPES.Double3, vectors(np.reshape(position, (1, 3)))[0])
    attribute(prim, names[1], TYPES.Quatd, quaternions(np.reshape(orientation, (1, 4)))[0])
    return names


def order(prim: PrimSpec, names: list[str]) -> None:
    """Say which operations move a prim, outermost first."""
    attribute(prim, "xformOpOrder", TYPES.TokenArray, Vt.TokenArray(names), uniform=True)


def sample(prim: PrimSpec, name: str, codes: list[float], values: Any) -> None:
    """Give an attribute of a prim values at time codes."""
    path, write = prim.path.AppendProperty(name), prim.layer.SetTimeSample
    for code, value in zip(codes, values, strict=True):
        write(path, code, value)


def extent(points: np.ndarray) -> Any:
    """Return the corners of the box about points (p, 3)."""
    return Vt.Vec3fArray([Gf.Vec3f(*points.min(axis=0).tolist()), Gf.Vec3f(*points.max(axis=0).tolist())])


def mesh(prim: PrimSpec, points: np.ndarray, faces: np.ndarray, normals: np.ndarray | None = None) -> None:
    """Make a prim a mesh of triangles (t, 3) with points (v, 3), which subdivision leaves alone."""
    attribute(prim, "points", TYPES.Point3fArray, Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32)))
    attribute(prim, "faceVertexCounts", TYPES.IntArray, Vt.IntArray([3] * len(faces)))
    attribute(prim, "faceVertexIndices", TYPES.IntArray, Vt.IntArray.FromNumpy(np.ascontiguousarray(faces.ravel(), np.int32)))
    attribute(prim, "subdivisionScheme", TYPES.Token, "none", uniform=True)
    attribute(prim, "doubleSided", TYPES.Bool, True, uniform=True)
    attribute(prim, "extent", TYPES.Float3Array, extent(points))
    if normals is not None:
        spec = attribute(prim, "normals", TYPES.Normal3fArray, Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals, np.float32)))
        spec.SetInfo("interpolation", "vertex")


def paint(prim: PrimSpec, color: str) -> None:
    """Give a prim, and what is below it, a colour "#rrggbb" of the screen."""
    linear = linear_of(seen_of_hex(color))
    spec = attribute(prim, "primvars:displayColor", TYPES.Color3fArray, Vt.Vec3fArray([Gf.Vec3f(*linear.tolist())]))
    spec.SetInfo("interpolation", "constant")


def paint_vertices(prim: PrimSpec, colors: np.ndarray) -> None:
    """Give each vertex of a mesh its colour (v, 3), uint8 of the screen."""
    linear = np.ascontiguousarray(linear_of(colors / 255.0), np.float32)
    attribute(prim, "primvars:displayColor", TYPES.Color3fArray, Vt.Vec3fArray.FromNumpy(linear)).SetInfo("interpolation", "vertex")
