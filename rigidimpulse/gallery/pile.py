"""A pile: boxes fall into a walled pit and pile up; the sub-stepped solver takes over where they touch.

No formula says how they lie in the end. But all of them stay in the pit, and none is inside another. Energy only falls, except by the
energy that the skins of the contacts give back. Friction and impacts without rebound bring them to rest, and then no bit changes. Walls and
boxes are those of the pile in the comparison of engines (side 0.5 m, mu = 0.5, e = 0), of a lighter material and fewer of them.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.quaternion import normalize
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.regime import TALL
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIDE, PITCH, LAYERS = 0.5, 0.9, 8
GRAVITY = 9.81
NUM_BOXES = 128
MATERIAL = Material(density=8.0, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)
SKIN = TOLERANCES.sub_stepping.skin * 0.5 * SIDE
DURATION = 5.0


def pile(num_boxes: int = NUM_BOXES, layers: int = LAYERS) -> Scene:
    """Return boxes above a pit of four walls, turned and thrown at random."""
    random = np.random.default_rng(0)
    side = math.ceil(math.sqrt(num_boxes / layers))
    half = 0.5 * side * PITCH
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=MATERIAL))
    for name, normal in (("-x", (1, 0, 0)), ("+x", (-1, 0, 0)), ("-y", (0, 1, 0)), ("+y", (0, -1, 0))):
        scene.add(Body(f"wall {name}", Shape.half_space(normal=normal, offset=-half), motion="static", material=MATERIAL))
    box = Shape.box(SIDE)
    for k in range(num_boxes):
        place = PITCH * (k % side + 0.5) - half, PITCH * (k // side % side + 0.5) - half, 0.6 + k // side**2
        q = random.normal(size=4)
        scene.add(
            Body(f"box {k + 1}", box, position=place, orientation=normalize(q), velocity=(*random.normal(0.0, 1.5, 2), 0.0),
                 angular_velocity=random.normal(0.0, 2.0, 3), material=MATERIAL)
        )  # fmt: skip
    return scene


def check(run: Recording) -> list[Check]:
    """Check that the boxes stay in the pit and apart, lose energy, and come to rest."""
    from rigidimpulse.gallery.hard.parts import above_floor, finite, weight

    assert run.ledger is not None
    boxes = [i for i, name in enumerate(run.names) if name.startswith("box")]
    half = 0.5 * math.ceil(math.sqrt(len(boxes) / LAYERS)) * PITCH
    inside = float(np.abs(run.positions[:, boxes, :2]).max()) - half
    total = run.ledger.total
    rise = float((total - np.minimum.accumulate(total)).max())
    return [
        finite(run),
        at_most("centre beyond a wall, m", inside, 0.0, "walls hold"),
        above_floor(run, SKIN),
        equal("boxes inside each other at the end", overlaps(run), 0, "contacts are held at a gap, the skin"),
        at_most("largest rise of energy, J", rise, SKIN * weight(run) * TALL, "E falls, except by what skins give back: a skin a level"),
        at_most("speed at the end, m/s", float(np.abs(run.velocities[-1]).max()), 0.0, "friction and dull impacts stop them"),
    ]


def overlaps(run: Recording) -> int:
    """Pairs of bodies that are inside each other in the last frame, asked of FCL."""
    from rigidimpulse.collision.distance.fcl import Narrowphase
    from rigidimpulse.core.quaternion import multiply
    from rigidimpulse.engine.compile_scene import compile_scene

    assert run.scene is not None
    world = compile_scene(run.scene)
    narrowphase, centers = Narrowphase(world.shapes), run.centers[-1]
    axes = multiply(run.orientations[-1], world.turn)
    a, b = np.triu_indices(world.num_bodies, 1)
    near = np.linalg.norm(centers[b] - centers[a], axis=1) < world.bound_radius[a] + world.bound_radius[b]
    near &= world.dynamic[a] | world.dynamic[b]
    return sum(
        narrowphase.overlap(int(world.shape_of_body[i]), (centers[i], axes[i]), int(world.shape_of_body[j]), (centers[j], axes[j]))
        for i, j in zip(a[near].tolist(), b[near].tolist(), strict=True)
    )


SCENES = (GalleryScene("pile", f"{NUM_BOXES} boxes fall into a pit and pile up", pile, check, DURATION),)
