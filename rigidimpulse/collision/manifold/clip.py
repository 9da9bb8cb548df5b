"""Contacts of a face of one convex polyhedron with a face of another: the polygon cut by the face's sides; see `polyhedra`."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

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


class Side(NamedTuple):
    """A face of one of two bodies."""

    shape: int
    body: int
    position: np.ndarray  # (3,) m, of the body, relative to a
    face: int


@jit
def _cut(polygon, count, plane, side):
    """Keep the part of the polygon with p.x <= offset, plane = (p, offset); returns its number of corners."""
    corner, ids, spare, spare_ids = polygon.corner, polygon.ids, polygon.spare, polygon.spare_ids
    px, py, pz, offset = plane
    kept = np.int64(0)
    for k in range(count):
        j = k - 1 if k > 0 else count - 1
        x0, y0, z0 = corner[j, 0], corner[j, 1], corner[j, 2]
        x1, y1, z1 = corner[k, 0], corner[k, 1], corner[k, 2]
        before, after = px * x0 + py * y0 + pz * z0 - offset, px * x1 + py * y1 + pz * z1 - offset
        if (before > 0.0) != (after > 0.0) and kept < MOST_CORNERS:
            t = before / (before - after)
            spare[kept, 0], spare[kept, 1], spare[kept, 2] = x0 + t * (x1 - x0), y0 + t * (y1 - y0), z0 + t * (z1 - z0)
            # The id of a new corner names the side that cuts and the corner that it cuts off.
            spare_ids[kept] = FROM_EDGE * (side + 1) + (ids[j] if before > 0.0 else ids[k]) % FROM_EDGE
            kept += 1
        if after <= 0.0 and kept < MOST_CORNERS:
            spare[kept, 0], spare[kept, 1], spare[kept, 2] = x1, y1, z1
            spare_ids[kept] = ids[k]
            kept += 1
    for k in range(kept):
        corner[k, 0], corner[k, 1], corner[k, 2] = spare[k, 0], spare[k, 1], spare[k, 2]
        ids[k] = spare_ids[k]
    return kept


@jit
def _write_paths(velocity, own, other, ahead, polygon, count):
    """Write how far (m) each corner, moving with the other body, comes in `ahead` s as seen from the face's own body."""
    a, b, x, y, corner, paths = 8 * own.body, 8 * other.body, own.position, other.position, polygon.corner, polygon.paths
    for k in range(count):
        rx, ry, rz = corner[k, 0] - x[0], corner[k, 1] - x[1], corner[k, 2] - x[2]
        sx, sy, sz = corner[k, 0] - y[0], corner[k, 1] - y[1], corner[k, 2] - y[2]
        wx, wy, wz, ox, oy, oz = velocity[a + 3], velocity[a + 4], velocity[a + 5], velocity[b + 3], velocity[b + 4], velocity[b + 5]
        paths[k, 0] = ahead * (velocity[b] - velocity[a] + (oy * sz - oz * sy) - (wy * rz - wz * ry))
        paths[k, 1] = ahead * (velocity[b + 1] - velocity[a + 1] + (oz * sx - ox * sz) - (wz * rx - wx * rz))
        paths[k, 2] = ahead * (velocity[b + 2] - velocity[a + 2] + (ox * sy - oy * sx) - (wx * ry - wy * rx))


@jit
def clip_faces(shapes, pair, own, other, query, polygon, points):
    """Contacts of the face `own` with the face `other` of the other body, both of them a `Side`; returns their number.

    Parts beside the face that come over it in `query.ahead` s count as well.
    """
    corner, ids, _, _, paths, height, chosen = polygon
    real, out_ids = points
    r, i, j, x, y, face, margin = pair.rotation, own.body, other.body, own.position, other.position, own.face, query.margin
    sign = 1.0 if i == pair.a else -1.0
    nx, ny, nz = turned_by(r, i, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    count = np.int64(0)
    begin = shapes.loop_first[other.face]
    for k in range(begin, min(shapes.loop_first[other.face + 1], begin + MOST_CORNERS)):
        v = shapes.loop[k]
        vx, vy, vz = turned_by(r, j, shapes.corner[v, 0], shapes.corner[v, 1], shapes.corner[v, 2])
        corner[count, 0], corner[count, 1], corner[count, 2] = vx + (y[0] - x[0]), vy + (y[1] - x[1]), vz + (y[2] - x[2])
        ids[count] = v
        count += 1
    _write_paths(pair.velocity, own, other, query.ahead, polygon, count)
    first, last, corners = shapes.loop_first[face], shapes.loop_first[face + 1], count
    for k in range(first, last):
        v, w = shapes.loop[k], shapes.loop[k + 1 if k + 1 < last else first]
        ax, ay, az = turned_by(r, i, shapes.corner[v, 0], shapes.corner[v, 1], shapes.corner[v, 2])
        bx, by, bz = turned_by(r, i, shapes.corner[w, 0], shapes.corner[w, 1], shapes.corner[w, 2])
        ex, ey, ez = bx - ax, by - ay, bz - az
        px, py, pz = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
        # The side is moved outwards by what may come over it in `ahead` s.
        offset, nearer = px * ax + py * ay + pz * az, 0.0
        for c in range(corners):
            nearer = max(nearer, -(px * paths[c, 0] + py * paths[c, 1] + pz * paths[c, 2]))
        count = _cut(polygon, count, (px, py, pz, offset + nearer), k - first)
    kept = 0
    for k in range(count):
        gap = nx * corner[k, 0] + ny * corner[k, 1] + nz * corner[k, 2] - shapes.plane[face, 3]
        if gap <= margin:
            corner[kept, 0], corner[kept, 1], corner[kept, 2] = corner[k, 0], corner[k, 1], corner[k, 2]
            height[kept], ids[kept] = gap, ids[k]
            kept += 1
    if kept == 0:
        return np.int64(0)
    # Four points can carry the load of all.
    number = four_of(corner, height, kept, chosen)
    at_a, at_b = (3, 0) if sign < 0.0 else (0, 3)
    for c in range(number):
        k = chosen[c]
        gap = height[k]
        for m in range(3):
            n = nx if m == 0 else (ny if m == 1 else nz)
            p = corner[k, m] + x[m]
            real[c, at_a + m], real[c, at_b + m] = p - gap * n, p
            real[c, 6 + m] = sign * n
        real[c, 9] = gap
        out_ids[c, 0], out_ids[c, 1], out_ids[c, 2] = face, other.face, ids[k]
    return number
