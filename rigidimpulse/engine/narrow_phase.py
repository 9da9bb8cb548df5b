"""The slot `Accuracy.narrow_phase`: who finds contacts, and the gaps by which time is backed up.

    "exact"   own manifolds (`collision/manifold`) and safe steps (`collision/time_of_impact`), for all pairs
    "fcl"     FCL's contacts and gaps for pairs of meshes (`fcl_contacts`), the own ones for all other pairs
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.collision.geometry import ROUND, Geometry
from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep
from rigidimpulse.engine.touching import Shared, contacts_at, find_touching

if TYPE_CHECKING:
    from rigidimpulse.engine.pair_table import PairTable
    from rigidimpulse.model.world import World

FCL = "FCL contacts"
"""What `explain` calls the effect."""


class OwnContacts:
    """The own manifolds and sweeps, for all pairs."""

    def find_touching(self, run: Any, table: PairTable, shared: Shared, time: float) -> int:
        """Find what touches the bodies marked in `run.finder.found.reached`, as `touching.find_touching` does."""
        world = run.world
        return find_touching(world.compiled_shapes, world.constants, run.motion, table, shared, run.finder.found, time)

    def contacts_at(self, run: Any, table: PairTable, places: np.ndarray, margin: float, count: int) -> int:
        """Append the contacts of the pairs at these places, as `touching.contacts_at` does."""
        return contacts_at(run.world.compiled_shapes, run.motion, table, places, margin, run.finder.found, count)

    def sweep(self, run: Any, method: Callable[..., ImpactTimes], pairs: PairsToSweep, end: float) -> ImpactTimes:
        """First contacts of pairs until `end` [s], by the method of the accuracy."""
        return method(run.detector, run.state.trajectory, pairs, end)


def mesh_shapes(geometry: Geometry) -> np.ndarray:
    """Which shapes (s,) bool are meshes: triangles without a radius, and nothing else."""
    is_surface = (geometry.kind == ROUND) & (geometry.radius == 0.0) & (np.diff(geometry.vertex_first) > 2)
    first = geometry.shape_first
    return np.array([bool(is_surface[first[s] : first[s + 1]].all()) for s in range(len(first) - 1)], bool)


def mesh_bodies(world: World) -> np.ndarray:
    """Which bodies (n,) bool have a mesh as their shape."""
    return mesh_shapes(world.geometry)[world.shape_of_body]


def why_not_fcl(world: World) -> str:
    """Why no pair of a world is FCL's; empty where some are."""
    if world.accuracy.narrow_phase != "fcl":
        return f"narrow_phase is {world.accuracy.narrow_phase!r}: own manifolds at every pair"
    if FCL in world.left_out:
        return "left out by the caller"
    if not world.can_collide:
        return world.why_no_impacts
    meshes = mesh_bodies(world)
    if np.count_nonzero(meshes) < 2 or not np.any(world.dynamic & meshes):
        return "no two meshes may meet: own manifolds at every pair"
    return ""
