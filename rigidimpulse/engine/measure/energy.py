r"""Energy that a run made of nothing.

    E(t) = K(t) + V(t) + sum of D_c(t)    over the causes c that may give energy

must not rise. K and V are the kinetic and potential energy of the frames, D_c what a cause took until then (see `recording.ledger`).
Causes that can only take energy are left out of the sum: what they gave is what is looked for. Which these are follows from the scene:

    impact                           takes, unless a restitution is above 1
    contact, energy correction       take, unless supports move or joints store energy: the ledger has their work in one sum with friction
    stick, sub-stepping              take, unless supports move
    joints                           take, unless supports move, or a row is soft or driven: springs and motors

All others are added: forces by their names, "position correction", "overlap" and "let go", which move bodies without a force, and "mass
that left". Position corrections of runs with sub-stepped islands are not: bodies that rose out of deep overlaps gained energy, by whatever
name. Where supports move everything is added. A second balance adds all causes in any scene: it is constant as far as the ledger is
complete, and shows energy that is under no cause even where impacts take more at the same time. What a cause gave that the first balance
adds is not judged: friction on a moving support is in one sum with the work of the support.

The ledger spreads what a sub-stepped island took evenly over its step, so between the ends of steps a sum with "sub-stepping" is not
constant. Where there were such islands the second balance is not looked at, and neither is the first where supports move. Contacts that
join such an island are moved apart, by up to GAP of the inner radius r of a body, and what is above them goes up, too. The ledger has this
in "sub-stepping". A body of the weight w, at the height h above the lowest, stands on h / 2 r others of its kind at most, so

    A = sum of w GAP (h / 2 + r)    in runs with sub-stepped islands, else 0

Supports that all have one steady velocity U do no work as seen from them. Where there are no others, and nothing but position corrections
may give energy, a third balance takes their place: that of the energy seen from the supports,

    E'(t) = K - U.p + m U^2 / 2 + V + (sum of m a).U t    and the causes that move bodies without a force

with p the momentum and m the mass of all, and a the steady accelerations.

The rise is that of any balance over its least value so far. Between the ends of steps of sub-stepped islands frames have no state of the
solver: velocities go from those at one end to those at the other, so that a body that rebounds is slow on the way. At such frames the least
value is the greatest of all frames that are a step away, or next to it, and what is compared with it the least of these.

The rise is compared with the energy that moves,

    rise <= RISE S + A,    S = max K + (max V - min V) + sum of (max D_c - min D_c) over the causes that are added + sum of m u^2 / 2

with the speed u up to which a body stands still (`RunRecord.unseen_speed`): where nothing moves, all else is round-off.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.collision.manifold.convexity import inner_radii
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.measure.record import Fault, RunRecord
from rigidimpulse.model.world import World
from rigidimpulse.recording.ledger import Masses, mechanics

KIND = "energy made"
RISE: float = 1e-3
"""Rise of the energy that no cause accounts for, of the energy that moves, from which a run is not ok."""
GAP: float = 0.6 * TOLERANCES.sub_stepping.skin
"""Gap to which sub-stepped contacts are moved apart, of the inner radius: a fifth of the skin, and three times that, since wedges go up by
more than their gaps."""
SAME_TIME: float = 1e-6
"""Times that are nearer than that are the same, steps."""
MOST_NAMES: int = 3
"""Bodies that a message names at most."""
MOST_OF_RISE: float = 0.1
"""Part of what the body gained that gained most, from which another is named beside it."""
WITHOUT_FORCE = frozenset({"position correction", "overlap", "let go"})
"""Causes that move bodies without a force: their work is the same from wherever it is seen."""
REMEDY = "use a smaller step, or contact_solver='newton' where islands are sub-stepped"
"""Tried on a jointed board that falls (`drawbridge` of the newcomers): 1.4e-4 of what moves by default, 1.1e-5 at a step of 1/240 s."""


def _taking_causes(record: RunRecord) -> frozenset[str]:
    """Causes that may only take energy in this run: what has been let go was a support that moved."""
    if np.any(record.world.moving) or record.release.any():
        return frozenset()
    return _taking_beside_supports(record.world, record.may_be_sub_stepped)


def _taking_beside_supports(world: World, may_be_sub_stepped: bool) -> frozenset[str]:
    """The same if supports do no work."""
    takes = {"stick", "sub-stepping"}
    if may_be_sub_stepped:
        takes.add("position correction")
    if not np.any(world.coefficients[:, :, 0] > 1.0):
        takes.add("impact")
    if not _joints_give(world):
        takes |= {"joints", "contact", "energy correction"}
    return frozenset(takes)


def _joints_give(world: World) -> bool:
    """Whether a joint has a spring or a motor."""
    if not world.joints_of_scene:
        return False
    table = world.joints
    return bool(np.any(np.isfinite(table.stiffness) & (table.stiffness > 0.0)) or np.any(table.rate != 0.0))


def energy_rise(record: RunRecord) -> tuple[np.ndarray, float]:
    """Rise (f,) J over its least value so far, of the first balance or of the second, whichever is larger; and S, J."""
    ledger, takes = record.ledger, _taking_causes(record)
    given, all_causes = ledger.total.copy(), ledger.total.copy()
    dynamic = record.world.dynamic
    still = 0.5 * record.world.mass[dynamic] @ record.unseen_speed[dynamic] ** 2
    moved = float(ledger.kinetic.max() + np.ptp(ledger.potential) + still)
    for cause, taken in ledger.dissipated.items():
        all_causes += taken
        if cause not in takes:
            given += taken
            moved += float(np.ptp(taken))
    rise = np.zeros(len(given))
    if not record.may_be_sub_stepped:
        rise = _rise_of(record, all_causes)
    if not record.may_be_sub_stepped or "sub-stepping" in takes:
        rise = np.maximum(rise, _rise_of(record, given))
    seen = _seen_from_supports(record)
    if seen is not None:
        rise = np.maximum(rise, _rise_of(record, seen))
    return rise, moved


def _rise_of(record: RunRecord, balance: np.ndarray) -> np.ndarray:
    """Rise (f,) J of a balance (f,) over its least value so far."""
    low, high, inside = balance.copy(), balance.copy(), _inside_steps(record)
    if inside.any():
        steps = record.world.accuracy.step / np.diff(record.frames.times).min()
        reach = math.ceil(steps - SAME_TIME)
        padded = np.pad(balance, reach, mode="edge")
        for k in range(2 * reach + 1):
            beside = padded[k : k + len(balance)]
            np.maximum(low, beside, out=low, where=inside)
            np.minimum(high, beside, out=high, where=inside)
    return np.maximum(high - np.minimum.accumulate(low), 0.0)


def _inside_steps(record: RunRecord) -> np.ndarray:
    """Frames (f,) bool between the ends of steps of sub-stepped islands."""
    steps = (record.frames.times - record.frames.times[0]) / record.world.accuracy.step
    return (np.abs(steps - np.round(steps)) > SAME_TIME) & record.may_be_sub_stepped


def _seen_from_supports(record: RunRecord) -> np.ndarray | None:
    """The third balance (f,) J; None where the supports have no velocity in common, or where something else may give energy."""
    world, frames, ledger = record.world, record.frames, record.ledger
    others = [cause for cause in ledger.dissipated if cause not in _taking_beside_supports(world, record.may_be_sub_stepped)]
    if not world.moving.any() or record.release.any() or not set(others) <= WITHOUT_FORCE:
        return None
    supports = ~world.dynamic
    velocity = frames.velocity[0, supports][0]
    if np.any(frames.velocity[:, supports] != velocity) or frames.angular_velocity[:, supports].any():
        return None
    if world.joints_of_scene and np.any(np.minimum(world.joints.body_a, world.joints.body_b) < 0):
        return None
    mass = world.mass[world.dynamic]
    fall = (mass @ world.steady_acceleration[world.dynamic]) @ velocity * frames.times
    momentum = np.einsum("n,fni->fi", mass, frames.velocity[:, world.dynamic])
    seen = ledger.total - momentum @ velocity + 0.5 * mass.sum() * (velocity @ velocity) + fall
    return seen + sum(ledger.dissipated[cause] for cause in others)


def allowed_rise(record: RunRecord, moved: float) -> np.ndarray:
    """Rise (f,) J that is allowed at each frame; moved: S, J."""
    allowed, world = np.full(len(record.frames.times), RISE * moved), record.world
    if record.may_be_sub_stepped:
        dynamic = world.dynamic
        weight = world.mass[dynamic, None] * world.steady_acceleration[dynamic]
        strength = np.linalg.norm(weight, axis=1)
        inner = inner_radii(world.geometry, world.convex_depths)[world.shape_of_body[dynamic]]
        stored = -np.einsum("fnk,nk->fn", record.frames.position[:, dynamic], weight)
        height = np.divide(stored, strength, out=np.zeros_like(stored), where=strength > 0.0)
        allowed += GAP * (0.5 * (height - height.min(axis=1, keepdims=True)) + inner) @ strength
    return allowed


def energy_faults(record: RunRecord) -> list[Fault]:
    """The fault of a run that made energy, with the time at which the rise came to its bound, and the bodies that gained in that frame."""
    rise, moved = energy_rise(record)
    if not np.isfinite(moved) or not moved > 0.0:
        return []
    too_much = rise > allowed_rise(record, moved)
    if not np.any(too_much):
        return []
    first, most = int(np.argmax(too_much)), int(np.argmax(rise))
    times, amount = record.frames.times, float(rise[most])
    origin = "position corrections, or from nothing," if record.may_be_sub_stepped else "nothing"
    text = f"{amount:.3g} J came from {origin} until {times[most]:.6g} s, {amount / moved:.1%} of the energy that moves; {REMEDY}"
    return [Fault(float(times[first]), KIND, bodies_that_gained(record, first), amount, text)]


def bodies_that_gained(record: RunRecord, frame: int, sign: float = 1.0) -> tuple[str, ...]:
    """Names of the dynamic bodies whose energy rose most from the frame before to this one, or fell most with a sign of -1."""
    frames, world = record.frames, record.world
    here = slice(frame - 1, frame + 1)
    mass = np.where(world.dynamic & (frames.times[here, None] >= record.release), world.mass, 0.0)
    parts = type(frames)(*(part[here] for part in frames))
    kinetic, potential, _, _ = mechanics(parts, Masses(mass, world.inertia, world.steady_acceleration), np.ones((1, 1)))
    gain = np.where(world.dynamic, sign * np.diff(kinetic + potential, axis=0)[0], -np.inf)
    order = np.argsort(-gain, kind="stable")[:MOST_NAMES]
    return tuple(world.names[i] for i in order if gain[i] >= MOST_OF_RISE * abs(gain[order[0]]) or i == order[0])
