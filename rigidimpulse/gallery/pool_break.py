"""Pool break: a cue ball into a rack of fifteen, on a table with four cushions.

Balls slide without friction in the plane z = 0. Restitution e is 0.95 between balls and 0.8 at cushions. For every
impact

    separation = e approach,   energy lost = (1 - e^2) mu u^2 / 2,   mu = m / 2 between balls, m at a cushion

(B9, B10), so the ledger of energy is known from the table of impacts; momentum changes by the impulses of the
cushions alone; smooth balls never spin. The rack is the hard part, many impacts in a fraction of a millisecond: the
run is compared with the exact one, impact by impact.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.gallery.event_driven import DisksInRectangle
from rigidimpulse.gallery.looks import CLOTH, CUSHION, pool_ball
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

RADIUS = 0.5 * 57.15e-3
MASS = 0.17
LENGTH, WIDTH = 2.54, 1.27
CUE_SPEED = 8.0
CUE_OFFSET = 0.004
"""m off the axis of the table, so that the break is not a mirror image of itself."""
RACK_GAP = 1e-4
"""m between neighbours in the rack."""
NUM_ROWS = 5
BALL_RESTITUTION, CUSHION_RESTITUTION = 0.95, 0.8
RAIL, RAIL_HEIGHT, BED_GAP = 0.08, 0.06, 1e-3
"""m: width and height of the cushions, and how far below the balls the cloth is drawn."""
CUSHIONS = {
    "cushion -x": ((RAIL, WIDTH, RAIL_HEIGHT), (-0.5 * (LENGTH + RAIL), 0.0, 0.0)),
    "cushion +x": ((RAIL, WIDTH, RAIL_HEIGHT), (0.5 * (LENGTH + RAIL), 0.0, 0.0)),
    "cushion -y": ((LENGTH + 2.0 * RAIL, RAIL, RAIL_HEIGHT), (0.0, -0.5 * (WIDTH + RAIL), 0.0)),
    "cushion +y": ((LENGTH + 2.0 * RAIL, RAIL, RAIL_HEIGHT), (0.0, 0.5 * (WIDTH + RAIL), 0.0)),
}
"""Sizes and places, m."""
NUM_FIXED = len(CUSHIONS) + 1
DURATION = 5.0
NUM_TIMED = 40
"""Impacts whose times are compared. Each impact of balls after the break multiplies errors by five or more."""
TIME_BOUND = 1e-11
"""s; until the last of these impacts, arithmetic of sixteen digits loses 5e-13 s."""
LAW_BOUND = 1e-12


def scene() -> Scene:
    """Return the table and sixteen balls."""
    smooth: dict[str, Any] = {"static_friction": 0.0, "dynamic_friction": 0.0, "restitution_combine": "minimum"}
    rubber = Material(restitution=CUSHION_RESTITUTION, **smooth)
    resin = Material(restitution=BALL_RESTITUTION, **smooth)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    for name, (size, place) in CUSHIONS.items():
        scene.add(Body(name, Shape.box(size), motion="static", position=place, material=rubber, visual=Visual(color=CUSHION)))
    bed = Shape.box((LENGTH + 2.0 * RAIL, WIDTH + 2.0 * RAIL, RAIL))
    place, cloth = (0.0, 0.0, -RADIUS - BED_GAP - 0.5 * RAIL), Visual(color=CLOTH)
    scene.add(Body("bed", bed, motion="static", position=place, material=rubber, visual=cloth))
    ball = Shape.sphere(RADIUS)
    for k, (x, y) in enumerate(_places()):
        speed = CUE_SPEED if k == 0 else 0.0
        name = f"ball {k}" if k else "cue ball"
        look = pool_ball(k, RADIUS)
        scene.add(Body(name, ball, position=(x, y, 0.0), velocity=(speed, 0.0, 0.0), mass=MASS, material=resin, visual=look))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare impacts with their law, the ledger with the impacts, and the beginning with the exact run."""
    impacts, first = run.impacts, NUM_FIXED
    at_cushion = np.minimum(impacts["body_a"], impacts["body_b"]) < first
    e = np.where(at_cushion, CUSHION_RESTITUTION, BALL_RESTITUTION)
    rebound = np.abs(impacts["separation_speed"] - e * impacts["approach_speed"]).max() / CUE_SPEED
    spent = 0.5 * np.where(at_cushion, MASS, 0.5 * MASS) * (1.0 - e**2) * impacts["approach_speed"] ** 2
    frame = np.searchsorted(impacts["time"], run.times, side="right")
    start = 0.5 * MASS * CUE_SPEED**2
    kinetic = run.ledger.kinetic if run.ledger else np.full(len(run.times), np.nan)
    energy = np.abs(kinetic + np.concatenate([[0.0], np.cumsum(spent)])[frame] - start).max() / start
    sign = np.where(impacts["body_b"] >= first, 1.0, -1.0)
    push = (sign * at_cushion * impacts["impulse"])[:, None] * impacts["normal"]
    momentum = MASS * run.velocities[:, first:].sum(1)
    given = np.concatenate([np.zeros((1, 3)), np.cumsum(push, axis=0)])[frame] + [MASS * CUE_SPEED, 0.0, 0.0]
    reach = np.abs(run.positions[:, first:]) - [0.5 * LENGTH - RADIUS, 0.5 * WIDTH - RADIUS, 0.0]
    return [
        *_against_exact(run),
        at_most("separation - e approach, of the cue speed", rebound, LAW_BOUND, "v_b' - v_a' = -e (v_b - v_a)"),
        at_most("error of the energy lost, relative", energy, LAW_BOUND, "(1 - e^2) mu u^2 / 2 an impact"),
        at_most(
            "error of the momentum, relative",
            np.abs(momentum - given).max() / (MASS * CUE_SPEED),
            LAW_BOUND,
            "only cushions change it",
        ),
        at_most("spin, rad/s", np.abs(run.angular_velocities).max(), LAW_BOUND, "smooth balls"),
        at_most("furthest into a cushion, m", reach.max(), LAW_BOUND, "bodies stay apart"),
        at_most("deepest overlap of balls, m", _overlap(run.positions[:, first:]), LAW_BOUND, "bodies stay apart"),
    ]


def _places() -> list[tuple[float, float]]:
    """Return where the cue ball and the rack lie, (x, y) m; the first ball of the rack on the foot spot."""
    pitch = 2.0 * RADIUS + RACK_GAP
    places = [(-0.25 * LENGTH, CUE_OFFSET)]
    for row in range(NUM_ROWS):
        for k in range(row + 1):
            places.append((0.25 * LENGTH + row * pitch * np.sqrt(0.75), pitch * (k - 0.5 * row)))
    return places


def _against_exact(run: Recording) -> list[Check]:
    """Compare the partners of all impacts, and the times of the first, with the exact run."""
    events = _balls().advance(float(run.times[-1]))
    pairs = [{event.a + NUM_FIXED, _body(event.b)} for event in events]
    found = [{int(impact["body_a"]), int(impact["body_b"])} for impact in run.impacts]
    right = sum(pair == other for pair, other in zip(pairs, found, strict=False))
    times = np.array([float(event.time) for event in events[:NUM_TIMED]])
    late = np.abs(run.impacts["time"][:NUM_TIMED] - times).max() if len(found) >= NUM_TIMED else np.inf
    law = "the exact run, 50 digits"
    return [
        equal("impacts", len(found), len(events), law),
        equal("impacts in their order, of the right bodies", right, len(events), law),
        at_most(f"error of the times of the first {NUM_TIMED}, s", late, TIME_BOUND, law),
    ]


def _balls() -> DisksInRectangle:
    """Return the balls for decimal arithmetic."""
    places = _places()
    velocities = [(CUE_SPEED, 0.0)] + [(0.0, 0.0)] * (len(places) - 1)
    return DisksInRectangle.of(places, velocities, RADIUS, (0.5 * LENGTH, 0.5 * WIDTH), BALL_RESTITUTION, CUSHION_RESTITUTION)


def exact(times: np.ndarray) -> Exact:
    """Return the motion in decimal arithmetic."""
    positions, events = _balls().frames(times)
    named = {f"ball {k}" if k else "cue ball": positions[:, k] for k in range(positions.shape[1])}
    return Exact(named, impacts=np.array([float(event.time) for event in events]))


def _body(index: int) -> int:
    """Return the body's index in the scene for a disk or wall of an event."""
    return index + NUM_FIXED if index >= 0 else -1 - index


def _overlap(positions: np.ndarray) -> float:
    """Return the deepest overlap of balls over all frames, m."""
    deepest = -np.inf
    for k in range(positions.shape[1]):
        between = np.linalg.norm(positions[:, k + 1 :] - positions[:, k : k + 1], axis=2)
        deepest = max(deepest, 2.0 * RADIUS - between.min(initial=np.inf))
    return float(deepest)


SCENES = (GalleryScene("pool_break", "A cue ball breaks a rack of fifteen", scene, check, DURATION, exact=exact),)
