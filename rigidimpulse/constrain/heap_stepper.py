"""One step of heaps: bodies and pairs put before the kernels, sub-steps with contacts looked at in between, energy kept in bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidimpulse.constrain.heap_contacts import AHEAD, MOST_SUNK, convex_polyhedra, inner_radii, margins, shrunk_geometry, store_contacts
from rigidimpulse.constrain.heap_rows import HeapBodies, HeapPairs, set_poses
from rigidimpulse.constrain.heap_solver import FREQUENCY, advance, note_approach, outgrown, softness, stale_pairs
from rigidimpulse.constrain.heap_table import HeapTable
from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.broadphase import overlapping_pairs
from rigidimpulse.detect.touching import contacts_of_pairs
from rigidimpulse.observe.energy import mechanical_energy

COLUMN = 20.0
"""Bodies whose weight may press the skin in by PRESSED."""
PRESSED = 0.25
LEAST_SUB_STEPS, MOST_SUB_STEPS = 16, 256
"""Sub-steps in a whole step."""


@dataclass
class Outcome:
    """What a step of heaps gave: bodies (k,) of the scene, in order of the heap, their poses and velocities (k, 6) at its end."""

    members: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray


class HeapStepper:
    """Steps sets of bodies by the sub-stepped solver; holds what does not change, and the contacts.

    Attributes:
        order: (n,) bodies by their places at the start of the run; rank: (n,) place of each in it.
        inner: (n,) m, distance from the centre of mass to the nearest face; inf for what cannot be moved. skin: (n,) m.
        table: pairs and rows.

    """

    def __init__(self, world) -> None:
        """Shrink the shapes for the contact kernels."""
        n = world.num_bodies
        self.world = world
        self.order = np.lexsort(np.column_stack([np.arange(n), world.position[:, ::-1]]).T)
        self.rank = np.argsort(self.order, kind="stable")
        dynamic_shapes = np.zeros(len(world.geometry.shape_first) - 1, bool)
        dynamic_shapes[world.shape_of_body[world.dynamic]] = True
        self.inner = np.where(world.dynamic, inner_radii(world.geometry)[world.shape_of_body], np.inf)
        self.skin = TOLERANCES.skin * self.inner
        self.geometry, factor = shrunk_geometry(world.geometry, dynamic_shapes)
        self.factor = factor[world.shape_of_body]
        self.convex = convex_polyhedra(world.geometry)[world.shape_of_body]
        lost = self.factor < 1.0
        self._taken_off = np.zeros(n)
        self._taken_off[lost] = (1.0 - self.factor[lost]) * world.bound_radius[lost]
        self.reach = np.where(world.ball | ~np.isfinite(world.bound_radius), 0.0, world.bound_radius)
        self.table = HeapTable()
        self._n = n

    def sub_step(self, context, members: np.ndarray) -> float:
        """Length of a sub-step, s: short enough for the load of a column, so that it scales with the size of bodies."""
        strength = float(np.linalg.norm(context.acceleration[members], axis=1).max())
        step = context.world.accuracy.step
        pieces = LEAST_SUB_STEPS
        if strength > 0.0:
            h = 2.0 * math.pi * FREQUENCY * math.sqrt(PRESSED * float(self.skin[members].min()) / (COLUMN * strength))
            pieces = min(max(math.ceil(step / h), pieces), MOST_SUB_STEPS)
        return step / pieces

    def widening(self, context, members: np.ndarray, ahead: float) -> np.ndarray:
        """How far (k,) m the members come in `ahead` s, and a little more."""
        now = context.state.now
        speed = np.linalg.norm(now.velocity[members], axis=1) + ahead * np.linalg.norm(context.acceleration[members], axis=1)
        return AHEAD * self.inner[members] + ahead * speed

    def near_pairs(self, position: np.ndarray, members: np.ndarray, widen: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (a, b), a of lower rank, of members with each other and with `others` that may meet.

        position (n, 3) m; widen (k,) m of the members; others: bodies that stay where they are, or nearly so.
        """
        world, radius = self.world, self.world.bound_radius
        low, high = np.full((self._n, 3), np.inf), np.full((self._n, 3), -np.inf)
        low[others], high[others] = world.static_min[others], world.static_max[others]
        placed = others[world.dynamic[others] | world.moving[others]]
        low[placed], high[placed] = position[placed] - radius[placed, None], position[placed] + radius[placed, None]
        margin = np.zeros(self._n)
        margin[members] = widen + self.skin[members]
        low[members] = position[members] - (radius[members] + margin[members])[:, None]
        high[members] = position[members] + (radius[members] + margin[members])[:, None]
        movable = np.zeros(self._n, bool)
        movable[members] = True
        pairs = np.empty((max(64, 16 * len(members)), 2), np.int64)
        count = overlapping_pairs(low, high, movable, pairs)
        if count < 0:
            pairs = np.empty((-count, 2), np.int64)
            count = overlapping_pairs(low, high, movable, pairs)
        a, b = pairs[:count, 0], pairs[:count, 1]
        distance = np.linalg.norm(position[b] - position[a], axis=1)
        near = (distance <= radius[a] + radius[b] + margin[a] + margin[b]) | ~world.dynamic[a] | ~world.dynamic[b]
        a, b = a[near], b[near]
        swap = self.rank[a] > self.rank[b]
        return np.where(swap, b, a), np.where(swap, a, b)

    def set_up(self, context, members: np.ndarray, supports: np.ndarray, ahead: float) -> None:
        """Put members and what they may touch before the kernels at the present instant, with their contacts."""
        world, now = self.world, context.state.now
        body = np.concatenate([members, supports])
        self.body = body[np.argsort(self.rank[body], kind="stable")]
        self.members, self.supports, self.ahead = members, supports, ahead
        body = self.body
        movable = world.dynamic[body]
        mass = np.zeros((len(body), 7))
        mass[:, 0] = world.inv_mass[body]
        self.bodies = HeapBodies(
            position=now.position[body].copy(), orientation=now.orientation[body].copy(), rotation=np.zeros((len(body), 3, 3)),
            velocity=np.hstack([now.velocity[body], now.angular_velocity[body]]), mass=mass, inertia=world.inertia[body].copy(),
            gravity=np.where(movable[:, None], context.acceleration[body], 0.0), reach=self.reach[body],
            path=np.full(len(body), np.inf), loose=np.zeros(len(body), bool),
        )  # fmt: skip
        set_poses(self.bodies)
        self._number = np.full(self._n, -1, np.int64)
        self._number[body] = np.arange(len(body))
        self._stepping = np.zeros(self._n, bool)
        self._stepping[self.rank[members]] = True
        self._find_pairs(context)
        self._look(context)

    def _find_pairs(self, context) -> None:
        """Broad phase at the poses of `bodies`: which pairs there are; known ones keep their rows."""
        table, number, world = self.table, self._number, self.world
        at = number[self.members]
        position = np.zeros((self._n, 3))
        position[self.body] = self.bodies.position
        speed = np.linalg.norm(self.bodies.velocity[at, :3], axis=1)
        speed += self.ahead * np.linalg.norm(self.bodies.gravity[at], axis=1)
        widen = AHEAD * self.inner[self.members] + 1.5 * self.ahead * speed
        moving = number[self.supports[world.moving[self.supports]]]
        fastest = float(np.linalg.norm(self.bodies.velocity[moving, :3], axis=1).max(initial=0.0))
        self.bodies.path[at] = widen
        a, b = self.near_pairs(position, self.members, widen + self.ahead * fastest, self.supports)
        key = self.rank[a] * self._n + self.rank[b]
        self._write_back()
        table.replace(self._stepping[table.key // self._n] | self._stepping[table.key % self._n], np.sort(key))
        self.place = np.flatnonzero(self._stepping[table.key // self._n] | self._stepping[table.key % self._n])
        key = table.key[self.place]
        first, second = number[self.order[key // self._n]], number[self.order[key % self._n]]
        free = self.bodies.mass[:, 0] > 0.0
        ball, endless = (self.bodies.reach == 0.0) & free, (self.bodies.reach == 0.0) & ~free
        self.pairs = HeapPairs(
            first, second, ball[first] | endless[second], ball[first] | ball[second], table.start[self.place], table.count[self.place],
            table.slide[self.place], table.turn[self.place],
        )  # fmt: skip
        self._places = np.empty(len(first), np.int64)

    def _write_back(self) -> None:
        """Put what the kernels changed of pairs into the table."""
        pairs = getattr(self, "pairs", None)
        if pairs is not None:
            for name in ("start", "count", "slide", "turn"):
                getattr(self.table, name)[self.place] = getattr(pairs, name)

    def _look(self, context) -> None:
        """Look again at the contacts of pairs that may have others by now."""
        bodies, pairs, table, world = self.bodies, self.pairs, self.table, self.world
        count = stale_pairs(pairs, self._places)
        if not count:
            return
        places = self._places[:count].copy()
        margin = np.empty(count)
        inner, skin, body = self.inner[self.body], self.skin[self.body], self.body
        margins(bodies, pairs, places, inner, skin, self.ahead, margin)
        a, b = body[pairs.first[places]], body[pairs.second[places]]
        # Between shrunk bodies the gap is wider.
        shown = margin + self._taken_off[a] + self._taken_off[b]
        now = context.state.now
        poses = now._replace(position=now.position.copy(), orientation=now.orientation.copy())
        poses.position[body], poses.orientation[body] = bodies.position, bodies.orientation
        rotation = context.state.rotation.copy()
        rotation[body] = bodies.rotation
        while True:
            found = contacts_of_pairs(
                self.geometry, world.shape_of_body, poses, rotation, a, b, shown, context.scratch_pairs, context.contact_real,
                context.contact_int, world.cylinders,
            )  # fmt: skip
            if found >= 0:
                break
            context.grow_contacts(-found)
        self._write_back()
        # Beside what was found, bodies that sank get contacts of their own, and each row is written before it is known to be kept.
        table.make_room(found + MOST_SUNK * count + 1)
        pairs.start[:] = table.start[self.place]
        table.used = store_contacts(
            world.geometry, world.shape_of_body[body], world.material_of_body[body], world.coefficients, self.convex[body], bodies, pairs,
            places, margin, world.bound_radius[body], inner, skin, self.factor[body], context.contact_real, context.contact_int,
            found, body, table.rows, table.ids, table.used,
        )  # fmt: skip

    def step(self, context, time: float, end: float) -> Outcome:
        """Step what `set_up` put before the kernels from `time` to `end`."""
        bodies = self.bodies
        length = end - time
        count = max(math.ceil(length / self.sub_step(context, self.members) - 1e-9), 1)
        h = length / count
        soft = softness(h)
        note_approach(bodies, self.pairs, self.table.rows)
        strength = float(np.linalg.norm(bodies.gravity, axis=1).max())
        done, work = 0, 0.0
        while True:
            some, supplied = advance(bodies, self.pairs, self.table.rows, count - done, h, soft, strength, self._places)
            done, work = done + some, work + supplied
            if done == count:
                break
            if outgrown(bodies, h):
                self._find_pairs(context)
            self._look(context)
        self._write_back()
        at = self._number[self.members]
        outcome = Outcome(self.members, bodies.position[at], bodies.orientation[at], bodies.velocity[at])
        self._limit_energy(context, outcome, work)
        return outcome

    def _limit_energy(self, context, outcome: Outcome, work: float) -> None:
        """Take off the speeds what the step gained beyond the work of moving supports."""
        now, members = context.state.now, outcome.members
        before = mechanical_energy(now, self.world, members)
        ends = now._replace(
            position=now.position.copy(), orientation=now.orientation.copy(), velocity=now.velocity.copy(),
            angular_velocity=now.angular_velocity.copy(),
        )  # fmt: skip
        ends.position[members], ends.orientation[members] = outcome.position, outcome.orientation
        ends.velocity[members], ends.angular_velocity[members] = outcome.velocity[:, :3], outcome.velocity[:, 3:]
        after = mechanical_energy(ends, self.world, members)
        still = np.zeros_like(ends.velocity)
        kinetic = after - mechanical_energy(ends._replace(velocity=still, angular_velocity=still), self.world, members)
        gained = after - before - work
        if gained > 0.0 and kinetic > 0.0:
            outcome.velocity *= math.sqrt(max(1.0 - gained / kinetic, 0.0))
