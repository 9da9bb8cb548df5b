"""Contacts of a face of one convex polyhedron with a face of another: the polygon cut by the face's sides; see `heap_polyhedra`."""

from __future__ import annotations

from math import inf

import numpy as np

from rigidimpulse.collision.manifold.polyhedra import FROM_EDGE, MOST_CORNERS, four_of
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import turned_back_by, turned_by


@jit
def face_like(shapes, s, r, i, nx, ny, nz):
    """The face of shape s turned by r[i] whose normal is most like n."""
    a, b, c = turned_back_by(r, i, nx, ny, nz)
    best, face = -inf, shapes.face_first[s]
    for f in range(shapes.face_first[s], shapes.face_first[s + 1]):
        cosine = a * shapes.plane[f, 0] + b * shapes.plane[f, 1] + c * shapes.plane[f, 2]
        if cosine > best:
            best, face = cosine, f
    return face


@jit
def _cut(polygon, ids, count, spare, spare_ids, px, py, pz, offset, side):
    """Keep the part of the polygon with p.x <= offset; returns its number of corners."""
    kept = np.int64(0)
    for k in range(count):
        j = k - 1 if k > 0 else count - 1
        x0, y0, z0 = polygon[j, 0], polygon[j, 1], polygon[j, 2]
        x1, y1, z1 = polygon[k, 0], polygon[k, 1], polygon[k, 2]
        before, after = px * x0 + py * y0 + pz * z0 - offset, px * x1 + py * y1 + pz * z1 - offset
        if (before > 0.0) != (after > 0.0) and kept < MOST_CORNERS:
            t = before / (before - after)
            spare[kept, 0], spare[kept, 1], spare[kept, 2] = x0 + t * (x1 - x0), y0 + t * (y1 - y0), z0 + t * (z1 - z0)
            spare_ids[kept] = FROM_EDGE * (side + 1) + (ids[j] if before > 0.0 else ids[k]) % FROM_EDGE
            kept += 1
        if after <= 0.0 and kept < MOST_CORNERS:
            spare[kept, 0], spare[kept, 1], spare[kept, 2] = x1, y1, z1
            spare_ids[kept] = ids[k]
            kept += 1
    for k in range(kept):
        polygon[k, 0], polygon[k, 1], polygon[k, 2] = spare[k, 0], spare[k, 1], spare[k, 2]
        ids[k] = spare_ids[k]
    return kept


@jit
def _coming(polygon, count, velocity, i, x, j, y, ahead, ways):
    """How far (m) each corner, moving with body j at y, comes in `ahead` s as seen from body i at x, into ways (count, 3)."""
    a, b = 8 * i, 8 * j
    for k in range(count):
        rx, ry, rz = polygon[k, 0] - x[0], polygon[k, 1] - x[1], polygon[k, 2] - x[2]
        sx, sy, sz = polygon[k, 0] - y[0], polygon[k, 1] - y[1], polygon[k, 2] - y[2]
        wx, wy, wz, ox, oy, oz = velocity[a + 3], velocity[a + 4], velocity[a + 5], velocity[b + 3], velocity[b + 4], velocity[b + 5]
        ways[k, 0] = ahead * (velocity[b] - velocity[a] + (oy * sz - oz * sy) - (wy * rz - wz * ry))
        ways[k, 1] = ahead * (velocity[b + 1] - velocity[a + 1] + (oz * sx - ox * sz) - (wz * rx - wx * rz))
        ways[k, 2] = ahead * (velocity[b + 2] - velocity[a + 2] + (ox * sy - oy * sx) - (wx * ry - wy * rx))


@jit
def clip_faces(shapes, velocity, r, s, i, x, face, t, j, y, other, margin, ahead, sign, scratch, real, out_ids):
    """Contacts of a face of shape s at (x, r[i]) with the face `other` of shape t at (y, r[j]); returns their number.

    sign: 1 where the face is a's, else -1; positions are relative to a. What is beside the face and comes over it in `ahead` s counts.
    """
    polygon, ids, spare, spare_ids, ways, height, chosen = scratch
    nx, ny, nz = turned_by(r, i, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    count = np.int64(0)
    for k in range(shapes.loop_first[other], min(shapes.loop_first[other + 1], shapes.loop_first[other] + MOST_CORNERS)):
        v = shapes.loop[k]
        vx, vy, vz = turned_by(r, j, shapes.corner[v, 0], shapes.corner[v, 1], shapes.corner[v, 2])
        polygon[count, 0], polygon[count, 1], polygon[count, 2] = vx + (y[0] - x[0]), vy + (y[1] - x[1]), vz + (y[2] - x[2])
        ids[count] = v
        count += 1
    _coming(polygon, count, velocity, i, x, j, y, ahead, ways)
    first, last, corners = shapes.loop_first[face], shapes.loop_first[face + 1], count
    for k in range(first, last):
        v, w = shapes.loop[k], shapes.loop[k + 1 if k + 1 < last else first]
        ax, ay, az = turned_by(r, i, shapes.corner[v, 0], shapes.corner[v, 1], shapes.corner[v, 2])
        bx, by, bz = turned_by(r, i, shapes.corner[w, 0], shapes.corner[w, 1], shapes.corner[w, 2])
        ex, ey, ez = bx - ax, by - ay, bz - az
        px, py, pz = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
        offset, nearer = px * ax + py * ay + pz * az, 0.0
        for c in range(corners):
            nearer = max(nearer, -(px * ways[c, 0] + py * ways[c, 1] + pz * ways[c, 2]))
        count = _cut(polygon, ids, count, spare, spare_ids, px, py, pz, offset + nearer, k - first)
    kept = 0
    for k in range(count):
        gap = nx * polygon[k, 0] + ny * polygon[k, 1] + nz * polygon[k, 2] - shapes.plane[face, 3]
        if gap <= margin:
            polygon[kept, 0], polygon[kept, 1], polygon[kept, 2] = polygon[k, 0], polygon[k, 1], polygon[k, 2]
            height[kept], ids[kept] = gap, ids[k]
            kept += 1
    if kept == 0:
        return np.int64(0)
    number = four_of(polygon, height, kept, chosen)
    at_a, at_b = (3, 0) if sign < 0.0 else (0, 3)
    for c in range(number):
        k = chosen[c]
        gap = height[k]
        for m in range(3):
            n = nx if m == 0 else (ny if m == 1 else nz)
            p = polygon[k, m] + x[m]
            real[c, at_a + m], real[c, at_b + m] = p - gap * n, p
            real[c, 6 + m] = sign * n
        real[c, 9] = gap
        out_ids[c, 0], out_ids[c, 1], out_ids[c, 2] = face, other, ids[k]
    return number
