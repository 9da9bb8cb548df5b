"""What the status of a run says is in every file that is written of it."""

from __future__ import annotations

import json

import pytest

import rigidimpulse as ri
from rigidimpulse.recording.status import Status


@pytest.fixture(scope="module")
def run() -> ri.Recording:
    """A box that starts 0.2 m inside another."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("below", ri.Shape.box(1.0), position=(0, 0, 0.5)))
    scene.add(ri.Body("above", ri.Shape.box(1.0), position=(0, 0, 1.3)))
    result = ri.simulate(scene, 0.1)
    assert not result.status.ok and "overlap at the start (below, above)" in result.status.message
    return result


def test_arrays_have_the_whole_status(run, tmp_path):
    assert ri.load_recording(run.export(tmp_path / "run.npz")).status == run.status


def test_caches_have_the_whole_status(run, tmp_path):
    pytest.importorskip("h5py")
    cached = ri.simulate(run.scene, 0.1, cache=tmp_path / "run.h5")
    assert ri.load_recording(tmp_path / "run.h5").status == cached.status == run.status


def test_the_status_of_a_run_that_is_ok_comes_back(tmp_path):
    scene = ri.Scene()
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1)))
    run = ri.simulate(scene, 0.1)
    assert ri.load_recording(run.export(tmp_path / "run.npz")).status == run.status == Status(True, "finished")


BROKEN = ['', '[]', '{}', '{"ok": true, "message": "m", "events": [1]}', '{"ok": true, "message": "m", "events": [{}]}']


@pytest.mark.parametrize("text", BROKEN)
def test_what_is_no_status_is_refused(text):
    with pytest.raises(ValueError):
        Status.from_json(text)


def test_gltf_files_name_the_warnings(run, tmp_path):
    tree = json.loads(run.export(tmp_path / "run.gltf").read_text())
    assert tree["asset"]["extras"]["rigidimpulse"]["warnings"] == run.status.message.splitlines()


def test_usd_files_name_the_warnings(run, tmp_path):
    sdf = pytest.importorskip("pxr.Sdf")
    layer = sdf.Layer.FindOrOpen(str(run.export(tmp_path / "run.usda")))
    assert layer.customLayerData["rigidimpulse"]["warnings"] == run.status.message


def test_pages_list_the_warnings(run, tmp_path):
    page = run.export(tmp_path / "run.html").read_text()
    manifest = json.loads(page.split('<script id="manifest" type="application/json">')[1].split("</script>")[0])
    (warning,) = manifest["warnings"]
    assert warning["what"] == "overlap at the start (below, above)" and warning["time"] == 0.0 and "apart" in warning["remedy"]
