"""Own manifolds against FCL: the first impact of each pair of meshes in a scene, with either narrow phase.

Both runs start alike. So the first impact of two bodies happens at one time and place, unless something before it went another way.
Compared are its time, the contacts at its instant, and the impulse

    J = sum over its contact points of (j n + tangent impulse)

Besides it is measured what FCL's collision gives by itself, with one body DEEP of the size inside the other, as a loop without backing up
leaves them. A point counts as a ghost if no own contact is within 2 DEEP of the size and 1 degree of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidimpulse.collision.distance.fcl_trees import TriangleTrees
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import multiply, rotate, to_matrix
from rigidimpulse.engine.begin import make_plan, make_run
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.narrow_phase import OwnContacts, mesh_bodies, why_not_fcl
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.pair_table import MARGIN, append_pairs, pair_bodies
from rigidimpulse.engine.participants import NarrowPhase
from rigidimpulse.engine.run import Run, start_trajectories
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy, resolve_accuracy
from rigidimpulse.scene.scene import Scene

DEEP = 1e-4
"""How far one body is moved into the other, over the size of the smaller one."""
ALIKE = np.cos(np.radians(1.0))
"""Cosine of the angle of normals that are one."""
SAME_PLACE, SAME_NORMAL = 1e-6, 1e-6
"""Distance over the size of the smaller body, and angle of normals (rad), of contacts that are one."""
INSTANT = 1.0
"""s, of a step in which nothing happens."""
ONE_IMPACT = 1e-9
"""s, within which impulses of a pair are one impact."""


@dataclass(frozen=True)
class FirstImpact:
    """The first impact of two bodies with own manifolds, and what is different with FCL's.

    Attributes:
        bodies: their names.
        time: s. later: s, of FCL's less that.
        place: distance of the centres of the impulses over the size of the smaller body. turn: rad, angle of the mean normals.
        impulse: |J_fcl - J_own| / |J_own|.
        own, fcl, common: contacts at the instant of impact, and those that both have.
        raw, ghosts: points of FCL's collision alone, and those that are no contact.

    """

    bodies: tuple[str, str]
    time: float
    later: float
    place: float
    turn: float
    impulse: float
    own: int
    fcl: int
    common: int
    raw: int
    ghosts: int


@dataclass(frozen=True, eq=False)
class NarrowPhases:
    """Two runs of one scene, one with each narrow phase.

    Attributes:
        run_own, run_fcl: the runs.
        first_impacts: of the pairs of meshes that meet in both runs, by time.
        only_own, only_fcl: pairs that meet in one of the runs only.

    """

    run_own: Recording
    run_fcl: Recording
    first_impacts: list[FirstImpact]
    only_own: list[tuple[str, str]] = field(default_factory=list)
    only_fcl: list[tuple[str, str]] = field(default_factory=list)

    def table(self) -> str:
        """A text table, a line for each pair."""
        head = ("bodies", "time, s", "later, s", "place", "turn, rad", "impulse", "contacts", "of FCL", "common", "raw", "ghosts")
        rows: list[tuple[str, ...]] = [head]
        for impact in self.first_impacts:
            numbers = (f"{value:.1e}" for value in (impact.later, impact.place, impact.turn, impact.impulse))
            counts = map(str, (impact.own, impact.fcl, impact.common, impact.raw, impact.ghosts))
            rows.append((" ".join(impact.bodies), f"{impact.time:.6g}", *numbers, *counts))
        widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
        return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows)


def compare_narrow_phases(scene: Scene, duration: float, fps: float = 60.0, accuracy: str | Accuracy = "standard") -> NarrowPhases:
    """Run a scene with own manifolds and with FCL's, and compare the first impact of each pair of meshes.

    Args:
        scene: with at least two meshes that may meet.
        duration: s.
        fps: frames of both recordings.
        accuracy: of both runs; its narrow_phase is not read.

    Raises:
        SceneError: no two meshes may meet, or the accuracy is one that FCL's gaps cannot have.

    """
    settings = resolve_accuracy(accuracy)
    own, fcl = (Accuracy(**{**settings.model_dump(), "narrow_phase": kind}) for kind in ("exact", "fcl"))
    reason = why_not_fcl(compile_scene(scene, fcl))
    if reason:
        raise SceneError(reason, "compare narrow phases of a scene in which two meshes, boxes or hulls may meet")
    run_own, run_fcl = (simulate_whole(scene, duration, fps, accuracy=accuracy) for accuracy in (own, fcl))
    begins_own, begins_fcl = _first_impacts(run_own), _first_impacts(run_fcl)
    meshes = _Instant(scene, fcl)
    impacts = [
        meshes.compare(pair, run_own.impacts[begins_own[pair]], run_fcl.impacts[begins_fcl[pair]])
        for pair in begins_own if pair in begins_fcl and meshes.are_fcls(pair)
    ]  # fmt: skip
    lonely = [
        [_names(run_own, pair) for pair in one if pair not in other and meshes.are_fcls(pair)]
        for one, other in ((begins_own, begins_fcl), (begins_fcl, begins_own))
    ]
    return NarrowPhases(run_own, run_fcl, impacts, *lonely)


def _names(run: Recording, pair: tuple[int, int]) -> tuple[str, str]:
    return run.names[pair[0]], run.names[pair[1]]


def _first_impacts(run: Recording) -> dict[tuple[int, int], np.ndarray]:
    """Rows of the first impact of each pair of bodies, in the order of their times."""
    first: dict[tuple[int, int], list[int]] = {}
    for k, impact in enumerate(run.impacts):
        rows = first.setdefault((int(impact["body_a"]), int(impact["body_b"])), [])
        if not rows or impact["time"] - run.impacts["time"][rows[0]] <= ONE_IMPACT:
            rows.append(k)
    return {pair: np.array(rows) for pair, rows in first.items()}


class _Instant:
    """The bodies of a scene at an instant, for both narrow phases."""

    def __init__(self, scene: Scene, accuracy: Accuracy) -> None:
        """accuracy: with FCL's contacts."""
        self._scene, self._accuracy = scene, accuracy
        self._world = compile_scene(scene, accuracy)
        self._is_mesh = mesh_bodies(self._world)

    def are_fcls(self, pair: tuple[int, int]) -> bool:
        """Whether both bodies are meshes."""
        return bool(self._is_mesh[list(pair)].all())

    def compare(self, pair: tuple[int, int], own: np.ndarray, fcl: np.ndarray) -> FirstImpact:
        """The first impact of two bodies; own, fcl: its rows of impulses."""
        run = self._at(float(own["time"][0]))
        contacts, others = (self._contacts(run, pair, by) for by in (OwnContacts(), run.narrow_phase))
        near, alike = SAME_PLACE * self._size(pair), float(np.cos(SAME_NORMAL))
        common = sum(_is_among(point, normal, others, near, alike) for point, normal in zip(*contacts, strict=True))
        raw = self._raw(run, pair, contacts)
        impulse, other = _impulse(own), _impulse(fcl)
        return FirstImpact(
            bodies=(self._world.names[pair[0]], self._world.names[pair[1]]),
            time=float(own["time"][0]),
            later=float(fcl["time"][0] - own["time"][0]),
            place=float(np.linalg.norm(_centre(fcl) - _centre(own))) / self._size(pair),
            turn=float(np.arcsin(min(1.0, np.linalg.norm(np.cross(_direction(own), _direction(fcl)))))),
            impulse=float(np.linalg.norm(other - impulse) / np.linalg.norm(impulse)),
            own=len(contacts[0]),
            fcl=len(others[0]),
            common=common,
            raw=raw[0],
            ghosts=raw[1],
        )

    def _size(self, pair: tuple[int, int]) -> float:
        return float(self._world.size[list(pair)].min())

    def _at(self, time: float) -> Run:
        """A run that stands at an instant."""
        world = compile_scene(self._scene, self._accuracy)
        if time > 0.0:
            own = Accuracy(**{**self._accuracy.model_dump(), "narrow_phase": "exact"})
            until = simulate_whole(self._scene, time, 1.0 / time, accuracy=own)
            world.position = until.positions[-1] + rotate(until.orientations[-1], world.offset)
            world.orientation = multiply(until.orientations[-1], world.turn)
        run = make_run(world, make_plan(world), Recorder(np.array([0.0]), world.num_bodies), EventLog())
        start_trajectories(run)
        run.state.now.position[:] = world.position
        run.state.rotation[:] = [to_matrix(q) for q in world.orientation]
        return run

    def _contacts(self, run: Run, pair: tuple[int, int], by: NarrowPhase) -> tuple[np.ndarray, np.ndarray]:
        """Points on a (k, 3) m and normals (k, 3) of the contacts within the margin."""
        table = PairEvents(run, INSTANT).table
        a, b = min(pair), max(pair)
        append_pairs(pair_bodies(run.world), run.world.margins, table, np.array([a]), np.array([b]), 0.0)
        count = -1
        while count < 0:
            count = by.contacts_at(run, table, np.array([0]), MARGIN, 0)
            if count < 0:
                run.finder.grow(-count)
        real = run.finder.found.buffers.real[:count]
        return real[:, :3].copy(), real[:, 6:9].copy()

    def _raw(self, run: Run, pair: tuple[int, int], contacts: tuple[np.ndarray, np.ndarray]) -> tuple[int, int]:
        """How many points FCL's collision gives with b moved in along the first normal, and how many are no contacts."""
        if not len(contacts[0]):
            return 0, 0
        (a, b), way = pair, DEEP * self._size(pair)
        shapes, position, rotation = run.world.shape_of_body, run.state.now.position, run.state.rotation
        between = position[b] - way * contacts[1][0] - position[a]
        trees = TriangleTrees(run.world.shapes, run.world.geometry)
        points, normals = trees.raw_contacts(int(shapes[a]), int(shapes[b]), rotation[a].T @ rotation[b], rotation[a].T @ between)
        points, normals = points @ rotation[a].T + position[a], normals @ rotation[a].T
        real = sum(_is_among(point, normal, contacts, 2.0 * way, ALIKE) for point, normal in zip(points, normals, strict=True))
        return len(points), len(points) - int(real)


def _is_among(point: np.ndarray, normal: np.ndarray, contacts: tuple[np.ndarray, np.ndarray], near: float, cosine: float) -> bool:
    """Whether a contact is among others, (k, 3) m and (k, 3): within `near` m, with a normal of this cosine."""
    points, normals = contacts
    return bool(np.any((np.linalg.norm(points - point, axis=1) <= near) & (normals @ normal >= cosine)))


def _impulse(rows: np.ndarray) -> np.ndarray:
    """Impulse (3,) N s on b of an impact's rows."""
    return (rows["impulse"][:, None] * rows["normal"] + rows["tangent_impulse"]).sum(axis=0)


def _direction(rows: np.ndarray) -> np.ndarray:
    """Unit direction (3,) of the normal impulse."""
    total = (rows["impulse"][:, None] * rows["normal"]).sum(axis=0)
    return total / np.linalg.norm(total)


def _centre(rows: np.ndarray) -> np.ndarray:
    """Where the normal impulse acts (3,) m."""
    return (rows["impulse"][:, None] * rows["point"]).sum(axis=0) / rows["impulse"].sum()
