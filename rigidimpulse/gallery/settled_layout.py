"""A pile of parts settles into a table and a stool, which then stand. Beside them the same pile falls down unsettled.

Legs are pinned to tops by three points each, so each piece is one rigid thing where its energy is 0: `PinPoints` meet exactly.
`RestoreShape` keeps stool and books at their places by the table, `NoOverlap` with a gap keeps everything apart and above the floor,
`GravityPotential` lets it down. `settle` minimises their sum from the disorder; what is pinned is then glued to one body. The other pile is
only moved out of itself, by `NoOverlap` alone.

What stands at a minimum of its potential stays: the run moves it by no more than the gap. Heights follow from sizes.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.quaternion import rotate
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.energy.pin import PinPoints

GRAVITY = 9.81
WOOD = Material(density=600.0, restitution=0.0, static_friction=0.6, dynamic_friction=0.6)
FURNITURE = {"table": ((1.0, 0.7, 0.05), (0.06, 0.06, 0.6)), "stool": ((0.36, 0.36, 0.04), (0.05, 0.05, 0.36))}
"""Sizes of the top and of each leg, m."""
BOOKS = {"book a": (0.3, 0.22, 0.06), "book b": (0.24, 0.18, 0.05)}
PLACES = {"table": (0.0, 0.0), "stool": (-0.1, -0.62), "book a": (0.15, 0.05), "book b": (-0.2, -0.1)}
"""Where things stand, m, from the table."""
GAP = 5e-4
WEIGHT = 1e7
"""N/m; the table sinks into its gap by 10 um."""
MESS = (0.0, 1.9, 0.0)
"""m, where the same pile lies unsettled."""
DURATION = 2.0


def parts() -> dict[str, tuple[float, float, float]]:
    """Return the sizes of all parts by name."""
    sizes = dict(BOOKS)
    for piece, (top, leg) in FURNITURE.items():
        sizes[piece] = top
        sizes.update({f"{piece}, leg {k}": leg for k in range(4)})
    return sizes


def pile() -> Scene:
    """Return the parts in disorder, many of them inside each other."""
    random = np.random.default_rng(3)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=WOOD))
    for name, size in parts().items():
        place = random.uniform((-0.6, -0.6, 0.4), (0.6, 0.6, 1.3))
        scene.add(Body(name, Shape.box(size), position=place, orientation=random.normal(size=4), material=WOOD))
    return scene


def settled() -> tuple[Scene, float]:
    """Return the pile settled, and the largest distance of pinned points, m."""
    from rigidimpulse.dynamics.forces.energy.overlap import NoOverlap
    from rigidimpulse.dynamics.forces.energy.potential import GravityPotential
    from rigidimpulse.dynamics.forces.energy.restore import RestoreShape
    from rigidimpulse.engine.settle import settle

    flat, legs = [*FURNITURE, *BOOKS], [name for name in parts() if "leg" in name]
    layout, upright = [(*PLACES[name], _height(name)) for name in flat], [(1.0, 0.0, 0.0, 0.0)] * len(flat)
    together = RestoreShape(flat, 1e4, layout, upright)
    # First through each other into place, then out of each other and down.
    built, first = settle(pile(), [*_pins(pile()), together])
    apart = [NoOverlap(WEIGHT, GAP, ["floor", *flat]), NoOverlap(WEIGHT, GAP, ["floor", *BOOKS, *legs])]
    scene, last = settle(built, [*_pins(built), together, *apart, GravityPotential()])
    if not (first.ok and last.ok):
        raise RuntimeError(f"{first.message}; {last.message}")
    return scene, last.residual


def _pins(scene: Scene) -> list[PinPoints]:
    """Return the pins of legs to tops, and three soft ones of the table to its place in the world, which tell where up is."""
    from rigidimpulse.dynamics.forces.energy.pin import PinPoints

    pins = []
    for piece, (top, leg) in FURNITURE.items():
        for k, corner in enumerate(itertools.product((-1, 1), (-1, 1))):
            name = f"{piece}, leg {k}"
            for spot in ((0.5, 0.5), (-0.5, 0.5), (0.5, -0.5)):
                across = np.array(spot) * leg[:2]
                on_top = np.array([*(np.array(corner) * (np.array(top[:2]) - leg[:2]) * 0.5 + across), -0.5 * top[2]])
                on_leg = np.array([*across, 0.5 * leg[2]])
                pins.append(PinPoints(piece, name, _there(scene[piece], on_top), _there(scene[name], on_leg)))
    for spot in np.eye(3):
        place = spot + (*PLACES["table"], _height("table"))
        pins.append(PinPoints(None, "table", place, _there(scene["table"], spot), 1e3))
    return pins


def _height(name: str) -> float:
    """Return the height of the centre of a top or a book where it stands, m."""
    if name in BOOKS:
        return _height("table") + 0.5 * (FURNITURE["table"][0][2] + BOOKS[name][2])
    top, leg = FURNITURE[name]
    return leg[2] + 0.5 * top[2]


def _there(body: Body, point: np.ndarray) -> np.ndarray:
    """Return the place (3,) m of a point of a body."""
    return np.asarray(body.position, float) + rotate(body.unit_orientation(), point)


def scene() -> Scene:
    """Return the settled pieces, each glued to one body, and beside them the pile, moved out of itself."""
    from rigidimpulse.dynamics.forces.energy.overlap import NoOverlap
    from rigidimpulse.engine.settle import settle

    parted, _ = settled()
    scene = Scene(parted.gravity, [parted["floor"], *(parted[name] for name in BOOKS)])
    for piece in FURNITURE:
        origin = np.asarray(parted[piece].position)
        glued = [parted[name] for name in parts() if name.startswith(piece)]
        shape = Shape.compound([(part.shape, part.position - origin, part.orientation) for part in glued])
        scene.add(Body(piece, shape, position=origin, material=WOOD))
    for body in settle(pile(), [NoOverlap(1.0, GAP)]).scene.bodies:
        if body.name != "floor":
            place = np.asarray(body.position) + MESS
            scene.add(replace(body, name=f"loose {body.name}", position=place))
    return scene


def check(run: Recording) -> list[Check]:
    """Check that the settled pieces are built and stand, and that the others do neither."""
    names = [*FURNITURE, *BOOKS]
    moved = max(float(np.abs(run.position(name) - run.position(name)[0]).max()) for name in names)
    high = max(abs(float(run.position(name)[0, 2]) - _height(name)) for name in names)
    fallen = float(run.position("loose table")[-1, 2])
    away = max(float(np.abs(run.velocity(name)[-1]).max()) for name in names)
    overlaps = sum(event.kind == "overlap at the start" for event in run.status.events)
    return [
        at_most("largest distance of pinned points, m", settled()[1], 1e-9, "exact pins meet"),
        at_most("height of tops and books off what their sizes give, m", high, 4.0 * GAP, "what stands is a gap above what carries it"),
        equal("bodies inside each other at the start", overlaps, 0, "no overlap"),
        at_most("way that settled bodies move, m", moved, 4.0 * GAP, "a minimum of the potential is at rest: they fall through the gaps"),
        at_most("their speed at the end, m/s", away, 0.0, "they rest"),
        at_least("height of the table above the loose top, m", _height("table") - fallen, 0.3, "the pile falls down"),
    ]


SCENES = (GalleryScene("settled_layout", "A pile of parts settles into furniture that stands; another falls", scene, check, DURATION),)
