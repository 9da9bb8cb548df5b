"""The memory of contacts against a dictionary that does the same."""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.collision.distance.simplices import EDGE_EDGE, FACE_VERTEX, VERTEX_FACE
from rigidimpulse.model.contact_memory import (
    bodies_in_sub_steps,
    forget_forces,
    grown,
    has_capacity,
    held_row,
    keep_forces,
    keep_wrenches,
    make_memory,
    place_of,
    read_forces,
    remember_rebound,
)
from rigidimpulse.model.contacts import Contacts, Touching

NUMBER = 40


def random_contacts(rng: np.random.Generator, pairs: int) -> tuple[Contacts, Touching]:
    """Contacts of random pairs of bodies, 1 to 9 of each, no two alike."""
    bodies = sorted({tuple(sorted(rng.choice(NUMBER, 2, replace=False).tolist())) for _ in range(pairs)})
    kinds = [rng.choice([VERTEX_FACE, FACE_VERTEX, EDGE_EDGE], rng.integers(1, 10)) for _ in bodies]
    rows = [(a, b, kind, k, 3 * k) for (a, b), mine in zip(bodies, kinds, strict=True) for k, kind in enumerate(mine)]
    a, b, kind, first, second = np.array(rows, np.int64).T.copy()
    m = len(rows)
    contacts = Contacts(a, b, *rng.normal(size=(3, m, 3)), *np.zeros((5, m)))
    return contacts, Touching(kind, np.column_stack([first, second]))


def test_forces_are_those_kept_last():
    """Random solutions, each of which replaces what its pairs carried; the dictionary holds the last one of each pair."""
    rng = np.random.default_rng(0)
    memory, known = make_memory(NUMBER, 16, 4, 8), {}
    start = np.zeros(NUMBER)
    for time in np.arange(1.0, 60.0):
        contacts, touching = random_contacts(rng, 5)
        m = len(contacts.gap)
        if not has_capacity(memory, m):
            memory = grown(memory, m)
        force = rng.normal(size=(m, 3))
        keep_forces(memory, NUMBER, time, contacts, touching, force)
        pairs = list(zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True))
        known.update({pair: {} for pair in pairs})
        for c, pair in enumerate(pairs):
            known[pair][touching.kind[c], *touching.feature[c].tolist()] = force[c]
        asked, what = random_contacts(rng, 30)
        out = np.empty((len(asked.gap), 3))
        read_forces(memory, start, asked, what, out)
        for c, pair in enumerate(zip(asked.body_a.tolist(), asked.body_b.tolist(), strict=True)):
            expected = known.get(pair, {}).get((what.kind[c], *what.feature[c].tolist()), np.zeros(3))
            np.testing.assert_array_equal(out[c], expected)


def test_forces_end_with_a_new_trajectory():
    """A force counts as long as neither body has taken a new trajectory since."""
    rng = np.random.default_rng(1)
    contacts, touching = random_contacts(rng, 1)
    memory, start, out = make_memory(NUMBER), np.zeros(NUMBER), np.empty((len(contacts.gap), 3))
    force = rng.normal(size=out.shape)
    keep_forces(memory, NUMBER, 1.0, contacts, touching, force)
    start[contacts.body_b[0]] = 1.0
    read_forces(memory, start, contacts, touching, out)
    np.testing.assert_array_equal(out, force)
    start[contacts.body_b[0]] = 1.5
    read_forces(memory, start, contacts, touching, out)
    np.testing.assert_array_equal(out, 0.0)


@pytest.mark.parametrize(("kind", "same"), [(VERTEX_FACE, True), (FACE_VERTEX, False)])
def test_a_vertex_that_slides_over_faces_stays_the_same_contact(kind: int, same: bool):
    """The face does not count: the feature of b where the vertex belongs to a, that of a where it belongs to b."""
    memory, out = make_memory(NUMBER), np.empty((1, 3))
    contacts = Contacts(np.array([1]), np.array([2]), *np.zeros((3, 1, 3)), *np.zeros((5, 1)))
    keep_forces(memory, NUMBER, 0.0, contacts, Touching(np.array([kind]), np.array([[5, 7]])), np.ones((1, 3)))
    read_forces(memory, np.zeros(NUMBER), contacts, Touching(np.array([kind]), np.array([[5, 8]])), out)
    np.testing.assert_array_equal(out, float(same))


def test_wrenches_are_the_sum_of_the_forces():
    """On b the forces and their moments about its centre, on a the opposite forces and their moments about its own."""
    rng = np.random.default_rng(2)
    contacts, touching = random_contacts(rng, 4)
    m = len(contacts.gap)
    memory, force, slides = make_memory(NUMBER), rng.normal(size=(m, 3)), rng.random(m) < 0.3
    keep_forces(memory, NUMBER, 1.0, contacts, touching, force)
    keep_wrenches(memory, NUMBER, 1.0, contacts, force, slides)
    force_on, moment_on = np.zeros((2, NUMBER, 3))
    for bodies, sign, arm in ((contacts.body_a, -1.0, contacts.arm_a), (contacts.body_b, 1.0, contacts.arm_b)):
        np.add.at(force_on, bodies, sign * force)
        np.add.at(moment_on, bodies, sign * np.cross(arm, force))
    np.testing.assert_allclose(memory.wrench, np.column_stack([force_on, moment_on]), atol=1e-13)
    for a, b in set(zip(contacts.body_a.tolist(), contacts.body_b.tolist(), strict=True)):
        mine = (contacts.body_a == a) & (contacts.body_b == b)
        assert memory.held[held_row(memory, a * NUMBER + b)]["slips"] == slides[mine].any()
    bodies = np.unique(np.concatenate([contacts.body_a, contacts.body_b]))
    np.testing.assert_array_equal(bodies_in_sub_steps(memory, NUMBER), bodies)
    np.testing.assert_array_equal(np.flatnonzero(memory.since == 1.0), bodies)
    forget_forces(memory, NUMBER, contacts)
    assert not len(bodies_in_sub_steps(memory, NUMBER)) and np.all(np.isnan(memory.since))


def test_rebounds_survive_growth():
    """10,000 pairs in a memory that began with 16 places."""
    memory = make_memory(NUMBER, 16, 4, 8)
    keys = np.random.default_rng(3).permutation(10_000)
    for key in keys.tolist():
        if not has_capacity(memory, 1):
            memory = grown(memory, 1)
        remember_rebound(memory, key, float(key), 2.0 * key, key % 7)
    at = np.array([place_of(memory, key) for key in keys.tolist()])
    np.testing.assert_array_equal(memory.key[at], keys)
    np.testing.assert_array_equal(memory.time[at], keys)
    np.testing.assert_array_equal(memory.count[at], keys % 7)
