"""Runs of candidates: timed, and given up where they take too long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.kernels import CALLED
from rigidimpulse.core.providers import load_function
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.glance.candidates import PEER, Candidate
from rigidimpulse.studies.peers import run_peer

REPEATS = ((0.3, 3), (1.0, 2))
"""A run shorter than this, in s, is made so often, and the least time counts: other work on the machine only adds."""


class GivenUp(Exception):
    """A run took too long; its argument is the simulated time that it had reached, s."""


@dataclass(frozen=True, eq=False)
class Played:
    """A candidate and what came of it.

    Attributes:
        candidate: what was run. recording: its motion; None if there is none.
        seconds: wall-clock time from scene to recording, without the loading of kernels; of another engine that of its steps alone;
            of a run that was given up, until then.
        spread: s, half the range of repeated runs. why_not: why there is no motion, or "".

    """

    candidate: Candidate
    recording: Recording | None
    seconds: float
    spread: float = 0.0
    why_not: str = ""


@dataclass(frozen=True, eq=False)
class Player:
    """Runs candidates of a scene for a duration, s, at frames a second."""

    scene: Scene
    duration: float
    fps: float

    def play(self, candidate: Candidate, limit: float) -> Played:
        """Run a candidate; after `limit` s it is given up."""
        try:
            runs = [self._run(candidate, limit)]
            often = next((number for most, number in REPEATS if runs[0][0] < most), 1) if candidate.kind != PEER else 1
            runs += [self._run(candidate, limit) for _ in range(often - 1)]
        except SceneError as error:
            return Played(candidate, None, 0.0, why_not=f"refused: {error}".replace("\n", " "))
        except GivenUp as reached:
            why = f"given up after {limit:.1f} s of computing, at {reached.args[0]:.2f} s of motion"
            return Played(candidate, None, limit, why_not=why)
        seconds = [spent for spent, _ in runs]
        return Played(candidate, runs[0][1], min(seconds), 0.5 * (max(seconds) - min(seconds)))

    def _run(self, candidate: Candidate, limit: float) -> tuple[float, Recording]:
        """Wall-clock time, s, and the motion."""
        if candidate.accuracy is None:
            return self._run_engine(candidate, limit)
        run = simulate_whole(self.scene, self.duration, self.fps, accuracy=candidate.accuracy, progress=watch(limit))
        assert run.profile is not None
        return run.profile.seconds - run.profile.preparing, run

    def _run_engine(self, candidate: Candidate, limit: float) -> tuple[float, Recording]:
        """Time of the steps of another engine alone, s, and the motion: how its model is built is not counted, in its favour."""
        try:
            load_function(f"rigidimpulse.studies.peers.{candidate.engine}_peer:make")
        except ImportError as error:
            raise SceneError(f"{candidate.engine} is not installed ({error})", "pip install 'rigidimpulse[peers]'") from None
        steps = max(1, round(candidate.rate / self.fps))
        run, spent = run_peer(candidate.engine, self.scene, self.duration, self.fps, steps, watch(limit))
        return spent, run


def watch(limit: float) -> Callable[[float], None]:
    """What to call while a run goes on: after `limit` s without the loading of kernels it raises `GivenUp`."""
    start, before = perf_counter(), _preparing()

    def look(time: float) -> None:
        if perf_counter() - start - (_preparing() - before) > limit:
            raise GivenUp(time)

    return look


def _preparing() -> float:
    """Time that kernels of this process took to load or compile until now, s."""
    return sum(kernel.preparing for kernel in CALLED)
