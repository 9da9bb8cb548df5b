"""What a notebook shows of objects in a cell."""

from __future__ import annotations

import base64
import html
import re
import struct
from pathlib import Path

import rigidimpulse as ri
from rigidimpulse.studies.settings import grid
from rigidimpulse.view.cells import table


def _scene(name: str = "ball") -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body(name, ri.Shape.sphere(0.1), position=(0, 0, 0.5)))
    return scene


def _picture(cell: str) -> bytes:
    found = re.search(r'src="data:image/png;base64,([A-Za-z0-9+/=]+)"', cell)
    assert found is not None
    return base64.b64decode(found[1])


def test_scene_is_a_picture_of_its_bodies() -> None:
    cell = _scene()._repr_html_()
    data = _picture(cell)
    assert data.startswith(b"\x89PNG") and struct.unpack(">II", data[16:24]) == (640, 360)
    assert "2 bodies" in cell
    # A body elsewhere is another picture.
    other = _scene()
    other.add(ri.Body("box", ri.Shape.box(0.2), position=(0.4, 0, 0.1)))
    assert _picture(other._repr_html_()) != data


def test_scene_that_cannot_be_drawn_is_words() -> None:
    assert "0 bodies" in ri.Scene()._repr_html_()
    broken = ri.Scene()
    broken.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(float("nan"), 0, 0)))
    assert "no picture" in broken._repr_html_() and "ball" in broken._repr_html_()


def test_run_is_its_player_and_names_are_text() -> None:
    name = '<script>alert("x")</script>'
    run = ri.simulate(_scene(name), 0.1)
    cell = run._repr_html_()
    assert cell.startswith("<iframe srcdoc=") and name not in cell
    found = re.search(r'srcdoc="([^"]*)"', cell)
    assert found is not None
    page = html.unescape(found[1])
    assert page.lstrip().lower().startswith("<!doctype html>") and name not in page
    assert run.plan is not None
    plan = run.plan._repr_html_()
    assert plan.startswith("<table>") and plan.count("<tr>") == len(run.plan.lines) + 1
    assert plan.index(">in<") < plan.index(">out<")


def test_loaded_run_is_words(tmp_path: Path) -> None:
    ri.simulate(_scene(), 0.1).export(tmp_path / "run.npz")
    assert "0.1 s" in ri.load_recording(tmp_path / "run.npz")._repr_html_()


def test_wedges_and_studies_are_tables(tmp_path: Path) -> None:
    values = {"material.restitution": [0.3, 0.6]}
    wedge = ri.wedge(_scene(), values, tmp_path / "wedge", duration=0.1, workers=ri.Workers(1))
    cell = wedge._repr_html_()
    assert cell.count("<tr>") == 3 and "material.restitution" in cell and "2 takes" in cell
    study = ri.study(_scene(), 0.2, settings=[next(setting for setting in grid() if setting.family == "presets")], budget=600.0)
    cell = study._repr_html_()
    assert cell.count("<tr>") == len(study.rows) + 1 == 2 and ">best<" in cell


def test_long_tables_are_cut_and_counted() -> None:
    cell = table(("a", "b"), [(str(k), "<b>") for k in range(100)])
    assert cell.count("<tr>") == 61 and "and 40 more" in cell and "<b>" not in cell
