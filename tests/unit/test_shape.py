"""Shapes as people write them: what is kept, what is cleaned, what is refused and with which words."""

import copy
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.shape import Shape, rotation_matrix

SPOT = Path(__file__).parents[2] / "assets" / "meshes" / "spot.obj"
BOX = Shape.box((1, 2, 3)).surface()
NO_TURN = (1, 0, 0, 0)


def volume(shape: Shape) -> float:
    """Signed volume by the divergence theorem, from the shape's surface."""
    surface = shape.surface()
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6.0)


def test_importing_shapes_and_scenes_loads_no_heavy_package():
    code = (
        "import sys, rigidimpulse.scene.scene, rigidimpulse.collision.geometry;"
        "heavy = {'trimesh', 'fcl', 'numba', 'meshcat', 'matplotlib', 'scipy'} & set(sys.modules);"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    root = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": root}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_shapes_are_immutable_and_survive_pickling():
    shape = Shape.mesh(BOX.vertices, BOX.faces)
    with pytest.raises(AttributeError):
        shape.radius = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError):
        shape.vertices[0, 0] = 7.0
    source = BOX.vertices.copy()
    kept = Shape.mesh(source, BOX.faces)
    source[:] = 0.0
    assert volume(kept) == pytest.approx(6.0, rel=1e-15)
    again = pickle.loads(pickle.dumps(shape))
    assert np.array_equal(again.surface().vertices, shape.surface().vertices)


def test_box_has_the_given_edge_lengths_and_faces_outwards():
    assert np.ptp(BOX.vertices, axis=0).tolist() == [1.0, 2.0, 3.0]
    assert volume(Shape.box((1, 2, 3))) == 6.0
    assert volume(Shape.box(2)) == 8.0


def test_half_space_keeps_its_rule_for_any_length_of_normal():
    """Solid where normal . x <= offset: scaling both changes nothing."""
    normal, offset = Shape.half_space((0, 3, 4), 10.0).plane()
    assert normal.tolist() == pytest.approx([0.0, 0.6, 0.8], rel=1e-15)
    assert offset == pytest.approx(2.0, rel=1e-15)


def test_seams_are_joined_in_a_real_file():
    """Spot comes in 13 pieces until vertices that differ only in texture coordinates are joined: V - E + F = 2."""
    shape = Shape.from_file(SPOT, scale=0.5)
    surface = shape.surface()
    assert surface.closed and len(surface.faces) == 5856
    assert len(surface.vertices) - 3 * 5856 // 2 + 5856 == 2
    assert volume(shape) == pytest.approx(volume(Shape.from_file(str(SPOT))) / 8.0, rel=1e-14)


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".glb", ".off"])
def test_files_of_other_formats_hold_the_same_solid(tmp_path, suffix):
    """STL has no shared vertices and float32 numbers: 1, 2 and 3 are exact in it."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.Trimesh(BOX.vertices, BOX.faces, process=False).export(tmp_path / f"box{suffix}")
    shape = Shape.from_file(tmp_path / f"box{suffix}")
    assert shape.surface().closed and len(shape.surface().vertices) == 8
    assert volume(shape) == 6.0


def test_all_geometries_of_a_file_are_taken_at_their_places(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    for x in (0.0, 8.0):
        scene.add_geometry(
            trimesh.Trimesh(BOX.vertices, BOX.faces, process=False),
            transform=trimesh.transformations.translation_matrix([x, 0.0, 0.0]),
        )
    scene.export(tmp_path / "two.glb")
    shape = Shape.from_file(tmp_path / "two.glb")
    assert shape.surface().vertices[:, 0].max() == 8.5 and shape.surface().vertices[:, 0].min() == -0.5
    assert volume(shape) == 12.0
    assert volume(Shape.from_trimesh(scene)) == 12.0


def test_from_trimesh_copies_the_mesh():
    trimesh = pytest.importorskip("trimesh")
    assert volume(Shape.from_trimesh(trimesh.creation.box((1, 2, 3)))) == pytest.approx(6.0, rel=1e-15)
    with pytest.raises(SceneError, match="no trimesh"):
        Shape.from_trimesh("box.obj")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("missing.obj", None, "no such file"),
        ("empty.obj", "", "missing|read|triangles"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "read|triangles"),
        ("broken.obj", "v 0 0 zero\nf 1 2 3\n", "read|triangles"),
        ("broken.stl", "no solid at all", "read|triangles"),
        ("broken.glb", "glTF", "read"),
        ("scene.txt", "hello", "read"),
    ],
)
def test_files_that_do_not_load_are_named_with_a_remedy(tmp_path, name, content, words):
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(SceneError, match=words) as caught:
        Shape.from_file(path)
    assert name in str(caught.value) and caught.value.remedy


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_scale_of_a_file_must_be_positive(scale):
    with pytest.raises(SceneError, match="scale"):
        Shape.from_file(SPOT, scale=scale)


def test_cleaning_joins_and_drops_but_moves_nothing():
    """Each face with its own vertices, plus an unused vertex, a face twice, a face with a repeated corner."""
    vertices = np.r_[BOX.vertices[BOX.faces].reshape(-1, 3), [[9.0, 9.0, 9.0]]]
    faces = np.arange(36).reshape(12, 3)
    faces = np.r_[faces, faces[:1, [1, 2, 0]], [[0, 0, 1]]]
    surface = Shape.mesh(vertices, faces).surface()
    assert surface.closed and len(surface.faces) == 12
    assert {tuple(v) for v in surface.vertices} == {tuple(v) for v in BOX.vertices}


def test_zeros_of_either_sign_are_the_same_place():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [4, 3, 2]])
    assert Shape.mesh(np.r_[vertices, [[-0.0, 0.0, -0.0]]], faces).surface().closed


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_open_seams_are_welded_relative_to_size(size):
    """Noise of 1e-10 of the size is joined, a gap of 1e-3 of the size is none of our business, at any scale."""
    random = np.random.default_rng(1)
    vertices = BOX.vertices[BOX.faces].reshape(-1, 3)
    faces = np.arange(36).reshape(12, 3)
    noisy = size * (vertices + 1e-10 * random.uniform(-1, 1, vertices.shape))
    assert Shape.mesh(noisy, faces).surface().closed
    torn = size * (vertices + 1e-3 * random.uniform(-1, 1, vertices.shape))
    assert Shape.mesh(torn, faces).surface().num_open_edges == 36


def test_triangles_without_area_are_flipped_so_that_the_solid_stays_closed():
    """A tetrahedron with a T-junction: the middle m of an edge belongs to one face only, joined by a flat triangle."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0]])
    faces = np.array([[0, 2, 1], [0, 4, 3], [4, 1, 3], [0, 1, 4], [0, 3, 2], [1, 2, 3]])
    surface = Shape.mesh(vertices, faces).surface()
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    assert surface.closed and len(surface.faces) == 6
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() >= 0.25
    assert volume(Shape.mesh(vertices, faces)) == pytest.approx(1.0 / 6.0, rel=1e-15)


def test_open_and_inconsistent_edges_are_counted():
    assert Shape.mesh(BOX.vertices, BOX.faces[1:]).surface().num_open_edges == 3
    faces = BOX.faces.copy()
    faces[0] = faces[0, ::-1]
    surface = Shape.mesh(BOX.vertices, faces).surface()
    assert (surface.num_open_edges, surface.num_twisted_edges) == (0, 3)


def test_solids_that_touch_along_an_edge_are_closed():
    """Two cubes share an edge, which has four faces, two each way."""
    other = BOX.vertices + [1.0, 2.0, 0.0]
    surface = Shape.mesh(np.r_[BOX.vertices, other], np.r_[BOX.faces, BOX.faces + 8]).surface()
    assert surface.closed and len(surface.vertices) == 14


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (Shape.sphere(-1), "radius is -1.0 m"),
        (Shape.sphere(np.nan), "radius is nan"),
        (Shape.box((1, 0, 1)), r"size is \[1.0, 0.0, 1.0\]"),
        (Shape.box((1, 2)), "three lengths"),
        (Shape.capsule(1, np.inf), "height is inf"),
        (Shape.cylinder(0, 1), "radius is 0.0"),
        (Shape.half_space((0, 0, 0)), "not all zero"),
        (Shape.half_space(offset=np.nan), "offset is nan"),
        (Shape.mesh(np.zeros((0, 3)), np.zeros((0, 3), int)), "empty"),
        (Shape.mesh([], []), "vertices have the form"),
        (Shape.mesh(BOX.vertices, []), "empty"),
        (Shape.mesh(BOX.vertices, [[0, 1, 8]]), r"face 0 .* 8 vertices; use indices from 0 to 7"),
        (Shape.mesh(BOX.vertices, [[0, 1, -1]]), "face 0"),
        (Shape.mesh(BOX.vertices, [[0, 1, 2, 3]]), "triangles"),
        (Shape.mesh(BOX.vertices * [1, np.nan, 1], BOX.faces), "vertex 0 is not finite"),
        (Shape.mesh(BOX.vertices * [1, 1e200, 1], BOX.faces), r"vertex 0 is at .* farther than 1e\+60 m \(8 such vertices\)"),
        (Shape.mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]), "area"),
        (Shape.compound([]), "no parts"),
        (Shape.compound([(Shape.sphere(1), (0, 0), NO_TURN)]), "part 0: position"),
        (Shape.compound([(Shape.sphere(1), (0, 0, 0), (0, 0, 0, 0))]), "part 0: orientation"),
        (Shape.compound([(Shape.sphere(-1), (0, 0, 0), NO_TURN)]), "compound, part 0, sphere: radius"),
    ],
)
def test_values_without_meaning_are_refused_when_checked(shape, words):
    with pytest.raises(SceneError, match=words) as caught:
        shape.check()
    assert caught.value.remedy


@pytest.mark.parametrize(
    "make",
    [
        lambda: Shape.sphere("big"),
        lambda: Shape.box("big"),
        lambda: Shape.mesh([[0, 0, 0], [1, 0]], [[0, 1, 2]]),
        lambda: Shape.mesh(BOX.vertices, [[0, 0.5, 1]]),
        lambda: Shape.mesh(BOX.vertices, [[0, np.nan, 1]]),
        lambda: Shape.compound([Shape.sphere(1)]),
        lambda: Shape.compound([("sphere", (0, 0, 0), NO_TURN)]),
        lambda: Shape.convex_hull([[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
        lambda: Shape.convex_hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]),
        lambda: Shape.convex_hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, np.nan]]),
        lambda: Shape.convex_hull(Shape.half_space()),
        lambda: Shape.convex_hull(Shape.compound([(Shape.sphere(1), (0, 0, 0), NO_TURN)])),
    ],
)
def test_what_is_no_number_or_no_solid_is_refused_at_once(make):
    with pytest.raises(SceneError) as caught:
        make()
    assert caught.value.remedy


def test_hull_of_a_grid_of_points_is_its_box():
    """Points inside faces and edges are dropped: 8 vertices, 12 faces, volume exact to rounding."""
    points = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
    hull = Shape.convex_hull(points)
    assert hull.surface().closed
    assert len(hull.surface().vertices) == 8 and len(hull.surface().faces) == 12
    assert volume(hull) == pytest.approx(64.0, rel=1e-15)


def test_hull_of_random_points_holds_them_all_and_is_closed():
    """No point is above any face by more than rounding (1e-14 for coordinates of order 1)."""
    points = np.random.default_rng(5).normal(size=(300, 3))
    surface = Shape.convex_hull(points).surface()
    a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert surface.closed
    assert np.max(points @ normals.T - np.sum(a * normals, axis=1)) <= 1e-14


def test_hull_of_shapes():
    assert Shape.convex_hull(Shape.capsule(1, 2)).kind == "capsule"
    frame = Shape.compound([(Shape.box(1), (x, y, 0), NO_TURN) for x in (0, 3) for y in (0, 3)])
    assert volume(Shape.convex_hull(frame)) == pytest.approx(16.0, rel=1e-15)
    assert Shape.convex_hull(Shape.from_file(SPOT)).surface().closed


def test_nested_compounds_compose_their_poses():
    """A point of the inner part is at p + R (q + S x)."""
    p, q = np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.5, 0.0])
    turn, inner_turn = (2.0, 0.0, 1.0, 0.0), (1.0, 1.0, 1.0, 1.0)
    inner = Shape.compound([(Shape.box(1), q, inner_turn), (Shape.sphere(1), (0, 0, 0), NO_TURN)])
    part = Shape.compound([(inner, p, turn)]).parts_flat()[0]
    x = np.array([0.3, -0.7, 1.1])
    expected = p + rotation_matrix(turn) @ (q + rotation_matrix(inner_turn) @ x)
    assert np.allclose(part.position + part.rotation @ x, expected, rtol=0, atol=2e-15)


def test_representations_say_what_a_shape_is():
    assert repr(Shape.box((1, 2, 3))) == "Shape.box([1.0, 2.0, 3.0])"
    assert repr(Shape.capsule(1, 2)) == "Shape.capsule(1.0, 2.0)"
    assert repr(Shape.mesh(BOX.vertices, BOX.faces)) == "Shape.mesh(8 vertices, 12 faces)"
    assert "1 parts" in repr(Shape.compound([(Shape.sphere(1), (0, 0, 0), NO_TURN)]))


def test_shapes_that_are_alike_are_compiled_once():
    box, half = ri.Shape.box(1.0), (1.0, 0.0, 0.0, 0.0)
    corners, faces = box.surface().vertices, box.surface().faces
    meshes = [ri.Shape.mesh(factor * corners, faces) for factor in (1.0, 1.0, 2.0)]
    pairs = [ri.Shape.compound([(ri.Shape.box(1.0), (x, 0, 0), half), (ri.Shape.sphere(0.2), (0, 0, 0), half)]) for x in (1.0, 1.0, 2.0)]
    shapes = [box, ri.Shape.box((1, 1, 1)), ri.Shape.box(2.0), ri.Shape.sphere(1.0), ri.Shape.capsule(1.0, 2.0), *meshes, *pairs]
    bodies = [ri.Body(f"body {k}", shape, position=(5.0 * k, 0, 0)) for k, shape in enumerate(shapes)]
    world = ri.compile_scene(ri.Scene(bodies=bodies))
    assert world.shape_of_body.tolist() == [0, 0, 1, 2, 3, 4, 4, 5, 6, 6, 7]
    np.testing.assert_allclose(world.mass[:8] / world.mass[0], [1, 1, 8, 4 / 3 * np.pi, 10 / 3 * np.pi, 1, 1, 8], rtol=1e-12)


def test_alike_shapes_of_bodies_whose_masses_differ_share_nothing_but_the_shape():
    alike = [{}, {"mass": 2.0}, {"material": ri.Material(density=10.0)}, {"center_of_mass": (0.1, 0, 0)}, {"motion": "static"}]
    bodies = [ri.Body(f"body {k}", ri.Shape.box(1.0), position=(3.0 * k, 0, 0), **given) for k, given in enumerate(alike)]
    world = ri.compile_scene(ri.Scene(bodies=bodies))
    assert world.mass.tolist() == [1000.0, 2.0, 10.0, 1000.0, np.inf]
    assert world.offset[3].tolist() == [0.1, 0.0, 0.0]
    assert world.shape_of_body.tolist() == [0, 0, 0, 1, 0]


def test_what_a_shape_is_known_by_travels_with_it():
    mesh = ri.Shape.mesh(ri.Shape.box(1.0).surface().vertices, ri.Shape.box(1.0).surface().faces)
    assert pickle.loads(pickle.dumps(mesh)).key == mesh.key == ri.Shape.mesh(mesh.vertices, mesh.faces).key
    assert copy.copy(mesh).key == mesh.key
