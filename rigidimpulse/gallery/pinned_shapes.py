"""Energy terms as forces (A16): blocks that keep their layout are hit by a ball, and a chain of pinned bars comes to rest.

`RestoreShape` pulls eight blocks back to a cube, wherever it flies and turns: it only pushes them against each other, so momentum and
energy stay. The bars hang on soft pins, with drag; they end where `settle` finds the minimum of the same energies.
"""

from __future__ import annotations

import itertools

import numpy as np

from rigidimpulse.dynamics.forces.drag import Drag
from rigidimpulse.dynamics.forces.energy.force import EnergyForce
from rigidimpulse.dynamics.forces.energy.pin import PinPoints
from rigidimpulse.dynamics.forces.energy.restore import RestoreShape
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
BLOCK, SPACING, WEIGHT = 0.2, 0.3, 300.0
BLOCKS = tuple(f"block {i}{j}{k}" for i, j, k in itertools.product("01", "01", "01"))
BARS, BAR_LENGTH, PIN = ("upper bar", "middle bar", "lower bar"), 0.6, 500.0
HANG = (0.0, 1.5, 1.0)
DRAG = 3.0
DURATION = 4.0
BOUND = 1e-5


def chain(scene: Scene) -> list[PinPoints]:
    """Add bars, askew, and return their pins."""
    pins, before = [], None
    place, along = np.array(HANG), np.array([0.8, 0.0, -0.6])
    for name in BARS:
        bar = Shape.box((BAR_LENGTH, 0.06, 0.1))
        scene.add(Body(name, bar, mass=1.0, position=place + 0.5 * BAR_LENGTH * along, orientation=_turned(0.6435)))
        pins.append(PinPoints(before, name, place, place, PIN))
        place, before = place + BAR_LENGTH * along, name
    return pins


def _turned(angle: float) -> tuple[float, float, float, float]:
    """Return the turn by an angle about y."""
    return (float(np.cos(0.5 * angle)), 0.0, float(np.sin(0.5 * angle)), 0.0)


def scene() -> Scene:
    """Return blocks and ball, which gravity does not pull, and the chain."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    bouncy = Material(restitution=0.9, static_friction=0.0, dynamic_friction=0.0)
    for name in BLOCKS:
        place = SPACING * (np.array([int(c) for c in name.split()[1]]) - 0.5)
        scene.add(Body(name, Shape.box(BLOCK), mass=0.5, position=place, material=bouncy, gravity_factor=0.0))
    ball = Shape.sphere(0.12)
    place, velocity = (-1.5, 0.05, 0.12), (3.0, 0.0, 0.0)
    scene.add(Body("ball", ball, position=place, velocity=velocity, mass=0.8, material=bouncy, gravity_factor=0.0))
    scene.add(EnergyForce(RestoreShape(list(BLOCKS), WEIGHT), name="shape"))
    for k, pin in enumerate(chain(scene)):
        scene.add(EnergyForce(pin, name=f"pin {k + 1}"))
    scene.add(Drag(linear=DRAG, bodies=list(BARS)))
    return scene


def hanging() -> dict[str, np.ndarray]:
    """Return the places of the bars at the minimum of their energies."""
    from rigidimpulse.dynamics.forces.energy.potential import GravityPotential
    from rigidimpulse.engine.settle import settle

    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    settled = settle(scene, [*chain(scene), GravityPotential()]).scene
    return {name: np.asarray(settled[name].position) for name in BARS}


def check(run: Recording) -> list[Check]:
    """Check what the blocks keep, and where the chain ends."""
    free = [run.index(name) for name in (*BLOCKS, "ball")]
    mass = np.array([0.5] * len(BLOCKS) + [0.8])
    momentum = np.einsum("i,fik->fk", mass, run.velocities[:, free])
    assert run.ledger is not None
    balance = run.ledger.total + sum(run.ledger.dissipated.values())
    wanted = hanging()
    off = max(float(np.linalg.norm(run.position(name)[-1] - wanted[name])) for name in BARS)
    blocks = np.stack([run.position(name) for name in BLOCKS], axis=1)
    spread = np.sqrt(((blocks - blocks.mean(1, keepdims=True)) ** 2).sum((1, 2)) / len(BLOCKS))
    return [
        at_least("impacts", len(run.impacts), 1, "the ball hits the blocks"),
        at_most("momentum of blocks and ball, relative", np.ptp(momentum, axis=0).max() / momentum[0, 0], 1e-12, "internal forces"),
        at_most("ledger, J", np.ptp(balance), BOUND, "a term stores what it takes"),
        at_most("size of the cube, relative", np.abs(spread / spread[0] - 1.0).max(), 0.2, "the layout is restored"),
        at_least("way of the cube, m", float(blocks[-1].mean(0)[0]), 1.0, "it flies on as a whole"),
        at_most("bars off the minimum of their energies at the end, m", off, 0.01, "drag leaves what settle finds"),
    ]


SCENES = (GalleryScene("pinned_shapes", "Blocks keep their layout, pinned bars come to rest", scene, check, DURATION),)
