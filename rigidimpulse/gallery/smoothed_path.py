"""Two trays carry a tall box each past the same places: along the straight lines between them, and along the path of least curvature.

The zig-zag changes its velocity at every corner, so its box topples. `smooth_path` with `Curvature` gives, of all paths that are at the
same places at the same times and start and end at rest, the one with the least integral of squared acceleration: the clamped cubic spline,
x(t) = h00 x_k + h10 T v_k + h01 x_(k+1) + h11 T v_(k+1), the v_k from equal second derivatives on both sides of a key,

    v_(k-1) + 4 v_k + v_(k+1) = 3 (x_(k+1) - x_(k-1)) / T.

Its acceleration stays below g w / l, from which on a box of width w and height l tips, so that one stands still on its tray.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
KEYS = np.array([[0.0, 0.0, 0.0], [0.7, 0.35, 0.0], [1.4, -0.35, 0.0], [2.1, 0.35, 0.0], [2.8, 0.0, 0.0]])
SEGMENT = 1.5
"""s, T: from key to key."""
RATE = 60
"""Frames of the paths per second."""
APART = 1.6
WIDTH, HEIGHT = 0.12, 0.4
TRAY, THICK, ABOVE = 0.4, 0.04, 0.25
FRICTION = 0.6
ROCKS = 0.02
"""rad; frames change the velocity in steps of up to 0.03 m/s, on which the box rocks a little. One that tips goes on to a quarter turn."""
DURATION = SEGMENT * (len(KEYS) - 1) + 0.5
TRACKS = {"zig-zag": 0.5 * APART, "smooth": -0.5 * APART}


def path(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times (f,) s and positions (f, 3) m of the frames of a tray."""
    from rigidimpulse.dynamics.forces.energy.path import Curvature, PinFrame, smooth_path

    per_key = round(SEGMENT * RATE)
    times = np.arange((len(KEYS) - 1) * per_key + 1) / RATE
    knots = SEGMENT * np.arange(len(KEYS))
    start = KEYS + (0.0, TRACKS[name], ABOVE)
    straight = np.stack([np.interp(times, knots, along) for along in start.T], axis=1)
    if name == "zig-zag":
        return times, straight
    rest = (0.0, 0.0, 0.0)
    pins = [PinFrame(k * per_key) for k in range(len(KEYS))]
    return times, smooth_path(times, straight, energies=[Curvature(1.0, start_velocity=rest, end_velocity=rest), *pins]).positions


def scene() -> Scene:
    """Return the trays with their boxes, and the paths as rows of dots on the floor."""
    wood = Material(density=600.0, static_friction=FRICTION, dynamic_friction=FRICTION)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=wood))
    tray, box, dot = Shape.box((TRAY, TRAY, THICK)), Shape.box((WIDTH, WIDTH, HEIGHT)), Shape.sphere(0.018)
    for name in TRACKS:
        times, places = path(name)
        # Straight lines need no frames between their ends.
        step = round(SEGMENT * RATE) if name == "zig-zag" else 1
        keys = Keyframes(times[::step], places[::step])
        scene.add(Body(f"tray, {name}", tray, motion="kinematic", position=places[0], keyframes=keys, material=wood))
        standing = places[0] + (0.0, 0.0, 0.5 * (THICK + HEIGHT))
        scene.add(Body(f"box, {name}", box, position=standing, material=wood))
        for k, place in enumerate(places[::6]):
            scene.add(Body(f"dot {k}, {name}", dot, motion="static", position=(place[0], place[1], 0.0)))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare the smooth path with the clamped spline, and what the boxes do with the accelerations."""
    limit = GRAVITY * WIDTH / HEIGHT
    spline, acceleration = _spline(run.times)
    tray = run.position("tray, smooth") - (0.0, TRACKS["smooth"], ABOVE)
    carried = run.position("box, smooth") - run.position("tray, smooth")
    lean = 2.0 * np.arccos(np.clip(np.abs(run.orientation("box, smooth")[:, 0]), 0.0, 1.0))
    fallen = run.position("box, zig-zag")[-1, 2]
    even = (1.0 / RATE) ** 2
    return [
        at_most("tray from the cubic spline, m", np.abs(tray - spline).max(), 2.0 * even, "least curvature, to second order in the frame"),
        at_most("largest acceleration, m/s^2", acceleration, limit, "below g w / l a box does not tip"),
        at_most("way of the box on the smooth tray, m", np.abs(carried - carried[0]).max(), ROCKS * HEIGHT, "it stands"),
        at_most("lean of that box, rad", lean.max(), ROCKS, "it stands"),
        at_most("height of the other box at the end, m", fallen, ABOVE, "it has toppled"),
        at_least("jump of velocity at a corner, m/s", _corner(), 0.5, "straight lines turn at once"),
    ]


def _spline(times: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the clamped cubic spline through the keys (f, 3), at rest after it, and its largest acceleration."""
    inner = len(KEYS) - 2
    matrix = 4.0 * np.eye(inner) + np.eye(inner, k=1) + np.eye(inner, k=-1)
    slope = np.zeros_like(KEYS)
    slope[1:-1] = np.linalg.solve(matrix, 3.0 * (KEYS[2:] - KEYS[:-2]) / SEGMENT)
    k = np.clip((times / SEGMENT).astype(int), 0, len(KEYS) - 2)
    s = np.clip(times / SEGMENT - k, 0.0, 1.0)[:, None]
    x = (1.0 + 2.0 * s) * (1.0 - s) ** 2 * KEYS[k] + s**2 * (3.0 - 2.0 * s) * KEYS[k + 1]
    x += SEGMENT * s * (1.0 - s) * ((1.0 - s) * slope[k] - s * slope[k + 1])
    # Straight in between, the acceleration is largest at a key.
    way = KEYS[1:] - KEYS[:-1]
    before = 6.0 * way / SEGMENT**2 - (4.0 * slope[:-1] + 2.0 * slope[1:]) / SEGMENT
    after = -6.0 * way / SEGMENT**2 + (2.0 * slope[:-1] + 4.0 * slope[1:]) / SEGMENT
    return x, float(np.linalg.norm(np.concatenate([before, after]), axis=1).max())


def _corner() -> float:
    """Return the least jump of velocity at an inner key of the zig-zag."""
    speeds = np.diff(KEYS, axis=0) / SEGMENT
    return float(np.linalg.norm(np.diff(speeds, axis=0), axis=1).min())


SCENES = (GalleryScene("smoothed_path", "A box topples on a zig-zag and stands on the path of least curvature", scene, check, DURATION),)
