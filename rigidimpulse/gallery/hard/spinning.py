"""Spinning and rolling bodies: Euler's disk, a coin, a tippe top, a rattleback.

Euler's disk (radius r, thickness d, leaning by a from the floor) in steady motion with its centre at rest: the contact c =
r e - (d / 2) n, e the direction down the face and n its normal, lies on the axis of rotation, so it rolls. Angular momentum
about the centre turns with the rate W about the vertical under the torque of the floor:

    W^2 (sin a / r) (r I_1 cos a - (d / 2) I_3 sin a) = m g (r cos a - (d / 2) sin a)

with I_1 = m (3 r^2 + d^2) / 12 and I_3 = m r^2 / 2 (thin: W^2 sin a = 4 g / r). Nothing dissipates: the lean stays.

Coin, spun on its edge: no closed form; energy never grows, it stays on the floor, and the ledger balances.

Tippe top: a sphere of radius R with its centre of mass off by s along its axis k. Jellett's invariant L . (c - x), c the
contact, is constant under any contact force F, friction included (J. H. Jellett 1872): the torque (c - x) x F has no part along
c - x = s k - R z, and L . d(c - x)/dt = s L . (w x k) = 0 for a body symmetric about k. With moments 1 - s/R < A / C < 1 + s/R
and fast spin it turns over (R. J. Cohen 1977), until it rolls without slip: that here is at a cosine of -0.88, with sub-steps of
a quarter of the length too. The invariant is right to second order in the angle of a sub-step, 0.01 rad at most, while it turns
by 750 rad; refined four times the error falls from 2e-4 by the factor of ten that a second order promises. The bound is 5e-4.

Rattleback: half an ellipsoid with mass turned by an angle against its axes. Spun against its sense it begins to rock and
turns back (G. T. Walker 1896). The smooth body that rolls without slip, integrated to 1e-9, turns back to -1.00 of its
spin in 1.9 s; this one has 10,242 corners, 3 mm apart, and loses energy from corner to corner (e = 0): it turns back to -0.60
of its spin, and one of 40,962 corners to -0.75. To rock from corner to corner at all it must rise by 7e-6 J; it begins with 1e-4 J.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.portable import matmul
from rigidimpulse.core.quaternion import rotate
from rigidimpulse.gallery.hard.parts import GRAVITY, above_floor, dull, energy_never_grows, finite, floor_scene, turned, undisturbed
from rigidimpulse.gallery.looks import GOLD
from rigidimpulse.gallery.record import Check, GalleryScene, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

DISK, THICKNESS = 0.0381, 0.0128
"""m: the toy sold under this name."""
LEAN = math.radians(20.0)
COIN, COIN_THICKNESS = 0.0116, 0.00233
TOP, OFFSET, TOP_SPIN = 0.02, 0.006, 150.0
AXES = (0.1, 0.02, 0.015)
SKEW = math.radians(5.0)
BACK_SPIN, WOBBLE = -3.0, 1.0
"""rad/s, about the vertical and about the level axes."""


def disk() -> Scene:
    """Return a disk in steady motion."""
    scene = floor_scene()
    turn = turned((0.0, 1.0, 0.0), LEAN)  # its low side is at +x
    r, d, a = DISK, THICKNESS, LEAN
    height = r * math.sin(a) + 0.5 * d * math.cos(a)
    e, n = np.array([math.cos(a), 0.0, -math.sin(a)]), np.array([math.sin(a), 0.0, math.cos(a)])
    spin = -_disk_rate() * math.sin(a) / r * (r * e - 0.5 * d * n)
    scene.add(
        Body(
            "disk",
            Shape.cylinder(r, d),
            position=(0.0, 0.0, height),
            orientation=turn,
            angular_velocity=spin,
            material=dull(0.5, density=7800.0),
        )
    )
    return scene


def _disk_rate() -> float:
    """Return W, rad/s; the mass cancels."""
    r, d, a = DISK, THICKNESS, LEAN
    across, along = (3.0 * r**2 + d**2) / 12.0, 0.5 * r**2
    left = math.sin(a) / r * (r * across * math.cos(a) - 0.5 * d * along * math.sin(a))
    return math.sqrt(GRAVITY * (r * math.cos(a) - 0.5 * d * math.sin(a)) / left)


def check_disk(run: Recording) -> list[Check]:
    """Compare lean, place and turning of the axis with steady motion.

    Forces held over steps of h = 1/60 s are right to second order: (W h)^2 / 24 = 3 % of the motion at W = 53 rad/s, but
    the law has no step in it. The bound, 1 % of the lean, of the radius and of the rate, is what an eye would miss.
    """
    axis = rotate(run.orientation("disk"), np.array([0.0, 0.0, 1.0]))
    lean = np.arccos(np.clip(axis[:, 2], -1.0, 1.0))
    turns = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    rate = (turns[-1] - turns[0]) / run.times[-1]
    moved = np.linalg.norm(run.position("disk")[:, :2], axis=1).max()
    return [
        finite(run),
        at_most("lean, relative error", np.abs(lean / LEAN - 1.0).max(), 0.01, "steady motion"),
        at_most("centre moves, of the radius", moved / DISK, 0.01, "its centre is at rest"),
        at_most("rate about the vertical, relative error", abs(rate / _disk_rate() - 1.0), 0.01, "W^2 sin a = 4 g / r for a thin disk"),
        above_floor(run),
        energy_never_grows(run, 2.0 * DISK),
        undisturbed(run),
    ]


def coin() -> Scene:
    """Return a coin spun on its edge, leaning a little."""
    scene = floor_scene()
    turn = turned((1.0, 0.0, 0.0), 0.5 * math.pi - 0.05)
    height = COIN * math.cos(0.05) + 0.5 * COIN_THICKNESS * math.sin(0.05)
    scene.add(
        Body("coin", Shape.cylinder(COIN, COIN_THICKNESS), position=(0.0, 0.0, height + 1e-4), orientation=turn,
             angular_velocity=(0.0, 0.0, 40.0), material=dull(0.3, 0.2, 7000.0), visual=Visual(color=GOLD))
    )  # fmt: skip
    return scene


def check_coin(run: Recording) -> list[Check]:
    """Check the promises and the ledger."""
    assert run.ledger is not None
    taken = np.sum(list(run.ledger.dissipated.values()), axis=0) if run.ledger.dissipated else 0.0
    balance = np.abs(run.ledger.total + taken - run.ledger.total[0]).max() / run.ledger.total[0]
    return [
        finite(run),
        at_most("error of the ledger, relative", balance, 1e-9, "energy balance"),
        above_floor(run),
        energy_never_grows(run, 2.0 * COIN),
        undisturbed(run),
    ]


def top() -> Scene:
    """Return a tippe top, spun upright with its heavy side down."""
    scene = floor_scene()
    mass = 0.02
    inertia = np.full(3, 0.4 * mass * TOP**2)
    turn = turned((1.0, 0.0, 0.0), 0.05)
    center = rotate(turn, np.array([0.0, 0.0, -OFFSET]))
    spin = (0.0, 0.0, TOP_SPIN)
    # The centre of the ball is at rest: the centre of mass goes round it.
    velocity = np.cross(spin, center)
    scene.add(
        Body("top", Shape.sphere(TOP), position=(0.0, 0.0, TOP), orientation=turn, angular_velocity=spin, velocity=velocity, mass=mass,
             inertia=inertia, center_of_mass=(0.0, 0.0, -OFFSET), material=dull(0.3))
    )  # fmt: skip
    return scene


def check_top(run: Recording) -> list[Check]:
    """Compare Jellett's invariant with its first value, and look whether the top has turned over."""
    inertia = 0.4 * 0.02 * TOP**2
    to_contact = run.position("top") - run.center_of_mass("top") - [0.0, 0.0, TOP]
    jellett = inertia * np.sum(run.angular_velocity("top") * to_contact, axis=1)
    up = rotate(run.orientation("top"), np.array([0.0, 0.0, 1.0]))[:, 2]
    return [
        finite(run),
        at_most(
            "Jellett's L . (c - x), relative change", np.abs(jellett / jellett[0] - 1.0).max(), 5e-4, "constant under any contact force"
        ),
        at_most("cosine of the axis at its lowest", up.min(), -0.85, "1 - s/R < A/C < 1 + s/R and fast: it turns over"),
        above_floor(run),
        energy_never_grows(run, 2.0 * TOP),
        undisturbed(run),
    ]


def rattleback() -> Scene:
    """Return an ellipsoid with skew inertia, spun against its sense."""
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=5)
    shape = Shape.convex_hull(np.asarray(ball.vertices) * AXES)
    mass = 0.1
    a, b, c = AXES
    moments = mass / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    cos, sin = math.cos(SKEW), math.sin(SKEW)
    skew = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    scene = floor_scene()
    height = -float(np.asarray(ball.vertices)[:, 2].min()) * c
    scene.add(
        Body("back", shape, position=(0.0, 0.0, height), orientation=turned((1.0, 0.0, 0.0), 0.01),
             angular_velocity=(WOBBLE, WOBBLE, BACK_SPIN), mass=mass, inertia=matmul(skew * moments, skew.T),
             center_of_mass=(0.0, 0.0, -0.3 * c), material=dull(0.9))
    )  # fmt: skip
    return scene


def check_rattleback(run: Recording) -> list[Check]:
    """Look whether it turned back."""
    spin = run.angular_velocity("back")[:, 2] / BACK_SPIN
    return [
        finite(run),
        at_most("spin over the first spin, at its lowest", spin.min(), -0.3, "it turns back (Walker 1896)"),
        above_floor(run),
        energy_never_grows(run, 2.0 * AXES[0]),
        undisturbed(run),
    ]


SCENES = (
    GalleryScene("euler_disk", "Euler's disk in steady motion: W^2 sin a = 4 g / r, corrected for thickness", disk, check_disk, 2.0, 240.0),
    GalleryScene("coin", "A coin spun on its edge", coin, check_coin, 3.0, 240.0),
    GalleryScene("tippe_top", "A tippe top turns over; Jellett's invariant", top, check_top, 5.0, 120.0),
    GalleryScene("rattleback", "A rattleback spun the wrong way turns back", rattleback, check_rattleback, 4.0, 60.0),
)
