"""docs/reference/effects.md says what there is: every scene, test, page and public name in its table exists, and every row is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import rigidimpulse as ri
from rigidimpulse import gallery

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reference" / "effects.md"
ROWS = tuple(f"{letter}{number}" for letter in "AB" for number in range(1, 17))
PLANNED: set[str] = set()
"""Rows that are not there yet; whoever adds one takes it out of this set."""
COLUMNS = ("row", "what it is", "names", "scenes", "tests", "more")


def table() -> list[dict[str, str]]:
    """Rows of the table, by column."""
    lines = [line.strip().strip("|") for line in PAGE.read_text().splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.split("|")] for line in lines]
    assert tuple(cells[0]) == COLUMNS and all(len(row) == len(COLUMNS) for row in cells)
    return [dict(zip(COLUMNS, row, strict=True)) for row in cells[2:]]


TABLE = table()


def quoted(text: str) -> list[str]:
    return re.findall(r"`([^`]+)`", text)


def test_every_row_is_there_once_and_in_order() -> None:
    found = [row["row"] for row in TABLE]
    assert found == [name for name in ROWS if name not in PLANNED]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: row["row"])
def test_what_a_row_names_exists(row: dict[str, str]) -> None:
    names, scenes, tests = (quoted(row[column]) for column in ("names", "scenes", "tests"))
    pages = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", row["more"])
    assert row["what it is"] and names and scenes and tests and pages
    for name in names:
        # A name with an argument, or with an attribute of a class: what comes first is public.
        home, _, attribute = name.partition("(")[0].partition(".")
        assert home in ri.__all__, name
        assert not attribute or attribute in {*vars(getattr(ri, home)), *getattr(ri, home).__dataclass_fields__}, name
    assert set(scenes) <= {*gallery.names(), *gallery.hard_names()}
    for path in tests:
        assert (ROOT / path).is_file() and "def test_" in (ROOT / path).read_text(), path
    assert all((PAGE.parent / page).is_file() for page in pages)


def test_every_scene_of_the_gallery_is_listed_on_its_page() -> None:
    text = (ROOT / "docs" / "guide" / "gallery.md").read_text()
    listed = set(quoted(re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)))
    # "`galperin_0` ... `galperin_3`" stands for those between.
    missing = {name for name in gallery.names() if name not in listed and not name.startswith("galperin")}
    assert not missing
