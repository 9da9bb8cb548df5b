"""Checks what the sentence of a study claims, against runs that the study does not know.

The independent reference finds impacts by conservative advancement, not by bisection, with steps that are on no ladder of the library. Two
of them bracket their own error: u with a step of 1/1440 s and v with 1/1080 s. With d = max |u - v| until the time of a claim,

    within E    |x - u| <= E + d         off by E    |x - u| >= E - d

The check says nothing where d is large, so d must be less than SHARE of the smallest body's size: ten times what the study itself takes for
the same motion. Depths are checked by points: no corner of a box may be deeper in a plane or another box than is claimed, in any of the
frames that the study looked at.
"""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate, rotate_inverse
from rigidimpulse.studies.glance.figures import DEPTH, DEPTH_FRAMES
from rigidimpulse.studies.glance.known import Glance
from rigidimpulse.studies.reference import TOLERANCE

SHARE = 10.0 * TOLERANCE
STEPS = (1440, 1080)
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def wrong_claims(known: Glance, runs: dict[str, ri.Recording] | None = None) -> list[str]:
    """What is wrong with the claims of a study, a line each; empty if all are true. runs: by name, in the place of those of the study."""
    verdict = known.verdict
    assert verdict is not None and verdict.claims
    found = {played.candidate.name: played.recording for played in known.runs if played.recording is not None} | (runs or {})
    return _wrong_depths(known, found) if known.measure == DEPTH else _wrong_places(known, found)


def _wrong_places(known: Glance, runs: dict[str, ri.Recording]) -> list[str]:
    verdict = known.verdict
    assert verdict is not None
    accuracies = [ri.Accuracy(impact_time="conservative", step=1.0 / rate, tolerance=1e-12) for rate in STEPS]
    fine, coarse = (ri.simulate(known.scene, known.duration, known.fps, accuracy=accuracy) for accuracy in accuracies)
    own, wrong = _distance(known, fine, coarse), []
    size = float(known.world.size[known.world.dynamic].min())
    for claim in verdict.claims:
        run = runs[claim.name]
        last = int(np.flatnonzero(known.times <= claim.time + 1e-9)[-1])
        doubt = float(own[: last + 1].max())
        if doubt > SHARE * size:
            wrong.append(f"{claim.name}: the motion is said to be known at {claim.time:.3f} s, but others are {doubt:.1e} m apart")
        found = _distance(known, run, fine)
        if claim.within == claim.within and found[: last + 1].max() > claim.within + doubt:
            wrong.append(f"{claim.name} is {found[: last + 1].max():.2e} m off by {claim.time:.3f} s, not within {claim.within:.2e} m")
        if claim.off == claim.off and found[last] < claim.off - doubt:
            wrong.append(f"{claim.name} is {found[last]:.2e} m off at {claim.time:.3f} s, not {claim.off:.2e} m")
    return wrong


def _distance(known: Glance, a: ri.Recording, b: ri.Recording) -> np.ndarray:
    """Largest distance (f,) of the dynamic bodies, m."""
    return np.linalg.norm(a.positions - b.positions, axis=2)[:, known.world.dynamic].max(axis=1)


def _wrong_depths(known: Glance, runs: dict[str, ri.Recording]) -> list[str]:
    """Claims that are shallower than a corner of a box is deep."""
    verdict, wrong = known.verdict, []
    assert verdict is not None
    for claim in verdict.claims:
        run = runs[claim.name]
        frames = np.unique(np.linspace(0, len(run.times) - 1, DEPTH_FRAMES).astype(int))
        deepest = max(_deepest_corner(known.scene, run, frame) for frame in frames.tolist())
        # The depth of the study has three digits.
        if deepest > 1.002 * claim.within + 1e-9:
            wrong.append(f"{claim.name} has a corner {deepest:.2e} m deep, not within {claim.within:.2e} m")
    return wrong


def _deepest_corner(scene: ri.Scene, run: ri.Recording, frame: int) -> float:
    """How deep a corner of a box lies in a half space or in another box, m."""
    boxes = [(i, np.asarray(body.shape.size)) for i, body in enumerate(scene.bodies) if body.shape.kind == "box"]
    deepest = 0.0
    for i, size in boxes:
        corners = run.positions[frame, i] + rotate(run.orientations[frame, i], CORNERS * size)
        for body in scene.bodies:
            if body.shape.kind == "half_space":
                normal, offset = body.shape.plane()
                deepest = max(deepest, float((offset - corners @ normal).max()))
        for j, other in boxes:
            if j != i and np.linalg.norm(run.positions[frame, i] - run.positions[frame, j]) < np.linalg.norm(size + other):
                local = rotate_inverse(run.orientations[frame, j], corners - run.positions[frame, j])
                deepest = max(deepest, float((0.5 * other - np.abs(local)).min(axis=1).max()))
    return deepest
