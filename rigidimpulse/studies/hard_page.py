"""The page of the hard-case suite: one self-contained HTML file, a row for each case, its checks behind it.

The bar of a check shows the value against its bound on a logarithmic scale: the line is the bound, each mark a factor of a thousand.
"""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigidimpulse.gallery.record import figure

if TYPE_CHECKING:
    from rigidimpulse.studies.hard_cases import CaseResult

DECADES = 15
"""Range of the bars, half on either side of the bound: powers of ten."""
SIGNS = {"at most": "≤", "at least": "≥", "equal to": "="}
STYLE = Path(__file__).with_name("hard_page.css")
SCRIPT = """
for (const button of document.querySelectorAll("nav button"))
  button.onclick = () => {
    document.body.classList.toggle("only-open", button.dataset.show === "open");
    for (const other of document.querySelectorAll("nav button")) other.setAttribute("aria-pressed", String(other === button));
  };
"""


def page(results: Sequence[CaseResult], machine: Mapping[str, Any]) -> str:
    """Return the page of some results; `machine` is what the times depend on."""
    families: dict[str, list[CaseResult]] = {}
    for result in results:
        families.setdefault(result.family, []).append(result)
    sections = "\n".join(_section(title, cases) for title, cases in families.items())
    about = f"rigidimpulse {machine['rigidimpulse']} · {machine['processor']}, {machine['cores']} cores · {machine['system']}"
    versions = f"Python {machine['python']}, numpy {machine['numpy']}, numba {machine['numba']}"
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>Hard cases</title>
<style>{STYLE.read_text(encoding="utf-8")}</style></head>
<body><main>
<header><h1>Hard cases</h1>
<p>Scenes that rigid-body engines break on, each at default settings, against a law of mechanics or a derived bound.
Click a case for its checks, its laws, and what other engines reach.</p></header>
{_tally(results)}
<nav><button data-show="all" aria-pressed="true">All cases</button>
<button data-show="open" aria-pressed="false">Not passed</button></nav>
{sections}
<footer>{_text(about)}<br>{_text(versions)}<br>
A bar shows a value against its bound, the dark line, on a logarithmic scale: a factor of 1,000 a mark.</footer>
</main><script>{SCRIPT}</script></body></html>
"""


def _tally(results: Sequence[CaseResult]) -> str:
    """Return the numbers at the head: passed, failed, not finished; time."""
    passed = sum(r.outcome == "passed" for r in results)
    late = sum(r.outcome in ("hung", "crashed") for r in results)
    failed = len(results) - passed - late
    seconds = sum(r.seconds for r in results)
    numbers = "".join(
        f'<div class="{kind}"><b>{count}</b><span>{label}</span></div>'
        for kind, count, label in (("good", passed, "passed"), ("bad", failed, "failed a check"), ("late", late, "hung or crashed"))
        if count or kind == "good"
    )
    motion = sum(r.duration for r in results)
    share = "".join(
        f'<i class="{kind}" style="flex: {count}"></i>' for kind, count in (("good", passed), ("bad", failed), ("late", late)) if count
    )
    return f"""<div class="tally">{numbers}<div><b>{seconds:,.0f} s</b><span>for {motion:,.0f} s of motion</span></div></div>
<div class="share">{share}</div>"""


def _section(title: str, cases: Sequence[CaseResult]) -> str:
    """Return a family."""
    passed = sum(case.passed for case in cases)
    rows = "\n".join(_case(case) for case in cases)
    return f"""<section><h2>{_text(title)}<small>{passed} of {len(cases)}</small></h2>
<div class="head"><span></span><span>case</span><span>measure</span><span class="num">value</span><span class="num">bound</span>
<span class="num">time</span></div>
{rows}</section>"""


def _case(case: CaseResult) -> str:
    """Return a case: its line, and behind it all checks."""
    main = case.main_check
    if main is None:
        what, value, bound = f'<div class="what">{_text(case.message[:160])}</div>', "", ""
    else:
        what = f'<div class="what">{_text(main["what"])}<small>{_text(main["law"])}</small></div>'
        value, bound = figure(main["value"]), f"{SIGNS[main['relation']]} {figure(main['bound'])}"
    return f"""<details class="{case.outcome}"><summary><span class="pill">{case.outcome}</span>
<div class="title">{_text(case.description)}<small>{_text(case.name)}</small></div>{what}
<span class="num fig">{value}</span><span class="num fig">{bound}</span><span class="num">{_seconds(case.seconds)}</span></summary>
<div class="checks">{checks_table(case.checks)}{_notes(case)}</div></details>"""


def checks_table(checks: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of checks as plain data (`hard_cases.as_plain`)."""
    if not checks:
        return ""
    rows = "".join(
        f'<tr class="{"yes" if c["passed"] else "no"}"><td>{"✓" if c["passed"] else "✗"}</td><td>{_text(c["what"])}</td>'
        f'<td class="num value">{figure(c["value"])}</td><td class="num">{SIGNS[c["relation"]]} {figure(c["bound"])}</td>'
        f'<td>{_bar(c)}</td><td class="law">{_text(c["law"])}</td></tr>'
        for c in checks
    )
    head = '<tr><th></th><th>check</th><th class="num">value</th><th class="num">bound</th><th></th><th>law</th></tr>'
    return f"<table>{head}{rows}</table>"


def _notes(case: CaseResult) -> str:
    """Return what else there is to say: the run in numbers, its status, other engines, the hash."""
    notes = []
    if case.checks:
        notes.append(f"<b>Run</b> {case.duration:g} s of motion, {case.impacts:,} impacts, {case.seconds:.2f} s")
    notes.append(f"<b>Status</b> {_text(case.message)}")
    if case.elsewhere:
        notes.append(f"<b>Other engines</b> {_text(case.elsewhere)}")
    if case.state_hash:
        notes.append(f"<b>State hash</b> {case.state_hash[:16]}")
    return "".join(f'<p class="note">{note}</p>' for note in notes)


def _bar(check: Mapping[str, Any]) -> str:
    """Return the bar of an error against its bound; counts have none."""
    if check["relation"] != "at most" or not check["bound"] or check["bound"] < 0.0:
        return ""
    value = check["value"]
    if value is None:
        share = 1.0
    elif value <= 0.0:
        share = 0.0
    else:
        share = min(1.0, max(0.02, 0.5 + math.log10(value / check["bound"]) / DECADES))
    return f'<div class="bar"><i style="width: {100.0 * share:.1f}%"></i></div>'


def _seconds(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds < 10.0 else f"{seconds:.0f} s"


def _text(text: str) -> str:
    return html.escape(text)
