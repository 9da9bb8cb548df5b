"""Newcomer scenes: machines with joints."""

from __future__ import annotations

import numpy as np
from piles import PAPER, STEEL, STONE, WOOD
from stage import Stage, height, must, newcomer, tilt, turn, way

import rigidimpulse as ri

BALL = ri.Material(density=7800.0, restitution=1.0, static_friction=0.0, dynamic_friction=0.0)


def _hung(stage: Stage, names, anchor) -> None:
    """Join links to a chain that begins at an anchor; each is 0.1 m long and hangs along z."""
    at = np.array(anchor, float)
    for before, name in zip([None, *names], names, strict=False):
        stage.join(ri.BallJoint(before, name, at.copy()))
        at[2] -= 0.1


@newcomer(1.5)
def see_saw():
    """A heavy crate drops on one arm; the other arm throws a light box up."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("plank", (2.0, 0.3, 0.04), (0.0, 0.0, 0.4), material=WOOD)
    stage.join(ri.HingeJoint("plank", None, (0.0, 0.0, 0.4), (0.0, 1.0, 0.0)))
    stage.box("light", (0.15, 0.15, 0.15), (-0.8, 0.0, 0.495), mass=1.0, material=WOOD)
    stage.box("heavy", (0.2, 0.2, 0.2), (0.8, 0.0, 1.5), mass=20.0, material=WOOD)
    return stage, lambda run: must((run.position("light")[:, 2].max() > 0.8, "the light box is not thrown"))


@newcomer(1.0)
def catapult():
    """A motor-less catapult: a weight on the short arm throws a ball off the long arm."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("arm", (2.0, 0.2, 0.05), (-0.5, 0.0, 0.6), material=WOOD)
    stage.join(ri.HingeJoint("arm", None, (0.0, 0.0, 0.6), (0.0, 1.0, 0.0)))
    stage.box("weight", (0.3, 0.2, 0.3), (0.35, 0.0, 0.4), mass=200.0, material=STEEL)
    stage.join(ri.FixedJoint("arm", "weight"))
    stage.ball("shot", 0.06, (-1.4, 0.0, 0.685), mass=1.0, material=STONE)
    return stage, lambda run: must((run.position("shot")[:, 2].max() > 1.0, "the shot does not fly"))


@newcomer(1.0)
def wrecking_ball():
    """A ball on a chain swings into a wall of blocks."""
    stage = Stage()
    stage.floor(material=STONE)
    for row in range(3):
        for k in range(2):
            stage.box(f"block {row} {k}", (0.15, 0.3, 0.15), (0.12, 0.31 * k - 0.155, 0.15 * row + 0.075), material=STONE)
    stage.ball("ball", 0.15, (-1.1, 0.0, 1.0), material=STEEL)
    stage.join(ri.DistanceJoint(None, "ball", (-0.15, 0.0, 1.4), (-1.1, 0.0, 1.0)))
    return stage, lambda run: must((way(run, "block 2 0") > 0.05, "the wall stands"))


@newcomer(1.0)
def chain_and_anchor():
    """An anchor hangs on a chain of six links and swings."""
    stage = Stage()
    links = [f"link {k}" for k in range(6)]
    for k, name in enumerate(links):
        stage.capsule(name, 0.01, 0.08, (0.0, 0.0, 2.0 - 0.1 * k - 0.05), material=STEEL)
    _hung(stage, links, (0.0, 0.0, 2.0))
    stage.box("anchor", (0.2, 0.05, 0.15), (0.0, 0.0, 1.325), velocity=(1.0, 0.0, 0.0), material=STEEL)
    stage.join(ri.BallJoint("link 5", "anchor", (0.0, 0.0, 1.4)))

    def see(run):
        length = np.linalg.norm(run.position("anchor") - [0.0, 0.0, 2.0], axis=1).max()
        return must((length < 0.68, f"the chain stretches to {length:.3f} m"), (way(run, "anchor") > 0.01, "the anchor does not swing"))

    return stage, see


@newcomer(1.2)
def newtons_cradle():
    """Five balls on strings: the outer one swings in, the last one swings out."""
    stage = Stage()
    for k in range(5):
        hook = np.array([0.1001 * k, 0.0, 1.0])
        angle = 0.5 if k == 0 else 0.0
        place = hook - 0.5 * np.array([np.sin(angle), 0.0, np.cos(angle)])
        stage.ball(f"ball {k}", 0.05, place, material=BALL)
        for side in (-0.15, 0.15):
            stage.join(ri.DistanceJoint(None, f"ball {k}", hook + [0.0, side, 0.0], place))

    def see(run):
        out = run.position("ball 4")[:, 0].max() - run.position("ball 4")[0, 0]
        middle = np.abs(run.position("ball 2")[:, 0] - run.position("ball 2")[0, 0]).max()
        return must((out > 0.2, f"the last ball swings {out:.3f} m"), (middle < 0.05, f"the middle one moves {middle:.3f} m"))

    return stage, see


@newcomer(1.0)
def door():
    """A ball hits a door, which turns on its hinge."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("door", (0.9, 0.04, 2.0), (0.45, 0.0, 1.01), material=WOOD)
    stage.join(ri.HingeJoint("door", None, (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), lower=-1.5, upper=1.5))
    stage.ball("ball", 0.12, (0.7, -0.5, 1.0), velocity=(0.0, 6.0, 0.0), mass=5.0, material=WOOD)
    return stage, lambda run: must((run.position("door")[-1, 1] > 0.1, "the door stays shut"), (tilt(run, "door") < 1e-3, "it leans"))


@newcomer(1.0)
def ragdoll_on_stairs():
    """A doll of a trunk, a head, two arms and two legs tumbles down three steps."""
    stage = Stage()
    stage.floor(material=STONE)
    for k in range(3):
        stage.box(f"step {k}", (0.4, 1.5, 0.2 * (3 - k)), (0.4 * k, 0.0, 0.1 * (3 - k)), motion="static", material=STONE)
    at = np.array([0.0, 0.0, 1.31])
    stage.box("trunk", (0.16, 0.3, 0.5), at, velocity=(1.0, 0.0, 0.0), material=PAPER)
    stage.ball("head", 0.11, at + [0.0, 0.0, 0.38], velocity=(1.0, 0.0, 0.0), material=PAPER)
    stage.join(ri.BallJoint("trunk", "head", at + [0.0, 0.0, 0.26]))
    for name, y, z in (("left arm", -0.22, 0.05), ("right arm", 0.22, 0.05), ("left leg", -0.09, -0.48), ("right leg", 0.09, -0.48)):
        stage.capsule(name, 0.05, 0.3, at + [0.0, y, z], velocity=(1.0, 0.0, 0.0), material=PAPER)
        stage.join(ri.BallJoint("trunk", name, at + [0.0, y, z + 0.2]))
    return stage, lambda run: must((height(run, "trunk") < 1.1, "the doll does not fall"))


@newcomer(1.0)
def trebuchet():
    """A hanging weight turns an arm, which throws a stone from a rope that is let go."""
    stage = Stage()
    stage.box("arm", (3.0, 0.1, 0.1), (-0.75, 0.0, 2.0), material=WOOD)
    stage.join(ri.HingeJoint("arm", None, (0.0, 0.0, 2.0), (0.0, 1.0, 0.0)))
    stage.box("weight", (0.4, 0.4, 0.4), (0.7, 0.0, 1.6), mass=500.0, material=STONE)
    stage.join(ri.HingeJoint("arm", "weight", (0.7, 0.0, 2.0), (0.0, 1.0, 0.0)))
    stage.ball("stone", 0.1, (-2.2, 0.0, 1.5), mass=5.0, material=STONE)
    stage.join(ri.DistanceJoint("arm", "stone", (-2.2, 0.0, 2.0), (-2.2, 0.0, 1.5), release_time=0.4))
    return stage, lambda run: must((np.linalg.norm(run.velocity("stone")[-1]) > 4.0, "the stone is slow"))


@newcomer(1.5)
def crane():
    """A trolley moves; the load on its rope follows and swings."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("trolley", (0.3, 0.3, 0.1), (0.0, 0.0, 2.0), motion="kinematic", velocity=(0.5, 0.0, 0.0))
    stage.box("load", (0.3, 0.3, 0.3), (0.0, 0.0, 0.65), mass=100.0)
    stage.join(ri.DistanceJoint("trolley", "load", (0.0, 0.0, 1.95), (0.0, 0.0, 0.8)))
    return stage, lambda run: must((0.2 < run.position("load")[-1, 0] < 1.4, "the load stays behind"))


def _gear(stage: Stage, name: str, x: float, angle: float, spin: float) -> None:
    """A gear of eight teeth: a disc and four crossing bars, as a compound."""
    bars = [(ri.Shape.box((0.26, 0.03, 0.03)), (0.0, 0.0, 0.0), turn((0, 0, 1), angle + k * np.pi / 4)) for k in range(4)]
    shape = ri.Shape.compound([(ri.Shape.cylinder(0.09, 0.03), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), *bars])
    stage.scene.add(ri.Body(name, shape, position=(x, 0.0, 0.5), angular_velocity=(0.0, 0.0, spin), mass=1.0))
    stage.join(ri.HingeJoint(name, None, (x, 0.0, 0.5), (0.0, 0.0, 1.0)))


@newcomer(1.0)
def gears():
    """A turning gear drives another one the other way."""
    stage = Stage()
    _gear(stage, "driver", 0.0, 0.0, 4.0)
    _gear(stage, "driven", 0.235, np.pi / 8, 0.0)
    return stage, lambda run: must((run.angular_velocity("driven")[:, 2].min() < -0.5, "the second gear does not turn the other way"))


@newcomer(1.0)
def double_pendulum():
    """Two rods swing; their joints stay closed."""
    stage = Stage()
    for k in range(2):
        stage.box(f"rod {k}", (0.5, 0.04, 0.04), (0.25 + 0.5 * k, 0.0, 2.0))
    stage.join(ri.HingeJoint("rod 0", None, (0.0, 0.0, 2.0), (0.0, 1.0, 0.0)))
    stage.join(ri.HingeJoint("rod 0", "rod 1", (0.5, 0.0, 2.0), (0.0, 1.0, 0.0)))

    def see(run):
        length = np.linalg.norm(run.position("rod 0") - [0.0, 0.0, 2.0], axis=1)
        return must((height(run, "rod 1", 30) < 1.7, "it does not swing"), (np.abs(length - 0.25).max() < 1e-6, "a joint opens"))

    return stage, see


@newcomer(1.0)
def rope_bridge():
    """Seven planks on hinges between two banks carry a crate."""
    stage = Stage()
    names = [f"plank {k}" for k in range(7)]
    for k, name in enumerate(names):
        stage.box(name, (0.19, 0.4, 0.03), (0.2 * k, 0.0, 1.0), material=WOOD)
        stage.join(ri.HingeJoint(names[k - 1] if k else None, name, (0.2 * k - 0.1, 0.0, 1.0), (0.0, 1.0, 0.0)))
    stage.join(ri.DistanceJoint("plank 6", None, (1.3, 0.0, 1.0), (1.5, 0.0, 1.2)))
    stage.box("crate", (0.15, 0.15, 0.15), (0.6, 0.0, 1.1), mass=2.0, material=WOOD)
    return stage, lambda run: must((height(run, "crate") > height(run, "plank 3"), "the crate falls through"))


@newcomer(1.0)
def pinata():
    """A stick on a hinge hits a box that hangs on a joint that breaks; the box falls."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("pinata", (0.3, 0.3, 0.3), (0.0, 0.0, 1.5), mass=1.0, material=PAPER)
    stage.join(ri.BallJoint("pinata", None, (0.0, 0.0, 2.0), break_force=30.0))
    stage.ball("stick", 0.1, (-1.0, 0.0, 1.5), velocity=(8.0, 0.0, 1.0), mass=2.0, material=WOOD)
    return stage, lambda run: must((height(run, "pinata") < 1.0, "the box still hangs"))


@newcomer(1.0)
def drawbridge():
    """A bridge falls to the limit of its hinge, and stays there."""
    stage = Stage()
    stage.box("bridge", (0.1, 1.0, 2.0), (0.0, 0.0, 1.0), velocity=(0.6, 0.0, 0.0), angular_velocity=(0.0, 0.6, 0.0), material=WOOD)
    stage.join(ri.HingeJoint(None, "bridge", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), lower=-0.1, upper=0.5))
    return stage, lambda run: must((abs(tilt(run, "bridge") - 0.5) < 0.02, f"it is at {tilt(run, 'bridge'):.3f} rad"))


@newcomer(1.0)
def trap_door():
    """A trap door is released; the ball on it falls through."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("flap", (0.5, 0.5, 0.03), (0.0, 0.0, 1.0), material=WOOD)
    stage.join(ri.HingeJoint("flap", None, (-0.25, 0.0, 1.0), (0.0, 1.0, 0.0)))
    stage.join(ri.FixedJoint("flap", None, release_time=0.2))
    stage.ball("ball", 0.1, (0.05, 0.0, 1.115), material=WOOD)
    return stage, lambda run: must(
        (height(run, "ball", 12) > 1.1, "it falls too early"), (height(run, "ball") < 0.9, "the ball does not fall")
    )


@newcomer(1.0)
def paddle_wheel():
    """A turning paddle knocks a ball away."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("paddle", (1.0, 0.05, 0.2), (0.0, 0.0, 0.15), motion="kinematic", angular_velocity=(0.0, 0.0, 3.0))
    stage.ball("ball", 0.1, (0.35, 0.3, 0.1), material=WOOD)
    return stage, lambda run: must((way(run, "ball") > 0.2, "the ball stays"))
