"""Contacts of soft bodies with rigid bodies: vertices on the surfaces of bodies, and sample points of bodies on faces of soft bodies.

Both are followed over the whole step, along straight ways: vertices as seen from the body, sample points against the moving faces. The
first place that comes within the gap gives the plane of the contact, so that nothing passes through, whatever its speed. Sample points
are vertices of meshes and boxes, the centres of spheres and axes of capsules with their radius, and points on the rims of cylinders.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.point import STACK, first_contact, first_contact_with_triangle
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, Geometry
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.portable import cosine, length, sine
from rigidimpulse.core.vector import dot, row, subtract

RIM_POINTS = 16
AXIS_POINTS = 9


class BodyShapes(NamedTuple):
    """The shapes of n rigid bodies."""

    geometry: Geometry
    shape_of_body: np.ndarray  # (n,)
    radius: np.ndarray  # (n,) m, bound about the centre of mass


class PosesOverStep(NamedTuple):
    """Poses of n rigid bodies at both ends of a step."""

    position: np.ndarray  # (n, 3) m
    rotation: np.ndarray  # (n, 3, 3)
    end_position: np.ndarray  # (n, 3) m
    end_rotation: np.ndarray  # (n, 3, 3)


class MovingFaces(NamedTuple):
    """The faces of all soft bodies over a step."""

    geometry: Geometry  # one mesh
    low: np.ndarray  # (N, 3) m, boxes of its tree, see `fit_boxes`
    high: np.ndarray  # (N, 3) m
    start: np.ndarray  # (v, 3) m, vertices
    end: np.ndarray  # (v, 3) m
    skip: np.ndarray  # (v, n) bool, vertices and bodies that do not collide


class MovingSamples(NamedTuple):
    """Sample points of rigid bodies over a step."""

    start: np.ndarray  # (s, 3) m
    end: np.ndarray  # (s, 3) m
    radius: np.ndarray  # (s,) m
    body: np.ndarray  # (s,)
    every: np.ndarray  # (s,) bool, whether to find all faces that a sample meets, or its first one only


@jit
def _into_frame(R, x, p):
    """Return R^T (p - x)."""
    d = subtract(p, (x[0], x[1], x[2]))
    return (
        R[0, 0] * d[0] + R[1, 0] * d[1] + R[2, 0] * d[2],
        R[0, 1] * d[0] + R[1, 1] * d[1] + R[2, 1] * d[2],
        R[0, 2] * d[0] + R[1, 2] * d[1] + R[2, 2] * d[2],
    )


@jit_making_arrays
def vertices_on_bodies(bodies, poses, start, end, gap, skip, out_int, out_real):
    """Find vertices that come within the gap of bodies; returns their number, which may exceed the size of the output.

    Args:
        bodies: `BodyShapes`. poses: `PosesOverStep` of b bodies. start, end: (n, 3) m, vertices at both ends of the step.
        gap: m. skip: (n, b) bool, pairs that do not collide.
        out_int: (k, 2) vertex, body. out_real: (k, 8) m, in the body's frame: normal, place of the surface, distance, time.

    """
    (geometry, shape_of_body, radius), (x0, R0, x1, R1) = bodies, poses
    stack = np.empty(STACK, np.int64)
    count = 0
    for b in range(x0.shape[0]):
        for i in range(start.shape[0]):
            # Seen from the body its surface stands still, and the vertex goes straight.
            y0 = _into_frame(R0[b], x0[b], row(start, i))
            y1 = _into_frame(R1[b], x1[b], row(end, i))
            way = subtract(y1, y0)
            reach = radius[b] + gap + np.sqrt(dot(way, way))
            if dot(y0, y0) > reach * reach or skip[i, b]:
                continue
            time, distance, normal, place = first_contact(geometry, shape_of_body[b], y0, y1, gap, stack)
            if time == inf:
                continue
            if count < out_int.shape[0]:
                out_int[count, 0], out_int[count, 1] = i, b
                for k in range(3):
                    out_real[count, k] = normal[k]
                    # The place of the surface that the vertex comes near, not the vertex.
                    out_real[count, 3 + k] = place[k] - distance * normal[k]
                out_real[count, 6], out_real[count, 7] = distance, time
            count += 1
    return count


@jit
def fit_boxes(geometry, start, end, low, high):
    """Fit the boxes (N, 3) of the tree over faces to all places of the vertices between start and end (n, 3)."""
    for node in range(geometry.node_child.shape[0] - 1, -1, -1):
        child = geometry.node_child[node]
        for k in range(3):
            if child >= 0:
                low[node, k] = min(low[child, k], low[child + 1, k])
                high[node, k] = max(high[child, k], high[child + 1, k])
                continue
            lowest, highest = inf, -inf
            first = geometry.node_start[node]
            for t in range(first, first + geometry.node_count[node]):
                for m in range(3):
                    i = geometry.triangle[t, m]
                    lowest, highest = min(lowest, start[i, k], end[i, k]), max(highest, start[i, k], end[i, k])
            low[node, k], high[node, k] = lowest, highest


@jit_making_arrays
def samples_on_faces(faces, samples, gap, out_int, out_real):
    """Find sample points that come within the gap of faces of soft bodies; returns their number, which may exceed the size of the output.

    Args:
        faces: `MovingFaces`. samples: `MovingSamples`. gap: m.
        out_int: (k, 2) sample, face. out_real: (k, 8) weights, normal from the sample to the face, distance at the start, time.

    """
    geometry, low, high, start, end, skip = faces
    p0, p1, radius, body, every = samples
    stack = np.empty(STACK, np.int64)
    count = 0
    for s in range(p0.shape[0]):
        a, b = row(p0, s), row(p1, s)
        way = subtract(b, a)
        first, hit = inf, -1
        weights, normal = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        nearest = inf
        stack[0] = 0
        depth = 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            # The box of the sample's way against the box of the faces' ways.
            apart = False
            for k in range(3):
                reach = radius[s] + gap * 1.02
                apart = apart or max(a[k], b[k]) + reach < low[node, k] or min(a[k], b[k]) - reach > high[node, k]
            if apart:
                continue
            child = geometry.node_child[node]
            if child >= 0:
                stack[depth], stack[depth + 1] = child + 1, child
                depth += 2
                continue
            from_ = geometry.node_start[node]
            for t in range(from_, from_ + geometry.node_count[node]):
                i, j, m = geometry.triangle[t, 0], geometry.triangle[t, 1], geometry.triangle[t, 2]
                # A face is left out only where all of its corners are.
                if skip[i, body[s]] and skip[j, body[s]] and skip[m, body[s]]:
                    continue
                corners = (row(start, i), row(start, j), row(start, m))
                ways = (
                    subtract(row(end, i), corners[0]), subtract(row(end, j), corners[1]), subtract(row(end, m), corners[2])
                )  # fmt: skip
                time, w, n, away = first_contact_with_triangle(a, way, corners, ways, radius[s], gap)
                if time == inf:
                    continue
                if every[s]:
                    _write_sample(count, s, t, (w, n, away, time), out_int, out_real)
                    count += 1
                # The face that is met first gives the plane; of faces met at once the nearest.
                elif time < first or (time == first and away < nearest):
                    first, hit, weights, normal, nearest = time, t, w, n, away
        if hit >= 0:
            _write_sample(count, s, hit, (weights, normal, nearest, first), out_int, out_real)
            count += 1
    return count


@jit
def _write_sample(c, s, face, found, out_int, out_real):
    """Write row c of the output of `samples_on_faces`, if the output has it."""
    weights, normal, distance, time = found
    if c < out_int.shape[0]:
        out_int[c, 0], out_int[c, 1] = s, face
        for k in range(3):
            out_real[c, k], out_real[c, 3 + k] = weights[k], normal[k]
        out_real[c, 6], out_real[c, 7] = distance, time


def sample_points(geometry: Geometry, shape: int) -> tuple[np.ndarray, np.ndarray]:
    """Sample points (s, 3) m of a shape, in its frame, and the radius (s,) m of the ball about each; none for half spaces."""
    points, radii = [np.zeros((0, 3))], [np.zeros(0)]
    for p in range(int(geometry.shape_first[shape]), int(geometry.shape_first[shape + 1])):
        if geometry.kind[p] == HALF_SPACE:
            continue
        if geometry.kind[p] == CYLINDER:
            found, radius = _rim_points(geometry.frame[p], float(geometry.radius[p])), 0.0
        else:
            found, radius = geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]], float(geometry.radius[p])
            if len(found) == 2:
                found = np.linspace(found[0], found[1], AXIS_POINTS)
        points.append(found)
        radii.append(np.full(len(found), radius))
    return np.concatenate(points), np.concatenate(radii)


def _rim_points(frame: np.ndarray, radius: float) -> np.ndarray:
    centre, axis, half = frame[:3], frame[3:6], frame[6]
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= length(across)
    angle = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = radius * (cosine(angle)[:, None] * across + sine(angle)[:, None] * np.cross(axis, across))
    return np.concatenate([centre + half * axis + rim, centre - half * axis + rim])
