"""What a page shows beside the motion: impacts on the time line, forces of contacts, energy and momentum; and meshes drawn for others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_view import QUARTER_TURN, ball_run, impacts_of, manifest_of

from rigidimpulse.io.scene_file import load_scene
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.ledger import Ledger
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.view.display import display_mesh
from rigidimpulse.view.history import MARK_BINS, contact_rows, energy_span, impact_marks, ledger_curves
from rigidimpulse.view.materials import PALETTE
from rigidimpulse.view.page import render_page


class TestHistory:
    def test_marks_count_all_impacts_and_are_as_high_as_the_root_of_the_strongest(self) -> None:
        table = impacts_of((0.0, 0, 1, 4.0), (0.5, 0, 1, 1.0), (0.5, 0, 1, 2.25), (1.0, 0, 1, 9.0), (0.7, 0, 1, 0.0))
        counts, heights = impact_marks(table, 0.0, 1.0)
        assert counts.sum() == 4.0  # the one without an impulse is none
        assert np.array_equal(np.flatnonzero(counts), [0, MARK_BINS // 2, MARK_BINS - 1])
        assert counts[MARK_BINS // 2] == 2.0
        assert np.allclose(heights[[0, MARK_BINS // 2, -1]], [2.0 / 3.0, 0.5, 1.0])

    def test_marks_of_a_single_frame_and_of_no_impacts_are_none(self) -> None:
        assert not impact_marks(impacts_of((0.0, 0, 1, 1.0)), 0.0, 0.0).any()
        assert not impact_marks(impacts_of(), 0.0, 1.0).any()

    def contacts(self, *rows: tuple[float, float, int, int, float]) -> np.ndarray:
        """Contacts (start, end, body_a, body_b, force along z on b) at (1, 2, 3)."""
        table = np.zeros(len(rows), CONTACT_DTYPE)
        for row, (start, end, body_a, body_b, force) in zip(table, rows, strict=True):
            row["start"], row["end"], row["body_a"], row["body_b"], row["force"][2] = start, end, body_a, body_b, force
            row["point"] = (1, 2, 3)
        return table

    def test_contacts_have_the_frames_that_see_them_and_the_force_on_what_is_pushed(self) -> None:
        times, up = np.arange(5) / 4.0, np.array([0.0, 0.0, 1.0])
        table = self.contacts((0.5, np.inf, 0, 1, 8.0), (0.1, 0.6, 1, 0, -8.0), (0.3, 0.4, 0, 1, 5.0), (0.0, 1.0, 0, 0, 5.0))
        rows = contact_rows(table, times, [False, True], up, 2.0)
        # Frames at 0, 0.25, 0.5, 0.75 and 1 s: none between 0.3 and 0.4; bodies that nothing moves have no arrow.
        assert np.array_equal(rows[:, :2], [[1, 3], [2, 5]])
        assert np.array_equal(rows[:, 2:5], np.tile([1, 2, 3], (2, 1)))
        assert np.allclose(rows[:, 5:8], np.tile([0, 0, 1.2], (2, 1)))  # both push the dynamic body up; 0.6 of the longest arrow

    def test_of_two_dynamic_bodies_the_arrow_is_that_on_the_upper_one(self) -> None:
        times, up = np.arange(2) / 1.0, np.array([0.0, 0.0, 1.0])
        rows = contact_rows(self.contacts((0.0, 2.0, 0, 1, -4.0), (0.0, 2.0, 0, 1, 1.0)), times, [True, True], up, 1.0)
        assert np.all(rows[:, 7] > 0.0)
        # Root of the force, 2 to 1, where the strongest 2 % are cut: the 98th percentile of 1 and 4 is 3.94.
        assert rows[0, 7] / rows[1, 7] == pytest.approx(np.sqrt(3.94), rel=1e-6)

    def test_ledger_is_measured_from_the_least_potential_energy(self) -> None:
        times = np.arange(3.0)
        ledger = Ledger(times, np.array([0.0, 3.0, 5.0]), np.array([-2.0, -5.0, -8.0]), np.tile([1.0, 2.0, 3.0], (3, 1)), times, {})
        curves = ledger_curves(ledger)
        assert curves is not None
        assert np.array_equal(curves[:3], [[0, 3, 5], [6, 3, 0], [6, 6, 5]])
        assert np.array_equal(curves[3:], np.tile([[1], [2], [3]], (1, 3)))
        assert energy_span(ledger) == pytest.approx(13e-3)
        ledger.kinetic[1] = np.nan
        assert ledger_curves(ledger) is None and ledger_curves(None) is None

    def test_a_loaded_recording_has_no_plots(self) -> None:
        manifest = manifest_of(render_page(ball_run()))
        assert manifest["ledger"] is None and manifest["contacts"] is False


class TestRenderedMeshes:
    def scene(self, tmp_path: Path, shape: Shape) -> Scene:
        """A body of this shape as a file has it, whose node draws the shape's own surface."""
        made = Scene(bodies=[Body("thing", shape, position=(1, 2, 3), orientation=QUARTER_TURN)])
        return load_scene(made.export(tmp_path / "scene.glb"))

    @pytest.mark.parametrize("shape", [Shape.sphere(0.5), Shape.box((1, 2, 3)), Shape.cylinder(0.5, 1)], ids=lambda shape: shape.kind)
    def test_a_body_that_looks_as_it_collides_has_no_other_mesh(self, shape: Shape, tmp_path: Path) -> None:
        (body,) = bodies_as_seen(self.scene(tmp_path, shape))
        # The file gives it a colour, and that is all.
        assert body.visual is not None and body.visual.hex_color() == PALETTE[0]
        assert body.drawn_shape is body.shape

    def test_the_mesh_of_the_node_is_drawn_in_the_frame_of_the_body(self, tmp_path: Path) -> None:
        scene = self.scene(tmp_path, Shape.box((1, 2, 3)))
        # The shape that collides is another one than that of the node.
        assert scene.origin is not None
        (body,) = scene.origin.as_seen([replace(scene.bodies[0], shape=Shape.sphere(1.0))])
        mesh = display_mesh(body.drawn_shape)
        assert mesh is not None and body.drawn_shape is not body.shape
        # The corners of the box, although its node lies elsewhere and turned: half the edges away from the body's origin.
        assert np.allclose(np.abs(mesh.vertices), [0.5, 1.0, 1.5], rtol=0, atol=1e-6)
        assert np.einsum("ij,ij->i", mesh.vertices, mesh.normals).min() > 0.0
