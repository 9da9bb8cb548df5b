"""Which scenes the event kernel of balls can advance."""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.geometry import HALF_SPACE
from rigidimpulse.engine.narrow_phase import why_not_fcl
from rigidimpulse.engine.regime import only_expensive, why_not_substepped
from rigidimpulse.engine.spheres.layout import BALL, OTHER, PLANE
from rigidimpulse.model.world import World

ARRIVED, STEP, GO_ON, FULL = 0, 1, 2, 3
"""How a flight of the kernel ends: at its end; at a boundary whose step is not simple; between boundaries, at something that is not
simple; at a table that is full."""


def why_not(world: World) -> str:
    """Why a scene is left to the loop in Python; empty where it is not."""
    accuracy = world.accuracy
    if not world.can_collide:
        return world.why_no_impacts
    kind = kinds(world)
    if not np.any(world.dynamic & (kind == BALL)) or np.count_nonzero(kind != OTHER) < 2:
        return "no ball may meet another one or a plane"
    if not np.all(np.isfinite(world.bound_radius[kind == OTHER])):
        return "half spaces that move, or in parts"
    if not why_not_fcl(world):
        return "contacts of meshes are FCL's"
    if world.joints_of_scene or world.force_tables:
        return "joints" if world.joints_of_scene else "forces vary"
    if world.triggers:
        return "triggers are looked at after every step"
    if accuracy.impact_time not in ("bisection", "conservative") or accuracy.response == "kinematic":
        return f"{accuracy.impact_time}, {accuracy.response}"
    return "" if why_not_substepped(world) or only_expensive(world) else "bodies may pile up"


def kinds(world: World) -> np.ndarray:
    """(n,) BALL, PLANE or OTHER."""
    geometry, shape = world.geometry, world.shape_of_body
    first = geometry.shape_first[shape]
    plane = (geometry.kind[first] == HALF_SPACE) & (geometry.shape_first[shape + 1] == first + 1) & ~world.moving & ~world.dynamic
    driven = np.array([body.keyframes is not None for body in world.scene.bodies], bool)
    carried = np.array([body.release_time is not None for body in world.scene.bodies], bool)
    ball = world.ball & ~carried & np.all(world.inertia == world.inertia[:, :1], axis=1)
    return np.where(ball, BALL, np.where(plane & ~driven, PLANE, OTHER))
