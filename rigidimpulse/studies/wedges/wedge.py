"""All combinations of the varied parameters of a scene, run on several processes, and what came of them."""

from __future__ import annotations

import csv
import logging
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import make_folder, plain_cell, write_renamed
from rigidimpulse.core.json_text import json_text
from rigidimpulse.core.providers import provider
from rigidimpulse.recording.recording import Recording, load_recording
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.job import DEFAULT_DURATION, DEFAULT_FPS, find_job
from rigidimpulse.studies.wedges.take import FAILED, Take, TakeJob, make_scene
from rigidimpulse.studies.wedges.vary import UnknownParameter, combinations
from rigidimpulse.studies.wedges.workers import ONE_A_CORE, Workers, run_dask, run_here, run_pool

logger = logging.getLogger("rigidimpulse")

MEASURES = {"impacts": "", "kinetic": "J", "potential": "J", "dissipated": "J", "travel": "m", "seconds": "s"}
"""Columns of the table besides the parameters, and their units."""
LABELS = {name: f"{unit} {name}".strip() for name, unit in MEASURES.items()} | {"seconds": "s computed"}
MOST_FINAL = 2
"""Bodies at most whose last place stands on the sheet."""


@dataclass(frozen=True)
class Wedge:
    """Takes of a wedge, in order of their numbers, and the folder with their files."""

    folder: Path
    takes: list[Take]
    jobs: list[TakeJob]

    def __repr__(self) -> str:
        """Return the numbers of takes and failures, and the folder."""
        return f"Wedge({len(self.takes)} takes, {len(self.failed)} failed, in {str(self.folder)!r})"

    def _repr_html_(self) -> str:
        """Return the table, for a cell of a notebook."""
        return str(provider("cell of wedge")(self))

    @property
    def failed(self) -> list[Take]:
        """Takes that did not come to their end."""
        return [take for take in self.takes if take.outcome == FAILED]

    def recording(self, number: int) -> Recording:
        """The recording of a take, with its scene.

        Raises:
            SceneError: there is no such take, or it has failed.

        """
        from dataclasses import replace

        if not 0 <= number < len(self.takes):
            raise SceneError(f"take {number}", f"give one of 0 to {len(self.takes) - 1}")
        job = self.jobs[number]
        return replace(load_recording(job.stem.with_suffix(".h5")), scene=make_scene(job.scene, job.parameters))

    def rows(self) -> list[tuple[str, ...]]:
        """The table with its head, as text."""
        names = list(self.takes[0].parameters)
        head = ("take", *names, "outcome", *(f"{name} [{unit}]" if unit else name for name, unit in MEASURES.items()), "message")
        return [head, *(self._row(take, names) for take in self.takes)]

    def _row(self, take: Take, names: list[str]) -> tuple[str, ...]:
        figures = [f"{getattr(take, name):.6g}" for name in MEASURES] if take.outcome != FAILED else [""] * len(MEASURES)
        return (str(take.number), *(_text(take.parameters[name]) for name in names), take.outcome, *figures, take.message)


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def wedge(
    scene: str | os.PathLike[str] | Scene | Callable[..., Scene],
    vary: Mapping[str, Sequence[Any]],
    folder: str | os.PathLike[str],
    *,
    duration: float | None = None,
    fps: float | None = None,
    accuracy: str | None = None,
    workers: Workers = ONE_A_CORE,
    progress: Callable[[Take], None] | None = None,
) -> Wedge:
    """Run a scene with all combinations of parameters; each take has its cache, its page and its figures in the folder.

    A wedge that was stopped goes on where it was when it is called again. Takes that fail are in the result and stop no others. Programs
    that call this with more than one process need the line `if __name__ == "__main__":`.

    Args:
        scene: a gallery name, a scene file, a Scene, or a function that returns one, whose arguments may be varied.
        vary: values by parameter: an argument of the function, seed, duration, accuracy, gravity.z, material.restitution, NAME.FIELD, ...
            See docs/guide/wedges.md.
        folder: for the files; also of workers on other machines.
        duration, fps, accuracy: as `simulate` has them; by default those of a gallery scene, else 4 s, 60 and "standard".
        workers: which processes run the takes; by default one process for each core of this machine.
        progress: called with each take that is done.

    Raises:
        SceneError: no such scene, nothing to vary, or the folder has another wedge in it.

    """
    named = os.fspath(scene) if isinstance(scene, str | os.PathLike) else None
    job = find_job(named) if named is not None else None
    own = (job.duration, job.fps, job.accuracy) if job is not None else (DEFAULT_DURATION, DEFAULT_FPS, "standard")
    given = {"duration": duration, "fps": fps, "accuracy": accuracy}
    settings = {name: default if given[name] is None else given[name] for (name, default) in zip(given, own, strict=True)}
    told = named if named is not None else scene
    assert not isinstance(told, os.PathLike)
    jobs = [TakeJob(k, told, parameters, settings, os.fspath(folder)) for k, parameters in enumerate(combinations(vary))]
    _check_names(jobs[0])
    _claim(Path(folder), {"scene": named or getattr(scene, "__name__", "scene"), "vary": vary, "settings": settings})
    takes = []
    for take in _runs(jobs, workers):
        takes.append(take)
        if progress is not None:
            progress(take)
    result = Wedge(Path(folder), sorted(takes, key=lambda take: take.number), jobs)
    _write_table(result)
    _write_sheet(result, Path(named).stem if named is not None else getattr(scene, "__name__", "scene"))
    return result


def _runs(jobs: list[TakeJob], workers: Workers) -> Iterator[Take]:
    """Run the takes; they come in the order in which they end."""
    number = min(workers.processes or os.cpu_count() or 1, len(jobs))
    if workers.scheduler is not None:
        return run_dask(jobs, workers.scheduler, number, workers.retries)
    return run_here(jobs, workers.retries) if number == 1 else run_pool(jobs, number, workers.retries)


def _check_names(job: TakeJob) -> None:
    """Raise a SceneError where nothing of the scene has a parameter's name; whatever else is wrong with a take, it says itself."""
    try:
        make_scene(job.scene, job.parameters)
    except UnknownParameter:
        raise
    except Exception as error:
        logger.debug("the first take: %s", error)


def _claim(folder: Path, told: dict[str, Any]) -> None:
    """Write what the wedge is of into the folder, or compare it with what is there."""
    make_folder(folder)
    path = folder / "wedge.json"
    text = json_text(told, indent=1, default=lambda value: value.tolist() if hasattr(value, "tolist") else str(value))
    if path.is_file() and path.read_text(encoding="utf-8") != text:
        raise SceneError(f"{str(folder)!r} has another wedge in it", "delete it, or give another folder")
    write_renamed(path, lambda target: target.write_text(text, encoding="utf-8"))


def _write_table(result: Wedge) -> None:
    def write(target: Path) -> None:
        with target.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([plain_cell(cell) for cell in row] for row in result.rows())

    write_renamed(result.folder / "wedge.csv", write)


def _write_sheet(result: Wedge, title: str) -> None:
    """Write index.html: all takes side by side."""
    from rigidimpulse.view.sheet import Card, write_sheet

    cards = []
    for take, job in zip(result.takes, result.jobs, strict=True):
        done = take.outcome != FAILED
        measures = {LABELS[name]: float(getattr(take, name)) for name in MEASURES}
        recording = result.recording(take.number) if done else None
        page = job.stem.with_suffix(".html").name if done else ""
        told = (take.parameters, measures if done else {}, take.outcome, take.message, _final(take))
        cards.append(Card(str(take.number), recording, page, *told))
    write_renamed(result.folder / "index.html", lambda target: write_sheet(target, cards, title))


def _final(take: Take) -> str:
    """Where the bodies of a take end, if they are few."""
    places = [f"{name} ends at ({', '.join(f'{x:.3g}' for x in pose[0])}) m" for name, pose in take.final.items()]
    return "; ".join(places) if len(places) <= MOST_FINAL else ""
