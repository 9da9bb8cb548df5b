"""Stacks and masonry at rest: nothing may move.

Each of these stands by statics: there are contact forces, none of them a pull and all inside the cones of friction, that
balance every block. So bodies that were at rest stay at rest, and any motion is an error of the solver. What an honest
solver needs is the gap of lasting contact, delta = 1e-6 of the size for each block below: 1e-4 of a side for a stack of
100. The bound on the top's way is 1 % of a side.

Semicircular arch of mean radius R and thickness t, voussoirs without mortar: the thrust line of its own weight fits
between intrados and extrados only if t / R > 0.1075 (M. Milankovitch 1907, as corrected for the vertical weight of
radial voussoirs by J. A. Ochsendorf 2006). At t / R = 0.16 it stands; at 0.08 no equilibrium exists and it falls. Blocks
fall apart into a few parts, but an arch of N voussoirs hinges only at its joints, which makes it a little stronger: at
N = 15 the least thickness is above 0.10 still (joints at 0, 48, 96 degrees from the crown are less than 6 degrees off
the hinges of the continuous arch, where the thrust line is tangent).

House of cards: two cards that lean at the angle theta from the vertical press each other with the half weight times tan
theta, plus tan theta times what lies on them, so the feet need friction mu >= H / N, at most tan theta = 0.27.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.gallery.hard.parts import dull, energy_never_grows, farthest, finite, floor_scene, turned, undisturbed
from rigidimpulse.gallery.looks import BRICK_COLOR, IVORY, STONE, card, shade_of
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual

STILL = "statics: forces in the cones balance every block"
BRICK = (0.24, 0.115, 0.071)
LAYERS, BRICKS = 8, 5
VOUSSOIRS, MEAN_RADIUS, ARCH_DEPTH = 15, 2.0, 0.6
CARD = (0.004, 0.06, 0.1)
"""m: thickness, width and length of a card; thick ones, of wood."""
LEAN = math.radians(15.0)
DECK = 0.004


def stack(num_boxes: int) -> Scene:
    """Return a stack of unit cubes."""
    material = dull(0.5)
    scene = floor_scene(material)
    for k in range(num_boxes):
        scene.add(Body(f"box {k + 1}", Shape.box(1.0), position=(0.0, 0.0, 0.5 + k), material=material))
    return scene


def exact_stack(num_boxes: int, times: np.ndarray) -> Exact:
    """Return the boxes where they were put."""
    places = {f"box {k + 1}": np.tile([0.0, 0.0, 0.5 + k], (len(times), 1)) for k in range(num_boxes)}
    return Exact(places, {name: np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1)) for name in places})


def check_stack(num_boxes: int, run: Recording) -> list[Check]:
    """Check that no box moves; the top one moves most."""
    names = [f"box {k + 1}" for k in range(num_boxes)]
    return [
        at_most("top moves, m", farthest(run, names[-1:]), 0.01, f"{STILL}; 1 % of a side"),
        at_most("any box moves, m", farthest(run, names), 0.01, STILL),
        *_still(run, 1.0, num_boxes),
    ]


def wall() -> Scene:
    """Return a brick wall in running bond: every other layer is shifted by half a brick and ends in half bricks."""
    material = dull(0.6, density=1900.0)
    scene = floor_scene(material)
    length, width, height = BRICK
    half = Shape.box((0.5 * length, width, height))
    brick = Shape.box(BRICK)
    for layer in range(LAYERS):
        z = (layer + 0.5) * height
        shifted = layer % 2 == 1
        places = [(k + (1.0 if shifted else 0.5)) * length for k in range(BRICKS - shifted)]
        for k, x in enumerate(places):
            look = shade_of(BRICK_COLOR, 7 * layer + k)
            scene.add(Body(f"layer {layer + 1} brick {k + 1}", brick, position=(x, 0.0, z), material=material, visual=look))
        for name, x in (("left", 0.25 * length), ("right", (BRICKS - 0.25) * length)) if shifted else ():
            look = shade_of(BRICK_COLOR, 7 * layer + (5 if name == "left" else 6))
            scene.add(Body(f"layer {layer + 1} {name}", half, position=(x, 0.0, z), material=material, visual=look))
    return scene


def check_wall(run: Recording) -> list[Check]:
    """Check that no brick moves."""
    return [
        at_most("any brick moves, m", farthest(run, _dynamic(run)), 0.01 * BRICK[2], f"{STILL}; 1 % of a brick's height"),
        *_still(run, BRICK[0], LAYERS),
    ]


def arch(thickness: float) -> Scene:
    """Return a semicircular arch of voussoirs; `thickness` is that of the mean radius."""
    material = dull(0.7, density=2400.0)
    scene = floor_scene(material)
    inner, outer = MEAN_RADIUS * (1.0 - 0.5 * thickness), MEAN_RADIUS * (1.0 + 0.5 * thickness)
    for k in range(VOUSSOIRS):
        angles = np.pi * np.array([k, k + 1]) / VOUSSOIRS
        ring = [(r * np.cos(a), y, r * np.sin(a)) for a in angles for r in (inner, outer) for y in (-0.5 * ARCH_DEPTH, 0.5 * ARCH_DEPTH)]
        points = np.array(ring)
        points[np.abs(points[:, 2]) < 1e-15, 2] = 0.0
        center = points.mean(axis=0)
        stone, look = Shape.convex_hull(points - center), shade_of(STONE, k)
        scene.add(Body(f"voussoir {k + 1}", stone, position=center, material=material, visual=look))
    return scene


def check_arch(run: Recording) -> list[Check]:
    """Check that no voussoir moves."""
    return [
        at_most("any voussoir moves, m", farthest(run, _dynamic(run)), 0.01 * MEAN_RADIUS * 0.16, f"{STILL}; t / R > 0.1075"),
        *_still(run, 0.7, VOUSSOIRS),
    ]


def check_thin_arch(run: Recording) -> list[Check]:
    """Check that the arch falls: its crown comes down to the floor."""
    crown = f"voussoir {VOUSSOIRS // 2 + 1}"
    drop = run.position(crown)[0, 2] - run.position(crown)[:, 2].min()
    return [
        finite(run),
        at_least("the crown comes down by, m", drop, 0.5 * MEAN_RADIUS, "t / R < 0.1075: no thrust line fits (Milankovitch)"),
        energy_never_grows(run, 0.7, VOUSSOIRS),
    ]


def house() -> Scene:
    """Return a house of three storeys: three, two and one pair of cards, a deck on each storey but the last."""
    material = dull(0.5, density=700.0)
    scene = floor_scene(material)
    thickness, width, length = CARD
    # A card leans toward its pair: x runs inward. Its foot is the corner at the inner face, its head the inner top edge.
    inward = 0.5 * length * math.sin(LEAN) + 0.5 * thickness * math.cos(LEAN)
    height = 0.5 * length * math.cos(LEAN) + 0.5 * thickness * math.sin(LEAN)
    pitch = 2.0 * length * math.sin(LEAN) + 4.0 * thickness
    base = 0.0
    for storey, num_pairs in enumerate((3, 2, 1)):
        for k in range(num_pairs):
            middle = (k - 0.5 * (num_pairs - 1)) * pitch
            for side, name in ((1.0, "right"), (-1.0, "left")):
                place = (middle + side * inward, 0.0, base + height)
                turn = turned((0.0, 1.0, 0.0), -side * LEAN)
                name = f"card {storey + 1}.{k + 1} {name}"
                scene.add(Body(name, Shape.box(CARD), position=place, orientation=turn, material=material, visual=card(CARD)))
        base += 2.0 * height
        if num_pairs > 1:
            deck = Shape.box((num_pairs * pitch, width, DECK))
            place = (0.0, 0.0, base + 0.5 * DECK)
            scene.add(Body(f"deck {storey + 1}", deck, position=place, material=material, visual=Visual(color=IVORY)))
            base += DECK
    return scene


def check_house(run: Recording) -> list[Check]:
    """Check that no card moves."""
    return [
        at_most("any card moves, m", farthest(run, _dynamic(run)), 0.01 * CARD[2], f"{STILL}, for mu > tan 15 degrees"),
        *_still(run, 3.0 * CARD[2], 6),
    ]


def _dynamic(run: Recording) -> list[str]:
    return [name for name in run.names if name != "floor"]


def _still(run: Recording, size: float, levels: int) -> list[Check]:
    """Return the checks of every scene at rest."""
    return [finite(run), energy_never_grows(run, size, levels), undisturbed(run)]


TWENTY = "20 boxes, 10 s: MuJoCo 9e-11 mm, PyBullet 13, Rapier 1, Jolt 64, PhysX 0.8, ODE 300 mm"
SCENES = (
    *(
        GalleryScene(
            f"stack_{n}", f"A stack of {n} boxes stands for 30 s", partial(stack, n), partial(check_stack, n), 30.0, 30.0, elsewhere=TWENTY,
            exact=partial(exact_stack, n),
        )
        for n in (10, 30, 100)
    ),
    GalleryScene("brick_wall", "A brick wall of eight courses in running bond", wall, check_wall, 10.0, 30.0),
    GalleryScene("arch", "A dry-stone arch, thickness 0.16 R", partial(arch, 0.16), check_arch, 10.0, 30.0),
    GalleryScene("arch_too_thin", "A dry-stone arch, thickness 0.08 R, must fall", partial(arch, 0.08), check_thin_arch, 4.0, 30.0),
    GalleryScene("house_of_cards", "A house of cards, three storeys", house, check_house, 10.0, 30.0),
)
