"""Until when a run can be trusted: chaos makes any error grow, rounding as well, so after enough impacts no tolerance helps.

Two runs bracket the setting of the run, h its step and tau its tolerance,

    h sqrt(2), 10 tau    and    h / sqrt(2), tau / 10,

one started with velocities and gravity a little higher, the other lower (`reference.perturbed`), so that a scene whose setting makes no
difference is asked about rounding at least. For an error c h^p their difference is c h^p (2^(p/2) - 2^(-p/2)): 0.7 of the error of the run
for p = 1, 1.5 for p = 2. The horizon of a body is the last frame before the first at which the two differ by more than a tolerance.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.studies.deviation import agree_until, deviation
from rigidimpulse.studies.reference import TOLERANCE, perturbed

LEAST, MOST = 1e-15, 1e-2
"""Tolerances of impact times that there are."""


def find_horizon(run: Recording) -> dict[str, float]:
    """Time by dynamic body until which a run that knows its scene and settings can be trusted, s; see `Recording.horizon`."""
    assert run.scene is not None and run.settings is not None
    duration, fps, accuracy, effects = run.settings
    pair = [
        simulate_whole(perturbed(run.scene, sign), duration, fps, accuracy=beside(accuracy, sign), effects=effects or None)
        for sign in (1.0, -1.0)
    ]
    world = compile_scene(run.scene)
    bodies = np.flatnonzero(world.dynamic)
    targeted = None if run.choice is None else getattr(run.choice.target, "position", None)
    tolerance = TOLERANCE * world.size[bodies] if targeted is None else targeted
    until = agree_until(run.times, deviation(*pair).distance[:, bodies], tolerance)
    return {world.names[i]: float(time) for i, time in zip(bodies.tolist(), until, strict=True)}


def beside(accuracy: Accuracy, sign: float) -> Accuracy:
    """The setting half a rung coarser (1) or finer (-1)."""
    step, tolerance = accuracy.step * math.sqrt(2.0) ** sign, accuracy.tolerance * 10.0**sign
    return accuracy.model_copy(update={"step": step, "tolerance": min(max(tolerance, LEAST), MOST)})
