"""The stage constrain: which contacts last, kept at their gap, and the forces they carry until the end of the step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.constrain.drift import lift_contacts, needs_lift
from rigidimpulse.constrain.resting import CARRIER_A, CARRIER_B, SHARED, hold_contacts, turning_of
from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.groups import Group, collect, make_group, select
from rigidimpulse.detect.touching import refresh_pose
from rigidimpulse.observe.energy import kinetic_energy, mechanical_energy
from rigidimpulse.plan import Bound, Skip

# Residual of the solver that is reported, relative to the speed gained in the step.
UNSOLVED = 1e-6
# Contacts that leave or approach slower than the held ones by this much are held.
SLACK = 1e-9
CARRIER_OF_KIND = np.array([CARRIER_B, CARRIER_A, SHARED, SHARED, SHARED, SHARED])


@dataclass(frozen=True)
class ContactForces:
    """Lasting contact and joints, solved exactly for each group of touching or joined bodies."""

    stage: str = "constrain"
    name: str = "contact forces (newton)"

    def bind(self, world) -> Bound | Skip:
        """In where something can press bodies together."""
        if world.joints_of_scene:
            return Bound(hold, f"{len(world.joints_of_scene)} joints")
        if not world.can_collide:
            return Skip("nothing can collide")
        if not world.can_press:
            return Skip("no force, no moving support and no spin presses bodies together")
        return Bound(hold, "bodies may come to rest on each other")


def hold(context, window, group: Group) -> None:
    """Find the lasting contacts of a group and write the wrenches of its members into context.wrench."""
    if group.heap is not None:
        return
    context.wrench[group.members] = 0.0
    group.held = held_contacts(group)
    if not group.held.any() and not len(group.joints):
        return
    if needs_lift(group.contacts, group.held, group.delta):
        _lift(context, window, group)
    subset = np.flatnonzero(group.held)
    if not len(subset) and not len(group.joints):
        return
    state, now = context.state, context.state.now
    contacts = select(group.contacts, subset)
    kinds = np.minimum(group.kinds[subset], len(CARRIER_OF_KIND) - 1)
    carrier = CARRIER_OF_KIND[kinds]
    carrier[context.world.half_space[contacts.body_a]] = CARRIER_A
    carrier[context.world.half_space[contacts.body_b]] = CARRIER_B
    turning = turning_of(
        context.world.geometry, context.world.shape_of_body, state.rotation, now, contacts, carrier
    )
    keys = [group.keys[c] for c in subset]
    force = np.array([state.force_of(key) for key in keys]).reshape(-1, 3)
    before = kinetic_energy(now, context.world, group.members)
    h = window.end - group.time
    if len(group.joints):
        h, residual = context.joints.hold(context, group, contacts, np.arange(len(subset)), turning, force, h)
    else:
        residual = hold_contacts(
            now, contacts, np.arange(len(subset)), turning, context.acceleration, context.angular_acceleration, h,
            context.column, force, context.wrench,
        )
    context.log.book(group.time, "capture", kinetic_energy(now, context.world, group.members) - before)
    ends = np.concatenate([contacts.body_a, contacts.body_b])
    alone = len(group.members) == 1 and not len(group.joints) and not np.any(context.world.moving[ends])
    state.on_rest_of_world[group.members] = alone
    for key, f in zip(keys, force, strict=True):
        state.contact_force[key] = (f, group.time)
    if residual > UNSOLVED:
        names = tuple(context.world.names[i] for i in group.members)
        context.log.report(
            group.time, "contact forces not solved", names, f"residual {residual:.1e}; use a smaller step"
        )
    group.rests = _rests(context, group, h)
    if group.rests and len(group.joints):
        context.joints.log_rest(group)
    if h < window.end - group.time and not group.rests:
        window.wake[group.members] = group.time + h


def held_contacts(group: Group) -> np.ndarray:
    """Contacts that neither bounce nor come in fast: slower than the speed whose rise would be the held gap."""
    return np.abs(group.approach) <= group.rest_speed * (1.0 + SLACK) + group.still


def _lift(context, window, group: Group) -> None:
    """Bring sunken contacts back to their gap and look at the group's contacts again."""
    state, now = context.state, context.state.now
    before = mechanical_energy(now, context.world, group.members)
    lift_contacts(now, group.contacts, group.held, group.delta, context.column)
    refresh_pose(group.members, now, state.rotation, state.course.inertia)
    context.log.book(group.time, "lift", mechanical_energy(now, context.world, group.members) - before)
    group.moved = True
    real, integer = collect(context, window, group.pairs, group.time)
    if not len(real):
        group.held = np.zeros(0, bool)
        return
    acceleration, angular = context.acceleration[group.members].copy(), context.angular_acceleration[group.members].copy()
    again = make_group(context, window, group.time, real, integer, np.ones(len(real), bool), group.joints)
    for name in ("contacts", "place", "kinds", "keys", "delta", "approach", "rest_speed", "live"):
        setattr(group, name, getattr(again, name))
    context.acceleration[group.members], context.angular_acceleration[group.members] = acceleration, angular
    group.held = held_contacts(group)


def _rests(context, group: Group, h: float) -> bool:
    """Whether all members stand still and their loads are carried, on supports that do not move."""
    world, now = context.world, context.state.now
    i = group.members
    supports = np.unique(np.concatenate([group.contacts.body_a, group.contacts.body_b]))
    if len(group.joints):
        supports = np.union1d(supports, context.joints.bodies_of(group.joints))
    if np.any(world.moving[supports]):
        return False
    limit = TOLERANCES.rest * np.linalg.norm(world.gravity[i], axis=1) * h
    force, torque = context.wrench[i, :3], context.wrench[i, 3:]
    spin = context.angular_acceleration[i] + np.einsum("ijk,ik->ij", now.inv_inertia[i], torque)
    gained = h * (context.acceleration[i] + world.inv_mass[i, None] * force)
    size = np.minimum(world.bound_radius[i], world.size[i])[:, None]
    slow = (
        (np.linalg.norm(now.velocity[i], axis=1) <= limit)
        & (np.linalg.norm(gained, axis=1) <= limit)
        & (np.linalg.norm(size * now.angular_velocity[i], axis=1) <= limit)
        & (np.linalg.norm(size * h * spin, axis=1) <= limit)
    )
    return bool(np.all(slow))
