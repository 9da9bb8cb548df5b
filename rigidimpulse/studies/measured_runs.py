"""Runs settings of one scene, and other engines, and measures them."""

from __future__ import annotations

import math
from time import perf_counter, process_time

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.model.effect import STAGES
from rigidimpulse.model.world import World
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.measures import Errors, Truth, measure, penetration
from rigidimpulse.studies.peers import run_peer
from rigidimpulse.studies.reference import Reference
from rigidimpulse.studies.row import Row
from rigidimpulse.studies.settings import Setting

SHORT, REPEATS = 0.3, 3
"""Runs shorter than this, in s, are repeated; the median counts."""
RUN_SHARE, PATIENCE = 0.1, 4.0
"""Share of the budget, and multiple of the time of the slowest preset, that one run may take."""


def peer_setting(peer: str, steps: int, fps: float) -> Setting:
    """What a row of another engine is called."""
    from rigidimpulse.scene.accuracy import Accuracy

    return Setting(f"{peer}, step 1/{round(fps * steps)}", peer, 1.0 / (fps * steps), Accuracy())


class TimeUp(Exception):
    """A run takes longer than the budget has left."""


class MeasuredRuns:
    """Runs settings of one scene and measures them; a run that takes too long is given up.

    Too long is a share of the budget, or a multiple of the time of the slowest preset, if that is more; and never beyond the budget.
    """

    def __init__(
        self, world: World, scene: Scene, reference: Reference, duration: float, fps: float, first: int, start: float, budget: float
    ) -> None:
        self.deadline, self.patience, self.usual = start + budget, RUN_SHARE * budget, 0.0
        self.world, self.scene, self.reference = world, scene, reference
        self.duration, self.fps = duration, fps
        self._first: dict[str, str] = {}
        truth = reference.truth
        met = truth.impacts if truth is not None else None
        self.until = reference.until
        # The beginning ends half-way between impact k and the next.
        self.beginning = self.until
        if met is not None and len(met) > first:
            self.beginning = min(self.until, 0.5 * float(met[first - 1] + met[first]))

    def run(self, setting: Setting) -> Row:
        """Run a setting; several times if that is short."""
        try:
            runs = [self._simulate(setting)]
            if _preparing(runs[0][1]) > 0.0:
                runs = [self._simulate(setting)]
            if runs[0][0] < SHORT:
                runs += [self._simulate(setting) for _ in range(REPEATS - 1)]
        except SceneError as error:
            return _refused(setting, f"refused: {error}")
        cost, median = sorted(runs, key=lambda made: made[0])[len(runs) // 2]
        profile = median.profile
        assert profile is not None
        status = "ok" if median.status.ok else "; ".join(dict.fromkeys(e.kind for e in median.status.events if e.is_problem))
        whole, beginning = self._errors(median)
        return Row(
            setting.name, setting.family, setting.knob, cost, profile.seconds - profile.preparing, whole, beginning,
            {stage: profile.stages.get(stage, 0.0) for stage in STAGES}, self._first_of(median, setting.name), status,
        )  # fmt: skip

    def _first_of(self, run: Recording, name: str) -> str:
        """Name of the setting that gave the same motion before; empty if this is the first."""
        first = self._first.setdefault(run.state_hash(), name)
        return "" if first == name else first

    def _simulate(self, setting: Setting) -> tuple[float, Recording]:
        """CPU time of the loop, s, and the run."""
        start, cpu = perf_counter(), process_time()
        deadline = self.deadline if setting.family == "presets" else min(self.deadline, start + max(self.patience, PATIENCE * self.usual))

        def watch(_: float) -> None:
            if perf_counter() > deadline:
                raise TimeUp

        run = simulate_whole(self.scene, self.duration, self.fps, accuracy=setting.accuracy, progress=watch)
        if setting.family == "presets":
            self.usual = max(self.usual, perf_counter() - start)
        profile = run.profile
        assert profile is not None
        loop = sum(profile.stages.get(stage, 0.0) for stage in STAGES)
        return (process_time() - cpu) * loop / profile.seconds, run

    def run_peer(self, name: str, steps: int) -> Row:
        """Run another engine with `steps` steps a frame."""
        setting = peer_setting(name, steps, self.fps)
        try:
            begin = perf_counter()
            run, spent = run_peer(name, self.scene, self.duration, self.fps, steps)
            seconds = perf_counter() - begin
        except SceneError as error:
            return _refused(setting, f"refused: {error}")
        whole, beginning = self._errors(run)
        return Row(setting.name, setting.family, setting.knob, spent, seconds, whole, beginning)

    def _errors(self, run: Recording) -> tuple[Errors, Errors]:
        deep = penetration(self.world, run)
        truth = self.reference.truth
        if truth is None:
            nothing = Truth(run.times, np.full_like(run.positions, np.nan), np.full_like(run.orientations, np.nan), None, 0.0, None)
            both = measure(self.world, run, nothing, float(run.times[-1]), deep)
            return both, both
        return measure(self.world, run, truth, self.until, deep), measure(self.world, run, truth, self.beginning, deep)


def _preparing(run: Recording) -> float:
    """Time that loading or compiling kernels took, s: some of it lies in the stages."""
    assert run.profile is not None
    return run.profile.preparing


def _refused(setting: Setting, why: str) -> Row:
    return Row(setting.name, setting.family, setting.knob, math.nan, math.nan, status=why.replace("\n", " "))
