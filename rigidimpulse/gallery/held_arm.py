"""An arm that controllers hold up is hit by a ball and comes back to its pose (A15).

Each part is pulled to its place and turn by a proportional-derivative controller; hinges hold the parts together and to the world. Under
gravity it sags a little, to where springs and weight balance. After the hit it swings back there. Controllers store no energy in the
ledger: the energy that they and the impact took is missing there. The pose at rest does not depend on the length of steps, so those of
"preview" are enough.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rigidimpulse.dynamics.forces.pd import PDController
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import HingeJoint
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
PARTS = ("upper arm", "lower arm", "hand")
LENGTHS, MASSES = (0.6, 0.5, 0.25), (2.0, 1.4, 0.5)
STIFFNESS, DAMPING = 300.0, 8.0
TURN, TURN_DAMPING = 3.0, 0.1
BALL_START, BALL_SPEED = (1.36, 0.0, 3.0), -2.0
DURATION = 6.0
RETURN, SLOW = 5e-4, 2e-3
"""m, m/s: what is left of the swing, and the errors that the preview allows in contact, of the order of 1e-3 of the size a step."""


def scene() -> Scene:
    """Return the arm, stretched out along x from a post, and a ball above it."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    hard = Material(restitution=0.5)
    scene.add(Body("post", Shape.box((0.2, 0.3, 1.6)), motion="static", position=(-0.15, 0.0, 0.2)))
    scene.add(Body("floor", Shape.half_space(offset=-0.6), motion="static", material=hard))
    at, before = 0.0, None
    for name, length, mass in zip(PARTS, LENGTHS, MASSES, strict=True):
        place = (at + 0.5 * length, 0.0, 0.5)
        scene.add(Body(name, Shape.box((length - 0.04, 0.12, 0.08)), mass=mass, position=place, material=hard))
        scene.add(HingeJoint(before, name, (at, 0.0, 0.5), (0.0, 1.0, 0.0), name=f"hinge of the {name}"))
        gains: dict[str, Any] = {"stiffness": STIFFNESS, "damping": DAMPING, "angular_stiffness": TURN, "angular_damping": TURN_DAMPING}
        scene.add(PDController(name, position=place, orientation=(1.0, 0.0, 0.0, 0.0), **gains))
        at, before = at + length, name
    ball = Shape.sphere(0.1)
    scene.add(Body("ball", ball, mass=1.5, position=BALL_START, velocity=(0.0, 0.0, BALL_SPEED), material=hard))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare the pose at the end with the balance of forces, known from statics."""
    found = np.array([run.position(name)[-1, 2] - run.position(name)[0, 2] for name in PARTS])
    low = min(float((run.position(name)[:, 2] - run.position(name)[0, 2]).min()) for name in PARTS)
    speed = max(float(np.linalg.norm(run.velocity(name)[-1])) for name in PARTS)
    hits = run.impacts[(run.impacts["body_a"] == run.index("ball")) | (run.impacts["body_b"] == run.index("ball"))]
    assert run.ledger is not None
    balance = run.ledger.total + sum(run.ledger.dissipated.values())
    return [
        at_least("impacts of the ball", len(hits), 1, "it falls on the arm"),
        at_least("lowest way of the hand, m", -low, 0.05, "the arm gives way"),
        at_most("pose at the end off the balance, m", np.abs(found - balanced()).max(), RETURN, "forces and moments sum to 0"),
        at_most("speed of the arm at the end, m/s", speed, SLOW, "damped"),
        at_most("ledger, J", np.ptp(balance), 0.02, "total and dissipated energy stay"),
    ]


def balanced() -> np.ndarray:
    """Return how far the parts' centres rise (negative: sag) where springs and weights balance: the minimum of V over the three angles."""
    from scipy.optimize import minimize

    lengths, masses = np.array(LENGTHS), np.array(MASSES)
    starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])

    def centres(angles: np.ndarray) -> np.ndarray:
        steps = lengths[:, None] * np.column_stack([np.cos(angles), -np.sin(angles)])
        return np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)[:-1]]) + 0.5 * steps

    def potential(angles: np.ndarray) -> float:
        off = centres(angles) - np.column_stack([starts + 0.5 * lengths, np.zeros(3)])
        return float(0.5 * STIFFNESS * (off**2).sum() + 0.5 * TURN * (angles**2).sum() + GRAVITY * masses @ off[:, 1])

    best = minimize(potential, np.zeros(3), method="BFGS", options={"gtol": 1e-9})
    return centres(best.x)[:, 1]


SCENES = (
    GalleryScene("held_arm", "An arm held by controllers is hit by a ball and comes back", scene, check, DURATION, accuracy="preview"),
)
