"""Settling a scene: a copy of it whose dynamic bodies are where a sum of energies is least."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import normalize
from rigidimpulse.dynamics.forces.energy.layout import Layout, compile_energies
from rigidimpulse.dynamics.forces.energy.minimise import Report
from rigidimpulse.dynamics.forces.energy.term import Energy, Poses
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.model.world import World
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.scene import Scene


class Settled(NamedTuple):
    """A settled scene, and how the minimisation went: unpacks as `scene, report`."""

    scene: Scene
    report: Report


def settle(scene: Scene, energies: Sequence[Energy], *, max_iterations: int = 2000) -> Settled:
    """Return a copy of a scene whose dynamic bodies are where a sum of energies is least.

    The minimum is one near the poses given, and stable: none of its neighbours is lower. Static and kinematic bodies stay, velocities and
    effects are kept; the scene given does not change. The order of energies and of bodies plays no part but in rounding.

    Args:
        scene: bodies, where the search begins.
        energies: PinPoints, RestoreShape, NoOverlap, PointOnSurface, GravityPotential.
        max_iterations: Newton steps tried at most.

    Returns:
        The scene, and a report: whether a minimum was found, the value in J, the largest force or torque left, the steps.

    Raises:
        SceneError: no energies, one of a path, a scene with joints or without a dynamic body, and what the terms refuse.

    Source: Witkin, Fleischer, Barr 1987 (energies); Nocedal, Wright 2006 (Newton's method).

    """
    world = compile_scene(scene)
    compiled = compile_energies(world, energies)
    if any(isinstance(effect, Joint) for effect in scene.effects):
        raise SceneError("the scene has joints, whose anchors are places in the world", "settle the bodies first, then add the joints")
    if not np.any(world.dynamic):
        raise SceneError("the scene has no dynamic body, and others do not move", "make a body dynamic")
    at, report = Layout(world, compiled).settled(max_iterations)
    return Settled(_with_poses(scene, world, at), report)


def _with_poses(scene: Scene, world: World, at: Poses) -> Scene:
    """Return a copy of a scene with its dynamic bodies elsewhere."""
    settled = Scene(scene.gravity)
    for i, body in enumerate(scene.bodies):
        changes: dict[str, Any] = {}
        if world.dynamic[i]:
            origin, orientation = world.body_pose(i, at.position[i], at.orientation[i])
            changes = {"position": tuple(origin.tolist()), "orientation": tuple(normalize(orientation).tolist())}
        settled.add(replace(body, **changes))
    for effect in scene.effects:
        settled.add(effect)
    return settled
