"""Rounded surfaces: a shape that is one ball, capsule or cylinder touches with a skeleton and a radius around it.

A ball or capsule has its radius everywhere. A cylinder has it at its side, where the normal n is across the axis k: |n.k| < ON_ITS_SIDE. At
its caps and rims, and for all other shapes, the radius is 0.
"""

from __future__ import annotations

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import dot, turned

ON_ITS_SIDE = 0.7
"""Cosine of normal and axis below which a cylinder that is not touched at a rim is touched at its side."""


@jit
def only_primitive(geometry, shape):
    """The only primitive of a shape, or -1."""
    p = geometry.shape_first[shape]
    return p if geometry.shape_first[shape + 1] == p + 1 else -1


@jit
def side_radius(geometry, p, rotation, normal):
    """Radius of a cylinder (the only primitive of its shape) that is touched at its side, or of a ball; else 0."""
    if p < 0 or geometry.kind[p] == HALF_SPACE:
        return 0.0
    if geometry.kind[p] == CYLINDER:
        frame = geometry.frame
        axis = turned(rotation, (frame[p, 3], frame[p, 4], frame[p, 5]))
        return geometry.radius[p] if abs(dot(normal, axis)) < ON_ITS_SIDE else 0.0
    return geometry.radius[p] if geometry.kind[p] == ROUND else 0.0
