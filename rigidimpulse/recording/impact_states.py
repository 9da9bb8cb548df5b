"""Velocities just before and after each impact, and what its impulse is made of, worked out again from the frames.

A recording has states at frames and impulses at impacts. Between two impacts a body that only gravity acts on has its exact path: a
parabola and the free rotation. So its state at an impact follows from the frame before, and each impulse J at the arm r changes it by

    v += J / m,    w += I^-1 (r x J)                                                      on b; the opposite on a

A state is taken as known only if it agrees with all else that was recorded: with the approach and separation speed of each impact on the
way, and with the next frame. Where another force acts (a joint, lasting contact, a spring) it does not agree, and is not shown.

Impacts at one instant were resolved in the order of their rows, some of them together as one block. A block is the shortest run of
rows whose approach speeds are those before it and whose separation speeds are those after it.

With K of `dynamics.impact.point`, t the tangential impulse and n the normal, the change of the normal speed at an impact is

    approach + separation = j (1/m_a + 1/m_b + s_a + s_b) + n.K t + the same of other points of the block,
    s = (r x n).I^-1 (r x n)

so that j is (approach + separation) over the sum of 1/m_a, 1/m_b, s_a, s_b, slip = n.K t / j, and others, the rest.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.quaternion import multiply, to_matrix
from rigidimpulse.motion import free_rotation
from rigidimpulse.scene.mass import BodyMass, masses_of

if TYPE_CHECKING:
    from rigidimpulse.recording.recording import Recording

AGREEMENT = 1e-5
"""Difference of two speeds that count as the same, relative to the speeds of the bodies: far below the three digits that people are shown.
Points of contact are recorded half-way between the two surfaces, whose distance is a millionth of the bodies' size."""
SAME_SUM = 1e-3
"""Share of approach plus separation speed by which the parts of an impulse may be off, to be shown with three digits."""


@dataclass(frozen=True)
class ImpactStates:
    """What is known of k impacts; the second axis of two is body a, body b, that of three in between before, after.

    Attributes:
        known: (k,) whether the velocities are those at the instant; else they are those of the frames before and after it.
        velocity: (k, 2, 2, 3) m/s. angular_velocity: (k, 2, 2, 3) rad/s, world axes.
        inverse_mass: (k, 2) 1/kg, 0 for what cannot be pushed. spin: (k, 2) 1/kg. slip, others: (k,) 1/kg; see the head of the file.
            NaN where they are not known.
        energy: (k,) J, change of the kinetic energy by this impulse; NaN where the velocities are not known.

    """

    known: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    inverse_mass: np.ndarray
    spin: np.ndarray
    slip: np.ndarray
    others: np.ndarray
    energy: np.ndarray


@dataclass
class _Body:
    """A body at an instant: centre of mass, principal frame, velocities."""

    mass: BodyMass
    time: float
    acceleration: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    inverse_inertia: np.ndarray

    def advance(self, time: float) -> None:
        """Go on, free of forces but gravity. A body that cannot be pushed keeps its velocities."""
        s = time - self.time
        if s == 0.0:
            return
        self.time = time
        self.position = self.position + s * (self.velocity + 0.5 * s * self.acceleration)
        self.velocity = self.velocity + s * self.acceleration
        if np.any(self.angular_velocity):
            moments = self.mass.moments if np.isfinite(self.mass.mass) else np.ones(3)
            constants, turned, spin = np.zeros(free_rotation.FREE_ROTATION_SIZE), np.empty(4), np.empty(3)
            free_rotation.prepare(np.ascontiguousarray(moments), self.orientation, self.angular_velocity, constants)
            free_rotation.evaluate(constants, s, turned, spin)
            self.orientation, self.angular_velocity = turned, spin
            self.inverse_inertia = _inverse_inertia(self.mass, turned)

    def push(self, arm: np.ndarray, impulse: np.ndarray) -> None:
        """Apply an impulse (3,) N s."""
        self.velocity = self.velocity + impulse / self.mass.mass
        self.angular_velocity = self.angular_velocity + self.inverse_inertia @ _cross(arm, impulse)

    def at(self, point: np.ndarray) -> np.ndarray:
        """Velocity (3,) of the body at a point, m/s."""
        return self.velocity + _cross(self.angular_velocity, point - self.position)

    def speed(self, point: np.ndarray) -> float:
        """Sum of what moves the point, m/s: the scale of round-off of its velocity."""
        arm = point - self.position
        return float(np.linalg.norm(self.velocity) + np.linalg.norm(self.angular_velocity) * np.linalg.norm(arm))


def impact_states(run: Recording, chosen: np.ndarray) -> ImpactStates:
    """Return the states at some impacts of a run, which needs its scene.

    Args:
        run: the recording.
        chosen: (k,) rows of `run.impacts`.

    """
    return _Walk(run, chosen).states()


class _Walk:
    """Goes through the intervals between frames that hold chosen impacts."""

    def __init__(self, run: Recording, chosen: np.ndarray) -> None:
        assert run.scene is not None
        self.run, self.chosen = run, chosen
        self.bodies, self.impacts = list(run.scene.bodies), run.impacts
        self.masses = masses_of(self.bodies)
        self.gravity = np.asarray(run.scene.gravity, dtype=np.float64)
        self.jointed = {getattr(effect, end, None) for effect in run.scene.effects for end in ("a", "b")}
        count, last = len(chosen), max(len(run.times) - 2, 0)
        # A frame at exactly the time of an impact shows the state after it, frame 0 the state as given.
        self.frame = np.clip(np.searchsorted(run.times, self.impacts["time"], side="left") - 1, 0, last)
        self.place = np.full(len(self.impacts), -1)
        self.place[chosen] = np.arange(count)
        self.found = ImpactStates(
            np.zeros(count, bool), np.zeros((count, 2, 2, 3)), np.zeros((count, 2, 2, 3)), np.zeros((count, 2)),
            np.full((count, 2), np.nan), np.full(count, np.nan), np.full(count, np.nan), np.full(count, np.nan),
        )  # fmt: skip

    def states(self) -> ImpactStates:
        """Of all chosen impacts."""
        rows_of = defaultdict(list)
        wanted = set(self.frame[self.chosen].tolist())
        for row in np.argsort(self.impacts["time"], kind="stable").tolist():
            if int(self.frame[row]) in wanted:
                rows_of[int(self.frame[row])].append(row)
        for frame, rows in rows_of.items():
            self._interval(frame, rows)
        return self.found

    def _interval(self, frame: int, rows: list[int]) -> None:
        """Walk through the impacts between a frame and the next one."""
        after = min(frame + 1, len(self.run.times) - 1)
        members = sorted({int(self.impacts[side][row]) for row in rows for side in ("body_a", "body_b")})
        now = {i: self._body_at(i, frame) for i in members}
        doubtful = {i for i in members if self.bodies[i].name in self.jointed}
        for first, end in _instants(self.impacts["time"][rows]):
            self._instant(rows[first:end], now, doubtful)
        for i in members:
            now[i].advance(float(self.run.times[after]))
            if not self._is_at(now[i], i, after):
                doubtful.add(i)
        for row in rows:
            k = self.place[row]
            a, b = int(self.impacts["body_a"][row]), int(self.impacts["body_b"][row])
            if k >= 0 and (a in doubtful or b in doubtful):
                self._take_from_frames(k, (a, b), frame, after)

    def _body_at(self, i: int, frame: int) -> _Body:
        run, body, mass = self.run, self.bodies[i], self.masses[i]
        orientation = multiply(run.orientations[frame, i], mass.turn)
        gravity = body.gravity_factor * self.gravity if body.motion == "dynamic" else np.zeros(3)
        return _Body(
            mass, float(run.times[frame]), gravity, run.centers[frame, i], np.ascontiguousarray(orientation),
            run.velocities[frame, i], np.ascontiguousarray(run.angular_velocities[frame, i]), _inverse_inertia(mass, orientation),
        )  # fmt: skip

    def _is_at(self, body: _Body, i: int, frame: int) -> bool:
        """Whether the velocities that were worked out are those of a frame."""
        run = self.run
        scale = float(np.linalg.norm(body.velocity) + np.linalg.norm(self.gravity) * (run.times[frame] - run.times[frame - 1]))
        spin = float(np.linalg.norm(body.angular_velocity))
        return bool(
            np.linalg.norm(run.velocities[frame, i] - body.velocity) <= AGREEMENT * scale
            and np.linalg.norm(run.angular_velocities[frame, i] - body.angular_velocity) <= AGREEMENT * max(spin, scale)
        )

    def _instant(self, rows: list[int], now: dict[int, _Body], doubtful: set[int]) -> None:
        """Resolve the impacts of one instant again, block after block."""
        time, first = float(self.impacts["time"][rows[0]]), 0
        for row in rows:
            for side in ("body_a", "body_b"):
                now[int(self.impacts[side][row])].advance(time)
        while first < len(rows):
            block = self._block(rows[first:], now)
            if not block:
                block = rows[first : first + 1]
                doubtful.update(int(self.impacts[side][block[0]]) for side in ("body_a", "body_b"))
            self._apply(block, now)
            first += len(block)

    def _block(self, rows: list[int], now: dict[int, _Body]) -> list[int]:
        """The shortest block that begins here; empty where there is none."""
        changed: dict[int, _Body] = {}
        for end, row in enumerate(rows, 1):
            if not self._agrees(row, now, "approach_speed", -1.0):
                return []
            for i, arm, impulse in self._pushes(row, now):
                changed.setdefault(i, _copy(now[i])).push(arm, impulse)
            after = {**now, **changed}
            if all(self._agrees(r, after, "separation_speed", 1.0) for r in rows[:end]):
                return rows[:end]
        return []

    def _agrees(self, row: int, now: dict[int, _Body], column: str, sign: float) -> bool:
        impact = self.impacts[row]
        a, b, point = now[int(impact["body_a"])], now[int(impact["body_b"])], impact["point"]
        speed = float(impact["normal"] @ (b.at(point) - a.at(point)))
        return abs(sign * speed - impact[column]) <= AGREEMENT * (a.speed(point) + b.speed(point) + abs(impact[column]))

    def _pushes(self, row: int, now: dict[int, _Body]) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Body, arm and impulse on it, of both bodies of an impact."""
        impact = self.impacts[row]
        impulse = impact["impulse"] * impact["normal"] + impact["tangent_impulse"]
        sides = ((int(impact["body_a"]), -1.0), (int(impact["body_b"]), 1.0))
        return [(i, impact["point"] - now[i].position, sign * impulse) for i, sign in sides]

    def _apply(self, block: list[int], now: dict[int, _Body]) -> None:
        """Apply the impulses of a block and note what is known of them."""
        members = {int(self.impacts[side][row]) for row in block for side in ("body_a", "body_b")}
        before = {i: _copy(now[i]) for i in members}
        for row in block:
            for i, arm, impulse in self._pushes(row, before):
                now[i].push(arm, impulse)
        for row in block:
            if self.place[row] >= 0:
                self._note(row, before, now, alone=len(block) == 1)

    def _note(self, row: int, before: dict[int, _Body], after: dict[int, _Body], alone: bool) -> None:
        k, found, impact = self.place[row], self.found, self.impacts[row]
        found.known[k] = True
        impulse = impact["impulse"] * impact["normal"] + impact["tangent_impulse"]
        slip, energy = 0.0, 0.0
        for side, (name, sign) in enumerate((("body_a", -1.0), ("body_b", 1.0))):
            i, point, normal = int(impact[name]), impact["point"], impact["normal"]
            for when, body in enumerate((before[i], after[i])):
                found.velocity[k, side, when], found.angular_velocity[k, side, when] = body.velocity, body.angular_velocity
                energy += 0.5 * sign * float(impulse @ body.at(point))
            arm = point - before[i].position
            lever = before[i].inverse_inertia @ _cross(arm, normal)
            found.inverse_mass[k, side] = 1.0 / before[i].mass.mass
            found.spin[k, side] = float(_cross(arm, normal) @ lever)
            slip += float(_cross(arm, impact["tangent_impulse"]) @ lever)
        found.energy[k] = energy
        self._note_rest(k, row, slip, alone)

    def _note_rest(self, k: int, row: int, slip: float, alone: bool) -> None:
        """What friction and other points add to the sum; nothing is known of the parts if the sum does not fit."""
        found, impact = self.found, self.impacts[row]
        speed, j = impact["approach_speed"] + impact["separation_speed"], impact["impulse"]
        fits = j > 0.0 and speed > 0.0
        if fits:
            found.slip[k] = slip / j
            own = found.inverse_mass[k].sum() + found.spin[k].sum() + found.slip[k]
            found.others[k] = 0.0 if alone else speed / j - own
            fits = abs(j * (own + found.others[k]) - speed) <= SAME_SUM * speed
        if not fits:
            found.spin[k], found.slip[k], found.others[k] = np.nan, np.nan, np.nan

    def _take_from_frames(self, k: int, bodies: tuple[int, int], frame: int, after: int) -> None:
        """Velocities of the frames around an impact. What does not need the velocities is left where its sum fits."""
        found = self.found
        found.known[k], found.energy[k] = False, np.nan
        for side, i in enumerate(bodies):
            for when, at in enumerate((frame, after)):
                found.velocity[k, side, when] = self.run.velocities[at, i]
                found.angular_velocity[k, side, when] = self.run.angular_velocities[at, i]
        if any(self.bodies[i].name in self.jointed for i in bodies) or abs(found.others[k]) > 0.0:
            # Joints push at the same instant, and other points are known only as a rest.
            found.spin[k], found.slip[k], found.others[k] = np.nan, np.nan, np.nan


def _instants(times: np.ndarray) -> list[tuple[int, int]]:
    """First and end of each run of equal times."""
    cuts = [0, *(np.flatnonzero(np.diff(times)) + 1).tolist(), len(times)]
    return list(pairwise(cuts))


def _inverse_inertia(mass: BodyMass, orientation: np.ndarray) -> np.ndarray:
    """Inverse inertia (3, 3) in world axes, 1/(kg m2); 0 for what cannot be pushed."""
    axes = to_matrix(orientation)
    return (axes / mass.moments) @ axes.T


def _copy(body: _Body) -> _Body:
    """Its fields are never changed in place."""
    return _Body(**vars(body))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b of vectors (3,), faster than numpy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
