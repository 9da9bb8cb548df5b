"""What accuracy costs in time: a scene run with a grid of settings, each measured against a reference, other engines beside it.

    cost     CPU time of the loop, s: of `simulate`, times the share of the stages in `run.profile`. Compiling the scene, loading kernels
             and making the recording are not in it, as building the model is not in that of other engines
    error    `measures.Errors`, of the whole run (until the reference's horizon) and of the beginning, until just before impact k + 1

A row is on the front if no other row is both cheaper and more accurate. Rows are kept in a CSV file as they come, with a fingerprint of the
scene; the same study asked for again goes on where it was.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from rigidimpulse.errors import SceneError
from rigidimpulse.files import write_renamed
from rigidimpulse.gallery.record import GalleryScene
from rigidimpulse.plan import STAGES
from rigidimpulse.recording import Recording
from rigidimpulse.scene import Scene
from rigidimpulse.simulation import frame_times, simulate
from rigidimpulse.studies.fingerprint import fingerprint
from rigidimpulse.studies.kept import KeptRows, kept_reference
from rigidimpulse.studies.measures import Errors, Truth, measure, penetration
from rigidimpulse.studies.peers import run_peer
from rigidimpulse.studies.reference import NONE, Reference, converged_reference, exact_reference
from rigidimpulse.studies.row import ERRORS, Row
from rigidimpulse.studies.settings import Setting, grid
from rigidimpulse.world import World, compile_scene

BUDGET, FULL_BUDGET = 60.0, 3600.0
"""s, of a study and of one of all settings."""
REFERENCE_SHARE = 0.3
"""Of the budget, for the reference."""
RUN_SHARE, PATIENCE = 0.1, 4.0
"""Of the budget, and of the time of the dearest preset, that one run may take."""
DURATION, FPS = 4.0, 60.0
FIRST = 5
"""Impacts of the beginning."""
SHORT, REPEATS = 0.3, 3
"""Runs shorter than this, in s, are repeated; the median counts."""
PEER_STEPS = (1, 2, 4, 8, 16, 64, 256)
"""Steps a frame of other engines."""


@dataclass
class Study:
    """The rows of a study, and what they were measured against.

    Attributes:
        name: of the scene. duration: s. reference: see there. rows: in the order they were run.
        left: names of settings that the budget had no time for.

    """

    name: str
    duration: float
    reference: Reference
    rows: list[Row] = field(default_factory=list)
    left: list[str] = field(default_factory=list)

    def front(self, error: str = "position") -> list[Row]:
        """Own rows that no other own row beats in both cost and error, cheapest first; error: a field of `Errors`.

        Of settings with the very same motion the first counts, since their costs differ by chance.
        """
        own = [row for row in self.rows if row.ran and not row.is_peer and not row.same_as]
        rows = [row for row in own if not math.isnan(getattr(row.whole, error))]
        rows.sort(key=lambda row: (row.cost, getattr(row.whole, error)))
        out: list[Row] = []
        for row in rows:
            if not out or getattr(row.whole, error) < getattr(out[-1].whole, error):
                out.append(row)
        return out

    def advantage(self, error: str = "position") -> list[tuple[Row, Row, float]]:
        """Each row of another engine, the best own row that took no longer (the fastest one if none did), and the ratio of their errors."""
        out, front = [], self.front(error)
        floor = max(self.reference.uncertainty if error == "position" else 0.0, float(np.finfo(float).tiny))
        for row in self.rows:
            theirs = getattr(row.whole, error)
            if row.is_peer and row.ran and front and not math.isnan(theirs):
                ours = ([own for own in front if own.cost <= row.cost] or front[:1])[-1]
                out.append((row, ours, theirs / max(getattr(ours.whole, error), floor)))
        return out

    def table(self) -> str:
        """Lines for people: every row, the front marked with a star."""
        lines = [("", "setting", "cost, s", *ERRORS, "status")]
        front = {row.name for row in self.front()}
        for row in self.rows:
            errors = [_figure(value) for value in row.whole]
            status = f"as {row.same_as}" if row.same_as and row.status == "ok" else row.status
            lines.append(("*" if row.name in front else "", row.name, _figure(row.cost), *errors, status))
        widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]) - 1)]
        return "\n".join("  ".join([*(cell.ljust(width) for cell, width in zip(line, widths)), line[-1]]).rstrip() for line in lines)


def _figure(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2g}"


def study(
    scene: Scene | str,
    duration: float | None = None,
    fps: float | None = None,
    *,
    name: str | None = None,
    settings: Sequence[Setting] | None = None,
    full: bool = False,
    budget: float = BUDGET,
    peers: Sequence[str] = (),
    first: int = FIRST,
    output: str | os.PathLike | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Study:
    """Run a scene over a grid of settings against a reference.

    Args:
        scene: a scene, or the name of one in the gallery, whose closed form is the reference if it has one.
        duration: s; fps: frames per second, at which errors are measured; by default those of the gallery scene, else 4 s at 60.
        name: what titles call the scene. settings: those to run; by default a grid of all strategies, small, or large with `full`.
        budget: s that the study may take, the reference included; settings that do not fit any more are named in `Study.left`.
        peers: other engines to run beside it, of `peers.PEERS`; they need `pip install 'rigidimpulse[peers]'`.
        first: number of impacts of the beginning that errors are told for as well.
        output: folder for `study.csv` and the charts `study.png`, `study.html` (extra `study`); a study found there is gone on with.
        progress: called with what is being run, and the share of the budget that is spent.

    Raises:
        SceneError: the scene cannot be simulated, or a name is unknown.

    """
    start = perf_counter()
    entry = _entry(scene)
    made = entry.scene() if entry is not None else scene
    assert isinstance(made, Scene)
    length = duration if duration is not None else entry.duration if entry is not None else DURATION
    fps = fps if fps is not None else entry.fps if entry is not None else FPS
    times = frame_times(length, fps)
    if len(times) < 2:
        raise SceneError(f"duration = {length!r}", "a study needs at least two frames")
    tell = progress or (lambda what, share: None)
    world = compile_scene(made)
    tell("reference", 0.0)
    mark = fingerprint(made, length, fps, first)
    reference = kept_reference(
        None if output is None else Path(output) / "reference.npz", mark,
        lambda: make_reference(made, entry, world, length, fps, REFERENCE_SHARE * budget, lambda what: tell(what, 0.0)),
    )  # fmt: skip
    out = Study(name or (entry.name if entry is not None else "scene"), length, reference)
    desk = _Desk(world, made, reference, length, fps, first, start, budget)
    kept = KeptRows(None if output is None else Path(output) / "study.csv", mark)
    jobs: list[tuple[Setting, Callable[[], Row]]] = [(each, lambda each=each: desk.run(each)) for each in settings or grid(full)]
    for peer in peers:
        jobs += [(_peer_setting(peer, k, fps), lambda peer=peer, k=k: desk.run_peer(peer, k)) for k in PEER_STEPS]
    costs: dict[str, list[tuple[float, float]]] = {}
    for setting, job in _in_turn(jobs):
        spent = perf_counter() - start
        row = kept.get(setting.name)
        if row is None and spent + _expected(costs.get(setting.family, []), setting.knob) > budget:
            out.left.append(setting.name)
            continue
        if row is None:
            tell(setting.name, min(spent / budget, 1.0))
            begin = perf_counter()
            try:
                row = job()
            except _TimeUp:
                out.left.append(setting.name)
                continue
            costs.setdefault(setting.family, []).append((setting.knob, perf_counter() - begin))
            kept.add(row)
        out.rows.append(row)
    if output is not None:
        from rigidimpulse.studies.charts import write_html, write_png

        write_renamed(Path(output) / "study.png", partial(write_png, out))
        write_renamed(Path(output) / "study.html", partial(write_html, out))
    return out


def _in_turn(jobs: list[tuple[Setting, Callable[[], Row]]]) -> list[tuple[Setting, Callable[[], Row]]]:
    """The first of every family, then the second of each, and so on: whatever the budget has time for, every family has a part in it."""
    seen: Counter[str] = Counter()
    places = []
    for setting, _ in jobs:
        places.append(0 if setting.family == "presets" else seen[setting.family])
        seen[setting.family] += 1
    return [jobs[k] for k in sorted(range(len(jobs)), key=lambda k: places[k])]


def make_reference(
    scene: Scene, entry: GalleryScene | None, world: World, duration: float, fps: float, budget: float, tell: Callable[[str], None]
) -> Reference:
    """The closed form of a gallery scene, else self-convergence."""
    if entry is not None and entry.exact is not None:
        return exact_reference(entry, world, frame_times(duration, fps))
    return converged_reference(scene, world, duration, fps, budget, tell)


def _entry(scene: Scene | str) -> GalleryScene | None:
    if isinstance(scene, str):
        from rigidimpulse import gallery

        return gallery.load(scene)
    return None


def _expected(known: list[tuple[float, float]], knob: float) -> float:
    """Time that a member of a family may take, s: in proportion to the steps, by the last that was run."""
    return known[-1][1] * max(known[-1][0] / knob, 1.0) if known and known[-1][0] > 1e-4 else sum(spent for _, spent in known[-1:])


def _peer_setting(peer: str, steps: int, fps: float) -> Setting:
    from rigidimpulse.accuracy import Accuracy

    return Setting(f"{peer}, step 1/{round(fps * steps)}", peer, 1.0 / (fps * steps), Accuracy())


class _TimeUp(Exception):
    """A run takes longer than the budget has left."""


class _Desk:
    """Runs settings of one scene and measures them; a run that takes too long is given up.

    Too long is a share of the budget, or some times what the dearest preset took, if that is more; and never beyond the budget.
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
                raise _TimeUp

        run = simulate(self.scene, self.duration, self.fps, accuracy=setting.accuracy, progress=watch)
        if setting.family == "presets":
            self.usual = max(self.usual, perf_counter() - start)
        profile = run.profile
        assert profile is not None
        loop = sum(profile.stages.get(stage, 0.0) for stage in STAGES)
        return (process_time() - cpu) * loop / profile.seconds, run

    def run_peer(self, name: str, steps: int) -> Row:
        """Run another engine with so many steps a frame."""
        setting = _peer_setting(name, steps, self.fps)
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
        if truth is None or self.reference.kind == NONE:
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
