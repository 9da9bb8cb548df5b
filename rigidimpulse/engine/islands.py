"""Islands: which bodies hang together at one instant, found from some of them by following contacts, joints and forces.

Bodies that share the forces of an island come along when one of them is looked at, even if they touch nothing any more: those forces end
for all of them at once, or momentum would not be kept. A finder finds: it brings bodies to the instant and looks at their contacts, and
changes nothing else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.collision.contact_buffer import Question
from rigidimpulse.collision.distance.simplices import CORNER, FACE_VERTEX, VERTEX_FACE
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.dispatch import PairQuery
from rigidimpulse.engine.pair_table import MARGIN, live_contacts
from rigidimpulse.engine.regime import island_roots
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.touching import fill_contacts, near_pairs, pressing
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.model.island import Island, empty_contacts, island_without_contacts
from rigidimpulse.motion.evaluate import bring_all

if TYPE_CHECKING:
    from rigidimpulse.engine.pair_events import PairEvents

NO_SPEEDS = np.zeros(0)
FAR_MARGIN = 30.0
"""Contacts that a position correction may close are looked for within this many contact margins."""


def collect(
    run: Run, pair_events: PairEvents, pairs: np.ndarray, time: float, margin: float = MARGIN
) -> tuple[np.ndarray, np.ndarray]:
    """Manifolds of window pairs at the present poses within so many contact margins: copies of the filled buffer rows.

    A pair that just came to contact but has no manifold (it overlaps, since its sweep does not back up time) has the
    witness of its sweep for a contact.
    """
    world, state = run.world, run.state
    buffer, a, b = run.contact_buffer, pair_events.a[pairs], pair_events.b[pairs]
    query = PairQuery(a, b, margin * pair_events.contact_margin[pairs])
    shapes = Shapes(world.geometry, world.shape_of_body, world.cylinders)
    count = buffer.find(Question(shapes, state.now, state.rotation, query))
    real, integer = buffer.real[:count].copy(), buffer.integer[:count].copy()
    for p in pairs[pair_events.time[pairs] <= time].tolist():
        a, b = pair_events.a[p], pair_events.b[p]
        if not np.any((integer[:, 0] == a) & (integer[:, 1] == b)) and np.any(pair_events.witness[p, 6:9]):
            real = np.vstack([real, pair_events.witness[p]])
            integer = np.vstack([integer, np.array([a, b, CORNER, -1, -1])])
    return real, integer


def touching_islands(run: Run, pair_events: PairEvents, time: float, bodies: np.ndarray) -> tuple[list[Island], np.ndarray]:
    """Islands that the given bodies belong to at `time`, and all bodies looked at, which are brought to it."""
    world, state = run.world, run.state
    seen, near = np.zeros(len(pair_events.a), bool), np.empty(len(pair_events.a), np.int64)
    brought, reached = np.zeros(world.num_bodies, bool), np.zeros(world.num_bodies, bool)
    frontier = np.asarray(bodies, np.int64)
    reals, integers = [], []
    while len(frontier):
        reached[frontier] = True
        # All that a position correction may come near is brought to `time` with what touches.
        pairs = near[: near_pairs(state.trajectory, time, pair_events.pairs, FAR_MARGIN, world.bound_radius, frontier, seen, near)]
        partners = _partners(run, frontier)
        mark = np.zeros(world.num_bodies, bool)
        mark[frontier] = mark[pair_events.a[pairs]] = mark[pair_events.b[pairs]] = mark[partners] = True
        fresh = (mark & ~brought).nonzero()[0]
        brought[fresh] = True
        bring_all(
            state.trajectory, fresh, time, state.now, state.rotation, run.acceleration, run.angular_acceleration
        )
        run.forces.weigh(fresh, time)
        real, integer = collect(run, pair_events, pairs, time)
        reals.append(real)
        integers.append(integer)
        mark[:] = False
        mark[integer[:, 0]] = mark[integer[:, 1]] = mark[partners] = True
        frontier = (mark & world.dynamic & ~reached).nonzero()[0]
    if not reals:
        return [], frontier
    islands = _components(run, pair_events, time, reached, np.concatenate(reals), np.concatenate(integers))
    return islands, reached.nonzero()[0]


def _partners(run: Run, bodies: np.ndarray) -> np.ndarray:
    """All bodies of the joints at the given ones, those tied by forces, and those that share forces with them."""
    state = run.state
    partners = np.concatenate([run.joints.bodies_of(run.joints.at(bodies)), run.forces.partners(bodies)])
    pressed = bodies[state.under_contact[bodies]]
    if not len(pressed):
        return partners
    shares = np.zeros(len(state.sharing), bool)
    shares[state.sharing[pressed]] = True
    sharers = (state.under_contact & shares[state.sharing]).nonzero()[0]
    return np.concatenate([partners, sharers])


def _components(
    run: Run, pair_events: PairEvents, time: float, reached: np.ndarray, real: np.ndarray, integer: np.ndarray
) -> list[Island]:
    """Split contacts, joints and forces into islands joined by movable bodies, in order of their first body."""
    dynamic = run.world.dynamic
    joints = run.joints.at(np.flatnonzero(reached & dynamic))
    ends = [run.joints.bodies_of(np.array([j])) for j in joints.tolist()]
    tied = np.flatnonzero(reached & run.forces.acts)
    links = [integer[:, :2], *(end[[[0, -1]]] for end in ends), np.array(run.forces.ties(tied), np.int64).reshape(-1, 2)]
    first, second = np.concatenate(links).T
    root = island_roots(run.world.num_bodies, first, second, dynamic)
    owner = root[np.where(dynamic[integer[:, 0]], integer[:, 0], integer[:, 1])]
    owner_of_joint = root[np.array([run.joints.movable_end(j) for j in joints.tolist()], np.int64)]
    owner_of_tied = root[tied]
    owners = np.union1d(owner, owner_of_joint)
    islands = [
        make_island(run, pair_events, time, (real, integer), owner == o, joints[owner_of_joint == o], tied[owner_of_tied == o])
        for o in owners.tolist()
    ]
    if len(alone := tied[~np.isin(owner_of_tied, owners)]):
        now = run.state.now
        islands.append(island_without_contacts(time, alone, now.velocity[alone], now.angular_velocity[alone]))
    return islands


def make_island(
    run: Run, pair_events: PairEvents, time: float, found: tuple[np.ndarray, np.ndarray], which: np.ndarray, joints: np.ndarray,
    tied: np.ndarray,
) -> Island:
    """The island of the contacts marked in `which`, sorted by pair, of the given joints, and of the bodies tied to them by forces.

    found: contacts as `collect` gives them.
    """
    world, state = run.world, run.state
    real, integer = found
    rows, contacts = _sorted_contacts(run, real, integer, which.nonzero()[0])
    mark = np.zeros(world.num_bodies, bool)
    mark[contacts.body_a] = mark[contacts.body_b] = True
    if len(joints):
        mark[run.joints.bodies_of(joints)] = True
    mark[tied] = True
    members = (mark & world.dynamic).nonzero()[0]
    place = pair_events.find(contacts.body_a, contacts.body_b)
    island = Island(
        time=time,
        members=members,
        pairs=np.array(sorted(set(place.tolist())), np.int64),
        contacts=contacts,
        place=place,
        kinds=integer[rows, 2],
        features=integer[rows, 3:5],
        keys=[contact_key(*row) for row in integer[rows].tolist()],
        contact_margin=pair_events.contact_margin[place],
        approach=NO_SPEEDS,
        rest_speed=NO_SPEEDS,
        live=live_contacts(pair_events.pairs, place, contacts.gap, time),
        velocity=state.now.velocity[members],
        angular_velocity=state.now.angular_velocity[members],
        joints=joints,
    )
    classify(run, island)
    return island


def _sorted_contacts(run: Run, real: np.ndarray, integer: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, Contacts]:
    """The rows (m,) of the contact buffer sorted by pair, and their contacts."""
    if len(rows) > 1:
        rows = rows[np.lexsort((integer[rows, 4], integer[rows, 3], integer[rows, 2], integer[rows, 1], integer[rows, 0]))]
    world, contacts = run.world, empty_contacts(len(rows))
    fill_contacts(run.state.now, real, integer, rows, world.material_of_body, world.coefficients, contacts)
    return rows, contacts


def near_contacts(
    run: Run, pair_events: PairEvents, members: np.ndarray, time: float
) -> tuple[Contacts, np.ndarray, list[tuple[int, ...]]]:
    """What a position correction of the members may close: contacts with all that is near, contact margins [m], and keys."""
    near = np.empty(len(pair_events.a), np.int64)
    seen = np.zeros(len(pair_events.a), bool)
    count = near_pairs(run.state.trajectory, time, pair_events.pairs, FAR_MARGIN, run.world.bound_radius, members, seen, near)
    real, integer = collect(run, pair_events, near[:count], time, FAR_MARGIN)
    rows, contacts = _sorted_contacts(run, real, integer, np.arange(len(real)))
    place = pair_events.find(contacts.body_a, contacts.body_b)
    return contacts, pair_events.contact_margin[place], [contact_key(*row) for row in integer[rows].tolist()]


def contact_key(a: int, b: int, kind: int, feature_a: int, feature_b: int) -> tuple[int, ...]:
    """Who a contact is from step to step; a vertex that slides over a tiled face stays the same contact."""
    if kind == VERTEX_FACE:
        return a, b, kind, feature_a
    if kind == FACE_VERTEX:
        return a, b, kind, feature_b
    return a, b, kind, feature_a, feature_b


def classify(run: Run, island: Island) -> None:
    """Measure approach speeds and what presses each contact; slow approaches within the margin are live.

    Where an island is supported, whatever it carries is pressed by its steady acceleration (gravity, constant forces) as soon as the
    support bears, so that is the least that counts.
    """
    state, world = run.state, run.world
    contacts = island.contacts
    force = np.array([state.force_of(key)[0] for key in island.keys])
    least = 0.0
    if not (world.dynamic[contacts.body_a] & world.dynamic[contacts.body_b]).all():
        least = float(world.steady_strength[island.members].max())
    touching = (island.kinds, island.features, island.contact_margin, force)
    accelerations = (run.acceleration, run.angular_acceleration)
    island.approach, island.rest_speed = pressing(
        world.geometry, world.shape_of_body, state.rotation, state.now, contacts, touching, accelerations, (least, world.accuracy.step)
    )
    island.live |= np.abs(island.approach) <= island.rest_speed
