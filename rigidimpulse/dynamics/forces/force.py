"""Forces that vary: what a force is to people, and what it is to a run.

People add frozen dataclasses derived from `Force` to a scene. When it is compiled, all forces of one class become one `ForceTable`: rows
that act on a dynamic body each, evaluated together. `forces.varying` says how bodies move under them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.quaternion import rotate, rotate_inverse
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.motion.trajectory import Trajectories, pose_at, state_at
from rigidimpulse.scene.body import number, vector
from rigidimpulse.scene.effect import SceneEffect
from rigidimpulse.scene.shape import normalized_quaternion

if TYPE_CHECKING:
    from rigidimpulse.model.world import World
    from rigidimpulse.motion.body_state import BodyState


class Instant(NamedTuple):
    """What forces are evaluated at: the time of each body, and their states."""

    time: np.ndarray  # (n,) s
    bodies: BodyState
    rotation: np.ndarray  # (n, 3, 3)
    trajectory: Trajectories  # of the bodies that no force moves

    def carried_pose(self, i: int, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Centre of mass (3,) and orientation (4,) at `time` of a body on a given path."""
        x, q = np.empty(3), np.empty(4)
        pose_at(self.trajectory, i, time, x, q)
        return x, q

    def carried_point(self, i: int, time: float, arm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity (3,) at `time` of a point of a body on a given path; arm (3,) m along its principal axes."""
        x, q, v, w = np.empty(3), np.empty(4), np.empty(3), np.empty(3)
        state_at(self.trajectory, i, time, x, q, v, w)
        r = rotate(q, arm)
        return x + r, v + cross_arrays(w, r)


class ForceTable(ABC):
    """All forces of one class in a compiled scene.

    Attributes:
        kind: what `explain` calls them. names: of the forces.
        body: (k,) dynamic body on which each row acts. cause: (k,) the force that it belongs to, a place in `names`.
        links: (l, 2) dynamic bodies between which a force acts: they move together.
        is_steady: whether the forces change only if bodies move, so that bodies may come to rest under them.
        comes_and_goes: whether bodies feel them only while they are told so (`VaryingForces.let_act`).
        reason: what `explain` says of them.
        burns: whether it changes the masses of bodies.
        switches: whether they begin and end where bodies are, so that steps must end there (`freeze`, `switched`).

    """

    kind: str
    names: list[str]
    body: np.ndarray
    cause: np.ndarray
    links: np.ndarray
    is_steady: bool
    comes_and_goes = False
    reason: str
    burns: ClassVar[bool] = False
    switches: ClassVar[bool] = False

    @abstractmethod
    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force [N] and torque about the centre of mass [N m] of rows (r,), as (r, 6), in the world."""

    def next_break(self, time: float) -> float:
        """Next instant after `time` at which a force or its rate jumps, s."""
        return np.inf

    def longest_steps(self) -> np.ndarray:
        """Longest step (k,) s over which each row still looks smooth: a force that repeats within a step is not seen."""
        return np.full(len(self.body), np.inf)

    def give_way(self, value: np.ndarray, time: float) -> list[int]:
        """Forces that end at `time` since they are too large, by their present rows (k, 6); they are gone from now on."""
        return []

    def carry_on(self, _earlier: Self) -> None:
        """Leave out what broke in a table of an earlier run."""
        return

    def share_until_break(self, value: np.ndarray, change: np.ndarray) -> float:
        """Share of a step after which one becomes too large, 1 if none does; rows start with value (k, 6) and change by (k, 6)."""
        return 1.0

    def freeze(self, _at: Instant | None) -> None:
        """From here on only the parts that act at an instant do, or all again (None)."""
        return

    def switched(self, _at: Instant) -> bool:
        """Whether other parts act than those of `freeze`."""
        return False

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Potential energy of each force at f instants, (f, forces) J, 0 for those that have none.

        times (f,) s; position (f, n, 3) m and orientation (f, n, 4) of centres of mass and principal axes.
        """
        return np.zeros((len(times), len(self.names)))


class Force(SceneEffect, ABC):
    """A force as people write it: a frozen dataclass derived from this. `Scene.add` takes it; the compiled scene checks it."""

    stage: ClassVar[str] = "forces"

    @classmethod
    @abstractmethod
    def compile(cls, forces: Sequence[Self], world: World) -> ForceTable:
        """Check the forces and bind them to a compiled scene; a `SceneError` names the force, the value and the remedy."""


def dynamic_body(world: World, name: str, where: str) -> int:
    """Index of a dynamic body. Raises SceneError where it is unknown or not dynamic."""
    if name not in world.names:
        raise unknown_name("body", name, world.names, where)
    i = world.names.index(name)
    if not world.dynamic[i]:
        raise SceneError(f"body {name!r} is not dynamic", "a force moves dynamic bodies only: name one of them", where)
    return i


def dynamic_bodies(world: World, names: Sequence[str] | None, where: str) -> np.ndarray:
    """Indices of dynamic bodies, of all for None. Raises SceneError as `dynamic_body` does, and where there are none."""
    if isinstance(names, str):
        raise SceneError(f"bodies is the text {names!r}", f"give a list of names: [{names!r}]", where)
    found = np.flatnonzero(world.dynamic) if names is None else sorted({dynamic_body(world, name, where) for name in names})
    if not len(found):
        what = "no body of the scene is dynamic" if names is None else "bodies is empty"
        raise SceneError(what, "add a dynamic body, or leave the force out", where)
    return np.array(found, np.int64)


def end_of(world: World, name: str | None, where: str) -> int:
    """Index of any body, -1 for None, the world. Raises SceneError for an unknown name."""
    if name is None:
        return -1
    if name not in world.names:
        raise unknown_name("body", name, world.names, where)
    return world.names.index(name)


def checked_vector(value: ArrayLike, name: str, unit: str, where: str) -> np.ndarray:
    """Three finite numbers, or a SceneError."""
    try:
        return vector(value, name, unit)
    except SceneError as error:
        raise error.within(where) from None


def checked_direction(value: ArrayLike, where: str) -> np.ndarray:
    """A unit vector, or a SceneError for one without length."""
    direction = checked_vector(value, "direction", "any unit", where)
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise SceneError("direction is zero", "give the direction of the force", where)
    return direction / length


def checked_orientation(value: ArrayLike, where: str) -> np.ndarray:
    """A unit quaternion (4,), or a SceneError for what is none."""
    try:
        q = np.array(value, float)
    except (TypeError, ValueError):
        q = np.zeros(0)
    if q.shape != (4,) or not np.all(np.isfinite(q)) or not q.any():
        raise SceneError(f"orientation is {value!r}", "give a quaternion (w, x, y, z)", where)
    return normalized_quaternion(q)


def checked_number(value: float, name: str, unit: str, where: str, *, least: float = -np.inf) -> float:
    """A finite number not below `least`, or a SceneError."""
    try:
        result = number(value, name, unit)
    except SceneError as error:
        raise error.within(where) from None
    if result < least:
        raise SceneError(f"{name} is {value!r}", f"give a number >= {least:g}{f', in {unit}' if unit else ''}", where)
    return result


def body_point(world: World, i: int, point: np.ndarray) -> np.ndarray:
    """A point (3,) m, given in the world at the start, from the centre of mass along the principal axes of body i (-1: as it is)."""
    return point if i < 0 else rotate_inverse(world.orientation[i], point - world.position[i])


def named(kind: str, given: Sequence[str | None], told: Sequence[str]) -> list[str]:
    """Names of forces: the given ones, or what they are told of, numbered where that is not enough.

    Raises:
        SceneError: two forces have been given the same name.

    """
    names: list[str] = []
    for name, text in zip(given, told, strict=True):
        if name is not None:
            if name in names:
                raise SceneError(f"two {kind} are named {name!r}", "give them different names")
            names.append(name)
            continue
        count = 1
        while (candidate := text if count == 1 else f"{text} {count}") in names:
            count += 1
        names.append(candidate)
    return names


CAUSES = frozenset(
    ("stick", "contact", "energy correction", "sub-stepping", "impact", "joints", "position correction", "mass that left", "overlap")
)
"""What the ledger calls other things than forces."""


def check_names(tables: Sequence[ForceTable]) -> None:
    """Refuse names that the ledger could not keep apart.

    Raises:
        SceneError: forces of two kinds have the same name, or one has that of another cause.

    """
    seen: dict[str, str] = dict.fromkeys(CAUSES, "the ledger")
    for table in tables:
        for name in table.names:
            if name in seen:
                raise SceneError(f"{table.kind}: {name!r} is a name of {seen[name]}, too", "give the force a name of its own")
        seen.update(dict.fromkeys(table.names, table.kind))


def no_links() -> np.ndarray:
    """Of forces that act on one body each."""
    return np.zeros((0, 2), np.int64)
