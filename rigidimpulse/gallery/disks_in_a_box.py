"""Three disks in a box (B16), against the exact event-driven run.

Spheres of radius 1 m in the plane z = 0, walls at x, y = +-5 m, no gravity, e = 1, no friction: 60 s of straight
lines between 35 impacts, 11 of them between disks. An error at one impact grows about a hundredfold until the end of
the run for each further impact of the same disks, so this scene finds small errors of impact times.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.event_driven import DisksInRectangle
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

RADIUS = 1.0
HALF_SIDE = 5.0
POSITIONS = ((1.0, 1.0), (-1.0, -1.1), (-3.0, 3.0))
VELOCITIES = ((0.0, 0.0), (1.0, 1.0), (-0.25, 0.25))
DURATION = 60.0
WALLS = {"wall -x": (1, 0, 0), "wall +x": (-1, 0, 0), "wall -y": (0, 1, 0), "wall +y": (0, -1, 0)}
SMOOTH = Material(restitution=1.0, static_friction=0.0, dynamic_friction=0.0)
POSITION_BOUND = 1e-8
TIME_BOUND = 1e-7
"""s: the same, at the speed of 0.1 m/s that an approach has at least."""
ENERGY_BOUND = 1e-12
FIRST_IMPACT = 0.636670597
"""s, rounded as it is printed in the source."""


def scene() -> Scene:
    """Return the box and its disks."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    for name, normal in WALLS.items():
        scene.add(Body(name, Shape.half_space(normal, -HALF_SIDE), motion="static", material=SMOOTH))
    disk = Shape.sphere(RADIUS)
    for k, (position, velocity) in enumerate(zip(POSITIONS, VELOCITIES, strict=True)):
        scene.add(Body(f"disk {k}", disk, position=(*position, 0.0), velocity=(*velocity, 0.0), material=SMOOTH))
    return scene


def exact(times: np.ndarray) -> Exact:
    """Return the motion in decimal arithmetic; energy is kept."""
    disks = DisksInRectangle.of(POSITIONS, VELOCITIES, RADIUS, (HALF_SIDE, HALF_SIDE))
    positions, events = disks.frames(times)
    named = {f"disk {k}": positions[:, k] for k in range(len(POSITIONS))}
    return Exact(named, energy=np.zeros(len(times)), impacts=np.array([float(event.time) for event in events]))


def check(run: Recording) -> list[Check]:
    """Compare with the exact run."""
    exact = DisksInRectangle.of(POSITIONS, VELOCITIES, RADIUS, (HALF_SIDE, HALF_SIDE))
    events = exact.advance(float(run.times[-1]))
    between = (run.impacts["body_a"] >= len(WALLS)) & (run.impacts["body_b"] >= len(WALLS))
    times = np.array([float(event.time) for event in events])
    late = np.abs(run.impacts["time"] - times).max() if len(run.impacts) == len(times) else np.inf
    final = np.array([[float(x) for x in position] for position in exact.positions])
    error = np.array([run.position(f"disk {k}")[-1, :2] - final[k] for k in range(len(final))])
    energy = run.ledger.total if run.ledger else np.array([np.nan])
    law = "straight lines and roots of quadratics, 50 digits"
    return [
        equal("impacts", len(run.impacts), len(events), law),
        equal("impacts between disks", int(between.sum()), sum(event.b >= 0 for event in events), law),
        at_most("first impact, s from 0.636670597", abs(run.impacts["time"][0] - FIRST_IMPACT), 1e-9, "B16"),
        at_most("error of impact times, s", late, TIME_BOUND, law),
        at_most("error of final positions, m", np.abs(error).max(), POSITION_BOUND, law),
        at_most("energy, relative change", np.ptp(energy) / energy[0], ENERGY_BOUND, "e = 1 keeps energy"),
    ]


SCENES = (
    GalleryScene(
        "disks_in_a_box", "Three elastic disks in a box for 60 s: 35 impacts, 11 between disks", scene, check, DURATION, exact=exact
    ),
)
