"""Animated prims that turn fast: the keyframes of their bodies are as dense as what is authored needs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_gltf_motion import turned

import rigidimpulse as ri

pytest.importorskip("pxr")
from pxr import UsdGeom
from usd_files import File

DURATION = 0.5


def keyframes_of(folder: Path, rate: float, arm: float = 0.0) -> ri.Keyframes:
    """Keyframes of a cube, `arm` m off the axis of a wheel that turns by `rate` turns a second about Z."""
    file = File()
    file.stage.SetTimeCodesPerSecond(24)
    wheel = UsdGeom.Xformable(file.prim("/wheel")).AddRotateZOp(UsdGeom.XformOp.PrecisionDouble)
    wheel.Set(0.0, 0.0)
    wheel.Set(360.0 * rate * DURATION, 24 * DURATION)
    file.body("/wheel/cube", at=(arm, 0, 0)).GetAttribute("physics:kinematicEnabled").Set(True)
    file.collider("/wheel/cube/shape", "Cube", size=0.1)
    keys = file.load(folder)["cube"].keyframes
    assert keys is not None
    return keys


@pytest.mark.parametrize("rate", [5.0, 29.0, 31.0, 50.0, 60.0, 120.0])
def test_fast_turns_do_not_alias(tmp_path: Path, rate: float) -> None:
    """With a key every 1/60 s 31 turns a second came out as 29 the other way round, and 60 as none."""
    keys = keyframes_of(tmp_path, rate)
    q, times = np.asarray(keys.orientations), np.asarray(keys.times)
    cosine = np.abs(np.sum(q[1:] * q[:-1], axis=1)).clip(max=1.0)
    turns = 2 * np.arccos(cosine)
    assert turns.max() < 0.51 * np.pi
    assert abs(turns.sum() / (2 * np.pi * DURATION) - rate) < 1e-6 * rate
    angle = 2 * np.pi * rate * times
    assert max(np.abs(turned(found) - turned((np.cos(a / 2), 0, 0, np.sin(a / 2)))).max() for found, a in zip(q, angle, strict=True)) < 1e-6


@pytest.mark.parametrize("rate", [0.1, 2.0, 20.0])
def test_ways_about_a_pivot_are_round(tmp_path: Path, rate: float) -> None:
    """Keys 1/60 s apart go straight: at 20 turns a second a body 1 m off the pivot came half a metre near to it."""
    keys = keyframes_of(tmp_path, rate, arm=1.0)
    x = np.asarray(keys.positions)
    assert np.abs(np.linalg.norm(x, axis=1) - 1.0).max() < 1e-9
    assert np.abs(np.linalg.norm(0.5 * (x[1:] + x[:-1]), axis=1) - 1.0).max() < 1e-3
