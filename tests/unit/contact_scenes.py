"""Shapes, poses and checks for the tests of contacts and least distances.

Unless said otherwise bodies are about 1 m in size and lie within 2 m of the origin: a point goes through two rotations
and two translations, each with an error of a few eps * 2 m, so positions and gaps are good to ROUND_OFF = 2e-14 m, and
normals that come from a surface to ROUND_OFF, however small the gap. Normals between two points carry
ROUND_OFF / distance.
"""

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from rigidimpulse.collision.geometry import HALF_SPACE, ROUND, CompiledShape, Primitive, Shapes, build_geometry
from rigidimpulse.collision.manifold.contact_points import Contacts as Buffers
from rigidimpulse.collision.manifold.dispatch import SCRATCH_ROWS, Posed, pair_contacts, pair_gap
from rigidimpulse.collision.manifold.kept_features import FEW_ROWS, make_contact_scratch
from rigidimpulse.collision.manifold.reduce import reduce_contacts

ROUND_OFF = 2e-14
VERTEX_FACE, FACE_VERTEX, EDGE_EDGE, CORNER, PLANE = range(5)
CAPACITY = 2000

IDENTITY = (np.zeros(3), np.eye(3))


def mesh(surface, scale=1.0):
    """A ROUND primitive of a trimesh surface."""
    vertices = np.array(surface.vertices, dtype=float) * scale
    return Primitive(ROUND, vertices=vertices, faces=np.array(surface.faces, dtype=np.int64))


def box(x=1.0, y=1.0, z=1.0, at=(0.0, 0.0, 0.0)):
    return trimesh.creation.box((x, y, z), transform=trimesh.transformations.translation_matrix(at))


def sphere(radius, at=(0.0, 0.0, 0.0)):
    return Primitive(ROUND, radius, vertices=np.array([at], dtype=float))


def capsule(radius, height):
    """A capsule along x; `height` is that of its cylindrical part."""
    return Primitive(ROUND, radius, vertices=np.array([[-0.5 * height, 0.0, 0.0], [0.5 * height, 0.0, 0.0]]))


def half_space(normal=(0.0, 0.0, 1.0), offset=0.0):
    return Primitive(HALF_SPACE, frame=np.array([*normal, offset, 0.0, 0.0, 0.0]))


def prism(polygon, depth):
    """The prism over a polygon (counter-clockwise in x, z), from y = -depth / 2 to depth / 2."""
    polygon = np.asarray(polygon, dtype=float)
    n = len(polygon)
    front = np.column_stack([polygon[:, 0], np.full(n, -0.5 * depth), polygon[:, 1]])
    vertices = np.concatenate([front, front + [0.0, depth, 0.0]])
    caps = np.array(_triangulated(polygon))
    i = np.arange(n)
    j = (i + 1) % n
    sides = np.concatenate([np.column_stack([i, i + n, j]), np.column_stack([j, i + n, j + n])])
    return trimesh.Trimesh(vertices, np.concatenate([caps, caps[:, ::-1] + n, sides]), process=False)


def _triangulated(polygon):
    """Ears cut from a simple polygon."""
    left, triangles = list(range(len(polygon))), []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = (polygon[left[m % len(left)]] for m in (k - 1, k, k + 1))
            others = [polygon[m] for m in left if m not in (left[k - 1], left[k], left[(k + 1) % len(left)])]
            if _turn(a, b, c) > 0 and not any(
                _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0 for p in others
            ):
                triangles.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
                del left[k]
                break
    return [*triangles, tuple(left)]


def _turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


L_NOTCH = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]


class Scene:
    """Shapes (each a list of primitives) and the buffers to ask for their contacts."""

    def __init__(self, *shapes, scratch_rows=SCRATCH_ROWS, capacity=CAPACITY):
        self.geometry = build_geometry([CompiledShape(tuple(s if isinstance(s, list) else [s])) for s in shapes])
        self.scratch = make_contact_scratch.py_func(scratch_rows, 0, FEW_ROWS)
        self.real = np.full((capacity, 10), np.nan)
        self.integer = np.full((capacity, 5), -7, dtype=np.int64)
        self.shapes = Shapes(self.geometry, np.arange(len(shapes)))
        self.buffers = Buffers(self.real, self.integer, self.scratch)

    def contacts(self, pose_a, pose_b, margin, shapes=(0, 1), reduced=False):
        a, b = shapes
        (x_a, R_a), (x_b, R_b) = pose_a, pose_b
        count = pair_contacts(self.shapes, Posed(a, x_a, R_a), Posed(b, x_b, R_b), margin, self.buffers, 0)
        if reduced:
            count = reduce_contacts(self.real, self.integer, 0, count)
        return Contacts(self.real[:count].copy(), self.integer[:count].copy())

    def gap(self, pose_a, pose_b, limit=10.0, shapes=(0, 1)):
        out = np.zeros(7)
        (x_a, R_a), (x_b, R_b) = pose_a, pose_b
        return pair_gap(self.geometry, Posed(shapes[0], x_a, R_a), Posed(shapes[1], x_b, R_b), limit, out), out[:3], out[3:6]


class Contacts:
    def __init__(self, real, integer):
        self.point_a, self.point_b, self.normal, self.gap = real[:, :3], real[:, 3:6], real[:, 6:9], real[:, 9]
        self.kind, self.feature_a, self.feature_b = integer[:, 2], integer[:, 3], integer[:, 4]

    def __len__(self):
        return len(self.gap)

    def check(self):
        """The two points are `gap` apart along the normal, which is a unit vector."""
        np.testing.assert_allclose(np.linalg.norm(self.normal, axis=1), 1.0, rtol=0, atol=ROUND_OFF)
        along = np.sum((self.point_b - self.point_a) * self.normal, axis=1)
        scale = 1.0 + np.abs(self.point_a).max(initial=0.0)
        np.testing.assert_allclose(along, self.gap, rtol=0, atol=ROUND_OFF * scale)
        return self


def random_pose(rng, reach=0.5):
    return rng.uniform(-reach, reach, 3), Rotation.random(random_state=rng).as_matrix()


def placed(common, position, rotation=None):
    """A pose given relative to a common one."""
    x, R = common
    return x + R @ np.asarray(position, dtype=float), R if rotation is None else R @ rotation


def turn(axis, angle):
    return Rotation.from_rotvec(angle * np.asarray(axis, dtype=float) / np.linalg.norm(axis)).as_matrix()


def body_points(points, pose):
    """World points in the frame of a pose."""
    return (np.asarray(points) - pose[0]) @ pose[1]


def matched(found, expected, tolerance):
    """Tell whether two sets of points agree, one to one."""
    found, expected = np.atleast_2d(found), np.atleast_2d(expected)
    if len(found) != len(expected):
        return False
    distance = np.linalg.norm(found[:, None] - expected[None], axis=2)
    return np.all(distance.min(axis=0) <= tolerance) and np.all(distance.min(axis=1) <= tolerance)


def clipped(subject, clip):
    """Intersection of two convex polygons (k, 2), counter-clockwise (Sutherland and Hodgman)."""
    for a, b in zip(clip, np.roll(clip, -1, axis=0), strict=True):
        side = [_turn(a, b, p) for p in subject]
        kept = []
        for k in range(len(subject)):
            p, q, s, t = subject[k - 1], subject[k], side[k - 1], side[k]
            if s * t < 0:
                kept.append(p + (q - p) * s / (s - t))
            if t >= 0:
                kept.append(q)
        subject = np.array(kept)
    return subject


SQUARE = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def roof(at=0.0):
    """A prism with its ridge along y at z = 0 (angle 90 degrees)."""
    return prism([(-1.0, -1.0), (1.0, -1.0), (0.0, at)], 2.0)


def spot_like(seed):
    """A random concave surface: an icosphere with its vertices moved in and out."""
    rng = np.random.default_rng(seed)
    surface = trimesh.creation.icosphere(1, 0.5)
    surface.vertices = np.array(surface.vertices) * rng.uniform(0.5, 1.2, (len(surface.vertices), 1))
    return surface


def approached(scene, pose_a, direction, R_b, gap, shapes=(0, 1)):
    """Move b along -direction from afar until the gap is as wanted: each step is a little less than the least gap."""
    distance = 8.0
    for _ in range(200):
        pose_b = (pose_a[0] + distance * direction, R_b)
        now = scene.gap(pose_a, pose_b, 20.0, shapes)[0]
        if now <= 1.5 * gap:
            return pose_b
        distance -= now - gap
        if distance < 0.0:
            return None
    return None
