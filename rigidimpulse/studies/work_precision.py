"""What accuracy costs in time: a scene run with a grid of settings, each measured against a reference, other engines beside it.

    cost     CPU time of the loop, s: of `simulate`, times the share of the stages in `run.profile`. Compiling the scene, loading kernels
             and making the recording are not in it, as building the model is not in that of other engines
    error    `measures.Errors`, of the whole run (until the reference's horizon) and of the beginning, until just before impact k + 1

A row is on the front if no other row is both cheaper and more accurate. Rows are written to a CSV file as they come, with a fingerprint of
the scene; the same study asked for again goes on where it was.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.files import write_renamed
from rigidimpulse.core.providers import provider
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.fingerprint import fingerprint
from rigidimpulse.gallery.record import GalleryScene
from rigidimpulse.model.world import World
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.job import Job
from rigidimpulse.studies.measured_runs import MeasuredRuns, TimeUp, peer_setting
from rigidimpulse.studies.reference import Reference, converged_reference, exact_reference
from rigidimpulse.studies.row import ERRORS, Row
from rigidimpulse.studies.settings import Setting, grid
from rigidimpulse.studies.stored_rows import StoredRows, stored_reference

BUDGET, FULL_BUDGET = 60.0, 3600.0
"""s, of a study and of one of all settings."""
REFERENCE_SHARE = 0.3
"""Of the budget, for the reference."""
DURATION, FPS = 4.0, 60.0
FIRST = 5
"""Impacts of the beginning, whose errors are measured as well."""
GRIDS = ("small", "full")
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

    def __repr__(self) -> str:
        """Return the scene, what the rows were measured against, and their number."""
        left = f", {len(self.left)} left" if self.left else ""
        return f"Study({self.name!r}, {self.duration:g} s, {len(self.rows)} rows{left}, reference: {self.reference.kind})"

    def _repr_html_(self) -> str:
        """Return the table, for a cell of a notebook."""
        return str(provider("cell of study")(self))

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
        """Rows of other engines, the best own row that took no longer, and the ratio of their errors.

        Rows that are faster than all own rows are left out.
        """
        out, front = [], self.front(error)
        floor = max(self.reference.uncertainty if error == "position" else 0.0, float(np.finfo(float).tiny))
        for row in self.rows:
            theirs = getattr(row.whole, error)
            ours = [own for own in front if own.cost <= row.cost]
            if row.is_peer and row.ran and ours and not math.isnan(theirs):
                out.append((row, ours[-1], theirs / max(getattr(ours[-1].whole, error), floor)))
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
    scene: Scene | str | Job,
    duration: float | None = None,
    fps: float | None = None,
    *,
    settings: Sequence[Setting] | str = "small",
    budget: float = BUDGET,
    peers: Sequence[str] = (),
    output: str | os.PathLike | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Study:
    """Run a scene over a grid of settings against a reference.

    Args:
        scene: a scene, a job that makes one, or the name of one in the gallery, whose closed form is the reference if it has one.
        duration: s; fps: frames per second, at which errors are measured; by default those of the gallery scene, else 4 s at 60.
        settings: those to run, or the name of a grid of all strategies: "small", or "full", which has more members a family.
        budget: s that the study may take, the reference included; settings that do not fit any more are named in `Study.left`.
        peers: other engines to run beside it, of `peers.PEERS`; they need `pip install 'rigidimpulse[peers]'`.
        output: folder for `study.csv` and, where the extra `study` is installed, the charts `study.png` and `settings.html`; a study found
            there is gone on with.
        progress: called with what is being run, and the share of the budget that is spent.

    Raises:
        SceneError: the scene cannot be simulated, or a name is unknown.

    """
    start = perf_counter()
    topic = topic_of(scene, duration, fps)
    chosen = _settings(settings)
    tell = progress or (lambda what, share: None)
    world = compile_scene(topic.scene)
    tell("reference", 0.0)
    mark = fingerprint(topic.scene, topic.duration, topic.fps, FIRST)
    folder = None if output is None else Path(output)
    reference = stored_reference(
        None if folder is None else folder / "reference.npz", mark,
        lambda: make_reference(topic, world, REFERENCE_SHARE * budget, lambda what: tell(what, 0.0)),
    )  # fmt: skip
    out = Study(topic.name, topic.duration, reference)
    measured_runs = MeasuredRuns(world, topic.scene, reference, topic.duration, topic.fps, FIRST, start, budget)
    jobs: list[tuple[Setting, Callable[[], Row]]] = [(each, lambda each=each: measured_runs.run(each)) for each in chosen]
    for peer in peers:
        jobs += [(peer_setting(peer, k, topic.fps), lambda peer=peer, k=k: measured_runs.run_peer(peer, k)) for k in PEER_STEPS]
    stored = StoredRows(None if folder is None else folder / "study.csv", mark)
    _run_jobs(out, _in_turn(jobs), stored, lambda: perf_counter() - start, budget, tell)
    if folder is not None and charts_are_installed():
        from rigidimpulse.studies.charts import write_html, write_png

        write_renamed(folder / "study.png", partial(write_png, out))
        write_renamed(folder / "settings.html", partial(write_html, out))
    return out


class _Topic(NamedTuple):
    """What is studied: name, scene, its gallery record if it has one, duration in s, frames per second."""

    name: str
    scene: Scene
    entry: GalleryScene | None
    duration: float
    fps: float


def _settings(settings: Sequence[Setting] | str) -> Sequence[Setting]:
    """Return the given settings, or those of the named grid."""
    if not isinstance(settings, str):
        return settings
    if settings not in GRIDS:
        raise unknown_name("grid of settings", settings, GRIDS)
    return grid(full=settings == "full")


def topic_of(scene: Scene | str | Job, duration: float | None, fps: float | None) -> _Topic:
    """Find the scene; its duration and fps are those of the gallery scene where they are not given."""
    entry, name = None, "scene"
    if isinstance(scene, str):
        from rigidimpulse import gallery

        entry = gallery.load(scene)
        name, scene = entry.name, entry.scene()
    elif isinstance(scene, Job):
        duration, fps = duration if duration is not None else scene.duration, fps if fps is not None else scene.fps
        entry, name, scene = scene.entry, scene.name, scene.make()
    elif not isinstance(scene, Scene):
        raise SceneError(f"scene is a {type(scene).__name__}", "give a Scene, or the name of one in the gallery")
    length = duration if duration is not None else entry.duration if entry is not None else DURATION
    rate = fps if fps is not None else entry.fps if entry is not None else FPS
    if len(frame_times(length, rate)) < 2:
        raise SceneError(f"duration = {length!r}", "a study needs at least two frames")
    return _Topic(name, scene, entry, length, rate)


def _run_jobs(
    out: Study, jobs: list[tuple[Setting, Callable[[], Row]]], stored: StoredRows, spent: Callable[[], float], budget: float,
    tell: Callable[[str, float], None],
) -> None:
    """Add the rows that are stored, and those that the budget has time for; spent: s until now."""
    costs: dict[str, list[tuple[float, float]]] = {}
    for setting, job in jobs:
        row = stored.get(setting.name)
        if row is None:
            begin = spent()
            if begin + _expected(costs.get(setting.family, []), setting) > budget:
                out.left.append(setting.name)
                continue
            tell(setting.name, min(begin / budget, 1.0))
            try:
                row = job()
            except TimeUp:
                out.left.append(setting.name)
                continue
            costs.setdefault(setting.family, []).append((setting.knob, spent() - begin))
            stored.add(row)
        out.rows.append(row)


def charts_are_installed() -> bool:
    """Whether charts can be drawn: the extra `study`."""
    return all(find_spec(name) is not None for name in ("matplotlib", "plotly"))


def _in_turn(jobs: list[tuple[Setting, Callable[[], Row]]]) -> list[tuple[Setting, Callable[[], Row]]]:
    """The first of every family, then the second of each, and so on: whatever the budget has time for, every family has a part in it."""
    seen: Counter[str] = Counter()
    places = []
    for setting, _ in jobs:
        places.append(0 if setting.family == "presets" else seen[setting.family])
        seen[setting.family] += 1
    return [jobs[k] for k in sorted(range(len(jobs)), key=lambda k: places[k])]


def make_reference(topic: _Topic, world: World, budget: float, tell: Callable[[str], None]) -> Reference:
    """The closed form of a gallery scene, else self-convergence."""
    if topic.entry is not None and topic.entry.exact is not None:
        return exact_reference(topic.entry, world, frame_times(topic.duration, topic.fps))
    return converged_reference(topic.scene, world, topic.duration, topic.fps, budget, tell)


def _expected(known: list[tuple[float, float]], setting: Setting) -> float:
    """Time that a member of a family may take, s, by the last (knob, s): in proportion to the steps, whatever the tolerance."""
    if not known:
        return 0.0
    knob, spent = known[-1]
    return spent if setting.family.endswith("tolerance") else spent * max(knob / setting.knob, 1.0)
