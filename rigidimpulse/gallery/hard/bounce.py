"""Bounces that end, a rocking block, and a rod in Painleve's paradox.

Bounces. A ball of restitution e falls from h: impact k = 1, 2, ... takes place at

    t_k = sqrt(2 h / g) (1 + 2 (e + ... + e^(k-1))),   speed after it e^k sqrt(2 g h)

and it rests at sqrt(2 h / g) (1 + e) / (1 - e), after infinitely many impacts. A run may replace bounces lower than the gap
of lasting contact, delta = 1e-6 of the size, by rest; that moves the time of rest by no more than 2 sqrt(2 delta / g) / (1 - e).

Rocking block (G. W. Housner 1963): a slender block, half diagonal R, slenderness angle a (tan a = width / height), rocks
from edge to edge on a floor that neither gives nor lets slip. At each impact angular momentum about the new edge is kept:

    w+ / w- = 1 - (3/2) sin^2 a

Between impacts energy is kept, so plateaus of the ledger give the ratio. The motion between
impacts is right to second order in the angle of a sub-step, 0.01 rad at most: the bound is its square, 1e-4.

Painleve rod: a rod that slides on its tip at the angle b from the floor, friction mu. The normal force has a factor
1 + 3 cos b (cos b - mu sin b); where that is negative, mu > (1 + 3 cos^2 b) / (3 sin b cos b), no finite force holds
the tip (P. Painleve 1895; F. Genot & B. Brogliato 1999): an impact without a collision must stop the tip. No blow-up, no
energy out of nothing: E never grows, so no point is ever faster than v0 plus what the fall gives, doubled for the spin.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from rigidimpulse.gallery.hard.parts import DELTA, GRAVITY, above_floor, dull, energy_never_grows, finite, floor_scene, turned, undisturbed
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

HEIGHT, RADIUS = 1.0, 0.1
RESTITUTIONS = (0.5, 0.8, 0.9)
IMPACTS = 10
"""Impacts of each ball whose times are compared, all before its Zeno end."""
BLOCK = (0.25, 0.25, 1.0)
TILT = 0.6
"""Share of the slenderness angle at which the block is let go."""
ROD, ROD_THICKNESS = 1.0, 1e-3
ANGLE = math.radians(55.0)
PAINLEVE_FRICTION = 2.0
"""Above (1 + 3 cos^2) / (3 sin cos) = 1.41 at this angle."""
SLIDE = 3.0


def bounces() -> Scene:
    """Return balls of several restitutions, dropped beside each other."""
    scene = floor_scene()
    for k, e in enumerate(RESTITUTIONS):
        scene.add(Body(f"e = {e}", Shape.sphere(RADIUS), position=(k, 0.0, RADIUS + HEIGHT), material=dull(0.5, e)))
    return scene


def check_bounces(run: Recording) -> list[Check]:
    """Compare impact times, and the time of the last impact, with the geometric series."""
    checks = [finite(run)]
    fall = math.sqrt(2.0 * HEIGHT / GRAVITY)
    for e in RESTITUTIONS:
        ball = run.index(f"e = {e}")
        times = run.impacts["time"][(run.impacts["body_a"] == ball) | (run.impacts["body_b"] == ball)]
        expected = fall * (1.0 + 2.0 * np.array([sum(e**j for j in range(1, k)) for k in range(1, IMPACTS + 1)]))
        late = np.abs(times[:IMPACTS] - expected).max() if len(times) >= IMPACTS else math.inf
        rest = fall * (1.0 + e) / (1.0 - e)
        allowed = 2.0 * math.sqrt(2.0 * DELTA * 2.0 * RADIUS / GRAVITY) / (1.0 - e)
        resting = np.flatnonzero(np.linalg.norm(run.velocities[:, ball], axis=1) > 0.0)[-1] + 1
        checks += [
            at_most(f"e = {e}: error of ten impact times, s", float(late), 1e-11, "t_k = sqrt(2h/g)(1 + 2(e + ... + e^(k-1)))"),
            at_most(
                f"e = {e}: last impact from the time of rest, s", abs(float(times[-1]) - rest) if len(times) else math.inf, allowed,
                "sqrt(2h/g)(1 + e)/(1 - e), without bounces below the contact margin",
            ),
            at_most(
                f"e = {e}: first frame at rest, s after it", (float(run.times[resting]) if resting < len(run.times) else math.inf) - rest,
                allowed + 2.0 / 60.0, "it then lies still; one frame and one step",
            ),
        ]  # fmt: skip
    return [*checks, energy_never_grows(run, 2.0 * RADIUS), undisturbed(run)]


def rocking() -> Scene:
    """Return a slender block on one edge."""
    rough = dull(1.0)
    scene = floor_scene(rough)
    angle = TILT * math.atan2(BLOCK[0], BLOCK[2])
    turn = turned((0.0, 1.0, 0.0), angle)
    # It stands on its edge at x = +width / 2, kept at the origin.
    half, height = 0.5 * BLOCK[0], 0.5 * BLOCK[2]
    place = (-half * math.cos(angle) + height * math.sin(angle), 0.0, half * math.sin(angle) + height * math.cos(angle))
    scene.add(Body("block", Shape.box(BLOCK), position=place, orientation=turn, material=rough))
    return scene


def check_rocking(run: Recording) -> list[Check]:
    """Compare the energies of successive half rocks."""
    from rigidimpulse.scene.mass import body_mass

    assert run.ledger is not None and run.scene is not None
    slender = math.atan2(BLOCK[0], BLOCK[2])
    factor = 1.0 - 1.5 * math.sin(slender) ** 2
    weight = body_mass(run.scene["block"]).mass * GRAVITY
    energy = run.ledger.total - 0.5 * weight * BLOCK[2]
    lean = 2.0 * np.arctan2(run.orientation("block")[:, 2], run.orientation("block")[:, 0])
    # A half rock: frames of one sign of the lean. Its middle frame is well away from both impacts.
    changes = np.flatnonzero(np.diff(np.sign(lean)) != 0.0)
    edges = np.concatenate([[0], changes + 1, [len(lean)]])
    plateaus = [energy[(a + b) // 2] for a, b in pairwise(edges) if b - a > 4][:4]
    ratios = [math.sqrt(b / a) for a, b in pairwise(plateaus) if b > 0.0]
    worst = max((abs(r / factor - 1.0) for r in ratios), default=math.inf)
    foot = np.abs(run.position("block")[:, 1]).max()
    return [
        finite(run),
        at_least("half rocks compared", len(ratios), 3, "it rocks on"),
        at_most("w+ / w-, relative error", worst, 1e-4, "Housner 1963: 1 - (3/2) sin^2 a"),
        at_most("out of its plane, m", foot, 1e-9, "mirror symmetry"),
        energy_never_grows(run, BLOCK[2]),
        undisturbed(run),
    ]


def rod() -> Scene:
    """Return a rod that slides on its tip, where no finite force can hold it."""
    rough = dull(PAINLEVE_FRICTION)
    scene = floor_scene(rough)
    # The rod leans so that friction on its lower tip, against the motion along +x, turns the tip into the floor.
    half = 0.5 * ROD
    turn = turned((0.0, 1.0, 0.0), -(0.5 * math.pi - ANGLE))
    height = half * math.sin(ANGLE) + 0.5 * ROD_THICKNESS * math.cos(ANGLE)
    shape = Shape.box((ROD_THICKNESS, ROD_THICKNESS, ROD))
    scene.add(Body("rod", shape, position=(0.0, 0.0, height), orientation=turn, velocity=(SLIDE, 0.0, 0.0), mass=1.0, material=rough))
    return scene


def check_rod(run: Recording) -> list[Check]:
    """Check that nothing blows up."""
    assert run.ledger is not None
    fall = run.ledger.potential[0] - run.ledger.potential.min()
    fastest = np.linalg.norm(run.velocities[:, run.index("rod")], axis=1).max()
    return [
        finite(run),
        at_most("speed of the centre, m/s", fastest, math.sqrt(SLIDE**2 + 2.0 * fall), "m v^2 / 2 <= E"),
        above_floor(run),
        energy_never_grows(run, ROD),
        undisturbed(run),
    ]


SCENES = (
    GalleryScene("bounces_to_rest", "Balls bounce to rest at sqrt(2h/g)(1 + e)/(1 - e)", bounces, check_bounces, 10.0,
        elsewhere="e = 0.5, worst apex error at dt 1/60: MuJoCo 96 mm, PyBullet 116, Rapier 53, Jolt 95, PhysX 22, ODE 116 mm"),
    GalleryScene("rocking_block", "A slender block rocks from edge to edge (Housner)", rocking, check_rocking, 4.0, 240.0),
    GalleryScene("painleve_rod", "A rod slides where no finite force can hold its tip (Painleve)", rod, check_rod, 2.0, 120.0),
)  # fmt: skip
