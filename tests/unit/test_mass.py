"""Mass properties against closed forms, quadrature and exact rational arithmetic.

Tolerance: 1e-13 relative to the largest entry, a few hundred roundings. A wrong term (a forgotten parallel axis, the
full length for the half) is off by per cents.
"""

import re
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.mass import MOST_KNOWN, body_mass, masses_of, principal_axes
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.shape import Shape, rotation_matrix

SPOT = Path(__file__).parents[2] / "assets" / "meshes" / "spot.obj"
BOX = Shape.box((1, 2, 3)).surface()
OPEN = Shape.mesh(BOX.vertices, BOX.faces[1:])
NO_TURN = (1, 0, 0, 0)
RELATIVE = 1e-13


def close(actual, expected, relative=RELATIVE) -> bool:
    expected = np.asarray(expected, dtype=float)
    return bool(np.all(np.abs(actual - expected) <= relative * np.max(np.abs(expected))))


def solid_of_revolution(radius, ends):
    """Volume and moments: dV = pi r^2 dz, dI_zz = pi r^4 / 2 dz, dI_xx = pi (r^4 / 4 + r^2 z^2) dz."""
    volume = mpmath.quad(lambda z: mpmath.pi * radius(z) ** 2, ends)
    along = mpmath.quad(lambda z: mpmath.pi * radius(z) ** 4 / 2, ends)
    across = mpmath.quad(lambda z: mpmath.pi * (radius(z) ** 4 / 4 + radius(z) ** 2 * z * z), ends)
    return float(volume), np.diag([float(across), float(across), float(along)])


def capsule_profile(r, h):
    return lambda z: mpmath.sqrt(max(0, r * r - max(0, abs(z) - h / 2) ** 2))


@pytest.mark.parametrize(
    ("shape", "profile", "ends"),
    [
        (Shape.sphere(0.7), capsule_profile(0.7, 0.0), [-0.7, 0, 0.7]),
        (Shape.capsule(0.5, 2.0), capsule_profile(0.5, 2.0), [-1.5, -1, 1, 1.5]),
        (Shape.capsule(3.0, 0.25), capsule_profile(3.0, 0.25), [-3.125, -0.125, 0.125, 3.125]),
        (Shape.cylinder(0.4, 3.0), lambda z: mpmath.mpf(0.4), [-1.5, 1.5]),
    ],
)
def test_round_primitives_agree_with_quadrature(shape, profile, ends):
    volume, inertia = solid_of_revolution(profile, ends)
    solid = shape.solid()
    assert solid.volume == pytest.approx(volume, rel=RELATIVE)
    assert close(solid.inertia, inertia)
    assert not solid.centroid.any()


def test_box_agrees_with_its_mesh():
    mesh = Shape.mesh(BOX.vertices, BOX.faces).solid()
    box = Shape.box((1, 2, 3)).solid()
    assert mesh.volume == box.volume == 6.0
    assert close(mesh.inertia, np.diag([6.5, 5.0, 2.5])) and close(box.inertia, np.diag([6.5, 5.0, 2.5]))
    assert not mesh.centroid.any()


def exact_polyhedron(vertices, faces):
    """Volume, centroid and inertia about it of a closed surface, in rational arithmetic, about the origin."""
    points = [[Fraction(float(x)) for x in vertex] for vertex in vertices]
    volume, first = Fraction(0), [Fraction(0)] * 3
    second = [[Fraction(0)] * 3 for _ in range(3)]
    for face in faces:
        a, b, c = (points[i] for i in face)
        s = [a[i] + b[i] + c[i] for i in range(3)]
        v = sum(a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]) for i in range(3)) / 6
        volume += v
        for i in range(3):
            first[i] += v * s[i] / 4
            for j in range(3):
                second[i][j] += v * (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + s[i] * s[j]) / 20
    centre = [value / volume for value in first]
    about = [[second[i][j] - volume * centre[i] * centre[j] for j in range(3)] for i in range(3)]
    trace = about[0][0] + about[1][1] + about[2][2]
    inertia = [[float((trace if i == j else 0) - about[i][j]) for j in range(3)] for i in range(3)]
    return float(volume), np.array([float(x) for x in centre]), np.array(inertia)


@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_meshes_agree_with_rational_arithmetic(offset):
    """The centre's error is relative to the coordinates; volume and inertia lose none of their digits far away.

    The reference takes the rounded coordinates as exact. Integrals about the origin would lose 4 to 8 digits at 100.
    """
    hull = Shape.convex_hull(np.random.default_rng(2).normal(size=(40, 3)) + offset).surface()
    notched = Shape.from_file(SPOT).surface()
    for vertices, faces in ((hull.vertices, hull.faces), (notched.vertices + offset, notched.faces)):
        solid = Shape.mesh(vertices, faces).solid()
        volume, centroid, inertia = exact_polyhedron(vertices, faces)
        assert solid.volume == pytest.approx(volume, rel=RELATIVE)
        assert np.max(np.abs(solid.centroid - centroid)) <= 4e-16 * (1.0 + offset)
        assert close(solid.inertia, inertia)


def test_solid_of_several_pieces_and_with_a_cavity():
    """A cube of side 4 with a hollow of side 2, and a cube of side 2 beside it."""
    cube = Shape.box(2.0).surface()
    hollow = np.r_[2 * cube.vertices, cube.vertices], np.r_[cube.faces, cube.faces[:, ::-1] + 8]
    solid = Shape.mesh(*hollow).solid()
    assert solid.volume == pytest.approx(64.0 - 8.0, rel=RELATIVE)
    assert close(solid.inertia, np.eye(3) * (64.0 * 32.0 - 8.0 * 8.0) / 12.0)
    two = Shape.mesh(np.r_[cube.vertices, cube.vertices + [6, 0, 0]], np.r_[cube.faces, cube.faces + 8]).solid()
    assert two.volume == 16.0 and two.centroid.tolist() == [3.0, 0.0, 0.0]
    across = 2 * (8.0 * 8.0 / 12.0 + 8.0 * 9.0)
    assert close(two.inertia, np.diag([2 * 8.0 * 8.0 / 12.0, across, across]))


def test_compound_of_two_halves_is_the_whole():
    halves = Shape.compound([(Shape.box((1, 2, 1.5)), (0, 0, z), NO_TURN) for z in (-0.75, 0.75)]).solid()
    assert halves.volume == 6.0 and not halves.centroid.any()
    assert close(halves.inertia, np.diag([6.5, 5.0, 2.5]))


def test_compound_turns_its_parts():
    """A box turned by 90 degrees about z has its x and y edges swapped."""
    turned = Shape.compound([(Shape.box((1, 2, 3)), (5, 0, 0), (1, 0, 0, 1))]).solid()
    assert close(turned.inertia, np.diag([5.0, 6.5, 2.5]))
    assert turned.centroid.tolist() == [5.0, 0.0, 0.0]


def test_mass_comes_from_density_or_is_given():
    shape = Shape.box((1, 2, 3))
    by_density = body_mass(Body("box", shape, material=Material(density=500)))
    given = body_mass(Body("box", shape, mass=12.0))
    assert by_density.mass == pytest.approx(3000.0, rel=1e-15) and given.mass == 12.0
    assert close(given.inertia, np.diag([13.0, 10.0, 5.0]))
    assert close(by_density.inertia, np.diag([6.5, 5.0, 2.5]) * 500.0)


def test_given_centre_moves_the_inertia_along():
    """Parallel axes: I' = I + m (|d|^2 - d d^T)."""
    moved = body_mass(Body("box", Shape.box((1, 2, 3)), mass=12.0, center_of_mass=(0, 0, 1)))
    assert moved.center_of_mass.tolist() == [0.0, 0.0, 1.0]
    assert close(moved.inertia, np.diag([25.0, 22.0, 5.0]))


def test_given_inertia_is_taken_as_it_is():
    tensor = rotation_matrix((1, 2, 3, 4)) @ np.diag([1.0, 2.0, 2.5]) @ rotation_matrix((1, 2, 3, 4)).T
    for inertia in ((1.0, 2.0, 2.5), tensor):
        mass = body_mass(Body("box", Shape.box(1), mass=3.0, inertia=inertia, center_of_mass=(1, 0, 0)))
        assert close(np.sort(mass.moments), [1.0, 2.0, 2.5])
        assert close(mass.axes @ np.diag(mass.moments) @ mass.axes.T, np.diag(inertia) if len(np.shape(inertia)) == 1
                     else tensor)  # fmt: skip


def test_open_mesh_with_all_figures_given_needs_no_solid():
    mass = body_mass(Body("bowl", OPEN, mass=2.0, inertia=(1, 1, 1), center_of_mass=(0, 0, 0.1)))
    assert mass.mass == 2.0 and mass.moments.tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("motion", ["static", "kinematic"])
def test_bodies_that_are_not_moved_need_no_solid(motion):
    mass = body_mass(Body("bowl", OPEN, motion=motion))
    assert np.isinf(mass.mass) and not mass.center_of_mass.any() and np.array_equal(mass.axes, np.eye(3))


def test_kinematic_bodies_turn_about_their_centre_of_mass():
    shape = Shape.compound([(Shape.box(1), (3, 0, 0), NO_TURN)])
    assert body_mass(Body("arm", shape, motion="kinematic")).center_of_mass.tolist() == [3.0, 0.0, 0.0]
    given = Body("arm", shape, motion="kinematic", center_of_mass=(1, 0, 0))
    assert body_mass(given).center_of_mass.tolist() == [1.0, 0.0, 0.0]
    assert not body_mass(Body("arm", shape, motion="static")).center_of_mass.any()


def twisted():
    faces = BOX.faces.copy()
    faces[0] = faces[0, ::-1]
    return Shape.mesh(BOX.vertices, faces)


FIN = Shape.mesh(np.r_[BOX.vertices, [[9, 9, 9]]], np.r_[BOX.faces, [[0, 1, 8]]])
SHEET = Shape.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]])


@pytest.mark.parametrize(
    ("shape", "settings", "problem", "remedy"),
    [
        (OPEN, {}, "open", "convex_hull.*mass=, inertia=, center_of_mass="),
        (OPEN, {"mass": 1.0, "inertia": (1, 1, 1)}, "open", "give center_of_mass="),
        (FIN, {}, "open", "convex_hull"),
        (Shape.mesh(BOX.vertices, BOX.faces[:, ::-1]), {}, "inside out", r"faces\[:, ::-1\]"),
        (twisted(), {}, "outwards", "fix_normals"),
        (SHEET, {}, "no volume", "thickness"),
        (Shape.half_space(), {}, "infinite", "static"),
        (Shape.compound([(OPEN, (0, 0, 0), NO_TURN)]), {}, "open", "convex_hull"),
        (Shape.box(1), {"inertia": (1, 1, 3)}, "moments", "sum of the other two"),
        (Shape.box(1), {"inertia": (1, 1, 0)}, "moments", "> 0"),
        (Shape.box(1), {"inertia": (-1, 1, 1)}, "moments", "> 0"),
        (Shape.box(1), {"inertia": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "not symmetric", "symmetric"),
        (Shape.sphere(1e-200), {}, "volume comes out as 0.0", "metres"),
        (Shape.sphere(1e200), {}, "volume comes out as inf", "metres"),
    ],
)
def test_masses_that_can_not_be_are_refused(shape, settings, problem, remedy):
    with pytest.raises(SceneError, match=problem) as caught:
        body_mass(Body("thing", shape, **settings))
    assert str(caught.value).startswith("body 'thing'")
    assert re.search(remedy, caught.value.remedy)


CUBE = Shape.box(2).surface()


@pytest.mark.parametrize("shape", [Shape.sphere(0.3), Shape.box(0.7), Shape.mesh(0.3 * CUBE.vertices, CUBE.faces)])
def test_equal_moments_are_exactly_equal_along_body_axes(shape):
    mass = body_mass(Body("round", shape, mass=1.7))
    assert len(set(mass.moments.tolist())) == 1
    assert np.array_equal(mass.axes, np.eye(3))


def test_turned_cube_still_has_equal_moments_and_body_axes():
    surface = Shape.box(1).surface()
    mass = body_mass(Body("cube", Shape.mesh(surface.vertices @ rotation_matrix((1, 2, 3, 4)).T, surface.faces)))
    assert len(set(mass.moments.tolist())) == 1
    assert np.array_equal(mass.axes, np.eye(3))


def test_diagonal_inertia_keeps_body_axes_and_their_order():
    for moments in ([3.0, 1.0, 2.5], [1.0, 2.0, 2.0], [2.0, 1.5, 2.0]):
        found, axes = principal_axes(np.diag(moments) + 1e-15 * (np.ones((3, 3)) - np.eye(3)))
        assert found.tolist() == moments
        assert np.array_equal(axes, np.eye(3))


def test_turned_symmetric_top_has_two_exactly_equal_moments():
    turn = rotation_matrix((1, 2, 3, 4))
    moments, axes = principal_axes(turn @ np.diag([2.0, 2.0, 1.0]) @ turn.T)
    assert len(set(moments.tolist())) == 2
    assert close(axes @ np.diag(moments) @ axes.T, turn @ np.diag([2.0, 2.0, 1.0]) @ turn.T, 4e-15)


def test_principal_axes_of_a_plate_with_equal_diagonal():
    """All of the diagonal equal, one product of inertia: axes at 45 degrees, moments 1 -/+ 0.3."""
    moments, axes = principal_axes(np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    assert close(np.sort(moments), [0.7, 1.0, 1.3], 1e-15)
    assert np.allclose(np.abs(axes[:2, :2]), np.sqrt(0.5), rtol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0, rel=1e-15)


def test_masses_that_are_kept_do_not_follow_what_the_caller_changes_later():
    centre = np.array([0.0, 0.0, 0.1])
    body = Body("a", Shape.box(0.5), mass=2.0, center_of_mass=centre)
    first = masses_of([body])[0]
    centre[2] = 0.2
    other = masses_of([body])[0]
    np.testing.assert_array_equal(first.center_of_mass, [0.0, 0.0, 0.1])
    np.testing.assert_array_equal(other.center_of_mass, [0.0, 0.0, 0.2])
    centre[2] = 0.1
    assert masses_of([body])[0] is first
    np.testing.assert_allclose(to_matrix(first.turn), first.axes, atol=1e-15)


def test_more_bodies_than_are_kept_have_their_own_masses():
    bodies = [Body(f"body {k}", Shape.sphere(0.1), mass=1.0 + k) for k in range(MOST_KNOWN + 50)]
    assert [m.mass for m in masses_of(bodies)] == [1.0 + k for k in range(MOST_KNOWN + 50)]
    assert [m.mass for m in masses_of(reversed(bodies))] == [1.0 + k for k in reversed(range(MOST_KNOWN + 50))]
