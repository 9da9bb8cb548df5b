"""A car of one rigid piece, wheels locked: the shape that the scenes of braking and crashing share."""

from __future__ import annotations

from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
LENGTH = 4.4
"""m, from bumper to bumper; both faces are upright, between the heights of BUMPER."""
AXLE, TRACK = 1.3, 0.8
"""m: the axles are this far before and behind the origin, the wheels this far beside it."""
CENTRE_HEIGHT = 0.5
"""m, h: of the centre of mass, above the origin, which lies on the road; the bumpers are level with it: a push there tips nothing."""
BUMPER = (0.4, 0.6)
WHEEL_RADIUS, WHEEL_WIDTH = 0.36, 0.24
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
ACROSS = (0.7071067811865476, 0.7071067811865476, 0.0, 0.0)
"""Turns the axis of a cylinder from z to y."""
LOWER = (
    (-2.05, 0.3),
    (-2.2, BUMPER[0]),
    (-2.2, BUMPER[1]),
    (-2.12, 0.86),
    (1.15, 0.86),
    (2.1, 0.72),
    (2.2, BUMPER[1]),
    (2.2, BUMPER[0]),
    (2.05, 0.3),
)
CABIN_FOOT, CABIN_ROOF = ((-1.95, 0.84), (1.15, 0.84)), ((-1.35, 1.38), (0.25, 1.4))
"""Outlines in the plane of x and z, m."""
HALF_WIDTH, HALF_ROOF = 0.84, 0.62
POST, POST_PITCH, VERGE = (0.14, 0.14, 0.9), 6.0, 2.6


def car_shape() -> Shape:
    """Return body, cabin and four wheels; x points ahead, the origin is on the road between the wheels."""
    lower = [(x, y, z) for y in (-HALF_WIDTH, HALF_WIDTH) for x, z in LOWER]
    cabin = [
        (x, side * width, z)
        for side in (-1.0, 1.0)
        for width, ends in ((HALF_WIDTH - 0.04, CABIN_FOOT), (HALF_ROOF, CABIN_ROOF))
        for x, z in ends
    ]
    wheel = Shape.cylinder(WHEEL_RADIUS, WHEEL_WIDTH)
    parts = [(Shape.convex_hull(lower), (0.0, 0.0, 0.0), UPRIGHT), (Shape.convex_hull(cabin), (0.0, 0.0, 0.0), UPRIGHT)]
    parts += [(wheel, (x, y, WHEEL_RADIUS), ACROSS) for x in (-AXLE, AXLE) for y in (-TRACK, TRACK)]
    return Shape.compound(parts)


def make_car(name: str, place: float, speed: float, mass: float, friction: float) -> Body:
    """Return a car at x = `place` m with `speed` m/s along x, of `mass` kg, its wheels locked on a road of this friction.

    Where two cars meet, the lesser friction of the two counts.
    """
    tyres = Material(restitution=0.0, static_friction=friction, dynamic_friction=friction, friction_combine="minimum")
    return Body(
        name,
        car_shape(),
        position=(place, 0.0, 0.0),
        velocity=(speed, 0.0, 0.0),
        mass=mass,
        center_of_mass=(0.0, 0.0, CENTRE_HEIGHT),
        material=tyres,
    )


def road(length: float) -> Scene:
    """Return a scene with a level road along x, posts on both sides from 0 to `length` m."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("road", Shape.half_space(), motion="static"))
    post = Shape.box(POST)
    for k in range(int(length / POST_PITCH) + 1):
        for side, y in (("left", VERGE), ("right", -VERGE)):
            scene.add(Body(f"{side} post {k}", post, motion="static", position=(k * POST_PITCH, y, 0.5 * POST[2])))
    return scene
