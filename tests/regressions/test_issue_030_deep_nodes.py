"""Issue 30: nodes of glTF files that are nested thousands deep are read and written in linear time; circles are refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "io"))
from gltf_files import BOX, Gltf, channels, physics, shaped, unpack, with_physics

DEEP = 5000
STEP = np.array([0.001, 0.002, -0.0005])
TURN = 2.0 * np.pi / 777.0
"""rad about y, from each node to the next."""


def nested(**deepest: object) -> list[dict]:
    """Each node below the one before, moved and turned against it."""
    turn = [0.0, float(np.sin(TURN / 2.0)), 0.0, float(np.cos(TURN / 2.0))]
    nodes: list[dict] = [{"name": f"n{k}", "translation": STEP.tolist(), "rotation": turn, "children": [k + 1]} for k in range(DEEP)]
    del nodes[-1]["children"]
    nodes[-1] |= deepest
    return nodes


def end() -> np.ndarray:
    """(3,) where the deepest node is: the sum of R^k STEP, in closed form for what the turn moves."""
    ratio = np.exp(1j * TURN)
    plane = (STEP[2] + 1j * STEP[0]) * (ratio**DEEP - 1.0) / (ratio - 1.0)  # z is turned towards x
    return np.array([plane.imag, DEEP * STEP[1], plane.real])


def turned_by(quaternion: np.ndarray) -> float:
    """rad about y, of a quaternion wxyz, in (-pi, pi]."""
    return float((2.0 * np.arctan2(quaternion[2], quaternion[0]) + np.pi) % (2.0 * np.pi) - np.pi)


@pytest.mark.parametrize("has_physics", [False, True])
def test_the_deepest_of_thousands_of_nodes_is_where_all_above_put_it(tmp_path: Path, has_physics: bool) -> None:
    """It took 16 s for 20,000 nodes, by the square of their number."""
    if has_physics:
        file = with_physics(nested(extensions=physics({"mass": 1}, shaped())), [BOX])
    else:
        file = Gltf(nested(mesh=0))
        file.mesh()
    body = ri.load_scene(file.save(tmp_path / "in.glb")).bodies[0]
    assert body.name == f"n{DEEP - 1}"
    assert np.allclose(body.position, end(), rtol=0.0, atol=1e-6)
    assert abs(turned_by(body.unit_orientation()) - (DEEP * TURN + np.pi) % (2.0 * np.pi) + np.pi) < 1e-6


def test_a_body_below_thousands_of_animated_nodes_is_written(tmp_path: Path) -> None:
    """The way up to the root went by recursion. The keys give the place that the body falls to, by g t^2 / 2."""
    nodes = nested(mesh=0)
    file = Gltf(nodes)
    file.mesh()
    file.animate(0, "translation", [0.0, 1.0], [STEP, STEP])
    nodes[-1]["extras"] = {"motion": "dynamic", "release_time": 0.25}
    scene = ri.load_scene(file.save(tmp_path / "in.glb"))
    run = ri.simulate(scene, 0.5, fps=4)
    run.export(tmp_path / "out.glb", impact_keys=False)
    values = channels(*unpack(tmp_path / "out.glb"))[f"n{DEEP - 1}", "translation"][1]
    fallen = np.linalg.norm(values[-1] - values[0])
    assert fallen == pytest.approx(0.5 * 9.81 * 0.25**2, abs=1e-5)


@pytest.mark.parametrize("size", [1, 2, DEEP])
def test_circles_of_nodes_are_refused(tmp_path: Path, size: int) -> None:
    """A node that is its own child, two, and thousands, beside a node that is fine."""
    circle = [{"name": f"n{k}", "children": [1 + (k + 1) % size]} for k in range(size)]
    with pytest.raises(ri.SceneError, match=r"'in\.glb'.*node 1 is its own ancestor.*export the file again"):
        ri.load_scene(Gltf([{"name": "fine"}, *circle]).save(tmp_path / "in.glb"))
