"""Triggers: volumes that report which bodies overlap them, and never push.

Overlap is tested at the start of the run, at the end of each step, and at times inside the step. The tests are so close in time that
neither side moves by more than half the thickness of both between two of them. Where the answer changes, bisection finds the time to
`SHARPNESS`. Inside the step bodies are taken on all the trajectories that they had in it. Of those of the compiled order of events only the
first and the last are kept: where a body has several impacts in a step and nothing else acts on it, it goes straight between the first and
the last of them.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.collision.geometry import compile_shape
from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.portable import dot, length, matmul
from rigidimpulse.core.quaternion import multiply, rotate
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.run import Run
from rigidimpulse.motion.trajectory import FIXED, Trajectories, pose_at
from rigidimpulse.recording.events import impact_table
from rigidimpulse.scene.body import vector
from rigidimpulse.scene.collision_filter import CollisionFilter, may_meet
from rigidimpulse.scene.effect import SceneEffect
from rigidimpulse.scene.shape import Shape, check_orientation, normalized_quaternion

SHARPNESS = TOLERANCES.time_of_impact.trigger
MOST_LOOKS = 1000
"""Looks at most at one pair in one step."""
BEGINS, ENDS = "overlap begins", "overlap ends"
"""Kinds of the events."""


@dataclass(frozen=True, eq=False)
class Trigger(SceneEffect):
    """A volume that reports overlap: `run.status.events` has "overlap begins" and "overlap ends" with trigger and body.

    Attributes:
        name: what events call it.
        shape: the volume, in its own frame.
        body: name of the body that it moves with, which it does not report; None: it stands still.
        position: (3,) m, in the frame of that body, or in the world.
        orientation: quaternion (w, x, y, z), the same.
        collision_filter: which bodies it reports; None: all.

    Raises:
        SceneError: when the scene is compiled, for a bad shape or pose or an unknown body; names the trigger.

    """

    name: str
    shape: Shape
    _: KW_ONLY
    body: str | None = None
    position: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    collision_filter: CollisionFilter | None = None
    stage: ClassVar[str] = "observe"

    def check(self, names: list[str]) -> None:
        """Raise a `SceneError` for what makes no sense."""
        where = f"trigger {self.name!r}"
        try:
            if not isinstance(self.shape, Shape):
                raise SceneError(f"shape is a {type(self.shape).__name__}", "give a Shape")
            self.shape.check()
            vector(self.position, "position", "m")
            check_orientation(np.asarray(self.orientation, float))
        except SceneError as error:
            raise error.within(where) from None
        if self.body is not None and self.body not in names:
            raise unknown_name("body", self.body, names, where)


@dataclass
class _Watched:
    """One trigger in a run: index of its body or -1, its pose in that body's principal frame, size, and who is inside."""

    trigger: Trigger
    body: int
    shape: int
    reach: float
    thickness: float
    may: np.ndarray
    inside: set[int] = field(default_factory=set)


class _Leg(NamedTuple):
    """A body `row` on a trajectory from `start` to `end`, s."""

    trajectory: Trajectories
    row: int
    start: float
    end: float


class Triggers:
    """All triggers of a run.

    Attributes:
        narrowphase: of the shapes of bodies and triggers.

    """

    def __init__(self, run: Run, triggers: list[Trigger]) -> None:
        """Check the triggers and look at who is inside at the start."""
        world = run.world
        self._run = run
        for trigger in triggers:
            trigger.check(world.names)
        compiled = [compile_shape(trigger.shape, np.zeros(3), np.eye(3)) for trigger in triggers]
        self.narrowphase = Narrowphase([*world.shapes, *compiled])
        self._thickness = np.array([_thickness(body.shape) for body in world.scene.bodies])
        moves = world.dynamic | world.moving
        self._watched = []
        for number, trigger in enumerate(triggers):
            body = -1 if trigger.body is None else world.names.index(trigger.body)
            may = np.array([may_meet(trigger.collision_filter, other.collision_filter) for other in world.scene.bodies])
            may &= moves | (body >= 0 and moves[body])
            if body >= 0:
                may[body] = False
            reach, thick = _reach(trigger.shape), _thickness(trigger.shape)
            self._watched.append(_Watched(trigger, body, len(world.shapes) + number, reach, thick, np.flatnonzero(may)))
        self._is_watched = np.zeros(world.num_bodies, bool)
        for watched in self._watched:
            self._is_watched[watched.may] = True
            self._is_watched[watched.body] |= watched.body >= 0
        self._legs: dict[int, list[_Leg]] = {}
        self._fastest = np.zeros((world.num_bodies, 2))
        self._impacts_seen = 0
        self._turned = np.full(world.num_bodies, np.inf)
        self._before, self._began = _copy(run.state.trajectory), run.state.time
        self.look(run.state.time, run.state.time)

    def look(self, begin: float, end: float) -> None:
        """Look at what happened in the step from `begin` to `end` [s]."""
        self._began = begin
        self._note_impacts()
        for watched in self._watched:
            for i in self._near(watched, begin, end):
                self._follow(watched, i, begin, end)
        self._before = _copy(self._run.state.trajectory)
        for i in self._legs:
            self._fastest[i] = 0.0
        self._legs.clear()

    def turn(self, bodies: np.ndarray, time: float) -> None:
        """Keep the trajectories of bodies that get others at `time` [s]."""
        trajectory = self._run.state.trajectory
        for i in bodies[self._is_watched[bodies]].tolist():
            start = float(trajectory.start[i])
            if time > start:
                kept = Trajectories(*(array[i : i + 1].copy() for array in trajectory))
                self._legs.setdefault(i, []).append(_Leg(kept, 0, start, time))
                fast = float(_speeds(kept, np.array([0]), time)[0]), float(np.linalg.norm(kept.angular_velocity[0]))
                self._fastest[i] = np.maximum(self._fastest[i], fast)

    def _note_impacts(self) -> None:
        """When the trajectories at the begin of the step ended: at the first impact, or where those at its end start."""
        rows = self._run.log.impacts
        new = impact_table(rows[min(self._impacts_seen, len(rows)) :])
        self._impacts_seen = len(rows)
        self._turned[:] = self._run.state.trajectory.start
        for side in ("body_a", "body_b"):
            np.minimum.at(self._turned, new[side], new["time"])

    def _near(self, watched: _Watched, begin: float, end: float) -> list[int]:
        """Bodies that may be inside or have come and gone, by bounding spheres, and those that were inside."""
        trajectories, world = (self._before, self._run.state.trajectory), self._run.world
        i = watched.may
        if not np.isfinite(watched.reach):
            return i.tolist()
        # Bound of the speed of the centre in the step.
        way = np.maximum(np.max([_speeds(trajectory, i, end) for trajectory in trajectories], axis=0), self._fastest[i, 0])
        centre, _ = self._pose(watched, end)
        own = watched.body
        if own >= 0:
            away = np.linalg.norm(centre - self._body(own, end)[0])
            # The trigger moves with its body, and turns about its centre.
            for trajectory in trajectories:
                turn = np.linalg.norm(trajectory.angular_velocity[own])
                way = way + _speeds(trajectory, np.array([own]), end) + 2.0 * away * turn
            way = way + self._fastest[own, 0] + 2.0 * away * self._fastest[own, 1]
        place = np.array([self._body(k, end)[0] for k in i.tolist()]).reshape(-1, 3)
        near = np.linalg.norm(place - centre, axis=1) <= watched.reach + world.bound_radius[i] + way * (end - begin)
        return sorted({*i[near].tolist(), *watched.inside})

    def _follow(self, watched: _Watched, i: int, begin: float, end: float) -> None:
        """Find the changes of one pair."""
        count = 1
        if end > begin:
            thick = 0.5 * (watched.thickness + self._thickness[i])
            way = (end - begin) * (self._speed(i, end) + self._speed(watched.body, end, watched.reach))
            count = int(np.clip(np.ceil(way / thick), 1, MOST_LOOKS)) if thick > 0.0 else MOST_LOOKS
            if way == 0.0:
                return
        was, before = i in watched.inside, begin
        # The first look is spared: the last step ended with it.
        first = 1 if begin < end else 0
        for time in np.linspace(begin, end, count + 1)[first:].tolist():
            now = self._overlaps(watched, i, time)
            if now != was:
                self._note(watched, i, self._changed(watched, i, before, time, was), now)
            was, before = now, time

    def _changed(self, watched: _Watched, i: int, low: float, high: float, was: bool) -> float:
        """When the answer changes between two times; the first one if it has changed there already."""
        if self._overlaps(watched, i, low) != was:
            return low
        while high - low > max(SHARPNESS, 4.0 * np.spacing(high)):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._overlaps(watched, i, middle) == was else (low, middle)
        return high

    def _note(self, watched: _Watched, i: int, time: float, begins: bool) -> None:
        body = self._run.world.names[i]
        (watched.inside.add if begins else watched.inside.discard)(i)
        text = f"{body!r} {'enters' if begins else 'leaves'} trigger {watched.trigger.name!r}"
        self._run.log.note(time, BEGINS if begins else ENDS, (watched.trigger.name, body), text)

    def _overlaps(self, watched: _Watched, i: int, time: float) -> bool:
        shape = int(self._run.world.shape_of_body[i])
        return bool(self.narrowphase.overlap(watched.shape, self._pose(watched, time), shape, self._body(i, time)))

    def _speed(self, i: int, end: float, reach: float | None = None) -> float:
        """Bound of the speed of any point of a body on the trajectories of a step, m/s."""
        if i < 0:
            return 0.0
        reach = float(self._run.world.bound_radius[i]) if reach is None else reach
        fastest = float(self._fastest[i, 0]) + float(self._fastest[i, 1]) * (reach if np.isfinite(reach) else 0.0)
        for trajectory in (self._before, self._run.state.trajectory):
            if trajectory.mode[i] != FIXED:
                spin = float(np.linalg.norm(trajectory.angular_velocity[i])) * (reach if np.isfinite(reach) else 0.0)
                fastest = max(fastest, float(_speeds(trajectory, np.array([i]), end)[0]) + spin)
        return fastest

    def _body(self, i: int, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Principal frame of a body."""
        legs, trajectory = self._legs.get(i, []), self._run.state.trajectory
        if not legs or legs[0].start > self._began:
            # What it began the step on was not kept.
            turned = min(float(self._turned[i]), legs[0].start if legs else np.inf)
            legs = [_Leg(self._before, i, -np.inf, turned), *legs]
        earlier = None
        for leg in (*legs, _Leg(trajectory, i, float(trajectory.start[i]), np.inf)):
            if time < leg.start and earlier is not None:
                return _between(earlier, leg, time)
            if time <= leg.end:
                return _pose_on(leg.trajectory, leg.row, time)
            earlier = leg
        raise AssertionError("the last trajectory has no end")

    def _pose(self, watched: _Watched, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Frame of a trigger."""
        position, turn = np.asarray(watched.trigger.position, float), normalized_quaternion(watched.trigger.orientation)
        if watched.body < 0:
            return position, turn
        x, q = self._run.world.body_pose(watched.body, *self._body(watched.body, time))
        return x + rotate(q, position), multiply(q, turn)


def _copy(trajectory: Trajectories) -> Trajectories:
    """The trajectories as they are now."""
    return Trajectories(*(array.copy() for array in trajectory))


def _speeds(trajectory: Trajectories, i: np.ndarray, end: float) -> np.ndarray:
    """Bounds (k,) of the speeds of the centres of bodies (k,) on their trajectories until `end` [s], m/s."""
    speed, pull = np.linalg.norm(trajectory.velocity[i], axis=1), np.linalg.norm(trajectory.acceleration[i], axis=1)
    return speed + pull * np.maximum(end - trajectory.start[i], 0.0)


def _pose_on(trajectory: Trajectories, i: int, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Principal frame of body i on a trajectory, which has begun by `time` [s] or begins later."""
    x, q = np.empty(3), np.empty(4)
    pose_at(trajectory, i, max(time, float(trajectory.start[i])), x, q)
    return x, q / length(q)


def _between(first: _Leg, second: _Leg, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Principal frame of a body at `time` [s] on a straight way from the end of one trajectory to the start of another."""
    (x_0, q_0), (x_1, q_1) = _pose_on(first.trajectory, first.row, first.end), _pose_on(second.trajectory, second.row, second.start)
    share = (time - first.end) / (second.start - first.end)
    q = (1.0 - share) * q_0 + share * (q_1 if dot(q_0, q_1) >= 0.0 else -q_1)
    return (1.0 - share) * x_0 + share * x_1, q / length(q)


def _corners(shape: Shape) -> tuple[np.ndarray, np.ndarray] | None:
    """Box about a shape in its own frame; None if it is endless."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for part in shape.parts_flat():
        if part.shape.kind == "half_space":
            return None
        if part.shape.kind in ("mesh", "box"):
            points, grown = part.shape.surface().vertices, 0.0
        else:
            half = 0.0 if part.shape.kind == "sphere" else 0.5 * part.shape.height
            points, grown = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), part.shape.radius
        points = part.position + matmul(points, part.rotation.T)
        low, high = np.minimum(low, points.min(axis=0) - grown), np.maximum(high, points.max(axis=0) + grown)
    return low, high


def extent(shape: Shape) -> float:
    """Return the longest side of the box about a shape, m; 1 m for an endless one."""
    box = _corners(shape)
    return 1.0 if box is None else float(np.max(box[1] - box[0]))


def _reach(shape: Shape) -> float:
    """Radius about the origin of the frame that encloses a shape, m."""
    box = _corners(shape)
    return np.inf if box is None else float(np.linalg.norm(np.maximum(np.abs(box[0]), np.abs(box[1]))))


def _thickness(shape: Shape) -> float:
    """Least side of the box about a shape, m; 1 m for an endless one, into which nothing comes by passing through."""
    box = _corners(shape)
    return 1.0 if box is None else float(np.min(box[1] - box[0]))
