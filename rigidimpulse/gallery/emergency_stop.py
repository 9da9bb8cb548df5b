"""An emergency stop with locked wheels (B2): a car, 29 m/s, a cow on the road.

Sliding friction mu m g is all that slows the car, whichever wheel bears how much of the weight:

    t = V / (mu g),    x = V t - mu g t^2 / 2,    stop after V^2 / (2 mu g)

With the centre of mass a height h above the road, half way between axles L apart, the friction under it tips the weight onto the front
axle until moments balance, N_front L = m g (L / 2 + mu h); once the car stands both bear half. V = 29 m/s and mu = 0.8 stop in 3.695 s,
53.6 m. All forces are constant until the stop, so the ways are polynomials and errors are those of the equations of contact, solved to
some 1e-12, and of the contact margin, 1e-6 of the car: 1e-6 relative is generous, and a step that stops a sixtieth of a second late is
off by 2e-3.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import multiply, quaternion_from_axis_angle, rotate
from rigidimpulse.gallery.car import AXLE, CENTRE_HEIGHT, GRAVITY, LENGTH, make_car, road
from rigidimpulse.gallery.record import Check, GalleryScene, asset_path, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SPEED, FRICTION, MASS = 29.0, 0.8, 1400.0
PRINTED_TIME = 3.695
"""s, as printed in the dynamics notes."""
TIME, WAY = SPEED / (FRICTION * GRAVITY), SPEED**2 / (2.0 * FRICTION * GRAVITY)
SPARE = 0.6
"""m between the car, once it stands, and the cow."""
COW_SCALE = 0.9
DURATION = 4.5
RELATIVE = 1e-6


def scene() -> Scene:
    """Return the road, the car and the cow, which stands beyond the place where the bumper stops."""
    scene = road(WAY + LENGTH)
    scene.add(make_car("car", 0.0, SPEED, MASS, FRICTION))
    cow = Shape.from_file(asset_path("spot.obj"), scale=COW_SCALE)
    # The model is Y up and looks along its -z; it stands across the road.
    upright = quaternion_from_axis_angle((1.0, 0.0, 0.0), 0.5 * np.pi)
    stance = multiply(quaternion_from_axis_angle((0.0, 0.0, 1.0), 0.15 * np.pi), upright)
    reach = np.array([rotate(stance, v) for v in cow.surface().vertices])
    place = (WAY + 0.5 * LENGTH + SPARE - reach[:, 0].min(), 0.0, -reach[:, 2].min())
    scene.add(Body("spot", cow, motion="static", position=place, orientation=stance))
    return scene


def check(run: Recording) -> list[Check]:
    """Compare the way, the stop and the loads of the axles with the closed forms."""
    t = np.minimum(run.times, TIME)
    way = run.position("car")[:, 0]
    error = np.abs(way - (SPEED * t - 0.5 * FRICTION * GRAVITY * t**2)).max()
    speed = run.velocity("car")[:, 0]
    # The deceleration between two frames well inside the slide gives the time of the stop, whatever the frame rate.
    last = int(np.searchsorted(run.times, 0.9 * TIME))
    stop = SPEED * run.times[last] / (SPEED - speed[last])
    half_weight = 0.5 * MASS * GRAVITY
    sliding = half_weight * (1.0 + FRICTION * CENTRE_HEIGHT / AXLE)
    return [
        at_most("error of the way at any time, of the stopping distance", error / WAY, RELATIVE, "x = V t - mu g t^2 / 2"),
        at_most("error of the time of the stop, relative", abs(stop / TIME - 1.0), RELATIVE, "t = V / (mu g)"),
        at_most("time of the stop from 3.695, s", abs(stop - PRINTED_TIME), 5e-4, "as printed in the dynamics notes"),
        at_most("speed once it stands, m/s", np.abs(speed[run.times > TIME]).max(), 0.0, "friction holds it"),
        at_most("front axle while it slides, of its load", abs(_front(run, last) / sliding - 1.0), RELATIVE, "m g (1/2 + mu h / L)"),
        at_most("front axle at rest, of its load", abs(_front(run, -1) / half_weight - 1.0), RELATIVE, "m g / 2"),
        at_least("bumper from the cow, m", _spare(run), SPARE - RELATIVE * WAY, "V^2 / (2 mu g) fits"),
    ]


def _front(run: Recording, frame: int) -> float:
    """Return the load of the front axle at a frame, N."""
    contacts, road = run.contacts_at(frame), run.index("road")
    ahead = contacts["point"][:, 0] > run.position("car")[frame, 0]
    up = np.where(contacts["body_a"] == road, 1.0, -1.0)
    return float(np.sum((up * contacts["force"][:, 2])[ahead]))


def _spare(run: Recording) -> float:
    """Return how far the bumper is from the cow at the end, m along the road."""
    assert run.scene is not None
    vertices = run.scene["spot"].shape.surface().vertices
    near = min(rotate(run.orientation("spot")[-1], v)[0] for v in vertices) + run.position("spot")[-1, 0]
    return float(near - run.position("car")[-1, 0] - 0.5 * LENGTH)


SCENES = (GalleryScene("emergency_stop", "A car with locked wheels stops before a cow", scene, check, DURATION),)
