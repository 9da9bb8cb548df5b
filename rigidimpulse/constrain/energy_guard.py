"""No energy from constant contact forces.

Over a sub-step contact forces are constant while contacts move, so they do a little work that they should not. Bodies that
together touched nothing that moves by itself cannot have gained energy: what they gained is taken off what moves against the
motion of their common rigid body, V, W, by one factor:

    v_i = V + W x (x_i - X) + dv_i,  w_i = W + dw_i,    T = T_rigid(V, W) + T_d(dv, dw),    T_d' = T_d - gained

T_rigid and T_d are orthogonal, so momentum and angular momentum stay. Ground that takes part pushes along some directions, and turns
about those across them: V and W then have only what is left, the part of the common motion whose momentum no such push changes (along
a smooth floor: V level, W upright), and are zero where the ground has friction.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.observe.energy import kinetic_energy, mechanical_energy

GAIN = 1e-11
"""Part of their kinetic energy that bodies may gain by rounding."""
PARALLEL = 1e-6
"""Sine of the angle of directions that count as one."""


def note_arrival(context, bodies: list[int], time: float) -> set[int]:
    """Keep the energy with which bodies under contact forces arrive, from which the work of those forces follows.

    All that share forces arrive together; what groups of them gained is taken off their velocities. Returns those slowed.
    """
    world, state = context.world, context.state
    slowed: set[int] = set()
    touched = [i for i in bodies if state.under_contact[i]]
    for i in touched:
        state.arrival_energy[i] = mechanical_energy(state.now, world, np.array([i]))
    for first in sorted({int(state.sharing[i]) for i in touched if state.closed[i]}):
        group = np.array([i for i in touched if state.sharing[i] == first])
        gained = sum(state.arrival_energy[i] - state.energy_at_start[i] for i in group.tolist())
        before = kinetic_energy(state.now, world, group)
        if gained > GAIN * before:
            take_off(state.now, world, group, gained, state.ground[first])
            context.log.book(time, "guard", kinetic_energy(state.now, world, group) - before)
            slowed.update(group.tolist())
    return slowed


def take_off(now, world, members: np.ndarray, energy: float, ground: np.ndarray) -> None:
    """Take energy [J], or all there is, off how the members move against each other or the ground, which pushes along `ground` (k, 3)."""
    mass, x = world.mass[members, None], now.position[members]
    v, w = now.velocity[members], now.angular_velocity[members]
    inertia = np.linalg.inv(now.inv_inertia[members])
    r = x - (mass * x).sum(axis=0) / mass.sum()
    momentum = np.concatenate([(mass * v).sum(axis=0), (np.cross(r, mass * v) + np.einsum("ijk,ik->ij", inertia, w)).sum(axis=0)])
    steiner = np.einsum("i,ij,ij->", mass[:, 0], r, r) * np.eye(3) - np.einsum("i,ij,ik->jk", mass[:, 0], r, r)
    common = np.zeros((6, 6))
    common[:3, :3], common[3:, 3:] = mass.sum() * np.eye(3), inertia.sum(axis=0) + steiner
    free = _free_motions(ground)
    rigid = free @ np.linalg.solve(free.T @ common @ free, free.T @ momentum)
    rigid_v = rigid[:3] + np.cross(rigid[3:], r)
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
