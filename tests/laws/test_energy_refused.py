"""Energies that make no sense, and scenes that cannot be settled, are refused with what to change."""

from __future__ import annotations

import numpy as np
import pytest
from test_energy_layouts import disorder

import rigidimpulse as ri


@pytest.mark.parametrize(
    ("energies", "words"),
    [
        ([], "give a list with one or more"),
        (ri.NoOverlap(), "give a list"),
        ([ri.NoOverlap], "is no energy of bodies"),
        ([ri.Curvature(1.0)], "is no energy of bodies"),
        ([ri.PinPoints("bax", "ball", (0, 0, 0), (0, 0, 0))], "unknown body 'bax'; did you mean 'box'"),
        ([ri.PinPoints("box", "box", (0, 0, 0), (0, 0, 0))], "same body"),
        ([ri.PinPoints(None, None, (0, 0, 0), (0, 0, 0))], "same body"),
        ([ri.PinPoints("box", "ball", (0, 0), (0, 0, 0))], "anchor_a is"),
        ([ri.PinPoints("box", "ball", (0, 0, 0), (0, 0, 0), 0.0)], "weight is 0.0; give a number > 0"),
        ([ri.RestoreShape(["box"])], "name two or more"),
        ([ri.RestoreShape("box")], "give a list of names"),
        ([ri.RestoreShape(["box", "floor"])], "'floor' is a half space"),
        ([ri.RestoreShape(["box", "ball"], positions=[(0, 0, 0)])], r"give finite numbers \(2, 3\)"),
        ([ri.RestoreShape(["box", "ball"], orientations=np.zeros((2, 4)))], "give quaternions"),
        ([ri.NoOverlap(gap=-1.0)], "gap is -1.0"),
        ([ri.NoOverlap(bodies=["box", "box"])], "each once"),
        ([ri.NoOverlap(np.nan)], "weight is nan"),
        ([ri.PointOnSurface("box", "box", (0, 0, 0))], "another body"),
        ([ri.PointOnSurface("box", "ball", (0, 0, np.inf))], "anchor is"),
    ],
)
def test_bad_energies_are_refused(energies: list, words: str) -> None:
    with pytest.raises(ri.SceneError, match=words):
        ri.settle(disorder(), energies)


def test_scenes_that_cannot_be_settled_are_refused() -> None:
    scene = disorder()
    scene.add(ri.BallJoint("box", "ball", (0, 0, 0)))
    with pytest.raises(ri.SceneError, match="settle the bodies first"):
        ri.settle(scene, [ri.NoOverlap()])
    with pytest.raises(ri.SceneError, match="no dynamic body"):
        ri.settle(ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")]), [ri.NoOverlap()])
    with pytest.raises(ri.SceneError, match="cannot be added to a scene"):
        disorder().add(ri.NoOverlap())
