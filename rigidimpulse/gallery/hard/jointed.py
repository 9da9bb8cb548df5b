"""Joints under load: a motorised hinge, and a chain of a hundred light links with a heavy ball.

Arm: mass m, its centre l from a hinge about a horizontal axis, moment I about the hinge.

Holding: from the horizontal, the drive k (0 - a) - c a' against gravity:

    I a'' = m g l cos a - k a - c a',    sag: k a = m g l cos a = the drive's torque

Overdamped (c > 2 sqrt(k I)) it never passes the sag. Its slower mode, 6.4 1/s, dies within 6 s to e^-38 of the sag; what is left is
the tolerance of rest, 1e-8 of the speed of a step, so 1e-6 of the sag is generous. At rest the hinge carries m g, straight up.

Lifting: from hanging, b the angle from there, a drive that strives for the speed w with c (w - b') within +- T, T > m g l: it lifts
with the droop of any proportional drive, b' = w - m g l sin(b) / c. What the droop changes in a step, m g l w h / c = 8e-6 rad/s, is the
bound: 2e-5 of w.

Stalling: T < m g l. It lifts with w until T no longer does, sin b_s = T / (m g l). From there on the torque is T, so that

    I b'^2 / 2 + (m g l (1 - cos b)) - T b    is what it was at b_s with b' = w

between two turning points, b_- and b_+, where b' = 0: nothing takes energy, and it goes on to swing between them, never faster than w.
About b_s it swings with sqrt(m g l cos b_s / I) = 3.4 rad/s and 0.15 rad, so steps of 1/60 s may be off by (w h)^2 / 12 = 3e-4 of that in a
swing, and frames miss a turn by 6e-5 rad: some 1e-4 rad, ten times which is the bound. The same part of w, 1e-3, for the speed.

Chain: n = 100 links of m = 0.1 kg and 0.1 m, the ball 1,000 times as heavy; drawn straight. A link next to the ball swings across with
w = 2 sqrt(T / (m l)), T = 1,000 m g: 630 1/s. Hanging, nothing moves, and joint 1 carries all of the weight. Let go one radian off, the
chain stays nearly straight and the ball nearly on its circle. Joints are rigid: their gaps, added up, are the stretch; 1e-3 of
the length is the issue's bound (iterative solvers stretch such chains by tens of percent). Energy: the swing itself has 1 rad/s and steps
of at most 1/60 s, (w h)^2 / 12 = 2e-5 of its energy; 1e-4 is the bound. The sway of the links needs sub-steps of some 0.7 / w = 1e-3 s with
a hundred bodies each: a second of motion takes about two minutes, so the case has 0.4 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rigidimpulse.core.quaternion import quaternion_from_axis_angle, rotate
from rigidimpulse.gallery.hard.parts import GRAVITY, energy_never_grows, finite, undisturbed
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import BallJoint, HingeJoint, Motor
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

ARM, ARM_MASS = (1.0, 0.1, 0.1), 2.0
REACH = 0.5 * ARM[0]
INERTIA = ARM_MASS * ((ARM[0] ** 2 + ARM[2] ** 2) / 12.0 + REACH**2)
LOAD = ARM_MASS * GRAVITY * REACH
"""N m, torque of gravity on an arm held level."""
STIFFNESS, DAMPING = 100.0, 20.0
SPEED, DRIVE_DAMPING = 0.5, 1e4
STRONG, WEAK = 1.2 * LOAD, 0.6 * LOAD
LINKS, LINK, LINK_RADIUS, LINK_MASS = 100, 0.1, 0.02, 0.1
BALL, BALL_MASS = 0.3, 100.0
LENGTH = LINKS * LINK
SWING = 1.0
"""rad, where the swinging chain is let go."""
TENTH_PERCENT = 1e-3


def arms() -> Scene:
    """Return three arms beside each other, each with a drive at its hinge."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    drives = (
        ("holds", 0.0, Motor(stiffness=STIFFNESS, damping=DAMPING)),
        ("lifts", 0.5 * math.pi, Motor(velocity=SPEED, damping=DRIVE_DAMPING, max_force=STRONG)),
        ("stalls", 0.5 * math.pi, Motor(velocity=SPEED, damping=DRIVE_DAMPING, max_force=WEAK)),
    )
    for k, (name, angle, motor) in enumerate(drives):
        turn = quaternion_from_axis_angle((0.0, 1.0, 0.0), angle)
        place = np.array([0.0, float(k), 0.0])
        centre = place + rotate(turn, np.array([REACH, 0.0, 0.0]))
        scene.add(Body(name, Shape.box(ARM), position=centre, orientation=turn, mass=ARM_MASS))
        scene.add(HingeJoint(None, name, place, (0.0, 1.0, 0.0), name=f"hinge {name}", motor=motor))
    return scene


def check_arms(run: Recording) -> list[Check]:
    """Compare the sag, the lift and the stall with their closed forms."""
    sag = _root(lambda a: STIFFNESS * a - LOAD * math.cos(a), 0.0, 1.0)
    held = _angle(run, "holds")
    reaction = run.reaction("hinge holds")[-1] - [0.0, 0.0, ARM_MASS * GRAVITY]
    torque = STIFFNESS * held[-1]
    lifted, speed = _angle(run, "lifts") + 0.5 * math.pi, run.angular_velocity("lifts")[:, 1]
    droop = SPEED - LOAD * np.sin(lifted) / DRIVE_DAMPING
    stall = math.asin(WEAK / LOAD)

    def energy(b: float) -> float:
        return 0.5 * INERTIA * SPEED**2 + WEAK * (b - stall) - LOAD * (math.cos(stall) - math.cos(b))

    low, high = _root(energy, 0.0, stall), _root(energy, stall, 0.5 * math.pi)
    stalled = _angle(run, "stalls") + 0.5 * math.pi
    late = run.times > 2.0 * stall / SPEED
    return [
        finite(run),
        at_most("holds: error of the sag, relative", abs(held[-1] / sag - 1.0), 1e-6, "k a = m g l cos a"),
        at_most("holds: drive's torque against gravity's, relative", abs(torque / (LOAD * math.cos(held[-1])) - 1.0), 1e-6, "balance"),
        at_most("holds: it passes the sag by, of it", held.max() / sag - 1.0, 1e-6, "overdamped: c > 2 sqrt(k I)"),
        at_most("holds: reaction without the weight, of it", np.abs(reaction).max() / (ARM_MASS * GRAVITY), 1e-6, "m g, straight up"),
        at_most("lifts: error of the speed, of it", np.abs(speed - droop)[run.times > 0.5].max() / SPEED, 1e-5, "w - m g l sin(b) / c"),
        at_most("stalls: error of the highest turn, rad", abs(stalled.max() - high), 1e-3, "energy under the greatest torque"),
        at_most("stalls: error of the lowest turn, rad", abs(stalled[late].min() - low), 1e-3, "energy under the greatest torque"),
        at_most("stalls: above its speed, of it", run.angular_velocity("stalls")[:, 1].max() / SPEED - 1.0, 1e-3, "the drive brakes there"),
        at_most("ends of the arms off their hinges, m", _off_hinges(run), 1e-9, "hinges are rigid"),
        undisturbed(run),
    ]


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a function between two places of opposite sign."""
    from scipy.optimize import root_scalar

    return float(root_scalar(function, bracket=(low, high)).root)


def _off_hinges(run: Recording) -> float:
    """Return how far the end of any arm is from its hinge, m."""
    ends = [run.position(name) - rotate(run.orientation(name), np.array([REACH, 0.0, 0.0])) for name in run.names]
    return max(float(np.linalg.norm(end - [0.0, k, 0.0], axis=1).max()) for k, end in enumerate(ends))


def _angle(run: Recording, name: str) -> np.ndarray:
    """Return the angle (f,) rad of an arm below the horizontal, against the drive; positive about +y, as the hinge counts."""
    axis = rotate(run.orientation(name), np.array([1.0, 0.0, 0.0]))
    angle = np.unwrap(np.arctan2(-axis[:, 2], axis[:, 0]))
    return angle if name == "holds" else angle - math.pi


def chain(angle: float) -> Scene:
    """Return a straight chain that hangs `angle` rad off the vertical, with the ball at its end."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    turn = quaternion_from_axis_angle((0.0, 1.0, 0.0), -angle)
    way = rotate(turn, np.array([0.0, 0.0, -1.0]))
    link = Shape.capsule(LINK_RADIUS, LINK - 2.0 * LINK_RADIUS)
    above = None
    for k in range(LINKS):
        name = f"link {k + 1}"
        scene.add(Body(name, link, position=(k + 0.5) * LINK * way, orientation=turn, mass=LINK_MASS))
        scene.add(BallJoint(above, name, k * LINK * way, name=f"joint {k + 1}"))
        above = name
    scene.add(Body("ball", Shape.sphere(BALL), position=(LENGTH + BALL) * way, orientation=turn, mass=BALL_MASS))
    scene.add(BallJoint(above, "ball", LENGTH * way, name=f"joint {LINKS + 1}"))
    return scene


def check_hanging(run: Recording) -> list[Check]:
    """Check that nothing moves and what the first and the last joint carry."""
    weight = GRAVITY * (BALL_MASS + LINKS * LINK_MASS)
    first, last = run.reaction("joint 1")[-1], run.reaction(f"joint {LINKS + 1}")[-1]
    moved = np.linalg.norm(run.positions - run.positions[0], axis=2).max()
    return [
        finite(run),
        at_most("stretch, of the length", _stretch(run), TENTH_PERCENT, "joints are rigid; the issue's 0.1 %"),
        at_most("anything moves, m", moved, 1e-9, "statics"),
        at_most("first joint's load without the weight, of it", np.abs(first - [0.0, 0.0, weight]).max() / weight, 1e-9, "(100 m + M) g"),
        at_most("last joint's load without the ball's, of it", np.abs(last - [0.0, 0.0, BALL_MASS * GRAVITY]).max() / weight, 1e-9, "M g"),
        undisturbed(run),
    ]


def check_swinging(run: Recording) -> list[Check]:
    """Check the length of the chain, the circle of the ball and the energy."""
    assert run.ledger is not None
    total = run.ledger.total
    swing = BALL_MASS * GRAVITY * (LENGTH + BALL) * (1.0 - math.cos(SWING))
    ball = run.position("ball")
    from_pivot = np.linalg.norm(ball, axis=1).max() / (LENGTH + BALL) - 1.0
    return [
        finite(run),
        at_most("stretch, of the length", _stretch(run), TENTH_PERCENT, "joints are rigid; the issue's 0.1 %"),
        at_most("ball beyond its circle, of the length", from_pivot, TENTH_PERCENT, "no path is longer than the chain"),
        at_least("the ball falls by, m", ball[0, 2] - ball[-1, 2], 0.3, "some sin^2 of the angle of g t^2 / 2"),
        at_most("energy, change of the swing's", np.ptp(total) / swing, 1e-4, "no work is done; second order in the step"),
        energy_never_grows(run, LINK, 0.0),
        undisturbed(run),
    ]


def _stretch(run: Recording) -> float:
    """Return the gaps of all joints, added up, at the frame where they are largest, of the length."""
    half = np.array([0.0, 0.0, 0.5 * LINK])
    gaps, end = np.zeros(len(run.times)), np.zeros(3)
    for k in range(LINKS):
        centre, turn = run.position(f"link {k + 1}"), run.orientation(f"link {k + 1}")
        gaps += np.linalg.norm(centre + rotate(turn, half) - end, axis=1)
        end = centre - rotate(turn, half)
    gaps += np.linalg.norm(run.position("ball") + rotate(run.orientation("ball"), np.array([0.0, 0.0, BALL])) - end, axis=1)
    return float(gaps.max() / LENGTH)


def hanging() -> Scene:
    """Return the chain at rest."""
    return chain(0.0)


def swinging() -> Scene:
    """Return the chain one radian off the vertical."""
    return chain(SWING)


SCENES = (
    GalleryScene("motor_hinge", "Motors at hinges hold an arm, lift one, and stall under one", arms, check_arms, 6.0),
    GalleryScene("chain_hanging", "A chain of 100 links bears a ball of 1,000 times a link's mass", hanging, check_hanging, 5.0),
    GalleryScene("chain_swinging", "The same chain swings", swinging, check_swinging, 0.4),
)
