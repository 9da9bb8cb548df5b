"""The notebooks in `demos/` run from their first cell to their last, and hold no outputs."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

DEMOS = Path(__file__).resolve().parent.parent / "demos"
NOTEBOOKS = sorted(DEMOS.glob("*.ipynb"))
SHOW = """
import pathlib, sys
names = {"__name__": "__main__"}
for cell in sys.argv[1:]:
    code, _, last = pathlib.Path(cell).read_text(encoding="utf-8").partition("\\0")
    exec(compile(code, cell, "exec"), names)
    if last:
        value = eval(last, names)
        show = getattr(value, "_repr_html_", None)
        print(len(show()) if show else repr(value))
"""
"""Runs cells as a notebook does: what the last line of a cell names is shown."""


def _code(path: Path) -> list[str]:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def _with_last(code: str) -> str:
    """The statements of a cell, and after a NUL the expression that it ends with, if it does."""
    tree = ast.parse(code)
    if not tree.body or not isinstance(tree.body[-1], ast.Expr):
        return code + "\0"
    last = tree.body[-1]
    lines = code.splitlines()
    return "\n".join(lines[: last.lineno - 1]) + "\0" + "\n".join(lines[last.lineno - 1 :])


def test_there_are_three_notebooks() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["first_hour", "what_accuracy_costs", "your_own_mesh"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path: Path, tmp_path: Path) -> None:
    cells = []
    for number, code in enumerate(_code(path)):
        cells.append(tmp_path / f"cell_{number}.txt")
        cells[-1].write_text(_with_last(code), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", SHOW, *map(str, cells)], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(DEMOS.parent)},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_holds_no_outputs(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 4 and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert len({cell["id"] for cell in cells}) == len(cells)
