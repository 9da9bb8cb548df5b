"""Struts that hold a closed mesh open.

From every vertex five rays run inwards, one along its normal and four tilted by 45 degrees, which brace the inside against shear. From the
place where a ray meets the opposite side struts join the corners of that face with the vertex, as a column of material would: with S the
area of the vertex, s the share of the ray, w the weight of the corner and L the length of the strut

    k = E_v S s w / 2 L    (half, since columns are met from both their ends)
"""

from __future__ import annotations

from math import inf

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross, dot, row, subtract

SHARE_ALONG, SHARE_TILTED = 0.4, 0.15
"""Shares of the ray along the normal and of each of the four others."""
LEAST_WEIGHT = 0.05
"""Corners of a face that a ray meets by less than this weight get no strut of their own."""
SLACK = TOLERANCES.soft_body.ray_slack


@jit
def first_hits(x, face, start, direction, hit, weight):
    """Write the first face that each ray meets, -1 for none, and the barycentric coordinates there.

    x: (n, 3) m. face: (f, 3). start: (r,) vertices, whose own faces do not count. direction: (r, 3). hit: (r,). weight: (r, 3).
    """
    for r in range(start.shape[0]):
        p, d = row(x, start[r]), row(direction, r)
        nearest = inf
        hit[r] = -1
        for f in range(face.shape[0]):
            i, j, k = face[f, 0], face[f, 1], face[f, 2]
            if i == start[r] or j == start[r] or k == start[r]:
                continue
            a = row(x, i)
            e1, e2, s = subtract(row(x, j), a), subtract(row(x, k), a), subtract(p, a)
            # Ray against triangle by Cramer's rule; a slack at the sides, so that no ray slips through between two faces.
            across = cross(d, e2)
            determinant = dot(e1, across)
            if determinant == 0.0:
                continue
            u = dot(s, across) / determinant
            if u < -SLACK or u > 1.0 + SLACK:
                continue
            q = cross(s, e1)
            v = dot(d, q) / determinant
            t = dot(e2, q) / determinant
            if v < -SLACK or u + v > 1.0 + SLACK or t <= 0.0 or t >= nearest:
                continue
            nearest = t
            hit[r] = f
            weight[r, 0], weight[r, 1], weight[r, 2] = 1.0 - u - v, u, v


def inner_struts(x: np.ndarray, face: np.ndarray, modulus: float) -> tuple[np.ndarray, np.ndarray]:
    """Struts (k, 2) through the inside of a closed mesh, x (n, 3) m, face (f, 3), and their stiffness (k,) N/m; modulus: E_v, Pa."""
    corners = x[face]
    area_vector = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    vertex_area = np.bincount(face.ravel(), np.repeat(np.linalg.norm(area_vector, axis=1), 3) / 3.0, len(x))
    normal = np.column_stack([np.bincount(face.ravel(), np.repeat(area_vector[:, k], 3), len(x)) for k in range(3)])
    length = np.linalg.norm(normal, axis=1)
    inward = -normal / np.where(length > 0.0, length, 1.0)[:, None]
    # Four rays tilted by 45 degrees brace the inside against shear.
    across = np.cross(inward, np.eye(3)[np.argmin(np.abs(inward), axis=1)])
    across /= np.where(length > 0.0, np.linalg.norm(across, axis=1), 1.0)[:, None]
    beside = np.cross(inward, across)
    tilted = [inward + side for side in (across, -across, beside, -beside)]
    direction = np.concatenate([inward, *(way / np.sqrt(2.0) for way in tilted)])
    start = np.tile(np.arange(len(x)), 5)
    share = np.repeat([SHARE_ALONG] + 4 * [SHARE_TILTED], len(x))
    hit, weight = np.empty(len(start), np.int64), np.zeros((len(start), 3))
    first_hits(x, face, start, direction, hit, weight)
    met = hit >= 0
    ends = np.stack([np.repeat(start[met], 3), face[hit[met]].ravel()], axis=1)
    stiffness = 0.5 * modulus * np.repeat(vertex_area[start[met]] * share[met], 3) * weight[met].ravel()
    kept = weight[met].ravel() >= LEAST_WEIGHT
    ends, stiffness = np.sort(ends[kept], axis=1), stiffness[kept]
    # Columns met from both ends, and by several rays, are one strut.
    strut, index = np.unique(ends, axis=0, return_inverse=True)
    total = np.bincount(index.ravel(), stiffness, len(strut))
    return strut, total / np.linalg.norm(x[strut[:, 1]] - x[strut[:, 0]], axis=1)
