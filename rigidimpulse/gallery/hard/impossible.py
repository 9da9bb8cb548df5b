"""Starts and ends that no motion of rigid bodies satisfies: the run must go on, say so, and feed in nothing.

Squeezed: two kinematic walls close on a body until there is no space left. No rigid motion is left; the status must name the
body, every number must stay finite, and the body must not be shot out: its speed stays within ten times the walls'.

Overlap at the start: bodies drawn inside each other, half way, at the same place, or one inside the other. The status says so
before the first frame, and from the first step on they are apart. Energy must not be made: without gravity and at rest, a
body pushed out by its whole size in a step of 1/60 s would have 60 sizes a second; energy that was not there before stays
below that of falling through its own size, m g s, the bound here with g = 9.81.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.gallery.hard.parts import GRAVITY, apart, dull, finite, floor_scene
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIZE = 0.5
CLOSING = 0.5
"""m/s, of each wall; they meet at 1 s."""


def squeezed(shape: str) -> Scene:
    """Return a body between two walls that close; it stands on the floor, not in the middle."""
    material = dull(0.5)
    scene = floor_scene(material)
    wall = Shape.box((0.2, 2.0, 2.0))
    for side in (-1.0, 1.0):
        place = (side * (0.1 + CLOSING), 0.0, 1.1)
        scene.add(
            Body(f"wall {side:+.0f}", wall, motion="kinematic", position=place, velocity=(-side * CLOSING, 0.0, 0.0), material=material)
        )
    made = Shape.sphere(0.5 * SIZE) if shape == "ball" else Shape.box(SIZE)
    scene.add(Body("body", made, position=(0.05, 0.0, 0.5 * SIZE), material=material))
    return scene


def check_squeezed(run: Recording) -> list[Check]:
    """Check that the run says what happened, and that nothing flies."""
    speeds = np.linalg.norm(run.velocity("body"), axis=1)
    named = sum("body" in event.bodies for event in run.status.events)
    return [
        finite(run),
        at_least("events that name the body", named, 1, "the status says that there is no space"),
        at_most("speed of the body, m/s", speeds.max(), 10.0 * CLOSING, "it is not shot out"),
    ]


def overlapping(depth: float, shape: str) -> Scene:
    """Return two equal bodies, the second one higher by `1 - depth` of the size, without gravity."""
    material = dull(0.5)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    for k, name in enumerate(("first", "second")):
        made = Shape.sphere(0.5 * SIZE) if shape == "ball" else Shape.box(SIZE)
        scene.add(Body(name, made, position=(0.0, 0.0, 2.0 + k * (1.0 - depth) * SIZE), mass=1.0, material=material))
    return scene


def inside() -> Scene:
    """Return a small ball inside a solid one, without gravity."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(Body("first", Shape.sphere(SIZE), mass=1.0))
    scene.add(Body("second", Shape.sphere(0.2 * SIZE), mass=1.0, position=(0.1 * SIZE, 0.0, 0.0)))
    return scene


def check_overlap(run: Recording) -> list[Check]:
    """Check that it is reported at once and resolved, and that no energy is made."""
    assert run.ledger is not None
    reported = sum(event.kind == "overlap at the start" for event in run.status.events)
    made = run.ledger.kinetic.max() if np.all(np.isfinite(run.ledger.kinetic)) else math.inf
    momentum = np.linalg.norm(run.ledger.momentum, axis=1).max()
    return [
        finite(run),
        apart(run),
        at_least("overlaps reported before the first frame", reported, 1, "the status says so"),
        at_most("energy made, J", made, GRAVITY * SIZE, "no explosion: m g s, m = 1 kg"),
        at_most("momentum made, kg m/s", momentum, 1e-12, "nothing acts from outside"),
    ]


def coincident() -> Scene:
    """Return two boxes and two balls, each pair at the very same place."""
    scene = overlapping(1.0, "box")
    for name in ("third", "fourth"):
        scene.add(Body(name, Shape.sphere(0.5 * SIZE), position=(4.0, 0.0, 2.0), mass=1.0))
    return scene


SCENES = (
    *(
        GalleryScene(
            f"squeezed_{shape}", f"Two walls close on a {shape} until there is no space left", partial(squeezed, shape), check_squeezed, 1.2
        )
        for shape in ("ball", "box")
    ),
    GalleryScene("deep_overlap", "Two boxes that overlap by half", partial(overlapping, 0.5, "box"), check_overlap, 2.0),
    GalleryScene("coincident", "Two boxes, and two balls, at the very same place", coincident, check_overlap, 2.0),
    GalleryScene("ball_in_ball", "A ball inside a solid ball", inside, check_overlap, 2.0),
)
