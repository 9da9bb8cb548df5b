"""Makes the smaller shapes of a scene, see `smaller_shapes`: once, when its bodies are first sub-stepped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, CompiledShape, Geometry, Primitive, build_geometry, joined
from rigidimpulse.collision.manifold.convexity import convex_polyhedra, inner_radii, several_polyhedra
from rigidimpulse.collision.manifold.dispatch import MOST_HULL_CORNERS
from rigidimpulse.collision.manifold.inset_surface import moved_in
from rigidimpulse.collision.manifold.smaller_shapes import LEVELS, PARTS, SHRINK, SmallerShapes
from rigidimpulse.collision.normal_cones import unit_vectors
from rigidimpulse.core.portable import dot

DEPTH = 0.012
"""d of inset surfaces, as a part of the radius that encloses a body."""
THIN = 0.25
"""Part of the radius of a ball, capsule or cylinder in a compound that d may be."""
ROUND_OFF: float = 1e-9
"""Part of d by which a face may be less than d farther in: the coordinates are rounded."""


def make_smaller_shapes(
    shapes: Sequence[CompiledShape], geometry: Geometry, depths: np.ndarray, moves: np.ndarray, of_body: np.ndarray, order: np.ndarray
) -> SmallerShapes:
    """Make the smaller shapes of a scene.

    Args:
        shapes: all shapes of the scene; geometry: their arrays.
        depths: (s,) m, `convexity.convex_depths`.
        moves: (s,) bool, shapes of bodies that move freely.
        of_body: (n,) shape of each body, by index; order: (n,) indices by rank.

    """
    number, kinds = len(shapes), _kinds_of(shapes, geometry, depths, moves)
    levels = _Levels(np.tile(np.arange(number), (LEVELS, 1)), np.zeros((LEVELS, number)), np.zeros((LEVELS, number)), np.zeros(number))
    made = _make_levels(shapes, kinds, levels) + _make_inset(shapes, geometry, kinds, moves, levels)
    built = _built(geometry, [smaller for _, _, smaller in made])
    back, growth = _lost(geometry, built, made)
    for k, (s, level, _) in enumerate(made):
        levels.shape[level:, s] = number + k
        levels.taken_off[level:, s] = levels.depth[s] if levels.depth[s] > 0.0 else _most_taken_off(built, back, growth, number + k)
    if not kinds.beside_others:
        built, back, growth = _add_shrunk(geometry, kinds, levels, (built, back, growth))
    own = of_body[order]
    taken_off, slack = np.ascontiguousarray(levels.taken_off[:, own]), np.ascontiguousarray(levels.slack[:, own])
    return SmallerShapes(
        built, number, levels.shape[:, of_body].ravel(), back, growth, taken_off, slack, levels.depth[own], kinds.convex[own],
        kinds.deeper[own], kinds.takes_up[own],
    )  # fmt: skip


class _Kinds(NamedTuple):
    """What smaller shapes s shapes of a scene need."""

    inner: np.ndarray  # (s,) m, inner radii
    convex: np.ndarray  # (s,) bool: convex polyhedra
    drum: np.ndarray  # (s,) bool: one cylinder
    takes_up: np.ndarray  # (s,) bool, see `SmallerShapes`
    deeper: np.ndarray  # (s,) bool: one cylinder, or a convex polyhedron that moves
    beside_others: bool  # polyhedra meet shapes beside which they are asked about as smaller ones


class _Levels(NamedTuple):
    """The levels of s shapes, written to as they are made; see `SmallerShapes`."""

    shape: np.ndarray  # (L, s)
    slack: np.ndarray  # (L, s) m
    taken_off: np.ndarray  # (L, s) m
    depth: np.ndarray  # (s,) m


def _kinds_of(shapes: Sequence[CompiledShape], geometry: Geometry, depths: np.ndarray, moves: np.ndarray) -> _Kinds:
    """The kinds of the shapes; arguments as of `make_smaller_shapes`."""
    convex, inner, takes_up = convex_polyhedra(geometry, depths), inner_radii(geometry, depths), np.zeros(len(shapes), bool)
    for s, compiled in enumerate(shapes):
        one = compiled.primitives[0]
        takes_up[s] = len(compiled.primitives) == 1 and (one.kind == CYLINDER or one.radius >= max(SHRINK * inner[s], 1e-300))
    drum = takes_up & (geometry.kind[geometry.shape_first[:-1]] == CYLINDER)
    return _Kinds(inner, convex, drum, takes_up, drum | (moves & convex), _asked_beside_others(geometry, convex, takes_up))


def _make_levels(shapes: Sequence[CompiledShape], kinds: _Kinds, levels: _Levels) -> list[tuple[int, int, CompiledShape]]:
    """Shapes of several d, (shape, level, smaller one), of cylinders, and of polyhedra that meet what they are smaller beside."""
    made = []
    for s in np.flatnonzero(kinds.drum | (kinds.deeper & kinds.beside_others)).tolist():
        one, slack = shapes[s].primitives[0], levels.slack[:, s]
        slack[1:] = np.array(PARTS) * _radius(one) if kinds.drum[s] else np.array((PARTS[1], *PARTS[1:])) * kinds.inner[s]
        made += [(s, level, _level(one, float(slack[level]))) for level in range(1, LEVELS) if slack[level] > slack[level - 1]]
    return made


def _make_inset(
    shapes: Sequence[CompiledShape], geometry: Geometry, kinds: _Kinds, moves: np.ndarray, levels: _Levels
) -> list[tuple[int, int, CompiledShape]]:
    """Inset surfaces of what moves and is neither convex nor one ball, capsule or cylinder: (shape, 1, smaller one)."""
    made = []
    for s in np.flatnonzero(moves & ~kinds.deeper).tolist():
        primitives = shapes[s].primitives
        one, single = primitives[0], len(primitives) == 1
        if not single or len(one.faces):
            levels.depth[s] = d = _inset_depth(geometry, s, shapes[s])
            made.append((s, 1, CompiledShape(tuple(_inset(p, d) for p in primitives))))
    return made


def _built(geometry: Geometry, made: list[CompiledShape]) -> Geometry:
    """The shapes of the scene, and those that were made of them behind them."""
    return joined(geometry, build_geometry(made)) if made else geometry


def _add_shrunk(
    geometry: Geometry, kinds: _Kinds, levels: _Levels, built: tuple[Geometry, np.ndarray, np.ndarray]
) -> tuple[Geometry, np.ndarray, np.ndarray]:
    """Add the one level of polyhedra that meet nothing they are smaller beside: shrunk about their centres of mass.

    No new trees and normals are made for them: these take long for many hulls. built: shapes, `back`, and `growth`.
    """
    before, back, growth = built
    alike, behind = np.flatnonzero(kinds.deeper & ~kinds.drum), len(before.vertex)
    levels.shape[1:, alike], levels.slack[1:, alike] = len(before.shape_first) - 1 + alike, SHRINK * kinds.inner[alike]
    everything = joined(before, _shrunk(geometry))
    back = np.pad(back, ((0, len(everything.vertex) - behind), (0, 0)))
    growth = np.pad(growth, ((0, len(everything.kind) - len(growth)), (0, 0)))
    back[behind:, :3] = SHRINK * geometry.vertex
    for s in alike.tolist():
        levels.taken_off[1:, s] = _most_taken_off(everything, back, growth, int(levels.shape[1, s]))
    return everything, back, growth


def _asked_beside_others(geometry: Geometry, convex: np.ndarray, takes_up: np.ndarray) -> bool:
    """Whether polyhedra (s,) bool meet shapes beside which they are asked about as smaller ones: meshes, or polyhedra of many corners."""
    half_space = geometry.kind[geometry.shape_first[:-1]] == HALF_SPACE
    known = convex | takes_up | half_space | several_polyhedra(geometry)
    return not known.all() or int(np.diff(geometry.vertex_first).max(initial=0)) > MOST_HULL_CORNERS


def _shrunk(geometry: Geometry) -> Geometry:
    """All shapes shrunk about the centres of mass of their bodies."""
    f = 1.0 - SHRINK
    frame = geometry.frame * [f, f, f, 1.0, 1.0, 1.0, f]
    return geometry._replace(
        vertex=f * geometry.vertex, frame=frame, radius=f * geometry.radius, node_min=f * geometry.node_min, node_max=f * geometry.node_max,
        bound_centre=f * geometry.bound_centre, bound_radius=f * geometry.bound_radius,
    )  # fmt: skip


def _level(p: Primitive, d: float) -> CompiledShape:
    """A convex polyhedron or a cylinder with a surface that is d m farther in along each axis of the body."""
    if p.kind == CYLINDER:
        # Not less of the radius: the prism for deep contacts, see `penetrating.SIDES`, must be farther out than this.
        return CompiledShape((_shorter(p, d, max(d, SHRINK * p.radius)),))
    return CompiledShape((replace(p, vertices=p.vertices * (1.0 - _parts_lost(p, d))),))


def _parts_lost(p: Primitive, d: float) -> np.ndarray:
    """Parts (3,) of its coordinates that a convex polyhedron loses so that all its faces are d m farther in, or more.

    With d / h_k along its axes, corners of boxes move least. But where faces are at an angle to the axes, such corners may come out of the
    true shape: irregular flat hulls fell through valleys. With d / r along all axes, r the least distance of a face, they never do. The
    parts are the mean of both, with as much of the second as is needed.
    """
    corners = p.vertices[p.faces]
    normal = unit_vectors(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    corners, normal = corners[np.any(normal != 0.0, axis=1)], normal[np.any(normal != 0.0, axis=1), None]
    along_axes = d / np.minimum(p.vertices.max(axis=0), -p.vertices.min(axis=0))
    in_by = dot(corners * along_axes, normal)
    offset = dot(corners, normal)
    alike = d / float(offset.min())
    lacks = in_by < d * (1.0 - ROUND_OFF)
    share = float(((d - in_by[lacks]) / (alike * offset[lacks] - in_by[lacks])).max(initial=0.0))
    return along_axes + share * (alike - along_axes)


def _inset_depth(geometry: Geometry, s: int, compiled: CompiledShape) -> float:
    """Depth d of the inset surface of shape s, m."""
    first, last = int(geometry.shape_first[s]), int(geometry.shape_first[s + 1])
    reach = np.linalg.norm(geometry.bound_centre[first:last], axis=1) + geometry.bound_radius[first:last]
    # A ball, capsule or cylinder can give up only a part of its radius, which limits the depth of all.
    return min([DEPTH * float(reach.max()), *(THIN * _radius(p) for p in compiled.primitives if not len(p.faces))])


def _radius(p: Primitive) -> float:
    """Radius of a ball or capsule, of a cylinder this or half its height if that is less, m."""
    return min(p.radius, float(p.frame[6])) if p.kind == CYLINDER else p.radius


def _inset(p: Primitive, d: float) -> Primitive:
    """The inset surface of a primitive, at a depth of d m."""
    if p.kind == CYLINDER:
        return _shorter(p, d, d)
    return replace(p, vertices=moved_in(p, d)) if len(p.faces) else replace(p, radius=p.radius - d)


def _shorter(cylinder: Primitive, half: float, radius: float) -> Primitive:
    """A cylinder whose half height and radius are less by so much, m."""
    return replace(cylinder, radius=cylinder.radius - radius, frame=np.append(cylinder.frame[:6], cylinder.frame[6] - half))


def _lost(true: Geometry, everything: Geometry, made: list[tuple[int, int, CompiledShape]]) -> tuple[np.ndarray, np.ndarray]:
    """What the smaller shapes that were made of the true ones have lost: `back` and `growth` of `SmallerShapes`."""
    back, growth, p = np.zeros((len(everything.vertex), 4)), np.zeros((len(everything.kind), 2)), len(true.kind)
    for s, _, smaller in made:
        for q in range(int(true.shape_first[s]), int(true.shape_first[s]) + len(smaller.primitives)):
            mine = slice(int(everything.vertex_first[p]), int(everything.vertex_first[p + 1]))
            back[mine, :3] = true.vertex[true.vertex_first[q] : true.vertex_first[q + 1]] - everything.vertex[mine]
            back[mine, 3] = true.radius[q] - everything.radius[p]
            if true.kind[q] == CYLINDER:
                growth[p] = true.frame[q, 6] / everything.frame[p, 6] - 1.0, true.radius[q] / everything.radius[p] - 1.0
            p += 1
    return back, growth


def _most_taken_off(everything: Geometry, back: np.ndarray, growth: np.ndarray, s: int) -> float:
    """Largest |m| of a smaller shape of one primitive, m."""
    p = int(everything.shape_first[s])
    lost = growth[p] * [everything.frame[p, 6], everything.radius[p]]
    moved = np.linalg.norm(back[everything.vertex_first[p] : everything.vertex_first[p + 1], :3], axis=1)
    return float(max(np.linalg.norm(lost), moved.max(initial=0.0)))
