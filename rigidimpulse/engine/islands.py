"""Groups of touching bodies at one instant, found from some of their bodies by following contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.collision.distance.simplices import CORNER, FACE_VERTEX, VERTEX_FACE
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.energy_limit import limit_energy, note_end_energy
from rigidimpulse.dynamics.constraints.rattle import project_velocities
from rigidimpulse.dynamics.impact.point import Contacts
from rigidimpulse.engine.pair_table import live_contacts
from rigidimpulse.engine.touching import bring_all, fill_contacts, near_pairs, pressing

if TYPE_CHECKING:
    from rigidimpulse.engine.exact.joints import JointState

MARGIN, FAR_MARGIN = 2.0, 30.0
"""Contacts are looked for within this many delta, and those that a lift of bodies may close."""
NO_FORCE = np.zeros(3)
CORRECTED = 10.0
"""Approach speed that a lift may make, in held gaps of turning (gap over size) times the speed: arms and normals turn a little."""
SLACK = 1e-9
"""Contacts that leave or approach slower than the held ones by this part are held."""


@dataclass
class Island:
    """Bodies joined by contacts at `time`.

    Attributes:
        members: movable bodies, in order of index.
        pairs: places in the window of the contacting pairs.
        contacts: all contacts within the margin; `place` (m,) their pairs, `kinds` (m,) and `features` (m, 2) what touches, `keys`
            who they are.
        delta: (m,) gap at which lasting contacts are held, m.
        approach: (m,) u.n, m/s; negative approaches.
        rest_speed: (m,) a slower rebound is none, m/s.
        live: (m,) bool, near enough for an impact now.
        velocity, angular_velocity, position: of the members as they arrived.
        moved: whether a lift has changed poses. shift: m, how far it moved points of the members at most.
        held: (m,) bool, contacts that carry forces. rests: whether all members stand still.
        zero_speed: m/s, approach speed that counts as none. scale: m/s, largest speed of a contact point.
        joints: the joints of the members.
        heap: members that are stepped as a heap (see `engine/substepped/advance`), None where there is none.
        free: accelerations and angular accelerations (k, 3) of the members but for varying forces, None where these do not act.
        loaded: whether varying forces are constant over the sub-step of contacts or joints.

    """

    time: float
    members: np.ndarray
    pairs: np.ndarray
    contacts: Contacts
    place: np.ndarray
    kinds: np.ndarray
    features: np.ndarray
    keys: list[tuple[int, ...]]
    contact_margin: np.ndarray
    approach: np.ndarray
    rest_speed: np.ndarray
    live: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    moved: bool = False
    shift: float = 0.0
    held: np.ndarray | None = None
    rests: bool = False
    zero_speed: float = 0.0
    scale: float = 0.0
    joints: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    substepped: np.ndarray | None = None
    free: tuple[np.ndarray, np.ndarray] | None = None
    loaded: bool = False

    def load(self, context, h: float) -> float:
        """Take varying forces as constant over a sub-step of h s at most; returns how long it may be."""
        return h if self.free is None else context.forces.load(context, self, h)

    def slow(self) -> np.ndarray:
        """Contacts (m,) that neither bounce nor come in fast: slower than the speed whose rise would be the held gap."""
        zero_speed = self.zero_speed
        if self.moved:
            zero_speed += CORRECTED * self.scale * TOLERANCES.contact.margin
        return np.abs(self.approach) <= self.rest_speed * (1.0 + SLACK) + zero_speed


def empty_contacts(m: int) -> Contacts:
    """Arrays for m contacts."""
    return Contacts(*np.empty((2, m), np.int64), *np.empty((3, m, 3)), *np.empty((5, m)))


def collect(context, pair_events, pairs: np.ndarray, time: float, margin: float = MARGIN) -> tuple[np.ndarray, np.ndarray]:
    """Manifolds of window pairs at the present poses within so many held gaps: copies of the filled buffer rows.

    A pair that just came to contact but has no manifold (it overlaps, since its sweep does not back up time) has the
    witness of its sweep for a contact.
    """
    world, state = context.world, context.state
    buffer, a, b = context.contact_buffer, pair_events.a[pairs], pair_events.b[pairs]
    count = buffer.find(world.geometry, world, state.now, state.rotation, a, b, margin * pair_events.contact_margin[pairs])
    real, integer = buffer.real[:count].copy(), buffer.integer[:count].copy()
    for p in pairs[pair_events.time[pairs] <= time].tolist():
        a, b = pair_events.a[p], pair_events.b[p]
        if not np.any((integer[:, 0] == a) & (integer[:, 1] == b)) and np.any(pair_events.witness[p, 6:9]):
            real = np.vstack([real, pair_events.witness[p]])
            integer = np.vstack([integer, np.array([a, b, CORNER, -1, -1])])
    return real, integer


def touching_islands(context, pair_events, time: float, bodies: np.ndarray) -> tuple[list[Island], np.ndarray]:
    """Groups that the given bodies belong to at `time`, and all bodies looked at, which are brought to it.

    Bodies that share the forces of a group come along when one of them is looked at, even if they touch nothing any more: those
    forces end for all of them at once, or momentum would not be kept.
    """
    world, state = context.world, context.state
    seen, near = np.zeros(len(pair_events.a), bool), np.empty(len(pair_events.a), np.int64)
    brought, reached = np.zeros(world.num_bodies, bool), np.zeros(world.num_bodies, bool)
    frontier = np.asarray(bodies, np.int64)
    reals, integers = [], []
    while len(frontier):
        reached[frontier] = True
        # All that a lift may come near is brought to `time` with what touches.
        pairs = near[: near_pairs(state.trajectory, time, pair_events.pairs, FAR_MARGIN, world.bound_radius, frontier, seen, near)]
        partners = _partners(context, frontier)
        mark = np.zeros(world.num_bodies, bool)
        mark[frontier] = mark[pair_events.a[pairs]] = mark[pair_events.b[pairs]] = mark[partners] = True
        fresh = (mark & ~brought).nonzero()[0]
        brought[fresh] = True
        bring_all(
            state.trajectory, fresh, time, state.now, state.rotation, context.acceleration, context.angular_acceleration
        )
        if context.forces is not None and context.forces.flow is not None:
            context.forces.flow.weigh(fresh, time)
        real, integer = collect(context, pair_events, pairs, time)
        reals.append(real)
        integers.append(integer)
        mark[:] = False
        mark[integer[:, 0]] = mark[integer[:, 1]] = mark[partners] = True
        frontier = (mark & world.dynamic & ~reached).nonzero()[0]
    if not reals:
        return [], frontier
    integer = np.concatenate(integers)
    islands = []
    if len(integer) or context.joints is not None or context.forces is not None:
        islands = _components(context, pair_events, time, reached, np.concatenate(reals), integer)
    _end_sub_steps(context, islands, time, reached.nonzero()[0])
    return islands, reached.nonzero()[0]


def _partners(context, bodies: np.ndarray) -> np.ndarray:
    """All bodies of the joints at the given ones, those tied by forces, and those that share forces with them; themselves included."""
    state = context.state
    partners = np.zeros(0, np.int64) if context.joints is None else context.joints.bodies_of(context.joints.at(bodies))
    if context.forces is not None:
        partners = np.concatenate([partners, context.forces.partners(bodies)])
    pressed = bodies[state.under_contact[bodies]]
    if not len(pressed):
        return partners
    shares = np.zeros(len(state.sharing), bool)
    shares[state.sharing[pressed]] = True
    sharers = (state.under_contact & shares[state.sharing]).nonzero()[0]
    return np.concatenate([partners, sharers])


def _components(context, pair_events, time: float, reached, real: np.ndarray, integer: np.ndarray) -> list[Island]:
    """Split contacts and joints into groups joined by movable bodies, in order of their first body."""
    dynamic = context.world.dynamic
    parent: dict[int, int] = {}

    def root(i: int) -> int:
        while parent.setdefault(i, i) != i:
            i = parent[i]
        return i

    def join(a: int, b: int) -> None:
        if dynamic[a] and dynamic[b]:
            low, high = sorted((root(a), root(b)))
            parent[high] = low

    ends_of_contacts = integer[:, :2].tolist()
    for a, b in ends_of_contacts:
        join(a, b)
    jointed: JointState | None = context.joints
    joints, at = np.zeros(0, np.int64), []
    if jointed is not None:
        joints = jointed.at(np.flatnonzero(reached & dynamic))
        for j in joints.tolist():
            ends = jointed.bodies_of(np.array([j])).tolist()
            join(ends[0], ends[-1])
            at.append(jointed.movable_end(j))
    forced = np.zeros(0, np.int64)
    if context.forces is not None:
        forced = np.flatnonzero(reached & context.forces.acts)
        for first, i in context.forces.ties(forced):
            join(first, i)
    owner = np.array([root(a if dynamic[a] else b) for a, b in ends_of_contacts], np.int64)
    owner_of_joint = np.array([root(i) for i in at], np.int64)
    owner_of_forced = np.array([root(i) for i in forced.tolist()], np.int64)
    owners, islands = sorted({*owner.tolist(), *owner_of_joint.tolist()}), []
    for o in owners:
        tied = forced[owner_of_forced == o]
        islands.append(make_island(context, pair_events, time, real, integer, owner == o, joints[owner_of_joint == o], tied))
    if len(forced) and len(free := forced[~np.isin(owner_of_forced, owners)]):
        islands.append(_free_island(context, time, free))
    return islands


def _free_island(context, time: float, members: np.ndarray) -> Island:
    """Bodies that nothing but forces hold: no contacts, no joints."""
    none, now = np.zeros(0, np.int64), context.state.now
    return Island(
        time, members, none, empty_contacts(0), none, none, np.zeros((0, 2), np.int64), [], np.zeros(0), np.zeros(0), np.zeros(0),
        np.zeros(0, bool), now.velocity[members], now.angular_velocity[members],
    )


def _end_sub_steps(context, islands: list[Island], time: float, bodies: np.ndarray) -> None:
    """What happens to all bodies brought at once when forces that were constant over a sub-step end."""
    for island in islands:
        if project_velocities(context, island):
            classify(context, island)
    note_end_energy(context, bodies.tolist())
    for island in islands:
        if len(island.joints):
            context.joints.project_velocities(context, island)
            classify(context, island)
    slowed = limit_energy(context, bodies.tolist(), time)
    for island in islands:
        if not slowed.isdisjoint(island.members.tolist()):
            classify(context, island)


def make_island(
    context, pair_events, time: float, real: np.ndarray, integer: np.ndarray, which: np.ndarray, joints: np.ndarray, tied: np.ndarray
) -> Island:
    """The group of the contacts marked in `which`, sorted by pair, of the given joints, and of the bodies tied to them by forces."""
    world, state = context.world, context.state
    rows, contacts = _sorted_contacts(context, real, integer, which.nonzero()[0])
    mark = np.zeros(world.num_bodies, bool)
    mark[contacts.body_a] = mark[contacts.body_b] = True
    if len(joints):
        mark[context.joints.bodies_of(joints)] = True
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
        approach=np.empty(len(rows)),
        rest_speed=np.empty(len(rows)),
        live=live_contacts(pair_events.pairs, place, contacts.gap, time),
        velocity=state.now.velocity[members],
        angular_velocity=state.now.angular_velocity[members],
        joints=joints,
    )
    classify(context, island)
    return island


def _sorted_contacts(context, real: np.ndarray, integer: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, Contacts]:
    """The rows (m,) of the contact buffer sorted by pair, and their contacts."""
    if len(rows) > 1:
        rows = rows[np.lexsort((integer[rows, 4], integer[rows, 3], integer[rows, 2], integer[rows, 1], integer[rows, 0]))]
    world, contacts = context.world, empty_contacts(len(rows))
    fill_contacts(context.state.now, real, integer, rows, world.material_of_body, world.coefficients, contacts)
    return rows, contacts


def near_contacts(context, pair_events, members: np.ndarray, time: float) -> tuple[Contacts, np.ndarray, list[tuple[int, ...]]]:
    """What a lift of the members of a group may close: contacts with all that is near at `time`, held gaps [m], and keys."""
    near = np.empty(len(pair_events.a), np.int64)
    seen = np.zeros(len(pair_events.a), bool)
    count = near_pairs(context.state.trajectory, time, pair_events.pairs, FAR_MARGIN, context.world.bound_radius, members, seen, near)
    real, integer = collect(context, pair_events, near[:count], time, FAR_MARGIN)
    rows, contacts = _sorted_contacts(context, real, integer, np.arange(len(real)))
    place = pair_events.find(contacts.body_a, contacts.body_b)
    return contacts, pair_events.contact_margin[place], [contact_key(*row) for row in integer[rows].tolist()]


def contact_key(a: int, b: int, kind: int, feature_a: int, feature_b: int) -> tuple[int, ...]:
    """Who a contact is from step to step; a vertex that slides over a tiled face stays the same contact."""
    if kind == VERTEX_FACE:
        return a, b, kind, feature_a
    if kind == FACE_VERTEX:
        return a, b, kind, feature_b
    return a, b, kind, feature_a, feature_b


def classify(context, island: Island) -> None:
    """Measure approach speeds and what presses each contact; slow approaches within the margin count as live.

    Where a group is supported, whatever it carries is pressed by its steady acceleration (gravity, constant forces) as soon as the support
    bears, so that is the least that counts.
    """
    state, world = context.state, context.world
    contacts = island.contacts
    force = np.array([state.force_of(key)[0] for key in island.keys])
    least = 0.0
    if not (world.dynamic[contacts.body_a] & world.dynamic[contacts.body_b]).all():
        least = float(world.steady_strength[island.members].max())
    pressing(
        world.geometry, world.shape_of_body, state.rotation, state.now, contacts, island.kinds, island.features,
        context.acceleration, context.angular_acceleration, force, least, world.accuracy.step, island.contact_margin, island.approach,
        island.rest_speed,
    )
    island.live |= np.abs(island.approach) <= island.rest_speed
