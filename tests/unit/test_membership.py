"""Which bodies are members of sub-stepped islands, and which of them sleep: kernels against sets in plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.engine.cheapest import (
    FADING,
    FIRST,
    FLIGHT,
    JOINTED_PIECE,
    JOINTED_SOLVE,
    LOOK,
    PIECE,
    REASONS,
    WORSE,
    CheapestRegime,
    Near,
    exact_cost,
)
from rigidimpulse.engine.regime import RATIO
from rigidimpulse.engine.sleeping import SLEEP_SPEED
from rigidimpulse.engine.substepped.membership import Candidates, connect_members, settle_islands
from rigidimpulse.motion.body_state import BodyState

REST, STRENGTH, INNER = 3.0, 9.81, 0.1
SLEEPY = REST * np.sqrt(INNER / STRENGTH)


def sets_of(number: int, links: np.ndarray, mark: np.ndarray) -> list[set[int]]:
    """Sets of marked elements that links between them connect."""
    left, out = set(np.flatnonzero(mark).tolist()), []
    while left:
        found, frontier = set(), {left.pop()}
        while frontier:
            found |= frontier
            frontier = {int(j) for i in frontier for a, b in links for j in ((b,) if a == i else (a,) if b == i else ()) if mark[j]} - found
        left -= found
        out.append(found)
    return out


def random_case(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Members (n,) bool, near pairs (3, k) and links (m, 2), of which at least one has a member each."""
    rng = np.random.default_rng(seed)
    number = int(rng.integers(2, 25))
    member = rng.random(number) < 0.7
    pairs, links = (drawn[drawn[:, 0] != drawn[:, 1]] for drawn in (rng.integers(0, number, (30, 2)), rng.integers(0, number, (6, 2))))
    pairs = pairs[member[pairs].any(axis=1)]
    return member, np.vstack([pairs.T, rng.integers(0, 2, len(pairs))]), links


@pytest.mark.parametrize("seed", range(60))
def test_islands_are_the_sets_that_pairs_and_joints_connect(seed: int) -> None:
    member, near, links = random_case(seed)
    root, islands = np.empty(len(member), np.int64), Near(np.ones(len(member), bool), np.ones(len(member), bool))
    who, _ = candidates(np.random.default_rng(2000 + seed), member)
    who.mass[::3] *= RATIO
    connect_members(near, links, who, member, root, islands)
    assert np.array_equal(root < 0, ~member)
    expected = sets_of(len(member), np.vstack([near[:2].T, links]), member)
    assert sorted(map(min, expected)) == sorted(set(root[member].tolist()))
    for island in expected:
        assert {int(root[i]) for i in island} == {min(island)}
        assert islands.touches[min(island)] == any(a in island or b in island for a, b, _ in near.T)
        inside = [(who.mass[a], who.mass[b]) for a, b, _ in near.T if a in island and b in island]
        assert islands.unlike[min(island)] == any(max(masses) > RATIO * min(masses) for masses in inside)


def candidates(rng: np.random.Generator, member: np.ndarray) -> tuple[Candidates, BodyState]:
    """Bodies of like size, some of which have hardly moved for long. Of what is no member some has a path of its own."""
    number = len(member)
    sleepy = rng.random(number) < 0.6
    still, none, zeros = np.zeros(number, bool), np.zeros(number), np.zeros((number, 3))
    speed = np.where(sleepy, 1e-4, rng.uniform(0.01, 3.0, number)) * SLEEP_SPEED * np.sqrt(STRENGTH * INNER)
    velocity = np.zeros((number, 3))
    velocity[:, 0] = speed
    now = BodyState(zeros, np.zeros((number, 4)), velocity, zeros, none, np.zeros((number, 3, 3)))
    return Candidates(
        dynamic=~still, moving=~member & (rng.random(number) < 0.2), jointed=still, mass=rng.uniform(0.5, 2.0, number),
        inner=np.full(number, INNER), steady=zeros, strength=np.full(number, STRENGTH), label=np.full(number, -1),
        sleep_timer=np.where(sleepy, 2.0 * SLEEPY, 0.5 * SLEEPY), asleep=still.copy(),
        let_go=still.copy(),
    ), now  # fmt: skip


@pytest.mark.parametrize("seed", range(60))
def test_members_sleep_that_no_moving_one_can_wake(seed: int) -> None:
    """A mover of mass m and speed v wakes as many contacts away as its momentum reaches, one at least; joints wake together.

    Islands of which every member sleeps are not stepped. Driven ones, and what moving supports carry, never sleep.
    """
    rng = np.random.default_rng(1000 + seed)
    member, near, links = random_case(seed)
    number = len(member)
    root = np.empty(number, np.int64)
    who, now = candidates(rng, member)
    connect_members(near, links, who, member, root, Near(np.zeros(number, bool), np.zeros(number, bool)))
    who.let_go[:] = member & (rng.random(number) < 0.1)
    let_go = np.flatnonzero(who.let_go).tolist()
    driven = np.zeros(number, bool)
    driven[root[member][:1]] = bool(seed % 3 == 0)
    chosen, timer = member.copy(), who.sleep_timer
    sleeps = settle_islands(now, who, near, links, chosen, root, driven, REST)

    joined = sets_of(number, links, member)
    for a, b, touching in near.T.tolist():
        if touching and who.moving[[a, b]].any():
            driven[root[b if who.moving[a] else a]] = True
    restless = {i for i in np.flatnonzero(member).tolist() if timer[i] < SLEEPY or driven[root[i]]}
    restless |= {j for of_joints in joined if of_joints & restless for j in of_joints}
    assert np.array_equal(who.label[member], root[member])
    if restless == set(np.flatnonzero(member).tolist()):
        assert len(sleeps) == 0 and np.array_equal(chosen, member)
        return
    unit = SLEEP_SPEED * np.sqrt(STRENGTH * INNER) * who.mass[member].min()
    reach = {i: number if i in let_go else max(who.mass[i] * now.velocity[i, 0] / unit, 1.0) for i in restless}
    contacts = np.vstack([near[:2, near[2] > 0].T, links])
    for _ in range(number):
        for a, b in np.vstack([contacts, contacts[:, ::-1]]).tolist():
            if member[a] and member[b] and reach.get(a, -1.0) >= 1.0:
                reach[b] = max(reach.get(b, -1.0), reach[a] - 1.0)
    awake = {i for i, left in reach.items() if left >= 0.0}
    awake |= {j for of_joints in joined if of_joints & awake for j in of_joints}
    alive = {int(root[i]) for i in restless}
    assert set(np.flatnonzero(sleeps).tolist()) == set(np.flatnonzero(member).tolist()) - awake
    assert set(np.flatnonzero(chosen).tolist()) == {i for i in np.flatnonzero(member).tolist() if int(root[i]) in alive}
    assert np.array_equal(who.asleep, sleeps & chosen)
    assert not who.let_go.any()


NONE = np.full(3, -1)


def asked(
    regime: CheapestRegime, label: np.ndarray, solves: float, joined: bool = False, touches: bool = True, unlike: bool = False
) -> str:  # fmt: skip
    """Why an island of three bodies stays exact, by a regime that knows it; empty where it is sub-stepped."""
    root, near = np.zeros(3, np.int64), Near(np.array([touches, False, False]), np.array([unlike, False, False]))
    return regime.refusals(root, label, np.full(3, joined), near, np.full(3, solves)).get(0, "")


def test_an_island_goes_to_sub_steps_where_exact_contact_costs_more() -> None:
    """The exact regime costs s e(3); sub-steps are expected to cost FIRST. Where nothing is near there is nothing to step."""
    costly = 1.01 * FIRST / float(exact_cost.py_func(1.0, 3))
    assert asked(CheapestRegime(np.zeros(3, bool)), NONE, costly) == ""
    assert asked(CheapestRegime(np.zeros(3, bool)), NONE, 0.98 * costly) == REASONS[2]
    assert asked(CheapestRegime(np.zeros(3, bool)), NONE, costly, touches=False) == REASONS[1]
    assert asked(CheapestRegime(np.zeros(3, bool)), NONE, costly, unlike=True) == REASONS[4]
    assert asked(CheapestRegime(np.ones(3, bool)), NONE, costly, joined=True, unlike=True) == ""


@pytest.mark.parametrize("touches", [True, False])
def test_joints_count_as_many_solves(touches: bool) -> None:
    factor = JOINTED_SOLVE if touches else FLIGHT
    costly = 1.01 * JOINTED_PIECE / (factor * float(exact_cost.py_func(1.0, 3)))
    for part, why in ((1.0, ""), (0.98, REASONS[2])):
        expected = why if part * costly > 1.0 else asked(CheapestRegime(np.ones(3, bool)), NONE, 1.0, True, touches)
        assert asked(CheapestRegime(np.ones(3, bool)), NONE, part * costly, True, touches) == expected


@pytest.mark.parametrize("number", range(1, 15))
def test_nobody_is_asked_where_no_island_can_be_worth_sub_steps(number: int) -> None:
    """Below `most_solves` of all bodies `may_begin` says no, however they are shared out. Of twelve bodies and more it may always say yes.

    Joints ask at every step.
    """
    rng, alone = np.random.default_rng(number), np.zeros(number, bool)
    regime = CheapestRegime(alone)
    most = regime.most_solves(number, alone)
    assert (most > 0.0) == (number < 12)
    for _ in range(200 if most else 0):
        solves = rng.dirichlet(np.full(number, 0.3)) * most * rng.uniform(0.0, 1.0 - 1e-9)
        assert not regime.may_begin(solves, number, alone)
    assert regime.may_begin(np.full(number, 1.001 * max(most, 1.0)), number, alone)
    assert regime.most_solves(number, ~alone) == 0.0


def test_sub_steps_that_cost_more_than_they_save_end_and_are_remembered() -> None:
    """What was measured is expected from then on, and fades."""
    regime, solves = CheapestRegime(np.zeros(3, bool)), 2.0 * FIRST / float(exact_cost.py_func(1.0, 3))
    saved, here = 2.0 * FIRST, np.zeros(3, np.int64)
    assert asked(regime, NONE, solves) == ""
    looks = 6
    pieces = int(np.ceil((WORSE * saved - LOOK * looks) / PIECE))
    for piece in range(pieces):
        regime.note(np.arange(3), looks if piece == 0 else 0)
    assert asked(regime, here, solves) == REASONS[3]
    spent, steps = PIECE * pieces + LOOK * looks, 0
    while asked(regime, NONE, solves):
        steps += 1
    assert steps == pytest.approx(np.log(saved / spent) / np.log(FADING), abs=1.0)
