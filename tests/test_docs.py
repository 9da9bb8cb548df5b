"""The documentation is true: examples run, commands parse, tables name what is in the code, names of the library have an entry."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
import shlex
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest

import rigidimpulse as ri
from rigidimpulse.cli.cli import main

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)]


class Block(NamedTuple):
    """A fenced block: its language, the line that it begins at, its text, and why it is not run ("" where it is)."""

    language: str
    line: int
    text: str
    not_run: str


def blocks(page: Path) -> list[Block]:
    """Fenced blocks of a page; `<!-- not run: REASON -->` on the line before a fence keeps an example from being run."""
    found, before, lines = [], "", page.read_text(encoding="utf-8").splitlines()
    start = None
    for i, line in enumerate(lines):
        if start is None and line.startswith("```"):
            start = i
        elif start is not None and line == "```":
            marker = re.fullmatch(r"<!-- not run: (.+) -->", before)
            found.append(Block(lines[start].strip("`"), start + 2, "\n".join(lines[start + 1 : i]), marker[1] if marker else ""))
            start = None
        if start is None and line:
            before = line
    assert start is None, f"{page.name}: a block that begins in line {start} has no end"
    return found


def named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def examples(page: Path) -> list[Block]:
    return [block for block in blocks(page) if block.language == "python" and not block.not_run]


def commands(page: Path) -> list[str]:
    """Lines of shell blocks, and commands in the text; comments taken off."""
    shell = [line for block in blocks(page) if block.language == "sh" for line in block.text.splitlines()]
    inline = re.findall(r"`(rigidimpulse [^`]+)`", page.read_text(encoding="utf-8"))
    return [line.split("  #")[0].strip() for line in [*shell, *inline] if line.strip()]


@pytest.mark.parametrize("page", [page for page in PAGES if examples(page)], ids=named)
def test_examples_of_a_page_run_in_their_order(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "assets").symlink_to(ROOT / "assets")
    (tmp_path / "demos").symlink_to(ROOT / "demos")
    space = {"__name__": "example"}
    for block in examples(page):
        # Empty lines before it, so that a traceback names the line of the page.
        exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), space)


@pytest.mark.parametrize("page", [page for page in PAGES if any(b.language == "python" for b in blocks(page))], ids=named)
def test_examples_that_are_not_run_are_python_at_least(page: Path) -> None:
    for block in blocks(page):
        if block.language == "python":
            ast.parse(block.text)


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=named)
def test_commands_exist_with_their_options(page: Path) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for line in commands(page):
        program, *arguments = shlex.split(line)
        if program == "rigidimpulse":
            _parse(arguments, line)
        elif program == "pip":
            wanted = re.findall(r"\[([\w,]+)\]", line)
            assert all(set(names.split(",")) <= set(extras) for names in wanted), line
        elif program == "python" and arguments[0] != "-m":
            assert (ROOT / arguments[0]).is_file(), line
        else:
            assert program in ("python", "git", "cd"), line


def _parse(arguments: list[str], line: str) -> None:
    """Let click read a command, types and choices included, without running it."""
    if not arguments[0].startswith("-"):
        assert arguments[0] in main.commands, line
        main.commands[arguments[0]].make_context(arguments[0], arguments[1:])
    else:
        assert arguments[0] in {"--help", "-h", "--version"} | set(main.params[0].opts), line


def test_links_lead_to_files() -> None:
    lost = []
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            if not target.startswith(("http:", "https:")) and not (page.parent / target).exists():
                lost.append(f"{page.name}: {target}")
    assert not lost


def test_files_that_pages_name_are_there() -> None:
    lost = []
    for page in PAGES:
        for name in re.findall(r"`((?:tests|rigidimpulse|docs|demos|assets)/[\w/.*-]*)`", page.read_text(encoding="utf-8")):
            if not any(ROOT.glob(name)):
                lost.append(f"{page.name}: {name}")
    assert not lost


def how_to_lists() -> dict[str, list[str]]:
    """Paths that each section "How to add ..." of docs/architecture.md lists, by heading."""
    lists: dict[str, list[str]] = {}
    heading = ""
    for line in (DOCS / "architecture.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ")
        elif heading.startswith("How to add") and (found := re.match(r"- `([^`]+)`", line)):
            lists.setdefault(heading, []).append(found[1])
    return lists


def test_what_one_must_touch_to_add_something_is_there() -> None:
    lists = how_to_lists()
    assert set(lists) >= {f"How to add {what}" for what in ("a joint", "a force", "a shape kind", "a narrow-phase pair", "an exporter")}
    lost = [f"{heading}: {path}" for heading, paths in lists.items() for path in paths if not (ROOT / path).is_file()]
    assert not lost


def test_terms_of_the_glossary_are_defined_once() -> None:
    terms = re.findall(r"^\| ([^|]+) \| ", (DOCS / "glossary.md").read_text(encoding="utf-8"), re.M)
    terms = [term for term in terms if term != "term"]
    assert len(terms) > 60
    assert len(set(terms)) == len(terms)


GENERATED = ("accuracy", "hard_cases", "validation", "what_accuracy_costs", "narrow_phases", "speed", "tosses", "release")
"""Pages of docs/results that a script writes."""


@pytest.mark.parametrize("name", [name for name in GENERATED if name != "validation"])
def test_results_say_where_they_were_measured(name: str) -> None:
    text = (DOCS / "results" / f"{name}.md").read_text(encoding="utf-8")
    for word in ("machine", "date", "commit", "command", "data"):
        assert re.search(rf"^\| {word} \| .+ \|$", text, re.M), word


def test_results_are_those_of_their_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every generated page, and the table of the README, is what its script makes of the data: no number is typed by hand."""
    monkeypatch.syspath_prepend(str(DOCS / "results"))
    script = importlib.import_module("make_results")
    assert set(script.PAGES) == set(GENERATED)
    for name, make in script.PAGES.items():
        assert (DOCS / "results" / f"{name}.md").read_text(encoding="utf-8") == make(), f"run `python docs/results/make_results.py {name}`"
    assert (ROOT / "README.md").read_text(encoding="utf-8") == script.readme(), "run `python docs/results/make_results.py`"


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 80


def test_pictures_are_small() -> None:
    """1.5 MB in all, so that a clone stays quick; the pictures that are there take half of it."""
    pictures = [path for path in DOCS.rglob("*") if path.suffix in (".png", ".jpg") and "_build" not in path.parts]
    assert sum(path.stat().st_size for path in pictures) < 1_500_000


def test_every_public_name_has_one_entry_in_the_reference() -> None:
    entries = [
        name
        for page in (DOCS / "reference").glob("*.md")
        for name in re.findall(r"auto(?:class|function|exception):: rigidimpulse\.(\w+)$", page.read_text(encoding="utf-8"), re.M)
    ]
    assert sorted(entries) == sorted(ri.__all__)


def parameter_rows() -> list[tuple[str, str, str]]:
    """Class, parameter and default of each row of the tables of docs/reference/parameters.md below a heading that names a class."""
    rows, owner = [], ""
    for line in (DOCS / "reference" / "parameters.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            words = re.findall(r"`(\w+)`", line)
            owner = words[0] if words and words[0] in ri.__all__ else ""
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if owner and line.startswith("| `") and len(cells) >= 3:
            rows += [(owner, name, cells[2]) for name in re.findall(r"`(\w+)`", cells[0])]
    return rows


def test_defaults_in_the_tables_of_parameters_are_those_of_the_code() -> None:
    rows = parameter_rows()
    assert len(rows) > 60
    wrong = []
    for owner, name, stated in rows:
        parameters = inspect.signature(getattr(ri, owner)).parameters
        if name not in parameters and owner == "Accuracy":
            default = ri.Accuracy.model_fields[name].default
        elif name not in parameters:
            wrong.append(f"{owner} has no {name}")
            continue
        else:
            default = parameters[name].default
            made = getattr(getattr(ri, owner), "__dataclass_fields__", {}).get(name)
            if made is not None and made.default_factory is not dataclasses.MISSING:
                default = made.default_factory()
        value = re.match(r"`([^`]*)`", stated)
        if default is inspect.Parameter.empty:
            right = stated == "needed"
        elif value is None:
            right = False
        elif dataclasses.is_dataclass(default):
            right = value[1] == f"{type(default).__name__}()"
        else:
            right = eval(value[1], {"inf": float("inf")}) == default
        if not right:
            wrong.append(f"{owner}.{name}: {stated} stated, {default!r} in the code")
    assert not wrong


def test_every_class_with_a_table_lists_all_its_parameters() -> None:
    listed: dict[str, set[str]] = {}
    for owner, name, _ in parameter_rows():
        listed.setdefault(owner, set()).add(name)
    for owner in ("Material", "Body", "Accuracy", "FlexibleBody"):
        kind = getattr(ri, owner)
        fields = set(kind.model_fields) if owner == "Accuracy" else {field.name for field in dataclasses.fields(kind)}
        assert listed[owner] == fields, owner


def reported_kinds() -> set[str]:
    """Kinds of events that the code reports or notes: the second argument of calls `report(time, kind, bodies, message)`."""
    kinds = set()
    for path in (ROOT / "rigidimpulse").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or len(node.args) < 4:
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name == "report" and isinstance(node.args[1], ast.Constant):
                kinds.add(node.args[1].value)
    return kinds


def test_every_status_is_explained() -> None:
    kinds = reported_kinds()
    assert len(kinds) > 12
    page = (DOCS / "reference" / "recording.md").read_text(encoding="utf-8")
    assert not {kind for kind in kinds if f"| {kind} |" not in page}
