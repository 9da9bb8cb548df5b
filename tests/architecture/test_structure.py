"""The shape of the tree: each measure stays at or below what `allowed.toml` says, and that file follows when the tree gets better.

The measures themselves are tested on small trees with a known fault in each.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from rules import LAYERS, graph, measures, package, read_allowed
from structure import (
    OldWord,
    circles,
    comment_lines,
    count_old_words,
    import_graph,
    layer_violations,
    modules_without_layer,
    old_words_in,
    parameter_counts,
    parameters_called,
    read_package,
    size,
    untyped_parameters,
)

KEYS = tuple(read_allowed()[0])


def complaint(key: str, value: float, allowed: float, slack: float, aim: float) -> str | None:
    """What is wrong with a value, and what to edit; None if nothing is. A value that has reached its aim may stay below what is allowed."""
    if value > allowed:
        return f"{key} is {value:,}, allowed are {allowed:,}. Mend the tree; `report.py --where {key}` says where."
    if value < allowed - slack and allowed > aim:
        return f"{key} is {value:,}, allowed are {allowed:,}: better. Set `{key} = {value}` in allowed.toml (`report.py --write` does)."
    return None


def test_every_measure_has_an_allowed_value_and_a_slack() -> None:
    allowed, slack = read_allowed()
    assert set(allowed) == set(slack) == set(measures())


@pytest.mark.parametrize("key", KEYS)
def test_a_measure_does_not_get_worse(key: str) -> None:
    """A new circle, a new import of a higher layer, a new long list of parameters, an old word: each is one more than is allowed."""
    allowed, slack = read_allowed()
    measure = measures()[key]
    wrong = complaint(key, measure.value, allowed[key], slack[key], measure.aim)
    if wrong:
        pytest.fail("\n".join([wrong, *measure.places[:60]]), pytrace=False)


def test_every_module_has_a_layer() -> None:
    """A new folder that no layer names would be outside the rule."""
    assert modules_without_layer(package(), LAYERS) == []


def test_imports_of_this_package_are_found() -> None:
    """The graph is not empty by mistake: known edges, at the top of a file and in a folder's `__init__`."""
    edges = graph()
    assert sum(map(len, edges.values())) > 500
    assert edges["rigidimpulse"] == {"rigidimpulse.core.version"}
    assert any(name.startswith("rigidimpulse.core.") for name in edges["rigidimpulse.engine.simulate"])


def test_the_ratchet_refuses_worse_and_asks_to_follow_better() -> None:
    assert complaint("lines", 101, 100, 5, 10) is not None
    assert complaint("lines", 100, 100, 5, 10) is None
    assert complaint("lines", 95, 100, 5, 10) is None
    assert "lines = 94" in (complaint("lines", 94, 100, 5, 10) or "")
    assert complaint("files", 3, 10, 2, 10) is None  # the aim is reached


# Small trees, each with a known fault.


def write(folder: Path, files: dict[str, str]) -> Path:
    """Write a package `tree` and return its folder."""
    root = folder / "tree"
    for name, text in {"__init__.py": "", **files}.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize(
    "back",
    [
        "from tree.low.a import x\n",
        "import tree.low.a\n",
        "from tree.low import a\n",
        "from . import a\n",
        "from .a import x\n",
        "from ..low.a import x\n",
        "def late() -> None:\n    from tree.low.a import x\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from tree.low.a import x\n",
        "from importlib import import_module\ndef late() -> None:\n    import_module('tree.low.a')\n",
    ],
)
def test_a_circle_is_found_however_it_is_closed(tmp_path: Path, back: str) -> None:
    """Modules a -> b -> c -> a, and d, which is in no circle."""
    root = write(
        tmp_path,
        {
            "low/__init__.py": "",
            "low/a.py": "from tree.low.b import y\nx = 1\n",
            "low/b.py": "from tree.low.c import z\ny = 1\n",
            "low/c.py": f"{back}z = 1\n",
            "low/d.py": "from tree.low.a import x\n",
        },
    )
    assert circles(import_graph(read_package(root))) == [["tree.low.a", "tree.low.b", "tree.low.c"]]


def test_two_circles_are_told_apart(tmp_path: Path) -> None:
    names = {"a": "b", "b": "a", "c": "d", "d": "e", "e": "c"}
    root = write(tmp_path, {f"{name}.py": f"import tree.{other}\n" for name, other in names.items()} | {"f.py": "import tree.a, tree.c\n"})
    assert circles(import_graph(read_package(root))) == [["tree.c", "tree.d", "tree.e"], ["tree.a", "tree.b"]]


def test_a_chain_is_no_circle(tmp_path: Path) -> None:
    files = {f"m{k}.py": f"import tree.m{k + 1}\n" for k in range(2000)} | {"m2000.py": ""}
    assert circles(import_graph(read_package(write(tmp_path, files)))) == []


def test_an_import_of_a_higher_layer_is_found(tmp_path: Path) -> None:
    files = {
        "low/__init__.py": "",
        "low/a.py": "from tree import __version__\nimport numpy\ndef late() -> None:\n    from tree.high.b import y\n",
        "low/c.py": "from tree.low import a\n",
        "high/__init__.py": "",
        "high/b.py": "from tree.low.a import x\ny = 1\n",
        "beside.py": "",
    }
    tree = read_package(write(tmp_path, files))
    layers = ({"low"}, {"high"}, {""})
    assert layer_violations(import_graph(tree), layers) == [("tree.low.a", "tree.high.b")]
    assert modules_without_layer(tree, layers) == ["tree.beside"]


def test_public_names_taken_from_the_top_count_as_an_import_of_it(tmp_path: Path) -> None:
    """Else every module could import every other one by way of the table of homes."""
    tree = read_package(write(tmp_path, {"low/__init__.py": "", "low/a.py": "from tree import Scene\n"}))
    assert layer_violations(import_graph(tree), ({"low"}, {""})) == [("tree.low.a", "tree")]


FUNCTIONS = '''
from tree.kernels import jit

def nine(a: int, b: int, c: int, /, d: int, e: int, *f: int, g: int, h: int, **i: int) -> None:
    """Has nine."""

class Kind:
    def eight(self, a: int, b: int, c: int, d: int, e: int, f: int, g: int, h: int) -> None:
        # why
        def inside(free) -> int:
            return free  # a second comment

    @classmethod
    def made(cls, context: int) -> None:
        # noqa: a remark to a tool
        pass

    @staticmethod
    def plain(self_like) -> None: ...

@jit
def kernel(a, b, context):
    def codegen(context, builder):
        pass

@kernels.overload(kernel, inline="always")
def typed(a):
    pass
'''


def test_parameters_are_counted_without_self(tmp_path: Path) -> None:
    counts = dict(parameter_counts(read_package(write(tmp_path, {"a.py": FUNCTIONS}))))
    assert counts["tree.a.nine"] == 9
    assert counts["tree.a.Kind.eight"] == 8
    assert counts["tree.a.Kind.made"] == 1
    assert counts["tree.a.Kind.plain"] == 1
    assert max(counts.values()) == 9


def test_untyped_parameters_are_found_outside_kernels(tmp_path: Path) -> None:
    tree = read_package(write(tmp_path, {"a.py": FUNCTIONS}))
    assert untyped_parameters(tree) == ["tree.a.Kind.eight.inside(free)", "tree.a.Kind.plain(self_like)"]


def test_parameters_called_context_are_found_outside_kernels(tmp_path: Path) -> None:
    assert parameters_called(read_package(write(tmp_path, {"a.py": FUNCTIONS})), "context") == ["tree.a.Kind.made"]


def test_comments_lines_and_files_are_counted(tmp_path: Path) -> None:
    tree = read_package(write(tmp_path, {"a.py": f"# outside of functions\n{FUNCTIONS}"}))
    assert comment_lines(tree) == 2
    assert size(tree) == (2, FUNCTIONS.count("\n") + 1)


WORDS = (OldWord("heap", "pile", ("heapq",)), OldWord("so many", "as many"), OldWord("core", "skeleton", ("tree.core",), ("tree/core/*",)))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("heap", {"heap": 1}),
        ("heaps of HEAP_SIZE, heapSize and old_heaps", {"heap": 4}),
        ("import heapq; cheap, heaped", {}),
        ("# a heap\nfrom heapq import heappush", {"heap": 1}),
        ("there are so\n    # many of them", {"so many": 1}),
        ("from tree.core import x  # on a core", {"core": 1}),
    ],
)
def test_old_words_are_found_as_words(text: str, found: dict[str, int]) -> None:
    assert count_old_words("tree/a.py", text, WORDS) == found


def test_old_words_are_found_in_files_and_in_their_names(tmp_path: Path) -> None:
    write(tmp_path, {"core/a.py": "core = 1\n", "heap_rows.py": "", "b.py": "message = 'on the heap'\n"})
    assert old_words_in(tmp_path, ["tree/**/*.py"], WORDS) == {"tree/b.py": {"heap": 1}, "tree/heap_rows.py": {"heap": 1}}
