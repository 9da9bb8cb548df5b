"""Crowds: 216 balls, ten thousand random impacts, dominoes, superellipsoids.

216 balls of radius 0.1 m and 10 kg in a cube of 6 x 6 x 6 at a pitch of 0.21 m, with 1 mm of noise, no friction, for 10 s.
e = 0: they fall on each other and spread; the mean over time of the summed squared penetration, of each other and of the
floor, is at most 1e-8 m^2. e = 1, from 1 m higher: energy is kept; its mean squared error is at most 1e-12 J^2, which is
1e-6 J of 30 kJ, 3e-11 relative.

Random impacts: clouds of bodies of all kinds, thrown at their middle, with random masses (1 : 10,000), spins, e in [0, 1] and
mu in [0, 2], one cloud after the other until there are ten thousand impacts. In the middle light bodies are caught between
heavy ones and all slide, roll and spin on each other. No impact may make energy: from one frame to the next, so close that
one impact or two lie between them, what impacts took never falls by more than rounding. Lasting contacts hold their forces
over sub-steps in which they turn by 0.01 rad at most: what they make is of second order in that, 1e-4 of the energy. A
million take an hour: `tests/bench/random_impacts.py`.

Dominoes: the first is pushed, all fall, each against the next. An even row falls with a wave of constant speed.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.core.quaternion import rotate
from rigidimpulse.engine.simulate import simulate
from rigidimpulse.gallery.hard.parts import above_floor, apart, dull, energy_never_grows, finite, floor_scene, turned
from rigidimpulse.gallery.looks import domino
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIDE, RADIUS, MASS, PITCH, LOWEST, NOISE = 6, 0.1, 10.0, 0.21, 0.101, 1e-3
CLOUD, CLOUD_TIME, CLOUD_FPS = 60, 0.5, 20_000.0
NUM_IMPACTS = 10_000
DOMINO, SPACING, NUM_DOMINOES = (0.0075, 0.024, 0.048), 0.02, 25
EXPONENT, HALF_AXES = 4.0, (0.3, 0.2, 0.15)


def balls(restitution: float, higher: float) -> Scene:
    """Return the cube of balls above the floor."""
    smooth = dull(0.0, restitution)
    scene = floor_scene(smooth)
    random = np.random.default_rng(0)
    ball = Shape.sphere(RADIUS)
    for k in range(SIDE**3):
        i, j, layer = k % SIDE, k // SIDE % SIDE, k // SIDE**2
        place = np.array([PITCH * (i - 2.5), PITCH * (j - 2.5), LOWEST + higher + PITCH * layer])
        place[:2] += NOISE * random.uniform(-1.0, 1.0, 2)
        scene.add(Body(f"ball {k + 1}", ball, position=place, mass=MASS, material=smooth))
    return scene


def check_balls(run: Recording) -> list[Check]:
    """Check penetration of frames, and energy."""
    from scipy.spatial import KDTree

    floor, summed = run.index("floor"), []
    places = np.delete(run.positions, floor, axis=1)
    for at in places:
        pairs = KDTree(at).query_pairs(2.0 * RADIUS, output_type="ndarray") if np.all(np.isfinite(at)) else np.zeros((0, 2), int)
        deep = 2.0 * RADIUS - np.linalg.norm(at[pairs[:, 1]] - at[pairs[:, 0]], axis=1)
        summed.append(float(np.sum(deep**2) + np.sum(np.maximum(RADIUS - at[:, 2], 0.0) ** 2)))
    return [
        finite(run),
        at_most("summed squared penetration, mean over time, m2", float(np.mean(summed)), 1e-8, "the issue's bound: 1e-8 m2"),
        energy_never_grows(run, 2.0 * RADIUS, SIDE),
    ]


def check_elastic(run: Recording) -> list[Check]:
    """Check that energy is kept."""
    assert run.ledger is not None
    total = run.ledger.total
    return [
        *check_balls(run)[:2],
        at_most("mean squared error of energy, J2", float(np.mean((total - total[0]) ** 2)), 1e-12, "e = 1, no friction: E is kept"),
    ]


def cloud(seed: int) -> Scene:
    """Return bodies of all kinds that fly at each other, without gravity."""
    random = np.random.default_rng(seed)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    shapes = (
        Shape.sphere(0.1),
        Shape.box((0.3, 0.15, 0.1)),
        Shape.capsule(0.06, 0.2),
        Shape.convex_hull(0.15 * random.normal(size=(12, 3))),
    )
    cells = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=3).reshape(-1, 3)[:CLOUD] - 1.5
    for k in range(CLOUD):
        place = 0.8 * cells[k] + 0.05 * random.normal(size=3)
        velocity = -3.0 * place + random.normal(size=3)
        friction = float(random.uniform(0.0, 2.0)) if random.random() < 0.7 else 0.0
        scene.add(
            Body(f"body {k}", shapes[k % 4], position=place, orientation=random.normal(size=4), velocity=velocity,
                 angular_velocity=4.0 * random.normal(size=3), mass=10.0 ** random.uniform(-2.0, 2.0),
                 material=dull(friction, float(random.uniform(0.0, 1.0))))
        )  # fmt: skip
    return scene


def check_random(num_impacts: int, run: Recording) -> list[Check]:
    """Go on with further clouds until there are enough impacts; energy of every frame of each against the ones before."""
    count, made, rise, seed, problems = 0, 0.0, 0.0, 0, 0
    while True:
        assert run.ledger is not None
        kinetic = run.ledger.kinetic
        made = max(made, float(-np.diff(run.ledger.dissipated["impact"]).min() / kinetic[0]))
        rise = max(rise, float((kinetic - np.minimum.accumulate(kinetic)).max() / kinetic[0]))
        count += len(run.impacts)
        problems += any(event.is_problem and event.time > 0.0 for event in run.status.events)
        if count >= num_impacts or not np.all(np.isfinite(kinetic)):
            break
        seed += 1
        run = simulate(cloud(seed), CLOUD_TIME, CLOUD_FPS)
    return [
        finite(run),
        at_least("impacts", count, num_impacts, "as many as asked for"),
        at_most("largest energy made by impacts in a frame, relative", made, 1e-13, "e <= 1: no impact makes energy, friction or not"),
        at_most("largest rise of energy, relative", rise, 1e-4, "lasting contacts: (0.01 rad)^2, the turn of a sub-step"),
        at_most("clouds whose status reports something after the start", problems, 0, "none jams"),
    ]


def dominoes() -> Scene:
    """Return a row of dominoes, the first with a push that tips it over."""
    material = dull(0.4, 0.0, 600.0)
    scene = floor_scene(material)
    shape = Shape.box(DOMINO)
    for k in range(NUM_DOMINOES):
        push = (0.0, 8.0, 0.0) if k == 0 else (0.0, 0.0, 0.0)
        speed = (8.0 * 0.5 * DOMINO[2], 0.0, 8.0 * 0.5 * DOMINO[0]) if k == 0 else (0.0, 0.0, 0.0)
        place = (k * SPACING, 0.0, 0.5 * DOMINO[2])
        look = domino(DOMINO, 1 + k % 6, 1 + k // 6 % 6)
        scene.add(
            Body(f"domino {k + 1}", shape, position=place, velocity=speed, angular_velocity=push, material=material, visual=look)
        )  # fmt: skip
    return scene


def check_dominoes(run: Recording) -> list[Check]:
    """Check that all fall, one after the other, with a steady wave."""
    up = np.stack([rotate(run.orientation(f"domino {k + 1}"), np.array([0.0, 0.0, 1.0]))[:, 2] for k in range(NUM_DOMINOES)])
    # A domino is on its way when it leans beyond its own tipping angle.
    tipped = math.cos(math.atan2(DOMINO[0], DOMINO[2]))
    times = [float(run.times[np.argmax(row < tipped)]) if np.any(row < tipped) else math.inf for row in up]
    late = np.diff(times[NUM_DOMINOES // 2 : -2])
    uneven = float(np.ptp(late) / np.mean(late)) if np.all(np.isfinite(late)) else math.inf
    fallen = int(np.sum(np.isfinite(times)))
    return [
        finite(run),
        equal("dominoes that fell", fallen, NUM_DOMINOES, "each has energy enough for the next"),
        equal("out of their order", int(np.sum(np.diff(times) <= 0.0)), 0, "each pushes the next"),
        at_most(
            "time from one to the next, second half: spread over mean", uneven, 0.25, "a steady wave; frames of 1/480 s read it to 0.1"
        ),
        above_floor(run),
        apart(run),
        energy_never_grows(run, DOMINO[2]),
    ]


def superellipsoids() -> Scene:
    """Return rounded boxes, |x/a|^4 + |y/b|^4 + |z/c|^4 = 1, that fall onto a pile."""
    from trimesh.creation import icosphere

    directions = np.asarray(icosphere(subdivisions=3).vertices)
    reach = np.sum(np.abs(directions) ** EXPONENT, axis=1) ** (-1.0 / EXPONENT)
    shape = Shape.convex_hull(directions * reach[:, None] * HALF_AXES)
    material = dull(0.4, 0.2)
    scene = floor_scene(material)
    for k in range(6):
        turn = turned((1.0, 0.3 * k, 0.5), 0.7 * k)
        scene.add(Body(f"body {k + 1}", shape, position=(0.1 * (k % 3), 0.07 * k, 0.5 + 0.6 * k), orientation=turn, material=material))
    return scene


def check_superellipsoids(run: Recording) -> list[Check]:
    """Check the promises."""
    return [finite(run), above_floor(run), apart(run), energy_never_grows(run, 2.0 * HALF_AXES[0], 6)]


SCENES = (
    GalleryScene("balls_216", "216 balls fall on each other, e = 0", partial(balls, 0.0, 0.0), check_balls, 10.0, 30.0),
    GalleryScene("balls_216_elastic", "216 balls fall on each other, e = 1", partial(balls, 1.0, 1.0), check_elastic, 10.0, 30.0),
    GalleryScene(
        "random_impacts",
        f"{NUM_IMPACTS:,} random impacts",
        partial(cloud, 0),
        partial(check_random, NUM_IMPACTS),
        CLOUD_TIME,
        CLOUD_FPS,
    ),
    GalleryScene("dominoes", "A row of dominoes", dominoes, check_dominoes, 2.0, 480.0),
    GalleryScene("superellipsoids", "Six superellipsoids fall onto a pile", superellipsoids, check_superellipsoids, 4.0),
)
