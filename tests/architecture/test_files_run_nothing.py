"""Reading a file runs nothing that stands in it: no module of the package can make programs of bytes, and few can load modules.

A scene in Python is a program, and is run as one; that is the one exception.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from rules import PACKAGE

MAKES_PROGRAMS = {
    "pickle", "_pickle", "cPickle", "pickletools", "marshal", "shelve", "dill", "cloudpickle", "joblib", "jsonpickle", "yaml", "codeop",
    "code",
}  # fmt: skip
"""Modules that make programs, or objects of any class, of bytes."""
MAY_MAKE_PROGRAMS = {"studies/live/channel.py": "scenes and messages between two processes, in pipes of their own"}
"""No file is read there."""
LOADS_MODULES = {"importlib", "runpy", "imp", "pkgutil", "zipimport"}
RUNS = {"eval", "exec", "compile", "__import__"}
"""Built-in functions that run a text."""
MAY_LOAD_MODULES = {
    "__init__.py": "public names, from its own table",
    "core/providers.py": "functions that `registration` modules name",
    "engine/impact_time.py": "methods by accuracy, from its own table",
    "engine/warm_up.py": "kernels, from its own table",
    "gallery/__init__.py": "scenes of the gallery, from its own table",
    "io/cache/registry.py": "classes and functions of a state, from its own tables",
    "studies/glance/candidates.py": "asks whether another engine is installed",
    "studies/glance/page.py": "files of the package",
    "studies/job.py": "runs a scene in Python, which is a program",
    "studies/hard_cases.py": "asks for versions of other libraries",
    "studies/peers/__init__.py": "other engines, from its own table",
    "studies/peers/mujoco_peer.py": "another engine",
    "studies/site_pages.py": "sources of scenes of the gallery",
    "studies/work_precision.py": "asks whether a library is installed",
    "view/live/server.py": "files of the package",
    "view/page.py": "files of the package",
    "view/sheet.py": "files of the package",
}


def modules(tree: ast.AST) -> Iterator[str]:
    """First names of the modules that a source imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name.split(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or "").split(".")[0]


def faults(source: str, path: str) -> list[str]:
    """What a source has that could run what stands in a file."""
    tree, found = ast.parse(source), []
    for name in modules(tree):
        if (name in MAKES_PROGRAMS and path not in MAY_MAKE_PROGRAMS) or (name in LOADS_MODULES and path not in MAY_LOAD_MODULES):
            found.append(f"{path} imports {name}")
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id in RUNS:
            found.append(f"{path}:{node.lineno} names {node.id}")
        if isinstance(node, ast.Attribute) and ast.unparse(node) in ("np.load", "numpy.load"):
            found.append(f"{path}:{node.lineno} numpy.load")
        if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
            if isinstance(node.value, ast.Constant) and node.value.value is False:
                found.remove(next(fault for fault in found if fault.endswith("numpy.load")))
            else:
                found.append(f"{path}:{node.value.lineno} allows pickles")
    return found


SOURCES = sorted(str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", SOURCES)
def test_a_module_makes_no_program_of_a_file(path: str) -> None:
    assert faults((PACKAGE / path).read_text(encoding="utf-8"), path) == []


def test_the_table_names_modules_that_load_others() -> None:
    for path in MAY_LOAD_MODULES:
        assert LOADS_MODULES & set(modules(ast.parse((PACKAGE / path).read_text(encoding="utf-8")))), path


@pytest.mark.parametrize(
    "source",
    [
        "import pickle", "from pickle import loads", "def f():\n    import marshal", "import importlib", "from importlib import resources",
        "eval('1')", "run = exec", "__import__('os')", "import numpy as np\nnp.load(path)", "np.load(path, allow_pickle=True)",
        "np.load(path, allow_pickle=flag)", "load = np.load",
    ],
)  # fmt: skip
def test_each_way_to_run_a_file_is_found(source: str) -> None:
    assert faults(source, "io/x.py")


def test_what_runs_nothing_passes() -> None:
    assert not faults("import json, re\nre.compile('a')\nnp.load(path, allow_pickle=False)\nnp.load(b, allow_pickle=False)\n", "io/x.py")
