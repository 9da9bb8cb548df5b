"""Stand-ins for participants that a scene does not call for. They do nothing, so the loop need not ask whether a participant is there."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from rigidimpulse.dynamics.constraints.jointed_island import JointMemory, make_memory
from rigidimpulse.engine.exact.step_begin import make_counts
from rigidimpulse.engine.pair_table import NEVER
from rigidimpulse.model.island import Island
from rigidimpulse.recording.joint_log import JointLog

if TYPE_CHECKING:
    from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
    from rigidimpulse.model.joint_table import Joints
    from rigidimpulse.model.world import World
    from rigidimpulse.recording.ledger import Ledger

NONE, NO_LINKS = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)


def _ask_nobody(*_asked: Any, **_named: Any) -> NoReturn:
    """In the place of what only those are asked that are there."""
    raise AssertionError("a run was asked for what its scene does not have")


class NoJoints:
    """A run without joints. `are_closed`, `moment` and `table` have no value: only islands with joints are asked for them."""

    are_closed: bool
    table: Joints
    moment: np.ndarray

    def __init__(self, world: World, times: np.ndarray) -> None:
        """No joint is at any of the bodies; times: (f,) s of the frames."""
        self._world, self._joined, self.log = world, np.zeros(world.num_bodies, bool), JointLog(times, [], NO_LINKS)

    @property
    def memory(self) -> JointMemory:
        """Memory of no joints, for solvers of contacts and joints together."""
        return self._memory

    @cached_property
    def _memory(self) -> JointMemory:
        return make_memory(self._world.joints, self._world.inertia)

    def at(self, _bodies: Sequence[int] | np.ndarray) -> np.ndarray:
        """No joint is at any body."""
        return NONE

    def bodies_of(self, _joints: np.ndarray) -> np.ndarray:
        """No joint has bodies."""
        return NONE

    def links(self) -> np.ndarray:
        """No joint joins bodies."""
        return NO_LINKS

    def joined(self) -> np.ndarray:
        """No body has a joint."""
        return self._joined

    def moving_bodies(self, _run: Any) -> np.ndarray:
        """No joint moves."""
        return NONE

    def report_start(self, _run: Any) -> None:
        """No joint is open."""

    def carry_on(self, _run: Any, _earlier: Any) -> None:
        """No joint goes on."""

    movable_end = are_passive = will_let_go = supports_of = project_velocities = impact_block = hold = let_go = log_rest = _ask_nobody
    begin_sub_steps = note_sub_steps = account_sub_steps = report_open = break_at = next_release = follow = _ask_nobody


class NoForces:
    """A run in which no force varies. `value` and `rate` have no value: only bodies that forces act on are asked for them."""

    value: np.ndarray
    rate: np.ndarray

    def __init__(self, num_bodies: int) -> None:
        """No force acts on any of the bodies."""
        self.acts = np.zeros(num_bodies, bool)
        self.log = _NoForceLog(num_bodies)

    def weigh(self, _bodies: np.ndarray, _time: float) -> None:
        """All masses stay."""

    def links(self) -> np.ndarray:
        """No force ties bodies together."""
        return NO_LINKS

    def finish(self, *_recorded: Any) -> None:
        """No force did any work."""

    def carry_on(self, _earlier: Any) -> None:
        """Nothing is to be left out."""

    let_act = present = may_rest = fly = of_flight = load = push = _ask_nobody


class NoSoftBodies:
    """A run without soft bodies."""

    moves = False

    def __init__(self, num_bodies: int) -> None:
        """Nothing presses any of the bodies."""
        self.pressed = np.zeros(num_bodies, bool)

    def advance(self, _run: Any, end: float) -> float:
        """The step is as long as it was."""
        return end

    def keep(self, _count: int) -> None:
        """There are no frames."""

    def tracks(self) -> list[FlexibleTrack]:
        """No soft body leaves a track."""
        return []

    def carry_on(self, _run: Any, _earlier: Any) -> None:
        """No soft body goes on."""

    def add_to(self, _ledger: Ledger) -> None:
        """Nothing is added to the ledger."""


class NoSubstepping:
    """A run in which no island may be sub-stepped."""

    def __init__(self, num_bodies: int) -> None:
        """None of the bodies belongs to one."""
        self.label, self.counts = np.full(num_bodies, -1), make_counts(num_bodies, NEVER, np.inf)

    def choose(self, _run: Any, _pair_events: Any) -> None:
        """No island is chosen."""

    def join(self, _run: Any, _pair_events: Any, _time: float, islands: list[Island]) -> list[Island]:
        """All islands are exact."""
        return islands

    def take_undisturbed_steps(self, _run: Any, _end: float, _until: float) -> None:
        """No step is taken: there are no members."""

    def let_go(self, _bodies: np.ndarray) -> None:
        """Nobody sleeps in an island."""

    def may_take(self, _bodies: np.ndarray) -> bool:
        """Nothing is handed over."""
        return False

    def is_idle(self) -> bool:
        """Nothing is sub-stepped, nor will be."""
        return True

    def finish(self, _run: Any) -> None:
        """There is nothing to end."""

    def carry_on(self, _earlier: Any, _old: np.ndarray, _new: np.ndarray) -> None:
        """Nobody will ask."""

    contact_forces = begin_trajectories = solve_again = _ask_nobody


class NoCompiledLoop:
    """A run whose events all need the loop in Python."""

    def advance(self, _run: Any, _pair_events: Any, event: tuple[float, np.ndarray], _until: float) -> tuple[float, np.ndarray]:
        """No event is dealt with."""
        return event


class NoFlight:
    """A run without the kernel of balls."""

    def may_fly(self) -> bool:
        """There is nothing to fly with."""
        return False

    fly = _ask_nobody


class NoTriggers:
    """A run without triggers."""

    narrowphase = None

    def look(self, _begin: float, _end: float) -> None:
        """Nobody looks."""

    def turn(self, _bodies: np.ndarray, _time: float) -> None:
        """Nobody asks where they were before."""


class NoKeyframes:
    """A run in which no body has keyframes."""

    def next_key(self, _time: float) -> float:
        """There is none."""
        return np.inf

    def start_segments(self, _run: Any, _time: float) -> None:
        """No body has a path."""


class _NoForceLog:
    """What forces did that do not act."""

    def __init__(self, num_bodies: int) -> None:
        """No work on any of the bodies."""
        self.work = np.zeros(num_bodies)

    def end(self, _body: int, _time: float, _now: Any = None) -> None:
        """Nothing is recorded."""

    def keep(self, _count: int) -> None:
        """There are no frames."""
