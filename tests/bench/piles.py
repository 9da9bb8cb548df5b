"""Times of big piles, and how far their bodies sink into each other: `python tests/bench/piles.py [NAMES] [--save]`.

The pile that engines are compared on: boxes of 0.5 m and 1 kg, mu = 0.5, e = 0, turned and thrown at random above a box-walled
container, 300 steps of 1/60 s; and the same of convex hulls of 32 vertices. Times are those of whole steps of the loop, recording
included, of the steps in which anything moves: a pile that has come to rest costs nothing. With NUMBA_NUM_THREADS=1 it runs on one
core, and times are processor times; on more they are those of a clock. Gaps are measured by separating axes
from the recorded poses, apart from the solver: the largest of s(n) = min n.b - max n.a over the normals of faces and the cross
products of edges.
With --save the lines go to tests/bench/<machine>/piles.csv.
"""

from __future__ import annotations

import argparse
import csv
import itertools
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np
import trimesh
from bench_scenes import machine

import rigidimpulse as ri
from rigidimpulse.core.kernels import number_of_cores
from rigidimpulse.core.quaternion import to_matrix

SIDE, PITCH, MASS = 0.5, 0.9, 1.0
STEPS, FPS = 300, 60.0
NUDGE = 1e-9
"""m."""
LAST = 60
"""Steps before rest that count as settled."""
FRAMES = 10
"""Last frames in which gaps are measured."""
CORNERS = 32
PILES = {"boxes_1000": (1000, False), "boxes_5000": (5000, False), "hulls_1000": (1000, True)}


class Line(NamedTuple):
    """What was measured of one pile: CPU times of a step in ms, depths in mm."""

    what: str
    state_hash: str
    steps: int
    median: float
    last: float
    peak: float
    largest_depth: float
    mean_depth: float
    largest_depth_ever: float


def pile(number: int, hulls: bool, fall: int = 0) -> ri.Scene:
    """Return the scene of `number` boxes or convex hulls; falls begin NUDGE apart, but end differently, as chaotic motions do."""
    random = np.random.default_rng(5)
    side = 10 if number <= 1000 else 20
    half = 0.5 * side * PITCH
    scene = ri.Scene(gravity=(0.0, 0.0, -9.81))
    material = ri.Material(density=MASS / SIDE**3, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)
    size = np.array([2.0 * half + 4.0, 2.0 * half + 4.0, 2.0])
    scene.add(ri.Body("floor", ri.Shape.box(size), position=(0, 0, -1), motion="static", material=material))
    for axis, sign in itertools.product(range(2), (-1.0, 1.0)):
        size, place = np.array([2.0 * half + 4.0, 2.0 * half + 4.0, 30.0]), np.array([0.0, 0.0, 14.0])
        size[axis], place[axis] = 2.0, sign * (half + 1.0)
        scene.add(ri.Body(f"wall {axis} {sign:+.0f}", ri.Shape.box(size), position=place, motion="static", material=material))
    shapes = [ri.Shape.box(SIDE)]
    if hulls:
        shapes = [ri.Shape.convex_hull(_corners(random)) for _ in range(20)]
    for k in range(number):
        layer, cell = divmod(k, side * side)
        place = ((cell % side + 0.5) * PITCH - half, (cell // side + 0.5) * PITCH - half, 0.5 + layer + fall * NUDGE)
        q = random.normal(size=4)
        scene.add(
            ri.Body(
                f"body {k}", shapes[k % len(shapes)], position=place, orientation=q / np.linalg.norm(q), mass=MASS, material=material,
                velocity=(*random.normal(0.0, 1.5, 2), 0.0), angular_velocity=random.normal(0.0, 2.0, 3),
            )
        )  # fmt: skip
    return scene


def _corners(random) -> np.ndarray:
    """Points on an ellipsoid about as large as the boxes."""
    points = random.normal(size=(CORNERS, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * random.uniform(0.25, 0.4, 3)


def depths(scene: ri.Scene, run: ri.Recording, frame: int) -> np.ndarray:
    """Depths of the pairs that are inside each other, m."""
    bodies = list(scene.bodies)
    solids = [_solid(body.shape) for body in bodies]
    reach = np.array([np.linalg.norm(v, axis=1).max() for v, _, _ in solids])
    x, r = run.positions[frame], to_matrix(run.orientations[frame])
    moves = np.array([body.motion == "dynamic" for body in bodies])
    out = []
    a, b = _near(x, reach, moves)
    for i, j in zip(a, b, strict=True):
        gap = _gap(solids[i], r[i], solids[j], r[j], x[j] - x[i])
        if gap < 0.0:
            out.append(-gap)
    return np.array(out)


def _near(x: np.ndarray, reach: np.ndarray, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from scipy.spatial import KDTree

    movable, fixed = np.flatnonzero(moves), np.flatnonzero(~moves)
    pairs = KDTree(x[movable]).query_pairs(2.0 * reach[movable].max(), output_type="ndarray")
    a, b = movable[pairs[:, 0]], movable[pairs[:, 1]]
    keep = np.linalg.norm(x[b] - x[a], axis=1) < reach[a] + reach[b]
    with_fixed = np.array(list(itertools.product(fixed, movable)))
    return np.concatenate([a[keep], with_fixed[:, 0]]), np.concatenate([b[keep], with_fixed[:, 1]])


def _solid(shape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals of faces and directions of edges of a convex shape."""
    surface = shape.surface()
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    normals = np.unique(mesh.facets_normal.round(9), axis=0) if len(mesh.facets) else np.zeros((0, 3))
    normals = np.unique(np.vstack([normals, mesh.face_normals]).round(9), axis=0)
    sharp = mesh.face_adjacency_angles > 1e-6
    ends = mesh.vertices[mesh.face_adjacency_edges[sharp]]
    edges = ends[:, 1] - ends[:, 0]
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    edges *= np.where(edges @ (0.12, 0.34, 0.57) < 0.0, -1.0, 1.0)[:, None]
    return np.asarray(mesh.vertices), normals, np.unique(edges.round(9), axis=0)


def _gap(solid_a, r_a, solid_b, r_b, between: np.ndarray) -> float:
    """Largest s(n) found; the search ends where it is positive."""
    a, b = solid_a[0] @ r_a.T, solid_b[0] @ r_b.T + between
    faces = np.vstack([solid_a[1] @ r_a.T, -solid_b[1] @ r_b.T])
    gap = float(((faces @ b.T).min(1) - (faces @ a.T).max(1)).max())
    if gap >= 0.0:
        return gap
    edges = np.cross((solid_a[2] @ r_a.T)[:, None], (solid_b[2] @ r_b.T)[None]).reshape(-1, 3)
    length = np.linalg.norm(edges, axis=1)
    edges = edges[length > 1e-4] / length[length > 1e-4, None]
    edges *= np.where(edges @ between < 0.0, -1.0, 1.0)[:, None]
    return max(gap, float(((edges @ b.T).min(1) - (edges @ a.T).max(1)).max())) if len(edges) else gap


def measure(name: str) -> Line:
    """Run a pile and measure it."""
    number, hulls = PILES[name]
    ri.simulate(pile(64, hulls), 4.0)
    scene, ends = pile(number, hulls), []
    clock = process_time if number_of_cores() == 1 else perf_counter
    run = ri.simulate(scene, STEPS / FPS, FPS, progress=lambda _time: ends.append(clock()))
    taken = 1e3 * np.diff(ends)
    sunk = np.concatenate([depths(scene, run, f) for f in range(-FRAMES, 0)])
    on_the_way = np.concatenate([depths(scene, run, f) for f in range(20, STEPS, 20)])
    print(run.status.message, "|", run.plan.line("sub-stepped islands").reason)
    return Line(
        name, run.state_hash()[:16], len(ends), float(np.median(taken)), float(np.median(taken[-LAST:])), float(taken.max()),
        1e3 * sunk.max(initial=0.0), 1e3 * float(sunk.mean()) if len(sunk) else 0.0, 1e3 * on_the_way.max(initial=0.0),
    )  # fmt: skip


def main() -> None:
    """Measure, print, save if asked to."""
    parser = argparse.ArgumentParser(description="Times of big piles, and how far their bodies sink into each other.")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(PILES)}; all if none is given")
    parser.add_argument("--save", action="store_true", help="write tests/bench/<machine>/piles.csv")
    options = parser.parse_args()
    print(machine(), "| cores:", number_of_cores())
    lines = []
    for name in options.names or PILES:
        line = measure(name)
        lines.append(line)
        print(
            f"{line.what:12} moves for {line.steps} steps  median {line.median:7.2f} ms a step  last {LAST} {line.last:7.2f}  "
            f"peak {line.peak:7.1f}  "
            f"depth at the end {line.largest_depth:.2f} mm, mean {line.mean_depth:.2f}, on the way {line.largest_depth_ever:.2f}  "
            f"{line.state_hash}",
            flush=True,
        )
    if options.save:
        folder = Path(__file__).parent / machine()
        folder.mkdir(exist_ok=True)
        with (folder / "piles.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(Line._fields)
            writer.writerows([*line[:3], *(f"{value:.3f}" for value in line[3:])] for line in lines)
        print(f"wrote {folder / 'piles.csv'}")


if __name__ == "__main__":
    main()
