"""Begin and end of a step of a sub-stepped island, each in one call (kernels); between them are the stages of `stages.py`.

load     the bodies are put before the solver, and it is measured what their motion asks for: how many sub-steps, how many looks at contacts
unload   the energy is balanced, and the poses and velocities of the members are taken
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_cache import most_approach, most_motion, note_changes
from rigidimpulse.collision.contact_records import MEMBER
from rigidimpulse.collision.fat_boxes import BodyBounds, Fat, stay_in_boxes
from rigidimpulse.core.kernels import jit
from rigidimpulse.dynamics.energy import add_kinetic, kinetic_energy, mechanical_energy
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import load_bodies
from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import note_pressed
from rigidimpulse.dynamics.solvers.tgs_soft.energy_balance import begin_balance, end_balance, takes_little
from rigidimpulse.engine.substepped.stages import pieces_of

STRENGTH, SKIN, RATIO, MOTION, PIECES, APPROACH, DEMANDS = range(7)
"""What is measured of the members: largest acceleration by steady forces, m/s2; thinnest skin, m; largest ratio of masses that touch each
other; farthest motion of pairs that have contacts, inner radii; pieces of the step that their motion and their approach ask for."""
TAKEN, RAISED, GIVEN = range(3)
"""Energies of an outcome, J, see `contact_forces.Outcome`."""


class Surroundings(NamedTuple):
    """What does not change of n bodies, and who takes part."""

    bounds: BodyBounds
    fat: Fat
    inv_mass: np.ndarray  # (n,) 1/kg
    strength: np.ndarray  # (n,) m/s2, of gravity and forces
    torque: np.ndarray  # (n, 3) N m, of forces
    part: np.ndarray  # (n,) MEMBER, SUPPORT or OUTSIDE, by index


@jit
def _most_unlike(island, pairs):
    """Largest ratio of the masses of two members that touch each other."""
    most, part, mass = 1.0, island.bodies.part, island.weights.mass
    for p in range(pairs.first.shape[0]):
        a, b = pairs.first[p], pairs.second[p]
        if pairs.count[p] > 0 and part[a] == MEMBER and part[b] == MEMBER:
            most = max(most, max(mass[a], mass[b]) / min(mass[a], mass[b]))
    return most


@jit
def load_island(island, pairs, around, motion, ahead, demands):
    """Put the bodies that take part before the solver as they are now, for a step of `ahead` s.

    island: `stages.Island`; around: `Surroundings`; motion: `touching.Motion`; demands: (DEMANDS,) what is measured. Returns whether the
    pairs hold all that may meet; if not, nothing is done.
    """
    bodies, part, now = island.bodies, around.part, motion.now
    if not stay_in_boxes(around.bounds, around.fat, now, motion.acceleration, part, ahead):
        return False
    load_bodies(bodies, island.order, now, (motion.acceleration, around.torque), around.inv_mass, part)
    strength, skin = 0.0, np.inf
    for k in range(island.order.shape[0]):
        if bodies.part[k] == MEMBER:
            strength, skin = max(strength, around.strength[island.order[k]]), min(skin, bodies.skin[k])
            for c in range(3):
                island.weights.pull[k, c] = bodies.gravity[k, c]
    fall = 0.5 * ahead * strength
    note_changes(bodies, pairs, ahead, fall, island.coefficients)
    demands[STRENGTH], demands[SKIN], demands[RATIO] = strength, skin, _most_unlike(island, pairs)
    demands[MOTION] = most_motion(bodies, pairs, ahead)
    demands[PIECES] = pieces_of(bodies, pairs, island.cornered, demands[MOTION], ahead)
    demands[APPROACH] = most_approach(bodies, pairs, ahead, fall)
    begin_balance(island.balance, bodies, island.weights)
    return True


@jit
def unload_island(island, at, position, orientation, velocity, energies):
    """Balance the energy of a step, and write poses (k, 3), (k, 4) and velocities (k, 6) of members `at` their ranks (k,).

    energies: (3, k) J, see TAKEN. Sub-steps must not make energy beyond what moving supports and drives gave. Returns whether hardly any of
    it had to be taken (`takes_little`).
    """
    bodies, balance = island.bodies, island.balance
    for k in range(at.shape[0]):
        energies[GIVEN, k] = balance.given[at[k]]
    end_balance(balance, bodies, island.weights)
    for k in range(at.shape[0]):
        i = at[k]
        for c in range(3):
            position[k, c] = bodies.position[i, c]
        for c in range(4):
            orientation[k, c] = bodies.orientation[i, c]
        for c in range(6):
            velocity[k, c] = bodies.velocity[8 * i + c]
        energies[TAKEN, k], energies[RAISED, k] = balance.taken[i], balance.raised[i]
    return takes_little(balance, bodies, island.weights, at)


@jit
def unload_pressed(island, at, position, orientation, velocity, energies, pressed):
    """The same of an island without joints; says in pressed (n,) by index on whom contacts acted last."""
    note_pressed(island.bodies, island.order, pressed)
    return unload_island(island, at, position, orientation, velocity, energies)


@jit
def add_mechanical_energies(now, constants, members, label, energy):
    """Add the mechanical energies of the members (k,) to those of their islands, energy (n,) J by label (n,), -1 for bodies in none."""
    for k in range(members.shape[0]):
        i = label[members[k]]
        if i >= 0:
            energy[i] += mechanical_energy(now, constants, members[k : k + 1])


@jit
def energies_of_islands(now, constants, members, label, energies, out):
    """Write the mechanical energy of the members (k,) of each island, and the sums of their `energies` (3, k), to out (4, n), by its label.

    label: (n,) of each body, or -1. All in J.
    """
    for i in range(out.shape[1]):
        for row in range(4):
            out[row, i] = 0.0
    add_mechanical_energies(now, constants, members, label, out[0])
    for k in range(members.shape[0]):
        i = label[members[k]]
        if i >= 0:
            for row in range(3):
                out[1 + row, i] += energies[row, k]


@jit
def compare_energies(now, constants, members, reached, out):
    """Write the mechanical energies of the members (k,) now and as they were reached, and their kinetic energies, to out (4,), J.

    reached: positions (k, 3), orientations (k, 4) and velocities (k, 6).
    """
    position, orientation, velocity = reached
    for c in range(4):
        out[c] = 0.0
    for k in range(members.shape[0]):
        i, one = members[k], members[k : k + 1]
        out[0] += mechanical_energy(now, constants, one)
        out[2] += kinetic_energy(now, constants, one)
        moves = add_kinetic(0.0, velocity[k, :3], velocity[k, 3:], orientation[k], constants.mass[i], constants.inertia[i])
        out[3] += moves
        out[1] += moves
        for c in range(3):
            out[1] -= constants.mass[i] * constants.steady_acceleration[i, c] * position[k, c]
