"""Bodies that fill their space exactly: they are made smaller by a few contact margins, so that there is space for these margins.

Lasting contacts are held at a gap d, the contact margin. Cubes that fill a box have no space for it: where four cubes in a row fill it,
five gaps ask for 5 d. Files rounded to single precision even lack some 1e-7 of the size. Such demands contradict each other. Least
displacements that meet them as well as can be (`constraints.displacement`, d - g asked for at a gap g, all masses 1) have pushes p, and
what a contact lacks is s p. Where this is more than a part of d, the smaller movable body of the pair is scaled about its centre of mass
by 1 - x. Its surface then withdraws by x n.r at the contact, r from the centre; x is such that this is a little more than what is
lacking. Mass and inertia stay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigidimpulse.collision.geometry import CompiledShape, Primitive, build_geometry
from rigidimpulse.core.portable import dot
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.displacement import displacement_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.engine.islands import near_contacts
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.model.world import World
from rigidimpulse.motion.evaluate import bring_all

DEPTH = TOLERANCES.initial_overlap.depth
SOFTNESS = TOLERANCES.initial_overlap.fit_softness
RESIDUAL = TOLERANCES.initial_overlap.fit_residual
MOST = TOLERANCES.initial_overlap.most_scaled
LACKING = 0.2
"""Part of the contact margin that a contact may lack."""
SPARE = 1.5
"""How much more than what is lacking a surface withdraws."""


def make_space(run: Run) -> World:
    """The world of a run that has not begun, in which bodies that fill their space exactly are a little smaller."""
    world, members = run.world, np.flatnonzero(run.world.dynamic)
    if not world.can_collide:
        return world
    pair_events = PairEvents(run, run.state.time)
    pair_events.find_pairs()
    if not len(pair_events.pairs):
        return world
    every = np.arange(world.num_bodies)
    bring_all(run.state.trajectory, every, run.state.time, run.state.now, run.state.rotation, run.acceleration, run.angular_acceleration)
    contacts, margin, _ = near_contacts(run, pair_events, members, run.state.time)
    # Bodies that are deeper inside each other are moved apart, see `initial_overlap`.
    shallow = contacts.gap >= -DEPTH / world.contact_margin * margin
    contacts, margin = select(contacts, np.flatnonzero(shallow)), margin[shallow]
    if not (contacts.gap < 0.5 * margin).any():
        return world
    shrink = _shrink(world, contacts, lacking(world, contacts, margin), margin)
    return _scaled(world, shrink) if shrink.any() else world


def lacking(world: World, contacts: Contacts, margin: np.ndarray) -> np.ndarray:
    """What each contact (m,) lacks of its margin (m,) when bodies are displaced as well as can be, m."""
    # Whether there is space does not depend on masses. With those of the bodies, what pushes 1,000 kg up from 0.01 kg in an open tower
    # would count as lacking: pushes grow as the ratio of masses.
    mobility, pair = (world.inv_mass > 0.0).astype(float), (contacts.body_a, contacts.body_b)
    rows = displacement_rows(mobility, pair, contacts.normal, margin - contacts.gap, SOFTNESS)
    solve_newton(rows, world.num_bodies, RESIDUAL * float(margin.min()))
    return rows.softness * rows.impulse


def _shrink(world: World, contacts: Contacts, lacks: np.ndarray, margin: np.ndarray) -> np.ndarray:
    """Part (n,) of their size by which bodies are made smaller."""
    shrink = np.zeros(world.num_bodies)
    for c in np.flatnonzero(lacks > LACKING * margin).tolist():
        a, b = int(contacts.body_a[c]), int(contacts.body_b[c])
        of_a = world.dynamic[a] and not (world.dynamic[b] and world.size[b] < world.size[a])
        body, reach = (a, dot(contacts.arm_a[c], contacts.normal[c])) if of_a else (b, -dot(contacts.arm_b[c], contacts.normal[c]))
        if SPARE * lacks[c] < MOST * reach:
            shrink[body] = max(shrink[body], SPARE * lacks[c] / reach)
    return shrink


def _scaled(world: World, shrink: np.ndarray) -> World:
    """The world with bodies smaller by these parts (n,); bodies of one shape that shrink alike share the new one."""
    shapes, shape_of_body = list(world.shapes), world.shape_of_body.copy()
    known: dict[tuple[int, float], int] = {}
    for i in np.flatnonzero(shrink).tolist():
        key = int(shape_of_body[i]), float(shrink[i])
        if key not in known:
            known[key] = len(shapes)
            shapes.append(CompiledShape(tuple(_smaller(part, 1.0 - shrink[i]) for part in shapes[key[0]].primitives)))
        shape_of_body[i] = known[key]
    return replace(world, shapes=shapes, shape_of_body=shape_of_body, geometry=build_geometry(shapes))


def _smaller(primitive: Primitive, factor: float) -> Primitive:
    """A primitive scaled about the origin."""
    frame = primitive.frame.copy()
    frame[:3], frame[6] = factor * frame[:3], factor * frame[6]
    return replace(primitive, radius=factor * primitive.radius, frame=frame, vertices=factor * primitive.vertices)
