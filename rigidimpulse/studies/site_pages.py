"""The HTML of `site`: the index and the page of a scene, which need nothing but the files beside them."""

from __future__ import annotations

import html
import importlib.util
import io
import keyword
import tokenize
from collections.abc import Sequence
from pathlib import Path

from rigidimpulse import gallery
from rigidimpulse.core.version import VERSION
from rigidimpulse.gallery.record import GalleryScene
from rigidimpulse.studies.hard_cases import CaseResult
from rigidimpulse.studies.hard_page import checks_table

STYLE = Path(__file__).with_name("site.css")


def index_page(results: Sequence[CaseResult], folder: Path) -> str:
    """Return the index: a card a scene, those that did not pass first."""
    passed = sum(result.passed for result in results)
    seconds, motion = sum(result.seconds for result in results), sum(result.duration for result in results)
    cards = "\n".join(_card(result, folder) for result in sorted(results, key=lambda result: result.passed))
    head = f"""<header><h1>rigidimpulse <span>gallery</span></h1>
<p class="lead">Rigid bodies that collide exactly. Every scene is checked against a law of mechanics; open one to play it.</p>
<p class="tally"><b>{passed}</b> of {len(results)} scenes pass all their checks <i></i> <b>{motion:,.0f} s</b> of motion computed in
<b>{seconds:,.0f} s</b> <i></i> version {_text(VERSION)}</p></header>"""
    return _document("Gallery", f'{head}\n<div class="cards">\n{cards}\n</div>')


def scene_page(entry: GalleryScene, result: CaseResult, folder: Path) -> str:
    """Return the page of a scene: the recording to play, checks, status and source."""
    name = entry.name
    player = ""
    if (folder / f"{name}_play.html").is_file():
        player = f'<iframe src="{name}_play.html" title="{_text(name)}" allow="fullscreen"></iframe>\n<p class="open">'
        player += f'<a href="{name}_play.html">open it alone</a></p>'
    source = _source(entry)
    facts = f"""<dl><dt>result</dt><dd>{_badge(result)}</dd><dt>computed in</dt><dd>{_seconds(result.seconds)}</dd>
<dt>motion</dt><dd>{result.duration:g} s, {result.impacts:,} impacts</dd>
<dt>status</dt><dd class="status">{_text(result.message)}</dd></dl>"""
    elsewhere = f'<section><h2>Other engines</h2><p>{_text(result.elsewhere)}</p></section>' if result.elsewhere else ""
    checks = f'<section class="checks"><h2>Checks</h2>{checks_table(result.checks)}</section>' if result.checks else ""
    body = f"""<header><p class="back"><a href="index.html">all scenes</a></p><h1>{_text(name)}</h1>
<p class="lead">{_text(_sentence(entry.description))}</p></header>
{player}
{facts}
{checks}
{elsewhere}
<section><h2>Source</h2><pre><code>{source}</code></pre></section>"""
    return _document(name, body)


def coloured(source: str) -> str:
    """Return Python source as HTML, with comments, texts, numbers and keywords marked; as it is if it cannot be read."""
    pieces, row, column, lines = [], 1, 0, source.splitlines(keepends=True)

    def until(end: tuple[int, int]) -> str:
        nonlocal row, column
        text = ""
        while row < end[0]:
            text += lines[row - 1][column:]
            row, column = row + 1, 0
        if end[1] > column:
            text += lines[row - 1][column : end[1]]
            column = end[1]
        return html.escape(text)

    try:
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            kind = _kind(token)
            pieces.append(until(token.start))
            text = until(token.end)
            pieces.append(f'<span class="{kind}">{text}</span>' if kind and text else text)
    except (tokenize.TokenError, SyntaxError, IndexError):
        return html.escape(source)
    return "".join(pieces)


def _kind(token: tokenize.TokenInfo) -> str:
    """Return what a token is called in the style; nothing for most."""
    if token.type == tokenize.NAME and keyword.iskeyword(token.string):
        return "word"
    return {tokenize.COMMENT: "comment", tokenize.STRING: "text", tokenize.NUMBER: "figure"}.get(token.type, "")


def _source(entry: GalleryScene) -> str:
    """Return the source of the module that makes a scene."""
    spec = importlib.util.find_spec(gallery.module_name(entry.name))
    if spec is None or spec.origin is None:
        return "not at hand"
    return coloured(Path(spec.origin).read_text(encoding="utf-8"))


def _card(result: CaseResult, folder: Path) -> str:
    """Return the card of a scene."""
    name = result.name
    drawn = (folder / f"{name}.png").is_file()
    picture = f'<img src="{name}.png" alt="" loading="lazy">' if drawn else '<div class="none">no picture</div>'
    return f"""<a class="card {'good' if result.passed else 'bad'}" href="{name}.html">{picture}
<div class="words"><h2>{_text(name)}</h2><p>{_text(_sentence(result.description))}</p>
<p class="foot">{_badge(result)}<span>{_seconds(result.seconds)}</span></p></div></a>"""


def _badge(result: CaseResult) -> str:
    """Return how a scene did, in a few words."""
    held = sum(check["passed"] for check in result.checks)
    number = len(result.checks)
    words = f"{held} of {number} {'check' if number == 1 else 'checks'}" if number else result.outcome
    return f'<span class="badge {"good" if result.passed else "bad"}">{"✓" if result.passed else "✗"} {words}</span>'


def _document(title: str, body: str) -> str:
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">
<title>{_text(title)}</title>
<style>{STYLE.read_text(encoding="utf-8")}</style></head>
<body><main>
{body}
</main></body></html>
"""


def _seconds(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds < 10.0 else f"{seconds:,.0f} s"


def _text(text: str) -> str:
    return html.escape(text)


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]
