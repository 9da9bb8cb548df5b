"""Pendulums, and what their pivots carry over a full swing (B3).

A ball of mass m, moment of inertia I about its centre, on a rigid rod without mass, d from the pivot to the centre, swings as a point mass
at the reduced length l = (I + m d^2) / (m d). Let go at the angle a0 (k = sin(a0 / 2), K the complete elliptic integral):

    sin(a / 2) = k sn(K - t sqrt(g / l)),    period T = 4 K(k) sqrt(l / g)

Over a full swing the momentum comes back, so what the pivot gives is what gravity takes: on average m g, straight up, and nothing sideways,
however far it swings. l = 1 m and 45 degrees: T = 2.086255872614 s, m g T up.

Joints are of second order. At steps of h = 1/240 s the widest swing, a' up to 4.8 rad/s, turns by 0.02 rad a step: forces and rates are
off by some (a' h)^2 / 12 = 3e-5 of themselves. The tension is m g (3 - 2 cos a0) = 3.3 m g at most, so means are off by 1e-4 of m g;
periods by some 3e-5, the bound is 1e-4; angles in 25 rad of phase by 1e-3, the bound is three times that. Frames of the reaction are
joined by a cubic spline: an error of (w / fps)^4 / 180, nothing beside that. A reaction that is late by a frame is off by 1e-2.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.quaternion import quaternion_from_axis_angle, rotate
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import HingeJoint
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY, LENGTH, MASS = 9.81, 1.0, 2.0
SWINGS = {"narrow": 15.0, "notes": 45.0, "wide": 100.0}
"""Degrees at which they are let go; the second one is that of the dynamics notes."""
NOTES_PERIOD = 2.086255872614
"""s, to its twelve printed digits."""
BOB, ROD = 0.09, 0.012
"""m, radii of ball and rod."""
INERTIA = 0.4 * MASS * BOB**2
DISTANCE = 0.5 * (LENGTH + math.sqrt(LENGTH**2 - 4.0 * INERTIA / MASS))
"""m, d: the reduced length is LENGTH."""
PITCH, POST = 0.6, 0.06
DURATION = 8.0
MEAN, ANGLE, PERIOD = 1e-4, 3e-3, 1e-4
"""Bounds: of m g, rad, and relative."""


def scene() -> Scene:
    """Return the pendulums in a row, one behind the other, and the frame that bears them; they swing in planes of x and z."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    _add_frame(scene)
    # The body's origin is at the pivot; the rod has no mass.
    rod, upright, centre = Shape.cylinder(ROD, DISTANCE), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -DISTANCE)
    shape = Shape.compound([(Shape.sphere(BOB), centre, upright), (rod, (0.0, 0.0, -0.5 * DISTANCE), upright)])
    for k, (name, degrees) in enumerate(SWINGS.items()):
        pivot = (0.0, k * PITCH, 0.0)
        turn = quaternion_from_axis_angle((0.0, 1.0, 0.0), -math.radians(degrees))
        scene.add(Body(name, shape, position=pivot, orientation=turn, mass=MASS, inertia=3 * (INERTIA,), center_of_mass=centre))
        scene.add(HingeJoint(None, name, pivot, (0.0, 1.0, 0.0), name=f"pivot of {name}"))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare angles, periods and mean reactions with the closed forms."""
    checks = []
    for name, degrees in SWINGS.items():
        start = math.radians(degrees)
        down = rotate(run.orientation(name), np.array([0.0, 0.0, -1.0]))
        angle = np.unwrap(np.arctan2(down[:, 0], -down[:, 2]))
        period = _period(start)
        mean = _mean(run, f"pivot of {name}", period) / (MASS * GRAVITY)
        checks += [
            at_most(f"{name}: error of the angle, rad", np.abs(angle - _swing(start, run.times)).max(), ANGLE, "sin(a/2) = k sn(K - w t)"),
            at_most(
                f"{name}: error of the period, relative", abs(_measured(run.times, angle) / period - 1.0), PERIOD, "4 K(k) sqrt(l / g)"
            ),
            at_most(f"{name}: mean reaction without the weight, of m g", abs(mean[2] - 1.0), MEAN, "m g T over a swing"),
            at_most(f"{name}: mean reaction sideways, of m g", np.abs(mean[:2]).max(), MEAN, "0 over a swing"),
        ]
    return [*checks, at_most("period at 45 degrees from that of the notes, s", abs(_period(0.25 * math.pi) - NOTES_PERIOD), 1e-12, "B3")]


def _add_frame(scene: Scene) -> None:
    """Add the beam above the pivots and its two posts, out of the way of the bobs."""
    reach = (len(SWINGS) - 1) * PITCH
    middle, low = 0.5 * reach, -LENGTH - 3.0 * BOB
    # The joined bodies may cross the beam: they are hung from the world, so the beam is kept above the rods.
    beam = Shape.box((POST, reach + PITCH + POST, POST))
    scene.add(Body("beam", beam, motion="static", position=(0.0, middle, POST)))
    scene.add(Body("floor", Shape.half_space(offset=low), motion="static"))
    for k, y in enumerate((-0.5 * PITCH, reach + 0.5 * PITCH)):
        post = Shape.box((POST, POST, 0.5 * POST - low))
        scene.add(Body(f"post {k}", post, motion="static", position=(0.0, y, 0.5 * (low + 0.5 * POST))))


def _period(start: float) -> float:
    """Return the period of a swing let go at `start` rad, s."""
    from scipy.special import ellipk

    return 4.0 * float(ellipk(math.sin(0.5 * start) ** 2)) * math.sqrt(LENGTH / GRAVITY)


def _swing(start: float, times: np.ndarray) -> np.ndarray:
    """Return the angle at times (f,) s, rad."""
    from scipy.special import ellipj, ellipk

    k = math.sin(0.5 * start)
    return 2.0 * np.arcsin(k * ellipj(ellipk(k * k) - math.sqrt(GRAVITY / LENGTH) * times, k * k)[0])


def _measured(times: np.ndarray, angle: np.ndarray) -> float:
    """Return the period from the first to the last passage in one direction through the lowest point, s."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, angle)
    passages = [root for root in spline.roots(extrapolate=False) if spline(root, 1) < 0.0]
    return float(passages[-1] - passages[0]) / (len(passages) - 1)


def _mean(run: Recording, joint: str, period: float) -> np.ndarray:
    """Return the mean (3,) of a joint's force over whole swings, N."""
    from scipy.interpolate import CubicSpline

    # The last frame has the forces of a part of a sub-step, which are of first order only: left out.
    spline = CubicSpline(run.times[:-1], run.reaction(joint)[:-1])
    swings = math.floor((run.times[-2] - 0.25 * period) / period)
    return spline.integrate(0.25 * period, (swings + 0.25) * period) / (swings * period)


SCENES = (
    GalleryScene(
        "pendulum", "Pendulums, and what their pivots carry over a full swing", scene, check, DURATION, accuracy="exact"
    ),
)
