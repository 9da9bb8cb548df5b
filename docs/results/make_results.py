"""Write the pages of docs/results/ from their data: `python docs/results/make_results.py [PAGE ...]`.

Pages: accuracy, hard_cases, validation, what_accuracy_costs, narrow_phases, speed, tosses, release; none: all. No number is typed here:
each comes from a file of data, and the page says which machine, commit and command made it. The table in README.md is written, too.
"""

from __future__ import annotations

import ast
import csv
import math
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from provenance import DATA, ROOT, generated, known, origin
from topics import KEPT, METHODS, TOPICS

sys.path.insert(0, str(ROOT / "tests" / "bench"))

from fit_tosses import GOALS

from rigidimpulse.gallery.hard import FAMILIES
from rigidimpulse.gallery.record import figure
from rigidimpulse.studies.glance import words
from rigidimpulse.studies.reference import Reference
from rigidimpulse.studies.row import Row
from rigidimpulse.studies.work_precision import Study

HERE = Path(__file__).resolve().parent
NARROW_PHASES = DATA / "narrow_phases.csv"
MIDDLE, PRESETS = DATA / "middle.csv", ("standard", "preview")
GALLERY, HARD = DATA / "gallery_checks.csv", DATA / "hard_checks.csv"
BENCH = ROOT / "tests" / "bench"
TOSSES = BENCH / "tosses"
MATRIX, READY = DATA / "release_matrix.csv", DATA / "ready_wheel.csv"
READY_WORDS = {
    "wheel": "wheel", "megabytes": "size, MB", "megabytes_installed": "kernels when installed, MB",
    "plain_megabytes": "size without kernels, MB",
    "dependencies": "dependencies", "processor": "compiled for", "seconds": "first picture, s",
    "processor_seconds": "its processor time, s", "compiled": "kernels that it compiled",
    "hashes": "hashes of the gallery that are the same",
}  # fmt: skip
"""What the columns of the table of the wheel with ready kernels are called."""
README_CHECKS = (
    ("bounce", "energy, relative change"), ("disks_in_a_box", "error of final positions"), ("wing_nut", "error of the attitude"),
    ("galperin_3", "impacts"), ("superball", "error of the final place"), ("spot", "error of the ledger"),
    ("rolling", "steel: error of the way"), ("planets", "comet: way from its start"),
)  # fmt: skip
"""Scene and the beginning of the check that the README shows."""
PLAYER = """<details><summary>Play the runs (1 MB)</summary>
<iframe src="../_static/study_spot.html" loading="lazy" title="spot: what accuracy costs" width="100%" height="860"
 style="border: 0; border-radius: 14px"></iframe>
</details>
<p><a href="../_static/study_spot.html">Open it in a page of its own</a></p>
"""
"""The playable page, which is loaded when it is asked for; `measure_accuracy_costs.py` makes it."""


def read(path: Path) -> list[dict[str, str]]:
    """Rows of a table of data, by column."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    return "\n".join([*lines, *(f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in row)} |" for row in rows)]) + "\n"


def page(title: str, *parts: str) -> str:
    """A page of parts."""
    return "\n".join([f"# {title}\n", generated(__file__), *parts]).rstrip() + "\n"


def number(text: str | float) -> str:
    """A number for a table; a dash where there is none."""
    return "-" if text in ("", None) or math.isnan(float(text)) else figure(float(text))


def check_rows(rows: Iterable[dict[str, str]]) -> list[tuple[str, ...]]:
    """Cells of checks: what, value, relation and bound, law."""
    words = {"at most": "≤", "at least": "≥", "equal to": "="}
    return [
        (
            row["what"] if row["passed"] == "True" else f"**failed:** {row['what']}",
            number(row["value"]),
            f"{words.get(row['relation'], '')} {number(row['bound'])}",
            code(row["law"]),
        )
        for row in rows
    ]


def code(text: str) -> str:
    """A formula in a table, as it is."""
    return f"`{text}`" if text else ""


def by_scene(rows: list[dict[str, str]]) -> dict[str, list[dict[str, str]]]:
    """Checks of each scene."""
    found: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        found.setdefault(row["scene"], []).append(row)
    return found


def accuracy() -> str:
    """All checks of the gallery."""
    rows = read(GALLERY)
    scenes = by_scene(rows)
    passed = sum(row["passed"] == "True" for row in rows)
    parts = [
        "Each gallery scene is compared with a law of physics in closed form, or with an exact reference. The bound "
        "follows from the law and its\n"
        "tolerances, never from what the library reaches. `rigidimpulse demo NAME` repeats the checks of one scene.\n",
        origin(GALLERY),
        f"{passed} of {len(rows)} checks hold, in {len(scenes)} scenes.\n",
        "## Known limits\n\n"
        "- While bodies stay in contact, contact forces are constant over a sub-step. The motion is of second order "
        "in it. The ledger counts what is\n"
        '  corrected as "energy correction".\n'
        "- A block of several contact points knows one slip direction per phase of an impact. A single point "
        "follows its slip as it turns.\n"
        "- The default response takes touching pairs one after the other. A body that is struck from both sides at "
        "once may leave unevenly.\n"
        '  `response="simultaneous"` keeps the symmetry.\n',
        "## Checks\n",
    ]
    for name, checks in scenes.items():
        parts += [f"### `{name}`\n", table(("quantity", "value", "bound", "law"), check_rows(checks))]
    return page("Accuracy", *parts)


def hard_cases() -> str:
    """All checks of the hard cases."""
    rows = read(HARD)
    scenes = by_scene(rows)
    good = sum(all(row["passed"] == "True" for row in checks) for checks in scenes.values())
    parts = [
        "Hard cases are scenes that rigid-body engines fail on. They run at default settings. How to run them is in the\n"
        "[guide](../guide/gallery.md#hard-cases). A check that names other settings shows that these are not enough.\n",
        origin(HARD),
        f"{good} of {len(scenes)} cases pass. Times are those of the simulation and its checks in a process of its own, "
        "kernels loaded from disk.\n",
    ]
    for title, cases in FAMILIES.values():
        lines = []
        for name in cases:
            for k, cells in enumerate(check_rows(scenes[name])):
                first = scenes[name][0]
                lines.append((f"`{name}`" if k == 0 else "", *cells[:3], f"{float(first['seconds']):.1f}" if k == 0 else "", cells[3]))
        parts += [f"## {title}\n", table(("case", "quantity", "value", "bound", "time, s", "law"), lines)]
    return page("Hard cases", *parts)


def validation() -> str:
    """What the tests of laws say of themselves."""
    folders = (
        ("Laws in closed form", "laws"), ("Order of errors in the step", "order"), ("Both sides of an option", "both_sides"),
        ("Same bits", "determinism"), ("Whole scenes", "invariants"), ("Files", "io"),
    )  # fmt: skip
    parts = [
        "Each line is a file of tests. Its text is the first sentence of the file. The file states the law, the "
        "bound and how far a wrong implementation\n"
        "would be off. `python tests/run.py` runs all tests, `python tests/run.py tests/laws/test_impulse.py` runs one file.\n",
        "Measured values are on the pages [accuracy](accuracy.md) and [hard cases](hard_cases.md).\n",
    ]
    for title, folder in folders:
        lines = []
        for path in sorted((ROOT / "tests" / folder).glob("test_*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            words = (ast.get_docstring(tree) or "").split("\n\n")[0].replace("\n", " ")
            sentence = re.split(r"(?<=[a-z)])\. |:$", words)[0].rstrip(".:")
            count = sum(isinstance(node, ast.FunctionDef) and node.name.startswith("test_") for node in tree.body)
            lines.append((sentence, count, f"`{path.relative_to(ROOT)}`"))
        parts += [f"## {title}\n", table(("what is tested", "tests", "file"), lines)]
    return page("Validation", *parts)


def study_of(name: str) -> Study:
    """A study as it was kept."""
    path = KEPT / f"{name}.csv"
    about = known(path)
    reference = Reference(about["reference"], "", None, {}, about["uncertainty"])
    return Study(name, TOPICS[name].duration, reference, [Row.of(cells) for cells in read(path)], [""] * about["left"])


def small(value: float) -> str:
    """A number for a table of errors."""
    return "-" if math.isnan(value) else "0" if value == 0.0 else f"{value:.1e}"


def what_accuracy_costs() -> str:
    """Studies of ten scenes and of a pile: a sentence and a chart each, tables below for those who want them."""
    studies = {name: study_of(name) for name in TOPICS}
    pile = KEPT / "pile_1000.csv"
    parts = [
        "Each scene has one message and one chart. The message says how far the `standard` run is from the truth at most, "
        "what it costs, and what other methods\n"
        "are worth at about the same cost. Down and left is better on a chart. "
        "For your own scene, `rigidimpulse study SCENE` says its sentence within seconds:\n"
        "see the [guide](../guide/studies.md). What to choose is in the guide, too: [accuracy](../guide/accuracy.md).\n",
        "## See it move\n\nA cow falls on a ring. Each picture is the same fall, computed in another way, with its seconds, "
        "and its error counts up as it plays. Click a point of\n"
        "the chart to play that run.\n",
        PLAYER,
        "## Where the numbers come from\n\nErrors are the largest of any body at any frame. "
        "Costs are processor seconds of the loop (of the steps, in other engines).\n",
        origin(KEPT / "spot.csv"),
        *(section(name, study) for name, study in studies.items()),
        pile_section(pile),
    ]
    return page("What accuracy costs", *parts)


def pile_section(pile: Path) -> str:
    """What is said of a pile, whose measure is depth."""
    rows = read(pile)
    standard = next(row for row in rows if row["setting"] == "standard")
    others = [row for row in rows if row["family"] not in ("step 1/60", "step 1/30", "step 1/20")]
    told = ", ".join(
        f"{row['family']}, {row['setting']}: {words.length(float(row['depth']) / 1e3)} in {number(row['mean'])} ms" for row in others
    )
    message = (
        f"Standard lets no box be deeper inside another than {words.length(float(standard['depth']) / 1e3)}, and takes "
        f"{number(standard['mean'])} ms for 1/60 s of motion. Other engines: {told}."
    )
    return "\n".join([
        "## A pile\n", message + "\n",
        "Boxes fall into a pit and are [sub-stepped](../theory/sub_stepping.md). Where they land has no truth: motion in a pile is "
        "chaotic. So the measure is depth.\n",
        "![Depth against time of a pile](pile_costs.png)\n",
        origin(pile),
        table(
            ("engine or step", "setting", "mean, ms", "median, ms", "deepest overlap, mm", "at the end, mm"),
            [(row["family"], row["setting"], row["mean"], row["median"], row["depth"], row["last_depth"]) for row in rows],
        ),
    ])  # fmt: skip


def message_of(study: Study) -> str:
    """What a study showed, in sentences; lengths are bounds, as in the sentence of `rigidimpulse study`."""
    rows = {row.name: row for row in study.rows if row.ran and not math.isnan(row.whole.position)}
    standard, least = rows["standard"], study.reference.uncertainty
    bound = standard.whole.position + least
    measured = study.reference.kind == "measured"
    truth = "recorded motion" if measured else "truth"
    until, cost = words.motion_time(study.duration), words.seconds(standard.cost)
    text = f"Standard stays within {words.length(bound)} of the {truth} for {until} and takes {cost}."
    for title, family in METHODS.items():
        rivals = [row for row in rows.values() if row.family == family and row.same_as != "standard"]
        if family == "bisection, step" or not rivals:
            continue
        rival = min(rivals, key=lambda row: abs(math.log(max(row.cost, 1e-6) / max(standard.cost, 1e-6))))
        off, cost = rival.whole.position - least, words.cost(max(rival.cost, 1e-6), max(standard.cost, 1e-6))
        cost = "at the same cost" if cost == "the same time" else f"in {cost}"
        if off > 2.0 * bound:
            text += f" {title[0].upper()}{title[1:]} {cost}: {words.length(off, up=False)} off."
    return text


def section(name: str, study: Study) -> str:
    """What is said of one scene: a message, its chart, and the numbers of the best settings, folded."""
    rows = [row for row in study.rows if row.family == "presets"] + [row for row in study.front() if row.family != "presets"]
    least, cells = study.reference.uncertainty, []
    for row in rows:
        whole = row.whole
        place = small(whole.position) if whole.position >= least else f"< {small(least)}"
        cells.append((row.name, small(row.cost), place, *(small(value) for value in (whole.energy, whole.impact_time, whole.penetration))))
    numbers = table(("setting", "cost, s", "place, m", "energy", "impact times, s", "overlap, m"), cells)
    parts = [
        f"## `{name}`\n", message_of(study) + "\n", TOPICS[name].words + f" Reference: {study.reference.kind}.\n",
        f"![{name}](accuracy_costs/{name}.png)\n",
        f"<details><summary>The presets and the best settings</summary>\n\n{numbers}\n</details>\n",
    ]  # fmt: skip
    return "\n".join(parts)


def narrow_phases() -> str:
    """First impacts with own manifolds and with FCL's."""
    rows, lines = read(NARROW_PHASES), []
    quantities = {"later": "time, s", "place": "place, of the size", "turn": "normal, rad", "impulse": "impulse, relative"}
    for kind in dict.fromkeys(row["kind"] for row in rows):
        chosen = [row for row in rows if row["kind"] == kind]
        for name, quantity in quantities.items():
            values = sorted(abs(float(row[name])) for row in chosen)
            first = (kind, len(chosen)) if name == "later" else ("", "")
            lines.append((*first, quantity, small(values[len(values) // 2]), small(values[-1])))
    counts = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own, fcl, common, raw, ghosts = (
            sum(int(row[name]) for row in rows if row["kind"] == kind) for name in ("own", "fcl", "common", "raw", "ghosts")
        )
        counts.append((kind, own, fcl, common, raw, f"{ghosts} ({100.0 * ghosts / raw:.0f} %)"))
    parts = [
        "Random pairs of meshes fly at each other, once with own manifolds and once with `narrow_phase=\"fcl\"`. What "
        "FCL does is in\n"
        "[contacts](../theory/contacts.md#contacts-by-fcl). Sizes are 1 mm to 100 m; masses, restitution, friction and "
        "spins are random. Convex meshes are hulls\n"
        "of 5 to 60 points. Concave ones are a cow (`assets/meshes`), stars and rings.\n",
        origin(NARROW_PHASES),
        "## First impact\n\nThe difference of FCL's from the own.\n",
        table(("meshes", "pairs", "difference of", "median", "largest"), lines),
        "The contact of a random pair is unique, a corner on a face or two edges, so both must agree. What is left is "
        "round-off: of the closest points over\n"
        "their distance, times what the impulse makes of a turn of the normal.\n",
        "## Contacts at that instant\n\n"
        "The last two columns are of FCL's collision alone, with one body 1e-4 of the size inside the other, as a loop "
        "leaves them that does not back up\n"
        "time. A ghost is a point without an own contact within 2e-4 of the size and 1 degree of it.\n",
        table(("meshes", "own", "FCL's", "common", "points of FCL's collision", "ghosts among them"), counts),
        "The ghosts are the difference. Where two edges cross, all points are ghosts: FCL gives corners of the "
        "triangles and the normal of a face. Where a\n"
        "corner meets a face, its point is right, and comes several times. On concave meshes the same holds at each of "
        "their contacts, and in hollows triangles\n"
        "of both sides meet. Backing up time, the filter and FCL's distance leave none of them.\n",
    ]
    return page("Narrow phases", *parts)


def speed() -> str:
    """Times beside other engines and of the main scenes."""
    parts = [
        "`run.profile` or `--profile` shows where the time of a run goes. `rigidimpulse study --scaling` measures "
        "how the cost grows with the number of\n"
        "bodies. `tests/bench/memory.py` measures memory.\n"
    ]
    for path in sorted(BENCH.glob("*/scenes.csv")):
        rows = [(row["what"], *(f"{float(row[name]):.3f}" for name in ("median", "least", "bound")), row["runs"]) for row in read(path)]
        parts += ["## Main scenes\n", origin(path), table(("what", "median, s", "least, s", "bound, s", "runs"), rows)]
    for path in sorted(BENCH.glob("*/against_peers.csv")):
        rows = read(path)
        parts += [
            "## Beside other engines\n\nThe same scenes run in all engines in turn, on one core each. Times are "
            "those of the loop here and of the steps there.\n"
            "The ratio is to the fastest other engine, the median over the rounds. Overlap is the deepest at any time and at the end.\n",
            origin(path),
        ]
        for scene in dict.fromkeys(row["scene"] for row in rows):
            unit = "ms for 1/60 s" if scene.startswith(("boxes", "hulls")) else "s in all"
            lines = [
                (
                    row["engine"], f"{float(row['mean']):.3g}", f"{float(row['median']):.3g}", f"{float(row['mean of the fastest']):.2f}",
                    length(row["deepest"]), length(row["at the end"]), row["note"].split(";")[0],
                )
                for row in rows if row["scene"] == scene
            ]  # fmt: skip
            parts += [
                f"### `{scene}`\n",
                table(("engine or setting", f"mean, {unit}", f"median, {unit}", "ratio", "overlap, mm", "at the end, mm", "note"), lines),
            ]
    return page("Speed", *parts, *ladder())


def ladder() -> list[str]:
    """What presets and other engines cost in scenes of one to two hundred bodies, and how far off they are."""
    rows = read(MIDDLE)
    parts = [
        "## From one body to two hundred\n\nScenes that people build first. Cost is processor time on one core for a second of motion: "
        "of the whole call of `simulate` here, of the\n"
        "steps alone in other engines, in steps of 1/240 s. Overlap is the deepest at any frame, of the size of the smaller body. The "
        "ratio is to the fastest\n"
        "other engine. Other engines take the hull of a concave mesh, so they are given the convex parts of it, in lines of their own.\n"
        "An overlap above 1 is a body that went through another.\n",
        "![Overlap against cost, scene by scene](middle.png)\n",
        origin(MIDDLE),
    ]
    for scene in dict.fromkeys(row["scene"] for row in rows):
        here = [row for row in rows if row["scene"] == scene]
        best = min((float(row["seconds"]) for row in here if row["what"] not in PRESETS), default=math.nan, key=_or_never)
        lines = [
            (
                row["what"], number(row["seconds"]), _ratio(float(row["seconds"]), best), number(row["depth"]), number(row["gap"]),
                row["status"],
            )
            for row in here
        ]  # fmt: skip
        columns = ("preset or engine", "s for 1 s", "ratio", "overlap", "gap of joints, m", "note")
        parts += [f"### `{scene}`\n\n{here[0]['about']}\n", table(columns, lines)]
    return parts


def _or_never(seconds: float) -> float:
    return math.inf if math.isnan(seconds) else seconds


def _ratio(seconds: float, best: float) -> str:
    """How many times as long as the best, or a dash."""
    return "-" if math.isnan(seconds / best) else f"{seconds / best:.2g}"


def length(text: str) -> str:
    """A depth in mm, or a dash."""
    return "-" if math.isnan(float(text)) else f"{float(text):.2g}"


def tosses() -> str:
    """Errors of recorded throws."""
    each = read(TOSSES / "each.csv")
    halves = {"even": each[::2], "odd": each[1::2]}
    lines = []
    for row in read(TOSSES / "fits.csv"):
        fitted = f"{row['position fitted']} %, {row['rotation fitted']}°" if row["position fitted"] else ""
        lines.append(
            (
                *(row[name] for name in ("body", "fitted on", "friction", "restitution", "inertia")),
                fitted,
                f"{row['position judged']} %, {row['rotation judged']}°",
            )
        )
    middle = []
    for name, rows in halves.items():
        for what, unit in (("position", "%"), ("rotation", "°")):
            values = sorted(float(row[what]) for row in rows)
            mean = sum(values) / len(values)
            middle.append((name, what, f"{values[len(values) // 2]:.3g} {unit}", f"{mean:.3g} {unit}", f"{values[-1]:.3g} {unit}"))
    parts = [
        "Recorded tosses of an acrylic cube on a board (`assets/README.md`) are compared with the same throws "
        "simulated. `rigidimpulse demo toss` shows\n"
        "one. `rigidimpulse/gallery/tosses.py` loads, starts and scores them.\n",
        origin(TOSSES / "fits.csv"),
        "## Method\n\n"
        "- **Data.** The recorded lengths read a little short, as free fall and the height at rest show. Lengths "
        "stay as recorded, with a matching gravity.\n"
        "  Errors are divided by the stated width of the cube.\n"
        "- **Start.** Three frames before the lowest corner can touch. Pose, velocity and spin are those of the "
        "exact flight that fits all frames before best.\n"
        "- **Run.** From there to the last frame, at the default accuracy.\n"
        "- **Errors.** The mean distance over the width and the mean angle over the frames, averaged over tosses. "
        "The symmetry of the cube is not used.\n"
        "- **Fit.** One friction and one restitution from a grid, fitted on one half of the tosses and judged on the other half.\n",
        "## Fits\n\nErrors are position and rotation. A row may also fit the moment of inertia, or round the corners. "
        f"The goal was {100.0 * GOALS[0]:g} % and {math.degrees(GOALS[1]):g}° on the judged half.\n",
        table(("what is fitted", "fitted on", "friction", "restitution", "inertia, kg m²", "fitted half", "judged half"), lines),
        "## Each toss\n\nErrors over the tosses of each half.\n",
        table(("half", "error", "median", "mean", "largest"), middle),
        "![Errors of the tosses](tosses.png)\n",
        "## What limits the errors\n\n"
        "`tests/bench/fit_tosses.py` also varies the start within the noise of the measurement, and the step of the "
        "contact forces. Both matter less than\n"
        "the law. One coefficient of friction is a compromise: the measured ratio of tangential to normal impulse "
        "falls with the speed. A friction that\n"
        "falls in the same way did not lower the errors, so this is not the only cause. A toss that ends on another "
        "face than the recorded one has a large\n"
        "rotation error; a few such tosses make much of the mean. One toss of the source is moved after it has come "
        "to rest, as by a hand. It is left in.\n",
    ]
    return page("Real tosses", *parts)


def readme() -> str:
    """The README with its table of checks."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    scenes, lines = by_scene(read(GALLERY)), []
    for name, what in README_CHECKS:
        check = next(row for row in scenes[name] if row["what"].startswith(what))
        quantity, value, bound, law = check_rows([check])[0]
        lines.append((f"`{name}`", quantity, value, bound, law))
    begin, end = "<!-- checks: begin -->\n", "<!-- checks: end -->"
    before, after = text.split(begin)[0], text.split(end)[1]
    return before + begin + table(("scene", "quantity", "value", "bound", "law"), lines) + end + after


def release() -> str:
    """The wheel in clean environments, and the wheel with ready kernels."""
    rows, ready = read(MATRIX), read(READY)
    good = sum(row["result"] == "ok" and not row["hashes"].startswith("other") for row in rows)
    parts = [
        "The wheel is built, installed in clean environments and run outside of the clone. Each run makes the first picture. "
        "Others throw a die,\nsave, load, export, use a cache, the command line, a robot, USD and a quadratic program, and repeat "
        "pinned hashes of the gallery.\n",
        origin(MATRIX),
        f"{good} of {len(rows)} runs do all that and have the same hashes.\n",
        "Kernels may be compiled for any processor, and what leads to a motion calls no function of a library that chooses its code by "
        "the processor.\nLAPACK is left: three of 51 scenes of the gallery, in which energies are minimised, have other hashes with "
        "OpenBLAS's code for other processors.\n",
        "## Environments\n\nSeconds are those of `rigidimpulse demo spot` with its page, with all that is compiled for it. "
        "Processor seconds are of all its\nprocesses. Compiled and loaded are kernels of the process of the demo. Others compile for "
        "it, too.\n",
    ]
    columns = {"dependencies": "dependencies", "conditions": "conditions", "seconds": "s", "processor_seconds": "processor s"}
    columns |= {name: name for name in ("compiled", "loaded", "hashes", "result")}
    for version in dict.fromkeys(row["python"] for row in rows):
        lines = [[row[name] for name in columns] for row in rows if row["python"] == version]
        parts += [f"### Python {version}\n", table(list(columns.values()), lines)]
    parts += [
        "## A wheel with ready kernels\n\nThe same wheel with all kernels that `rigidimpulse warmup` and the gallery need, compiled "
        "for a class of processors.\nThe first picture is made in a clean environment where nothing has run before.\n",
        origin(READY),
        table(("", "value"), [(READY_WORDS[name], value) for name, value in ready[0].items()]),
    ]
    return page("Release", *parts)


PAGES: dict[str, Callable[[], str]] = {
    "narrow_phases": narrow_phases, "accuracy": accuracy, "hard_cases": hard_cases, "validation": validation,
    "what_accuracy_costs": what_accuracy_costs, "speed": speed,
    "tosses": tosses, "release": release,
}  # fmt: skip


def main() -> None:
    """Write the pages that are asked for."""
    for name in sys.argv[1:] or PAGES:
        (HERE / f"{name}.md").write_text(PAGES[name](), encoding="utf-8")
    (ROOT / "README.md").write_text(readme(), encoding="utf-8")


if __name__ == "__main__":
    main()
