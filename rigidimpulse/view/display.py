"""Display geometry of shapes: triangles with vertex normals, smooth where the surface is round, sharp at its edges.

Sphere, capsule and cylinder are lathed: a profile (r, z) with outward normals (n_r, n_z), turned about z. Other shapes
show the very triangles that collide. A corner of a triangle takes the mean normal of the faces around its vertex that
lie within `CREASE` of its own face, weighted by their angle there (Thürmer & Wüthrich 1998); corners of one vertex that
come out alike share it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.mesh_colors import PLAIN
from rigidimpulse.core.triangles import unique_edges
from rigidimpulse.scene.shape import Shape

CREASE = np.radians(35.0)
SEGMENTS = 64
"""Corners of a full turn."""
LARGEST_FAN = 512
"""Faces around one vertex above which its corners are not smoothed: their comparison grows with the square."""
LEAST_SQUARE = 5.0
"""m, least half side of the square that stands for a half space."""
PLAIN_BYTE = round(255 * PLAIN)
NORMAL_STEPS = 2.0**12
"""Corners of a vertex share it if their normals agree to one part in this many."""


class DisplayMesh(NamedTuple):
    """Triangles to draw, in the shape's own frame."""

    vertices: np.ndarray  # (v, 3) m
    faces: np.ndarray  # (f, 3)
    normals: np.ndarray  # (v, 3) unit, outward
    colors: np.ndarray | None = None  # (v, 3) uint8 as people see them, None: of one colour that is chosen elsewhere
    open: bool = False  # it has edges at which one sees its inside


def display_mesh(shape: Shape, segments: int = SEGMENTS) -> DisplayMesh | None:
    """Return the triangles of a shape; of a compound all together; None if there are none (half spaces).

    Args:
        shape: any shape.
        segments: corners of a full turn of round shapes, at least 8.

    """
    meshes = []
    for part in shape.parts_flat():
        if part.shape.kind != "half_space":
            mesh = _single(part.shape, segments)
            turned = mesh._replace(vertices=part.position + mesh.vertices @ part.rotation.T, normals=mesh.normals @ part.rotation.T)
            meshes.append(turned)
    return joined_meshes(meshes) if meshes else None


def joined_meshes(meshes: list[DisplayMesh]) -> DisplayMesh:
    """Return several meshes, at least one, as one; those without colours are grey beside those with some."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    painted = any(mesh.colors is not None for mesh in meshes)
    return DisplayMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([_colors_or_plain(mesh) for mesh in meshes]) if painted else None,
        any(mesh.open for mesh in meshes),
    )


def _colors_or_plain(mesh: DisplayMesh) -> np.ndarray:
    return np.full(mesh.vertices.shape, PLAIN_BYTE, np.uint8) if mesh.colors is None else mesh.colors


def has_one_color(mesh: DisplayMesh) -> bool:
    """Whether a mesh has no colours of its own, or the same everywhere."""
    return mesh.colors is None or bool(np.all(mesh.colors == mesh.colors[0]))


def display_planes(shape: Shape) -> list[tuple[np.ndarray, float]]:
    """Return unit normal (3,) and offset (m) of every half space of a shape, in the shape's frame."""
    planes = []
    for part in shape.parts_flat():
        if part.shape.kind == "half_space":
            normal, offset = part.shape.plane()
            turned = part.rotation @ normal
            planes.append((turned, float(offset + turned @ part.position)))
    return planes


def display_square(normal: np.ndarray, offset: float, half: float) -> DisplayMesh:
    """Return a square that stands for a plane; half: m, half its side, unless that is less than `LEAST_SQUARE`."""
    across = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    across /= np.linalg.norm(across)
    along, half = np.cross(normal, across), max(half, LEAST_SQUARE)
    corners = [offset * normal + half * (a * across + b * along) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return DisplayMesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), np.tile(normal, (4, 1)))


def _single(shape: Shape, segments: int) -> DisplayMesh:
    """Return the triangles of a shape that is neither a compound nor a half space."""
    if shape.kind == "sphere":
        angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, segments // 2 + 1)
        return _lathe(shape.radius * _circle(angle), _circle(angle), segments)
    if shape.kind == "capsule":
        angle = np.linspace(0.0, 0.5 * np.pi, segments // 4 + 1)
        upper = shape.radius * _circle(angle) + [0.0, 0.5 * shape.height]
        normal = _circle(angle)
        mirror = np.array([1.0, -1.0])
        return _lathe(np.concatenate([upper[::-1] * mirror, upper]), np.concatenate([normal[::-1] * mirror, normal]),
                      segments)  # fmt: skip
    if shape.kind == "cylinder":
        r, z = shape.radius, 0.5 * shape.height
        profile = np.array([[0.0, -z], [r, -z], [r, -z], [r, z], [r, z], [0.0, z]])
        normal = np.array([[0.0, -1.0], [0.0, -1.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
        return _lathe(profile, normal, segments)
    if shape.colors is not None:
        assert shape.vertices is not None and shape.faces is not None
        return shade_pieces([(shape.vertices, shape.faces, shape.colors)])
    surface = shape.surface()
    return shade(np.asarray(surface.vertices, dtype=np.float64), np.asarray(surface.faces))._replace(open=not surface.closed)


def _circle(angle: np.ndarray) -> np.ndarray:
    """Return the points (k, 2) of the unit circle."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _lathe(profile: np.ndarray, normal: np.ndarray, segments: int) -> DisplayMesh:
    """Return the profile (k, 2) with normals (k, 2), both (r, z) and running upwards, turned about z."""
    turn = _circle(2.0 * np.pi * np.arange(segments) / segments)

    def turned(points: np.ndarray) -> np.ndarray:
        level = np.broadcast_to(points[:, None, 1:], (len(points), segments, 1))
        return np.concatenate([points[:, None, :1] * turn, level], axis=2).reshape(-1, 3)

    lower = np.arange(len(profile) - 1)[:, None] * segments + np.arange(segments)
    after = np.roll(lower, -1, axis=1)
    upper, upper_after = lower + segments, after + segments
    faces = np.stack([np.stack([lower, after, upper_after], 2), np.stack([lower, upper_after, upper], 2)], axis=2)
    step = np.linalg.norm(np.diff(profile, axis=0), axis=1) > 0.0
    round_off = 1e-12 * float(np.abs(profile).max())
    keep = np.stack([step & (profile[:-1, 0] > round_off), step & (profile[1:, 0] > round_off)], axis=1)
    kept = faces[np.broadcast_to(keep[:, None, :], faces.shape[:3])]
    return DisplayMesh(turned(profile), kept, turned(normal))


def shade_pieces(pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray | None]]) -> DisplayMesh:
    """Return meshes (vertices, faces, colours of corners or None) as one; its normals are smooth across their seams."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _, _ in pieces[:-1]])
    faces = np.concatenate([faces + start for (_, faces, _), start in zip(pieces, starts, strict=True)])
    unique, index = np.unique(np.concatenate([vertices for vertices, _, _ in pieces]), axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    painted = [np.full((len(own), 3, 3), PLAIN_BYTE, np.uint8) if colors is None else colors for _, own, colors in pieces]
    plain = all(colors is None for _, _, colors in pieces)
    mesh = shade(unique, faces[proper], None if plain else np.concatenate(painted)[proper])
    return mesh._replace(open=bool(np.any(unique_edges(faces[proper], len(unique)).count % 2 == 1)))


def shade(vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None = None) -> DisplayMesh:
    """Return the triangles (f, 3) of the vertices (v, 3) with normals; a vertex on a crease, or of several colours, becomes several.

    Args:
        vertices: (v, 3) m.
        faces: (f, 3).
        colors: (f, 3, 3) uint8 of the corners, None: none.

    """
    corners = vertices[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    face_normal = _unit(np.cross(sides[:, 0], -sides[:, 2]))
    cosine = np.einsum("fkj,fkj->fk", _unit(sides), -_unit(np.roll(sides, 1, axis=1)))
    weight = np.arccos(np.clip(cosine, -1.0, 1.0)).ravel()
    normal = np.repeat(face_normal, 3, axis=0)
    own, other = _corner_pairs(faces, len(vertices))
    smooth = np.einsum("ij,ij->i", normal[own], normal[other]) >= np.cos(CREASE)
    own, other = own[smooth], other[smooth]
    total = np.zeros_like(normal)
    for axis in range(3):
        total[:, axis] = np.bincount(own, weight[other] * normal[other, axis], minlength=len(normal))
    total = np.where(np.any(total != 0.0, axis=1)[:, None], _unit(total), normal)
    rounded = np.round(total * NORMAL_STEPS).astype(np.int64)
    painted = [] if colors is None else [colors.reshape(-1, 3)]
    key = np.column_stack([faces.ravel(), rounded, *painted])
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    shades = None if colors is None else painted[0][first]
    return DisplayMesh(vertices[faces.ravel()[first]], index.reshape(-1, 3), total[first], shades)


def _corner_pairs(faces: np.ndarray, num_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Return all ordered pairs of triangle corners at the same vertex, each corner with itself included.

    Corner 3 i + k is corner k of face i.
    """
    vertex = faces.ravel()
    order = np.argsort(vertex, kind="stable")
    count = np.bincount(vertex, minlength=num_vertices)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    fan = np.where(count > LARGEST_FAN, 1, count)[vertex]  # a corner of too large a fan is paired with itself alone
    own = np.repeat(np.arange(len(vertex)), fan)
    place = np.arange(len(own)) - np.repeat(np.cumsum(fan) - fan, fan)
    other = np.where(count[vertex[own]] > LARGEST_FAN, own, order[(first[vertex[own]] + place) % len(vertex)])
    return own, other


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return the vectors of the last axis with length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
