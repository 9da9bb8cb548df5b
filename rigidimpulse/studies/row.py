"""One line of a study: a setting, what it cost, how wrong it was."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from rigidimpulse.model.effect import STAGES
from rigidimpulse.studies.measures import Errors
from rigidimpulse.studies.peers import PEERS

ERRORS = Errors._fields
UNKNOWN = Errors(*[math.nan] * len(ERRORS))
COLUMNS = (
    "name", "family", "knob", "cost", "seconds", *ERRORS, *(f"first_{name}" for name in ERRORS), *(f"{stage}_s" for stage in STAGES),
    "same_as", "status",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One run.

    Attributes:
        name: of the setting. family: settings that differ in one knob. knob: step in s, or tolerance.
        cost: CPU time of the loop, s, NaN if there is no run. seconds: whole time, s.
        whole, beginning: errors until the reference's horizon, and over the first impacts.
        stages: time by stage, s. same_as: the first row of the study with the very same motion, if there is one before.
        status: "ok", what the run reported, or why there is none.

    """

    name: str
    family: str
    knob: float
    cost: float
    seconds: float
    whole: Errors = UNKNOWN
    beginning: Errors = UNKNOWN
    stages: dict[str, float] = field(default_factory=dict)
    same_as: str = ""
    status: str = "ok"

    @property
    def ran(self) -> bool:
        """Whether there was a run."""
        return math.isfinite(self.cost)

    @property
    def is_peer(self) -> bool:
        """Whether another engine made it."""
        return self.family in PEERS

    def cells(self) -> list[str]:
        """Values in the order of COLUMNS; numbers in full."""
        stages = [repr(float(self.stages[stage])) if stage in self.stages else "" for stage in STAGES]
        numbers = [repr(float(value)) for value in (self.knob, self.cost, self.seconds, *self.whole, *self.beginning)]
        return [self.name, self.family, *numbers, *stages, self.same_as, self.status]

    @staticmethod
    def of(cells: dict[str, str]) -> Row:
        """The row of a line of a table with COLUMNS."""
        whole, beginning = (Errors(*(float(cells[before + name]) for name in ERRORS)) for before in ("", "first_"))
        stages = {stage: float(cells[f"{stage}_s"]) for stage in STAGES if cells[f"{stage}_s"]}
        knob, cost, seconds = (float(cells[name]) for name in ("knob", "cost", "seconds"))
        return Row(cells["name"], cells["family"], knob, cost, seconds, whole, beginning, stages, cells["same_as"], cells["status"])
