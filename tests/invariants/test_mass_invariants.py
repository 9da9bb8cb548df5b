"""What rigid motion, scaling, relabelling and splitting must not change in mass properties.

Tolerance: 1e-13 of the largest moment. The random hulls are kept from being flat, so their conditioning is that of a
body one can hold; the coordinates of a moved mesh are rounded, which moves the inertia by about 1e-16 times the
distance from the origin over the size.
"""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rigidimpulse.scene.body import Body
from rigidimpulse.scene.mass import body_mass, principal_axes
from rigidimpulse.scene.shape import Shape, rotation_matrix

RELATIVE = 1e-13
seeds = st.integers(0, 2**32 - 1)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(x * x for x in q) > 0.01)
offsets = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)
quick = settings(max_examples=40, deadline=None)


def hull(seed: int) -> Shape:
    """A random polyhedron of a size of about 1: the corners of a cube, each moved, and some points more."""
    random = np.random.default_rng(seed)
    cube = Shape.box(1.5).surface().vertices + random.uniform(-0.2, 0.2, (8, 3))
    return Shape.convex_hull(np.r_[cube, random.uniform(-1, 1, (random.integers(0, 30), 3))])


def near(actual, expected, relative=RELATIVE) -> bool:
    return bool(np.max(np.abs(actual - expected)) <= relative * np.max(np.abs(expected)))


@quick
@given(seeds, quaternions, offsets)
def test_rigid_motion_carries_mass_properties_along(seed, turn, offset):
    """m' = m, c' = R c + d, I' = R I R^T."""
    surface, rotation = hull(seed).surface(), rotation_matrix(turn)
    here = Shape.mesh(surface.vertices, surface.faces).solid()
    there = Shape.mesh(surface.vertices @ rotation.T + offset, surface.faces).solid()
    assert abs(there.volume - here.volume) <= RELATIVE * here.volume
    assert near(there.centroid, rotation @ here.centroid + offset, RELATIVE * 10) or np.allclose(
        there.centroid, rotation @ here.centroid + offset, rtol=0, atol=1e-14
    )
    assert near(there.inertia, rotation @ here.inertia @ rotation.T)


@quick
@given(seeds, quaternions, offsets)
def test_compound_of_one_part_is_the_part_moved(seed, turn, offset):
    part, rotation = hull(seed), rotation_matrix(turn)
    whole = Shape.compound([(part, offset, turn)]).solid()
    assert np.allclose(whole.centroid, offset + rotation @ part.solid().centroid, rtol=0, atol=1e-15)
    assert near(whole.inertia, rotation @ part.solid().inertia @ rotation.T)


@quick
@given(seeds, st.floats(1e-3, 1e3))
def test_scaling_by_s_scales_volume_by_s3_and_inertia_by_s5(seed, scale):
    surface = hull(seed).surface()
    one = Shape.mesh(surface.vertices, surface.faces).solid()
    scaled = Shape.mesh(surface.vertices * scale, surface.faces).solid()
    assert abs(scaled.volume / scale**3 - one.volume) <= RELATIVE * one.volume
    assert near(scaled.inertia / scale**5, one.inertia)


@quick
@given(seeds, st.randoms(use_true_random=False))
def test_order_of_faces_changes_no_bit(seed, order):
    """Sums have one rounding; the corners of a face stay in their order."""
    surface = hull(seed).surface()
    faces = surface.faces.tolist()
    order.shuffle(faces)
    one, other = Shape.mesh(surface.vertices, surface.faces).solid(), Shape.mesh(surface.vertices, faces).solid()
    assert one.volume == other.volume
    assert np.array_equal(one.centroid, other.centroid) and np.array_equal(one.inertia, other.inertia)


@quick
@given(seeds, st.floats(-0.4, 0.4))
def test_splitting_a_solid_changes_nothing(seed, height):
    """A tower of two boxes as a compound, against the one box."""
    random = np.random.default_rng(seed)
    x, y, z = random.uniform(0.2, 2.0, 3)
    lower, upper = (0.5 + height) * z, (0.5 - height) * z
    parts = [
        (Shape.box((x, y, lower)), (0, 0, lower / 2), (1, 0, 0, 0)),
        (Shape.box((x, y, upper)), (0, 0, lower + upper / 2), (1, 0, 0, 0)),
    ]
    split, whole = Shape.compound(parts).solid(), Shape.box((x, y, z)).solid()
    assert abs(split.volume - whole.volume) <= RELATIVE * whole.volume
    assert np.allclose(split.centroid, [0, 0, z / 2], rtol=0, atol=1e-15)
    assert near(split.inertia, whole.inertia)


@quick
@given(seeds)
def test_every_solid_has_a_realizable_inertia(seed):
    moments = np.sort(body_mass(Body("hull", hull(seed))).moments)
    assert moments[0] > 0.0
    assert moments[0] + moments[1] > moments[2]


@quick
@given(st.tuples(*[st.floats(0.01, 10)] * 3), quaternions)
def test_principal_axes_rebuild_the_tensor(moments, turn):
    """I = A diag(moments) A^T with A orthonormal and right-handed."""
    rotation = rotation_matrix(turn)
    tensor = rotation @ np.diag(moments) @ rotation.T
    found, axes = principal_axes(tensor)
    assert near(axes @ np.diag(found) @ axes.T, tensor)
    assert np.allclose(axes.T @ axes, np.eye(3), rtol=0, atol=4e-15)
    assert np.linalg.det(axes) > 0.0
    assert near(np.sort(found), np.sort(moments))
