"""Two runs side by side, without a browser: distances and angles of known motions, the table, what is refused, the page's contents."""

from __future__ import annotations

import base64
import gzip
import json
import re
import urllib.request
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
from click.testing import CliRunner

import rigidimpulse as ri
from rigidimpulse.cli.cli import BAD_SCENE, main
from rigidimpulse.core.quaternion import multiply
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
from rigidimpulse.engine.simulate import frame_times
from rigidimpulse.recording.events import IMPACT_DTYPE
from rigidimpulse.studies.compare import frames_of, labels_of
from rigidimpulse.studies.comparison_page import COMPARISON_SCRIPTS, render_comparison
from rigidimpulse.view.page import SCRIPTS, render_page

FPS = 24.0
DRIFT = np.array([3e-3, 0.0, 4e-3])  # m/s by which the ball of the second run runs away: 5e-3 m/s
TURN = 0.5  # rad/s by which its box turns on, about AXIS
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ROUND_OFF = 1e-15  # a few roundings of places and quaternions of size 1, each 1.1e-16


def turn_about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the quaternions (f, 4) of turns by angles (f,) about a unit axis."""
    return np.concatenate([np.cos(0.5 * angle)[:, None], np.sin(0.5 * angle)[:, None] * axis], axis=1)


def runs(num_frames: int = 49) -> tuple[ri.Recording, ri.Recording]:
    """Two made-up runs of a floor, a ball and a box, and a cloth: in the second the ball drifts off, the box turns on, a corner lifts."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.5), position=(0, 0, 1)))
    scene.add(ri.Body("box </script>{{script}}", ri.Shape.box((1, 2, 3)), position=(0.25, 0, 0)))
    times = frame_times((num_frames - 1) / FPS, FPS) if num_frames > 1 else np.zeros(1)
    positions = np.zeros((num_frames, 3, 3))
    positions[:, 1, 2] = 1.0 - 0.25 * times
    orientations = np.tile([1.0, 0.0, 0.0, 0.0], (num_frames, 3, 1))
    orientations[:, 2] = turn_about(np.array([1.0, 0.0, 0.0]), 3.0 * times)
    corners = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
    soft_body = FlexibleTrack("cloth", np.tile(corners, (num_frames, 1, 1)), np.array([[0, 1, 2], [0, 2, 3]]))
    a = ri.Recording(times, list(scene.names), positions, orientations, positions, positions, positions, np.zeros(0, IMPACT_DTYPE),
                     scene=scene, soft_bodies=[soft_body])  # fmt: skip
    drifted, turned, lifted = positions.copy(), orientations.copy(), soft_body.vertices.copy()
    drifted[:, 1] += times[:, None] * DRIFT
    turned[:, 2] = -multiply(turn_about(AXIS, TURN * times), orientations[:, 2])  # the sign of a quaternion means nothing
    lifted[:, 2, 2] += 0.125 * times
    return a, replace(a, positions=drifted, orientations=turned, soft_bodies=[replace(soft_body, vertices=lifted)])


def manifest_of(page: str) -> dict[str, Any]:
    """Return the manifest of a page."""
    return json.loads(page.split('<script id="manifest" type="application/json">')[1].split("</script>")[0])


def messages_of(page: str, kind: str) -> list[dict[str, Any]]:
    """Return the meshcat messages of a page of one kind."""
    packed = re.findall(rf'<script class="command" type="text/plain" data-kind="{kind}">(.*?)</script>', page)
    return [umsgpack.unpackb(gzip.decompress(base64.b64decode(text))) for text in packed]


def call(*arguments: object) -> Any:
    """Run `rigidimpulse compare` in this process."""
    return CliRunner().invoke(main, ["compare", *map(str, arguments)])


class TestComparison:
    def test_known_motion_has_its_distance_and_angle(self) -> None:
        # A frame late, these would be off by 2e-4 m and 2e-2 rad; with centres or signs taken wrongly by all of it.
        a, b = runs()
        for one, other in ((a, b), (b, a)):
            comparison = ri.compare(one, other)
            assert comparison.names == ["ball", "box </script>{{script}}", "cloth"]
            assert np.abs(comparison.distance("ball") - 5e-3 * a.times).max() < ROUND_OFF
            assert np.abs(comparison.angle("box </script>{{script}}") - TURN * a.times).max() < ROUND_OFF
            assert np.abs(comparison.distance("cloth") - 0.125 * a.times).max() < ROUND_OFF
            assert not comparison.angle("ball").any() and not comparison.distance("floor").any() and not comparison.angle("cloth").any()
            assert np.array_equal(comparison.deviation.distance[:, 1], comparison.distance("ball"))

    def test_apart_from_the_first_frame_beyond_a_thousandth_of_the_size(self) -> None:
        # The ball is 1 m wide: 5e-3 m/s take 0.2 s to 1e-3 m, between frames 4 and 5. The cloth is 1 m wide as well: 0.008 s, frame 1.
        a, b = runs()
        rows = {row.name: row for row in ri.compare(a, b).rows}
        assert (rows["ball"].size, rows["box </script>{{script}}"].size, rows["cloth"].size) == (1.0, 3.0, 1.0)
        assert rows["ball"].apart == 5 / FPS
        assert rows["cloth"].apart == 1 / FPS
        assert rows["box </script>{{script}}"].apart == np.inf
        assert rows["ball"].distance == pytest.approx(1e-2, abs=ROUND_OFF)

    def test_table_has_a_line_for_each_body_furthest_apart_first(self) -> None:
        a, b = runs()
        lines = ri.compare(a, b, ("one", "two"), {"ball": 1.5}).table().splitlines()
        assert lines[0] == "largest differences between one and two"
        assert [line.split("  ")[0] for line in lines[2:]] == ["cloth", "ball", "box </script>{{script}}"]
        assert lines[2].split()[1:] == ["0.25", "-", "0.04167", "-"]
        assert lines[3].split()[1:] == ["0.01", "0", "0.2083", "1.5"]
        assert lines[4].split()[-4:] == ["0", "1", "never", "-"]
        assert "horizon" not in ri.compare(a, b).table()

    def test_without_a_scene_there_are_distances_but_no_sizes_and_no_page(self, tmp_path: Path) -> None:
        a, b = (replace(run, scene=None) for run in runs())
        comparison = ri.compare(a, b)
        assert comparison.names == ["ball", "box </script>{{script}}", "cloth"]  # not the floor: it does not move
        assert np.isnan(comparison.rows[0].size)
        with pytest.raises(ri.SceneError, match="shapes of the scene"):
            comparison.export(tmp_path / "x.html")
        assert ri.compare(a, runs()[1]).export(tmp_path / "x.html").exists()  # the scene of either run will do

    def test_what_is_not_finite_is_infinitely_far_and_not_drawn(self, tmp_path: Path) -> None:
        a, b = runs()
        b.positions[7, 1, 0] = np.nan
        comparison = ri.compare(a, b)
        assert comparison.distance("ball")[7] == np.inf and np.isfinite(comparison.distance("ball")[6])
        with pytest.raises(ValueError, match=r"'ball'.*frame 7"):
            comparison.export(tmp_path / "x.html")
        b.positions[7, 1, 0] = 0.0
        b.soft_bodies[0].vertices[3, 2] = np.inf
        assert ri.compare(a, b).distance("cloth")[3] == np.inf
        with pytest.raises(ValueError, match="'cloth'"):
            ri.compare(a, b).export(tmp_path / "x.html")

    @pytest.mark.parametrize(("change", "words"), [
        (lambda b: replace(b, names=["floor", "ball", "crate"]), "crate.*runs of one scene"),
        (lambda b: replace(b, times=2.0 * b.times), "same duration and fps"),
        (lambda b: replace(b, soft_bodies=[]), "cloth of 4 vertices.*none"),
        (lambda b: replace(b, soft_bodies=[replace(b.soft_bodies[0], vertices=b.soft_bodies[0].vertices[:, :3])]), "of 3 vertices"),
    ])  # fmt: skip
    def test_runs_of_different_scenes_are_refused(self, change: Any, words: str) -> None:
        a, b = runs()
        with pytest.raises(ri.SceneError, match=words):
            ri.compare(a, change(b))

    @pytest.mark.parametrize("labels", ["ab", ("a",), ("a", "a"), ("a", ""), ("a", 2), ("a", "b", "c")])
    def test_labels_are_two_different_texts(self, labels: Any) -> None:
        with pytest.raises(ri.SceneError, match="two different texts"):
            ri.compare(*runs(), labels=labels)

    def test_horizon_of_an_unknown_body_or_of_no_number_is_refused(self) -> None:
        with pytest.raises(ri.SceneError, match="did you mean 'ball'"):
            ri.compare(*runs(), horizon={"bal": 1.0})
        with pytest.raises(ri.SceneError, match="'ball' is not a number"):
            ri.compare(*runs(), horizon={"ball": np.nan})
        assert ri.compare(*runs(), horizon={"cloth": -np.inf}).horizon == {"cloth": -np.inf}


class TestPage:
    def test_page_holds_the_second_run_beside_the_first(self) -> None:
        a, b = runs()
        horizon = {"ball": 1.25, "cloth": np.inf, "box </script>{{script}}": -np.inf}
        page = render_comparison(ri.compare(a, b, ("first", "second"), horizon))
        contents = manifest_of(page)["comparison"]
        assert contents["labels"] == ["first", "second"]
        assert [ghost["name"] for ghost in contents["ghosts"]] == ["ball", "box </script>{{script}}"]  # what is static is drawn once
        assert contents["horizon"] == {"ball": 1.25, "box </script>{{script}}": -1.0}  # before the first frame
        (motion,) = messages_of(page, "motion")
        assert {entry["path"].split("/")[1] for entry in motion["animations"]} == {"bodies", "ghosts"}
        ball = next(entry for entry in motion["animations"] if entry["path"] == "/ghosts/1 ball")
        (track,) = ball["clip"]["tracks"]
        assert np.array_equal(np.frombuffer(track["values"].data, "<f4").reshape(-1, 3), b.position("ball").astype(np.float32))
        distance, angle = messages_of(page, "apart")
        values = np.frombuffer(distance["value"].data, "<f4").reshape(3, len(a.times))
        assert np.allclose(values, [5e-3 * a.times, 0 * a.times, 0.125 * a.times], rtol=1e-7, atol=ROUND_OFF)
        assert np.frombuffer(angle["value"].data, "<f4").reshape(3, -1)[1, -1] == pytest.approx(TURN * a.times[-1], rel=1e-7)
        *_, frames = messages_of(page, "frames")
        assert frames["path"] == f"/ghosts/{contents['softBodies'][0]['key']}"
        assert np.array_equal(np.frombuffer(frames["value"].data, "<f4"), b.soft_bodies[0].vertices.astype(np.float32).ravel())

    def test_camera_sees_both_runs(self) -> None:
        # The box reaches 1.9 m to either side, the ball of the second run 5.5 m to one: 1.8 m more in half the width.
        a, b = runs()
        b.positions[:, 1, 0] += 5.0
        alone = manifest_of(render_page(a))["framing"]
        both = manifest_of(render_comparison(ri.compare(a, b)))["framing"]
        assert both["half"][0] > alone["half"][0] + 1.7
        assert both["movers"] == alone["movers"]

    def test_page_of_one_run_is_that_of_two_less_what_they_add(self) -> None:
        # Everything that ghosts need is added to the page of a run, so that page itself has nothing of it, byte for byte.
        # A single frame: there the two pages have the same motion, none.
        a, _ = runs(num_frames=1)
        plain, page = render_page(a, "a and b"), render_comparison(ri.compare(a, a))
        folder = resources.files("rigidimpulse.view") / "page"
        for name in ("compare.css", *COMPARISON_SCRIPTS[len(SCRIPTS) :]):
            text = "\n" + (folder / name).read_text(encoding="utf-8")
            assert page.count(text) == 1
            page = page.replace(text, "")
        page, number = re.subn(r'\n<script class="command"[^>]* data-kind="apart">.*?</script>', "", page)
        assert number == 2
        page = page.replace(re.findall(r'\n<script class="command"[^>]* data-kind="frames">.*?</script>', page)[-1], "")
        manifest, own = manifest_of(page), manifest_of(plain)
        del manifest["comparison"]
        manifest["summary"] = own["summary"]
        assert manifest == own
        cut = '<script id="manifest" type="application/json">.*?</script>'
        assert re.sub(cut, "", page) == re.sub(cut, "", plain)
        for name in SCRIPTS:
            assert not re.search("ghost|comparison", (folder / name).read_text(encoding="utf-8"))

    def test_same_runs_give_the_same_bytes_and_texts_cannot_break_out(self, tmp_path: Path) -> None:
        labels = ("</script><b>", "{{style}}")
        first = ri.compare(*runs(), labels).export(tmp_path / "first.html").read_bytes()
        assert first == ri.compare(*runs(), labels).export(tmp_path / "second.html").read_bytes()
        page = first.decode("utf-8")
        assert manifest_of(page)["comparison"]["labels"] == list(labels)
        assert "<title>&lt;/script&gt;&lt;b&gt; and {{style}}</title>" in page
        assert re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"'](?!data:)", page) == []

    def test_export_is_a_page_and_show_serves_it(self, tmp_path: Path) -> None:
        comparison = ri.compare(*runs())
        with pytest.raises(ri.SceneError, match=r"ends in \.html"):
            comparison.export(tmp_path / "run.npz")
        with comparison.show(open_browser=False) as viewer, urllib.request.urlopen(viewer.url) as reply:
            assert reply.read() == comparison.export(tmp_path / "run.html").read_bytes()
        assert [path.name for path in tmp_path.iterdir()] == ["run.html"]


class TestCommand:
    def test_accuracies_are_run_and_a_recording_gives_its_frames(self, tmp_path: Path) -> None:
        recorded, page = tmp_path / "some.npz", tmp_path / "page.html"
        ri.simulate(_scene(), 0.5, 23.976, accuracy="preview").export(recorded)
        result = call(recorded, "exact", "--scene", _scene_file(tmp_path), "-o", page)
        assert result.exit_code == 0, result.output
        assert "largest differences between some and exact" in result.stdout
        assert [line.split()[0] for line in result.stdout.splitlines()[-2:]] == ["ball", "wrote"]
        assert manifest_of(page.read_text(encoding="utf-8"))["comparison"]["labels"] == ["some", "exact"]

    def test_a_run_is_itself(self, tmp_path: Path) -> None:
        result = call("standard", "standard", "--scene", _scene_file(tmp_path), "--duration", 0.25, "--fps", 24)
        assert result.exit_code == 0, result.output
        assert result.stdout.splitlines()[-1].split() == ["ball", "0", "0", "never"]

    @pytest.mark.parametrize(("words", "message"), [
        (("previw", "exact"), "cannot compare 'previw'"),
        (("exact", "lost.npz"), "there is no such file"),
        (("exact", "preview", "-o", "page.htm"), "ends in .html"),
    ])  # fmt: skip
    def test_bad_words_are_refused_before_anything_runs(self, words: tuple[str, ...], message: str, tmp_path: Path) -> None:
        result = call(*words, "--scene", _scene_file(tmp_path))
        assert result.exit_code == BAD_SCENE
        assert message in result.stderr and "status" not in result.stdout

    def test_other_frames_are_refused(self, tmp_path: Path) -> None:
        recorded = tmp_path / "some.npz"
        ri.simulate(_scene(), 0.25, 24).export(recorded)
        result = call(recorded, "preview", "--scene", _scene_file(tmp_path), "--fps", 48)
        assert result.exit_code == BAD_SCENE and "same duration and fps" in result.stderr

    @pytest.mark.parametrize("fps", [24.0, 23.976, 24000 / 1001, 30000 / 1001, 59.94, 60.0, 120.0, 1000.0])
    @pytest.mark.parametrize("duration", [0.1, 1.0, 4.0, 7.3, 61.0])
    def test_frames_of_a_recording_are_found_to_the_last_bit(self, fps: float, duration: float) -> None:
        # duration / frames loses a bit here and there, and then no frame time is the same.
        times = frame_times(duration, fps)
        run = replace(runs()[0], times=times)
        assert np.array_equal(frame_times(**frames_of(run)), times)

    def test_a_single_frame_has_no_frame_rate(self) -> None:
        with pytest.raises(ri.SceneError, match="one frame"):
            frames_of(runs(num_frames=1)[0])

    def test_labels_tell_runs_apart(self) -> None:
        assert labels_of(("out/run.npz", "exact")) == ("run", "exact")
        assert labels_of(("old/run.npz", "new/run.npz")) == ("A old/run.npz", "B new/run.npz")
        assert labels_of(("exact", "exact")) == ("A exact", "B exact")


SCENE_FILE = """
import rigidimpulse as ri

def scene():
    made = ri.Scene()
    made.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    made.add(ri.Body("ball", ri.Shape.sphere(0.5), position=(0, 0, 0.7), material=ri.Material(restitution=0.5)))
    return made
"""


def _scene_file(folder: Path) -> Path:
    """Return the file of a scene: a ball falls on a floor."""
    path = folder / "falling_ball.py"
    path.write_text(SCENE_FILE)
    return path


def _scene() -> ri.Scene:
    """Return the scene of `SCENE_FILE`."""
    names: dict[str, Any] = {}
    exec(SCENE_FILE, names)
    return names["scene"]()
