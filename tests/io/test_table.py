"""Recordings as tables."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri


def test_a_table_has_every_bit(tmp_path: Path) -> None:
    """One row a frame and body; figures read back are the recording's to the last bit, names with commas are whole."""
    scene = ri.Scene(bodies=[ri.Body("a, b", ri.Shape.box((1, 2, 3)), velocity=(1, 0, 2), angular_velocity=(1, 2, 3))])
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(5, 0, 0)))
    run = ri.simulate(scene, 0.5, 7)
    with run.export(tmp_path / "run.csv").open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    assert head[:4] == ["time [s]", "frame", "body", "position x [m]"] and head[-1] == "angular velocity z [rad/s]"
    assert len(rows) == 2 * len(run.times) and [row[2] for row in rows[:2]] == ["a, b", "ball"]
    assert [int(row[1]) for row in rows[::2]] == list(range(len(run.times)))
    for k, name in enumerate(run.names):
        figures = np.array([[row[0], *row[3:]] for row in rows[k::2]], float)
        parts = [run.times[:, None], run.position(name), run.orientations[:, k], run.velocity(name), run.angular_velocity(name)]
        assert np.array_equal(figures, np.concatenate(parts, axis=1))
    with pytest.raises(ri.SceneError, match="start_frame"):
        run.export(tmp_path / "run.csv", start_frame=1)
