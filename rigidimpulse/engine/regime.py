"""Which islands are sub-stepped, of the islands of bodies that may touch in a step.

The exact regime is more accurate, so it is used wherever it can be afforded. "auto" sub-steps an island only where all of this holds:

    many        at least MANY movable bodies, or FEW that move (faster than the sleep speed, see `sleeping.py`) in a scene of MANY;
                KEPT for an island that is sub-stepped already
    or costly   at least FEW, each of which the exact regime solved more than EXPENSIVE_SOLVES times in the last step, in the mean.
                Bodies at rest take 2 to 4 solves, a fall of boxes 10 to 20; each takes about as long as a step of a small
                sub-stepped island
    or joints   an island with joints that something is near, each body of which the exact regime solved more than EXPENSIVE_SOLVES
                times a step, in the mean of the last ones; EXPENSIVE_JOINTED times where it has less than FEW bodies and was in no
                contact in the last step: a door on a soft hinge takes up to 9 though it touches nothing. Where nothing is near it
                EXPENSIVE_SWING times, by as much less often as it has more bodies than SMALL. A body that hangs alone stays exact,
                and so do islands with joints in scenes with rolling friction
    or runaway  in the middle of a step, an island of which a body was solved more than RUNAWAY times in the step, or by as much less
                often as it has more bodies than LARGE: it costs more than it advances. So do islands in which two bodies come to contact
                again and again and no impulse keeps them apart. They are handed over at that instant, whatever they are made of.
                Contacts that rebound by more than REBOUND, without joints, are given more of them: many impacts are what such scenes
                are about. So are neighbours of masses beyond RATIO : 1, which sub-steps may throw apart

and, at every step,

    sliding     no rolling or spinning friction between two bodies that may touch, as sub-steps have none; in an island of ROLLING bodies at
                most: exact contact takes 17 s a second for a pile of 80 balls, 66 s for 125. Larger islands, and those that run away, go
                without, and the status says so

and, where an island begins to be sub-stepped (a body that comes near later is taken in):

    alike       no two neighbours of masses beyond RATIO : 1; where joints are, contacts and joints are solved exactly at any ratio
    dull        no restitution above REBOUND, or ELASTIC where joints are: a rebound is found at the end of the step only
    low         no body more than TALL others above a support: long columns want exact rows; not asked where joints are, nor where each
                body was solved more than EXPENSIVE_TALL times in the last step, in the mean: a column that stands takes a few, a chain of
                rings that swings takes thirty. Nor of a CROWD of more than PAIRS pairs a body, more than layers of bricks have: one
                exact solution takes as long as seconds of sub-steps

In scenes of fewer than SOME movable bodies without joints only what has joints or runs away is sub-stepped. "cheapest" asks what islands
cost, and nothing else of the above: see `cheapest.py`. "substepped" takes every island that touches something or has joints.

A body without joints that moves farther than FAST of its inner radius in a sub-step, or turns by more than SPIN rad, is swept instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.collision.contact_records import SEPARATION, SKIN, SUPPORT, in_play
from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.union_find import roots
from rigidimpulse.engine.sleeping import SLEEP_SPEED
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState

MANY, SOME, FEW, KEPT = 60, 12, 8, 2
ASK = -1.0
"""`SolveCounts.most` where it is asked at every step whether islands begin to be sub-stepped."""
EXPENSIVE_SOLVES, EXPENSIVE_TALL = 6.0, 16.0
EXPENSIVE_JOINTED, EXPENSIVE_SWING, SMALL = 16.0, 300.0, 8.0
RATIO, REBOUND, ELASTIC, TALL = 30.0, 0.5, 0.9, 12
CROWD, PAIRS = 128, 4.0
ROLLING = 72
FAST, SPIN = 0.5, 2.5 / 16.0


def why_not_substepped(world: World) -> str:
    """Why a scene cannot have sub-stepped islands; empty where it can."""
    solver = world.accuracy.contact_solver
    if "sub-stepped islands" in world.left_out:
        return "left out by the caller"
    if solver not in ("auto", "cheapest", "substepped"):
        return f"contact_solver is {solver!r}"
    if not world.joints_of_scene and not (world.can_collide and world.can_press):
        return "nothing presses bodies together"
    if any(table.burns for table in world.force_tables):
        return "masses change"
    if solver == "cheapest" and world.rolling.size:
        return "rolling friction is exact only"
    if solver == "substepped":
        # Everything that touches would be stepped, and roll for ever.
        return "rolling friction is exact only" if world.rolling.size else ""
    if world.joints_of_scene or only_expensive(world):
        return ""
    # A crowd is looked at in every step, for nothing if all of it rebounds.
    used, movable = np.unique(world.material_of_body), np.unique(world.material_of_body[world.dynamic])
    elastic = bool(np.all(world.coefficients[np.ix_(movable, used)][:, :, 0] > REBOUND))
    return f"all bodies rebound by more than {REBOUND}" if elastic else ""


def may_begin(most: float, joined: np.ndarray, solve_count: np.ndarray) -> bool:
    """Whether an island may begin to be sub-stepped at the start of a step; most: `most_solves_of_all`, joined (n,) bool: have joints.

    solve_count: (n,) how often the exact solver dealt with each body in the last step; with those that have joints, in the mean of steps.
    """
    return float(solve_count.sum()) > most or bool(np.any(joined & (solve_count > EXPENSIVE_SOLVES)))


def most_solves_of_all(world: World) -> float:
    """How often the exact solver deals with all bodies in a step, before islands without joints may begin to be sub-stepped."""
    if not only_expensive(world):
        return ASK
    return FEW * EXPENSIVE_SOLVES if _number(world) >= SOME else np.inf


def only_expensive(world: World) -> bool:
    """Whether islands are sub-stepped only where the exact regime has become expensive: the scene has not MANY bodies."""
    return world.accuracy.contact_solver in ("auto", "cheapest") and _number(world) < MANY


def is_crowd(world: World) -> bool:
    """Whether a scene has a CROWD of movable bodies without joints, too many for finer sub-steps than the settings ask for."""
    return _number(world) >= CROWD


def jointed(world: World) -> np.ndarray:
    """Which bodies (n,) bool have joints."""
    out = np.zeros(world.num_bodies, bool)
    if world.joints_of_scene:
        ends = np.concatenate([world.joints.body_a, world.joints.body_b])
        out[ends[ends >= 0]] = True
    return out


def _number(world: World) -> int:
    """Movable bodies without joints."""
    return int(np.count_nonzero(world.dynamic & ~jointed(world)))


def island_roots(number: int, first: np.ndarray, second: np.ndarray, movable: np.ndarray) -> np.ndarray:
    """Root (n,) of each of `number` bodies: the lowest one that links (k,) between movable bodies join it with."""
    joins = movable[first] & movable[second]
    return roots(number, first[joins], second[joins])


def solves_in_islands(root: np.ndarray, solve_count: np.ndarray) -> np.ndarray:
    """How often a body of each island (n,), by its root, was solved in the mean.

    root: (n,) of every body, -1 for those in no island; solve_count: (n,) how often the exact solver dealt with each body in a step.
    """
    members = np.flatnonzero(root >= 0)
    size = np.bincount(root[members], minlength=len(root))
    return np.bincount(root[members], weights=solve_count[members], minlength=len(root)) / np.maximum(size, 1)


def crowded(root: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Which islands (n,) bool, by their root, are crowds; root: (n,) of every body, -1 for those in none; first: body (k,) of each pair."""
    size, pairs = (np.bincount(of[of >= 0], minlength=len(root)) for of in (root, root[first]))
    return (size > CROWD) & (pairs > PAIRS * size)


@jit_making_arrays
def support_levels(bodies, pairs, rows, tall):
    """Level (n+1,) of each body above the supports, counted in bodies along closed contacts: at most tall + 1; 0 for immovable bodies.

    Bodies without support, and those that play no part, have tall + 2.
    """
    number = bodies.part.shape[0]
    level = np.full(number, tall + 2, np.int64)
    for i in range(number):
        if bodies.part[i] == SUPPORT:
            level[i] = 0
    changed = True
    # Levels fall until no contact lowers one any more.
    while changed:
        changed = False
        for p in range(pairs.first.shape[0]):
            a, b = pairs.first[p], pairs.second[p]
            closed = False
            if in_play(bodies.part, a, b):
                for c in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
                    closed = closed or rows[c, SEPARATION] <= rows[c, SKIN]
            if not closed:
                continue
            low, high = (a, b) if level[a] < level[b] else (b, a)
            reached = min(level[low] + 1, tall + 1)
            if level[low] <= tall + 1 and reached < level[high]:
                level[high] = reached
                changed = True
    return level


def lively(now: BodyState, strength: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Which bodies (n,) bool are faster than the sleep speed; strength (n,) m/s2 of what pulls them, inner (n,) m."""
    radius = np.where(np.isfinite(inner), inner, 0.0)
    v, w = now.velocity, now.angular_velocity
    speed = np.sqrt(np.einsum("ij,ij->i", v, v)) + radius * np.sqrt(np.einsum("ij,ij->i", w, w))
    return speed > SLEEP_SPEED * np.sqrt(strength * radius)


def roll(world: World, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Which pairs (k,) bool of bodies a and b (k,) have rolling or spinning friction, in a scene with some."""
    return np.any(world.rolling[world.material_of_body[a], world.material_of_body[b]], axis=1)


def unlike(world: World, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Which pairs (k,) bool of bodies a and b (k,) are both dynamic, of masses beyond RATIO : 1."""
    heavy = np.maximum(world.mass[a], world.mass[b]) > RATIO * np.minimum(world.mass[a], world.mass[b])
    return world.dynamic[a] & world.dynamic[b] & heavy


@dataclass(frozen=True, eq=False)
class Judged:
    """What is known of n bodies where it is decided which islands are sub-stepped."""

    root: np.ndarray  # (n,) -1 for those in no island
    substepped_before: np.ndarray  # (n,) bool, members of sub-stepped islands
    joined: np.ndarray  # (n,) bool, with joints
    struck: np.ndarray  # (n,) bool, the exact regime found them in contact in the last step
    moves: np.ndarray  # (n,) bool
    solve_count: np.ndarray  # (n,) how often the exact solver dealt with each body in the last step


def refusals(world: World, bodies: Judged, pairs: tuple[np.ndarray, np.ndarray], auto: bool) -> dict[int, str]:
    """Why islands are not sub-stepped, by their root; the condition `low` is not tested here.

    Args:
        world: the compiled scene.
        bodies: all of them.
        pairs: bodies a and b, (k,) each, of the pairs that may touch in the step.
        auto: False where every island is taken that touches something or has joints.

    """
    out: dict[int, str] = {}
    (a, b), root = pairs, bodies.root
    members = np.flatnonzero(root >= 0)
    size = np.bincount(root[members], minlength=len(root))
    was_substepped, has_joints, is_struck, touches = np.zeros((4, len(root)), bool)
    for flag, of_body in ((was_substepped, bodies.substepped_before), (has_joints, bodies.joined), (is_struck, bodies.struck)):
        flag[root[members[of_body[members]]]] = True
    # The island of each pair: that of whichever body is in one.
    owner = np.where(root[a] >= 0, root[a], root[b])
    touches[owner] = True
    if not auto:
        return dict.fromkeys(np.flatnonzero((size > 0) & ~touches & ~has_joints).tolist(), "alone")
    moving_count = np.bincount(root[members[bodies.moves[members]]], minlength=len(root))
    solves = solves_in_islands(root, bodies.solve_count)
    expensive = solves > EXPENSIVE_SOLVES
    lively_enough = expensive & (_number(world) >= SOME) if only_expensive(world) else expensive | (moving_count >= FEW)
    least = np.where(was_substepped, KEPT, np.where(lively_enough, FEW, MANY))
    for r in np.flatnonzero((size > 0) & (size < least) & ~has_joints).tolist():
        out[r] = "few bodies"
    swings = EXPENSIVE_SWING / np.maximum(size / SMALL, 1.0)
    near = np.where((size < FEW) & ~is_struck, EXPENSIVE_JOINTED, EXPENSIVE_SOLVES)
    cheap = solves <= np.where(touches, near, swings)
    # Sub-steps have no rolling and no spinning friction.
    if world.rolling.size:
        rolls = roll(world, a, b)
        out.update(dict.fromkeys(np.unique(owner[rolls & (size[owner] <= ROLLING)]).tolist(), "rolling friction"))
    stays_exact = np.full(len(root), True) if world.rolling.size else cheap | (size < KEPT)
    for r in np.flatnonzero(has_joints & ~was_substepped & stays_exact).tolist():
        out[r] = "joints"
    # The rest holds only where an island begins: a body that comes near later is taken in.
    begins = ~was_substepped[owner]
    if not begins.any():
        return out
    coefficient = world.coefficients[world.material_of_body[a], world.material_of_body[b], 0]
    heavy = unlike(world, a, b)
    for r in np.unique(owner[begins & (coefficient > np.where(has_joints[owner], ELASTIC, REBOUND))]).tolist():
        out.setdefault(r, "restitution")
    for r in np.unique(owner[begins & heavy & ~has_joints[owner]]).tolist():
        out.setdefault(r, "mass ratio")
    return out
