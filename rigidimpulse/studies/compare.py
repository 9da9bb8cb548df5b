"""Two runs of one scene side by side: a table of how far apart they are, and a page that plays both.

    distance, angle   of the bodies, as in `deviation`
    of a flexible body: the largest distance |x_a - x_b|, m, of its vertices, and no angle

A body is apart from the first frame at which its distance is more than `APART` of its size, its largest extent.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.core.files import write_renamed
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import PRESETS
from rigidimpulse.studies.deviation import Deviation, deviation

if TYPE_CHECKING:
    from rigidimpulse.view.server import Viewer

APART = 1e-3
"""Distance over size from which a body counts as apart."""


class Row(NamedTuple):
    """A body in two runs: size m (nan without a scene), largest distance m and angle rad, time s from which it is apart (inf: never)."""

    name: str
    size: float
    distance: float
    angle: float
    apart: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two runs of one scene.

    Attributes:
        run_a, run_b: the runs.
        labels: what tables and pages call them.
        horizon: time, s, until which the results of a body are to be trusted, by its name; bodies without one are not in it.
        deviation: distance (f, n) m and angle (f, n) rad of the n bodies at times (f,) s.
        soft_body_distance: (f,) m, largest distance of the vertices, by name of flexible body.

    """

    run_a: Recording
    run_b: Recording
    labels: tuple[str, str]
    horizon: dict[str, float]
    deviation: Deviation
    soft_body_distance: dict[str, np.ndarray] = field(default_factory=dict)

    @cached_property
    def names(self) -> list[str]:
        """The bodies that are compared: those that are not static (without a scene: that move), then flexible ones."""
        scene = self.run_a.scene
        if scene is None:
            poses = [np.concatenate([run.positions, run.orientations], axis=2) for run in (self.run_a, self.run_b)]
            moves = (np.concatenate(poses) != poses[0][0]).any(axis=(0, 2))
            chosen = [name for name, moved in zip(self.run_a.names, moves, strict=True) if moved]
        else:
            chosen = [body.name for body in scene.bodies if body.motion != "static"]
        return chosen + list(self.soft_body_distance)

    def distance(self, name: str) -> np.ndarray:
        """(f,) m, between the two places of a body; of a flexible one the largest of its vertices.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        if name in self.soft_body_distance:
            return self.soft_body_distance[name]
        return self.deviation.distance[:, self.run_a.index(name)]

    def angle(self, name: str) -> np.ndarray:
        """(f,) rad, between the two attitudes of a body; zeros for a flexible one, which has none.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        if name in self.soft_body_distance:
            return np.zeros(len(self.deviation.times))
        return self.deviation.angle[:, self.run_a.index(name)]

    @cached_property
    def rows(self) -> list[Row]:
        """A row for each of `names`."""
        sizes = self._sizes()
        rows = []
        for name in self.names:
            distance, size = self.distance(name), sizes.get(name, np.nan)
            off = np.flatnonzero(distance > APART * size)
            apart = float(self.deviation.times[off[0]]) if len(off) else np.inf
            rows.append(Row(name, size, float(distance.max()), float(self.angle(name).max()), apart))
        return rows

    def table(self) -> str:
        """Return a text table, a line for each of `names`, those furthest apart first.

        Columns: largest distance (m) and angle (rad) over all frames; the time (s) of the first frame at which the distance is more than
        1e-3 of the body's size; the horizon (s), if there is one.
        """
        head = ["body", "distance, m", "angle, rad", f"{APART:g} of its size from, s", "horizon, s"]
        lines = [head]
        for row in sorted(self.rows, key=lambda row: -row.distance):
            apart = "-" if np.isnan(row.size) else "never" if np.isinf(row.apart) else f"{row.apart:.4g}"
            angle = "-" if row.name in self.soft_body_distance else f"{row.angle:.2g}"
            horizon = f"{self.horizon[row.name]:.4g}" if row.name in self.horizon else "-"
            lines.append([row.name, f"{row.distance:.2g}", angle, apart, horizon])
        if not self.horizon:
            lines = [line[:-1] for line in lines]
        widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
        aligned = ([line[0].ljust(widths[0]), *map(str.rjust, line[1:], widths[1:])] for line in lines)
        title = f"largest differences between {self.labels[0]} and {self.labels[1]}"
        return "\n".join([title, *("  ".join(line) for line in aligned)])

    def export(self, path: str | os.PathLike[str]) -> Path:
        """Write a page that plays run a, run b as ghosts in it, and a plot of how far they are apart: one .html file.

        Raises:
            SceneError: for another suffix, or runs without a scene.
            ValueError: a pose of either run is not finite.

        """
        path = Path(path)
        _check_page(path)
        page = self._page()
        return write_renamed(path, lambda target: target.write_text(page, encoding="utf-8"))

    def show(self, open_browser: bool = True) -> Viewer:
        """Open the page of `export` in the browser; returns the viewer, which ends with the program.

        Raises:
            SceneError: runs without a scene.
            ValueError: a pose of either run is not finite.

        """
        from rigidimpulse.view.server import show_page

        return show_page(self._page(), open_browser)

    def _page(self) -> str:
        self.run_a._need_scene("the page of a comparison")
        from rigidimpulse.studies.comparison_page import render_comparison

        return render_comparison(self)

    def _sizes(self) -> dict[str, float]:
        """Largest extents, m, by name; empty without a scene."""
        if self.run_a.scene is None:
            return {}
        from rigidimpulse.engine.compile_scene import compile_scene

        sizes = dict(zip(self.run_a.names, compile_scene(self.run_a.scene).size.tolist(), strict=True))
        for track in self.run_a.soft_bodies:
            sizes[track.name] = float(np.ptp(track.vertices[0], axis=0).max())
        return sizes


def compare(
    run_a: Recording, run_b: Recording, labels: Sequence[str] = ("a", "b"), horizon: Mapping[str, float] | None = None
) -> Comparison:
    """Compare two runs of one scene, at the same frame times.

    Args:
        run_a: a run; its scene has the shapes that the page draws, of both runs.
        run_b: another run of the same bodies, at another accuracy for example.
        labels: what tables and pages call them.
        horizon: time, s, until which results are to be trusted, by body name. Tables and pages mark it.

    Raises:
        SceneError: the runs have other bodies or other frame times; the labels are not two different texts; a horizon is no number or
            of an unknown body.

    """
    first, second = _two_labels(labels)
    apart = deviation(run_a, run_b)
    distances = _soft_body_distances(run_a, run_b)
    known = run_a.names + list(distances)
    for name, time in (horizon or {}).items():
        if name not in known:
            raise unknown_name("body", name, known, "horizon")
        if np.isnan(time):
            raise SceneError(f"the time of {name!r} is not a number", "give s, or leave the body out", "horizon")
    if run_a.scene is None and run_b.scene is not None:
        from dataclasses import replace

        run_a = replace(run_a, scene=run_b.scene)
    return Comparison(run_a, run_b, (first, second), {k: float(v) for k, v in (horizon or {}).items()}, apart, distances)


def check_words(words: Sequence[str], output: str | None = None) -> None:
    """Look at what a command is to compare, and where it is to write the page, before anything is run.

    Raises:
        SceneError: a word is neither a recording nor an accuracy; the output is no page.

    """
    for word in words:
        if word not in PRESETS and not is_recording(word):
            remedy = f"give a recording, a file that ends in .npz, or an accuracy: {', '.join(PRESETS)}"
            raise SceneError(f"cannot compare {word!r}", remedy)
    if output is not None:
        _check_page(Path(output))


def is_recording(word: str) -> bool:
    """Whether a word names the file of a recording."""
    return Path(word).suffix == ".npz"


def labels_of(words: Sequence[str]) -> tuple[str, str]:
    """Return labels of what two words name: accuracies, and files by their names without folders and suffix."""
    first, second = (Path(word).stem if is_recording(word) else word for word in words)
    return (first, second) if first != second else (f"A {words[0]}", f"B {words[1]}")


def frames_of(run: Recording) -> dict[str, float]:
    """Return duration (s) and fps with which another run has the frames of this one, to the last bit if it can.

    Raises:
        SceneError: the recording has a single frame.

    """
    times = run.times
    if len(times) < 2:
        raise SceneError("a recording of one frame has no frame rate", "export a longer run")
    rate = (len(times) - 1) / float(times[-1])
    near = [float(f"{rate:.12g}"), *(rate + np.arange(-4, 5) * np.spacing(rate)).tolist()]
    return {"duration": float(times[-1]), "fps": next((fps for fps in near if np.array_equal(np.arange(len(times)) / fps, times)), rate)}


def _check_page(path: Path) -> None:
    if path.suffix != ".html":
        raise SceneError(f"cannot write the comparison to {path.name!r}", "use a name that ends in .html")


def _two_labels(labels: Sequence[str]) -> tuple[str, str]:
    if isinstance(labels, str) or len(labels) != 2 or len({label for label in labels if isinstance(label, str) and label}) != 2:
        raise SceneError(f"labels are {labels!r}", "give two different texts, such as ('preview', 'exact')")
    return labels[0], labels[1]


def _soft_body_distances(a: Recording, b: Recording) -> dict[str, np.ndarray]:
    """Largest distance of the vertices, (f,) m, by flexible body; infinite where a vertex is not finite."""
    in_a, in_b = (", ".join(f"{track.name} of {track.vertices.shape[1]} vertices" for track in run.soft_bodies) or "none" for run in (a, b))
    if in_a != in_b:
        raise SceneError(f"one run has the flexible bodies {in_a}, the other {in_b}", "compare runs of one scene")
    distances = {}
    for track, other in zip(a.soft_bodies, b.soft_bodies, strict=True):
        distance = np.linalg.norm(track.vertices - other.vertices, axis=2).max(axis=1)
        distances[track.name] = np.where(np.isfinite(distance), distance, np.inf)
    return distances


def common_horizon(runs: Sequence[Recording]) -> dict[str, float]:
    """Horizons, s by body, before the end, of the run that can be trusted longer; recordings that were loaded have none."""
    known = [run.horizon for run in runs if run.settings is not None]
    longest = {name: max(horizon[name] for horizon in known) for name in (known[0] if known else ())}
    return {name: time for name, time in longest.items() if time < runs[0].times[-1]}
