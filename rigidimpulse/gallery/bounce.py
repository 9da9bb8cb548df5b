"""A ball dropped from 10 m on a floor, without loss: it comes back to 10 m for ever.

With h the height of its foot above the floor at the start and T = sqrt(2 h / g) the time it falls,

    z(t) = r + h - g s^2 / 2,    s = |t - 2 k T|,    k the whole number nearest to t / 2 T,

impacts at (2 k + 1) T, each with the impulse 2 m sqrt(2 g h). The only error of a run is that of its impact times.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY, RADIUS, HEIGHT = 9.81, 0.5, 9.5
"""m/s^2; m: the ball, and its foot above the floor."""
FALL = math.sqrt(2.0 * HEIGHT / GRAVITY)
DURATION = 10.0
BOUND = 1e-12
"""m, s and relative: four impacts, each to rounding of ten metres, times the 14 m/s."""


def scene() -> Scene:
    """Return the floor and the ball."""
    rubber = Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=rubber))
    scene.add(Body("ball", Shape.sphere(RADIUS), position=(0.0, 0.0, RADIUS + HEIGHT), material=rubber))
    return scene


def exact(times: np.ndarray) -> Exact:
    """Return the parabolas."""
    since = np.abs(times - 2.0 * FALL * np.round(times / (2.0 * FALL)))
    place = np.zeros((len(times), 3))
    place[:, 2] = RADIUS + HEIGHT - 0.5 * GRAVITY * since**2
    met = FALL * np.arange(1, 2 * len(times), 2)
    return Exact({"ball": place}, energy=np.zeros(len(times)), impacts=met[met <= times[-1]])


def check(run: Recording) -> list[Check]:
    """Compare with the parabolas."""
    law = exact(run.times)
    assert run.ledger is not None and law.impacts is not None
    found = run.impacts["time"]
    late = np.abs(found - law.impacts).max() if len(found) == len(law.impacts) else math.inf
    total = run.ledger.total
    return [
        equal("impacts", len(found), len(law.impacts), "one every 2 sqrt(2 h / g)"),
        at_most("error of impact times, s", late, BOUND, "(2 k + 1) sqrt(2 h / g)"),
        at_most("error of the place, m", np.abs(run.position("ball") - law.position["ball"]).max(), BOUND, "parabolas"),
        at_most("energy, relative change", np.ptp(total) / total[0], BOUND, "e = 1 keeps energy"),
    ]


SCENES = (GalleryScene("bounce", "A ball bounces without loss", scene, check, DURATION,
    elsewhere="apex error at dt 1/60 and 1e-4: MuJoCo 15 mm and 0.09, PyBullet 0.03 and 1e-6, Rapier 1 and 0.3, PhysX 6 and 2e-4 mm",
    exact=exact),)  # fmt: skip
