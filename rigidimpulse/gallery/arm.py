"""An arm of two parts falls: a shoulder in a cone, with a soft stop of its twist, and an elbow that does not bend backwards.

Both joints are of six axes (see `scene.joint_six_axis`). The shoulder is a ball joint, its axis within CONE of that of the
socket, its twist stopped by a spring and damper; the elbow is a hinge between bounds. Limits are bounds, to the error at
which joints are closed, and only take energy: kinetic and potential energy together do not rise, except by what the soft
stop gives back, which is little.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import conjugate, multiply
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint_six_axis import Limit, SixAxisJoint
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
CONE, BEND = 1.0, (0.0, 2.2)
"""rad: half angle of the shoulder's cone, bounds of the elbow."""
LENGTH, RADIUS = 0.6, 0.06
DURATION = 3.0
BOUND = 1e-9
GAIN = 1e-3
"""Energy that the soft stop may give back and the method of the joints, of second order, make, relative to m g l of the arm."""


def scene() -> Scene:
    """Return the arm, stretched out sideways; x is along it, gravity along -z, the socket looks down and outwards."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    part = Shape.box((LENGTH - 2.0 * RADIUS, 2.0 * RADIUS, 1.5 * RADIUS))
    scene.add(Body("upper", part, position=(0.5 * LENGTH, 0.0, 0.0), mass=2.0))
    scene.add(Body("lower", part, position=(1.5 * LENGTH, 0.0, 0.0), mass=1.5))
    fixed = Limit(translation="xyz", upper=0.0)
    twist = Limit(rotation="x", lower=-0.2, upper=0.2, stiffness=20.0, damping=0.3)
    scene.add(SixAxisJoint(None, "upper", (0, 0, 0), limits=[fixed, Limit(rotation="yz", upper=CONE), twist], name="shoulder"))
    hinge = [fixed, Limit(rotation="xz", upper=0.0), Limit(rotation="y", lower=BEND[0], upper=BEND[1])]
    scene.add(SixAxisJoint("upper", "lower", (LENGTH, 0, 0), limits=hinge, name="elbow"))
    return scene


def check(run: Recording) -> list[Check]:
    """Check both limits and the energy."""
    upper, lower = run.orientation("upper"), run.orientation("lower")
    swing = 2.0 * np.arcsin(np.minimum(np.hypot(upper[:, 2], upper[:, 3]), 1.0))
    elbow = multiply(conjugate(upper), lower)
    bend = 2.0 * np.arctan2(elbow[:, 2], elbow[:, 0])
    assert run.ledger is not None
    scale = 1.5 * GRAVITY * 1.5 * LENGTH + 2.0 * GRAVITY * 0.5 * LENGTH
    rise = np.max(run.ledger.total - np.minimum.accumulate(run.ledger.total))
    return [
        at_most("swing beyond the cone, rad", swing.max() - CONE, BOUND, "it is a limit"),
        at_least("largest swing, rad", swing.max(), CONE - 1e-3, "the arm falls against it"),
        at_most("elbow beyond its bounds, rad", max(bend.max() - BEND[1], BEND[0] - bend.min()), BOUND, "it is a limit"),
        at_most("rise of energy, relative", rise / scale, GAIN, "limits only take energy"),
    ]


SCENES = (GalleryScene("arm", "An arm with limits at shoulder and elbow falls", scene, check, DURATION),)
