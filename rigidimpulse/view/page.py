"""One HTML file of a recording that anyone can open, offline: meshcat's viewer, the motion and our stage around it.

The page holds meshcat's script, a few of its messages (gzip in base64: display geometry, frame times, arrows, tracks),
a manifest in JSON that names and paints what they hold, and the files of `page/`. The same recording gives the same
bytes.
"""

from __future__ import annotations

import base64
import gzip
import html
import os
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from rigidimpulse.core.json_text import json_text
from rigidimpulse.recording.exporters import ExportTarget
from rigidimpulse.view.contents import MOST_KEYS, check_entries, is_large, page_contents
from rigidimpulse.view.protocol import RecordingLike

SCRIPTS = (
    "elements.js", "numbers.js", "theme.js", "look.js", "room.js", "stage.js", "arrows.js", "contacts.js", "trails.js",
    "soft_bodies.js", "shapes.js", "joints.js", "spins.js", "transport.js", "plot.js", "clusters.js", "timeline.js", "panel.js",
    "ledger.js", "impacts.js", "card.js", "inspector.js", "marks.js", "header.js", "hud.js", "messages.js", "main.js",
)  # fmt: skip
LARGE_SCRIPTS = tuple("glb.js" if name == "messages.js" else name for name in SCRIPTS)
"""Those of a large recording, see `contents.MOST_KEYS`."""
STYLES = ("page.css", "layout.css", "panel.css", "card.css")
DEFAULT_TITLE = "rigidimpulse"


def write_html(
    recording: RecordingLike, path: str | os.PathLike[str], title: str = DEFAULT_TITLE, checks: Sequence[Any] = ()
) -> None:
    """Write a recording as one HTML file, which needs nothing else, not even a network.

    Args:
        recording: the motion.
        path: the file.
        title: the sentence of the scene, shown as the page's head and as its name.
        checks: comparisons of the run with laws, see `gallery.record.Check`.

    Raises:
        ValueError: the recording has no frames, or a pose is not finite.

    """
    Path(path).write_text(render_page(recording, title, checks=checks), encoding="utf-8")


def export_html(recording: RecordingLike, target: ExportTarget) -> None:
    """Write a recording as `write_html` does; its title is the name of the file."""
    write_html(recording, target.path, title=target.title)


def render_page(
    recording: RecordingLike, title: str = DEFAULT_TITLE, most_keys: int = MOST_KEYS, checks: Sequence[Any] = ()
) -> str:
    """Return the HTML page of a recording, as `write_html` writes it; most_keys: from which the page is a large one, see `contents`."""
    large = is_large(recording, most_keys)
    manifest, messages = page_contents(recording, large=large)
    manifest["checks"] = check_entries(checks)
    return assemble(manifest, messages, title, LARGE_SCRIPTS if large else SCRIPTS)


def assemble(
    manifest: dict[str, Any],
    messages: list[tuple[str, dict[str, Any]]],
    title: str,
    scripts: tuple[str, ...] = SCRIPTS,
    styles: tuple[str, ...] = STYLES,
) -> str:
    """Return the HTML page of a manifest and messages as in `contents`, with these files of `page/`."""
    files = resources.files("rigidimpulse.view") / "page"
    viewer = viewer_files()
    fields = {
        "title": html.escape(title),
        "style": "\n".join((files / name).read_text(encoding="utf-8") for name in styles),
        "license": (viewer / "main.min.js.LICENSE.txt").read_text(encoding="utf-8").replace("--", "- -"),
        "meshcat": (viewer / "main.min.js").read_text(encoding="utf-8"),
        "commands": "\n".join(_command(kind, message) for kind, message in messages),
        "bar": (files / "bar.html").read_text(encoding="utf-8"),
        "manifest": json_text(manifest).replace("<", "\\u003c"),
        "script": "\n".join((files / name).read_text(encoding="utf-8") for name in scripts),
    }
    return fill_template((files / "page.html").read_text(encoding="utf-8"), fields)


def fill_template(page: str, fields: dict[str, str]) -> str:
    """Return the template with its fields, {{name}}, filled in."""
    # Cut the template at its fields first, so that braces in a name or in a script are never taken for a field.
    pieces = []
    for piece in page.split("{{"):
        name, closed, rest = piece.partition("}}")
        pieces += [fields[name], rest] if closed else [piece]
    return "".join(pieces)


def viewer_files() -> Any:
    """Return the folder of meshcat's viewer."""
    return resources.files("meshcat") / "viewer" / "dist"


def _command(kind: str, message: dict[str, Any]) -> str:
    """Return one meshcat message as an inert script element."""
    import umsgpack

    packed = base64.b64encode(gzip.compress(umsgpack.packb(message), compresslevel=6, mtime=0)).decode("ascii")
    return f'<script class="command" type="text/plain" data-kind="{kind}">{packed}</script>'
