"""An error of a scene as the page shows it: where, with its line in the file, what, and the remedy."""

from __future__ import annotations

import ast
import re
import traceback
from pathlib import Path
from typing import Any

from rigidimpulse.core.errors import RigidImpulseError, SceneError

BUG = "look at the terminal for the whole message"


def problem_of(error: BaseException, file: str) -> dict[str, Any]:
    """Return an error as text: where, problem, remedy, line (None if there is none) and the text of that line.

    Args:
        error: what was raised.
        file: the scene's file; empty if there is none.

    """
    where, problem, remedy = "", f"{type(error).__name__}: {error}", BUG
    if isinstance(error, SceneError):
        where, problem, remedy = error.where, error.problem, error.remedy
    elif isinstance(error, RigidImpulseError):
        problem, remedy = str(error), ""
    line = _line_of(error, file) if file.endswith(".py") else None
    if line is not None:
        problem = re.sub(rf"^line {line}: ", "", problem)
        where = "" if where.startswith("scene file") else where
    return {"where": where, "problem": problem, "remedy": remedy, "line": line, "source": _source(file, line)}


def _line_of(error: BaseException, file: str) -> int | None:
    """The line of the file in which an error was raised or, if it was raised later, the one that names the body it is about."""
    each: BaseException | None = error
    while each is not None:
        if isinstance(each, SyntaxError) and each.filename == file:
            return each.lineno
        lines = [entry.lineno for entry in traceback.extract_tb(each.__traceback__) if entry.filename == file]
        if lines:
            return lines[-1]
        each = each.__cause__
    quoted = re.search(r"'([^']+)'", error.where) if isinstance(error, SceneError) else None
    return _line_naming(file, quoted.group(1)) if quoted else None


def _line_naming(file: str, name: str) -> int | None:
    """The first line with a string that is this name."""
    try:
        tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return None
    lines = [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Constant) and node.value == name]
    return min(lines, default=None)


def _source(file: str, line: int | None) -> str:
    """The text of a line; empty if there is none."""
    if line is None:
        return ""
    try:
        return Path(file).read_text(encoding="utf-8").splitlines()[line - 1].strip()
    except (OSError, ValueError, IndexError):
        return ""
