"""One scene simulated many times, with other values each time: in this process or on several cores, one result after the other.

A variation is declared as a take of a wedge is (`wedges/vary.py`). Nothing is written to disk; of each run what `keep` returns stays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from rigidimpulse.core.errors import RigidImpulseError, SceneError, unknown_name
from rigidimpulse.engine.simulate import prepare, simulate_whole
from rigidimpulse.recording.recording import Recording
from rigidimpulse.recording.status import Status
from rigidimpulse.scene.accuracy import Accuracy, Preset
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.wedges.take import make_scene
from rigidimpulse.studies.wedges.vary import UnknownParameter, run_settings


@dataclass(frozen=True, eq=False)
class FinalState:
    """How a run ended, of n bodies.

    Attributes:
        names: of the bodies, in order of index. time: s, of the last frame.
        positions: (n, 3) m, body origins. orientations: (n, 4) wxyz, body to world.
        velocities: (n, 3) m/s, centres of mass. angular_velocities: (n, 3) rad/s, world axes.
        impacts: how many impulses at contact points there were. status: how the run went. state_hash: that of the recording.

    """

    names: list[str]
    time: float
    positions: np.ndarray
    orientations: np.ndarray
    velocities: np.ndarray
    angular_velocities: np.ndarray
    impacts: int
    status: Status
    state_hash: str

    def index(self, name: str) -> int:
        """Index of a body.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        if name not in self.names:
            raise unknown_name("body", name, self.names)
        return self.names.index(name)


def final_state(run: Recording) -> FinalState:
    """Return how a run ended."""
    frames = (run.positions, run.orientations, run.velocities, run.angular_velocities)
    position, orientation, velocity, spin = (array[-1].copy() for array in frames)  # Views would keep all frames.
    end = float(run.times[-1])
    return FinalState(run.names, end, position, orientation, velocity, spin, len(run.impacts), run.status, run.state_hash())


@dataclass(frozen=True, eq=False)
class VariedRun:
    """One of many runs.

    Attributes:
        number: of its variation, from 0. parameters: what that changes.
        kept: what `keep` returned, by default a `FinalState`; None if the run failed.
        error: why it failed, with the number of the variation; None if it did not.

    """

    number: int
    parameters: Mapping[str, Any]
    kept: Any = None
    error: RigidImpulseError | None = None


@dataclass(frozen=True)
class Task:
    """What all runs share; settings: duration, fps and accuracy."""

    scene: Scene | Callable[..., Scene]
    settings: dict[str, Any]
    effects: dict[str, bool] | None
    keep: Callable[[Recording], Any]

    def run(self, number: int, parameters: Mapping[str, Any]) -> VariedRun:
        """Run a variation; whatever goes wrong is in the result."""
        try:
            settings = run_settings(self.settings, _checked(parameters))
            run = simulate_whole(make_scene(self.scene, dict(parameters)), **settings, effects=self.effects)
            return VariedRun(number, parameters, self.keep(run))
        except SceneError as error:
            return VariedRun(number, parameters, error=error.within(f"variation {number}"))
        except Exception as error:
            return VariedRun(number, parameters, error=failure(number, error))


def failure(number: int, error: BaseException) -> RigidImpulseError:
    """An error that is not the scene's, of a variation."""
    return RigidImpulseError(f"variation {number}: {type(error).__name__}: {error}")


def simulate_many(
    scene: Scene | Callable[..., Scene],
    variations: Iterable[Mapping[str, Any]],
    duration: float,
    fps: float = 60.0,
    *,
    accuracy: Preset | Accuracy = "standard",
    effects: Mapping[str, bool] | None = None,
    keep: Callable[[Recording], Any] = final_state,
    processes: int | None = 1,
) -> Iterator[VariedRun]:
    """Simulate a scene once for each variation. Each run has the bits that `simulate` gives for the changed scene.

    The scene is checked, and its kernels are compiled, when this is called; the runs go on while results are taken. They come in the
    order of the variations, which are taken as they are needed: a generator may give any number of them. A run that fails is among the
    results with its error, and stops no other; so is one whose process dies.

    Args:
        scene: what to simulate, which is not changed; or a function that returns it, whose arguments may be varied.
        variations: of each run, values by name, as `wedge` has them: `{"die.velocity": (1, 0, 0), "material.restitution": 0.3,
            "gravity.z": -1.62}`. An empty one leaves the scene as it is. See docs/guide/wedges.md for all names.
        duration, fps, accuracy, effects: as `simulate` has them.
        keep: called with each recording, in the process that ran it; what it returns is kept, the recording is not. With several
            processes it is a function that stands at the top of a module, and returns what can be pickled.
        processes: how many runs at a time. 1: in this process. None: one for each core. Programs that call this with other than 1 need
            the line `if __name__ == "__main__":`.

    Returns:
        An iterator of results. When it is closed, or left by an exception, worker processes end.

    Raises:
        SceneError: the scene, the duration or an effect cannot be used; nothing of the scene has a name of the first variation; processes
            is not 1 or more; scene or keep cannot be sent to other processes.

    """
    if processes is not None and (not isinstance(processes, int) or processes < 1):
        raise SceneError(f"processes is {processes!r}", "give a whole number >= 1, or None for one a core")
    settings = {"duration": duration, "fps": fps, "accuracy": accuracy}
    task = Task(scene, settings, None if effects is None else dict(effects), keep)
    rest = iter(variations)
    first = list(_first(rest))
    _check(task, first)
    jobs = enumerate(chain(first, rest))
    if processes == 1:
        return (task.run(number, parameters) for number, parameters in jobs)
    from rigidimpulse.studies.many_processes import check_sending, run_on_several

    check_sending(task)
    return run_on_several(task, jobs, processes)


def _first(variations: Iterator[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
    """The first of some variations, if there are any."""
    for parameters in variations:
        yield parameters
        return


def _checked(parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    if not isinstance(parameters, Mapping):
        raise SceneError(f"it is {parameters!r}", "give values by name: {'die.velocity': (1, 0, 0)}")
    return parameters


def _check(task: Task, first: list[Mapping[str, Any]]) -> None:
    """Prepare a run, so that kernels are compiled here and once; raise a SceneError for what is wrong with all runs."""
    times = frame_times(task.settings["duration"], task.settings["fps"])
    if isinstance(task.scene, Scene):
        prepare(task.scene, times, task.settings["accuracy"], task.effects)
    for parameters in first:
        try:
            made = make_scene(task.scene, dict(_checked(parameters)))
            if made is not task.scene:
                prepare(made, times, task.settings["accuracy"], task.effects)
        except UnknownParameter as error:
            raise error.within("variation 0") from None
        except Exception:
            return  # The run of this variation tells.
