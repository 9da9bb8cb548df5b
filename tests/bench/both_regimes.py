"""The sub-stepped regime against the exact one on random scenes:
`python tests/bench/both_regimes.py [FIRST] [--scenes N] [--limit S] [--solver NAME]`.

A scene has 12 to 60 bodies of one restitution and one friction, drawn by its seed: boxes, balls, capsules, cylinders, hulls, and in a third
of the scenes concave corners. They fall on a floor, or into a tray. Each runs with contact_solver "newton" and with "substepped", or
another one. Compared are

    lost     E(0) - E(t), the energy of motion and place that is lost until the first body rests in the exact run
    depth    of bodies inside each other in the sub-stepped run, at frames that are chosen evenly, by the measure that runs end with; of the
             skin, the gap at which sub-stepped contacts are kept: 0.8 % of the inner radius of the smaller body

A line says both. The exit code is 1 if energies differ by more than LOST, or a body is deeper than the skin. A scene whose exact run is not
done after the limit of processor time is left out, and said: another seed takes its place.
"""

from __future__ import annotations

import argparse
import sys
from statistics import median

import numpy as np
import trimesh
from apart import apart

import rigidimpulse as ri
from rigidimpulse.collision.manifold.convexity import inner_radii
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.measure.measure import record_of_recording
from rigidimpulse.engine.measure.overlap import overlap_depths

SCENES = 30
LOST = 0.05
"""Part by which the energies that are lost may differ."""
REBOUND = 0.5
"""Bodies that rebound by more are sub-stepped only where all must be, see `engine.regime`."""
AT_REST = 0.02
"""A body rests from where its speed stays below this part of sqrt(g s), s = 0.15 m: the size of a body."""
DURATION = 1.5
"""s."""


def corner(size: float) -> ri.Shape:
    """A board with another on it that stands: a mesh with an edge that goes in."""
    profile = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)]) * 0.8 * size
    triangles = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    mesh = trimesh.creation.extrude_triangulation(profile, triangles, height=0.5 * size)
    return ri.Shape.mesh(mesh.vertices - mesh.center_mass, mesh.faces)


def shape(random: np.random.Generator, kinds: tuple[str, ...]) -> ri.Shape:
    """A shape of one of the kinds, of 0.1 to 0.25 m."""
    size = random.uniform(0.1, 0.25)
    match kinds[random.integers(len(kinds))]:
        case "box":
            return ri.Shape.box(size * random.uniform(0.4, 1.0, 3))
        case "ball":
            return ri.Shape.sphere(0.5 * size)
        case "capsule":
            return ri.Shape.capsule(0.25 * size, 0.5 * size)
        case "cylinder":
            return ri.Shape.cylinder(0.4 * size, size * random.uniform(0.2, 1.0))
        case "hull":
            points = random.normal(size=(20, 3))
            return ri.Shape.convex_hull(points / np.linalg.norm(points, axis=1, keepdims=True) * (0.3, 0.5, 0.5) * size)
        case _:
            return corner(size)


def make_scene(seed: int) -> ri.Scene:
    """The scene of a seed."""
    random = np.random.default_rng(seed)
    friction = random.uniform(0.1, 0.8)
    material = ri.Material(restitution=random.uniform(0.0, REBOUND), static_friction=friction, dynamic_friction=friction)
    kinds = ("box", "ball", "capsule", "cylinder", "hull", *(("corner",) if seed % 3 == 2 else ()))
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    if seed % 2:
        for axis in range(2):
            for sign in (-1.0, 1.0):
                size, place = np.array([1.8, 1.8, 0.6]), np.array([0.0, 0.0, 0.3])
                size[axis], place[axis] = 0.1, 0.85 * sign
                scene.add(ri.Body(f"wall {axis} {sign:+.0f}", ri.Shape.box(size), position=place, motion="static", material=material))
    for k in range(random.integers(12, 61)):
        layer, cell = divmod(k, 16)
        place = np.array([0.35 * (cell % 4 - 1.5), 0.35 * (cell // 4 - 1.5), 0.3 + 0.35 * layer])
        turned = random.normal(size=4)
        moving = {"velocity": random.normal(0.0, 0.4, 3), "angular_velocity": random.normal(0.0, 3.0, 3), "material": material}
        scene.add(ri.Body(f"body {k}", shape(random, kinds), position=place, orientation=turned / np.linalg.norm(turned), **moving))
    return scene


def first_rest(run: ri.Recording) -> int:
    """The frame from which a dynamic body rests, the first that does; the last frame if none does."""
    frames = []
    for name in run.names:
        if name.startswith("body"):
            speed = np.linalg.norm(run.velocity(name), axis=1)
            moving = np.flatnonzero(speed > AT_REST * np.sqrt(9.81 * 0.15))
            frames.append(int(moving[-1]) + 1 if len(moving) else 0)
    return min(min(frames), len(run.times) - 1)


def compare(seed: int, solver: str) -> tuple[str, float, float]:
    """A line about a seed, the difference of energies and the depth; solver: that is compared with exact contact."""
    scene = make_scene(seed)
    exact = ri.simulate(scene, DURATION, accuracy=ri.Accuracy(contact_solver="newton"))
    soft = ri.simulate(scene, DURATION, accuracy=ri.Accuracy(contact_solver=solver))
    frame = first_rest(exact)
    lost = [float(run.ledger.total[0] - run.ledger.total[frame]) for run in (exact, soft)]
    record = record_of_recording(soft)
    depths = overlap_depths(record)
    world = record.world
    inner = np.where(world.dynamic, inner_radii(world.geometry, world.convex_depths)[world.shape_of_body], np.inf)
    skin = TOLERANCES.sub_stepping.skin * np.minimum(inner[depths.a], inner[depths.b])
    share = float((depths.depth / skin).max(initial=0.0))
    differs = abs(lost[1] / lost[0] - 1.0)
    said = "; ".join(sorted({event.kind for event in soft.status.events if event.is_problem})) or "ok"
    bodies = sum(name.startswith("body") for name in exact.names)
    until = f"until {exact.times[frame]:.2f} s lost {lost[0]:.3f} J, {lost[1] / lost[0] - 1.0:+.2%}"
    return f"seed {seed}: {bodies} bodies, {until}; depth {share:.2f} skins; {said}", differs, share


def main() -> int:
    """Compare scenes until there are enough; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--solver", default="substepped", help="contact_solver that is compared with \"newton\"")
    parser.add_argument("--limit", type=int, default=90, help="s of processor time for both runs of a scene")
    options = parser.parse_args()
    found: list[tuple[float, float]] = []
    for seed in range(options.first, options.first + 2 * options.scenes):
        if len(found) == options.scenes:
            break
        told = apart(compare, seed, options.solver, seconds=options.limit)
        print(f"seed {seed}: {told}" if isinstance(told, str) else told[0], flush=True)
        if not isinstance(told, str):
            found.append(told[1:])
    differing, deep = (sorted(column) for column in zip(*found, strict=True))
    print(f"energies differ by {median(differing):.2%}, at most {differing[-1]:.2%}; depth at most {deep[-1]:.2f} skins")
    return int(differing[-1] > LOST or deep[-1] > 1.0)


if __name__ == "__main__":
    sys.exit(main())
