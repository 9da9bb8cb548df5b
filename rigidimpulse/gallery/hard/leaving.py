"""Contact that ends at a known place: a ladder, a ball on a ball, a rimless wheel.

Ladder (thin rod of length l, smooth wall and floor) from rest at the angle a0 from the vertical. Energy gives
w^2 = (3 g / l)(cos a0 - cos a), and the force of the wall, m d/dt ((l / 2) w cos a), is zero when

    cos a = (2/3) cos a0:  its top is at two thirds of its height when it leaves the wall.

Ball of radius r from the top of a fixed ball of radius R, smooth, pushed so that energy is that of rest at the top: the
force g cos a - v^2 / (R + r) is zero at cos a = 2/3, from v^2 = 2 g (R + r)(1 - cos a).

Rimless wheel of n spokes of length l (here a regular hull of n corners), a = pi / n, that rolls over its corners on a level
floor without slip and without bounce: angular momentum about the new corner is kept at each impact,

    w+ / w- = (I + m l^2 cos 2 a) / (I + m l^2),

I about the centre. The wheel then loses energy by the square of that at each spoke.

Ends of contact are found from frames, so times are read off to one frame; places by the parabola or circle that follows.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.gallery.hard.parts import GRAVITY, dull, energy_never_grows, finite, floor_scene, turned
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

LENGTH, THICK, WIDE = 2.0, 1e-3, 0.3
START = math.radians(20.0)
BIG, SMALL = 1.0, 0.1
OFF_TOP = math.radians(5.0)
SPOKES, SPOKE, WIDTH = 8, 0.5, 0.3
PUSH = 3.2
"""rad/s: enough for three spokes (2.3), too little to leave the floor (w^2 l < g cos a, 4.3)."""
FPS = 240.0


def ladder() -> Scene:
    """Return a thin plank that leans at a smooth wall."""
    smooth = dull(0.0)
    scene = floor_scene(smooth)
    scene.add(Body("wall", Shape.half_space(normal=(1.0, 0.0, 0.0)), motion="static", material=smooth))
    # Turned so that its top leans to -x; the wall is x <= 0, foot and head touch with their outermost corners.
    half = np.array([0.5 * LENGTH * math.sin(START) + 0.5 * THICK * math.cos(START), 0.0,
                     0.5 * LENGTH * math.cos(START) + 0.5 * THICK * math.sin(START)])  # fmt: skip
    turn = turned((0.0, 1.0, 0.0), -START)
    scene.add(Body("ladder", Shape.box((THICK, WIDE, LENGTH)), position=half, orientation=turn, material=smooth))
    return scene


def check_ladder(run: Recording) -> list[Check]:
    """Compare sideways speed after the wall, which is then constant, and the height of leaving, with the closed form.

    Thickness: the moment of inertia and the contact points differ from a rod's by (d / l)^2 and d / l, 5e-4; the bound is
    four times that.
    """
    leave = math.acos(2.0 / 3.0 * math.cos(START))
    rate = math.sqrt(3.0 * GRAVITY / LENGTH * (math.cos(START) - math.cos(leave)))
    speed = 0.5 * LENGTH * rate * math.cos(leave)
    landed = np.flatnonzero(run.positions[:, run.index("ladder"), 2] < 0.02 * LENGTH)
    last = landed[0] if len(landed) else len(run.times) - 1
    sideways = run.velocity("ladder")[:last, 0]
    lean = np.array([math.acos(min(1.0, max(-1.0, 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2)))) for q in run.orientation("ladder")[:last]])
    free = np.flatnonzero(sideways > (1.0 - 1e-3) * sideways.max())
    return [
        finite(run),
        at_most("speed off the wall, relative error", abs(sideways[-1] / speed - 1.0), 4 * THICK / LENGTH, "max of (l/2) w cos a"),
        at_most(
            "height of the head where it leaves, relative error", abs(math.cos(lean[free[0]]) / math.cos(leave) - 1.0),
            0.06, "2/3 of the start; read off where 99.9 % of the speed is reached",
        ),
        energy_never_grows(run, LENGTH),
    ]  # fmt: skip


def ball_off_ball() -> Scene:
    """Return a small smooth ball that slides off a large fixed one."""
    smooth = dull(0.0)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("fixed", Shape.sphere(BIG), motion="static", material=smooth))
    reach = BIG + SMALL
    speed = math.sqrt(2.0 * GRAVITY * reach * (1.0 - math.cos(OFF_TOP)))
    place = (reach * math.sin(OFF_TOP), 0.0, reach * math.cos(OFF_TOP))
    velocity = (speed * math.cos(OFF_TOP), 0.0, -speed * math.sin(OFF_TOP))
    scene.add(Body("ball", Shape.sphere(SMALL), position=place, velocity=velocity, material=smooth))
    return scene


def check_ball_off_ball(run: Recording) -> list[Check]:
    """Compare the flight after leaving with the parabola from cos a = 2/3.

    Forces are right to second order in the angle of a sub-step, 0.01 rad at most: 1e-4 / 12, which is the bound.
    """
    reach = BIG + SMALL
    sideways = math.sqrt(2.0 / 3.0 * GRAVITY * reach) * 2.0 / 3.0
    away = np.linalg.norm(run.position("ball"), axis=1)
    flying = np.flatnonzero(away > reach * 1.02)
    speed = run.velocity("ball")[flying[0], 0] if len(flying) else math.nan
    return [
        finite(run),
        at_most(
            "level speed after it leaves, relative error",
            abs(speed / sideways - 1.0),
            1e-5,
            "cos a = 2/3: v cos a = (2/3)^1.5 sqrt(g (R + r))",
        ),
        at_most("deepest in the fixed ball, m", reach - away.min(), 1e-9, "bodies stay apart"),
        energy_never_grows(run, 2 * SMALL),
    ]


def wheel() -> Scene:
    """Return a regular prism that rolls over its corners; it begins on a face, with a push."""
    rough = dull(5.0)
    scene = floor_scene(rough)
    half = math.pi / SPOKES
    angles = half + 2.0 * half * np.arange(SPOKES)
    points = [(SPOKE * math.sin(a), y, -SPOKE * math.cos(a)) for a in angles for y in (-0.5 * WIDTH, 0.5 * WIDTH)]
    height = SPOKE * math.cos(half)
    w = PUSH
    # About the front corner of the face it stands on: v = w x r.
    scene.add(
        Body(
            "wheel", Shape.convex_hull(points), position=(0.0, 0.0, height), angular_velocity=(0.0, w, 0.0), material=rough,
            velocity=(w * height, 0.0, w * SPOKE * math.sin(half)),
        )
    )  # fmt: skip
    return scene


def check_wheel(run: Recording) -> list[Check]:
    """Compare the energies of one spoke and the next: plateaus of the ledger.

    Between impacts motion is of second order in the angle of a sub-step, 0.01 rad at most: the bound is its square, 1e-4.
    """
    from rigidimpulse.scene.mass import body_mass

    assert run.ledger is not None and run.scene is not None
    properties = body_mass(run.scene["wheel"])
    m, inertia = properties.mass, properties.inertia[1, 1]
    half = math.pi / SPOKES
    factor = (inertia + m * SPOKE**2 * math.cos(2.0 * half)) / (inertia + m * SPOKE**2)
    # Kinetic energy when on a face, of the plateau: the total minus the potential of the wheel on a face.
    ground = m * GRAVITY * SPOKE * math.cos(half)
    total = run.ledger.total - ground
    ratios = []
    turns = 2.0 * half
    about = np.unwrap(2.0 * np.arctan2(run.orientation("wheel")[:, 2], run.orientation("wheel")[:, 0]))
    spoke = np.floor((about + 1e-9) / turns)
    for k in range(3):
        before, after = np.flatnonzero(spoke == k), np.flatnonzero(spoke == k + 1)
        if len(before) > 2 and len(after) > 2:
            ratios.append(math.sqrt(total[after[len(after) // 2]] / total[before[len(before) // 2]]))
    worst = max((abs(r / factor - 1.0) for r in ratios), default=math.inf)
    return [
        finite(run),
        equal("spokes it rolled over", len(ratios), 3, "its speed is enough for three"),
        at_most("w+ / w- from the law, relative error", worst, 1e-4, "angular momentum about the new corner is kept"),
        energy_never_grows(run, 2 * SPOKE),
    ]


SCENES = (
    GalleryScene("ladder", "A ladder slides down a smooth wall and leaves it at 2/3 of its height", ladder, check_ladder, 1.2, FPS),
    GalleryScene("ball_off_ball", "A smooth ball leaves a fixed one at cos = 2/3", ball_off_ball, check_ball_off_ball, 1.5, FPS),
    GalleryScene("rimless_wheel", "A wheel rolls over its corners, w+ / w- by angular momentum", wheel, check_wheel, 1.6, FPS),
)
