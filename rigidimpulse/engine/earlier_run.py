"""What a run of a changed scene takes over from the run before the change, in whose middle it begins.

The earlier run stands between two steps, at the time T of a frame. From T on the scene is the changed one. A body of both scenes

    begins again    at T, with the pose and the velocity that it has then, where the change acts: on the body itself, its joints, its
                    forces, or on what it touches at T, directly or through other bodies that can move; and where more than states of
                    bodies goes on from step to step: in sub-stepped islands, at joints, under forces that vary
    is carried on   everywhere else: its trajectory, the forces of its lasting contacts and its rebounds go on to the last bit

Joints and forces that are new are fastened to bodies where these are at T: their anchors are places in the world at T. Those of both scenes
stay fastened where they were, whatever else of them changes.

What a scene says of the start of a body (pose, velocities) counts for bodies that are new at T, and where the change is in just that: a
body that is given another position is there from T on.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import build_geometry
from rigidimpulse.core.content_digest import digest_of
from rigidimpulse.core.quaternion import multiply, rotate
from rigidimpulse.core.union_find import roots
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.soft_body.body import FlexibleBody
from rigidimpulse.engine.compile_scene import compile_forces, varying_forces
from rigidimpulse.engine.compile_shapes import world_boxes
from rigidimpulse.engine.run import Run, start_bodies
from rigidimpulse.model.contact_memory import carried_memory, held_pairs
from rigidimpulse.model.joint_table import compile_joints
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import LINEAR, PRESCRIBED, pose_at
from rigidimpulse.recording.recorder import Frames
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.fastening import fastening

STARTS = ("position", "orientation", "velocity", "angular_velocity")
"""What a scene says of the start of a body."""


class _Both(NamedTuple):
    """Bodies (k,) of both scenes: their indices in the earlier run, and in this one."""

    old: np.ndarray
    new: np.ndarray

    def index(self, number: int) -> np.ndarray:
        """Index in this run of each of `number` bodies of the earlier one, -1 for those that are gone."""
        index = np.full(number, -1, np.int64)
        index[self.old] = self.new
        return index


class EarlierRun:
    """A run between two steps, and what its end there would be.

    Attributes:
        run: the run; it is read only. state: (n, ...) of its bodies if it ended there.

    """

    def __init__(self, run: Run, state: Frames, before: EarlierRun | None = None) -> None:
        """state: of one frame, at the time of the run: velocities at the end of the sub-steps under way; before: where it began itself."""
        self.run, self.state, self._before = run, state, before
        self._known = {fastening(effect) for effect in run.world.scene.effects}

    def placed(self, world: World) -> World:
        """The world of the changed scene with its bodies where they are now."""
        placed = self._posed(self._with_known_shapes(world, self._both(world)))
        low, high = world_boxes(placed.geometry, placed.shape_of_body, placed.position, placed.orientation)
        placed.static_min[:], placed.static_max[:] = low, high
        self._fasten(world, placed)
        return placed

    def _posed(self, world: World) -> World:
        """A world with its bodies where those of the earlier run are, and with their velocities."""
        both, earlier = self._both(world), self.run.world
        starts = {name: getattr(world, name).copy() for name in STARTS}
        position, orientation, velocity, angular_velocity = starts.values()
        for i, j in zip(both.old.tolist(), both.new.tolist(), strict=True):
            before, now = earlier.scene.bodies[i], world.scene.bodies[j]
            stays = {name: digest_of(getattr(before, name)) == digest_of(getattr(now, name)) for name in STARTS}
            origin, turn = earlier.body_pose(i, self.state.position[0, i], self.state.orientation[0, i])
            origin = origin if stays["position"] else np.array(now.position, float)
            turn = turn if stays["orientation"] else now.unit_orientation()
            position[j], orientation[j] = origin + rotate(turn, world.offset[j]), multiply(turn, world.turn[j])
            if not (now.motion == "dynamic" or _is_due(now, self.run.state.time)):
                continue  # it moves as the scene says
            v, w = self.state.velocity[0, i], self.state.angular_velocity[0, i]
            if stays["angular_velocity"]:
                angular_velocity[j] = w
            if stays["velocity"]:
                # The velocity is that of the centre of mass, which may be elsewhere in the body now.
                velocity[j] = v + cross_arrays(w, position[j] - self.state.position[0, i]) if stays["position"] else v
        return replace(world, **starts, static_min=world.static_min.copy(), static_max=world.static_max.copy())

    def _fasten(self, world: World, placed: World) -> None:
        """Fasten joints and forces of the placed world where they belong; world: with bodies where they start."""
        links: dict[EarlierRun | None, World] = {None: world, self: placed}

        def where(effect: Any) -> World:
            link = self._fastened_at(fastening(effect))
            if link is not None and link not in links:
                links[link] = link._posed(world)
            return links[link]

        joints, forces = placed.joints_of_scene, varying_forces(world)
        places = [where(joint) for joint in joints]
        for other in {id(place): place for place in places if place is not world}.values():
            these = np.array([place is other for place in places])
            now, changed = compile_joints(joints, other), placed.joints._asdict()
            for name in ("anchor_a", "anchor_b", "frame_a", "frame_b"):
                changed[name] = np.where(these.reshape(-1, *[1] * (changed[name].ndim - 1)), getattr(now, name), changed[name])
            placed.joints = type(now)(**changed)
        by_place: dict[int, tuple[World, list[Any]]] = {}
        for force in forces:
            at = world if isinstance(force, FlexibleBody) else where(force)
            by_place.setdefault(id(at), (at, []))[1].append(force)
        if len(by_place) > 1 or id(world) not in by_place:
            placed.force_tables = compile_forces(world, list(by_place.values()))

    def _fastened_at(self, key: tuple[type, str]) -> EarlierRun | None:
        """The run at whose end an effect was fastened, None for the start."""
        if key not in self._known:
            return self
        return None if self._before is None else self._before._fastened_at(key)

    def _with_known_shapes(self, world: World, both: _Both) -> World:
        """The world with the shapes of the earlier run, and its own behind them: contacts are known by the numbers of corners and edges."""
        earlier, stays = self.run.world, ~_other_bodies(self.run.world, world, both)
        old, new = both.old[stays], both.new[stays]
        shape_of_body, size, radius = world.shape_of_body.copy(), world.size.copy(), world.bound_radius.copy()
        own = np.delete(np.arange(world.num_bodies), new)
        which, place = np.unique(shape_of_body[own], return_inverse=True)
        shapes = [*earlier.shapes, *(world.shapes[k] for k in which.tolist())]
        shape_of_body[own] = len(earlier.shapes) + place
        shape_of_body[new], size[new], radius[new] = earlier.shape_of_body[old], earlier.size[old], earlier.bound_radius[old]
        geometry = build_geometry(shapes)
        return replace(world, shapes=shapes, geometry=geometry, shape_of_body=shape_of_body, size=size, bound_radius=radius)

    @staticmethod
    def follow_keyframes(run: Run) -> None:
        """Put bodies with keyframes where they are at the start of a run of the placed world, and let those go whose time has come."""
        world, trajectory, time = run.world, run.state.trajectory, run.state.time
        waiting = ~world.dynamic
        run.keyframes.start_segments(run, time)
        run.log.forget()  # what was let go before is in the ledger of the earlier run
        let_go = np.flatnonzero(waiting & world.dynamic)
        start_bodies(run, let_go)
        for i in np.flatnonzero(trajectory.mode == PRESCRIBED).tolist():
            pose_at(trajectory, i, time, world.position[i], world.orientation[i])

    def carry_on(self, run: Run) -> None:
        """Let the bodies of a run of the placed world that the change does not reach go on as they were."""
        time, earlier, number = run.state.time, self.run, self.run.world.num_bodies
        both = self._both(run.world)
        again = self._begin_again(run, both)
        index = both.index(number)
        carried = (index >= 0) & ~again
        rows = _Both(np.flatnonzero(carried), index[carried])
        _carry_state(earlier, run, rows)
        # Their first frame is on the paths that they have now: the last bits of a place depend on where a path began.
        run.recorder.written[rows.new] = 0
        run.state.memory = carried_memory(earlier.state.memory, index, carried, run.world.num_bodies)
        run.contact_log.carry_on(earlier.contact_log, np.where(carried, index, -1), time)
        run.substepped.carry_on(earlier.substepped, *rows)
        run.joints.carry_on(run, earlier)
        run.forces.carry_on(earlier)
        run.soft_bodies.carry_on(run, earlier)

    def _both(self, world: World) -> _Both:
        """The bodies of both scenes, by their names."""
        index = {name: j for j, name in enumerate(world.names)}
        old = np.array([i for i, name in enumerate(self.run.world.names) if name in index], np.int64)
        return _Both(old, np.array([index[self.run.world.names[i]] for i in old.tolist()], np.int64))

    def _begin_again(self, run: Run, both: _Both) -> np.ndarray:
        """Which bodies (n,) bool of the earlier run the change acts on at its instant, or that cannot be carried on."""
        earlier, number = self.run, self.run.world.num_bodies
        again = np.zeros(number, bool)
        again[np.setdiff1d(np.arange(number), both.old)] = True  # what is gone held others
        again[both.old] = _changed(earlier, run, both) | _moved(run)[both.new]
        if not np.all(np.diff(both.new) > 0):
            again |= earlier.state.under_contact  # contacts have a first and a second body, by their order
        again |= (earlier.substepped.label >= 0) | (earlier.state.trajectory.mode == LINEAR) | earlier.forces.acts
        again[both.old] |= run.forces.acts[both.new]
        for joints, indices in ((earlier.world.joints, None), (run.world.joints, both)):
            if joints is not None:
                ends = _ends(joints.body_a, joints.body_b, indices)
                again[ends[earlier.world.dynamic[ends]]] = True  # what stands at a joint holds others, too
        links = [held_pairs(earlier.state.memory, earlier.state.trajectory.start), earlier.contact_log.lasting_pairs()]
        links += [earlier.joints.links(), earlier.forces.links()]
        return _reached(again, np.concatenate(links), earlier.world.dynamic)


def _is_due(body: Body, time: float) -> bool:
    """Whether a body that is carried first has been let go at `time` [s]."""
    return body.release_time is not None and body.release_time <= time


def _ends(first: np.ndarray, second: np.ndarray, both: _Both | None) -> np.ndarray:
    """Bodies of joints, as indices of the earlier run; both: given where they are those of this run."""
    ends = np.unique(np.concatenate([first, second]))
    return ends[ends >= 0] if both is None else both.old[np.isin(both.new, ends)]


def _changed(earlier: Run, run: Run, both: _Both) -> np.ndarray:
    """Which bodies (k,) bool of both scenes are another than before, or fall otherwise."""
    before, now = earlier.world, run.world
    if before.accuracy != now.accuracy or before.left_out != now.left_out:
        return np.ones(len(both.old), bool)
    return _other_bodies(before, now, both) | np.any(before.steady_acceleration[both.old] != now.steady_acceleration[both.new], axis=1)


def _moved(run: Run) -> np.ndarray:
    """Which bodies (n,) bool of a run at its start are not where its scene has them: they were moved apart."""
    return run.world.dynamic & np.any(run.state.trajectory.position != run.world.position, axis=1)


def _other_bodies(before: World, now: World, both: _Both) -> np.ndarray:
    """Which bodies (k,) bool of both scenes are written in another way than before."""
    bodies = [(before.scene.bodies[i], now.scene.bodies[j]) for i, j in zip(both.old.tolist(), both.new.tolist(), strict=True)]
    return np.array([a is not b and digest_of(a) != digest_of(b) for a, b in bodies], bool)


def _reached(seeds: np.ndarray, links: np.ndarray, dynamic: np.ndarray) -> np.ndarray:
    """Seeds (n,) bool, and all that hangs together with them by links (l, 2) over bodies that can move."""
    links = links[np.all(links >= 0, axis=1)]
    seeds = seeds.copy()
    touched = links[seeds[links].any(axis=1)]
    seeds[touched[dynamic[touched]]] = True
    inner = links[np.all(dynamic[links], axis=1)]
    root = roots(len(seeds), np.ascontiguousarray(inner[:, 0]), np.ascontiguousarray(inner[:, 1]))
    return seeds | (dynamic & np.isin(root, root[seeds & dynamic]))


def _carry_state(earlier: Run, run: Run, rows: _Both) -> None:
    """Copy what the engine remembers of bodies: paths, velocities, and what contact forces do to them."""
    old, new = rows
    before, now = earlier.state, run.state
    for one, other, names in (
        (before.trajectory, now.trajectory, before.trajectory._fields),
        (before.now, now.now, (*STARTS, "inv_inertia")),
        (before.limiter, now.limiter, before.limiter._fields[:-1]),  # the last is a constant
        (before, now, ("rotation", "sub_step", "by_joints")),
        (earlier, run, ("acceleration", "angular_acceleration", "wrench", "wrench_rate")),
        (earlier.world, run.world, ("dynamic", "moving", "inv_mass")),  # of bodies that are let go
    ):
        for name in names:
            getattr(other, name)[new] = getattr(one, name)[old]
    index = np.zeros(len(before.sharing), np.int64)
    index[old] = new
    now.sharing[new] = index[before.sharing[old]]
