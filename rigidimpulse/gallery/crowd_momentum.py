"""A crowd of bodies collides in flight on the Moon: internal forces cancel (B4).

Impacts, friction, joints and contacts act in pairs, equal and opposite, along one line. Gravity alone changes the total momentum. With M
the mass, and X0, V0 place and velocity of the common centre of mass at the start,

    p(t) = p0 + M g t,    X(t) = X0 + V0 t + g t^2 / 2,    L(t) = L0 + M (X0 t + V0 t^2 / 2) x g    about the origin

Momentum is a sum of rounding: some hundred impacts of 1e-16 of the momentum that moves, sum m |v|; 1e-12 is the bound. Where bodies stay
in touch or joined they are moved by some 1e-6 of their size to keep their gap: two of COUNT that pass each other have another angular
momentum then, 2e-8 / COUNT of the whole each time, so its bound is 1e-8. Energy: impacts only lose it; joints are of second order, a
relative spin of 4 rad/s turns by 0.07 rad in a step, 0.07^2 / 12 = 4e-4 of the pairs' spinning, some hundredth of all: 1e-5. Friction
that acts on one of two bodies, or an impulse at two points a millimetre apart, is off by 1e-3.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, asset_path, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint import BallJoint
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 1.62
COUNT, SHELL, INWARD, UPWARD = 26, 1.6, 1.4, 2.4
"""Number of bodies, m from the middle at the start, m/s towards it and up."""
HEIGHT = 2.2
"""m, of the middle at the start."""
DURATION = 3.0
MOMENTUM, ANGULAR, ENERGY = 1e-12, 1e-8, 1e-5


def scene() -> Scene:
    """Return the crowd, spread over a ball and thrown up, each body towards the middle and spinning; two pairs are joined."""
    rng = np.random.default_rng(4)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    shapes = (
        (Shape.sphere(0.2), 400.0), (Shape.box((0.5, 0.3, 0.2)), 500.0), (Shape.capsule(0.1, 0.4), 700.0),
        (Shape.cylinder(0.22, 0.16), 300.0), (Shape.from_file(asset_path("spot.obj"), scale=0.3), 600.0),
    )  # fmt: skip
    for k in range(COUNT):
        shape, density = shapes[k % len(shapes)]
        out = _direction(k)
        material = Material(density=density, restitution=0.7, static_friction=0.4)
        velocity = -INWARD * out * rng.uniform(0.7, 1.3) + [0.0, 0.0, UPWARD]
        place = SHELL * out + [0.0, 0.0, HEIGHT]
        scene.add(
            Body(
                f"body {k}", shape, position=place, orientation=rng.normal(size=4), velocity=velocity,
                angular_velocity=rng.normal(size=3) * 2.0, material=material,
            )
        )  # fmt: skip
    for a, b in ((0, 1), (7, 8)):
        middle = 0.5 * SHELL * (_direction(a) + _direction(b)) + [0.0, 0.0, HEIGHT]
        scene.add(BallJoint(f"body {a}", f"body {b}", middle, name=f"joint of {a} and {b}"))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare momentum, centre of mass and angular momentum at every frame with the closed forms."""
    from rigidimpulse.scene.mass import body_mass

    assert run.ledger is not None and run.scene is not None
    t, g = run.times[:, None], np.array([0.0, 0.0, -GRAVITY])
    masses = np.array([body_mass(body).mass for body in run.scene.bodies])
    total = masses.sum()
    moving = float(masses @ np.linalg.norm(run.velocities[0], axis=1))
    momentum = run.ledger.momentum - run.ledger.momentum[0] - total * g * t
    centre = np.einsum("i,fik->fk", masses, run.centers) / total
    start, speed = centre[0], run.ledger.momentum[0] / total
    path = centre - (start + speed * t + 0.5 * g * t**2)
    turning = run.ledger.angular_momentum - run.ledger.angular_momentum[0] - total * np.cross(start * t + 0.5 * speed * t**2, g)
    return [
        at_least("impacts", len(run.impacts), 40, "it is a crowd"),
        at_most("error of the momentum, of sum m |v|", np.abs(momentum).max() / moving, MOMENTUM, "p0 + M g t"),
        at_most(
            "error of the centre of mass, of the way of a body", np.abs(path).max() / (INWARD * DURATION), MOMENTUM, "X0 + V0 t + g t^2 / 2"
        ),
        at_most(
            "error of the angular momentum, of r sum m |v|",
            np.abs(turning).max() / (SHELL * moving),
            ANGULAR,
            "L0 + M (X0 t + V0 t^2 / 2) x g",
        ),
        at_most(
            "largest rise of energy, relative",
            np.diff(run.ledger.total).max() / run.ledger.kinetic[0],
            ENERGY,
            "friction and e < 1 only take",
        ),
    ]


def _direction(k: int) -> np.ndarray:
    """Return unit vector number k of COUNT (3,), spread evenly over the sphere (the golden spiral)."""
    height = 1.0 - (2.0 * k + 1.0) / COUNT
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    return np.array([np.sqrt(1.0 - height**2) * np.cos(turn), np.sqrt(1.0 - height**2) * np.sin(turn), height])


SCENES = (GalleryScene("crowd_momentum", "A crowd collides in flight, momentum is kept", scene, check, DURATION),)
