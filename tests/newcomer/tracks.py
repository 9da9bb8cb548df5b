"""Newcomer scenes: things that roll, slide, fly and drop into others."""

from __future__ import annotations

import numpy as np
import trimesh
from piles import PAPER, STEEL, STONE, WOOD
from stage import Stage, height, must, newcomer, speed, tilt, turn, way

import rigidimpulse as ri

RUBBER = ri.Material(density=1100.0, restitution=0.7, static_friction=0.9, dynamic_friction=0.8)


def _ramp(stage: Stage, name: str, size, position, angle: float, material=WOOD) -> None:
    stage.box(name, size, position, orientation=turn((0, 1, 0), angle), motion="static", material=material)


def _bowl(radius: float, thick: float) -> trimesh.Trimesh:
    """A bowl: its section turned about z, open above, its bottom at z = 0."""
    angles = np.linspace(0.0, 0.5 * np.pi, 8)
    outer = np.column_stack([np.sin(angles), 1.0 - np.cos(angles)]) * radius
    inner = np.column_stack([np.sin(angles) * (radius - thick), radius - np.cos(angles) * (radius - thick)])
    return trimesh.creation.revolve(np.vstack([outer, inner[::-1]]), sections=24)


@newcomer(1.0)
def marble_ramp():
    """A marble rolls down a ramp onto the floor."""
    stage = Stage()
    stage.floor(material=WOOD)
    _ramp(stage, "ramp", (0.6, 0.1, 0.02), (0.0, 0.0, 0.2), 0.4)
    stage.ball("marble", 0.01, (-0.2, 0.0, 0.34), material=STONE)
    return stage, lambda run: must((run.position("marble")[-1, 0] > 0.3, "the marble does not roll off"),
                                   (abs(height(run, "marble") - 0.01) < 0.05, "it is not on the floor"))  # fmt: skip


@newcomer(2.5)
def marble_run():
    """A marble runs over three ramps, to and fro."""
    stage = Stage()
    stage.floor(material=WOOD)
    for k in range(3):
        _ramp(stage, f"ramp {k}", (0.4, 0.06, 0.01), (0.12 * (k % 2), 0.0, 0.5 - 0.15 * k), 0.25 * (1 - 2 * (k % 2)))
    stage.ball("marble", 0.012, (-0.15, 0.0, 0.58), material=STONE)
    return stage, lambda run: must((height(run, "marble") < 0.2, "the marble is stuck"))


@newcomer(1.5)
def pinball():
    """A ball goes down a tilted table between bumpers."""
    stage = Stage()
    lean = 0.15
    stage.box("table", (1.0, 0.5, 0.04), (0.0, 0.0, 0.0), orientation=turn((0, 1, 0), lean), motion="static", material=WOOD)
    for k, (x, y) in enumerate(((-0.1, 0.05), (0.1, -0.08), (0.25, 0.1))):
        place = (x * np.cos(lean) + 0.045 * np.sin(lean), y, -x * np.sin(lean) + 0.045 * np.cos(lean))
        stage.rod(f"bumper {k}", 0.03, 0.05, place, orientation=turn((0, 1, 0), lean), motion="static", material=RUBBER)
    stage.ball("ball", 0.013, (-0.4, 0.045, 0.1), velocity=(0.5, 0.0, 0.0), material=STEEL)
    return stage, lambda run: must((run.position("ball")[-1, 0] > 0.1, "the ball does not go down"))


@newcomer(1.5)
def plinko():
    """Three chips fall through rows of pegs to the floor."""
    stage = Stage()
    stage.floor(material=WOOD)
    for row in range(4):
        for k in range(4):
            stage.rod(f"peg {row} {k}", 0.008, 0.1, (0.1 * k + 0.05 * (row % 2), 0.0, 0.2 + 0.1 * row), motion="static",
                      orientation=turn((1, 0, 0), 0.5 * np.pi), material=WOOD)  # fmt: skip
    for k in range(3):
        stage.ball(f"chip {k}", 0.02, (0.1 * k + 0.02, 0.0, 0.65 + 0.05 * k), material=WOOD)
    return stage, lambda run: must(*((height(run, f"chip {k}") < 0.15, f"chip {k} is stuck") for k in range(3)))


@newcomer(1.5)
def cart():
    """A cart on four wheels rolls down a ramp."""
    stage = Stage()
    _ramp(stage, "ramp", (4.0, 1.0, 0.1), (0.0, 0.0, 0.0), 0.2, RUBBER)
    way_down = np.array([np.cos(0.2), 0.0, -np.sin(0.2)])
    up = np.array([np.sin(0.2), 0.0, np.cos(0.2)])
    start = -1.0 * way_down + 0.05 * up
    stage.box("cart", (0.4, 0.2, 0.05), start + 0.1 * up, orientation=turn((0, 1, 0), 0.2), material=WOOD)
    for k, (x, y) in enumerate(((-0.15, -0.13), (0.15, -0.13), (-0.15, 0.13), (0.15, 0.13))):
        place = start + 0.06 * up + x * way_down + np.array([0.0, y, 0.0])
        stage.rod(f"wheel {k}", 0.06, 0.03, place, orientation=turn((1, 0, 0), 0.5 * np.pi), material=RUBBER)
        stage.join(ri.HingeJoint("cart", f"wheel {k}", place, (0.0, 1.0, 0.0)))
    return stage, lambda run: must((way(run, "cart") > 0.8, f"the cart rolls {way(run, 'cart'):.2f} m only"))


@newcomer(1.5)
def fruit_bowl():
    """Three fruits fall into a bowl and stay in it."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.mesh("bowl", _bowl(0.15, 0.02), (0.0, 0.0, 0.0), motion="static", material=WOOD)
    for k in range(3):
        stage.ball(f"fruit {k}", 0.035, (0.03 * np.cos(2 * k), 0.03 * np.sin(2 * k), 0.12 + 0.08 * k), material=WOOD)
    return stage, lambda run: must(
        *(
            (np.hypot(*run.position(f"fruit {k}")[-1, :2]) < 0.13 and height(run, f"fruit {k}") > 0.03, f"fruit {k} is out")
            for k in range(3)
        )
    )


@newcomer(1.0)
def ring_toss():
    """A ring drops over a peg."""
    stage = Stage()
    stage.floor(material=WOOD)
    stage.rod("peg", 0.015, 0.2, (0.0, 0.0, 0.1), motion="static", material=WOOD)
    stage.mesh("ring", trimesh.creation.torus(0.06, 0.01, major_sections=24, minor_sections=8), (0.02, 0.0, 0.3),
               orientation=turn((1, 0, 0), 0.2), material=WOOD)  # fmt: skip
    return stage, lambda run: must(
        (np.hypot(*run.position("ring")[-1, :2]) < 0.06 and height(run, "ring") < 0.05, "the ring is not on the peg")
    )


@newcomer(1.0)
def nut_on_bolt():
    """A hexagonal nut drops along a smooth bolt to its head."""
    stage = Stage()
    stage.floor(material=STEEL)
    stage.rod("bolt", 0.009, 0.1, (0.0, 0.0, 0.06), motion="static", material=STEEL)
    stage.rod("head", 0.018, 0.01, (0.0, 0.0, 0.005), motion="static", material=STEEL)
    stage.mesh("nut", trimesh.creation.annulus(0.011, 0.02, 0.012, sections=6), (0.0, 0.0, 0.09), material=STEEL)
    return stage, lambda run: must((abs(height(run, "nut") - 0.016) < 2e-3, f"the nut is at {height(run, 'nut'):.4f} m"))


def _letter(cells) -> trimesh.Trimesh:
    """A letter of cells of 4 cm (x, z), as one closed mesh."""
    grid = np.zeros((7, 3, 7), bool)
    for x, z in cells:
        grid[x + 1, 1, z + 1] = True
    corners, faces = {}, []
    for x, y, z in np.argwhere(grid):
        for axis in range(3):
            for side in (0, 1):
                beyond = np.array([x, y, z])
                beyond[axis] += 2 * side - 1
                if grid[tuple(beyond)]:
                    continue
                u, v = (axis + 1) % 3, (axis + 2) % 3
                quad = []
                for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    corner = np.array([x, y, z])
                    corner[axis] += side
                    corner[u] += du
                    corner[v] += dv
                    quad.append(corners.setdefault(tuple(corner.tolist()), len(corners)))
                quad = quad if side else quad[::-1]
                faces += [quad[:3], [quad[0], quad[2], quad[3]]]
    mesh = trimesh.Trimesh((np.array(list(corners), float) - 2.5) * 0.04, faces)
    mesh.apply_translation(-mesh.center_mass)
    return mesh


@newcomer(1.2)
def falling_letters():
    """The letters L, T, U fall on the floor."""
    stage = Stage()
    stage.floor(material=WOOD)
    cells = {
        "L": [(0, 0), (0, 1), (0, 2), (1, 0), (2, 0)],
        "T": [(0, 2), (1, 2), (2, 2), (1, 1), (1, 0)],
        "U": [(0, 0), (0, 1), (0, 2), (1, 0), (2, 0), (2, 1), (2, 2)],
    }
    for k, (name, where) in enumerate(cells.items()):
        stage.mesh(name, _letter(where), (0.2 * k, 0.0, 0.3), orientation=turn((1, 1, k), 0.4), material=WOOD)
    return stage, lambda run: must(*((0.01 < height(run, n) < 0.1, f"{n} is not on the floor") for n in cells))


@newcomer(1.0)
def box_on_ramp():
    """A box slides down a ramp of 15 degrees at 0.1 of friction, and another one with 0.5 stays."""
    stage = Stage()
    ice = ri.Material(static_friction=0.1, dynamic_friction=0.1, friction_combine="minimum", restitution=0.0)
    grip = ri.Material(static_friction=0.5, dynamic_friction=0.5, friction_combine="minimum", restitution=0.0)
    lean = np.radians(15.0)
    _ramp(stage, "ramp", (2.0, 1.0, 0.1), (0.0, 0.0, 0.0), lean, grip)
    up, down = np.array([np.sin(lean), 0.0, np.cos(lean)]), np.array([np.cos(lean), 0.0, -np.sin(lean)])
    for name, y, material in (("slides", -0.2, ice), ("stays", 0.2, grip)):
        stage.box(name, (0.1, 0.1, 0.1), 0.1 * up - 0.5 * down + [0.0, y, 0.0], orientation=turn((0, 1, 0), lean), material=material)
    far = 0.5 * 9.81 * (np.sin(lean) - 0.1 * np.cos(lean))
    return stage, lambda run: must((abs(way(run, "slides") - far) < 1e-3, f"it slides {way(run, 'slides'):.4f} m, not {far:.4f}"),
                                   (way(run, "stays") < 1e-4, f"the other slides {way(run, 'stays'):.6f} m"))  # fmt: skip


@newcomer(1.0)
def barrel():
    """A barrel rolls down a ramp: 2/3 of g sin(lean)."""
    stage = Stage()
    lean = 0.2
    _ramp(stage, "ramp", (4.0, 1.0, 0.1), (0.0, 0.0, 0.0), lean, RUBBER)
    up, down = np.array([np.sin(lean), 0.0, np.cos(lean)]), np.array([np.cos(lean), 0.0, -np.sin(lean)])
    stage.rod("barrel", 0.2, 0.6, 0.25 * up - 1.5 * down, orientation=turn((1, 0, 0), 0.5 * np.pi), material=RUBBER)
    far = 9.81 * np.sin(lean) / 3.0
    return stage, lambda run: must((abs(way(run, "barrel") - far) < 0.02, f"it rolls {way(run, 'barrel'):.3f} m, not {far:.3f}"))


@newcomer(1.0)
def hoop():
    """A hoop rolls upright."""
    stage = Stage()
    stage.floor(material=RUBBER)
    ring = trimesh.creation.torus(0.2, 0.02, major_sections=48, minor_sections=8)
    rolling = {"velocity": (1.0, 0.0, 0.0), "angular_velocity": (0.0, 1.0 / 0.22, 0.0)}
    stage.mesh("hoop", ring, (0.0, 0.0, 0.22), orientation=turn((1, 0, 0), 0.5 * np.pi), material=RUBBER, **rolling)

    def see(run):
        return must((run.position("hoop")[-1, 0] > 0.8, "the hoop stops"), (abs(tilt(run, "hoop") - 0.5 * np.pi) < 0.3, "it falls"))

    return stage, see


@newcomer(1.5)
def bouncing_balls():
    """Balls of three materials bounce in order of their restitution."""
    stage = Stage()
    stage.floor(material=ri.Material(restitution=1.0, restitution_combine="minimum"))
    for k, e in enumerate((0.2, 0.5, 0.9)):
        stage.ball(f"ball {k}", 0.1, (0.4 * k, 0.0, 1.1), material=ri.Material(restitution=e, restitution_combine="minimum"))

    def see(run):
        tops = [run.position(f"ball {k}")[round(60 * 0.46) :, 2].max() - 0.1 for k in range(3)]
        return must(
            *((abs(tops[k] - e * e) < 0.02, f"ball {k} rises {tops[k]:.3f} m, not {e * e:.3f}") for k, e in enumerate((0.2, 0.5, 0.9)))
        )

    return stage, see


@newcomer(1.2)
def conveyor():
    """A belt carries a parcel."""
    stage = Stage()
    stage.box("belt", (3.0, 0.5, 0.1), (0.0, 0.0, -0.05), motion="kinematic", velocity=(0.5, 0.0, 0.0), material=RUBBER)
    stage.box("parcel", (0.2, 0.2, 0.2), (0.0, 0.0, 0.1), material=PAPER)
    return stage, lambda run: must((0.5 < way(run, "parcel") < 0.61, f"the parcel goes {way(run, 'parcel'):.3f} m"))


@newcomer(1.0)
def rising_platform():
    """A platform raises a crate and a ball on it."""
    stage = Stage()
    stage.box("platform", (1.0, 1.0, 0.1), (0.0, 0.0, 0.0), motion="kinematic", velocity=(0.0, 0.0, 0.5), material=WOOD)
    stage.box("crate", (0.3, 0.3, 0.3), (0.2, 0.0, 0.2), material=WOOD)
    stage.ball("ball", 0.1, (-0.2, 0.0, 0.15), material=WOOD)
    return stage, lambda run: must(*((height(run, n) - height(run, n, 0) > 0.49, f"{n} is left below") for n in ("crate", "ball")))


@newcomer(1.2)
def half_pipe():
    """A ball rolls to and fro in a bowl of its own OBJ file and never leaves it."""
    stage = Stage()
    stage.mesh("bowl", _bowl(0.5, 0.05), (0.0, 0.0, 0.0), motion="static", material=WOOD)
    stage.ball("ball", 0.05, (0.3, 0.0, 0.35), material=STEEL)
    return stage, lambda run: must((np.hypot(*run.position("ball")[-1, :2]) < 0.45 and height(run, "ball") > 0.05, "the ball is out"))


@newcomer(1.0)
def cow_on_table():
    """The cow of the assets drops on a table and stays above it."""
    stage = Stage()
    stage.box("table", (2.0, 2.0, 0.1), (0.0, 0.0, -0.05), motion="static", material=WOOD)
    shape = ri.Shape.from_file("assets/meshes/spot.obj", scale=0.3)
    stage.scene.add(ri.Body("cow", shape, position=(0.0, 0.0, 0.5), orientation=turn((1, 0, 0), 0.5 * np.pi), material=WOOD))
    return stage, lambda run: must((run.positions[-1, 1, 2] > 0.02, "the cow falls through"), (speed(run, "cow") < 3.0, "it flies"))
