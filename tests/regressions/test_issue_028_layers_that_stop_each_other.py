"""Layers of a pile that fall one behind the other, and are stopped one after the other in the same step, do not go into each other.

Law: each layer comes to the one below while that is stopped in the same step of 1/60 s, or the next. The gap of two layers is never less
than minus the skin, 0.8 % of the inner radius. Where only what closes at the start of the step was looked for, layers of 0.1 m went 12.8 mm
into each other: 32 skins.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.quaternion import to_matrix

LAYERS, SIDE = 7, 0.1
SKIN = 0.008 * 0.5 * SIDE


def pile(gap: float, kind: str) -> ri.Scene:
    """4 x 4 columns of bodies with gaps between all of them."""
    shape = ri.Shape.box(SIDE) if kind == "boxes" else ri.Shape.convex_hull(np.array(list(np.ndindex(2, 2, 2))) * SIDE - 0.5 * SIDE)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    pitch = SIDE + gap
    for k in range(16 * LAYERS):
        scene.add(ri.Body(f"body {k}", shape, position=(pitch * (k % 4), pitch * (k // 4 % 4), 0.5 * SIDE + gap + pitch * (k // 16))))
    return scene


def gaps_of(run: ri.Recording) -> np.ndarray:
    """Gaps (f, LAYERS, 16) to what is below, along the upward face normals of both boxes, whichever is wider: columns lean and shear."""
    place = run.positions[:, 1:].reshape(len(run.times), LAYERS, 16, 3)
    axes = to_matrix(run.orientations[:, 1:]).reshape(len(run.times), LAYERS, 16, 3, 3)
    place = np.concatenate([place[:, :1] * (1.0, 1.0, 0.0) - (0.0, 0.0, 0.5 * SIDE), place], axis=1)
    axes = np.concatenate([np.broadcast_to(np.eye(3), axes[:, :1].shape), axes], axis=1)
    between, gaps = np.diff(place, axis=1), []
    for normal in (axes[:, :-1, :, :, 2], axes[:, 1:, :, :, 2]):
        reach = [0.5 * SIDE * np.abs(np.einsum("flci,flcij->flcj", normal, some)).sum(-1) for some in (axes[:, :-1], axes[:, 1:])]
        gaps.append(np.einsum("flci,flci->flc", normal, between) - reach[0] - reach[1])
    return np.maximum(*gaps)


@pytest.mark.parametrize(("gap", "kind"), [(0.02, "boxes"), (0.005, "boxes"), (0.05, "boxes"), (0.02, "hulls")])
def test_layers_stay_apart(gap: float, kind: str) -> None:
    run = ri.simulate(pile(gap, kind), 0.5, 60.0)
    assert any(line.name == "sub-stepped islands" and line.counts["steps"] > 0 for line in run.plan.lines)
    gaps = gaps_of(run)
    assert gaps.min() > -SKIN
    assert run.status.ok
