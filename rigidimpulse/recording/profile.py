"""Where the time of a run went: by stage of the loop and by kernel."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import NamedTuple

from rigidimpulse.core.kernels import CALLED
from rigidimpulse.model.effect import STAGES
from rigidimpulse.model.plan import Plan

MOST_ROWS = 20
"""Kernels in a table."""


class KernelTime(NamedTuple):
    """How often Python called a kernel, and how long it took in all, s."""

    calls: int
    seconds: float


@dataclass
class Profile:
    """Times of one run, s, wall clock.

    Kernels are those that Python called, by module and name; what they call is in them. Their times lie inside those of the stages. Runs in
    other threads at the same time are counted, too.

    Attributes:
        seconds: all of `simulate`.
        stages: by stage; "all else" is compiling the scene, the loop itself, and making the recording.
        kernels: by name, the longest first.
        preparing: first calls of kernels, which are compiled or loaded from the cache then; not in `kernels`.

    """

    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    kernels: dict[str, KernelTime] = field(default_factory=dict)
    preparing: float = 0.0

    def __repr__(self) -> str:
        """Return the seconds, and the stage that took longest."""
        longest = max(self.stages, key=lambda name: self.stages[name], default="")
        most = f", most in {longest!r}: {self._share(self.stages[longest])}" if longest else ""
        return f"Profile({self.seconds:.3g} s{most}, {len(self.kernels)} kernels)"

    def table(self) -> str:
        """Lines for people: stages, then the kernels that took longest."""
        rows = [("stage", "s", "share", "")]
        rows += [(name, f"{spent:.3f}", self._share(spent), "") for name, spent in self.stages.items()]
        rows += [("in all", f"{self.seconds:.3f}", "", ""), ("", "", "", ""), ("kernel", "s", "share", "calls, us each")]
        for name, (calls, spent) in list(self.kernels.items())[:MOST_ROWS]:
            rows.append((name, f"{spent:.3f}", self._share(spent), f"{calls:>8,} x {1e6 * spent / calls:.0f}"))
        rows.append(("loading or compiling kernels", f"{self.preparing:.3f}", self._share(self.preparing), ""))
        width = max(len(row[0]) for row in rows)
        return "\n".join(f"{name.ljust(width)}  {spent:>8}  {share:>6}  {note}".rstrip() for name, spent, share, note in rows)

    def _share(self, spent: float) -> str:
        return f"{100.0 * spent / self.seconds:.0f} %" if self.seconds > 0.0 else "-"


class Stopwatch:
    """Counts from where it is made; `read` gives the profile until then."""

    def __init__(self) -> None:
        """Note the counters of all kernels, whoever ran them before."""
        self._start = perf_counter()
        self._before = {kernel: (kernel.calls, kernel.seconds, kernel.preparing) for kernel in CALLED}

    def read(self, plan: Plan) -> Profile:
        """What went by since the start."""
        kernels, preparing = {}, 0.0
        for kernel in CALLED:
            calls, spent, prepared = self._before.get(kernel, (0, 0.0, 0.0))
            preparing += kernel.preparing - prepared
            if kernel.calls > calls and kernel.seconds > spent:
                kernels[kernel.name] = KernelTime(kernel.calls - calls, kernel.seconds - spent)
        seconds = perf_counter() - self._start
        stages: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        for line in plan.lines:
            stages[line.stage] += line.seconds
        stages = {stage: spent for stage, spent in stages.items() if spent > 0.0}
        stages["all else"] = seconds - sum(stages.values())
        ordered = sorted(kernels.items(), key=lambda item: -item[1].seconds)
        return Profile(seconds, stages, dict(ordered), preparing)
