"""Buffers that kernels write runs into: they say when they are full, and what was in them stays when they grow."""

import numpy as np
import pytest

from rigidimpulse.model.island import empty_contacts
from rigidimpulse.recording.contact_log import ContactLog, close_contacts, has_contact_capacity, replace_contacts
from rigidimpulse.recording.events import CAUSES, FIRST_ROWS, IMPACT, EventLog, has_capacity, log_energy, log_stretch
from rigidimpulse.recording.impulses import ImpulseAccounts

TIMES = np.linspace(0.0, 1.0, 11)
BODIES = 6


def test_a_full_log_says_so_and_keeps_its_rows_when_it_grows() -> None:
    log = EventLog()
    for k in range(FIRST_ROWS):
        assert has_capacity(log.buffers, 1, 0, 0)
        log_energy(log.buffers, float(k), IMPACT, -1.0 - k)
    log_stretch(log.buffers, 0.0, 1.0, 3, 2.0, -1.0, True)
    assert has_capacity(log.buffers, 0, FIRST_ROWS - 1, FIRST_ROWS)
    assert not has_capacity(log.buffers, 1, FIRST_ROWS, 5 * FIRST_ROWS)
    log.grow()
    assert has_capacity(log.buffers, 1, FIRST_ROWS, 5 * FIRST_ROWS)
    log.account(99.0, "let go", 0.5)
    log.account(99.0, "let go", 0.0)  # nothing changed: no row
    assert log.energy["change"].tolist() == [*(-1.0 - np.arange(FIRST_ROWS)), 0.5]
    assert [CAUSES[k] for k in log.energy["cause"][-2:]] == ["impact", "let go"]
    assert log.stretches.tolist() == [(0.0, 1.0, 3, 2.0, -1.0, True)]


def contacts_between(dice: np.random.Generator, bodies: np.ndarray, count: int):
    """Contacts of bodies with each other and with body 0."""
    contacts = empty_contacts(count)
    for column in contacts:
        column[...] = 0
    ends = np.array([np.sort(dice.choice(np.append(0, bodies), 2, replace=False)) for _ in range(count)]).reshape(-1, 2)
    contacts.body_a[:], contacts.body_b[:] = ends.T
    contacts.normal[:] = (0.0, 0.0, 1.0)
    contacts.arm_a[:] = dice.normal(size=(count, 3))
    return contacts


def kept(seed: int, first_rows: int = 4096) -> tuple[np.ndarray, list[dict], int]:
    """What is left of random stretches, of which often only some bodies end: table, impulses by body, rows of the buffer."""
    dice = np.random.default_rng(seed)
    accounts = ImpulseAccounts(TIMES)
    log, time = ContactLog(TIMES, BODIES, accounts, first_rows), 0.0
    for _ in range(60):
        time += dice.choice([0.0, 0.004, 0.03])
        bodies = np.sort(dice.choice(np.arange(1, BODIES), dice.integers(1, BODIES), replace=False))
        log.close(bodies, time)
        if dice.random() < 0.7:
            contacts = contacts_between(dice, bodies, int(dice.integers(0, 9)))
            force = dice.normal(size=(len(contacts.gap), 3)) + (0.7, 0.0, 0.0)
            log.replace(bodies, time, contacts, np.zeros((BODIES, 3)), force)
    return log.table(), [accounts.of(i) for i in range(BODIES)], len(log.buffers.rows)


@pytest.mark.parametrize("seed", range(8))
def test_how_often_contacts_are_taken_out_changes_nothing(seed: int) -> None:
    table, impulses, _ = kept(seed)
    again, others, rows = kept(seed, first_rows=4)
    assert len(table) > 10
    assert rows <= 64  # open contacts only: some 9 a solution
    assert again.tobytes() == table.tobytes()
    for one, other in zip(impulses, others, strict=True):
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[key], other[key]) for key in one)


def test_of_a_stretch_only_the_contacts_of_bodies_that_leave_end() -> None:
    accounts = ImpulseAccounts(TIMES)
    log = ContactLog(TIMES, 4, accounts)
    contacts = contacts_between(np.random.default_rng(0), np.array([1, 2, 3]), 3)
    contacts.body_a[:], contacts.body_b[:] = (0, 1, 0), (1, 2, 3)
    assert has_contact_capacity(log.buffers, 3)
    replace_contacts(log.buffers, np.array([1, 2, 3]), 0.0, contacts, np.zeros((4, 3)), np.full((3, 3), (2.0, 0.0, 0.0)))
    close_contacts(log.buffers, np.array([1]), 0.0)  # they begin now
    assert np.isinf(log.buffers.rows["end"][:3]).all()
    close_contacts(log.buffers, np.array([1]), 0.5)
    assert log.buffers.rows["end"][:3].tolist() == [0.5, 0.5, np.inf]
    table = log.table()
    assert sorted(zip(table["body_b"].tolist(), table["end"].tolist(), strict=True)) == [(1, 0.5), (2, 0.5), (3, np.inf)]
    assert accounts.of(3)["contact with", 0][-1] == pytest.approx([0.0, 0.0, 2.0], rel=1e-12)
    assert accounts.of(2)["contact with", 1][-1] == pytest.approx([0.0, 0.0, 1.0], rel=1e-12)
