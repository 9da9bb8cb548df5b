"""The flat arrays of compiled shapes, against brute force over small and real meshes."""

from pathlib import Path

import numpy as np
import pytest

from rigidimpulse.collision.geometry import (
    CYLINDER,
    EDGE_BOUNDARY,
    EDGE_CAPSULE,
    EDGE_CONVEX,
    EDGE_HIDDEN,
    HALF_SPACE,
    LEAF_SIZE,
    ROUND,
    CompiledShape,
    Geometry,
    Primitive,
    build_geometry,
    compile_shape,
)
from rigidimpulse.scene.shape import Shape, rotation_matrix

SPOT = Path(__file__).parents[2] / "assets" / "meshes" / "spot.obj"


def build(*shapes: Shape) -> Geometry:
    return build_geometry([compile_shape(shape, np.zeros(3), np.eye(3)) for shape in shapes])


def grid(num: int, height=lambda x, y: 0.0 * x) -> Shape:
    """An open square of num x num cells of side 1, facing up."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(num + 1.0), np.arange(num + 1.0), indexing="ij"))
    cell = (np.arange(num)[:, None] * (num + 1) + np.arange(num)).ravel()
    a, b, c, d = cell, cell + num + 1, cell + num + 2, cell + 1
    return Shape.mesh(np.column_stack([x, y, height(x, y)]), np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]))


def subdivided_cube(num: int) -> Shape:
    """A cube of side num whose faces are grids of num x num cells."""
    square = grid(num)
    vertices, faces = [], []
    for k in range(3):
        for side in (0, 1):
            points = np.roll(square.vertices, k, axis=1).copy()
            points[:, (k + 2) % 3] = side * num
            faces.append((square.faces if side else square.faces[:, ::-1]) + len(points) * len(vertices))
            vertices.append(points)
    return Shape.mesh(np.concatenate(vertices), np.concatenate(faces))


def notch() -> Shape:
    """An L-shaped prism: one concave edge along z at (1, 1)."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)
    low, high = np.c_[outline, np.zeros(6)], np.c_[outline, np.ones(6)]
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    walls = [[[k, (k + 1) % 6, 6 + (k + 1) % 6], [k, 6 + (k + 1) % 6, 6 + k]] for k in range(6)]
    return Shape.mesh(np.r_[low, high], np.r_[cap[:, ::-1], cap + 6, np.array(walls).reshape(-1, 3)])


def meshes() -> list[Shape]:
    random = np.random.default_rng(3)
    bumpy = grid(7, lambda x, y: random.normal(0.0, 0.3, x.shape))
    return [Shape.box((1, 2, 3)), subdivided_cube(4), notch(), bumpy, Shape.convex_hull(random.normal(size=(60, 3)))]


@pytest.mark.parametrize("index", range(5))
def test_vertices_and_edges_have_one_owner_and_the_right_neighbours(index):
    g = build(meshes()[index])
    owners_of_vertex = np.zeros(len(g.vertex), int)
    owners_of_edge = np.zeros(len(g.edge), int)
    faces_of_edge: dict[int, list[int]] = {}
    for t, triangle in enumerate(g.triangle):
        for k in range(3):
            assert set(g.edge[g.triangle_edge[t, k]]) == {triangle[k], triangle[(k + 1) % 3]}
            owners_of_vertex[triangle[k]] += g.triangle_owns[t] >> k & 1
            owners_of_edge[g.triangle_edge[t, k]] += g.triangle_owns[t] >> (3 + k) & 1
            faces_of_edge.setdefault(int(g.triangle_edge[t, k]), []).append(t)
    assert np.all(owners_of_vertex == 1) and np.all(owners_of_edge == 1)
    assert len({tuple(sorted(edge)) for edge in g.edge.tolist()}) == len(g.edge)
    for e, faces in faces_of_edge.items():
        normals = {tuple(n) for n in g.edge_normal[e]}
        assert normals == {tuple(g.triangle_normal[t]) for t in faces}
        assert (g.edge_kind[e] == EDGE_BOUNDARY) == (len(faces) == 1)
    for v in range(len(g.vertex)):
        around = g.vertex_edge[g.vertex_edge_first[v] : g.vertex_edge_first[v + 1]]
        assert sorted(around) == np.flatnonzero((g.edge == v).any(axis=1)).tolist()


@pytest.mark.parametrize("index", range(5))
def test_normals_are_unit_and_follow_the_winding(index):
    g = build(meshes()[index])
    a, b, c = (g.vertex[g.triangle[:, k]] for k in range(3))
    area_vector = np.cross(b - a, c - a)
    assert np.allclose(np.linalg.norm(g.triangle_normal, axis=1), 1.0, rtol=0, atol=4e-16)
    assert np.all(np.sum(area_vector * g.triangle_normal, axis=1) > 0.0)


@pytest.mark.parametrize("index", range(5))
def test_edges_are_classed_by_the_opposite_corner(index):
    """A convex edge has the far corner of one face below the plane of the other: no sines, as used inside."""
    g = build(meshes()[index])
    for e in np.flatnonzero(g.edge_kind != EDGE_BOUNDARY):
        one, other = np.flatnonzero((g.triangle_edge == e).any(axis=1))
        corner = (set(g.triangle[other]) - set(g.edge[e])).pop()
        height = (g.vertex[corner] - g.vertex[g.edge[e, 0]]) @ g.triangle_normal[one]
        assert (g.edge_kind[e] == EDGE_CONVEX) == (height < -1e-9)


def test_flat_faces_keep_only_their_true_corners_and_edges():
    g = build(subdivided_cube(4))
    assert g.closed.tolist() == [True]
    assert sorted(g.vertex[g.vertex_corner].tolist()) == [[x, y, z] for x in (0, 4) for y in (0, 4) for z in (0, 4)]
    assert np.sum(g.edge_kind == EDGE_CONVEX) == 12 * 4  # twelve creases of four pieces
    assert np.sum(g.edge_kind == EDGE_HIDDEN) == len(g.edge) - 48


def test_concave_edge_is_hidden():
    g = build(notch())
    inner = [e for e in range(len(g.edge)) if np.all(g.vertex[g.edge[e], :2] == 1.0)]
    assert g.edge_kind[inner].tolist() == [EDGE_HIDDEN]
    assert np.sum(g.edge_kind == EDGE_CONVEX) == 18 - 1
    assert g.vertex_corner.all()


def test_open_surface_has_a_boundary_and_is_not_closed():
    g = build(grid(5))
    assert g.closed.tolist() == [False]
    assert np.sum(g.edge_kind == EDGE_BOUNDARY) == 20
    assert np.sum(g.vertex_corner) == 4


def test_inside_out_surface_is_not_closed():
    box = Shape.box(1.0).surface()
    assert build(Shape.mesh(box.vertices, box.faces[:, ::-1])).closed.tolist() == [False]


def test_edge_of_three_faces_counts_as_boundary():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0.5], [0, 0, 1]]
    g = build(Shape.mesh(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert np.all(g.edge_kind == EDGE_BOUNDARY)
    assert g.vertex_corner.all()


def test_sheet_of_two_sides_has_a_convex_rim():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    g = build_geometry([CompiledShape((Primitive(ROUND, vertices=square, faces=np.r_[faces, faces[:, ::-1]]),))])
    rim = np.array([0 not in e or 2 not in e for e in g.edge])
    assert np.all(g.edge_kind[rim] == EDGE_CONVEX)
    assert g.edge_kind[~rim].tolist() == [EDGE_BOUNDARY]  # the diagonal has four faces


@pytest.mark.parametrize("index", range(5))
def test_tree_holds_every_triangle_once(index):
    g = build(Shape.sphere(1.0), meshes()[index])
    first, end = g.node_first[1:3]
    seen, stack = [], [int(first)]
    visited = 0
    while stack:
        node = stack.pop()
        visited += 1
        start, count = g.node_start[node], g.node_count[node]
        corners = g.vertex[g.triangle[start : start + count]].reshape(-1, 3)
        assert np.array_equal(g.node_min[node], corners.min(axis=0))
        assert np.array_equal(g.node_max[node], corners.max(axis=0))
        left = int(g.node_child[node])
        if left < 0:
            assert 1 <= count <= LEAF_SIZE
            seen += range(start, start + count)
        else:
            assert g.node_start[left] == start
            assert g.node_start[left + 1] == start + g.node_count[left]
            assert g.node_count[left] + g.node_count[left + 1] == count
            stack += [left, left + 1]
    assert visited == end - first
    assert sorted(seen) == list(range(*g.triangle_first[1:3]))


def test_real_mesh_is_closed_and_its_tree_is_balanced():
    g = build(Shape.from_file(SPOT))
    assert g.closed.tolist() == [True]
    assert len(g.triangle) == 5856 and len(g.edge) == 3 * 5856 // 2 and len(g.vertex) == 2 + len(g.edge) - 5856
    depth = np.zeros(len(g.node_child), int)
    for node in np.flatnonzero(g.node_child >= 0):  # children come after their parents
        depth[g.node_child[node] : g.node_child[node] + 2] = depth[node] + 1
    leaves = g.node_child < 0
    assert g.node_count[leaves].sum() == 5856
    assert depth.max() == depth[leaves].min() + 1 == np.ceil(np.log2(5856 / LEAF_SIZE))


def test_curved_primitives_have_their_point_segment_or_frame():
    shape = Shape.compound(
        [
            (Shape.half_space((0, 0, 2), 3.0), (0, 0, 1), (1, 0, 0, 0)),
            (Shape.sphere(0.5), (1, 2, 3), (1, 0, 0, 0)),
            (Shape.capsule(0.25, 2.0), (0, 0, 0), (1, 0, 1, 0)),  # z axis turned to x
            (Shape.cylinder(0.5, 3.0), (0, 0, 5), (1, 1, 0, 0)),  # z axis turned to -y
        ]
    )
    g = build(shape)
    assert g.kind.tolist() == [HALF_SPACE, ROUND, ROUND, CYLINDER]
    assert g.radius.tolist() == [0.0, 0.5, 0.25, 0.5]
    assert g.closed.all()
    assert g.frame[0].tolist() == [0, 0, 1, 2.5, 0, 0, 0]  # z <= 1.5 in its own frame
    assert np.allclose(g.frame[3], [0, 0, 5, 0, -1, 0, 1.5], rtol=0, atol=1e-15)
    assert np.allclose(g.vertex, [[1, 2, 3], [-1, 0, 0], [1, 0, 0]], rtol=0, atol=1e-15)
    assert g.triangle.tolist() == [[0, 0, 0], [1, 2, 2]]
    assert g.triangle_edge.tolist() == [[-1, -1, -1], [0, -1, -1]]
    assert g.triangle_owns.tolist() == [0b000001, 0b001011]
    assert g.edge.tolist() == [[1, 2]] and g.edge_kind.tolist() == [EDGE_CAPSULE]
    assert g.vertex_corner.all() and not g.edge_normal.any() and not g.triangle_normal.any()
    assert np.diff(g.node_first).tolist() == [0, 1, 1, 0]
    assert np.isinf(g.bound_radius[0])
    assert np.allclose(g.bound_radius[1:], [0.5, 1.25, np.hypot(0.5, 1.5)], rtol=1e-14)


def test_bounding_spheres_hold_all_vertices():
    for shape in [*meshes(), Shape.capsule(0.3, 2.0), Shape.from_file(SPOT, scale=3.0)]:
        g = build(shape)
        distance = np.linalg.norm(g.vertex - g.bound_centre[0], axis=1) + g.radius[0]
        assert distance.max() <= g.bound_radius[0]
        assert g.bound_radius[0] <= distance.max() * (1.0 + 1e-14)


def test_indices_are_absolute_across_shapes():
    """Each shape of a joint build equals the same shape built alone, moved by its offsets."""
    shapes = [Shape.capsule(0.3, 1.0), *meshes(), Shape.half_space(), Shape.sphere(2.0), notch()]
    joint = build(*shapes)
    assert joint.shape_first.tolist() == list(range(len(shapes) + 1))
    for index, shape in enumerate(shapes):
        alone = build(shape)
        for names, first in (
            (("triangle",), "vertex_first"),
            (("triangle_edge",), "edge_first"),
            (("node_child", "node_start"), ""),
        ):
            for name in names:
                own = {"triangle": "triangle_first", "triangle_edge": "triangle_first"}.get(name, "node_first")
                rows = slice(*getattr(joint, own)[index : index + 2])
                shift = getattr(joint, first or {"node_child": "node_first", "node_start": "triangle_first"}[name])
                expected = getattr(alone, name)
                expected = np.where(expected < 0, expected, expected + shift[index])
                assert np.array_equal(getattr(joint, name)[rows], expected)
        vertices = slice(*joint.vertex_first[index : index + 2])
        assert np.array_equal(joint.vertex[vertices], alone.vertex)
        assert np.array_equal(joint.vertex_corner[vertices], alone.vertex_corner)
    for v in range(len(joint.vertex)):
        around = joint.vertex_edge[joint.vertex_edge_first[v] : joint.vertex_edge_first[v + 1]]
        assert np.all((joint.edge[around] == v).any(axis=1))


def test_arrays_have_one_type_each():
    """Kernels are compiled once: types must not depend on what the scene holds."""
    kinds = [{name: (a.dtype, a.ndim) for name, a in build(*shapes)._asdict().items()}
             for shapes in ([], [Shape.half_space()], [Shape.sphere(1.0)], meshes())]  # fmt: skip
    assert all(kind == kinds[0] for kind in kinds)
    assert {dtype for dtype, _ in kinds[0].values()} == {np.dtype(float), np.dtype(np.int64), np.dtype(bool)}
    assert all(a.flags.c_contiguous for a in build(*meshes()))


def test_compile_puts_shapes_into_the_principal_frame():
    """x_principal = axes^T (x_body - centre); a plane keeps its points."""
    axes, centre = rotation_matrix((1, 2, 3, 4)), np.array([0.1, 0.2, 0.3])
    box = compile_shape(Shape.box((1, 2, 3)), centre, axes).primitives[0]
    assert np.allclose(box.vertices @ axes.T + centre, Shape.box((1, 2, 3)).surface().vertices, rtol=0, atol=4e-15)
    plane = compile_shape(Shape.half_space((1, 1, 0), 2.0), centre, axes).primitives[0]
    on_plane = axes.T @ (np.array([2.0, 0.0, 7.0]) - centre)
    assert abs(plane.frame[:3] @ on_plane - plane.frame[3]) <= 4e-15
    assert np.array_equal(compile_shape(Shape.box(2.0), np.zeros(3), np.eye(3)).primitives[0].vertices,
                          Shape.box(2.0).surface().vertices)  # fmt: skip
