"""Islands: which bodies hang together at one instant, found from some of them by following contacts, joints and forces.

A finder finds: it brings bodies to the instant and looks at their contacts, and changes nothing else. Its kernels are in `touching`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.engine.pair_table import MARGIN, mark_live
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.touching import (
    FAR_MARGIN,
    Pressing,
    Shared,
    fill_contacts,
    near_pairs,
    press,
    split_islands,
    witness_contacts,
)
from rigidimpulse.model.contact_memory import read_forces
from rigidimpulse.model.contacts import Contacts, Touching
from rigidimpulse.model.island import Island, empty_contacts, island_without_contacts

if TYPE_CHECKING:
    from rigidimpulse.engine.pair_events import PairEvents

FASTER = 2.0
"""Times by which bodies may become faster until something counts as near."""


def touching_islands(run: Run, pair_events: PairEvents, time: float, bodies: np.ndarray) -> tuple[list[Island], np.ndarray]:
    """Islands that the given bodies belong to at `time`, and all bodies looked at, which are brought to it."""
    if not len(bodies):  # where a step begins with sub-stepped islands alone
        return [], bodies
    finder = run.finder
    finder.links = np.concatenate([run.joints.links(), run.forces.links()])
    shared = Shared(run.state.under_contact, run.state.sharing, finder.links)
    count = -1
    while count < 0:
        finder.found.reached[:] = False
        finder.found.reached[bodies] = True
        count = run.narrow_phase.find_touching(run, pair_events.table, shared, time)
        if count < 0:
            finder.grow(-count)
    run.forces.weigh(np.flatnonzero(finder.found.brought), time)
    reached = finder.found.reached.copy()
    return _islands(run, pair_events, time, reached, count), reached.nonzero()[0]


def _islands(run: Run, pair_events: PairEvents, time: float, reached: np.ndarray, count: int) -> list[Island]:
    """The islands of the first `count` contacts found, and of joints and forces of the bodies reached, in order of their first body."""
    world, found = run.world, run.finder.found
    root, order = np.empty(world.num_bodies, np.int64), np.empty(count, np.int64)
    split_islands(world.dynamic, run.finder.links, found, count, root, order)
    integer = found.buffers.integer[order]
    owner = root[np.where(world.dynamic[integer[:, 0]], integer[:, 0], integer[:, 1])]
    joints = run.joints.at(np.flatnonzero(reached & world.dynamic))
    # Forces on sub-stepped bodies are those of their sub-steps.
    tied = np.flatnonzero(reached & run.forces.acts & world.dynamic & (run.substepped.label < 0))
    owner_of_joint = root[np.array([run.joints.movable_end(j) for j in joints.tolist()], np.int64)]
    owners = np.union1d(owner, owner_of_joint)
    first, last = owner.searchsorted(owners, side="left"), owner.searchsorted(owners, side="right")
    islands = [
        make_island(run, pair_events, time, order[i:j], joints[owner_of_joint == o], tied[root[tied] == o])
        for o, i, j in zip(owners.tolist(), first.tolist(), last.tolist(), strict=True)
    ]
    if len(tied) and len(alone := tied[~np.isin(root[tied], owners)]):
        now = run.state.now
        islands.append(island_without_contacts(time, alone, now.velocity[alone], now.angular_velocity[alone]))
    return islands


def make_island(run: Run, pair_events: PairEvents, time: float, rows: np.ndarray, joints: np.ndarray, tied: np.ndarray) -> Island:
    """The island of contacts in the rows (m,) of the buffers, sorted by pair, of joints, and of the bodies that forces tie to them."""
    world, state, found = run.world, run.state, run.finder.found
    contacts = _contacts(run, rows)
    mark = np.zeros(world.num_bodies, bool)
    mark[contacts.body_a] = mark[contacts.body_b] = True
    if len(joints):
        mark[run.joints.bodies_of(joints)] = True
    mark[tied] = True
    members = (mark & world.dynamic).nonzero()[0]
    place, m = found.place[rows], len(rows)
    island = Island(
        time=time,
        members=members,
        contacts=contacts,
        place=place,
        touching=_touching(run, rows),
        contact_margin=pair_events.table.pairs["contact_margin"][place],
        speeds=np.empty((2, m)),
        live=np.empty(m, bool),
        velocity=state.now.velocity[members],
        angular_velocity=state.now.angular_velocity[members],
        joints=joints,
    )
    if m:
        mark_live(pair_events.table.pairs, place, contacts.gap, time, island.live)
        classify(run, island)
    return island


def _touching(run: Run, rows: np.ndarray) -> Touching:
    """What touches, of the contacts in the rows (m,) of the buffers."""
    integer = run.finder.found.buffers.integer[rows]
    return Touching(np.ascontiguousarray(integer[:, 2]), np.ascontiguousarray(integer[:, 3:]))


def _contacts(run: Run, rows: np.ndarray) -> Contacts:
    """The contacts in the rows (m,) of the buffers."""
    world, contacts, buffers = run.world, empty_contacts(len(rows)), run.finder.found.buffers
    if len(rows):
        fill_contacts(run.state.now, buffers.real, buffers.integer, rows, world.material_of_body, world.coefficients, contacts)
    return contacts


def look_again(run: Run, pair_events: PairEvents, island: Island) -> Island:
    """The island of the same pairs and members after its bodies were moved."""
    pairs = np.unique(island.place)
    count = _collect(run, pair_events, pairs, island.time, MARGIN)
    rows = np.arange(count)
    integer = run.finder.found.buffers.integer[:count]
    rows = rows[np.lexsort((integer[:, 4], integer[:, 3], integer[:, 2], integer[:, 1], integer[:, 0]))]
    return make_island(run, pair_events, island.time, rows, island.joints, island.members)


def _collect(run: Run, pair_events: PairEvents, pairs: np.ndarray, time: float, margin: float) -> int:
    """Write the contacts of pairs at the present poses within `margin` contact margins into the buffers; returns their number."""
    finder, table = run.finder, pair_events.table
    while True:
        count = run.narrow_phase.contacts_at(run, table, pairs, margin, 0)
        if count >= 0:
            count = witness_contacts(table, pairs, time, finder.found, 0, count)
        if count >= 0:
            return count
        finder.grow(-count)


def near_contacts(run: Run, pair_events: PairEvents, members: np.ndarray, time: float) -> tuple[Contacts, np.ndarray, Touching]:
    """What a position correction of the members may close: contacts with all that is near, contact margins [m], and what touches."""
    table, n = pair_events.table, len(pair_events.pairs)
    near, asked = np.empty(n, np.int64), np.zeros(run.world.num_bodies, bool)
    asked[members] = True
    count = near_pairs(run.state.trajectory, time, table, run.world.bound_radius, asked, np.zeros(n, bool), near)
    count = _collect(run, pair_events, near[:count], time, FAR_MARGIN)
    integer = run.finder.found.buffers.integer[:count]
    rows = np.lexsort((integer[:, 4], integer[:, 3], integer[:, 2], integer[:, 1], integer[:, 0]))
    place = run.finder.found.place[rows]
    return _contacts(run, rows), table.pairs["contact_margin"][place], _touching(run, rows)


def forces_of(run: Run, contacts: Contacts, touching: Touching) -> np.ndarray:
    """Forces (m, 3) N that contacts carry until now, in their frames."""
    force = np.empty((len(contacts.gap), 3))
    if len(force):
        read_forces(run.state.memory, run.state.trajectory.start, contacts, touching, force)
    return force


def classify(run: Run, island: Island) -> None:
    """Measure approach speeds and what presses each contact; slow approaches within the margin are live.

    Where an island is supported, whatever it carries is pressed by its steady acceleration (gravity, constant forces) as soon as the
    support bears, so that is the least that counts.
    """
    world, contacts, least = run.world, island.contacts, 0.0
    if not len(contacts.gap):
        return
    if not (world.dynamic[contacts.body_a] & world.dynamic[contacts.body_b]).all():
        least = float(world.steady_strength[island.members].max())
    normal_force = np.ascontiguousarray(forces_of(run, contacts, island.touching)[:, 0])
    press(
        world.compiled_shapes, run.motion, contacts, island.touching, normal_force, Pressing(least, world.accuracy.step),
        island.contact_margin, island.speeds,
    )  # fmt: skip
    island.live |= np.abs(island.approach) <= island.rest_speed


def is_alone(run: Run, members: np.ndarray, rest: float, push: float = 0.0) -> bool:
    """Whether nothing can come near members in `rest` s, that may touch them, however they and all else may turn aside.

    push: m/s2, at most, by forces that vary on the members.
    """
    world, trajectory = run.world, run.state.trajectory
    if not world.can_collide:
        return True
    speed = np.sqrt((trajectory.velocity**2).sum(1))
    speed[members] = np.sqrt((run.state.now.velocity[members] ** 2).sum(1))
    pull = np.sqrt((world.steady_acceleration**2).sum(1))
    pushed = np.flatnonzero(run.forces.acts)
    pull[pushed] = np.maximum(pull[pushed], np.sqrt((trajectory.acceleration[pushed] ** 2).sum(1)))
    pull[members] += push
    reach = np.where(world.dynamic, rest * (FASTER * speed + rest * pull), 0.0)[:, None]
    low, high = run.box_min - reach, run.box_max + reach
    for i in members.tolist():
        far, at = reach[i] + world.bound_radius[i] + world.largest_contact_margin, run.state.now.position[i]
        near = np.flatnonzero(np.all((low <= at + far) & (high >= at - far), axis=1))
        near = near[near != i]
        if not world.is_apart(np.minimum(near, i), np.maximum(near, i)).all():
            return False
    return True
