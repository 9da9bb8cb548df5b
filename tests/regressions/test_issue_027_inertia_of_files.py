"""Issue 27: an inertia that no body has is brought to the nearest possible one where a file gives it, and refused in a scene of Python."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

GIVEN = np.array([1.0, 1.0, 4.0])
NEAREST = np.array([5.0, 5.0, 10.0]) / 3.0
"""Nearest to (1, 1, 4) with I1 + I2 >= I3: two units too much of I3, shared along (1, 1, -1)."""


def gltf(folder: Path, moments: np.ndarray) -> Path:
    motion = {"mass": 2.0, "inertiaDiagonal": moments.tolist()}
    node = {"name": "odd", "extensions": {"KHR_physics_rigid_bodies": {"motion": motion, "collider": {"geometry": {"shape": 0}}}}}
    shapes = {"KHR_implicit_shapes": {"shapes": [{"type": "sphere", "sphere": {"radius": 0.5}}]}}
    tree = {"asset": {"version": "2.0"}, "nodes": [node], "extensions": shapes}
    (folder / "it.gltf").write_text(json.dumps(tree))
    return folder / "it.gltf"


def usd(folder: Path, moments: np.ndarray) -> Path:
    (folder / "it.usda").write_text(f"""#usda 1.0
(metersPerUnit = 1)
def Sphere "odd" (apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsCollisionAPI", "PhysicsMassAPI"])
{{
    double radius = 0.5
    float physics:mass = 2
    float3 physics:diagonalInertia = ({moments[0]}, {moments[1]}, {moments[2]})
}}
""")
    return folder / "it.usda"


def urdf(folder: Path, moments: np.ndarray) -> Path:
    figures = " ".join(f'{key}="{value}"' for key, value in zip(("ixx", "iyy", "izz"), moments, strict=True))
    (folder / "it.urdf").write_text(
        f'<robot name="it"><link name="odd"><inertial><mass value="2"/><inertia {figures}/></inertial>'
        '<collision><geometry><sphere radius="0.5"/></geometry></collision></link></robot>'
    )
    return folder / "it.urdf"


def mjcf(folder: Path, moments: np.ndarray) -> Path:
    figures = " ".join(map(str, moments))
    (folder / "it.xml").write_text(
        '<mujoco><worldbody><body name="odd"><freejoint/>'
        f'<inertial pos="0 0 0" mass="2" diaginertia="{figures}"/><geom type="sphere" size="0.5"/></body></worldbody></mujoco>'
    )
    return folder / "it.xml"


@pytest.mark.parametrize("write", [gltf, usd, urdf, mjcf])
def test_an_impossible_inertia_of_a_file_is_brought_to_the_nearest_possible_one(write, tmp_path: Path) -> None:
    """It was refused by `simulate`, and not reported; a robot had the inertia of its shape. Now it runs, and the report has the figures."""
    scene = ri.load_scene(write(tmp_path, GIVEN))
    (line,) = (line for line in scene.report if "moments of inertia" in line)
    assert "'odd'" in line and "1, 1, 4 kg m^2" in line and "1.66667, 1.66667, 3.33333" in line
    assert np.allclose(np.linalg.eigvalsh(np.asarray(scene["odd"].inertia)), NEAREST, rtol=1e-8)
    run = ri.simulate(scene, 0.1, fps=30)
    assert run.status.ok


@pytest.mark.parametrize("write", [gltf, usd, urdf, mjcf])
def test_a_possible_inertia_stays(write, tmp_path: Path) -> None:
    """Also one on the bound, of a flat body."""
    for moments in (np.array([1.0, 2.0, 2.5]), np.array([1.0, 2.0, 3.0])):
        scene = ri.load_scene(write(tmp_path, moments))
        found = np.linalg.eigvalsh(np.asarray(scene["odd"].inertia))
        assert np.allclose(found, moments, rtol=1e-15) and not any("inertia" in line for line in scene.report)


def test_no_possible_tensor_is_nearer(tmp_path: Path) -> None:
    """Law: of 2,000 bodies of random second moments none has a tensor nearer to the given one, in the Frobenius norm."""
    rng = np.random.default_rng(27)
    for _ in range(20):
        given = rng.exponential(size=3) * [1.0, 1.0, 20.0]
        scene = ri.load_scene(gltf(tmp_path, given))
        moments = np.sort(np.diag(np.asarray(scene["odd"].inertia)))
        assert moments[0] > 0.0 and moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9)
        off = np.linalg.norm(np.asarray(scene["odd"].inertia) - np.diag(given))
        factor = rng.normal(size=(2000, 3, 3)) * (rng.random((2000, 1, 1)) * np.sqrt(given.max()))
        second = factor @ factor.transpose(0, 2, 1) * rng.random((2000, 1, 1))
        other = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
        assert off <= np.linalg.norm(other - np.diag(given), axis=(1, 2)).min() * (1.0 + 1e-8)


def test_a_scene_of_python_is_refused() -> None:
    scene = ri.Scene(bodies=[ri.Body("odd", ri.Shape.sphere(0.5), mass=2.0, inertia=(1.0, 1.0, 4.0))])
    with pytest.raises(ri.SceneError, match=r"body 'odd'.*above the sum of the other two"):
        ri.simulate(scene, 0.1)
