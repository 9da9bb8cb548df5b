r"""Bodies that went through the surface of another one, found at recorded frames by other means than those of the engine.

An open surface has no inside, so no frame shows that a body has passed it. Its way does. A point that is inside a body never crosses the
surface of another one in a sound run. Such points are looked at in the frame of the surface. From the frame at x_0 to that at x_1,

    L = 2 max(|v_0|, |v_1|, |x_1 - x_0| / dt) dt

is taken as the longest way that the point can have gone: it stayed in the ball of radius L / 2 about the middle of x_0 and x_1. If no
border of the surface is in this ball, and the segment from x_0 to x_1 crosses the surface an odd number of times, then every way from x_0
to x_1 in the ball does so. Where a border is in it, the body may have gone around or through a hole, and nothing is known.

Frames between which the whole way is less than half the depth rho of the point in its body are one segment: so bodies that rest cost
nothing. Bodies that start in a surface are not looked at until they are clear of it: such an overlap is reported where the run starts, and
moved apart to either side. What is closed is left to `overlap`: a body that enters it is inside at some frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rigidimpulse.collision.geometry import Geometry
from rigidimpulse.collision.segment_crossings import crossings
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.engine.measure.depth import distance_from_triangles, inner_points, middles_of
from rigidimpulse.engine.measure.overlap import LATE, REMEDY
from rigidimpulse.engine.measure.record import Fault, RunRecord
from rigidimpulse.model.world import World

KIND = "went through a surface"
FASTER: float = 2.0
"""Highest speed between two frames, of that at their ends: a body may be hit and slowed down again."""
STRETCH: float = 0.5
"""Way, of the depth of a point in its body, up to which several frames are one segment: the point cannot have reached the surface."""
CLEAR: float = 0.9
"""Distance from the surface, of the depth of the point in its body, from which on the body is not in the surface."""
AT_ONCE: int = 200_000
"""Places of points that are computed at once."""


@dataclass(frozen=True, eq=False)
class _Surface:
    """An open surface."""

    primitive: int  # in the geometry of the world
    triangles: np.ndarray  # (t, 3, 3) m
    middles: np.ndarray  # (4, t) m, see `depth.middles_of`
    border: np.ndarray  # (e, 2, 3) m


@dataclass(frozen=True, eq=False)
class _Ways:
    """Ways of p points in the frame of a surface, at f frames."""

    body: np.ndarray  # (p,) whose points they are
    rho: np.ndarray  # (p,) m, their depths in these bodies
    place: np.ndarray  # (p, f, 3) m
    longest: np.ndarray  # (p, f - 1) m, L of each interval; 0 of those that do not count


@dataclass(frozen=True, eq=False)
class _Segments:
    """Stretches of ways, c of them."""

    point: np.ndarray  # (c,) of which point
    first: np.ndarray  # (c,) frames
    last: np.ndarray  # (c,)
    longest: np.ndarray  # (c,) m, the sum of L

    def part(self, which: np.ndarray) -> _Segments:
        """Those of this mask."""
        return _Segments(self.point[which], self.first[which], self.last[which], self.longest[which])


def tunnelling_faults(record: RunRecord) -> list[Fault]:
    """A fault for each pair of a body and an open surface that it went through, at the first time."""
    world = record.world
    if not world.can_collide or world.accuracy.impact_time in LATE:
        return []
    surfaces = {shape: found for shape in range(len(world.shapes)) if (found := _surfaces(world, shape))}
    faults = []
    for body in np.flatnonzero(np.isin(world.shape_of_body, list(surfaces))).tolist():
        for ways in _ways(record, body):
            for surface in surfaces[int(world.shape_of_body[body])]:
                faults += _faults(record, body, surface, ways)
    return faults


def _faults(record: RunRecord, owner: int, surface: _Surface, ways: _Ways) -> list[Fault]:
    """The faults of some bodies at one surface of a body."""
    times, names = record.frames.times, record.world.names
    faults: dict[int, Fault] = {}
    found = _passages(record.world, surface, ways)
    for c in np.argsort(found.last, kind="stable").tolist():
        body = int(ways.body[found.point[c]])
        if body in faults or not _was_clear(surface, ways, int(found.point[c]), int(found.first[c])):
            continue
        time, depth = float(times[found.last[c]]), float(ways.rho[found.point[c]])
        text = f"the body went through the surface of the other one, and was inside it by {depth:.3g} m or more"
        faults[body] = Fault(time, KIND, (names[body], names[owner]), depth, f"{text}; {REMEDY}")
    return list(faults.values())


def _passages(world: World, surface: _Surface, ways: _Ways) -> _Segments:
    """The segments that surely cross a surface."""
    segments = _segments(ways)
    begin, end = ways.place[segments.point, segments.first], ways.place[segments.point, segments.last]
    through = crossings(world.geometry, surface.primitive, begin, end) % 2 == 1
    for c in np.flatnonzero(through).tolist():
        middle, radius = 0.5 * (begin[c] + end[c]), 0.5 * float(segments.longest[c])
        through[c] = not _meets_ball(surface.border, middle, radius)
    return segments.part(through)


def _meets_ball(border: np.ndarray, middle: np.ndarray, radius: float) -> bool:
    """Whether a border (e, 2, 3) comes into a ball."""
    begin, along = border[:, 0], border[:, 1] - border[:, 0]
    squared = np.sum(along * along, axis=1)
    share = np.divide(np.sum((middle - begin) * along, axis=1), squared, out=np.zeros(len(border)), where=squared > 0.0)
    nearest = begin + np.clip(share, 0.0, 1.0)[:, None] * along
    return bool(np.any(np.linalg.norm(nearest - middle, axis=1) <= radius))


def _was_clear(surface: _Surface, ways: _Ways, point: int, first: int) -> bool:
    """Whether a point was away from the surface at the start of the run, or where the segment begins."""
    distances = [distance_from_triangles(surface.triangles, surface.middles, place) for place in ways.place[point, [0, first]]]
    return max(distances) > CLEAR * ways.rho[point]


def _segments(ways: _Ways) -> _Segments:
    """Stretches of the ways: intervals, and several of them as one where the point moves little."""
    points, intervals = ways.longest.shape
    total = np.zeros((points, intervals + 1))
    np.cumsum(ways.longest, axis=1, out=total[:, 1:])
    # Points of a surface have no depth: each interval in which they move counts.
    stretch = np.where(ways.rho > 0.0, STRETCH * ways.rho, 1.0)[:, None]
    number = np.floor(total / stretch)
    changed = np.where(ways.rho[:, None] > 0.0, number[:, 1:] != number[:, :-1], ways.longest > 0.0)
    kept = np.zeros(total.shape, bool)
    kept[:, [0, -1]] = True
    kept[:, 1:] |= changed
    kept[:, :-1] |= changed
    point, frame = np.nonzero(kept)
    here = np.flatnonzero(point[1:] == point[:-1])
    longest = total[point[here + 1], frame[here + 1]] - total[point[here], frame[here]]
    return _Segments(point[here], frame[here], frame[here + 1], longest).part(longest > 0.0)


def _ways(record: RunRecord, owner: int) -> Iterator[_Ways]:
    """Ways of points of all bodies that may not go through a surface of a body, some at a time."""
    world = record.world
    bodies = np.flatnonzero(np.arange(world.num_bodies) != owner)
    meets = world.dynamic[bodies] | world.dynamic[owner]
    bodies = bodies[meets & ~world.is_apart(np.minimum(bodies, owner), np.maximum(bodies, owner))]
    points = [inner_points(world.shapes[shape]) for shape in world.shape_of_body[bodies].tolist()]
    body, points = np.repeat(bodies, [len(these) for these in points]), np.concatenate([np.zeros((0, 4)), *points])
    length = max(AT_ONCE // len(record.frames.times), 1)
    for begin in range(0, len(body), length):
        yield _ways_of(record, owner, body[begin : begin + length], points[begin : begin + length])


def _ways_of(record: RunRecord, owner: int, body: np.ndarray, points: np.ndarray) -> _Ways:
    """Ways of points (p, 4) of bodies (p,), see `inner_points`, in the frame of the owner of a surface."""
    frames = record.frames
    arm = np.einsum("fpij,pj->fpi", to_matrix(frames.orientation[:, body]), points[:, :3])
    apart = frames.position[:, body] - frames.position[:, owner, None] + arm
    velocity = frames.velocity[:, body] + np.cross(frames.angular_velocity[:, body], arm)
    velocity -= frames.velocity[:, owner, None] + np.cross(frames.angular_velocity[:, owner, None], apart)
    place = np.einsum("fji,fpj->pfi", to_matrix(frames.orientation[:, owner]), apart)
    speed, dt = np.linalg.norm(velocity, axis=2).T, np.diff(frames.times)
    moved = np.linalg.norm(np.diff(place, axis=1), axis=2)
    longest = FASTER * np.maximum(np.maximum(speed[:, 1:], speed[:, :-1]) * dt, moved)
    let_go = record.world.dynamic & (frames.times[:-1, None] >= record.release)
    longest[~(let_go[:, body] | let_go[:, owner, None]).T] = 0.0
    return _Ways(body, points[:, 3], place, longest)


def _surfaces(world: World, shape: int) -> list[_Surface]:
    """The open surfaces of a shape."""
    geometry, found = world.geometry, []
    for k, primitive in enumerate(world.shapes[shape].primitives):
        number = int(geometry.shape_first[shape]) + k
        if len(primitive.faces) and not geometry.closed[number]:
            triangles = primitive.vertices[primitive.faces]
            found.append(_Surface(number, triangles, middles_of(triangles), _border(geometry, number)))
    return found


def _border(geometry: Geometry, primitive: int) -> np.ndarray:
    """Edges (e, 2, 3) of an odd number of triangles of a primitive. Those whose triangles only run the wrong way round are no border."""
    triangles = slice(geometry.triangle_first[primitive], geometry.triangle_first[primitive + 1])
    edges = geometry.triangle_edge[triangles].ravel()
    return geometry.vertex[geometry.edge[np.flatnonzero(np.bincount(edges) % 2 == 1)]]
