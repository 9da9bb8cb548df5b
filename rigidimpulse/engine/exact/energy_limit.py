"""The energy limiter: no energy from constant contact forces.

Over a sub-step contact forces are constant while contacts move, so they do a little work that they should not. Bodies that
together touched nothing but each other and ground of one velocity cannot have gained energy, seen from that ground: what they
gained is taken off what moves against the motion of their common rigid body, V, W, by one factor:

    v_i = V + W x (x_i - X) + dv_i,  w_i = W + dw_i,    T = T_rigid(V, W) + T_d(dv, dw),    T_d' = T_d - gained

T_rigid and T_d are orthogonal, so momentum and angular momentum stay. Ground that takes part pushes along some directions, and turns
about those across them: V and W then have only what is left, the part of the common motion whose momentum no such push changes (along
a smooth floor: V level, W upright), and are zero where the ground has friction.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.energy import kinetic_energy, mechanical_energy
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.model.island import Island
from rigidimpulse.model.state import Ground
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState

PARALLEL = TOLERANCES.contact_forces.same_direction


def note_hold(run: Run, island: Island, contacts: Contacts, force: np.ndarray) -> None:
    """Remember who shares the forces (m, 3) of the held contacts from now on, and whether they may make energy."""
    state, first = run.state, int(island.members[0])
    ground = _passive_ground(run, island, contacts, bool(np.any(force[:, 0] > 0.0)))
    state.sharing[island.members] = first
    state.closed[island.members] = ground is not None
    if ground is not None:
        state.ground[first] = ground


def _passive_ground(run: Run, island: Island, contacts: Contacts, presses: bool) -> Ground | None:
    """What stands by an island, or None where forces may make energy.

    They may not where all that stands moves with one velocity, joints are neither driven nor springs, and no other force varies.
    presses: whether contacts press.
    """
    world, now = run.world, run.state.now
    pairs = np.column_stack([contacts.body_a, contacts.body_b])
    stands = ~world.dynamic[pairs]
    supports, rough = np.unique(pairs[stands]), bool(np.any(stands.any(axis=1) & (contacts.static_friction > 0.0)))
    passive, tied = island.free is None, False
    if len(island.joints):
        ends = run.joints.bodies_of(island.joints)
        tied = run.joints.hold_to_world(island.joints)
        rough = rough or tied or not np.all(world.dynamic[ends])
        supports = np.union1d(supports, ends[~world.dynamic[ends]])
        # Without contact joints keep energy by themselves, up and down: what they gain they lose.
        passive = passive and run.joints.are_passive(island.joints) and presses
    velocity = now.velocity[supports[0]].copy() if len(supports) else np.zeros(3)
    steady = not np.any(now.angular_velocity[supports]) and not np.any(now.velocity[supports] != velocity)
    if not (passive and steady) or (tied and np.any(velocity)):
        return None
    return Ground(velocity, np.eye(3) if rough else contacts.normal[stands.any(axis=1)])


def limit_correction_energy(run: Run, island: Island, contacts: Contacts, way: np.ndarray, depth: float) -> None:
    """Take off the members' speeds what a position correction by `way` (k, 3) m gained.

    That is beyond their weight times the depth [m] that contacts may sink.
    """
    world, now, members = run.world, run.state.now, island.members
    weight = world.mass[members, None] * world.steady_acceleration[members]
    excess = -float((weight * way).sum()) - depth * float(np.linalg.norm(weight, axis=1).sum())
    ground = _passive_ground(run, island, contacts, True) if excess > 0.0 else None
    if ground is not None:
        before = kinetic_energy(now, world, members)
        now.velocity[members] -= ground.velocity
        take_off(now, world, members, excess, ground.pushes)
        now.velocity[members] += ground.velocity
        run.log.account(island.time, "energy correction", kinetic_energy(now, world, members) - before)


def note_end_energy(run: Run, bodies: list[int]) -> None:
    """Keep the energy with which bodies under contact forces arrive, from which the work of those forces follows."""
    for i in bodies:
        if run.state.under_contact[i]:
            run.state.end_energy[i] = mechanical_energy(run.state.now, run.world, np.array([i]))


def limit_energy(run: Run, bodies: list[int], time: float) -> set[int]:
    """Take what islands of the bodies gained since they share their forces off their velocities; returns those slowed.

    All that share forces arrive together. The energy is that seen from the ground, which has the velocity U:

        E - E_0 - sum m (v - v_0).U + sum m a.U (t - t_0),    a: gravity and constant forces.
    """
    world, state, trajectory, now = run.world, run.state, run.state.trajectory, run.state.now
    slowed: set[int] = set()
    touched = [i for i in bodies if state.under_contact[i]]
    for first in sorted({int(state.sharing[i]) for i in touched if state.closed[i]}):
        island, ground = np.array([i for i in touched if state.sharing[i] == first]), state.ground[first]
        fallen = (time - trajectory.start[island, None]) * world.steady_acceleration[island]
        change = now.velocity[island] - trajectory.velocity[island] - fallen
        gained = mechanical_energy(now, world, island) - float(state.energy_at_start[island].sum())
        gained -= float(world.mass[island] @ (change @ ground.velocity))
        before = kinetic_energy(now, world, island)
        if gained > run.energy_gain * before:
            v, w = now.velocity[island].copy(), now.angular_velocity[island].copy()
            now.velocity[island] -= ground.velocity
            take_off(now, world, island, gained, ground.pushes)
            now.velocity[island] += ground.velocity
            # Frames on the way have their share of it.
            state.correction[island] += np.hstack([now.velocity[island] - v, now.angular_velocity[island] - w])
            run.log.account(time, "energy correction", kinetic_energy(now, world, island) - before)
            slowed.update(island.tolist())
    return slowed


def take_off(now: BodyState, world: World, members: np.ndarray, energy: float, ground: np.ndarray) -> None:
    """Take energy [J], or all there is, off how the members move against each other or the ground, which pushes along `ground` (k, 3)."""
    mass, x = world.mass[members, None], now.position[members]
    v, w = now.velocity[members], now.angular_velocity[members]
    inertia = np.linalg.inv(now.inv_inertia[members])
    r = x - (mass * x).sum(axis=0) / mass.sum()
    momentum = np.concatenate([(mass * v).sum(axis=0), (cross_arrays(r, mass * v) + np.einsum("ijk,ik->ij", inertia, w)).sum(axis=0)])
    steiner = np.einsum("i,ij,ij->", mass[:, 0], r, r) * np.eye(3) - np.einsum("i,ij,ik->jk", mass[:, 0], r, r)
    common = np.zeros((6, 6))
    common[:3, :3], common[3:, 3:] = mass.sum() * np.eye(3), inertia.sum(axis=0) + steiner
    free = _free_motions(ground)
    rigid = free @ np.linalg.solve(free.T @ common @ free, free.T @ momentum)
    rigid_v = rigid[:3] + cross_arrays(rigid[3:], r)
    dv, dw = v - rigid_v, w - rigid[3:]
    available = 0.5 * float((mass * dv**2).sum() + np.einsum("ij,ijk,ik->", dw, inertia, dw))
    if available > 0.0:
        share = np.sqrt(max(1.0 - energy / available, 0.0))
        now.velocity[members], now.angular_velocity[members] = rigid_v + share * dv, rigid[3:] + share * dw


def _free_motions(ground: np.ndarray) -> np.ndarray:
    """Basis (6, k) of translations and rotations of a common body that pushes along `ground` (k, 3) do no work on, wherever they act."""
    _, size, directions = np.linalg.svd(np.vstack([ground, np.zeros((1, 3))]))
    rank = int((size > PARALLEL).sum())
    turns = directions if rank == 0 else directions[:1] if rank == 1 else directions[:0]
    free = np.zeros((3 - rank + len(turns), 6))
    free[: 3 - rank, :3], free[3 - rank :, 3:] = directions[rank:], turns
    return free.T
