"""What every run keeps, whatever its scene: laws that need no reference, checked from outside.

    finite       every number of every frame
    apart        no two bodies are inside each other by more than DEPTH of the smaller one, in any frame (FCL's yes or no, which
                 still says yes with one of them moved by that much in any of six directions); by SOFT_DEPTH in runs with sub-stepped
                 islands, whose contacts are soft
    energy       E' = sum m |v - V|^2 / 2 + rotation - sum m a . (x - V t), seen from the supports, which all have the velocity V and so do
                 no work, never grows: by no more than ENERGY of the energy moved, and the contact gaps; in runs with sub-stepped islands
                 that is said of E' without what the ledger has as position correction, which is at most a rise by the skin
    momentum     p(t) = p(0) + sum m a t + impulse of the supports, which are the impacts' where nothing presses bodies on them, zero where
                 there is no support; with one floor it pushes only, and drags by no more than the greatest friction times that, and in
                 sub-stepped islands SOFT_CONE of it
                 (except by contact capture of contacts that leave slowly under load, which is in the ledger)
    angular      L(t) = L(0) + (x0 t + v0 t^2 / 2) x sum m a about the origin, where all bodies have the same a and nothing supports them
"""

from __future__ import annotations

import numpy as np
from scene_plans import ScenePlan, make_scene

import rigidimpulse as ri
from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.core.quaternion import multiply, rotate
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.scene.mass import body_mass

DEPTH, SOFT_DEPTH = 1e-6, 1e-2
"""The second is what the status allows such runs (`engine.measure.overlap`); 3.3e-3 is the most that 2,400 random scenes had."""
ENERGY, JOINT_ENERGY = 1e-6, 1e-3
"""Of the energy moved. Joints are of second order: some (w h)^2, 1e-3 for a radian in ten steps."""
MOMENTUM = 1e-10
"""Of the sum of m |v|: some thousand impulses, each to rounding or to the solver's 1e-12."""
FLOOR = 1e3
"""Times that, for what the floor gives, which lasting contacts make a sum of many forces."""
SOFT_CONE = 0.04
"""How near friction of impacts is to its cone in sub-stepped islands, see docs/theory/sub_stepping.md."""
ANGULAR = 1e-4
"""Of its scale. Forces of lasting contacts are constant over sub-steps in which their arms turn by 0.01 rad: its square."""
STEP = 1.0 / 60.0
"""s; jointed bodies that are drawn touching part to the contact gap in about a step, with a speed."""


def _is_soft(run: ri.Recording) -> bool:
    """Whether there were sub-stepped islands."""
    assert run.ledger is not None
    return "sub-stepping" in run.ledger.dissipated


def broken_laws(plan: ScenePlan, run: ri.Recording) -> list[str]:
    """One line for each law that a run of a plan breaks."""
    arrays = (run.positions, run.orientations, run.velocities, run.angular_velocities)
    if not all(np.all(np.isfinite(array)) for array in arrays):
        return ["numbers are not finite"]
    mass = np.array([body.mass for body in plan.bodies])
    acceleration = np.tile(plan.gravity, (len(mass), 1))
    acceleration[0] += np.array(plan.force) / mass[0]
    return [
        *_overlaps(plan, run),
        *_energy(plan, run, mass, acceleration),
        *_momentum(plan, run, mass, acceleration),
        *_angular_momentum(plan, run, mass, acceleration),
    ]


def _overlaps(plan: ScenePlan, run: ri.Recording) -> list[str]:
    """The pair that is first inside each other; pairs that a joint joins do not touch."""
    world = ri.compile_scene(make_scene(plan, inscribed=True))
    narrowphase, share = Narrowphase(world.shapes), SOFT_DEPTH if _is_soft(run) else DEPTH
    joined = {(joint.body - 1, joint.body) for joint in plan.joints if not joint.to_world}
    a, b = np.triu_indices(world.num_bodies, 1)
    wanted = world.dynamic[a] & np.array([(i, j) not in joined for i, j in zip(a.tolist(), b.tolist(), strict=True)])
    a, b = a[wanted], b[wanted]
    for f in range(1, len(run.times)):
        centers = run.positions[f] + rotate(run.orientations[f], world.offset)
        axes = multiply(run.orientations[f], world.turn)
        near = np.linalg.norm(centers[b] - centers[a], axis=1) < world.bound_radius[a] + world.bound_radius[b]
        for i, j in zip(a[near].tolist(), b[near].tolist(), strict=True):
            moved = share * min(world.size[i], world.size[j])
            poses = [(centers[j] + moved * way, axes[j]) for way in np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])]
            shapes = int(world.shape_of_body[i]), int(world.shape_of_body[j])
            if all(narrowphase.overlap(shapes[0], (centers[i], axes[i]), shapes[1], pose) for pose in poses):
                return [f"overlap of {world.names[i]} and {world.names[j]} at {run.times[f]:.4f} s"]
    return []


def _energy(plan: ScenePlan, run: ri.Recording, mass, acceleration) -> list[str]:
    """Growth of the energy seen from the supports, beyond what contact gaps allow."""
    assert run.ledger is not None
    ledger, velocity = run.ledger, np.array(plan.support_velocity)
    kinetic = ledger.kinetic - ledger.momentum @ velocity + 0.5 * mass.sum() * velocity @ velocity
    potential = ledger.potential + (mass @ acceleration) @ velocity * run.times
    skin = TOLERANCES.sub_stepping.skin if _is_soft(run) else 0.0
    # A dissipation: what rising to the skin gives is negative there.
    lifted = ledger.dissipated.get("position correction", np.zeros(1)) if skin else np.zeros(1)
    total = kinetic + potential + lifted
    rise = float((total - np.minimum.accumulate(total)).max())
    moved = float(kinetic.max() + np.ptp(potential))
    size = max(max(body.size) + body.size[2] * (body.shape == "capsule") for body in plan.bodies)
    weight = float(mass @ np.linalg.norm(acceleration, axis=1))
    gap = 2.0 * TOLERANCES.contact.margin * size
    allowed = (JOINT_ENERGY if plan.joints else ENERGY) * moved + gap * len(mass) * weight + 0.5 * mass.sum() * (gap / STEP) ** 2
    at = run.times[int(np.argmax(total - np.minimum.accumulate(total)))]
    if -lifted.min() > ENERGY * moved + skin * size * len(mass) * weight:
        return [f"position corrections give {-lifted.min():.1e} J, more than a rise by the skin"]
    return [f"energy grows by {rise:.1e} J until {at:.4f} s, {rise / moved:.1e} of what moves"] if rise > allowed else []


def _momentum(plan: ScenePlan, run: ri.Recording, mass, acceleration) -> list[str]:
    """Momentum that neither steady forces nor supports gave."""
    assert run.ledger is not None
    given = run.ledger.momentum - run.ledger.momentum[0] - run.times[:, None] * (mass @ acceleration)
    moved = float((mass * np.linalg.norm(run.velocities[:, : len(mass)], axis=2)).sum(axis=1).max())
    allowed = MOMENTUM * moved
    if any(joint.to_world for joint in plan.joints):
        return []
    # What supports give sub-stepped islands is no impact, either.
    pressed = bool({"contact", "stick"} & set(run.ledger.dissipated)) or _is_soft(run) or bool(plan.joints) or bool(np.any(acceleration))
    if plan.support == "none" or not pressed:
        error = float(np.abs(given - _impulse_of_supports(run, len(mass))).max())
        return [f"momentum off by {error:.1e} kg m/s, allowed {allowed:.1e}"] if error > allowed else []
    if plan.support == "floor" and not plan.joints:
        # Sums since the start: at a frame inside a sub-step each body has its own share of the forces of that sub-step.
        pull = float(-given[:, 2].min())
        drag = float((np.linalg.norm(given[:, :2], axis=1) - _greatest_friction(plan) * given[:, 2]).max())
        allowed = FLOOR * allowed + _captured(run, mass, moves=any(plan.support_velocity))
        allowed += SOFT_CONE * _greatest_friction(plan) * float(given[:, 2].max()) if _is_soft(run) else 0.0
        if max(pull, drag) > allowed:
            return [f"floor pulls by {pull:.1e} N s, drags too much by {drag:.1e} N s, allowed {allowed:.1e}"]
    return []


def _captured(run: ri.Recording, mass, moves: bool) -> float:
    """Pull of contact captures, N s: k of them that take E off the motion of m pull by sqrt(2 m E k) at most (Cauchy and Schwarz).

    Where the floor moves, its work is part of what the ledger has, which then may be of either sign.
    """
    assert run.ledger is not None
    energy = float(run.ledger.dissipated.get("stick", np.zeros(1))[-1])
    energy = abs(energy) if moves else max(energy, 0.0)
    return float(np.sqrt(2.0 * mass.sum() * energy * len(run.contacts)))


def _impulse_of_supports(run: ri.Recording, number: int) -> np.ndarray:
    """Sum of the impulses of supports on bodies until each frame (f, 3), N s, from the table of impacts."""
    impacts = run.impacts
    impulse = impacts["impulse"][:, None] * impacts["normal"] + impacts["tangent_impulse"]
    on_bodies = impulse * ((impacts["body_b"] < number) * 1.0 - (impacts["body_a"] < number))[:, None]
    sums = np.vstack([np.zeros(3), np.cumsum(on_bodies, axis=0)])
    return sums[np.searchsorted(impacts["time"], run.times, side="right")] * (run.times > 0.0)[:, None]


def _greatest_friction(plan: ScenePlan) -> float:
    """The largest coefficient of a body with the supports: the mean of both, as materials combine."""
    return max(0.5 * (body.friction[0] + plan.support_friction) for body in plan.bodies)


def _angular_momentum(plan: ScenePlan, run: ri.Recording, mass, acceleration) -> list[str]:
    """Angular momentum about the origin that steady forces did not give."""
    assert run.ledger is not None
    if plan.support != "none" or any(plan.force) or any(joint.to_world for joint in plan.joints):
        return []
    centers, velocities, t = run.centers[:, : len(mass)], run.velocities[:, : len(mass)], run.times[:, None]
    path = t * (mass @ centers[0]) + 0.5 * t**2 * (mass @ velocities[0])
    given = run.ledger.angular_momentum - run.ledger.angular_momentum[0] - np.cross(path, plan.gravity)
    scale = (mass * np.linalg.norm(centers, axis=2) * np.linalg.norm(velocities, axis=2)).sum(axis=1).max() + np.abs(
        [body_mass(body).moments.max() * np.linalg.norm(body.angular_velocity) for body in run.scene.bodies if body.motion == "dynamic"]
    ).sum()
    error = float(np.abs(given).max())
    return [f"angular momentum off by {error:.1e} kg m2/s, {error / scale:.1e} of it"] if error > ANGULAR * scale else []
