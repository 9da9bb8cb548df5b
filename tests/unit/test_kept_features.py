"""Features that are kept from look to look: the same contacts, in the same order, as when they are looked for again each time."""

import numpy as np
import pytest
import trimesh
from contact_scenes import IDENTITY, Scene, approached, box, capsule, mesh, turn
from hypothesis import given, settings
from hypothesis import strategies as st

from rigidimpulse.collision.bvh import STACK_ROWS
from rigidimpulse.collision.manifold.contact_points import Contacts as Buffers
from rigidimpulse.collision.manifold.dispatch import Posed, pair_contacts
from rigidimpulse.collision.manifold.kept_features import BEGIN, END, LOOKED, MARGIN, SEARCHES, make_contact_scratch

STACK, PLACES, ROWS = 1 << 15, 16, 1 << 17
RING = trimesh.creation.torus(0.5, 0.15, major_sections=24, minor_sections=12)


def bumpy(seed, subdivisions=2):
    """A ball with bumps and dents of a tenth of its radius."""
    ball = trimesh.creation.icosphere(subdivisions, 0.5)
    wave = np.random.default_rng(seed).normal(size=3) * 6.0
    ball.vertices *= 1.0 + 0.1 * np.sin(ball.vertices @ wave)[:, None]
    return ball


def slab(seed, levels=3):
    """A plate 2 m wide whose faces have hills and hollows 0.04 m high: two of them have many contacts, which come and go as they slide."""
    plate, rng = box(2.0, 2.0, 0.3), np.random.default_rng(seed)
    for _ in range(levels):
        plate = plate.subdivide()
    x, y, _ = plate.vertices.T
    plate.vertices[:, 2] += 0.02 * np.sin(9.0 * x + rng.uniform(0.0, 6.0)) * np.sin(8.0 * y + rng.uniform(0.0, 6.0))
    return plate


def open_sheet():
    """A sheet with two sides, not flat."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 9))
    corner = np.arange(81).reshape(9, 9)
    a, b, c, d = (corner[i : i + 8, j : j + 8].ravel() for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    vertices = np.column_stack([x.ravel(), y.ravel(), 0.1 * np.sin(3.0 * x.ravel())])
    return trimesh.Trimesh(vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]), process=False)


PAIRS = {
    "bumpy balls": (mesh(bumpy(1)), mesh(bumpy(2)), [0.3, 0.5, 1.0]),
    "slabs": (mesh(slab(1)), mesh(slab(2)), [0.0, 0.0, 1.0]),
    "rings": (mesh(RING), mesh(RING), [0.0, 0.2, 1.0]),
    "boxes": (mesh(box()), mesh(box(0.4, 0.3, 0.2)), [0.1, 0.2, 1.0]),
    "small on large": (mesh(box(40.0, 40.0, 1.0)), mesh(bumpy(3)), [0.0, 0.0, 1.0]),
    "large on small": (mesh(bumpy(3)), mesh(box(40.0, 40.0, 1.0)), [0.0, 0.0, -1.0]),
    "capsule on a mesh": (mesh(bumpy(4)), capsule(0.2, 0.6), [0.0, 0.4, 1.0]),
    "open sheet": (mesh(open_sheet()), mesh(bumpy(5)), [0.0, 0.1, 1.0]),
}


def towards(direction):
    """The unit vector along a direction."""
    return np.array(direction) / np.linalg.norm(direction)


class Both:
    """One pair of bodies, asked about with lists that are kept and without."""

    def __init__(self, first, second, stack=STACK, rows=ROWS):
        self.scene = Scene(first, second, scratch_rows=stack)
        self.kept = Buffers(self.scene.real.copy(), self.scene.integer.copy(), make_contact_scratch.py_func(stack, PLACES, rows))

    def look(self, pose, margin):
        """Contacts (real, integer) in both ways."""
        a, b, found = Posed(0, *IDENTITY), Posed(1, *pose), []
        for buffers in (self.scene.buffers, self.kept):
            count = pair_contacts(self.scene.shapes, a, b, margin, buffers, 0)
            found.append((buffers.real[:count].copy(), buffers.integer[:count, 2:].copy()))
        return found

    def follow(self, pose, speed, spin, looks, margin):
        """Move the second body `looks` times, comparing; spin about its own centre. Returns how many contacts there were."""
        (x, R), total = pose, 0
        for k in range(looks):
            now = (x + k * np.array(speed), turn(spin, k * float(np.linalg.norm(spin))) @ R if np.any(spin) else R)
            (real, integer), (kept_real, kept_integer) = self.look(now, margin)
            np.testing.assert_array_equal(kept_integer, integer)
            np.testing.assert_array_equal(kept_real, real)
            total += len(real)
        return total

    @property
    def looks(self):
        """Looks since the list was found."""
        return int(self.kept.scratch.features.integer[:, LOOKED].max())


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("way", [0.0, 1e-4, 1e-3, 1e-2])
def test_same_contacts_while_bodies_slide_and_turn(name, way):
    first, second, direction = PAIRS[name]
    both = Both(first, second)
    axis = np.array([0.3, -0.5, 0.8])
    start = turn((0.0, 0.0, 1.0), 0.1) if name == "slabs" else turn((1.0, 2.0, 3.0), 0.7)
    pose = approached(both.scene, IDENTITY, towards(direction), start, 5e-3)
    sideways = np.cross(direction, [1.0, 0.3, 0.2])
    for speed, spin in ((way * sideways, 0.0 * axis), (0.0 * sideways, way * axis), (-0.3 * way * np.array(direction), 0.5 * way * axis)):
        assert both.follow(pose, speed, spin, 12, 0.03) > 0


def test_a_list_is_used_while_bodies_hardly_move():
    """Found at the first look, with the least s; at the second, for eight looks; then every eighth look."""
    both = Both(*PAIRS["bumpy balls"][:2])
    x, R = approached(both.scene, IDENTITY, np.array([0.0, 0.0, 1.0]), np.eye(3), 1e-3)
    looks = []
    for k in range(26):
        both.look((x + [1e-4 * k, 0.0, 0.0], R), 0.02)
        looks.append(both.looks)
    assert looks.count(1) <= 5
    assert max(looks) >= 7
    entry = both.kept.scratch.features.integer[both.kept.scratch.features.integer[:, LOOKED] > 0]
    assert len(entry) == 1
    for _ in range(20):
        both.look((x, R), 0.02)
    assert both.looks >= 19


def test_a_wider_margin_asks_for_a_new_list():
    both = Both(*PAIRS["bumpy balls"][:2])
    pose = approached(both.scene, IDENTITY, np.array([0.0, 0.0, 1.0]), np.eye(3), 0.02)
    assert len(both.look(pose, 0.01)[1][0]) == 0
    real, kept = (found[0] for found in both.look(pose, 0.03))
    assert len(real) > 0
    np.testing.assert_array_equal(kept, real)
    assert both.kept.scratch.features.real[both.kept.scratch.features.integer[:, LOOKED] > 0, MARGIN] == 0.03


def test_bodies_that_went_far_apart_and_come_back():
    both = Both(*PAIRS["rings"][:2])
    x, R = approached(both.scene, IDENTITY, towards([0.0, 0.2, 1.0]), turn((1.0, 2.0, 3.0), 0.7), 1e-3)
    for up in (0.0, 0.001, 0.002, 0.3, 0.6, 0.3, 0.0, 0.0):
        (real, integer), (kept_real, kept_integer) = both.look((x + [0.0, 0.0, up], R), 0.03)
        np.testing.assert_array_equal(kept_real, real)
        np.testing.assert_array_equal(kept_integer, integer)


def test_too_few_rows_and_leaves_give_the_same_contacts_in_the_same_order():
    """Lists that do not fit are not kept, and others are given up in time. Nothing depends on what is kept, so that no run does either."""
    # A full search writes 119 rows, and 324 of the finer plates; with the greatest s more than the 200 of one search in either.
    for levels, stack, rows in ((3, STACK_ROWS + 40, 1 << 14), (3, STACK, 8 * 200), (4, STACK, 8 * 200)):
        both = Both(mesh(slab(1, levels)), mesh(slab(2, levels)), stack, rows)
        # A search without lists has as many rows as one with them.
        scratch = make_contact_scratch.py_func(stack, 0, rows // SEARCHES)
        both.scene.buffers = both.scene.buffers._replace(scratch=scratch)
        pose = approached(both.scene, IDENTITY, np.array([0.0, 0.0, 1.0]), turn((0.0, 0.0, 1.0), 0.3), 1e-3)
        assert both.follow(pose, [1e-3, 0.0, 0.0], [0.0, 0.0, 1e-3], 12, 0.06) > 200
        features = both.kept.scratch.features
        kept = features.integer[features.integer[:, LOOKED] > 0]
        assert features.state[0] <= rows
        assert (kept[:, BEGIN] <= kept[:, END]).all() and (kept[:, END] <= features.state[0]).all()


@settings(max_examples=40, deadline=None)
@given(
    name=st.sampled_from(sorted(PAIRS)),
    seed=st.integers(0, 2**31),
    size=st.sampled_from([1e-5, 1e-3, 5e-3]),
    gap=st.sampled_from([-2e-3, 0.0, 1e-6, 1e-2]),
)
def test_same_contacts_on_any_way(name, seed, size, gap):
    first, second, direction = PAIRS[name]
    both, rng = Both(first, second), np.random.default_rng(seed)
    start = turn((0.0, 0.0, 1.0), rng.uniform(0.0, 6.0)) if name == "slabs" else turn(rng.normal(size=3), 1.0)
    x, R = approached(both.scene, IDENTITY, towards(direction), start, max(gap, 1e-6))
    x = x + min(gap, 0.0) * np.array(direction)
    for _ in range(15):
        (real, integer), (kept_real, kept_integer) = both.look((x, R), 0.02)
        np.testing.assert_array_equal(kept_integer, integer)
        np.testing.assert_array_equal(kept_real, real)
        x, R = x + size * rng.normal(size=3), turn(rng.normal(size=3), size * rng.normal()) @ R
