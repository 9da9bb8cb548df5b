"""What the measures of a run read, as plain data, and what they find.

The measures read recorded arrays only. They know nothing of the solver's contacts, pairs or tolerances, so that an error of the solver
cannot hide itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.model.world import World
from rigidimpulse.recording.ledger import Ledger
from rigidimpulse.recording.recorder import Frames

STILL: float = 1e-6
"""Way in a run, of the size of a body, below which it stands still: what moves less is not measured, it may be round-off alone."""


@dataclass(frozen=True, eq=False)
class RunRecord:
    """A run of n bodies at f frames."""

    world: World
    frames: Frames  # of principal frames
    ledger: Ledger
    release: np.ndarray  # (n,) s, when bodies that are carried first are let go; 0 for others
    touched: np.ndarray  # (k, 2) bodies that gave each other impulses by impacts, contacts and joints; -1: the world
    forced: np.ndarray  # (n,) bool: forces that vary act on the body, or may do so
    jointed: np.ndarray  # (n,) bool, bodies with joints

    @property
    def may_be_sub_stepped(self) -> bool:
        """Whether the run may have had sub-stepped islands, whose contacts are in no table."""
        return "sub-stepping" in self.ledger.dissipated

    @property
    def unseen_speed(self) -> np.ndarray:
        """Speed (n,) m/s up to which a dynamic body stands still, 0 for others."""
        size = np.where(self.world.dynamic, self.world.size, 0.0)
        return STILL * size / float(self.frames.times[-1] - self.frames.times[0])


@dataclass(frozen=True, eq=False)
class Fault:
    """Something that a sound run does not show."""

    time: float  # s
    kind: str
    bodies: tuple[str, ...]
    amount: float  # J, m, or a share, as the kind says
    message: str
