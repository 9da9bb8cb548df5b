"""Accuracy targets: the scene is run on a ladder of settings, coarse ones first, and the cheapest one that meets the target is taken.

Let u_k be the run on rung k (`settings.rung`) and d_k the largest distance between u_k and u_(k+1). For an error c h^p with p >= 1,
halving the step leaves at most half of it, so e_k <= 2 d_k. That is for errors that have begun to shrink as they should; so

    e_k  ~  SAFETY max(d_k, d_(k-1) / 8) + r_k + floor

where r_k is how far u_k moves when it starts with an error of rounding (`reference.perturbed`) and its impact times may be off by LOOSER
times their tolerance. The term d_(k-1) / 8 counts where d_k is small by chance. Two neighbours may be on one branch of a motion that has
several, and far off together: so a rung is taken only if the next but one is within the bounds of it, too. The floor is an error that all
rungs share: the rounding of the positions themselves and, where contacts last, the gap at which bodies rest
(`tolerances.TOLERANCES.contact.margin` of a body's size; in sub-stepped islands the skin, relative to half a size).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.model.world import World
from rigidimpulse.recording.choice import UNKNOWN, Choice, Estimate, Try
from rigidimpulse.recording.events import Event
from rigidimpulse.recording.recording import Recording, SimulatedRecording, Status
from rigidimpulse.scene.accuracy_targets import InTime, Within
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.deviation import deviation
from rigidimpulse.studies.reference import perturbed
from rigidimpulse.studies.settings import Setting, rung

SAFETY = 3.0
LAST_RUNG = 7
"""A step of 1/3840 s."""
LOOSER = 4.0
FLOOR = 8.0 * float(np.finfo(float).eps)
"""Of the largest coordinate, and of the largest angle turned."""


def simulate_to_target(
    scene: Scene, duration: float, fps: float, target: object, effects: Mapping[str, bool] | None, progress: Callable[[float], None] | None
) -> SimulatedRecording:
    """Choose a setting and return its run; see `simulate`.

    Raises:
        SceneError: as `simulate`; or the accuracy is neither a name, an Accuracy nor an accuracy target.

    """
    if not isinstance(target, Within | InTime):
        raise SceneError(f"accuracy {target!r}", "give 'preview', 'standard', 'exact', an Accuracy, Within(...) or InTime(...)")

    def run(setting: Setting, end: float, given: Scene = scene) -> SimulatedRecording:
        return simulate_whole(given, end, fps, accuracy=setting.accuracy, effects=effects, progress=progress)

    chosen, choice = _within(run, scene, duration, target) if isinstance(target, Within) else _in_time(run, scene, duration, target)
    events = chosen.status.events
    if not choice.met:
        names = tuple(body.name for body in scene.bodies if body.motion == "dynamic")
        events = (*events, Event(choice.until, "accuracy not reached", names, f"{_complaint(target)}: {choice.message}"))
    status = Status.of(events)
    return replace(chosen, status=replace(status, message=f"{status.message}\n{choice.message}"), choice=choice)


def _complaint(target: Within | InTime) -> str:
    if isinstance(target, InTime):
        return f"no setting computes a frame in {target.per_frame:g} s; allow more time, or have fewer bodies"
    return "no setting meets the target; give larger bounds, or an earlier `until` (chaos has no remedy: see run.horizon)"


def _within(run: Callable[..., SimulatedRecording], scene: Scene, duration: float, target: Within) -> tuple[SimulatedRecording, Choice]:
    """Return the cheapest rung whose estimated error is within the bounds, and its run."""
    until = duration if target.until is None else min(target.until, duration)
    settings = [rung(0)]
    runs, steps, errors = [run(settings[0], until)], [], []

    def drift(level: int) -> np.ndarray:
        """What rounding and tolerance do to a rung; asked only of one that might do."""
        return _apart(runs[level], run(_looser(settings[level]), until, perturbed(scene)))

    passed = -1  # the rung that is within the bounds as far as the next one says
    for level in range(1, LAST_RUNG + 1):
        settings.append(rung(level))
        runs.append(run(settings[-1], until))
        steps.append(_apart(runs[-2], runs[-1]))
        errors.append(_estimate(steps, np.zeros(2), runs[-2]))
        if passed >= 0:
            if (wide := _widened(errors[passed], _apart(runs[passed], runs[-1]) + _floor(runs[passed]))).within(target):
                break
            errors[passed], passed = wide, -1
        if not Estimate(*_floor(runs[-2]).tolist()).within(target):
            break  # finer steps would not help
        if errors[-1].within(target):
            errors[-1] = _estimate(steps, drifted := drift(level - 1), runs[-2])
            if errors[-1].within(target):
                passed = level - 1
            elif drifted.max() >= steps[-1].max() and settings[-2].accuracy.tolerance <= rung(LAST_RUNG).accuracy.tolerance:
                break  # it is about as good as rounding lets it be
    best = passed
    if best < 0:
        best = int(np.argmin([error.position for error in errors]))
        errors[best] = _estimate(steps[: best + 1], drift(best), runs[best])
    tries = [Try(setting.accuracy, _seconds(made), error) for setting, made, error in zip(settings, runs, [*errors, UNKNOWN], strict=True)]
    how = "from runs with a half and a quarter of the step, and one started off by rounding"
    choice = Choice(target, settings[best].accuracy, errors[best].within(target), errors[best], until, how, tuple(tries))
    return (runs[best] if until == duration else run(settings[best], duration)), choice


def _widened(error: Estimate, apart: np.ndarray) -> Estimate:
    """The estimate, and no less than a distance [m] and an angle [rad], (2,)."""
    return Estimate(max(error.position, float(apart[0])), max(error.angle, float(apart[1])))


def _in_time(run: Callable[..., SimulatedRecording], scene: Scene, duration: float, target: InTime) -> tuple[SimulatedRecording, Choice]:
    """Return the finest rung whose frames take no longer than the target allows, and its run."""
    settings, runs, steps = [], [], []
    for level in range(LAST_RUNG + 1):
        settings.append(rung(level))
        runs.append(run(settings[-1], duration))
        if level:
            steps.append(_apart(runs[-2], runs[-1]))
        if _seconds(runs[-1]) > target.per_frame * len(runs[-1].times):
            break
    fast = [k for k, made in enumerate(runs) if _seconds(made) <= target.per_frame * len(made.times)]
    best = fast[-1] if fast else 0
    drift = _apart(runs[best], run(_looser(settings[best]), duration, perturbed(scene)))
    # The finest that was run has nothing finer to compare with: what the one before is off by bounds its error.
    error = _estimate(steps[: best + 1], drift, runs[best]) if steps else UNKNOWN
    tries = tuple(Try(setting.accuracy, _seconds(made), UNKNOWN) for setting, made in zip(settings, runs, strict=True))
    how = f"from a run with {'half' if best < len(steps) else 'twice'} the step, and one started off by rounding"
    return runs[best], Choice(target, settings[best].accuracy, bool(fast), error, duration, how, tries)


def _looser(setting: Setting) -> Setting:
    """The setting with a larger tolerance of impact times."""
    return setting._replace(accuracy=setting.accuracy.model_copy(update={"tolerance": LOOSER * setting.accuracy.tolerance}))


def _seconds(run: Recording) -> float:
    """Time that a run took without the loading of kernels, s."""
    assert run.profile is not None
    return run.profile.seconds - run.profile.preparing


def _apart(a: Recording, b: Recording) -> np.ndarray:
    """Largest distance [m] and angle [rad] between two runs, (2,)."""
    apart = deviation(a, b)
    return np.array([apart.distance.max(initial=0.0), apart.angle.max(initial=0.0)])


def _floor(run: Recording) -> np.ndarray:
    """What runs on all rungs have in common: rounding, and what lasting contacts leave between bodies; m and rad, (2,)."""
    assert run.scene is not None and run.ledger is not None
    world = compile_scene(run.scene)
    spin = float(np.linalg.norm(run.angular_velocities, axis=2).max(initial=0.0))
    rounding = FLOOR * np.array([np.abs(run.positions).max(initial=0.0), 1.0 + spin * run.times[-1]])
    touching = [island for island in _islands(run, world) if len(island) > 0]
    share = 0.5 * TOLERANCES.sub_stepping.skin if "sub-stepping" in run.ledger.dissipated else 2.0 * TOLERANCES.contact.margin
    return rounding + share * np.array([max((world.size[island].sum() for island in touching), default=0.0), float(bool(touching))])


def _islands(run: Recording, world: World) -> list[np.ndarray]:
    """Return the dynamic bodies (indices) of each island that lasting contacts joined at some time; the gaps of an island add up."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    a, b, n = run.contacts["body_a"], run.contacts["body_b"], world.num_bodies
    touched = np.isin(np.arange(n), np.concatenate([a, b])) & world.dynamic
    inner = world.dynamic[a] & world.dynamic[b]
    links = coo_matrix((np.ones(int(inner.sum())), (a[inner], b[inner])), (n, n))
    count, label = connected_components(links, directed=False)
    return [np.flatnonzero((label == k) & touched) for k in range(count)]


def _estimate(steps: list[np.ndarray], drift: np.ndarray, run: Recording) -> Estimate:
    """The estimate for a run whose distance to the next finer one is the last of `steps`."""
    step = np.maximum(steps[-1], steps[-2] / 8.0) if len(steps) > 1 else steps[-1]
    return Estimate(*(SAFETY * step + drift + _floor(run)).tolist())
