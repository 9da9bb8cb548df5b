"""One take: the scene with its parameters, run in its cache, measured, and its page."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import write_renamed
from rigidimpulse.core.json_text import json_text
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.job import find_job
from rigidimpulse.studies.wedges.vary import is_of_run, run_settings, with_parameter

DONE, REPORTED, FAILED = "ok", "reported", "failed"
"""How a take ends: as it should, with something that its status reports, or not at all."""
FIGURES = ("kinetic", "potential", "dissipated", "travel", "seconds")
"""Numbers of a take that its file has as texts where they are not finite."""


@dataclass(frozen=True)
class TakeJob:
    """What a worker needs to know; scene: what `rigidimpulse simulate` takes, a Scene, or a function that returns one."""

    number: int
    scene: str | Scene | Callable[..., Scene]
    parameters: dict[str, Any]
    settings: dict[str, Any]
    folder: str

    @property
    def stem(self) -> Path:
        """Path of the take's files, without suffix."""
        return Path(self.folder) / f"take_{self.number:04d}"


@dataclass(frozen=True)
class Take:
    """A take that is done, or has failed.

    Attributes:
        number: from 0. parameters: their values. outcome: "ok", "reported" or "failed". message: of the status, or why it failed.
        impacts: how many. kinetic, potential, dissipated: J, at the end. travel: m, longest way of a body from start to end.
        seconds: it took. state_hash: of the recording. fingerprint: of scene and settings.
        final: by dynamic body, position (3) m and orientation (4) at the end.

    """

    number: int
    parameters: dict[str, Any]
    outcome: str
    message: str
    impacts: int = 0
    kinetic: float = 0.0
    potential: float = 0.0
    dissipated: float = 0.0
    travel: float = 0.0
    seconds: float = 0.0
    state_hash: str = ""
    fingerprint: str = ""
    final: dict[str, list[list[float]]] = field(default_factory=dict)


def make_scene(scene: str | Scene | Callable[..., Scene], parameters: dict[str, Any]) -> Scene:
    """Return the scene of a take.

    Raises:
        SceneError: no such scene, or nothing of it has a parameter's name.

    """
    made = scene
    left = {name: value for name, value in parameters.items() if not is_of_run(name)}
    if not isinstance(made, Scene):
        function: Callable[..., Scene] = find_job(made).make if isinstance(made, str) else made
        known = inspect.signature(function).parameters
        made = function(**{name: left.pop(name) for name in list(left) if name in known})
    for name, value in left.items():
        made = with_parameter(made, name, value)
    return made


def run_take(job: TakeJob) -> Take:
    """Run a take, or go on with it, or read it if it is done; what the scene is to blame for is in the result."""
    try:
        return _run(job)
    except SceneError as error:
        return Take(job.number, job.parameters, FAILED, str(error))


def _run(job: TakeJob) -> Take:
    from rigidimpulse.engine.fingerprint import fingerprint
    from rigidimpulse.engine.simulate import simulate_whole

    start = perf_counter()
    settings = run_settings(job.settings, job.parameters)
    scene = make_scene(job.scene, job.parameters)
    mark = fingerprint(scene, *settings.values())
    known = read_take(job.stem)
    if known is not None and known.fingerprint == mark:
        return known
    run = simulate_whole(scene, settings["duration"], settings["fps"], accuracy=settings["accuracy"], cache=job.stem.with_suffix(".h5"))
    run.export(job.stem.with_suffix(".html"))
    moving = [i for i, body in enumerate(scene.bodies) if body.motion == "dynamic"]
    ways = np.linalg.norm(run.positions[-1, moving] - run.positions[0, moving], axis=1)
    ledger = run.ledger
    assert ledger is not None
    take = Take(
        job.number, job.parameters, DONE if run.status.ok else REPORTED, run.status.message, len(run.impacts),
        float(ledger.kinetic[-1]), float(ledger.potential[-1]), float(sum(lost[-1] for lost in ledger.dissipated.values())),
        float(ways.max(initial=0.0)), perf_counter() - start, run.state_hash(), mark,
        {run.names[i]: [run.positions[-1, i].tolist(), run.orientations[-1, i].tolist()] for i in moving},
    )  # fmt: skip
    write_take(job.stem, take)
    return take


def write_take(stem: Path, take: Take) -> None:
    """Write the take's figures beside its cache."""
    text = json_text(vars(take), indent=1)
    write_renamed(stem.with_suffix(".json"), lambda target: target.write_text(text, encoding="utf-8"))


def read_take(stem: Path) -> Take | None:
    """The figures of a take that is done; None if there are none."""
    path = stem.with_suffix(".json")
    if not path.is_file():
        return None
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        return Take(**told | {name: float(told[name]) for name in FIGURES})
    except (ValueError, TypeError, KeyError):
        return None  # of another version
