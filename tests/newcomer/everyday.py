"""Newcomer scenes: things of a house and a yard, and a line of machines that set each other off."""

from __future__ import annotations

import numpy as np
import trimesh
from piles import PAPER, STEEL, STONE, WOOD
from stage import Stage, height, must, newcomer, rounded, speed, tilt, turn, way
from tracks import RUBBER

import rigidimpulse as ri

ROUGH = ri.Material(density=600.0, restitution=0.0, static_friction=0.8, dynamic_friction=0.7)
ICE = ri.Material(density=900.0, restitution=0.0, static_friction=0.02, dynamic_friction=0.02)


def _turned(section, sections: int = 24) -> trimesh.Trimesh:
    """A closed section (r, z) turned about z, its centre of mass at the origin."""
    mesh = trimesh.creation.revolve(np.asarray(section, float), sections=sections)
    mesh.apply_translation(-mesh.center_mass)
    return mesh


@newcomer(2.0)
def ball_on_stairs():
    """A rubber ball bounces down five steps."""
    stage = Stage()
    stage.floor(material=STONE)
    for k in range(5):
        stage.box(f"step {k}", (0.3, 1.0, 0.18 * (5 - k)), (0.3 * k, 0.0, 0.09 * (5 - k)), motion="static", material=STONE)
    stage.ball("ball", 0.1, (0.0, 0.0, 1.2), velocity=(1.0, 0.0, 0.0), material=RUBBER)
    return stage, lambda run: must((run.position("ball")[-1, 0] > 1.2, "the ball stays on the stairs"))


@newcomer(1.5)
def bulldozer():
    """A blade pushes a row of three crates and a ball ahead of it."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.box("blade", (0.1, 1.6, 0.4), (-0.3, 0.0, 0.21), motion="kinematic", velocity=(0.5, 0.0, 0.0), material=STEEL)
    names = [f"crate {k}" for k in range(3)]
    for k, name in enumerate(names):
        stage.box(name, (0.3, 0.3, 0.3), (0.0, 0.45 * (k - 1), 0.15), material=WOOD)
    stage.ball("ball", 0.1, (0.0, 0.72, 0.1), material=WOOD)
    return stage, lambda run: must(*((run.position(n)[-1, 0] > 0.6, f"{n} is left behind") for n in (*names, "ball")))


@newcomer(2.0)
def lift():
    """A lift goes up by 1 m and stops; the crate on it goes with it."""
    stage = Stage()
    keys = ri.Keyframes((0.0, 0.5, 1.0, 1.5), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.25), (0.0, 0.0, 0.75), (0.0, 0.0, 1.0)))
    stage.box("lift", (1.0, 1.0, 0.1), (0.0, 0.0, 0.0), motion="kinematic", keyframes=keys, material=WOOD)
    stage.box("crate", (0.3, 0.3, 0.3), (0.1, 0.0, 0.2), material=WOOD)
    return stage, lambda run: must((abs(height(run, "crate") - 1.2) < 2e-3, f"the crate is at {height(run, 'crate'):.3f} m"))


@newcomer(1.0)
def spinning_top():
    """A top spins upright on a floor and does not fall."""
    stage = Stage()
    stage.floor(material=STEEL)
    top = _turned([(0.0, 0.0), (0.004, 0.004), (0.03, 0.03), (0.03, 0.036), (0.004, 0.04), (0.004, 0.06), (0.0, 0.06)])
    stage.mesh("top", top, (0.0, 0.0, -float(top.bounds[0, 2])), angular_velocity=(0.0, 0.0, 300.0), material=STEEL)
    return stage, lambda run: must((tilt(run, "top") < 0.1, "the top falls"))


@newcomer(1.0)
def hole_in_a_plate():
    """Of three balls above a plate with a hole the one above the hole falls through; the others stay."""
    stage = Stage()
    plate = trimesh.creation.annulus(0.06, 0.3, 0.02, sections=24)
    stage.mesh("plate", plate, (0.0, 0.0, 0.0), motion="static", material=WOOD)
    for k, x in enumerate((0.0, 0.18, -0.18)):
        stage.ball(f"ball {k}", 0.03, (x, 0.0, 0.15), material=WOOD)

    def see(run):
        return must(
            (height(run, "ball 0") < -1.0, "ball 0 does not fall through"),
            *((abs(height(run, n) - 0.04) < 1e-3, f"{n} is not on the plate") for n in ("ball 1", "ball 2")),
        )

    return stage, see


@newcomer(1.0)
def overhang():
    """Three planks reach out over the edge of a table, each a little less than it may: they stand."""
    stage = Stage()
    stage.box("table", (0.6, 0.6, 0.1), (0.0, 0.0, 0.0), motion="static", material=WOOD)
    places = (0.3 - 0.3 + 0.09, 0.09 + 0.14, 0.09 + 0.14 + 0.28)
    for k, x in enumerate(places):
        stage.box(f"plank {k}", (0.6, 0.1, 0.03), (x, 0.0, 0.065 + 0.03 * k), material=WOOD)

    def see(run):
        return must(*((way(run, f"plank {k}") < 1e-3 and tilt(run, f"plank {k}") < 1e-2, f"plank {k} falls") for k in range(3)))

    return stage, see


@newcomer(1.5)
def stool():
    """A stool of an OBJ file, three legs below a seat, drops a little tilted and stands."""
    stage = Stage()
    stage.floor(material=STONE)
    seat = trimesh.creation.cylinder(0.18, 0.03, sections=24)
    legs = [trimesh.creation.box((0.03, 0.03, 0.4)) for _ in range(3)]
    for k, leg in enumerate(legs):
        angle = 2.0 * np.pi * k / 3.0
        leg.apply_translation((0.13 * np.cos(angle), 0.13 * np.sin(angle), -0.2145))
    whole = trimesh.util.concatenate([seat, *legs])
    whole.apply_translation(-whole.center_mass)
    low = -float(whole.bounds[0, 2])
    stage.mesh("stool", whole, (0.0, 0.0, low + 0.03), orientation=turn((1, 0, 0), 0.05), material=WOOD)
    return stage, lambda run: must((tilt(run, "stool") < 0.01 and abs(height(run, "stool") - low) < 2e-3, "the stool does not stand"))


@newcomer(1.5)
def turntable():
    """On a turntable a rough box goes round with the plate, a slippery one slides off."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.rod("plate", 0.5, 0.05, (0.0, 0.0, 0.3), motion="kinematic", angular_velocity=(0.0, 0.0, 3.0), material=ROUGH)
    turns = {"velocity": (0.0, 0.75, 0.0), "angular_velocity": (0.0, 0.0, 3.0)}
    stage.box("rough", (0.1, 0.1, 0.1), (0.25, 0.0, 0.375), material=ROUGH, **turns)
    stage.box("slippery", (0.1, 0.1, 0.1), (-0.4, 0.0, 0.375), material=ICE, velocity=rounded((0.0, -1.2, 0.0)))

    def see(run):
        place = run.position("rough")[-1]
        return must(
            (abs(np.hypot(place[0], place[1]) - 0.25) < 5e-3, "the rough box slides"), (height(run, "slippery") < 0.3, "the other stays"),
        )  # fmt: skip

    return stage, see


@newcomer(1.2)
def dice_in_a_cup():
    """Three dice drop into a cup and stay in it."""
    stage = Stage()
    cup = _turned([(0.0, 0.0), (0.05, 0.0), (0.055, 0.1), (0.048, 0.1), (0.043, 0.007), (0.0, 0.007)])
    stage.mesh("cup", cup, (0.0, 0.0, -float(cup.bounds[0, 2])), motion="static", material=WOOD)
    names = [f"die {k}" for k in range(3)]
    for k, name in enumerate(names):
        lean = turn((1.0, 0.3 * k, 0.2), 0.7 + 0.4 * k)
        stage.box(name, (0.016, 0.016, 0.016), (0.012 * (k - 1), 0.0, 0.08 + 0.03 * k), orientation=lean, material=PAPER)

    def see(run):
        return must(*((height(run, n) < 0.08 and np.hypot(*run.position(n)[-1, :2]) < 0.045, f"{n} is out") for n in names))

    return stage, see


@newcomer(2.0)
def six_machines():
    """A ball rolls down a ramp, dominoes fall, a second ball is pushed off a shelf onto a see-saw, and that throws a box."""
    stage = Stage()
    stage.floor(material=WOOD)
    lean = 0.3
    stage.box("ramp", (0.6, 0.1, 0.02), (-0.45, 0.0, 0.6), orientation=turn((0, 1, 0), lean), motion="static", material=WOOD)
    stage.box("shelf", (0.476, 0.2, 0.04), (0.088, 0.0, 0.46), motion="static", material=WOOD)
    stage.ball("first ball", 0.03, (-0.65, 0.0, 0.72), material=WOOD)
    names = [f"domino {k}" for k in range(6)]
    for k, name in enumerate(names):
        stage.box(name, (0.01, 0.04, 0.08), (0.04 + 0.04 * k, 0.0, 0.52), material=WOOD)
    stage.ball("second ball", 0.025, (0.322, 0.0, 0.505), material=STONE)
    stage.box("plank", (0.7, 0.1, 0.01), (0.62, 0.0, 0.1), material=WOOD)
    stage.join(ri.HingeJoint("plank", None, (0.62, 0.0, 0.1), (0.0, 1.0, 0.0)))
    stage.box("light", (0.04, 0.04, 0.04), (0.9, 0.0, 0.126), material=PAPER)

    def see(run):
        return must(
            *((tilt(run, n) > 0.5, f"{n} stands") for n in names),
            (run.position("second ball")[-1, 2] < 0.4, "the second ball stays on its shelf"),
            (run.position("light")[:, 2].max() > 0.2, "the light box is not thrown"), (speed(run, "first ball") < 5.0, "the ball flies"),
        )  # fmt: skip

    return stage, see
