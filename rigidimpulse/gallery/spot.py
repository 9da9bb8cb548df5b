"""Spot the cow is thrown at a torus that lies on the floor: concave against concave, 5,856 against 4,096 triangles.

There is no closed form for the motion, but laws hold at every impact. No impact makes energy, and friction stays in its cone. The cow
never enters floor or torus. The energy it has lost is the one that the ledger has as dissipated.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.gallery.record import Check, GalleryScene, asset_path, at_most, rotations
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SCALE = 0.5
"""Metres per unit of the model, which is 1.7 units tall."""
FRICTION = (0.6, 0.5)
RESTITUTION = 0.6
DENSITY = 700.0
RING_RADIUS, TUBE_RADIUS, RING_SECTIONS, TUBE_SECTIONS = 0.7, 0.16, 64, 32
START, VELOCITY, SPIN = (-2.49, -0.01, 1.2), (2.75, 0.0, 0.65), (-1.1, 9.0, 1.2)
DURATION = 4.0


def scene() -> Scene:
    """Return floor, torus and cow."""
    stone = Material(restitution=RESTITUTION, static_friction=FRICTION[0], dynamic_friction=FRICTION[1])
    hide = Material(density=DENSITY, restitution=RESTITUTION, static_friction=FRICTION[0], dynamic_friction=FRICTION[1])
    scene = Scene()
    scene.add(Body("floor", Shape.half_space(), motion="static", material=stone))
    scene.add(Body("torus", torus(), motion="static", position=(0.0, 0.0, TUBE_RADIUS), material=stone))
    cow = Shape.from_file(asset_path("spot.obj"), scale=SCALE)
    upright = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)  # the model is Y up: a quarter turn about x
    scene.add(
        Body("spot", cow, position=START, orientation=upright, velocity=VELOCITY, angular_velocity=SPIN, material=hide)
    )
    return scene


def torus() -> Shape:
    """Return a torus about z."""
    around = 2.0 * np.pi * np.arange(RING_SECTIONS) / RING_SECTIONS
    tube = 2.0 * np.pi * np.arange(TUBE_SECTIONS) / TUBE_SECTIONS
    out = RING_RADIUS + TUBE_RADIUS * np.cos(tube)
    height = np.broadcast_to(TUBE_RADIUS * np.sin(tube), (RING_SECTIONS, TUBE_SECTIONS))
    vertices = np.stack([np.outer(np.cos(around), out), np.outer(np.sin(around), out), height], axis=2).reshape(-1, 3)
    ring, section = np.meshgrid(np.arange(RING_SECTIONS), np.arange(TUBE_SECTIONS), indexing="ij")
    here = (ring * TUBE_SECTIONS + section).ravel()
    next_section = (ring * TUBE_SECTIONS + (section + 1) % TUBE_SECTIONS).ravel()
    next_ring = ((ring + 1) % RING_SECTIONS * TUBE_SECTIONS + section).ravel()
    across = ((ring + 1) % RING_SECTIONS * TUBE_SECTIONS + (section + 1) % TUBE_SECTIONS).ravel()
    faces = np.concatenate([np.stack([here, next_ring, across], 1), np.stack([here, across, next_section], 1)])
    return Shape.mesh(vertices, faces)


def check(run: Recording) -> list[Check]:
    """Check the laws that hold whatever the motion."""
    vertices = run.scene["spot"].shape.surface().vertices if run.scene else np.zeros((1, 3))
    lowest, inside = _depths(run, vertices)
    return [
        *_energy(run),
        at_most("tangential over normal impulse, above mu", _cone_excess(run), 1e-9, "Coulomb: |J_t| <= mu_s J_n"),
        at_most("deepest vertex below the floor, m", lowest, 1e-9, "bodies stay apart"),
        at_most("deepest vertex in the torus, m", inside, 1e-9, "bodies stay apart"),
        at_most(
            "speed at the end, m/s",
            float(np.linalg.norm(run.velocity("spot")[-1])),
            1e-3,
            "friction and impacts stop it",
        ),
    ]


def _energy(run: Recording) -> list[Check]:
    if run.ledger is None:
        return []
    total, start = run.ledger.total, run.ledger.kinetic[0] + run.ledger.potential[0] - run.ledger.potential.min()
    taken = np.sum(list(run.ledger.dissipated.values()), axis=0) if run.ledger.dissipated else np.zeros(len(total))
    return [
        at_most(
            "largest rise of energy, relative", np.diff(total).max() / start, 1e-9, "impacts and friction only take"
        ),
        at_most(
            "error of the ledger, relative", np.abs(total + taken - total[0]).max() / start, 1e-9, "energy balance"
        ),
    ]


def _cone_excess(run: Recording) -> float:
    """Return the largest |J_t| / J_n - mu_s over all impacts."""
    impacts = run.impacts[run.impacts["impulse"] > 0.0]
    ratio = np.linalg.norm(impacts["tangent_impulse"], axis=1) / impacts["impulse"]
    return float(np.max(ratio - FRICTION[0], initial=-FRICTION[0]))


def _depths(run: Recording, vertices: np.ndarray) -> tuple[float, float]:
    """Return how deep the cow's vertices get below the floor and into the torus, m, over all frames."""
    # The faceted torus lies inside the round one; its faces lie outside the torus of this tube radius.
    inscribed = TUBE_RADIUS * math.cos(math.pi / TUBE_SECTIONS) - RING_RADIUS * (
        1.0 - math.cos(math.pi / RING_SECTIONS)
    )
    lowest = inside = -math.inf
    turns = rotations(run.orientation("spot"))
    for turn, position in zip(turns, run.position("spot"), strict=True):
        x, y, z = (turn.apply(vertices) + position).T
        lowest = max(lowest, -float(z.min()))
        away = np.hypot(np.hypot(x, y) - RING_RADIUS, z - TUBE_RADIUS)
        inside = max(inside, inscribed - float(away.min()))
    return lowest, inside


SCENES = (GalleryScene("spot", "Spot the cow is thrown at a torus: concave against concave", scene, check, DURATION),)
