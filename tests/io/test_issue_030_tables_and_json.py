"""What tables and pages say of names that a spreadsheet would compute, and of parameters that are no number."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import pytest

import rigidimpulse as ri
from rigidimpulse.core.files import plain_cell
from rigidimpulse.view.sheet import Card, write_sheet


def refuse(text: str) -> float:
    """Raise: JSON has no such number."""
    raise ValueError(text)


@pytest.mark.parametrize("name", ["=1+1", "+cmd", "-cmd", "@SUM(A1)", "  =1", "\t=1"])
def test_names_are_no_formulas(name: str, tmp_path: Path) -> None:
    ball = ri.Shape.sphere(0.1)
    run = ri.simulate(ri.Scene(bodies=[ri.Body(name, ball), ri.Body("a-b", ball, position=(9, 0, 0))]), 0.1, 10)
    with run.export(tmp_path / "run.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    assert [row[2] for row in rows[:2]] == [f"'{name}", "a-b"]
    assert any(cell.startswith("-") for cell in rows[-1])  # numbers below 0 stay numbers


def test_numbers_stay() -> None:
    assert [plain_cell(text) for text in ("-1.5", "+2", "-inf", "x=1", "")] == ["-1.5", "+2", "-inf", "x=1", ""]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), [1.0, float("-inf")]])
def test_a_sheet_of_parameters_that_are_no_number(value: object, tmp_path: Path) -> None:
    """The index of the page is JSON, as the browser reads it, and says the value in words."""
    page = tmp_path / "index.html"
    write_sheet(page, [Card("0", None, "", {"h": value, "g": 1.5}, {"travel": float("nan")}, "failed", "no run")], "sheet")
    found = re.search(r'<script[^>]*id="index"[^>]*>(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)
    assert found
    card = json.loads(found[1].replace("\\u003c", "<"), parse_constant=refuse)["cards"][0]
    told = card["parameters"]["h"]
    assert (told[1] if isinstance(told, list) else told) in ("NaN", "Infinity", "-Infinity")
    assert card["parameters"]["g"] == 1.5
