"""The page of a recording, without a browser: keys, display geometry, arrows, framing, the file and its server."""

from __future__ import annotations

import base64
import gzip
import json
import re
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
from hypothesis import given
from hypothesis import strategies as st

from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape
from rigidimpulse.view import camera as framing
from rigidimpulse.view.arrows import LEAST_LENGTH, MOST_ROWS, arrow_rows, arrow_scale, fade_time
from rigidimpulse.view.display import display_mesh, display_planes, shade
from rigidimpulse.view.materials import PALETTE, color, surface
from rigidimpulse.view.page import render_page, write_html
from rigidimpulse.view.server import show
from rigidimpulse.view.tracks import body_tracks, quaternion_keys, thin_keys

NO_CARD = np.zeros(0, np.int64)
QUARTER_TURN = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)  # about x


def recording(scene: Scene, times: np.ndarray, positions: np.ndarray, orientations: np.ndarray | None = None,
              impacts: np.ndarray | None = None) -> Recording:  # fmt: skip
    """Return a made-up recording of poses (f, n, 3) and (f, n, 4)."""
    if orientations is None:
        orientations = np.tile([1.0, 0.0, 0.0, 0.0], (*positions.shape[:2], 1))
    impacts = np.zeros(0, IMPACT_DTYPE) if impacts is None else impacts
    return Recording(times, list(scene.names), positions, orientations, positions, positions, positions, impacts,
                     scene=scene)  # fmt: skip


def ball_run(num_frames: int = 5, **scene_arguments: Any) -> Recording:
    """Return a ball that rises along z beside a floor."""
    scene = Scene(**scene_arguments)
    scene.add(Body("floor", Shape.half_space(), motion="static"))
    scene.add(Body("ball", Shape.sphere(0.5)))
    times = np.arange(num_frames) / 24.0
    positions = np.zeros((num_frames, 2, 3))
    positions[:, 1, 2] = 0.5 + times
    return recording(scene, times, positions)


def manifest_of(page: str) -> dict[str, Any]:
    """Return the manifest of a page."""
    found = re.search(r'<script id="manifest" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.loads(found.group(1))


def messages_of(page: str, kind: str) -> list[dict[str, Any]]:
    """Return the meshcat messages of a page of one kind."""
    packed = re.findall(rf'<script class="command" type="text/plain" data-kind="{kind}">(.*?)</script>', page)
    return [umsgpack.unpackb(gzip.decompress(base64.b64decode(text))) for text in packed]


def impacts_of(*rows: tuple[float, int, int, float]) -> np.ndarray:
    """Return impacts (time, body_a, body_b, impulse) at the origin, normal z, without friction."""
    table = np.zeros(len(rows), IMPACT_DTYPE)
    for row, (at, body_a, body_b, impulse) in zip(table, rows, strict=True):
        row["time"], row["body_a"], row["body_b"], row["impulse"] = at, body_a, body_b, impulse
        row["normal"] = (0, 0, 1)
    return table


class TestTracks:
    def test_quaternion_sign_never_jumps_and_the_rotation_stays(self) -> None:
        half_angle = np.linspace(0.0, 9.0, 40)
        wxyz = np.stack([np.cos(half_angle), 0 * half_angle, 0 * half_angle, np.sin(half_angle)], axis=1)
        wxyz[::3] *= -1.0
        keys = quaternion_keys(wxyz)
        # Steps of 9/39 rad of half angle: neighbours have the cosine 0.97, or -0.97 where the sign jumps.
        assert np.all(np.einsum("ij,ij->i", keys[1:], keys[:-1]) > 0.9)
        assert np.array_equal(np.abs(keys), np.abs(wxyz[:, [1, 2, 3, 0]]))

    @given(st.lists(st.integers(0, 2), min_size=1, max_size=30))
    def test_dropped_keys_do_not_change_the_motion(self, values: list[int]) -> None:
        stored = np.array(values, dtype=np.float32)[:, None]
        times = np.arange(len(values), dtype=float)
        kept = thin_keys(stored)
        fine = np.linspace(0.0, times[-1], 4 * len(values) + 1)
        assert np.array_equal(np.interp(fine, times[kept], stored[kept, 0]), np.interp(fine, times, stored[:, 0]))

    def test_body_at_rest_has_no_track_and_a_resting_end_costs_one_key(self) -> None:
        times = np.arange(100) / 24.0
        still = np.tile([1.0, 2.0, 3.0], (100, 1))
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (100, 1))
        assert body_tracks(times, still, upright) == []
        moving = still + np.minimum(times, 1.0)[:, None]
        (track,) = body_tracks(times, moving, upright)
        assert track.name == "position"
        assert len(track.times) == 24 + 1 + 1  # 24 frames on the way, the first at rest, the last

    def test_a_key_costs_49_bytes_at_most(self) -> None:
        num_frames = 2000
        run = ball_run(num_frames)
        angle = np.linspace(0, 30, num_frames)
        run.orientations[:, 1] = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=1)
        page = render_page(run)
        (motion,) = messages_of(page, "motion")
        raw = len(umsgpack.packb(motion))
        assert raw / num_frames < 37.0  # 4 (3 + 1) + 4 (4 + 1) and the names
        assert len(page) - len(render_page(ball_run(1))) < 49 * num_frames


class TestDisplayGeometry:
    @pytest.mark.parametrize(
        "shape",
        [
            Shape.sphere(0.7),
            Shape.box((1, 2, 3)),
            Shape.capsule(0.3, 1.2),
            Shape.cylinder(0.4, 0.9),
            Shape.convex_hull(np.random.default_rng(3).normal(size=(30, 3))),
            Shape.compound([(Shape.sphere(0.2), (1, 0, 0), (1, 0, 0, 0)), (Shape.box(0.3), (0, 0, 1), QUARTER_TURN)]),
        ],
        ids=lambda shape: shape.kind,
    )
    def test_surface_is_closed_and_normals_are_outward_units(self, shape: Shape) -> None:
        mesh = display_mesh(shape)
        assert mesh is not None
        corners = mesh.vertices[mesh.faces]
        area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.ptp(mesh.vertices, axis=0).max()
        # The area vectors of a closed surface add up to nothing; drawn inside out its volume is negative.
        assert np.allclose(area.sum(axis=0), 0.0, atol=1e-12 * size**2)
        assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0.0
        assert np.all(np.linalg.norm(area, axis=1) > 0.0)
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-12)
        face_normal = area / np.linalg.norm(area, axis=1, keepdims=True)
        slope = np.einsum("fkj,fj->fk", mesh.normals[mesh.faces], face_normal)
        assert np.all(slope > np.cos(np.radians(35.0)))

    def test_sphere_has_the_normals_of_the_sphere(self) -> None:
        mesh = display_mesh(Shape.sphere(2.0))
        assert mesh is not None
        assert np.allclose(mesh.vertices, 2.0 * mesh.normals, rtol=0, atol=1e-15)

    def test_capsule_reaches_from_tip_to_tip_and_cylinder_from_end_to_end(self) -> None:
        for shape, half in ((Shape.capsule(0.3, 1.2), 0.9), (Shape.cylinder(0.3, 1.2), 0.6)):
            mesh = display_mesh(shape)
            assert mesh is not None
            assert np.allclose([mesh.vertices.min(axis=0)[2], mesh.vertices.max(axis=0)[2]], [-half, half])
            assert np.linalg.norm(mesh.vertices[:, :2], axis=1).max() == pytest.approx(0.3)

    def test_edges_of_a_box_are_sharp(self) -> None:
        mesh = display_mesh(Shape.box((1, 2, 3)))
        assert mesh is not None
        assert len(mesh.vertices) == 24
        assert np.array_equal(np.sort(np.abs(mesh.normals), axis=1), np.tile([0.0, 0.0, 1.0], (24, 1)))

    @pytest.mark.parametrize(("bend", "smooth"), [(30.0, True), (40.0, False)])
    def test_crease_divides_smooth_from_sharp(self, bend: float, smooth: bool) -> None:
        rise = np.tan(np.radians(0.5 * bend))
        vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, -rise], [1, 0, -rise]], dtype=float)
        mesh = shade(vertices, np.array([[0, 1, 2], [0, 3, 1]]))
        assert len(mesh.vertices) == (4 if smooth else 6)
        if smooth:
            assert np.allclose(mesh.normals, np.where(vertices[:, :1] == 0.0, [0, 0, 1], mesh.normals), atol=1e-12)

    def test_half_spaces_are_planes(self) -> None:
        assert display_mesh(Shape.half_space()) is None
        shape = Shape.compound([(Shape.half_space((0, 0, 2), 2), (0, 0, 1), QUARTER_TURN), (Shape.box(1), (0, 0, 0),
                                (1, 0, 0, 0))])  # fmt: skip
        ((normal, offset),) = display_planes(shape)
        assert np.allclose(normal, [0, -1, 0])  # z turned about x by a quarter
        assert offset == pytest.approx(1.0)  # n . x = 1 in the part, whose origin lies in the plane n . x = 0
        assert display_mesh(shape) is not None


class TestArrows:
    def test_impulse_acts_plus_on_b_and_minus_on_a(self) -> None:
        table = impacts_of((0.5, 0, 1, 4.0), (0.25, 1, 2, 1.0))
        table["tangent_impulse"][0] = (3, 0, 0)
        rows = arrow_rows(table, dynamic=[False, True, True], longest=2.0, with_card=np.array([1, 0]))
        assert np.array_equal(rows[:, 0], np.float32([0.25, 0.25, 0.5]))  # sorted; two for the pair of dynamic bodies
        assert np.allclose(rows[0, 4:7] + rows[1, 4:7], 0.0)
        assert np.allclose(rows[2, 4:7], [0.6, 0.0, 0.8])
        assert rows[2, 10] == pytest.approx(2.0)
        assert rows[0, 10] == pytest.approx(2.0 / 5.0)  # one scale: 5 N s are 2 m long
        assert arrow_scale(table, 2.0) == pytest.approx(2.0 / 5.0)
        assert np.array_equal(rows[:, 11], [0, 0, 1])  # numbers of their cards

    def test_length_keeps_the_order_of_the_impulses(self) -> None:
        impulses = 10.0 ** np.arange(-9, 3)
        rows = arrow_rows(impacts_of(*((k, 0, 1, j) for k, j in enumerate(impulses))), [False, True], 1.0, NO_CARD)
        assert np.all(np.diff(rows[:, 10]) >= 0.0)
        assert rows[0, 10] == pytest.approx(LEAST_LENGTH)
        assert rows[-1, 10] == 1.0

    def test_nothing_to_draw(self) -> None:
        assert arrow_rows(impacts_of(), [False, True], 1.0, NO_CARD).shape == (0, 12)
        assert arrow_rows(impacts_of((0.0, 0, 1, 0.0)), [True, True], 1.0, NO_CARD).shape == (0, 12)
        assert arrow_rows(impacts_of((0.0, 0, 1, 2.0)), [False, False], 1.0, NO_CARD).shape == (0, 12)
        assert arrow_scale(impacts_of(), 1.0) == 0.0

    def test_most_arrows_are_the_largest(self) -> None:
        table = np.repeat(impacts_of((0.0, 0, 1, 1.0)), MOST_ROWS + 7)
        table["impulse"] = 1.0 + np.arange(len(table))
        table["time"] = np.arange(len(table))
        rows = arrow_rows(table, [False, True], 1.0, NO_CARD)
        assert len(rows) == MOST_ROWS
        assert rows[0, 0] == 7.0

    def test_fade_is_shorter_in_a_short_run(self) -> None:
        assert fade_time(10.0) == 0.4
        assert fade_time(0.01) == pytest.approx(0.0015)
        assert fade_time(0.0) > 0.0


class TestFraming:
    @given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-2))
    def test_up_is_turned_to_y(self, gravity: tuple[float, float, float]) -> None:
        up = framing.up_axis(gravity)
        rotation = framing.stage_rotation(up)
        # 1 + y may be as small as 1e-12 next to -Y, where its rounding, 1e-16, grows to 1e-4.
        assert np.allclose(rotation @ up, [0, 1, 0], atol=1e-3)
        x, y, z, w = framing._stage_quaternion(up)
        turned = up + 2.0 * np.cross([x, y, z], np.cross([x, y, z], up) + w * up)
        assert np.allclose(turned, rotation @ up, atol=1e-3)

    def test_z_up_without_gravity(self) -> None:
        assert np.array_equal(framing.up_axis((0, 0, 0)), [0, 0, 1])

    def paths(self, *ends: tuple[float, float, float]) -> list[framing.Path]:
        return [
            framing.Path(f"b{k}", np.linspace((0, 0, k), end, 9), 0.1, bool(np.any(end))) for k, end in enumerate(ends)
        ]

    def test_outline_holds_every_body_at_every_time(self) -> None:
        paths = self.paths((3, 1, 2), (-1, 4, 0.5))
        result = framing.frame_action(paths, np.array([0.0, 0.0, 1.0]))
        rotation = framing.stage_rotation(np.array([0.0, 0.0, 1.0]))
        outline = np.array(result.outline) + result.centre
        for direction in framing.OUTLINE_DIRECTIONS:
            reach = max(np.max(path.position @ rotation.T @ direction) + path.radius for path in paths)
            assert np.max(outline @ direction) == pytest.approx(reach)
        assert not result.follow
        assert np.linalg.norm(result.view) == pytest.approx(1.0)
        assert result.view[1] > 0.0

    def test_scales_with_the_scene(self) -> None:
        base = framing.frame_action(self.paths((3, 1, 2)), np.array([0.0, 0.0, 1.0]))
        for scale in (1e-3, 1e3):
            paths = [
                framing.Path(path.name, scale * path.position, scale * path.radius, True)
                for path in self.paths((3, 1, 2))
            ]
            scaled = framing.frame_action(paths, np.array([0.0, 0.0, 1.0]))
            assert np.allclose(scaled.half, scale * np.array(base.half), rtol=1e-12, atol=0)
            assert np.allclose(scaled.view, base.view)

    def test_runaway_is_not_framed_and_a_long_flight_is_followed(self) -> None:
        up = np.array([0.0, 0.0, 1.0])
        with_runaway = framing.frame_action(self.paths((1, 0, 0), (0, 1, 1), (1, 1, 2), (0, 0, -500)), up)
        assert max(with_runaway.half) < 5.0
        alone = framing.frame_action(self.paths((500, 0, 0)), up)
        assert alone.follow
        assert max(alone.half) < 5.0

    def test_nothing_moves_or_nothing_is_there(self) -> None:
        up = np.array([0.0, 0.0, 1.0])
        still = framing.Path("b", np.zeros((1, 3)), 0.25, False)
        assert np.allclose(framing.frame_action([still], up).half, 0.25)
        assert max(framing.frame_action([], up).half) > 0.0


class TestSurfaces:
    def test_colours_differ_for_many_bodies(self) -> None:
        assert [color(k) for k in range(len(PALETTE))] == list(PALETTE)
        assert len({color(k) for k in range(5 * len(PALETTE))}) == 5 * len(PALETTE)

    def test_finish_follows_the_material(self) -> None:
        steel = surface(0, Body("a", Shape.sphere(1), material=Material(density=7800, dynamic_friction=0.2)), None)
        rubber = surface(0, Body("b", Shape.box(1), material=Material(density=1100, dynamic_friction=0.9)), None)
        assert steel["metalness"] > 0.5 > rubber["metalness"]
        assert steel["roughness"] < rubber["roughness"]
        assert steel["octants"] and not rubber["octants"]
        assert surface(0, Body("c", Shape.sphere(1), motion="static"), None)["octants"] is False


class TestPage:
    def test_same_recording_gives_the_same_bytes(self) -> None:
        assert render_page(ball_run()) == render_page(ball_run())

    def test_page_asks_for_nothing_outside(self, tmp_path: Path) -> None:
        path = tmp_path / "run.html"
        write_html(ball_run(), path)
        page = path.read_text(encoding="utf-8")
        assert re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"'](?!data:)", page) == []
        assert "{{" not in page.split("</style>")[0]

    def test_names_and_title_cannot_break_out(self) -> None:
        scene = Scene(bodies=[Body("</script><b>/\u2603{{script}}", Shape.sphere(1))])
        page = render_page(recording(scene, np.zeros(1), np.zeros((1, 1, 3))), title="</title><script>{{style}}")
        assert "<" not in page.split('type="application/json">')[1].split("</script>")[0]
        (body,) = manifest_of(page)["bodies"]
        assert body["name"] == "</script><b>/\u2603{{script}}"
        assert "/" not in body["key"]
        assert "<title>&lt;/title&gt;&lt;script&gt;{{style}}</title>" in page

    def test_equal_shapes_are_sent_once(self) -> None:
        scene = Scene(bodies=[Body(f"b{k}", Shape.sphere(0.5)) for k in range(30)])
        page = render_page(recording(scene, np.zeros(1), np.zeros((1, 30, 3))))
        assert len(messages_of(page, "shape")) == 1
        assert messages_of(page, "motion") == []

    def test_frame_times_and_duration(self) -> None:
        page = render_page(ball_run(num_frames=25))
        (times,) = messages_of(page, "times")
        assert np.array_equal(np.frombuffer(times["value"].data, "<f4"), (np.arange(25) / 24.0).astype(np.float32))
        (motion,) = messages_of(page, "motion")
        assert [(a["path"], a["clip"]["duration"], a["clip"]["fps"]) for a in motion["animations"]] == [
            ("/bodies/1 ball", 1.0, 1)
        ]

    def test_level_half_space_is_ground_for_any_up(self) -> None:
        for gravity, normal in (((0, 0, -9.81), (0, 0, 1)), ((0, -9.81, 0), (0, 1, 0))):
            scene = Scene(gravity=gravity)
            scene.add(Body("floor", Shape.half_space(normal), motion="static"))
            scene.add(Body("wall", Shape.half_space((1, 0, 0)), motion="static"))
            page = render_page(recording(scene, np.zeros(1), np.zeros((1, 2, 3))))
            planes = [body["planes"][0]["level"] for body in manifest_of(page)["bodies"]]
            assert planes == [True, False]
            assert {body["group"] for body in manifest_of(page)["bodies"]} == {"ground"}

    def test_pose_that_is_not_finite_is_refused_by_name(self) -> None:
        run = ball_run()
        run.positions[3, 1, 0] = np.nan
        with pytest.raises(ValueError, match=r"'ball'.*frame 3"):
            render_page(run)
        with pytest.raises(ValueError, match="no frames"):
            render_page(ball_run(num_frames=0))

    def test_500_bodies_and_240_frames(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(0)
        num_bodies, num_frames = 500, 240
        kinds = (Shape.sphere, Shape.box, lambda s: Shape.capsule(s, s), lambda s: Shape.cylinder(s, s))
        scene = Scene(bodies=[Body(f"b{k}", kinds[k % 4](rng.uniform(0.1, 0.3))) for k in range(num_bodies)])
        positions = np.cumsum(rng.normal(size=(num_frames, num_bodies, 3)), axis=0)
        orientations = rng.normal(size=(num_frames, num_bodies, 4))
        orientations /= np.linalg.norm(orientations, axis=2, keepdims=True)
        impacts = np.repeat(impacts_of((0.5, 0, 1, 1.0)), 5000)
        run = recording(scene, np.arange(num_frames) / 60.0, positions, orientations, impacts)
        path = tmp_path / "many.html"
        start = time.perf_counter()
        write_html(run, path)
        assert time.perf_counter() - start < 5.0
        assert path.stat().st_size < 10e6


class TestServer:
    def test_serves_the_page_at_one_address_until_closed(self, capsys: pytest.CaptureFixture[str]) -> None:
        first = show(ball_run(), title="first", open_browser=False)
        with show(ball_run(), title="second", open_browser=False) as viewer:
            assert viewer is first
            assert viewer.url in capsys.readouterr().out
            assert not viewer.fetched.is_set()
            with urllib.request.urlopen(viewer.url) as reply:
                assert reply.read().decode("utf-8") == render_page(ball_run(), title="second")
            assert viewer.fetched.wait(1.0)
            with pytest.raises(urllib.error.HTTPError) as missing:
                urllib.request.urlopen(viewer.url + "other")
            missing.value.close()
        viewer.close()
        with pytest.raises(urllib.error.URLError):
            urllib.request.urlopen(viewer.url, timeout=1.0)

    def test_opens_the_browser_and_waits_until_it_has_the_page(self, monkeypatch: pytest.MonkeyPatch) -> None:
        fetched = []

        def fetch(url: str) -> bool:
            with urllib.request.urlopen(url) as reply:
                fetched.append(reply.read())
            return True

        monkeypatch.setattr("webbrowser.open", fetch)
        with show(ball_run()) as viewer:
            assert viewer.fetched.is_set()
            assert len(fetched) == 1


def test_import_is_light() -> None:
    code = "import sys, rigidimpulse.view; print([m for m in ('meshcat', 'trimesh', 'numba') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
