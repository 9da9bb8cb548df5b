"""From one body to two hundred: what each preset costs, how deep bodies are inside each other, how far joints are apart.

`python tests/bench/middle.py [SCENE ...] [--presets standard,preview] [--engines MuJoCo,Bullet,PhysX,Rapier] [--rounds N] [--save]`

Scenes are those that people build first: a die, dice in a tray, a wall that a ball hits, shards, mixed shapes, concave meshes, a chain of
rings, dolls on stairs, a gyroscope, a chain with a weight, dominoes, a pendulum. A line says: seconds of processor time for a second of
motion (median of the rounds; presets and engines take turns, so that other work hits all alike), the depth of bodies inside each other
at frames that are chosen evenly, of the size of the smaller body, by the measure that runs end with (`engine.measure`), the widest gap of
a joint, the growth of the energy of motion and place over an earlier frame, of the largest kinetic energy (not where a drive gives some),
and the status. Other engines run in steps of 1/240 s what they can load: not concave meshes, of which they would take the hulls, but the
same bodies in convex parts. Their depths and gaps are measured in the same way at the same frames; their time is that of the steps alone.
With --save the lines go to docs/results/data/middle.csv, for the page of the results.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import process_time
from typing import NamedTuple

import numpy as np
import trimesh
from bench_scenes import machine
from engines import ENGINES, EngineRun, run_engines, use_cores

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "results"))

from provenance import DATA, note

import rigidimpulse as ri
from rigidimpulse.core.quaternion import multiply, rotate
from rigidimpulse.engine.measure.measure import record_of_recording
from rigidimpulse.engine.measure.overlap import overlap_depths
from rigidimpulse.engine.measure.record import RunRecord

HARD = ri.Material(density=1200, restitution=0.2, static_friction=0.4, dynamic_friction=0.4)
SOFT = ri.Material(density=700, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)
PEER_STEP, PEER_STEPS = 1.0 / 240.0, 4
"""Step of other engines, s, and how many of them there are from frame to frame."""


class Line(NamedTuple):
    """What was measured of a scene at one preset, or in one engine."""

    scene: str
    what: str  # preset or engine
    seconds: float  # of processor time for 1 s of motion
    depth: float  # of the size of the smaller body
    gap: float  # m, of joints
    gain: float  # of the largest kinetic energy
    status: str


def _turn(random: np.random.Generator) -> np.ndarray:
    """An orientation, all alike probable."""
    q = random.normal(size=4)
    return q / np.linalg.norm(q)


def _ground(material: ri.Material = HARD) -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    return scene


def _walled(half: float, height: float) -> ri.Scene:
    """A floor with four walls of boxes, `half` m from the middle."""
    scene = _ground()
    for axis in range(2):
        for sign in (-1.0, 1.0):
            size, place = np.array([2.0 * half + 0.4 * half, 2.0 * half + 0.4 * half, height]), np.array([0.0, 0.0, 0.5 * height])
            size[axis], place[axis] = 0.2 * half, sign * 1.1 * half
            scene.add(ri.Body(f"wall {axis} {sign:+.0f}", ri.Shape.box(size), position=place, motion="static", material=HARD))
    return scene


def _drop(scene: ri.Scene, shapes: list[ri.Shape], number: int, pitch: float, across: int) -> ri.Scene:
    """Bodies in layers of `across` by `across`, turned at random."""
    random = np.random.default_rng(3)
    for k in range(number):
        layer, cell = divmod(k, across * across)
        place = pitch * np.array([cell % across - 0.5 * (across - 1), cell // across - 0.5 * (across - 1), layer + 0.8])
        body = {"position": place, "orientation": _turn(random), "angular_velocity": random.normal(0.0, 2.0, 3), "material": HARD}
        scene.add(ri.Body(f"body {k}", shapes[k % len(shapes)], **body))
    return scene


def die() -> ri.Scene:
    """A die of 16 mm that is thrown and comes to rest."""
    scene = _ground()
    thrown = {"position": (0, 0, 0.1), "velocity": (0.5, 0, 0), "angular_velocity": (20, 30, 5)}
    scene.add(ri.Body("die", ri.Shape.box(0.016), orientation=_turn(np.random.default_rng(8)), material=HARD, **thrown))
    return scene


def dice() -> ri.Scene:
    """A hundred dice fall into a tray."""
    return _drop(_walled(0.11, 0.5), [ri.Shape.box(0.016)], 100, 0.03, 5)


def wall() -> ri.Scene:
    """A wall of sixty bricks that a ball hits."""
    scene = _ground(SOFT)
    for row in range(10):
        for column in range(6):
            place = (0.0, 0.2 * (column + 0.5 * (row % 2)) - 0.5, 0.05 + 0.1 * row)
            scene.add(ri.Body(f"brick {row} {column}", ri.Shape.box((0.1, 0.2, 0.1)), position=place, material=SOFT))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.15), position=(-1.5, 0, 0.5), velocity=(10, 0, 0), mass=10.0, material=SOFT))
    return scene


def shards() -> ri.Scene:
    """Convex pieces of a cube that falls apart on the floor."""
    from scipy.spatial import HalfspaceIntersection

    random, scene = np.random.default_rng(4), _ground(SOFT)
    seeds = random.uniform(-0.5, 0.5, (150, 3))
    box = np.vstack([np.column_stack([sign * np.eye(3), np.full(3, -0.5)]) for sign in (1.0, -1.0)])
    for k, seed in enumerate(seeds):
        other = np.delete(seeds, k, axis=0)
        normal = other - seed
        cell = HalfspaceIntersection(np.vstack([np.column_stack([normal, -0.5 * ((other**2).sum(1) - seed @ seed)]), box]), seed)
        corners = cell.intersections
        middle = corners.mean(axis=0)
        # A little smaller: pieces do not begin in touch.
        shape = ri.Shape.convex_hull(0.999 * (corners - middle))
        scene.add(ri.Body(f"shard {k}", shape, position=middle + [0, 0, 0.9], material=SOFT))
    return scene


def mixed() -> ri.Scene:
    """Thirty cylinders, capsules, hulls and gears fall into a box."""
    random = np.random.default_rng(6)
    teeth = [(ri.Shape.box((0.26, 0.05, 0.05)), (0, 0, 0), (np.cos(a), 0, 0, np.sin(a))) for a in np.arange(4) * np.pi / 8]
    gear = ri.Shape.compound([(ri.Shape.cylinder(0.1, 0.05), (0, 0, 0), (1, 0, 0, 0)), *teeth])
    hull = ri.Shape.convex_hull(random.normal(size=(24, 3)) * [0.07, 0.05, 0.05])
    return _drop(_walled(0.5, 2.0), [ri.Shape.cylinder(0.08, 0.15), ri.Shape.capsule(0.06, 0.12), hull, gear], 30, 0.33, 3)


def _ring(major: float, minor: float) -> ri.Shape:
    """A ring of 2,000 faces."""
    torus = trimesh.creation.torus(major, minor, major_sections=40, minor_sections=25)
    return ri.Shape.mesh(torus.vertices, torus.faces)


def concave_12() -> ri.Scene:
    """Twelve rings of 2,000 faces fall into a box."""
    return _drop(_walled(0.5, 3.0), [_ring(0.15, 0.05)], 12, 0.45, 2)


def concave_40() -> ri.Scene:
    """Forty of them."""
    return _drop(_walled(0.5, 6.0), [_ring(0.15, 0.05)], 40, 0.45, 2)


def rings() -> ri.Scene:
    """A chain of forty rings, held by contact alone, swings down onto a floor."""
    scene, ring = _ground(), _ring(0.05, 0.011)
    for k in range(40):
        turned = (1, 0, 0, 0) if k % 2 else (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
        motion = "dynamic" if k else "static"
        scene.add(ri.Body(f"ring {k}", ring, position=(0.077 * k, 0, 1.5), orientation=turned, motion=motion, material=HARD))
    return scene


def _in_parts(scene: ri.Scene, concavity: float) -> ri.Scene:
    """The scene with meshes cut into convex parts, as a user may do for "preview"."""
    cut: dict[bytes, ri.Shape] = {}
    for body in list(scene.bodies):
        if body.shape.kind == "mesh":
            if body.shape.key not in cut:
                cut[body.shape.key] = body.shape.convex_parts(concavity)
            scene[body.name] = replace(body, shape=cut[body.shape.key])
    return scene


def concave_12_parts() -> ri.Scene:
    """The twelve rings in convex parts."""
    return _in_parts(concave_12(), 0.05)


def concave_40_parts() -> ri.Scene:
    """The forty rings in convex parts."""
    return _in_parts(concave_40(), 0.05)


def rings_parts() -> ri.Scene:
    """The chain of rings in convex parts."""
    return _in_parts(rings(), 0.02)


def _doll(scene: ri.Scene, name: str, at: np.ndarray) -> None:
    """A doll of twelve bodies."""
    parts = {
        "pelvis": (0.0, 0.0, 0.2, 0.12, 0.12), "chest": (0.0, 0.26, 0.24, 0.16, 0.25), "head": (0.0, 0.5, 0.14, 0.14, 0.16),
        "left upper arm": (-0.2, 0.25, 0.08, 0.08, 0.25), "left lower arm": (-0.2, -0.03, 0.07, 0.07, 0.25),
        "right upper arm": (0.2, 0.25, 0.08, 0.08, 0.25), "right lower arm": (0.2, -0.03, 0.07, 0.07, 0.25),
        "left thigh": (-0.07, -0.26, 0.11, 0.11, 0.36), "left calf": (-0.07, -0.65, 0.09, 0.09, 0.36),
        "right thigh": (0.07, -0.26, 0.11, 0.11, 0.36), "right calf": (0.07, -0.65, 0.09, 0.09, 0.36), "hat": (0.0, 0.64, 0.1, 0.1, 0.05),
    }  # fmt: skip
    for part, (y, z, *size) in parts.items():
        shape = ri.Shape.box((size[1], size[0], size[2]))
        scene.add(ri.Body(f"{name} {part}", shape, position=at + [0, y, z], velocity=(1.5, 0, 0), material=SOFT))
    for a, b, y, z in (
        ("pelvis", "chest", 0, 0.1), ("chest", "head", 0, 0.4), ("head", "hat", 0, 0.6), ("chest", "left upper arm", -0.15, 0.36),
        ("chest", "right upper arm", 0.15, 0.36), ("pelvis", "left thigh", -0.07, -0.07), ("pelvis", "right thigh", 0.07, -0.07),
    ):  # fmt: skip
        scene.add(ri.BallJoint(f"{name} {a}", f"{name} {b}", at + [0, y, z]))
    for side, y in (("left", -0.2), ("right", 0.2)):
        scene.add(ri.HingeJoint(f"{name} {side} upper arm", f"{name} {side} lower arm", at + [0, y, 0.11], (0, 1, 0)))
        scene.add(ri.HingeJoint(f"{name} {side} thigh", f"{name} {side} calf", at + [0, 0.35 * y, -0.455], (0, 1, 0)))


def _stairs(dolls: int) -> ri.Scene:
    scene = _ground(SOFT)
    for k in range(4):
        size = (0.4, 1.5 * dolls, 0.2 * (4 - k))
        place = (0.4 * k, 0.75 * (dolls - 1), 0.1 * (4 - k))
        scene.add(ri.Body(f"step {k}", ri.Shape.box(size), position=place, motion="static", material=SOFT))
    for k in range(dolls):
        _doll(scene, f"doll {k}", np.array([0.0, 1.5 * k, 1.7 + 0.02 * k]))
    return scene


def doll() -> ri.Scene:
    """A doll of twelve bodies falls down stairs."""
    return _stairs(1)


def dolls_10() -> ri.Scene:
    """Ten of them."""
    return _stairs(10)


def gyroscope() -> ri.Scene:
    """A fast wheel on a pivot at the end of its axle."""
    scene = ri.Scene()
    turned = (np.sqrt(0.5), 0, np.sqrt(0.5), 0)
    spins = {"position": (0.1, 0, 1), "orientation": turned, "angular_velocity": (300, 0, 0)}
    scene.add(ri.Body("wheel", ri.Shape.cylinder(0.1, 0.02), mass=1.0, **spins))
    scene.add(ri.BallJoint("wheel", None, (0, 0, 1)))
    return scene


def pendulum() -> ri.Scene:
    """A rod on a hinge."""
    scene = ri.Scene()
    scene.add(ri.Body("rod", ri.Shape.box((1.0, 0.05, 0.05)), position=(0.5, 0, 2), mass=1.0))
    scene.add(ri.HingeJoint("rod", None, (0, 0, 2), (0, 1, 0)))
    return scene


def chain_100() -> ri.Scene:
    """A chain of a hundred links with a weight of a thousandfold mass at its end, at a slant."""
    scene, along = ri.Scene(), np.array([0.6, 0.0, -0.8])
    pose = {"orientation": (np.cos(0.4636476), 0, np.sin(0.4636476), 0)}
    for k in range(100):
        scene.add(ri.Body(f"link {k}", ri.Shape.box((0.09, 0.03, 0.03)), position=0.1 * (k + 0.5) * along, mass=0.1, **pose))
        scene.add(ri.BallJoint(f"link {k - 1}" if k else None, f"link {k}", 0.1 * k * along))
    scene.add(ri.Body("weight", ri.Shape.sphere(0.4), position=10.4 * along, mass=100.0))
    scene.add(ri.BallJoint("link 99", "weight", 10.0 * along))
    return scene


def dominoes() -> ri.Scene:
    """A ball runs into twelve dominoes."""
    scene = _ground()
    for k in range(12):
        scene.add(ri.Body(f"domino {k}", ri.Shape.box((0.01, 0.04, 0.08)), position=(0.04 * k, 0, 0.04), material=HARD))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.02), position=(-0.2, 0, 0.05), velocity=(2.0, 0, 0), material=HARD))
    return scene


SCENES: dict[str, tuple[Callable[[], ri.Scene], float]] = {
    "die": (die, 1.5), "dice": (dice, 2.0), "wall": (wall, 2.0), "shards": (shards, 2.0), "mixed": (mixed, 2.0),
    "concave_12": (concave_12, 1.5), "concave_40": (concave_40, 1.5), "rings": (rings, 1.0),
    "concave_12_parts": (concave_12_parts, 1.5), "concave_40_parts": (concave_40_parts, 1.5), "rings_parts": (rings_parts, 1.0),
    "doll": (doll, 2.0), "dolls_10": (dolls_10, 2.0), "gyroscope": (gyroscope, 2.0), "pendulum": (pendulum, 10.0),
    "chain_100": (chain_100, 2.0), "dominoes": (dominoes, 2.0),
}  # fmt: skip
"""Makers and durations, s."""


BY_PARTS = frozenset({"concave_12", "concave_40", "rings"})
"""Scenes of concave meshes, which other engines are given in convex parts."""


class Poses(NamedTuple):
    """Body origins (f, n, 3) m and orientations (f, n, 4) at frames, by whatever moved the bodies."""

    position: np.ndarray
    orientation: np.ndarray


def widest_gap(scene: ri.Scene, poses: Poses) -> float:
    """How far the anchors of a joint are apart at most, m; 0 without joints."""
    widest, place = 0.0, {body.name: k for k, body in enumerate(scene.bodies)}
    for joint in scene.effects:
        anchor, ends = getattr(joint, "anchor", None), []
        if anchor is None:
            continue
        for name in (joint.a, joint.b):
            if name is None:
                ends.append(np.broadcast_to(np.asarray(anchor, float), (len(poses.position), 3)))
                continue
            body, k = scene.bodies[place[name]], place[name]
            inverse = np.asarray(body.orientation, float) * [1, -1, -1, -1]
            own = rotate(inverse, np.asarray(anchor, float) - body.position)
            ends.append(poses.position[:, k] + np.array([rotate(q, own) for q in poses.orientation[:, k]]))
        widest = max(widest, float(np.linalg.norm(ends[0] - ends[1], axis=1).max()))
    return widest


def deepest(record: RunRecord) -> float:
    """How deep bodies are inside each other at most, of the size of the smaller one."""
    depths = overlap_depths(record)
    return float((depths.depth / depths.size).max(initial=0.0))


def measured(name: str, preset: str) -> tuple[Line, RunRecord]:
    """Run a scene at a preset and measure it."""
    make, duration = SCENES[name]
    scene = make()
    start = process_time()
    run = ri.simulate(scene, duration, accuracy=preset)
    seconds, record = (process_time() - start) / duration, record_of_recording(run)
    total = run.ledger.kinetic + run.ledger.potential
    gain = float((total - np.minimum.accumulate(total)).max() / max(float(run.ledger.kinetic.max()), 1e-300))
    gap = widest_gap(scene, Poses(run.positions, run.orientations))
    return Line(name, preset, seconds, deepest(record), gap, gain, run.status.message.splitlines()[0]), record


def others(name: str, record: RunRecord, engines: tuple[str, ...]) -> list[Line]:
    """The same scene in other engines; record: of a run here, whose frames tell where to look."""
    make, duration = SCENES[name]
    scene, out = make(), []
    answers = run_engines(scene, PEER_STEP, round(duration / PEER_STEP), names=engines, each=PEER_STEPS)
    for engine, answer in answers.items():
        if isinstance(answer, str):
            out.append(Line(name, engine, np.nan, np.nan, np.nan, np.nan, answer))
            continue
        depth, gap = _errors(scene, record, answer)
        out.append(Line(name, engine, 1e-3 * float(answer.times.sum()) / duration, depth, gap, np.nan, ""))
    return out


def _errors(scene: ri.Scene, record: RunRecord, answer: EngineRun) -> tuple[float, float]:
    """Depth and gap of what an engine did, as ours are measured."""
    start = np.array([body.position for body in scene.bodies], float), np.array([body.unit_orientation() for body in scene.bodies])
    position, orientation = (np.concatenate([a[None], b]) for a, b in zip(start, (answer.position, answer.orientation), strict=True))
    centre = position + rotate(orientation, record.world.offset)
    frames = record.frames._replace(position=centre, orientation=multiply(orientation, record.world.turn))
    return deepest(replace(record, frames=frames)), widest_gap(scene, Poses(position, orientation))


def show(lines: list[Line]) -> Line:
    """The line of a scene at a preset over all rounds, printed: the median of times, the worst of all else."""
    depth, gap, gain = (max(line[k] for line in lines) for k in (3, 4, 5))
    line = Line(lines[0].scene, lines[0].what, median(line.seconds for line in lines), depth, gap, gain, lines[-1].status)
    numbers = f"{line.seconds:9.4f} s/s  depth {line.depth:8.1e}  gap {line.gap:8.1e} m  gain {line.gain:8.1e}"
    print(f"{line.scene:11} {line.what:9} {numbers}  {line.status}", flush=True)
    return line


def main() -> None:
    """Measure, print, save if asked to."""
    parser = argparse.ArgumentParser(description="From one body to two hundred: what each preset costs.")
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(SCENES)}; all if none is given")
    parser.add_argument("--presets", default="standard,preview")
    parser.add_argument("--engines", default=",".join(ENGINES), help="others to run; none: ''")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--save", action="store_true", help="write docs/results/data/middle.csv")
    options = parser.parse_args()
    use_cores(1)
    print(machine())
    lines = []
    for warm in (die, doll, gyroscope):
        for preset in options.presets.split(","):
            ri.simulate(warm(), 1.0, accuracy=preset)
    for name in options.scenes or SCENES:
        rounds: dict[str, list[Line]] = {}
        for _ in range(options.rounds):
            here = [measured(name, preset) for preset in options.presets.split(",")]
            found = [line for line, _ in here]
            if options.engines and name not in BY_PARTS:
                found += others(name, here[0][1], tuple(options.engines.split(",")))
            for line in found:
                rounds.setdefault(line.what, []).append(line)
        lines += [show(of_one) for of_one in rounds.values()]
    if options.save:
        path = DATA / "middle.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([("about", *Line._fields), *((_about(line.scene), *line) for line in lines)])
        note(path, f"python tests/bench/middle.py --rounds {options.rounds} --save")


def _about(name: str) -> str:
    """The sentence that says what a scene shows."""
    return (SCENES[name][0].__doc__ or "").splitlines()[0]


if __name__ == "__main__":
    main()
