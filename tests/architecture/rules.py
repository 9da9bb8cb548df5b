"""The rules of this project's tree, as data: layers, old words with their exceptions, and the table of measures."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from structure import (
    OldWord,
    Package,
    circles,
    comment_lines,
    import_graph,
    layer_violations,
    old_words_in,
    parameter_counts,
    parameters_called,
    read_package,
    size,
    untyped_parameters,
)

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rigidimpulse"
ALLOWED = Path(__file__).with_name("allowed.toml")

LAYERS = (
    {"core"},
    {"scene"},
    {"motion"},
    {"collision"},
    {"model"},
    {"dynamics"},
    {"recording"},
    {"engine"},
    {"io", "view"},
    {"studies", "gallery", "testing"},
    {"cli", "__main__", ""},
)
"""From the lowest: a module imports from its own layer and from lower ones. "" is the package's own `__init__`, with its table of homes."""

MOST_PARAMETERS, HARD_LIMIT = 8, 12

FOLDERS_OF_REAL_THINGS = ("rigidimpulse/gallery/*", "tests/*", "demos/*")
"""Scenes, and tests of them, have real walls, rooms, books and nets."""
PICTURES = ("rigidimpulse/view/*", "docs/viewer.md", "docs/how/observe.md", "tests/browser/*", "tests/unit/test_view*")

OLD_WORDS = (
    OldWord("heap", "sub-stepped island; a pile of bodies", ("heapq", "binary heap", "JSHeapUsedSize", "MB heap", "heap of JavaScript"), (
    ), "a binary heap is a priority queue, JavaScript has a heap"),
    OldWord("group", "island", (
        "click.group", "main.group", "collision group", "collision_group", "CollisionGroup", "Khronos group", "THREE.Group", "hits.group",
        "match.group", ".group(", ".groups(", "create_group(",
    ), (
        "rigidimpulse/io/*", "rigidimpulse/view/*", "rigidimpulse/cli/*", "rigidimpulse/studies/charts.py",
        "rigidimpulse/scene/collision_filter.py",
        "tests/io/*", "tests/browser/*", "tests/unit/test_view.py",
        "docs/guide/usd.md", "docs/guide/robots.md", "docs/guide/gltf.md",
        "docs/guide/cache.md", "docs/guide/recipes/*",
    ), "files have groups of nodes and of data sets, filters have groups of bodies, commands and regular expressions have groups"),
    OldWord("guard", "safe step, conservative bound; energy limiter"),
    OldWord("lift", "position correction, depenetration", (), (
        *FOLDERS_OF_REAL_THINGS, "docs/results/hard_cases.md",
    ), "bodies do lift off"),
    OldWord("parting", "position correction, depenetration"),
    OldWord("foresight", "error estimate, step-size control"),
    OldWord("dear", "expensive"),
    OldWord("dearer", "more expensive"),
    OldWord("toil", "solve count"),
    OldWord("lane", "SIMD vector, element of a vector", ("SIMD lane", "simd_lane"), (
        "rigidimpulse/dynamics/solvers/tgs_soft/*", "tests/unit/test_simd.py", "tests/unit/test_substepped_records.py",
    ), "the lanes of a SIMD vector are its elements"),
    OldWord("core", "skeleton of a rounded shape; inset surface", (
        "rigidimpulse.core", "rigidimpulse/core", "numba.core", '"core.', "'core.", "`core`", "`core/", "`core.", "| core |", "core <-",
        "core/", "\"core\"", "(core|np", "usd-core", "usd_core", "Cores and SIMD",
        "physical core", "processor core", "one core", "two cores", "four cores", "all cores", "many cores", "more cores", "shared cores",
        "number_of_cores", "MOST_CORES", "most_cores", "several cores", "other cores", "number of cores", "each core works", "['cores']",
        '["cores"]', '"cores"', "{cores}", "cores=", "test_cores", "s} cores", "]} cores",
    ), (
        "rigidimpulse/core/*", "rigidimpulse/cli/*", "rigidimpulse/studies/*", "rigidimpulse/gallery/hard/*", "docs/results/*",
        "tests/bench/*", "tests/determinism/test_cores.py",
    ), "the package's lowest folder, the cores of a processor, and the solid core of a body with spikes"),
    OldWord("course", "trajectory", ("of course", "Of course"), FOLDERS_OF_REAL_THINGS, "courses of bricks"),
    OldWord("window", "pair events, candidate pairs", (), (
        *PICTURES, "rigidimpulse/gallery/tosses.py", "docs/results/tosses.md", "tests/*",
    ), "windows of a browser, and of a measured signal"),
    OldWord("calm", "below the sleep speed, asleep"),
    OldWord("calmer", "slower"),
    OldWord("stirred", "awake"),
    OldWord("stir", "wake"),
    OldWord("room", "capacity, workspace", ("room.glb", "room_moving.glb", "room_again.glb", "a room of yours", '"room"'), (
        *FOLDERS_OF_REAL_THINGS, *PICTURES, "docs/reference/gltf.md",
    ), "rooms of scenes, room on a page"),
    OldWord("wish", "accuracy target"),
    OldWord("desk", "report", (), FOLDERS_OF_REAL_THINGS, "furniture"),
    OldWord("deck", "work queue", (), FOLDERS_OF_REAL_THINGS, "a deck of cards"),
    OldWord("team", "workers"),
    OldWord("keeper", "checkpointer"),
    OldWord("book", "record, account", (), (*FOLDERS_OF_REAL_THINGS, "docs/results/accuracy.md"), "books on a table"),
    OldWord("capture", "stick", ("contact capture", "capture_output", "LogCaptureFixture"), PICTURES,
            "pictures are captured, `subprocess` and `pytest` capture output"),
    OldWord("rattles", "inelastic collapse", ("RATTLE",), (), "the velocity projection method RATTLE"),
    OldWord("rattle together", "inelastic collapse"),
    OldWord("wall", "half space, plane", ("wall clock", "wall time", "wall-clock", "wall_s", '"wall"', '"walls"'), (
        *FOLDERS_OF_REAL_THINGS, "rigidimpulse/studies/*", "docs/results/*", "docs/guide/gallery.md", "docs/guide/recipes/blender.md",
        "docs/reference/gltf.md", "README.md",
    ), "walls of bricks, thin walls, pits with walls; time on the wall's clock"),
    OldWord("net", "soft body, cloth", (
        "net force", "net impulse", "net torque", "net momentum", "https://", ".net/", "cloth, a net or jelly",
    ), FOLDERS_OF_REAL_THINGS, "sums, and the nets of scenes"),
    OldWord("arrival", "velocity projection"),
    OldWord("anew", "again"),
    OldWord("so many", "that number of"),
    OldWord("but for", "except for"),
    OldWord("held gap", "contact margin"),
    OldWord("free top", "free rotation"),
    OldWord("forced top", "forced rotation"),
)  # fmt: skip
"""HOUSE words of the left column. `rows`, `touch`, `least`, `delta` and `still` are not here: they are plain English or mathematics in most
places, so that counting them says nothing. Pages of the viewer (JavaScript, CSS) are not read: they have windows, groups and room."""

CODE = ("rigidimpulse/**/*.py",)
PROSE = ("docs/**/*.md", "docs/*.py", "README.md", "demos/**/*.py")
TESTS = ("tests/*.py", "tests/[!a]*/**/*.py")
"""All tests but those of this folder, which names the words."""


@dataclass(frozen=True)
class Measure:
    """One line of the table: key in `allowed.toml`, words, value, what is aimed at, and where the value comes from."""

    key: str
    title: str
    value: float
    aim: float
    places: tuple[str, ...] = ()


@cache
def package() -> Package:
    """The package as it stands."""
    return read_package(PACKAGE)


@cache
def graph() -> dict[str, set[str]]:
    """Its imports; the package's own `__init__` names the homes of the public names and imports them when they are asked for."""
    return import_graph(package())


def _words(patterns: tuple[str, ...]) -> tuple[int, tuple[str, ...]]:
    """Return the number of old words, and a line for each file, the worst first."""
    found = old_words_in(ROOT, patterns, OLD_WORDS)
    ordered = sorted(found.items(), key=lambda item: (-sum(item[1].values()), item[0]))
    return sum(sum(counts.values()) for counts in found.values()), tuple(
        f"{path}: {', '.join(f'{word} {number}' for word, number in sorted(counts.items()))}" for path, counts in ordered
    )


@cache
def measures() -> dict[str, Measure]:
    """Measure the tree."""
    files, lines = size(package())
    rings = circles(graph())
    upwards = layer_violations(graph(), LAYERS)
    counts = parameter_counts(package())
    over = [found for found in counts if found.number > MOST_PARAMETERS]
    far_over = [found for found in over if found.number > HARD_LIMIT]
    untyped, contexts = untyped_parameters(package()), parameters_called(package(), "context")
    code, prose, tests = _words(CODE), _words(PROSE), _words(TESTS)

    def named(found: list) -> tuple[str, ...]:
        return tuple(f"{entry.place}: {entry.number}" for entry in found)

    largest = tuple(rings[0]) if rings else ()
    table = [
        Measure("largest_circle", "files in the largest circle of imports", max(len(largest), 1), 2, largest),
        Measure("circles_over_two", "circles of more than two files", sum(len(ring) > 2 for ring in rings), 0, tuple(map(" ".join, rings))),
        Measure("layer_violations", "imports from a higher layer", len(upwards), 0, tuple(f"{a} imports {b}" for a, b in upwards)),
        Measure("files", "files of the package", files, 370),
        Measure("lines", "lines of the package", lines, 45_000),
        Measure("over_8_parameters", f"functions with more than {MOST_PARAMETERS} parameters", len(over), 10, named(over)),
        Measure("over_12_parameters", f"functions with more than {HARD_LIMIT} parameters", len(far_over), 0, named(far_over)),
        Measure("most_parameters", "most parameters of a function", counts[0].number, HARD_LIMIT, named(counts[:1])),
        Measure("untyped_parameters", "untyped parameters outside kernels", len(untyped), 0, tuple(untyped)),
        Measure("context_parameters", "parameters called `context` outside kernels", len(contexts), 0, tuple(contexts)),
        Measure("old_words_in_code", "old words in the package", code[0], 0, code[1]),
        Measure("old_words_in_prose", "old words in docs, README and demos", prose[0], 0, prose[1]),
        Measure("old_words_in_tests", "old words in tests", tests[0], 0, tests[1]),
    ]
    return {measure.key: measure for measure in table}


def comments() -> float:
    """Comment lines in function bodies as a share of all lines, %. The aim is what the code needs, so that nothing fails on it."""
    return 100.0 * comment_lines(package()) / size(package())[1]


def read_allowed() -> tuple[dict[str, int], dict[str, int]]:
    """Return (allowed values, slack) of `allowed.toml`."""
    table = tomllib.loads(ALLOWED.read_text(encoding="utf-8"))
    return table["allowed"], table["slack"]
