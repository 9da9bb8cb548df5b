"""Pages of gallery scenes: what is written, what is kept, and that a scene that fails or hangs is shown as such."""

from __future__ import annotations

import html
import json
import os
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from shutil import copytree

import pytest
from click.testing import CliRunner

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.cli.cli import BAD_SCENE, CHECK_FAILED, main
from rigidimpulse.studies.hard_cases import FAILED, HUNG, PASSED, CaseResult
from rigidimpulse.studies.site import make_site, run_scene
from rigidimpulse.studies.site_pages import coloured, index_page, scene_page


def outside(page: str) -> list[str]:
    """What a page asks for that is not beside it."""
    links = re.findall(r"(?:src|href)=[\"']([^\"']*)", page)
    return [link for link in links if re.match(r"[a-z]+:|/", link) and not link.startswith("data:")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site of two short scenes."""
    folder = tmp_path_factory.mktemp("site")
    results = make_site(folder, ["two_spheres", "galperin_0"], jobs=2)
    assert [result.outcome for result in results] == [PASSED, PASSED], [result.message for result in results]
    return folder


def test_index_and_pages_name_every_scene_with_its_checks(folder: Path) -> None:
    index = (folder / "index.html").read_text(encoding="utf-8")
    assert "<b>2</b> of 2 scenes pass" in index
    for name in ("two_spheres", "galperin_0"):
        result = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        page = (folder / f"{name}.html").read_text(encoding="utf-8")
        assert f'href="{name}.html"' in index and f'src="{name}.png"' in index
        assert f"{len(result['checks'])} of {len(result['checks'])} checks" in index
        assert all(unescape(check["what"]) in unescape(page) and unescape(check["law"]) in unescape(page) for check in result["checks"])
        assert f'src="{name}_play.html"' in page and "SCENES = " in unescape(re.sub("<[^>]*>", "", page))
        assert outside(index) + outside(page) == []
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        head = f"<title>{html.escape(gallery.load(name).description)}"
        assert head in (folder / f"{name}_play.html").read_text(encoding="utf-8")


def test_a_scene_is_kept_until_the_package_is_newer(folder: Path, tmp_path: Path) -> None:
    site = copytree(folder, tmp_path / "site")
    kept: list[bool] = []

    def report(_result: CaseResult, was_kept: bool) -> None:
        kept.append(was_kept)

    make_site(site, ["two_spheres"], report=report)
    os.utime(site / "two_spheres.json", (1.0, 1.0))
    # That it is run again shows by its hanging: it has hardly any time.
    (again,) = make_site(site, ["two_spheres"], limit=0.02, report=report)
    assert kept == [True, False] and again.outcome == HUNG


def test_a_scene_that_takes_too_long_is_shown_as_such(tmp_path: Path) -> None:
    (result,) = make_site(tmp_path, ["two_spheres"], limit=0.02)
    assert result.outcome == HUNG
    page, index = ((tmp_path / name).read_text(encoding="utf-8") for name in ("two_spheres.html", "index.html"))
    assert "iframe src" not in page and "not done after 0.02 s" in page
    assert "no picture" in index and "hung" in index and "<b>0</b> of 1 scenes" in index


def test_a_check_that_fails_is_marked_and_comes_first(tmp_path: Path) -> None:
    entry = gallery.load("two_spheres")
    spoiled = replace(entry, check=lambda run: [replace(check, passed=False) for check in entry.check(run)[:1]] + entry.check(run)[1:])
    result = run_scene(spoiled, tmp_path)
    assert result.outcome == FAILED
    number = len(result.checks)
    assert f"✗ {number - 1} of {number} checks" in scene_page(spoiled, result, tmp_path)
    good = replace(result, name="good", outcome=PASSED)
    index = index_page([good, result], tmp_path)
    assert index.index('href="two_spheres.html"') < index.index('href="good.html"')


@pytest.mark.parametrize("module", sorted({gallery.module_name(name) for name in gallery.names() + gallery.hard_names()}))
def test_colours_change_no_letter_of_a_source(module: str) -> None:
    source = (Path(ri.__file__).parent.parent / (module.replace(".", "/") + ".py")).read_text(encoding="utf-8")
    marked = coloured(source)
    assert unescape(re.sub("<[^>]*>", "", marked)) == source
    assert '<span class="word">def</span>' in marked


def test_source_that_cannot_be_read_stays_as_it_is() -> None:
    assert coloured("'''<open") == "&#x27;&#x27;&#x27;&lt;open"


@pytest.mark.parametrize(("words", "message"), [(["two_sphere"], "unknown gallery scene"), (["two_spheres", "--jobs", "0"], "jobs is 0")])
def test_the_command_refuses_what_makes_no_sense(words: list[str], message: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["gallery", *words, "-o", str(tmp_path / "site")])
    assert result.exit_code == BAD_SCENE and message in result.stderr
    assert not (tmp_path / "site").exists()


def test_the_command_says_what_became_of_each_scene(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["gallery", "two_spheres", "--limit", "0.02", "-o", str(tmp_path)])
    assert result.exit_code == CHECK_FAILED
    assert "HUNG    two_spheres" in result.stdout and "0 of 1 passed" in result.stdout
