"""Newton's cradle as a row of touching balls between two walls: k balls in, k balls out.

Equal masses, e = 1, impacts in sequence: velocities are passed on from ball to ball, so k balls with speed v set the
last k moving with v and stop. (All impacts at once is another law with another answer; the response "sequential" is
the one that gives this.)

The outer balls then fly the distance d to the wall, come back at time 3 d / v, and so on: the outline of the motion
repeats with the period 4 d / v. One or two balls at a speed v are always in flight, from one wall to the row or back.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from rigidimpulse.gallery.looks import STEEL
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

NUM_BALLS = 5
RADIUS = 0.03125
"""m; a power of two, so that neighbours touch to the last bit."""
DENSITY = 7860.0
SPEED = 1.0
FREE = 0.375
"""m, d: from a ball at the end of the row to the wall."""
WALL = 0.0625
"""m, thickness."""
DURATION = 6.0
BOUND = 1e-11
"""m and m/s: rounding of some ten impacts on each of eight passages, times a hundred."""


def scene(num_in: int) -> Scene:
    """Return the row, whose first `num_in` balls come in from the left, where they touch the wall."""
    steel = Material(density=DENSITY, restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    left, right = _walls()
    wall = Shape.box((WALL, 4.0 * RADIUS, 4.0 * RADIUS))
    scene.add(Body("left wall", wall, motion="static", position=(left - 0.5 * WALL, 0, 0), material=steel))
    scene.add(Body("right wall", wall, motion="static", position=(right + 0.5 * WALL, 0, 0), material=steel))
    ball = Shape.sphere(RADIUS)
    for k in range(NUM_BALLS):
        comes_in = k < num_in
        x = 2.0 * RADIUS * k - (FREE if comes_in else 0.0)
        speed = SPEED if comes_in else 0.0
        scene.add(Body(f"ball {k}", ball, position=(x, 0, 0), velocity=(speed, 0, 0), material=steel, visual=Visual(color=STEEL)))
    return scene


def check(num_in: int, run: Recording) -> list[Check]:
    """Compare all frames with the straight lines of the balls that fly."""
    expected_x, expected_v = _motion(num_in, run.times)
    x = np.column_stack([run.position(f"ball {k}")[:, 0] for k in range(NUM_BALLS)])
    v = np.column_stack([run.velocity(f"ball {k}")[:, 0] for k in range(NUM_BALLS)])
    clear = np.abs(run.times[:, None] * SPEED / FREE - np.round(run.times[:, None] * SPEED / FREE)) > 1e-9
    first = run.impacts[run.impacts["time"] < 1.5 * FREE / SPEED]
    after = v[np.searchsorted(run.times, 1.5 * FREE / SPEED)]
    energy = run.ledger.kinetic if run.ledger else np.array([np.nan])
    across = np.abs(run.velocities[..., 1:]).max() + np.abs(run.angular_velocities).max()
    law = f"{num_in} in, {num_in} out"
    return [
        equal("balls that leave", int(np.sum(np.abs(after - SPEED) < BOUND)), num_in, law),
        equal("balls that stay", int(np.sum(np.abs(after) < BOUND)), NUM_BALLS - num_in, law),
        equal("impacts of the first passage", len(first), num_in * (NUM_BALLS - num_in), "each passes on one speed"),
        at_most("error of positions, m", np.abs(x - expected_x).max(), BOUND, "straight lines of speed v or 0"),
        at_most("error of velocities, m/s", np.abs((v - expected_v) * clear).max(), BOUND, "v or 0, for ever"),
        at_most("motion across and spin", across, BOUND, "all impulses are along the row"),
        at_most("energy, relative change", np.ptp(energy) / energy[0], BOUND, "e = 1 keeps energy"),
    ]


def _walls() -> tuple[float, float]:
    """Return where the walls are, m."""
    return -RADIUS - FREE, 2.0 * RADIUS * (NUM_BALLS - 1) + RADIUS + FREE


def _motion(num_in: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (f, NUM_BALLS) along the row."""
    home = 2.0 * RADIUS * np.arange(NUM_BALLS)
    phase = np.mod(times[:, None] * SPEED / FREE, 4.0)
    # Phase 0 to 1: the left balls come in; 1 to 2: the right ones go out, 2 to 3: back; 3 to 4: the left ones go out.
    left = np.arange(NUM_BALLS) < num_in
    right = np.arange(NUM_BALLS) >= NUM_BALLS - num_in
    out_left = np.maximum(1.0 - phase, 0.0) + np.maximum(phase - 3.0, 0.0)
    out_right = np.maximum(1.0 - np.abs(phase - 2.0), 0.0)
    rate_left = (phase < 1.0) * SPEED - (phase > 3.0) * SPEED
    rate_right = ((phase > 1.0) & (phase < 2.0)) * SPEED - ((phase > 2.0) & (phase < 3.0)) * SPEED
    position = home + FREE * (right * out_right - left * out_left)
    return position, left * rate_left + right * rate_right


SCENES = (
    GalleryScene(
        "cradle_one", "Newton's cradle: one ball in, one ball out", partial(scene, 1), partial(check, 1), DURATION
    ),
    GalleryScene(
        "cradle_two", "Newton's cradle: two balls in, two balls out", partial(scene, 2), partial(check, 2), DURATION
    ),
)
