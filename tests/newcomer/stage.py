"""A newcomer's stage: scenes are written by hand, and what is seen is checked from outside.

Positions are rounded to float32, as files have them. Every body has a trimesh mesh of its own beside the shape that the library gets;
overlap is measured with these meshes: how deep points on the surface of one body are inside another one.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

import rigidimpulse as ri

DEPTH = 1e-3
"""Deepest overlap, of the size of the smaller body, that no one sees."""
FRAMES = 12
"""Frames at which overlap is measured."""
See = Callable[[ri.Recording], list[str]]


def rounded(values) -> tuple[float, ...]:
    """The values as float32 has them."""
    return tuple(float(x) for x in np.asarray(values, np.float32))


def turn(axis, angle: float) -> tuple[float, ...]:
    """The quaternion (w, x, y, z) of a turn by `angle` rad about an axis."""
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    return (float(np.cos(0.5 * angle)), *(np.sin(0.5 * angle) * unit))


class Stage:
    """A scene in the making, and the meshes of its bodies in body frames.

    Attributes:
        scene: what is simulated. meshes: of bodies, by name; a floor has none. floors: names of half spaces with z <= 0.
        joined: pairs of names whose overlap does not count: a joint joins them.

    """

    def __init__(self) -> None:
        """An empty stage."""
        self.scene = ri.Scene()
        self.meshes: dict[str, trimesh.Trimesh] = {}
        self.moves: dict[str, bool] = {}
        self.floors: list[str] = []
        self.joined: set[frozenset[str | None]] = set()

    def floor(self, name: str = "floor", **more) -> None:
        """The floor at z = 0."""
        self.scene.add(ri.Body(name, ri.Shape.half_space(), motion="static", **more))
        self.floors.append(name)

    def box(self, name: str, size, position, **more) -> None:
        """A box."""
        self._add(name, ri.Shape.box(rounded(size)), trimesh.creation.box(rounded(size)), position, more)

    def ball(self, name: str, radius: float, position, **more) -> None:
        """A ball."""
        self._add(name, ri.Shape.sphere(radius), trimesh.creation.icosphere(3, radius), position, more)

    def rod(self, name: str, radius: float, height: float, position, **more) -> None:
        """A cylinder along its own z axis."""
        mesh = trimesh.creation.cylinder(radius, height, sections=32)
        self._add(name, ri.Shape.cylinder(radius, height), mesh, position, more)

    def capsule(self, name: str, radius: float, height: float, position, **more) -> None:
        """A capsule along its own z axis."""
        mesh = trimesh.creation.capsule(height, radius, count=[16, 16])
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        self._add(name, ri.Shape.capsule(radius, height), mesh, position, more)

    def mesh(self, name: str, mesh: trimesh.Trimesh, position, **more) -> None:
        """A mesh, by way of an OBJ file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name.replace(' ', '_')}.obj"
            mesh.export(path)
            self._add(name, ri.Shape.from_file(str(path)), mesh, position, more)

    def _add(self, name: str, shape: ri.Shape, mesh: trimesh.Trimesh, position, more: dict) -> None:
        self.scene.add(ri.Body(name, shape, position=rounded(position), **more))
        self.meshes[name] = mesh
        self.moves[name] = more.get("motion", "dynamic") == "dynamic"

    def join(self, joint) -> None:
        """A joint; the bodies that it joins may overlap."""
        self.scene.add(joint)
        self.joined.add(frozenset((joint.a, joint.b)))


@dataclass(frozen=True)
class Newcomer:
    """A scene of the corpus: its stage, what must be seen in a run of it, and how long it is [s]."""

    name: str
    make: Callable[[], tuple[Stage, See]]
    duration: float


CORPUS: dict[str, Newcomer] = {}
"""All scenes, by name."""


def newcomer(duration: float):
    """Put a function that makes a stage and says what is seen into the corpus."""

    def put(make: Callable[[], tuple[Stage, See]]):
        CORPUS[make.__name__] = Newcomer(make.__name__, make, duration)
        return make

    return put


@dataclass
class Seen:
    """What a run of a scene of the corpus showed.

    Attributes:
        missed: what must be seen and is not, a line each. status: message of the run.
        cost: s of processor time for a second of motion. depth: deepest overlap, of the size of the smaller body.

    """

    missed: list[str]
    status: str
    cost: float
    depth: float
    where: str = ""
    run: ri.Recording | None = field(default=None, repr=False)


def look(case: Newcomer, most: float = np.inf) -> Seen:
    """Run a scene at defaults and look at it; one that takes more than `most` s of processor time is given up at the end of a step."""
    stage, see = case.make()
    begin = time.process_time()

    def give_up(reached: float) -> None:
        if time.process_time() - begin > most:
            raise TimeoutError(f"more than {most} s, at {reached:.3f} s of {case.duration} s")

    try:
        run = ri.simulate(stage.scene, case.duration, progress=None if np.isinf(most) else give_up)
    except TimeoutError as error:
        return Seen([str(error)], str(error), most / case.duration, np.nan)
    cost = (time.process_time() - begin) / case.duration
    depth, where = deepest_overlap(stage, run)
    missed = see(run)
    if not run.status.ok:
        missed.append(f"status: {run.status.message}")
    if depth > DEPTH:
        missed.append(f"{where}: {depth:.1e} of the size inside")
    return Seen(missed, run.status.message, cost, depth, where, run)


def deepest_overlap(stage: Stage, run: ri.Recording) -> tuple[float, str]:
    """How deep one body is inside another, of the size of the smaller one, at some frames; and which, where and when."""
    worst, where = 0.0, ""
    fine = {name: _fine_points(mesh) for name, mesh in stage.meshes.items()}
    for f in np.unique(np.linspace(0, len(run.times) - 1, FRAMES).astype(int)):
        pose = {name: _matrix(run, name, f) for name in stage.meshes}
        points = {name: fine[name] @ p[:3, :3].T + p[:3, 3] for name, p in pose.items()}
        box = {name: (p.min(axis=0), p.max(axis=0)) for name, p in points.items()}
        for a, mesh in stage.meshes.items():
            size = float(mesh.extents.max())
            if stage.floors and stage.moves[a] and (depth := -float(box[a][0][2]) / size) > worst:
                worst, where = depth, f"{a} in the floor at {run.times[f]:.3f} s"
            for b, other in stage.meshes.items():
                if a == b or not (stage.moves[a] or stage.moves[b]) or frozenset((a, b)) in stage.joined:
                    continue
                if np.any(box[a][0] > box[b][1]) or np.any(box[b][0] > box[a][1]):
                    continue
                near = points[a][np.all((points[a] >= box[b][0]) & (points[a] <= box[b][1]), axis=1)]
                local = (near - pose[b][:3, 3]) @ pose[b][:3, :3]
                depth = _depth(other, local) / min(size, float(other.extents.max()))
                if depth > worst:
                    worst, where = depth, f"{a} in {b} at {run.times[f]:.3f} s"
    return worst, where


def _fine_points(mesh: trimesh.Trimesh) -> np.ndarray:
    """Points on the surface of a mesh: its corners, and those of its faces cut in four, twice."""
    return mesh.vertices if len(mesh.vertices) > 100 else mesh.subdivide().subdivide().vertices


def _matrix(run: ri.Recording, name: str, frame: int) -> np.ndarray:
    pose = trimesh.transformations.quaternion_matrix(run.orientation(name)[frame])
    pose[:3, 3] = run.position(name)[frame]
    return pose


def _depth(mesh: trimesh.Trimesh, points: np.ndarray) -> float:
    """How deep the deepest of some points (k, 3) is inside a mesh, m."""
    if not len(points):
        return 0.0
    if mesh.is_convex:
        heights = points @ mesh.face_normals.T - np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0])
        return max(0.0, -float(heights.max(axis=1).min()))
    inside = points[_winding(mesh, points) > 0.5]
    if not len(inside):
        return 0.0
    triangles, repeated = np.tile(mesh.triangles, (len(inside), 1, 1)), np.repeat(inside, len(mesh.faces), axis=0)
    nearest = np.linalg.norm(trimesh.triangles.closest_point(triangles, repeated) - repeated, axis=1)
    return float(nearest.reshape(len(inside), -1).min(axis=1).max())


def _winding(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Winding numbers (k,) of a closed mesh about points: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    a, b, c = (mesh.triangles[None, :, i] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    volume = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ijk,ijk->ij", x, y) for x, y in ((a, b), (b, c), (c, a)))
    return np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb).sum(axis=1) / (2.0 * np.pi)


def must(*seen: tuple[bool, str]) -> list[str]:
    """The lines of those things that are not seen."""
    return [line for is_seen, line in seen if not is_seen]


def tilt(run: ri.Recording, name: str, frame: int = -1) -> float:
    """Angle [rad] between a body's own z axis and the one of the world."""
    _, x, y, _ = run.orientation(name)[frame]
    return float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)))


def way(run: ri.Recording, name: str) -> float:
    """How far a body is from where it was, m."""
    return float(np.linalg.norm(run.position(name)[-1] - run.position(name)[0]))


def height(run: ri.Recording, name: str, frame: int = -1) -> float:
    """Height of a body's origin, m."""
    return float(run.position(name)[frame, 2])


def speed(run: ri.Recording, name: str) -> float:
    """Speed at the end, m/s."""
    return float(np.linalg.norm(run.velocity(name)[-1]))
