"""Stand-ins for participants that a scene does not call for. They do nothing, so the loop need not ask whether a participant is there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rigidimpulse.model.island import Island

NONE, NO_LINKS = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)


class NoJoints:
    """A run without joints."""

    def __init__(self) -> None:
        """No force was ever recorded."""
        self.names: list[str] = []
        self.reactions: list[tuple[float, int, np.ndarray]] = []

    def at(self, _bodies: Sequence[int] | np.ndarray) -> np.ndarray:
        """No joint is at any body."""
        return NONE

    def bodies_of(self, _joints: np.ndarray) -> np.ndarray:
        """No joint has bodies."""
        return NONE

    def links(self) -> np.ndarray:
        """No joint joins bodies."""
        return NO_LINKS

    def moving_bodies(self, _run: Any) -> np.ndarray:
        """No joint moves."""
        return NONE


class NoForces:
    """A run in which no force varies."""

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


class NoSoftBodies:
    """A run without soft bodies."""

    moves = False

    def __init__(self, num_bodies: int) -> None:
        """Nothing presses any of the bodies."""
        self.pressed = np.zeros(num_bodies, bool)

    def advance(self, _run: Any, end: float) -> float:
        """The step is as long as it was."""
        return end

    def tracks(self) -> list[Any]:
        """No soft body leaves a track."""
        return []

    def add_to(self, _ledger: Any) -> None:
        """Nothing is added to the ledger."""


class NoSubstepping:
    """A run in which no island may be sub-stepped."""

    def __init__(self, num_bodies: int) -> None:
        """None of the bodies belongs to one."""
        self.label, self.solve_count = np.full(num_bodies, -1), np.zeros(num_bodies)

    def choose(self, _run: Any, _pair_events: Any) -> None:
        """No island is chosen."""

    def join(self, _run: Any, _pair_events: Any, _time: float, islands: list[Island]) -> list[Island]:
        """All islands are exact."""
        return islands

    def is_idle(self) -> bool:
        """Nothing is sub-stepped, nor will be."""
        return True

    def finish(self, _run: Any) -> None:
        """There is nothing to end."""


class NoCompiledLoop:
    """A run whose events all need the loop in Python."""

    def advance(self, _run: Any, _pair_events: Any, time: float, bodies: np.ndarray) -> tuple[float, np.ndarray]:
        """No event is dealt with."""
        return time, bodies


class NoFlight:
    """A run without the kernel of balls."""

    def may_fly(self) -> bool:
        """There is nothing to fly with."""
        return False


class _NoForceLog:
    """What forces did that do not act."""

    def __init__(self, num_bodies: int) -> None:
        """No work on any of the bodies."""
        self.work = np.zeros(num_bodies)

    def end(self, _body: int, _time: float) -> None:
        """Nothing is recorded."""
