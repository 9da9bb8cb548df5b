"""Separation and overlap measured with FCL, against proofs, brute force and closed forms.

For two convex bodies a separation proves itself: its points lie on both surfaces, |q - p| = gap, and the support gap
along the normal, min_B n.x - max_A n.x, is the gap too. For others the oracle looks at every pair of features. FCL
works on coordinates of size s in double precision, so errors are a few 1e-16 s; 1e-13 s is asked for. Its iterative
solvers (1e-6 absolute) would fail by seven orders of magnitude.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Primitive
from rigidimpulse.collision.manifold.cylinder import cylinder_triangle_distance
from rigidimpulse.core.errors import SceneError

EXACT = 1e-13
PACKAGE = Path(__file__).parents[2] / "rigidimpulse"
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def of_mesh(solid):
    return Primitive(ROUND, vertices=np.array(solid.vertices, dtype=float), faces=np.array(solid.faces))


BALL = Primitive(ROUND, 0.4, vertices=np.array([[0.1, 0.0, 0.0]]))
BOX = of_mesh(trimesh.creation.box([1.0, 0.8, 0.6]))
ROD = Primitive(ROUND, 0.3, vertices=np.array([[0.0, 0.1, -0.5], [0.0, 0.1, 0.6]]))
CAN = Primitive(CYLINDER, 0.4, frame=np.array([0.05, 0.0, -0.1, 0.6, 0.0, 0.8, 0.5]))
HULL = of_mesh(trimesh.convex.convex_hull(np.random.default_rng(3).normal(size=(20, 3)) * 0.4))
RING = of_mesh(trimesh.creation.torus(0.8, 0.25, major_sections=16, minor_sections=8))
GROUND = Primitive(HALF_SPACE, frame=np.array([0.0, 0.6, 0.8, 0.1, 0.0, 0.0, 0.0]))
SHAPES = {"ball": BALL, "box": BOX, "rod": ROD, "can": CAN, "hull": HULL, "ring": RING, "ground": GROUND}
CONVEX = ["ball", "box", "rod", "can", "hull", "ground"]


def narrowphase(*primitives):
    return Narrowphase([CompiledShape((primitive,)) for primitive in primitives])


def random_pose(rng, reach=1.0):
    return rng.normal(size=3) * reach, Rotation.random(random_state=rng).as_quat(scalar_first=True)


def rotation_of(pose):
    return Rotation.from_quat(pose[1], scalar_first=True)


def greatest(primitive, pose, n):
    """Return the greatest n . x over a convex primitive (for a half space: if n is its normal)."""
    rotation = rotation_of(pose)
    if primitive.kind == HALF_SPACE:
        normal = rotation.apply(primitive.frame[:3])
        assert np.linalg.norm(normal - n) < 1e-12
        return primitive.frame[3] + n @ pose[0]
    if primitive.kind == CYLINDER:
        axis = rotation.apply(primitive.frame[3:6])
        reach = primitive.radius * np.linalg.norm(np.cross(axis, n)) + primitive.frame[6] * abs(axis @ n)
        return (rotation.apply(primitive.frame[:3]) + pose[0]) @ n + reach
    return ((rotation.apply(primitive.vertices) + pose[0]) @ n).max() + primitive.radius


def outside(primitive, pose, point):
    """How far a point is outside a convex primitive, at least along one direction."""
    x = rotation_of(pose).inv().apply(point - pose[0])
    if primitive.kind == HALF_SPACE:
        return x @ primitive.frame[:3] - primitive.frame[3]
    if primitive.kind == CYLINDER:
        y = x - primitive.frame[:3]
        height = y @ primitive.frame[3:6]
        across = np.linalg.norm(y - height * primitive.frame[3:6])
        return max(abs(height) - primitive.frame[6], across - primitive.radius)
    if len(primitive.faces):
        corners = primitive.vertices[primitive.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return (np.sum(normals * (x - corners[:, 0]), axis=1) / np.linalg.norm(normals, axis=1)).max()
    a, b = primitive.vertices[0], primitive.vertices[-1]
    fraction = np.clip((x - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0.0, 1.0)
    return np.linalg.norm(x - a - fraction * (b - a)) - primitive.radius


def segment_distances(p, d, q, e):
    """Return the distances (n, m) of segments p + s d (n) and q + t e (m): ends against segments, and crossings."""
    p, d, q, e = p[:, None], d[:, None], q[None], e[None]

    def to_segment(x, a, v):
        fraction = np.clip(np.sum((x - a) * v, axis=-1) / np.maximum(np.sum(v * v, axis=-1), 1e-300), 0.0, 1.0)
        return np.linalg.norm(x - a - fraction[..., None] * v, axis=-1)

    best = np.min([to_segment(p, q, e), to_segment(p + d, q, e), to_segment(q, p, d), to_segment(q + e, p, d)], axis=0)
    c = np.cross(d, e)
    squared = np.maximum(np.sum(c * c, axis=-1), 1e-300)
    s = np.sum(np.cross(q - p, e) * c, axis=-1) / squared
    t = np.sum(np.cross(q - p, d) * c, axis=-1) / squared
    crossing = np.abs(np.sum((q - p) * c, axis=-1)) / np.sqrt(squared)
    inner = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0) & (squared > 1e-200)
    return np.where(inner, np.minimum(best, crossing), best)


def brute_force_gap(first, pose_a, second, pose_b):
    """Return the distance of two surfaces that do not cross, less the radii, from every pair of features."""

    def parts(primitive, pose):
        vertices = rotation_of(pose).apply(primitive.vertices) + pose[0]
        last = len(vertices) - 1
        faces = primitive.faces if len(primitive.faces) else np.array([[0, last, last]])
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        return vertices, vertices[faces], vertices[edges[:, 0]], vertices[edges[:, 1]] - vertices[edges[:, 0]]

    if first.kind == CYLINDER:
        first, pose_a, second, pose_b = second, pose_b, first, pose_a
    vertices_a, triangles_a, tails_a, sides_a = parts(first, pose_a)
    if second.kind == CYLINDER:
        rotation, out = rotation_of(pose_b), np.zeros(9)
        axis, centre = rotation.apply(second.frame[3:6]), rotation.apply(second.frame[:3]) + pose_b[0]
        can = (centre, axis, second.frame[6], second.radius)
        return min(cylinder_triangle_distance(*can, triangle, out) for triangle in triangles_a) - first.radius
    vertices_b, triangles_b, tails_b, sides_b = parts(second, pose_b)
    least = segment_distances(tails_a, sides_a, tails_b, sides_b).min()
    for vertices, triangles in ((vertices_a, triangles_b), (vertices_b, triangles_a)):
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        proper = np.linalg.norm(normal, axis=1) > 0.0
        for vertex in vertices if proper.any() else ():
            near = trimesh.triangles.closest_point(triangles[proper], np.tile(vertex, (proper.sum(), 1)))
            least = min(least, np.linalg.norm(near - vertex, axis=1).min())
    return least - first.radius - second.radius


def apart_by(narrow, a, pose_a, b, pose_b, gap, direction):
    """Move b along a direction until the gap is the wanted one; return its pose."""
    position = pose_b[0] + 8.0 * direction
    for _ in range(100):
        distance = narrow.separation(a, pose_a, b, (position, pose_b[1])).gap
        if abs(distance - gap) <= 1e-3 * gap or distance > 20.0:
            break
        position = position - (distance - gap) * direction
    return position, pose_b[1]


@pytest.mark.parametrize("first", CONVEX)
@pytest.mark.parametrize("second", CONVEX)
def test_separation_of_convex_bodies_proves_itself(first, second):
    if first == second == "ground":
        pytest.skip("two half spaces have a test of their own")
    rng = np.random.default_rng(5)
    a, b = SHAPES[first], SHAPES[second]
    narrow = narrowphase(a, b)
    num_checked = 0
    for trial in range(25):
        pose_a, pose_b = random_pose(rng), random_pose(rng, 1.5)
        direction = rng.normal(size=3)
        if first == "ground" or second == "ground":
            normal = (
                rotation_of(pose_a).apply(a.frame[:3]) if first == "ground" else -rotation_of(pose_b).apply(b.frame[:3])
            )
            direction = normal + 0.3 * direction
        direction /= np.linalg.norm(direction)
        gap = 10.0 ** rng.uniform(-9, 0)
        if trial % 2:
            pose_b = apart_by(narrow, 0, pose_a, 1, pose_b, gap, direction)
        s = narrow.separation(0, pose_a, 1, pose_b)
        assert narrow.overlap(0, pose_a, 1, pose_b) == (s.gap <= 0.0)
        if s.gap <= 0.0:
            continue
        num_checked += 1
        size = 1.0 + np.abs(pose_a[0]).max() + np.abs(pose_b[0]).max()
        assert np.linalg.norm(s.point_b - s.point_a - s.gap * s.normal) < EXACT * size
        assert outside(a, pose_a, s.point_a) < EXACT * size and outside(b, pose_b, s.point_b) < EXACT * size
        # the normal comes from the points: it is off by their round-off over the gap
        bound = -greatest(b, pose_b, -s.normal) - greatest(a, pose_a, s.normal)
        assert s.gap - bound < EXACT * size * (1.0 + 0.1 * size / s.gap)
        back = narrow.separation(1, pose_b, 0, pose_a)
        assert abs(back.gap - s.gap) < EXACT * size
    assert num_checked >= 10


@pytest.mark.parametrize("other", ["ball", "box", "rod", "can", "hull", "ring"])
def test_separation_from_a_concave_mesh_against_all_pairs_of_features(other):
    rng = np.random.default_rng(6)
    narrow = narrowphase(RING, SHAPES[other])
    num_checked = 0
    for _ in range(12):
        pose_a, pose_b = random_pose(rng, 0.3), random_pose(rng, 0.7)
        s = narrow.separation(0, pose_a, 1, pose_b)
        assert narrow.overlap(0, pose_a, 1, pose_b) == (s.gap <= 0.0)
        if s.gap > 0.0:
            num_checked += 1
            assert abs(s.gap - brute_force_gap(RING, pose_a, SHAPES[other], pose_b)) < EXACT * 10.0
            assert np.linalg.norm(s.point_b - s.point_a - s.gap * s.normal) < EXACT * 10.0
    assert num_checked >= 3


def test_spheres_and_capsules_know_their_depth():
    narrow = narrowphase(BOX, BALL, ROD)
    still = (np.zeros(3), IDENTITY)
    s = narrow.separation(0, still, 1, (np.array([-0.1, 0.0, 0.65]), IDENTITY))
    assert abs(s.gap + 0.05) < 1e-15 and np.allclose(s.normal, [0.0, 0.0, 1.0], atol=1e-14)
    assert np.allclose(s.point_a, [0.0, 0.0, 0.3], atol=1e-15) and np.allclose(s.point_b, [0.0, 0.0, 0.25], atol=1e-15)
    s = narrow.separation(2, still, 1, (np.array([0.5, 0.1, 0.0]), IDENTITY))
    assert abs(s.gap + 0.1) < 1e-15 and np.allclose(s.normal, [1.0, 0.0, 0.0], atol=1e-14)
    s = narrow.separation(0, still, 1, (np.array([0.0, 0.0, 0.1]), IDENTITY))
    assert s.gap == 0.0 and np.isnan(s.point_a).all() and np.isnan(s.normal).all()


def test_half_spaces():
    floor = Primitive(HALF_SPACE, frame=np.array([0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0]))
    ceiling = Primitive(HALF_SPACE, frame=np.array([0.0, 0.0, -1.0, -2.0, 0.0, 0.0, 0.0]))
    narrow = narrowphase(floor, ceiling, BOX, CAN)
    still = (np.zeros(3), IDENTITY)
    s = narrow.separation(0, still, 1, still)
    assert s.gap == 1.5 and np.array_equal(s.normal, [0.0, 0.0, 1.0]) and s.point_a[2] == 0.5 and s.point_b[2] == 2.0
    assert narrow.overlap(0, still, 1, (np.array([0.0, 0.0, -1.6]), IDENTITY))
    assert not narrow.overlap(0, still, 1, still)
    assert narrow.separation(0, still, 0, still).gap == -np.inf
    s = narrow.separation(2, (np.array([0.0, 0.0, 0.7]), IDENTITY), 0, still)
    assert abs(s.gap + 0.1) < 1e-15 and np.array_equal(s.normal, [0.0, 0.0, -1.0])
    s = narrow.separation(0, still, 3, (np.array([0.0, 0.0, 0.9]), IDENTITY))
    assert abs(s.gap - (0.4 - 0.1 - 0.5 * 0.8 - 0.4 * 0.6)) < 1e-15


def test_one_inside_another_overlaps_and_the_hole_of_a_ring_does_not():
    small = of_mesh(trimesh.creation.box([0.1, 0.1, 0.1]))
    bead = Primitive(ROUND, 0.05, vertices=np.zeros((1, 3)))
    pin = Primitive(CYLINDER, 0.05, frame=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.05]))
    narrow = narrowphase(BOX, RING, small, bead, pin)
    still = (np.zeros(3), IDENTITY)
    for inner in (2, 3, 4):
        for first, second in ((0, inner), (inner, 0)):
            assert narrow.overlap(first, still, second, still)
            assert narrow.separation(first, still, second, still).gap <= 0.0
        assert not narrow.overlap(1, still, inner, still)
        assert narrow.overlap(1, still, inner, (np.array([0.8, 0.0, 0.0]), IDENTITY))
        assert abs(narrow.separation(1, still, inner, still).gap - 0.5) < 0.05
    sheet = Primitive(ROUND, vertices=BOX.vertices, faces=BOX.faces[:-1])
    assert not narrowphase(sheet, small).overlap(0, still, 1, still)


def test_part_of_a_compound_inside_another_body():
    far = np.array([[3.0, 0.0, 0.0]])
    pair = CompiledShape((Primitive(ROUND, 0.05, vertices=far), Primitive(ROUND, 0.05, vertices=np.zeros((1, 3)))))
    both = of_mesh(
        trimesh.util.concatenate(
            [
                trimesh.creation.box([0.1] * 3),
                trimesh.creation.box(
                    [0.1] * 3, transform=np.array([[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
                ),
            ]
        )
    )
    narrow = Narrowphase([CompiledShape((BOX,)), pair, CompiledShape((both,)), CompiledShape((both, GROUND))])
    still, aside = (np.zeros(3), IDENTITY), (np.array([-3.0, 0.0, 0.0]), IDENTITY)
    for shape in (1, 2):
        assert narrow.overlap(0, still, shape, still) and narrow.overlap(0, still, shape, aside)
        assert not narrow.overlap(0, still, shape, (np.array([-1.5, 0.0, 0.0]), IDENTITY))
    high = (np.array([-1.5, 0.0, 9.0]), IDENTITY)
    assert not narrow.overlap(0, high, 2, still)
    assert abs(narrow.separation(0, high, 3, still).gap - narrow.separation(0, high, 2, still).gap) > 1.0


@pytest.mark.parametrize("scale", [1e-4, 1e-2, 1e4])
def test_scale_and_distance_from_the_origin_change_nothing(scale):
    """A tessellated centimetre box, and one a kilometre away: as exact as a metre box at the origin."""
    fine = trimesh.creation.box([1.0, 0.8, 0.6]).subdivide().subdivide().subdivide()
    rng = np.random.default_rng(8)
    narrow, large = narrowphase(of_mesh(fine), HULL), None
    fine.apply_scale(scale)
    large = narrowphase(of_mesh(fine), Primitive(ROUND, vertices=HULL.vertices * scale, faces=HULL.faces))
    shift = np.array([1e3, -2e3, 5e2]) * scale
    for _ in range(20):
        pose_a, pose_b = random_pose(rng, 0.1), random_pose(rng, 1.5)
        s = narrow.separation(0, pose_a, 1, pose_b)
        moved = [(pose[0] * scale + shift, pose[1]) for pose in (pose_a, pose_b)]
        t = large.separation(0, moved[0], 1, moved[1])
        assert (s.gap <= 0.0) == (t.gap <= 0.0)
        assert abs(t.gap - s.gap * scale) < 1e-11 * scale  # coordinates of 2e3 hold 2e-13


def test_touching_counts_as_overlap():
    narrow = narrowphase(BOX, BOX)
    still = (np.zeros(3), IDENTITY)
    assert narrow.overlap(0, still, 1, (np.array([1.0, 0.0, 0.0]), IDENTITY))
    assert narrow.overlap(0, still, 1, (np.array([1.0 - 1e-12, 0.0, 0.0]), IDENTITY))
    assert not narrow.overlap(0, still, 1, (np.array([1.0 + 1e-12, 0.0, 0.0]), IDENTITY))


def test_bad_input_is_refused_before_it_reaches_fcl():
    narrow = narrowphase(BOX, HULL)
    still = (np.zeros(3), IDENTITY)
    for position, orientation in (
        ([np.nan, 0.0, 0.0], IDENTITY),
        ([0.0, np.inf, 0.0], IDENTITY),
        (np.zeros(2), IDENTITY),
        (np.zeros(3), [np.nan, 0.0, 0.0, 0.0]),
        (np.zeros(3), np.zeros(4)),
        (np.zeros(3), [2.0, 0.0, 0.0, 0.0]),
    ):
        for question in (narrow.separation, narrow.overlap):
            with pytest.raises(ValueError, match=r"position|orientation"):
                question(0, still, 1, (np.array(position), np.array(orientation)))
    for vertices, faces in (
        (np.zeros((0, 3)), np.zeros((0, 3), np.int64)),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]])),
        (np.eye(3), np.array([[0, 1, 3]])),
        (np.eye(3), np.array([[0, 1, -1]])),
    ):
        with pytest.raises(SceneError):
            narrowphase(Primitive(ROUND, vertices=vertices, faces=faces))
    with pytest.raises(SceneError):
        Narrowphase([CompiledShape(())])


STORM = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
from scipy.spatial.transform import Rotation
from test_narrowphase import SHAPES, narrowphase
rng = np.random.default_rng(99)
names = list(SHAPES)
narrow = narrowphase(*SHAPES.values())
quarter = Rotation.create_group("O").as_quat(scalar_first=True)
count = 0
for trial in range({trials}):
    for a in range(len(names)):
        for b in range(len(names)):
            poses = []
            for _ in range(2):
                lattice = rng.random() < 0.5  # aligned, touching, coincident
                x = rng.integers(-2, 3, 3) * 0.5 if lattice else rng.normal(size=3)
                turn = Rotation.random(random_state=rng).as_quat(scalar_first=True)
                q = quarter[rng.integers(24)] if lattice else turn
                poses.append((np.asarray(x, dtype=float), q))
            s = narrow.separation(a, poses[0], b, poses[1])
            meets = narrow.overlap(a, poses[0], b, poses[1])
            assert not np.isnan(s.gap), (names[a], names[b], poses)
            assert meets == (s.gap <= 0.0) or abs(s.gap) < 1e-12, (names[a], names[b], poses, s, meets)
            assert s.gap <= 0.0 or abs(np.linalg.norm(s.point_b - s.point_a) - s.gap) < 1e-12
            count += 1
print(count)
"""


def test_thousands_of_poses_do_not_crash():
    """In a process of its own: a fault inside FCL is a failure of this test, not the end of all tests."""
    program = STORM.format(folder=str(Path(__file__).parent), trials=60)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2_000:]
    assert done.stdout.strip() == "2940"


WITH_FCL = {"collision/distance/fcl.py", "collision/distance/fcl_trees.py"}


def test_two_modules_touch_fcl_and_only_its_safe_part():
    safe = {
        "BVHModel",
        "CollisionObject",
        "CollisionRequest",
        "CollisionResult",
        "Contact",  # a type
        "DistanceRequest",
        "DistanceResult",
        "Transform",
        "collide",
        "distance",
    }
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text())
        imported = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                imported |= {name.name.split(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                imported.add(node.module.split(".")[0])
        assert ("fcl" in imported) == (path.relative_to(PACKAGE).as_posix() in WITH_FCL), path
        assert "trimesh.collision" not in path.read_text()
    for name in sorted(WITH_FCL):
        tree = ast.parse((PACKAGE / name).read_text())
        used = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.value.id == "fcl"}
        assert used <= safe
        keywords = {keyword.arg for node in ast.walk(tree) if isinstance(node, ast.Call) for keyword in node.keywords}
        assert not keywords & {"enable_signed_distance", "gst_type", "gjk_solver_type"}
