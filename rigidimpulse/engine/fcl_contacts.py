"""The narrow phase "fcl" in a run: FCL's contacts and gaps for pairs of meshes, the own ones for all other pairs.

FCL's contacts get into the same buffer as the own ones, with the same names of what touches, so that all that follows is the same.
Where the surfaces of two meshes meet (bodies that start flush, or a little inside each other) FCL knows no normal. Such a pair has its own
manifold and its own sweep as long as it does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rigidimpulse.collision.distance.fcl_trees import TriangleTrees
from rigidimpulse.collision.manifold.fcl_contacts import FclManifolds, Limits, MeshContact, Placed
from rigidimpulse.collision.manifold.reduce import MAX_PER_NORMAL, reduce_contacts
from rigidimpulse.collision.time_of_impact.fcl_gaps import MEETS, Swept, sweep
from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep, no_impacts
from rigidimpulse.engine.narrow_phase import FCL, OwnContacts, mesh_bodies
from rigidimpulse.engine.pair_table import MARGIN, USED, PairTable
from rigidimpulse.engine.touching import Shared, near_pairs, witness_contacts
from rigidimpulse.model.world import World
from rigidimpulse.motion.evaluate import bring_all


class FclContacts(OwnContacts):
    """FCL's contacts and gaps of meshes."""

    def __init__(self, run: Any) -> None:
        """run: with its world, at its start."""
        world: World = run.world
        self._is_mesh = mesh_bodies(world)
        self._manifolds = FclManifolds(TriangleTrees(world.shapes, world.geometry))
        self._swept = Swept(
            self._manifolds, world.shape_of_body, world.size, world.bound_radius, run.detector.sweep_scratch.reach,
            world.accuracy.iterations,
        )  # fmt: skip

    def find_touching(self, run: Any, table: PairTable, shared: Shared, time: float) -> int:
        """The same order as that of `touching.find_touching`: from some bodies on, contact by contact."""
        world, found, state = run.world, run.finder.found, run.state
        used = int(table.number[USED])
        seen, near = np.zeros(used, bool), np.empty(used, np.int64)
        frontier = found.reached.copy()
        found.reached[:] = found.brought[:] = False
        count = 0
        while frontier.any():
            found.reached[frontier] = True
            number = near_pairs(state.trajectory, time, table, world.constants.bound_radius, frontier, seen, near)
            places = near[:number]
            # All that a position correction may come near is brought to `time` with what touches.
            mark = frontier | _tied(shared, frontier)
            mark[table.pairs["a"][places]] = mark[table.pairs["b"][places]] = True
            motion, fresh = run.motion, np.flatnonzero(mark & ~found.brought)
            found.brought[fresh] = True
            bring_all(motion.trajectory, fresh, time, motion.now, motion.rotation, motion.acceleration, motion.angular_acceleration)
            first = count
            count = self.contacts_at(run, table, places, MARGIN, count)
            if count >= 0:
                count = witness_contacts(table, places, time, found, first, count)
            if count < 0:
                return count
            mark = _tied(shared, frontier)
            mark[found.buffers.integer[first:count, :2]] = True
            frontier = mark & world.dynamic & ~found.reached
        return count

    def contacts_at(self, run: Any, table: PairTable, places: np.ndarray, margin: float, count: int) -> int:
        """Append FCL's contacts of the meshes among the pairs, and the own ones of the others."""
        pairs = table.pairs[places]
        asked = self._is_mesh[pairs["a"]] & self._is_mesh[pairs["b"]]
        own = ~asked
        with run.plan.clock(FCL):
            for k in np.flatnonzero(asked).tolist():
                contacts = self._contacts(run, pairs[k], margin)
                own[k] = contacts is None
                if contacts and count + len(contacts) >= len(run.finder.found.place):
                    return -(count + len(contacts) + 1)
                count = self._write(run, (int(places[k]), pairs[k]), contacts or [], count)
        return super().contacts_at(run, table, np.ascontiguousarray(places[own]), margin, count) if own.any() else count

    def sweep(self, run: Any, method: Callable[..., ImpactTimes], pairs: PairsToSweep, end: float) -> ImpactTimes:
        """First contacts by FCL's gaps where both bodies are meshes, by the method of the accuracy elsewhere."""
        world, result = run.world, no_impacts(len(pairs.a))
        asked = np.flatnonzero(self._is_mesh[pairs.a] & self._is_mesh[pairs.b])
        own = np.ones(len(pairs.a), bool)
        if len(asked):
            chosen = PairsToSweep(*(column[asked] for column in pairs))
            contact_margin = world.contact_margin * np.minimum(world.size[chosen.a], world.size[chosen.b])
            with run.plan.clock(FCL):
                found = sweep(self._swept, run.state.trajectory, chosen, contact_margin, end)
            own[asked] = found.status == MEETS
            for column, part in zip(result, found, strict=True):
                column[asked] = part
        if own.any():
            rest = super().sweep(run, method, PairsToSweep(*(np.ascontiguousarray(column[own]) for column in pairs)), end)
            for column, part in zip(result, rest, strict=True):
                column[own] = part
        return result

    def _contacts(self, run: Any, pair: np.void, margin: float) -> list[MeshContact] | None:
        """FCL's contacts of a pair at the present poses, None where the surfaces meet."""
        a, b, now, rotation = int(pair["a"]), int(pair["b"]), run.state.now, run.state.rotation
        shape_of_body, between = run.world.shape_of_body, now.position[b] - now.position[a]
        placed = Placed(int(shape_of_body[a]), int(shape_of_body[b]), rotation[a].T @ rotation[b], rotation[a].T @ between)
        contact_margin = float(pair["contact_margin"])
        return self._manifolds.contacts(placed, Limits(margin * contact_margin, contact_margin))

    def _write(self, run: Any, pair: tuple[int, np.void], contacts: list[MeshContact], first: int) -> int:
        """Append contacts of a pair (its place and row) to the buffers, which have the space, in the world; returns the new count."""
        place, (a, b) = pair[0], (int(pair[1]["a"]), int(pair[1]["b"]))
        found, axes, origin = run.finder.found, run.state.rotation[a], run.state.now.position[a]
        real, integer = found.buffers.real, found.buffers.integer
        for row, contact in enumerate(contacts, first):
            point_a, point_b = axes @ contact.point_a + origin, axes @ contact.point_b + origin
            real[row, :3], real[row, 3:6], real[row, 6:9], real[row, 9] = point_a, point_b, axes @ contact.normal, contact.gap
            integer[row] = a, b, contact.kind, contact.feature_a, contact.feature_b
        count = reduce_contacts(real, integer, first, first + len(contacts), MAX_PER_NORMAL)
        found.place[first:count] = place
        return count


def _tied(shared: Shared, frontier: np.ndarray) -> np.ndarray:
    """Whom (n,) bool links tie to bodies of the frontier, and those that share forces with them."""
    mark = np.zeros(len(frontier), bool)
    at = frontier[shared.links].any(axis=1)
    mark[shared.links[at]] = True
    sharing = shared.sharing[frontier & shared.under_contact]
    return mark | (shared.under_contact & np.isin(shared.sharing, sharing))
