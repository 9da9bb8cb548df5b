"""What a page draws of bodies from a file whose nodes have other meshes than colliders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gltf_files import BALL, physics, shaped, with_physics

import rigidimpulse as ri
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.view.display import DisplayMesh, display_mesh

TURN = (0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5)))  # xyzw: a quarter about z


def drawn(path: Path) -> dict[str, np.ndarray]:
    """Vertices of the meshes that are drawn in the place of shapes, by body."""
    found: dict[str, DisplayMesh] = {}
    for body in bodies_as_seen(ri.load_scene(path)):
        mesh = display_mesh(body.drawn_shape)
        if body.drawn_shape is body.shape or mesh is None:
            continue
        found[body.name] = mesh
        corners = mesh.vertices[mesh.faces]
        # Outward faces of a closed mesh have a positive volume, also below a mirror.
        assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0.0
    return {name: mesh.vertices for name, mesh in found.items()}


def test_meshes_below_a_body_are_drawn_in_its_frame_with_their_scales(tmp_path: Path) -> None:
    file = with_physics(
        [
            {"name": "ball", "translation": [5, 6, 7], "rotation": TURN, "extensions": physics({"mass": 1.0}, shaped()), "children": [1]},
            {"name": "cube", "mesh": 0, "translation": [1, 0, 0], "scale": [2, 1, -4]},
            {"name": "plain", "extensions": physics({"mass": 1.0}, shaped())},
        ],
        [BALL],
    )
    file.mesh()
    found = drawn(file.save(tmp_path / "scene.glb"))
    assert list(found) == ["ball"]  # the other node draws nothing, so its shape is shown
    # A unit cube of which x is doubled, z stretched by four and mirrored, 1 m along x of the body, whatever place and turn that has.
    low, high = found["ball"].min(axis=0), found["ball"].max(axis=0)
    assert np.allclose(low, [0.0, -0.5, -2.0], rtol=0, atol=1e-6) and np.allclose(high, [2.0, 0.5, 2.0], rtol=0, atol=1e-6)


def test_a_mesh_below_another_body_belongs_to_that(tmp_path: Path) -> None:
    file = with_physics(
        [
            {"name": "below", "extensions": physics({"mass": 1.0}, shaped()), "children": [1]},
            {"name": "above", "mesh": 0, "translation": [0, 0, 2], "extensions": physics({"mass": 1.0}, shaped())},
        ],
        [BALL],
    )
    file.mesh()
    assert list(drawn(file.save(tmp_path / "scene.glb"))) == ["above"]
