"""What runs of a scene are measured against: its closed form, its recording, or runs so fine that they agree with each other.

Self-convergence. Runs on ever higher rungs of the ladder (`settings.rung`) are compared with the one before, u_k with u_(k-1), until they
agree to AGREED of a body's size at every frame, or until time or rungs are spent. The finest run is the reference. Two things limit it:

    its own error      about |u_k - u_(k-1)|, per body and frame: errors below that say nothing
    chaos              rounding grows; so the finest setting runs once more, started off by rounding (`perturbed`), and the
                       reference is told for a body only until both agree with it to TOLERANCE of the body's size: its horizon

Where no body has a horizon beyond the first frame there is no reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.gallery.record import GalleryScene
from rigidimpulse.model.world import World
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.deviation import agree_until, deviation
from rigidimpulse.studies.measures import Truth, mechanical_energy, truth_of
from rigidimpulse.studies.settings import TIGHT, rung

AGREED = 1e-9
TOLERANCE = 1e-3
"""Of a body's size: two runs that differ by more do not agree."""
ROUNDING = 4e-16
"""Relative change of the data of motion: two units of the last place."""
FIRST_RUNG, LAST_RUNG = 2, 9
CLOSED_FORM, MEASURED, SELF_CONVERGED, NONE = "closed form", "measured", "self-converged", "none"


@dataclass(frozen=True, eq=False)
class Reference:
    """What is known of the true motion.

    Attributes:
        kind: "closed form", "measured", "self-converged" or "none". note: for people, how it came about or why there is none.
        truth: what runs are compared with; None if there is none.
        horizon: s by body, until when it can be trusted; -inf where never.
        uncertainty: m, largest error that the reference may have itself until its horizon.

    """

    kind: str
    note: str
    truth: Truth | None
    horizon: dict[str, float]
    uncertainty: float

    @property
    def until(self) -> float:
        """The time until which all bodies are told, s."""
        return min(self.horizon.values(), default=-np.inf)

    def describe(self) -> str:
        """One line for people."""
        if self.kind == NONE:
            return f"{NONE}, since {self.note}"
        limits = f"until {self.until:.4g} s, uncertain by {self.uncertainty:.1e} m"
        return f"{self.kind}, {limits}" + (f" ({self.note})" if self.kind == SELF_CONVERGED else "")


def perturbed(scene: Scene, sign: float = 1.0) -> Scene:
    """The scene with gravity, velocities and spins changed by ROUNDING of themselves, up or down by a chance that is always the same.

    Places change by ROUNDING of their largest coordinate, too little to open or close a contact.
    """
    random = np.random.default_rng(0)

    def off(value: ArrayLike) -> np.ndarray:
        return sign * ROUNDING * random.choice([-1.0, 1.0], 3) * np.asarray(value, float)

    out = Scene(gravity=np.asarray(scene.gravity, float) * (1.0 + sign * ROUNDING))
    for body in scene.bodies:
        if body.motion == "dynamic":
            velocity, spin = (np.asarray(value, float) + off(value) for value in (body.velocity, body.angular_velocity))
            place = np.asarray(body.position, float)
            body = replace(body, velocity=velocity, angular_velocity=spin, position=place + off(np.full(3, np.abs(place).max())))
        out.add(body)
    for effect in scene.effects:
        out.add(effect)
    return out


def exact_reference(entry: GalleryScene, world: World, times: np.ndarray) -> Reference:
    """The closed form, or the recording, of a gallery scene that has one."""
    assert entry.exact is not None
    law, names = entry.exact(times), list(world.names)
    position, orientation = (np.full((len(times), len(names), width), np.nan) for width in (3, 4))
    for values, target in ((law.position, position), (law.orientation, orientation)):
        for name, value in values.items():
            target[:, names.index(name)] = value
    run = simulate_whole(world.scene, float(times[-1]), 1.0 / float(times[1] - times[0]))
    truth = Truth(times, position, orientation, law.energy, mechanical_energy(world, run)[1], law.impacts)
    extent = float(np.nanmax(np.abs(position), initial=0.0))
    horizon = {name: float(times[-1]) for name in law.position}
    if law.noise > 0.0:
        return Reference(MEASURED, "the recorded motion", truth, horizon, law.noise)
    return Reference(CLOSED_FORM, "closed form of the gallery scene", truth, horizon, float(np.finfo(float).eps) * extent)


def converged_reference(
    scene: Scene, world: World, duration: float, fps: float, budget: float, tell: Callable[[str], None]
) -> Reference:
    """Make a reference by self-convergence in about `budget` s; tell: called with what is being run."""
    times, start, spent = frame_times(duration, fps), perf_counter(), 0.0
    size = world.size[world.dynamic]
    if len(size) == 0:
        return Reference(NONE, "nothing moves", None, {}, np.nan)
    runs: list[Recording] = []
    note = "the finest rung of the ladder was reached"
    for level in range(FIRST_RUNG, LAST_RUNG + 1):
        accuracy = Accuracy(step=rung(level).accuracy.step, tolerance=TIGHT)
        tell(f"reference, step {accuracy.step:.2g} s")
        begin = perf_counter()
        try:
            runs.append(simulate_whole(scene, duration, fps, accuracy=accuracy))
        except SceneError as error:
            return Reference(NONE, f"the reference cannot be run: {error}", None, {}, np.nan)
        spent = perf_counter() - begin
        if len(runs) > 1 and _distance(runs[-1], runs[-2], world).max(initial=0.0) <= AGREED * float(size.min()):
            note = f"two runs agree, the finer one with a step of {accuracy.step:.2g} s"
            break
        # The next rung takes about twice as long, the perturbed run as long again.
        if perf_counter() - start + 4.0 * spent > budget and len(runs) > 1:
            note = f"time was spent at a step of {accuracy.step:.2g} s"
            break
    tell("reference, started off by rounding")
    settings = runs[-1].settings
    assert settings is not None
    twin = simulate_whole(perturbed(scene), duration, fps, accuracy=settings.accuracy)
    return reference_of(world, times, runs[-1], [runs[-2] if len(runs) > 1 else twin, twin], note)


def _distance(a: Recording, b: Recording, world: World) -> np.ndarray:
    """Distances (f, d) of the dynamic bodies, m."""
    return deviation(a, b).distance[:, world.dynamic]


def reference_of(world: World, times: np.ndarray, finest: Recording, others: list[Recording], note: str) -> Reference:
    """The finest run, as far as the others agree with it.

    Args:
        world: the compiled scene. times: (f,) s.
        finest: the run that is taken for the truth.
        others: what it is compared with: coarser runs, and one that started off by rounding.
        note: for people, how the runs came about.

    """
    bodies = np.flatnonzero(world.dynamic)
    distance = np.maximum.reduce([_distance(finest, other, world) for other in others])
    until = agree_until(times, distance, TOLERANCE * world.size[bodies])
    horizon = {world.names[i]: float(t) for i, t in zip(bodies.tolist(), until, strict=True)}
    if until.max() <= times[0]:
        return Reference(NONE, f"two runs part at once ({note})", None, horizon, np.nan)
    truth, beyond = truth_of(world, finest), times[:, None] > until
    for value in (truth.position, truth.orientation):
        told = value[:, bodies]
        told[beyond] = np.nan
        value[:, bodies] = told
    return Reference(SELF_CONVERGED, note, truth, horizon, float(np.where(beyond, 0.0, distance).max()))
