"""Contacts of a cylinder with another primitive, for tests: arrangements in one line, and the surface of a cylinder."""

from __future__ import annotations

import numpy as np
import trimesh

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Primitive, build_geometry
from rigidimpulse.collision.manifold.contact_points import Contacts as Buffers
from rigidimpulse.collision.manifold.contact_points import Pose
from rigidimpulse.collision.manifold.cylinder import (
    cylinder_cylinder_contacts,
    cylinder_cylinder_gap,
    cylinder_half_space_contacts,
    cylinder_half_space_gap,
    cylinder_round_contacts,
    cylinder_round_gap,
)
from rigidimpulse.collision.manifold.kept_features import FEW_ROWS, make_contact_scratch
from rigidimpulse.core.kernels import jit

Z = np.array([0.0, 0.0, 1.0])


@jit
def contacts_kernel(geometry, i, j, pose, margin, buffers):
    if geometry.kind[j] == HALF_SPACE:
        return cylinder_half_space_contacts(geometry, i, j, pose, margin, buffers, np.int64(0))
    if geometry.kind[j] == ROUND:
        return cylinder_round_contacts(geometry, i, j, pose, margin, buffers, np.int64(0))
    return cylinder_cylinder_contacts(geometry, i, j, pose, margin, buffers, np.int64(0))


@jit
def gap_kernel(geometry, i, j, pose, limit, stack, out):
    if geometry.kind[j] == HALF_SPACE:
        return cylinder_half_space_gap(geometry, i, j, pose, limit, stack, out)
    if geometry.kind[j] == ROUND:
        return cylinder_round_gap(geometry, i, j, pose, limit, stack, out)
    return cylinder_cylinder_gap(geometry, i, j, pose, limit, stack, out)


def cylinder(radius=1.0, half=1.0, centre=(0.0, 0.0, 0.0), axis=Z):
    axis = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return Primitive(CYLINDER, radius, frame=np.array([*centre, *axis, half]))


def half_space(normal=(0.0, 0.0, 1.0), offset=0.0):
    return Primitive(HALF_SPACE, frame=np.array([*normal, offset, 0.0, 0.0, 0.0]))


def mesh(solid, scale=1.0):
    return Primitive(ROUND, vertices=np.array(solid.vertices) * scale, faces=np.array(solid.faces))


def box(size):
    return mesh(trimesh.creation.box(size))


def capsule(radius, half):
    return Primitive(ROUND, radius, vertices=np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]))


def sphere(radius):
    return Primitive(ROUND, radius, vertices=np.zeros((1, 3)))


class Contacts:
    """Contacts of two primitives: the first a cylinder, the second moved by rotation and position."""

    def __init__(self, first, second, position=(0.0, 0.0, 0.0), rotation=None, margin=1e-4):
        self.geometry = build_geometry([CompiledShape((first,)), CompiledShape((second,))])
        self.R = np.ascontiguousarray(np.eye(3) if rotation is None else rotation.as_matrix())
        self.pose = Pose(self.R, np.array(position, dtype=float))
        self.scratch, real, integer = make_contact_scratch.py_func(200, 0, FEW_ROWS), np.zeros((200, 10)), np.zeros((200, 5), np.int64)
        count = contacts_kernel(self.geometry, 0, 1, self.pose, margin, Buffers(real, integer, self.scratch))
        self.point_a, self.point_b, self.normal = real[:count, :3], real[:count, 3:6], real[:count, 6:9]
        self.gap, self.features = real[:count, 9], integer[:count, 3:5]

    def least_gap(self, limit=1e9):
        out = np.zeros(9)
        return gap_kernel(self.geometry, 0, 1, self.pose, limit, self.scratch.pairs, out), out[:3], out[3:6]

    def expect(self, points, normals, gap=None, tolerance=1e-12):
        """Check that the points on the first body are these, in any order, and the normals too."""
        assert len(self.gap) == len(points)
        normals = np.broadcast_to(np.asarray(normals, dtype=float), (len(points), 3))
        for point, normal in zip(np.asarray(points, dtype=float), normals, strict=True):
            error = np.linalg.norm(self.point_a - point, axis=1) + np.linalg.norm(self.normal - normal, axis=1)
            assert error.min() < tolerance, f"no contact at {point} with normal {normal}: {self.point_a}"
        if gap is not None:
            assert np.allclose(self.gap, gap, rtol=0.0, atol=tolerance)
        assert np.allclose(self.point_b - self.point_a, self.gap[:, None] * self.normal, rtol=0.0, atol=tolerance)
        assert len({tuple(pair) for pair in self.features.tolist()}) == len(self.gap)


def circle(radius, angles, z):
    return [[radius * np.cos(angle), radius * np.sin(angle), z] for angle in angles]


def support(axis, half, radius, n):
    return radius * np.linalg.norm(np.cross(axis, n)) + half * abs(axis @ n)


def outside(p, centre, axis, half, radius):
    """How far a point is outside a cylinder, at least along one direction; negative inside."""
    height = (p - centre) @ axis
    return max(abs(height) - half, np.linalg.norm(p - centre - height * axis) - radius)


def unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)
