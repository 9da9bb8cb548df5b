"""Cones of the normals with which a surface of triangles can touch, for every node of its box tree.

Two features touch with a normal n from a to b that lies in the Gauss arc or cone of a's feature, and -n in that of b's (see
`manifold.mesh_mesh`). So two nodes of the box trees whose cones cannot hold n and -n have no contact, however near they are.
Neither have nodes that no way along such an n leads from one to the other. A walk through both trees leaves them out (`bvh`).
Source: Johnson and Cohen, "Spatialized normal cone hierarchies", Symposium on Interactive 3D Graphics, 2001.

A cone has an axis c and a half angle a, and holds every unit n with an angle to c of a at most.

- Face: its normal, a = 0. The kernels take it as it is.
- Convex edge with normals n_0, n_1, phi apart: c = (n_0 + n_1) / |n_0 + n_1|, a = phi / 2 + s. The kernels let a normal miss the arc
  a little; s is more than that.
- Vertex with edges along the unit vectors u_i: all n with  u_i . n <= tau  for each i, where tau is how far the kernels let a normal miss.
  c is the mean of the normals of its faces. The largest angle to c in this set is at -c, if -c is in the set, or else on its border, which
  consists of arcs of the circles u_i . n = tau: at the end of an arc, where two circles meet,
      n = (u_i + u_j) tau / (1 + g) +- (u_i x u_j) h,   g = u_i . u_j,   h^2 = (1 - 2 tau^2 / (1 + g)) / (1 - g^2),
  or where a circle is farthest from c,
      n = tau u_i +- sqrt(1 - tau^2) w,   w the unit vector along the part of c across u_i.
  Whichever of these points are in the set count. Where none is, as at a saddle, nothing touches the vertex.
- Boundaries, capsules, surfaces that bound no solid, and vertices with many edges or two alike: every direction, a = pi.
- Leaf: the axis is the mean of those of the features that its triangles own, the half angle is the least that holds all their cones.
- Node: the same of the cones of its two children.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

TAU = 0.041
"""tau: a little more than the sine by which the kernels let a normal miss a cone (twice `manifold.contact_points.TILT`)."""
EDGE_SLACK = 0.08
"""s, rad: more than asin(tau) and the tilt of edges that count as parallel (`manifold.mesh_edges.NEARLY_PARALLEL`)."""
MOST_EDGES = 16
"""Edges of a vertex beyond which its cone is not worth its cost."""
ALIKE = 1.0 - 1e-6
"""Cosine of the angle of two edges of a vertex beyond which their circles do not tell where they meet."""
ROUND_OFF: float = 1e-7
"""How far outside the set a point of its border may be by round-off."""
AT_ONCE = 4096
"""Vertices whose points are tried at once."""


class Features(NamedTuple):
    """What of a surface can touch: indices start at 0, arrays as in `geometry.Geometry`, and their cones.

    A half angle below 0 means that nothing touches the feature.
    """

    triangle: np.ndarray  # (T, 3)
    triangle_edge: np.ndarray  # (T, 3)
    owns: np.ndarray  # (T, 6) 0 or 1
    face_axis: np.ndarray  # (T, 3), zeros where a triangle has no area
    vertex_axis: np.ndarray  # (V, 3)
    vertex_angle: np.ndarray  # (V,) rad
    edge_axis: np.ndarray  # (E, 3)
    edge_angle: np.ndarray  # (E,) rad


def vertex_cones(vertex: np.ndarray, edge: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Half angles (V,) rad of the cones of vertices (V, 3) with edges (E, 2) around given axes (V, 3); -1 where nothing touches."""
    along = unit_vectors(vertex[edge[:, 1]] - vertex[edge[:, 0]])
    ends, leaving = edge.T.ravel(), np.concatenate([along, -along])
    order = np.argsort(ends, kind="stable")
    degree = np.bincount(ends, minlength=len(vertex))
    first = np.cumsum(degree) - degree
    out = np.full(len(vertex), np.pi)
    for d in range(2, MOST_EDGES + 1):
        alike = np.flatnonzero(degree == d)
        for start in range(0, len(alike), AT_ONCE):
            v = alike[start : start + AT_ONCE]
            out[v] = _largest_angles(leaving[order[first[v, None] + np.arange(d)]], axis[v])
    return out


def _largest_angles(u: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Half angles (m,) of the cones around axes (m, 3) of vertices with d edges along u (m, d, 3)."""
    i, j = np.triu_indices(u.shape[1], 1)
    g = np.einsum("mik,mik->mi", u[:, i], u[:, j])
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = (u[:, i] + u[:, j]) * (TAU / (1.0 + g))[:, :, None]
        square = (1.0 - 2.0 * TAU * TAU / (1.0 + g)) / (1.0 - g * g)
        aside = np.cross(u[:, i], u[:, j]) * np.sqrt(square)[:, :, None]  # not a number where two circles do not meet
    across = unit_vectors(axis[:, None] - np.einsum("mdk,mk->md", u, axis)[:, :, None] * u) * np.sqrt(1.0 - TAU * TAU)
    points = np.concatenate([middle + aside, middle - aside, TAU * u + across, TAU * u - across], axis=1)
    with np.errstate(invalid="ignore"):
        # One product after another: a sum over three numbers at a time is slow.
        x, y, z = (points[:, :, None, k] * u[:, None, :, k] for k in range(3))
        inside = (x + y + z <= TAU + ROUND_OFF).all(axis=2)
    cosine = np.where(inside, np.einsum("mpk,mk->mp", np.nan_to_num(points), axis), 2.0).min(axis=1)
    angle = np.where(cosine > 1.5, -1.0, np.arccos(np.clip(cosine, -1.0, 1.0)))
    behind = (np.einsum("mdk,mk->md", u, -axis) <= TAU + ROUND_OFF).all(axis=1)
    return np.where(behind | (g.max(axis=1) > ALIKE) | ~axis.any(axis=1), np.pi, angle)


def edge_cones(edge_normal: np.ndarray, convex: np.ndarray, hidden: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes (E, 3) and half angles (E,) rad of edges with normals (E, 2, 3); nothing touches those that are hidden (E,)."""
    axis = unit_vectors(edge_normal.sum(axis=1))
    half = np.arccos(np.clip(np.einsum("ek,ek->e", axis, edge_normal[:, 0]), -1.0, 1.0))
    # The normals of a sheet that is folded back add up to round-off.
    clear = convex & (np.linalg.norm(edge_normal.sum(axis=1), axis=1) > ROUND_OFF)
    return axis, np.where(hidden, -1.0, np.where(clear, half + EDGE_SLACK, np.pi))


def node_cones(features: Features, start: np.ndarray, child: np.ndarray) -> np.ndarray:
    """Cones (N, 11) of nodes; start (N,): the first triangle of each; child (N,): its left child, -1 for a leaf.

    Columns: axis; cosine and sine of the half angle; least and greatest component of a normal along each axis.
    """
    total, centre, half = np.zeros((len(start), 3)), np.zeros((len(start), 3)), np.zeros(len(start))
    leaves = np.flatnonzero(child < 0)
    leaves = leaves[np.argsort(start[leaves])]
    _cones_of_leaves(features, leaves, start[leaves], (total, centre, half))
    # Nodes stand level by level: those of the next level begin with the first child of this one.
    begins = [0]
    while (parents := child[begins[-1] :][child[begins[-1] :] >= 0]).size:
        begins.append(int(parents[0]))
    for begin, end in zip(reversed(begins[:-1]), reversed(begins[1:]), strict=True):
        nodes = begin + np.flatnonzero(child[begin:end] >= 0)
        left = child[nodes]
        total[nodes] = total[left] + total[left + 1]
        centre[nodes] = unit_vectors(total[nodes])
        for part in (left, left + 1):
            cosine = np.einsum("nk,nk->n", centre[part], centre[nodes])
            half[nodes] = np.maximum(half[nodes], np.arccos(np.clip(cosine, -1.0, 1.0)) + half[part])
    half = np.where(centre.any(axis=1), np.minimum(half + ROUND_OFF, np.pi), np.pi)
    # A normal is at an angle from  theta - a  to  theta + a  to a coordinate axis which is theta from that of the cone.
    theta = np.arccos(np.clip(centre, -1.0, 1.0))
    least, greatest = np.cos(np.minimum(theta + half[:, None], np.pi)), np.cos(np.maximum(theta - half[:, None], 0.0))
    return np.column_stack([centre, np.cos(half), np.where(half < np.pi, np.sin(half), 0.0), least, greatest])


def _cones_of_leaves(features: Features, leaves: np.ndarray, first: np.ndarray, out: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Write sum of axes, axis and half angle of leaves whose triangles begin at `first`, which rises, into the three arrays `out`."""
    owns, triangle, edge = features.owns.astype(bool), features.triangle, features.triangle_edge
    axis = np.concatenate([features.face_axis[:, None], features.vertex_axis[triangle], features.edge_axis[edge]], axis=1)
    faces = np.where(features.face_axis.any(axis=1), 0.0, np.pi)[:, None]
    vertices = np.where(owns[:, :3], features.vertex_angle[triangle], -1.0)
    angle = np.concatenate([faces, vertices, np.where(owns[:, 3:], features.edge_angle[edge], -1.0)], axis=1)
    there = angle >= 0.0
    total = np.add.reduceat(np.where(there[:, :, None], axis, 0.0).sum(axis=1), first)
    centre = unit_vectors(total)
    mine = np.repeat(centre, np.diff(first, append=len(triangle)), axis=0)
    reach = np.where(there, np.arccos(np.clip(np.einsum("tfk,tk->tf", axis, mine), -1.0, 1.0)) + angle, 0.0).max(axis=1)
    for array, values in zip(out, (total, centre, np.maximum.reduceat(reach, first)), strict=True):
        array[leaves] = values


def every_direction(num_nodes: int) -> np.ndarray:
    """Cones (N, 11) that hold all directions."""
    return np.tile([0.0, 0.0, 0.0, -1.0, 0.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0], (num_nodes, 1))


def unit_vectors(vectors: np.ndarray) -> np.ndarray:
    """Return unit vectors (..., 3) along vectors; zero for those too short to have a direction."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(lengths, np.finfo(np.float64).tiny)
