"""Tests read and change the engine as its users do: none replaces an attribute of a module or a class of the package.

What a test needs to choose is a parameter or a participant of a run (`engine.simulate.prepare`). Only the world outside of the package
may be replaced: processes, browsers, modules that are not installed; each place stands in a table with its reason. Facts of a run are
numbers of the plan's lines; its text is read only where the words are the subject.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from rules import ROOT

OUTSIDE = {
    "tests/test_hard_cases.py: hard_cases.subprocess.Popen": "cases run another program, which hangs or crashes",
    "tests/unit/test_cli.py: ri.Recording.show": "opens a browser and waits for it",
    "tests/unit/test_cli.py: rigidimpulse.studies.work_precision.find_spec": "a module that is not installed",
}
WORDS_ARE_THE_SUBJECT = {"tests/test_gallery_plans.py"}
"""Files that read the text of `explain`."""
REPLACING = ("setattr", "delattr", "setitem", "delitem", "patch", "object")
"""Last names of functions that replace something: of `monkeypatch`, of `unittest.mock`, and the built-in ones."""
FILES = sorted(path for path in (ROOT / "tests").rglob("*.py") if path.parent.name != "architecture")


def named(node: ast.expr) -> str:
    """The dotted name of an expression, "" if it has none."""
    if isinstance(node, ast.Attribute):
        owner = named(node.value)
        return f"{owner}.{node.attr}" if owner else ""
    return node.id if isinstance(node, ast.Name) else ""


def imported(tree: ast.AST) -> set[str]:
    """Names that a file imports from the package."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "rigidimpulse":
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Import):
            names |= {alias.asname or "rigidimpulse" for alias in node.names if alias.name.split(".")[0] == "rigidimpulse"}
    return names


def replaced(source: str) -> Iterator[str]:
    """Dotted names of what a file replaces in the package: by `setattr`, by `patch`, or by writing to an attribute."""
    tree = ast.parse(source)
    known = imported(tree) | {"rigidimpulse"}
    for node in ast.walk(tree):
        found = []
        if isinstance(node, ast.Call) and named(node.func).split(".")[-1] in REPLACING:
            parts = [argument.value if isinstance(argument, ast.Constant) else named(argument) for argument in node.args[:2]]
            found = [".".join(str(part) for part in parts if part)]
            if node.args and isinstance(node.args[0], ast.Constant):
                found = [str(node.args[0].value)]
        elif isinstance(node, ast.Assign | ast.AugAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found = [named(target) for target in targets if isinstance(target, ast.Attribute)]
        yield from (name for name in found if name.split(".")[0] in known)


def test_no_test_replaces_a_part_of_the_package() -> None:
    found = {f"{path.relative_to(ROOT).as_posix()}: {name}" for path in FILES for name in replaced(path.read_text(encoding="utf-8"))}
    assert found == set(OUTSIDE)


def test_only_tests_of_its_words_read_the_text_of_explain() -> None:
    readers = {path.relative_to(ROOT).as_posix() for path in FILES if ".explain()" in path.read_text(encoding="utf-8")}
    assert readers == WORDS_ARE_THE_SUBJECT


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("from rigidimpulse.engine import run\nmonkeypatch.setattr(run, 'LIMIT', 1)", ["run.LIMIT"]),
        ("import rigidimpulse as ri\ndef f():\n    setattr(ri.Body, 'name', 1)", ["ri.Body.name"]),
        ("monkeypatch.setattr('rigidimpulse.core.kernels.LIMIT', 1)", ["rigidimpulse.core.kernels.LIMIT"]),
        ("from rigidimpulse.engine import run\nrun.LIMIT = 1", ["run.LIMIT"]),
        ("from rigidimpulse.engine import run\nwith mock.patch.object(run, 'f'):\n    pass", ["run.f"]),
        ("from rigidimpulse.engine import run\nmonkeypatch.setenv('HOME', '')\nmine = run.begin()\nmine.limit = 1", []),
    ],
)
def test_replacing_is_found_however_it_is_written(source: str, found: list[str]) -> None:
    assert list(replaced(source)) == found
