"""A pendulum of two links swings wildly: hard constraints stay closed over a long run (A12).

Let go level, two links on ball joints fall, whip and turn over without ever repeating themselves; where they meet each other or the
hook they rebound without loss. Joints are rigid: the two anchors of each are one point, to the rounding of positions that are corrected
at the end of every sub-step (1e-12 of the length; 1e-9 m is the bound), after ten seconds as after one. Constraints on velocities alone
drift by the square of the step at each one, (w h)^2 l / 2 = 1e-3 m. Nothing takes energy: joints are of second order, (w h)^2 / 12 with
sub-steps in which links turn by some 0.02 rad, 3e-5 of what passes from link to link; over dozens of whips 1e-3 of the fall is the bound.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import quaternion_from_axis_angle, rotate
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import BallJoint
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY, LINKS, LINK, RADIUS, MASS = 9.81, 2, 0.7, 0.06, 1.0
NUDGE = 0.4
"""rad/s of the last link about its own axis's normal, level: the motion leaves the plane."""
HEIGHT, ROD = 2.0, 1.0
"""m, of the pivot, and length of the rod that it hangs on."""
STEP = 1.0 / 60.0
DURATION = 12.0
CLOSED, ENERGY = 1e-9, 1e-3


def scene() -> Scene:
    """Return the links in line along x from the pivot, and the post it is on."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    smooth = Material(restitution=1.0, static_friction=0.0)
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    upright = (1.0, 0.0, 0.0, 0.0)
    hook = Shape.compound(
        [(Shape.sphere(1.4 * RADIUS), (0.0, 0.0, 0.0), upright), (Shape.cylinder(0.02, ROD), (0.0, 0.0, 0.5 * ROD), upright)]
    )
    scene.add(Body("hook", hook, motion="static", position=(0.0, 0.0, HEIGHT), material=smooth))
    # A capsule lies along z: a quarter turn about y lays it along x.
    level = quaternion_from_axis_angle((0.0, 1.0, 0.0), 0.5 * np.pi)
    link, above = Shape.capsule(RADIUS, LINK - 2.0 * RADIUS), "hook"
    for k in range(LINKS):
        name, spin = f"link {k + 1}", (0.0, 0.0, NUDGE if k == LINKS - 1 else 0.0)
        place = ((k + 0.5) * LINK, 0.0, HEIGHT)
        scene.add(
            Body(
                name,
                link,
                position=place,
                orientation=level,
                velocity=(0.0, 0.5 * LINK * spin[2], 0.0),
                angular_velocity=spin,
                mass=MASS,
                material=smooth,
            )
        )
        scene.add(BallJoint(above, name, (k * LINK, 0.0, HEIGHT), name=f"joint {k + 1}"))
        above = name
    return scene


def check(run: Recording) -> list[Check]:
    """Check the gaps of the joints at the ends of steps, early and late, and the energy."""
    ends = np.abs(run.times / STEP - np.round(run.times / STEP)) < 1e-6
    gap = _gaps(run)[ends]
    late = run.times[ends] > 0.5 * DURATION
    assert run.ledger is not None
    fall = GRAVITY * MASS * LINK * 0.5 * LINKS**2
    turns = np.abs(run.angular_velocities).max() / (2.0 * np.pi)
    return [
        at_most("anchors apart in the first half, m", gap[~late].max(), CLOSED, "joints are rigid"),
        at_most("anchors apart in the second half, m", gap[late].max(), CLOSED, "and do not drift"),
        at_most("energy, change of that of the fall", np.ptp(run.ledger.total[ends]) / fall, ENERGY, "no work is done; second order"),
        at_least("fastest link, turns a second", turns, 1.0, "it whips"),
    ]


def _gaps(run: Recording) -> np.ndarray:
    """Return the largest distance (f,) between the two anchors of a joint, m."""
    half, end = np.array([0.0, 0.0, 0.5 * LINK]), np.array([0.0, 0.0, HEIGHT])
    largest = np.zeros(len(run.times))
    for k in range(LINKS):
        centre, turn = run.position(f"link {k + 1}"), run.orientation(f"link {k + 1}")
        largest = np.maximum(largest, np.linalg.norm(centre - rotate(turn, half) - end, axis=1))
        end = centre + rotate(turn, half)
    return largest


SCENES = (GalleryScene("pendulum_drift", "Two links swing wildly, and stay joined (animation notes A12)", scene, check, DURATION),)
