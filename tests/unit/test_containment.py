"""Point in solid: exact against independent oracles, also for points in line with vertices and edges.

Oracles: the generalised winding number (sum of solid angles over 4 pi: 1 inside, 0 outside) for random points;
membership of unit cells for solids put together from a lattice, where every ray runs through vertices and edges;
closed forms for curved primitives. A ray parity that counts a shared edge twice, or not at all, fails for about half
of the lattice points in line with it.
"""

from __future__ import annotations

import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.collision.containment import plane_orientation, point_in_convex, points_inside, space_orientation
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, CompiledShape, Primitive, build_geometry

SPOT = Path(__file__).parents[2] / "assets" / "meshes" / "spot.obj"


def geometry_of(*primitives):
    return build_geometry([CompiledShape(tuple(primitives))])


def mesh_primitive(mesh):
    return Primitive(ROUND, vertices=np.array(mesh.vertices), faces=np.array(mesh.faces))


def winding_number(triangles, points):
    """Return the winding number (k,) of triangles (t, 3, 3) about points (k, 3), by Van Oosterom & Strackee 1983."""
    angle = np.zeros(len(points))
    for start in range(0, len(points), 64):
        a, b, c = np.moveaxis(triangles[None] - points[start : start + 64, None, None], 2, 0)
        la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
        volume = np.sum(a * np.cross(b, c), axis=2)
        dots = la * lb * lc + np.sum(a * b, axis=2) * lc + np.sum(b * c, axis=2) * la + np.sum(c * a, axis=2) * lb
        angle[start : start + 64] = 2.0 * np.sum(np.arctan2(volume, dots), axis=1)
    return angle / (4.0 * np.pi)


def lattice_solid(cells):
    """Return a triangle mesh of the union of unit cells (given by their lowest corners), all coordinates integers."""
    cells = {tuple(cell) for cell in cells}
    vertices, faces, index = [], [], {}
    for cell in sorted(cells):
        for axis in range(3):
            for side in range(2):
                neighbour = list(cell)
                neighbour[axis] += 2 * side - 1
                if tuple(neighbour) in cells:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                quad = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    corner = list(cell)
                    corner[axis] += side
                    corner[u] += du
                    corner[v] += dv
                    quad.append(index.setdefault(tuple(corner), len(vertices)))
                    if quad[-1] == len(vertices):
                        vertices.append(corner)
                if not side:
                    quad.reverse()
                faces += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    return np.array(vertices, dtype=float), np.array(faces)


L_SHAPE = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (0, 2, 0), (0, 0, 1)]
RING = [(i, j, 0) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
STAIRS = [(i, j, k) for i in range(3) for j in range(3) for k in range(3) if i + j + k < 3]


def star(seed=1):
    """Return a spiky star-shaped mesh: an icosphere whose vertices have radii between 0.2 and 1."""
    mesh = trimesh.creation.icosphere(subdivisions=2)
    radii = np.random.default_rng(seed).uniform(0.2, 1.0, len(mesh.vertices))
    return trimesh.Trimesh(mesh.vertices * radii[:, None], mesh.faces, process=False)


@pytest.mark.parametrize("cells", [[(0, 0, 0)], L_SHAPE, RING, STAIRS], ids=["box", "L", "ring", "stairs"])
def test_lattice_points_in_line_with_vertices_and_edges(cells):
    """Every point of a grid of pitch 1/4 looks along edges, vertices, diagonals; truth: it lies in a closed cell."""
    vertices, faces = lattice_solid(cells)
    grid = np.stack(np.meshgrid(*[np.arange(-1.0, 4.01, 0.25)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    truth = np.zeros(len(grid), dtype=bool)
    for cell in cells:
        truth |= np.all((grid >= np.array(cell)) & (grid <= np.array(cell) + 1.0), axis=1)
    geometry = geometry_of(Primitive(ROUND, vertices=vertices, faces=faces))
    assert geometry.closed[0]
    assert np.array_equal(points_inside(geometry, 0, grid), truth)
    # the same lattice off the dyadic numbers: points strictly between lattice planes keep their truth
    scale = 0.1
    geometry = geometry_of(Primitive(ROUND, vertices=vertices * scale, faces=faces))
    clear = np.all(np.abs(grid - np.round(grid)) > 0.1, axis=1) | ~truth & np.any((grid < -0.1) | (grid > 3.1), axis=1)
    assert np.array_equal(points_inside(geometry, 0, grid[clear] * scale), truth[clear])


@pytest.mark.parametrize("name", ["torus", "star", "capsule", "spot"])
def test_random_points_against_the_winding_number(name):
    if name == "spot":
        if not SPOT.exists():
            pytest.skip("mesh of spot not present")
        mesh = trimesh.load(SPOT, process=True, force="mesh")
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    else:
        mesh = {
            "torus": lambda: trimesh.creation.torus(1.0, 0.4, major_sections=16, minor_sections=8),
            "star": star,
            "capsule": lambda: trimesh.creation.capsule(1.0, 0.5),
        }[name]()
    geometry = geometry_of(mesh_primitive(mesh))
    assert geometry.closed[0]
    low, high = mesh.bounds
    points = np.random.default_rng(7).uniform(low - 0.05, high + 0.05, (1_000, 3))
    winding = winding_number(mesh.triangles, points)
    assert np.all(np.abs(winding - np.round(winding)) < 1e-6)
    inside = points_inside(geometry, 0, points)
    assert np.array_equal(inside, np.round(winding) == 1)
    assert 20 < inside.sum() < 980


@pytest.mark.parametrize(
    "make", [lambda: trimesh.creation.torus(1.0, 0.4, major_sections=16, minor_sections=8), star], ids=["torus", "star"]
)
def test_rays_through_vertices_and_edges(make):
    """Points behind and before each vertex and each edge's middle, along the ray: y and z agree to the last bit."""
    mesh = make()
    vertices = np.round(np.array(mesh.vertices) * 2**20) / 2**20  # so that midpoints are exact
    mesh = trimesh.Trimesh(vertices, mesh.faces, process=False)
    middles = 0.5 * (vertices[mesh.edges_unique[:, 0]] + vertices[mesh.edges_unique[:, 1]])
    targets = np.concatenate([vertices, middles])
    rng = np.random.default_rng(3)
    points = np.concatenate([targets - [[shift, 0.0, 0.0]] for shift in rng.uniform(-1.0, 1.0, 4)])
    winding = winding_number(mesh.triangles, points)
    clear = np.abs(winding - np.round(winding)) < 1e-6
    assert clear.mean() > 0.95
    inside = points_inside(geometry_of(mesh_primitive(mesh)), 0, points[clear])
    assert np.array_equal(inside, np.round(winding[clear]) == 1)


def test_vertices_and_exact_midpoints_lie_on_the_surface():
    mesh = star()
    vertices = np.round(np.array(mesh.vertices) * 2**20) / 2**20
    geometry = geometry_of(Primitive(ROUND, vertices=vertices, faces=np.array(mesh.faces)))
    edges = mesh.edges_unique
    assert points_inside(geometry, 0, vertices).all()
    assert points_inside(geometry, 0, 0.5 * (vertices[edges[:, 0]] + vertices[edges[:, 1]])).all()


def test_convex_hull_behind_all_planes():
    rng = np.random.default_rng(5)
    hull = trimesh.convex.convex_hull(rng.normal(size=(40, 3)))
    geometry = geometry_of(mesh_primitive(hull))
    points = rng.normal(size=(2_000, 3))
    planes = np.einsum("tj,ktj->kt", hull.face_normals, points[:, None] - hull.triangles[None, :, 0])
    truth = np.all(planes <= 0.0, axis=1)
    assert np.array_equal([point_in_convex(geometry, 0, tuple(point)) for point in points], truth)
    assert np.array_equal(points_inside(geometry, 0, points), truth)
    assert 100 < truth.sum() < 1_900


def test_signs_of_determinants_are_exact():
    """Nearly degenerate arguments, one unit in the last place apart, against rational arithmetic."""
    rng = np.random.default_rng(11)
    terms = np.empty(192)
    for _ in range(300):
        a, b = rng.normal(size=3), rng.normal(size=3)
        c = a + 0.5 * (b - a) + rng.integers(-1, 2, 3) * 1e-16
        p = a + rng.uniform(-2.0, 2.0) * (b - a) + rng.integers(-1, 2, 3) * 1e-16
        fa, fb, fc, fp = ([Fraction(float(x)) for x in point] for point in (a, b, c, p))
        plane = (fb[1] - fa[1]) * (fp[2] - fa[2]) - (fb[2] - fa[2]) * (fp[1] - fa[1])
        u, v, w = ([q[k] - fp[k] for k in range(3)] for q in (fa, fb, fc))
        space = sum(u[k] * (v[(k + 1) % 3] * w[(k + 2) % 3] - v[(k + 2) % 3] * w[(k + 1) % 3]) for k in range(3))
        assert plane_orientation(*a[1:], *b[1:], *p[1:], terms) == (plane > 0) - (plane < 0)
        assert space_orientation(tuple(a), tuple(b), tuple(c), tuple(p), terms) == (space > 0) - (space < 0)


def test_curved_primitives_and_unions():
    rng = np.random.default_rng(13)
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    points = rng.uniform(-2.0, 2.0, (2_000, 3))
    sphere = Primitive(ROUND, 0.7, vertices=np.array([[0.1, 0.2, 0.3]]))
    capsule = Primitive(ROUND, 0.4, vertices=np.array([-axis, axis]))
    cylinder = Primitive(CYLINDER, 0.5, frame=np.array([0.1, 0.0, 0.0, *axis, 0.8]))
    half_space = Primitive(HALF_SPACE, frame=np.array([*axis, -1.5, 0.0, 0.0, 0.0]))
    in_sphere = np.linalg.norm(points - [0.1, 0.2, 0.3], axis=1) <= 0.7
    along = points @ axis
    in_capsule = np.linalg.norm(points - np.clip(along, -1.0, 1.0)[:, None] * axis, axis=1) <= 0.4
    shifted = points - [0.1, 0.0, 0.0]
    height = shifted @ axis
    in_cylinder = (np.abs(height) <= 0.8) & (np.linalg.norm(shifted - height[:, None] * axis, axis=1) <= 0.5)
    in_half_space = along <= -1.5
    truths = [in_sphere, in_capsule, in_cylinder, in_half_space]
    primitives = [sphere, capsule, cylinder, half_space]
    for primitive, truth in zip(primitives, truths, strict=True):
        assert np.array_equal(points_inside(geometry_of(primitive), 0, points), truth)
        assert truth.any() and not truth.all()
    assert np.array_equal(points_inside(geometry_of(*primitives), 0, points), np.any(truths, axis=0))


def test_open_meshes_hold_nothing_and_overlapping_parts_do_not_cancel():
    vertices, faces = lattice_solid([(0, 0, 0)])
    centre = [[0.5, 0.5, 0.5], [1.25, 0.5, 0.5]]
    assert not points_inside(geometry_of(Primitive(ROUND, vertices=vertices, faces=faces[:-1])), 0, centre).any()
    both = Primitive(
        ROUND,
        vertices=np.concatenate([vertices, vertices + [0.25, 0, 0]]),
        faces=np.concatenate([faces, faces + len(vertices)]),
    )
    assert points_inside(geometry_of(both), 0, [*centre, [0.1, 0.5, 0.5]])[[0, 2]].all()
    hollow = Primitive(
        ROUND,
        vertices=np.concatenate([4.0 * vertices, vertices + 1.0]),
        faces=np.concatenate([faces, faces[:, ::-1] + len(vertices)]),
    )
    assert np.array_equal(points_inside(geometry_of(hollow), 0, [[1.5, 1.5, 1.5], [0.5, 0.5, 0.5]]), [False, True])


def test_cost_grows_with_the_depth_of_the_tree_only():
    mesh = trimesh.creation.icosphere(subdivisions=5)  # 20,480 triangles
    geometry = geometry_of(mesh_primitive(mesh))
    points = np.random.default_rng(17).uniform(-1.0, 1.0, (2_000, 3))
    points_inside(geometry, 0, points[:1])
    start = time.perf_counter()
    inside = points_inside(geometry, 0, points)
    assert time.perf_counter() - start < 2_000 * 100e-6  # all triangles of one point take more than 200 us
    assert np.array_equal(
        inside[np.abs(np.linalg.norm(points, axis=1) - 1.0) > 1e-2],
        (np.linalg.norm(points, axis=1) < 1.0)[np.abs(np.linalg.norm(points, axis=1) - 1.0) > 1e-2],
    )


def test_points_in_shapes_as_a_user_asks():
    ring = ri.Shape.from_trimesh(trimesh.creation.torus(1.0, 0.25))
    assert np.array_equal(ri.contains(ring, [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.3]]), [True, False, False])
    # Far from the origin: the frame is the shape's own, not that of its centre of mass.
    upright = (1.0, 0.0, 0.0, 0.0)
    parts = [(ri.Shape.box((1.0, 1.0, 1.0)), (5.0, 0.0, 0.0), upright), (ri.Shape.sphere(0.5), (7.0, 0.0, 0.0), upright)]
    assert np.array_equal(ri.contains(ri.Shape.compound(parts), [[5.4, 0.4, 0.4], [7.4, 0.4, 0.4], [0.0, 0.0, 0.0]]), [True, False, False])
    with pytest.raises(ri.SceneError):
        ri.contains(ri.Shape.sphere(-1.0), [[0.0, 0.0, 0.0]])
