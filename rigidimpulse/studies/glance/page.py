"""The page of a glance: one file that plays all runs side by side, over each other or one at a time, beside a chart of error against time.

While a study goes on, a second file beside the page, `study.js`, hands over what is known by now; the page asks for it every second and
shows it without a reload. When the study ends the page is written with all of it, and the second file goes.

The data are an index (JSON) and a block of bytes (gzip in base64) that the index cuts into arrays, as in `view.sheet`. The index has
    scene      name, duration, asked, until [s], measure, uncertainty [m], size [m], summary
    verdict    headline, details, trust, recommended, reason; null before there is one
    progress   finished, spent [s], waiting: names of runs to come
    times      of the curves, s. impacts: [time s, impulse N s] of the standard run
    runs       name, kind, setting, seconds, spread, whyNot, bound, largest, left, curve (m by frame, null where unknown), stages, motion
    truth      motion of the reference, or null
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.files import write_renamed
from rigidimpulse.model.effect import STAGES
from rigidimpulse.recording.recording import Recording
from rigidimpulse.studies.glance.known import Glance
from rigidimpulse.studies.glance.played import Played
from rigidimpulse.view.camera import frame_action, up_axis
from rigidimpulse.view.page import fill_template, viewer_files
from rigidimpulse.view.sheet import BYTES_A_KEY, MOST_BYTES, Block, Shapes, motion_entry, movers_of

MOST_FRAMES = 240
"""Of the motion of a run in the page."""
MOST_IMPACTS = 400
"""Marks on the timeline; the strongest."""
DIGITS = 3
"""Of errors in the index."""
SHARED_SCRIPTS = ("look.js", "block.js")
SCRIPTS = ("format.js", "pictures.js", "chart.js", "timeline.js", "study.js")
PAGE, SIDECAR = "study.html", "study.js"


def write_page(known: Glance, folder: Path) -> Path:
    """Write the page of a glance into a folder, and beside it what an open page asks for; a finished study has the page alone."""
    told, packed = _told(known)
    page = _page(told, packed, known.name)
    path = write_renamed(folder / PAGE, lambda target: target.write_text(page, encoding="utf-8"))
    if known.finished:
        (folder / SIDECAR).unlink(missing_ok=True)
    else:
        text = f'rigidimpulseStudy({told},"{packed}");'
        write_renamed(folder / SIDECAR, lambda target: target.write_text(text, encoding="utf-8"))
    return path


def page_of(known: Glance) -> str:
    """Return the page of a glance as it is now."""
    return _page(*_told(known), known.name)


def _told(known: Glance) -> tuple[str, str]:
    """Return the index as JSON, and the packed block."""
    index, block = contents(known)
    packed = base64.b64encode(gzip.compress(block, compresslevel=6, mtime=0)).decode("ascii")
    return json.dumps(index, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c"), packed


def contents(known: Glance) -> tuple[dict[str, Any], bytes]:
    """Return the index and the block of bytes."""
    block, shapes, ways = Block(), Shapes(), []
    shown = [played for played in known.runs if played.recording is not None]
    moving = max(len(movers_of(played.recording)) for played in shown if played.recording is not None) if shown else 1
    frames = int(np.clip(MOST_BYTES / (BYTES_A_KEY * max(moving * (len(shown) + 1), 1)), 2, MOST_FRAMES))

    def motion(run: Recording | None, framed: bool = False) -> dict[str, Any] | None:
        if run is None:
            return None
        entry, own = motion_entry(run, shapes, block, frames)
        if framed:
            ways.extend(own)
        return entry

    truth = _truth(known)
    runs = [_run_entry(known, played) | {"motion": motion(played.recording, _is_framed(known, played))} for played in known.runs]
    index = {
        "scene": _scene_entry(known), "verdict": _verdict_entry(known),
        "progress": {"finished": known.finished, "spent": round(known.spent, 1), "waiting": known.waiting},
        "times": known.times.round(5).tolist(), "impacts": _impacts(known), "runs": runs, "truth": motion(truth, True),
        "framing": asdict(frame_action(ways, up_axis(known.scene.gravity))),
        "shapes": [
            [block.add(array.astype(kind)) for array, kind in ((mesh.vertices, "f4"), (mesh.normals, "f4"), (mesh.faces, "u4"))]
            for mesh in shapes.meshes
        ],
    }  # fmt: skip
    return index, bytes(block.bytes)


def _is_framed(known: Glance, played: Played) -> bool:
    """Whether the camera looks at where a run goes: at the standard one while there is no reference."""
    return known.truth is None and played.candidate.name in ("preview", "standard")


def _truth(known: Glance) -> Recording | None:
    """The motion that is drawn as the truth."""
    if known.truth is not None or known.reference is None:
        return known.truth
    return next((played.recording for played in known.runs if played.candidate.name == "exact"), None)


def _scene_entry(known: Glance) -> dict[str, Any]:
    reference = known.reference
    number = int(known.world.dynamic.sum())
    impacts = next((len(played.recording.impacts) for played in known.runs if played.recording is not None), 0)
    part = "" if known.duration >= known.asked else f"the first {known.duration:.2g} of "
    summary = f"{number} moving {'body' if number == 1 else 'bodies'} · {part}{known.asked:.4g} s of motion · {impacts:,} impacts"
    return {
        "name": known.name, "duration": known.duration, "asked": known.asked, "until": known.until, "measure": known.measure,
        "uncertainty": None if reference is None else _figure(reference.uncertainty), "summary": summary,
        "size": float(known.world.size[known.world.dynamic].min(initial=np.inf)),
        "reference": "" if reference is None else reference.describe(),
    }  # fmt: skip


def _verdict_entry(known: Glance) -> dict[str, Any] | None:
    verdict = known.verdict
    if verdict is None:
        return None
    entry = {"headline": verdict.headline, "details": list(verdict.details), "trust": verdict.trust}
    return entry | {"recommended": verdict.recommended, "reason": verdict.reason}


def _run_entry(known: Glance, played: Played) -> dict[str, Any]:
    candidate, figures = played.candidate, known.figures(played)
    profile = None if played.recording is None else played.recording.profile
    entry: dict[str, Any] = {
        "name": candidate.name, "kind": candidate.kind, "setting": candidate.setting, "seconds": _figure(played.seconds),
        "spread": _figure(played.spread), "whyNot": played.why_not, "bound": None, "largest": None, "left": None, "curve": [],
        "stages": {} if profile is None else {stage: _figure(profile.stages[stage]) for stage in STAGES if stage in profile.stages},
    }  # fmt: skip
    if figures is not None:
        left = None if np.isinf(figures.left) else figures.left
        entry |= {"bound": _figure(figures.bound), "largest": _figure(figures.largest), "left": left}
        entry["curve"] = [_figure(value) for value in figures.curve.tolist()]
    return entry


def _figure(value: float) -> float | None:
    """A number as JSON has it, with few digits; None where it is not finite."""
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None


def _impacts(known: Glance) -> list[list[float]]:
    """Time s and impulse N s of the strongest impacts of the standard run."""
    run = next((played.recording for played in known.runs if played.candidate.name == "standard"), None)
    if run is None or run.impacts.dtype.names is None:
        return []
    strongest = np.sort(np.argsort(run.impacts["impulse"])[-MOST_IMPACTS:])
    return [[round(float(run.impacts["time"][k]), 4), float(f"{run.impacts['impulse'][k]:.2g}")] for k in strongest.tolist()]


def _page(index: str, block: str, name: str) -> str:
    own, shared = resources.files("rigidimpulse.studies.glance") / "page", resources.files("rigidimpulse.view") / "page"
    scripts = [*(shared / name for name in SHARED_SCRIPTS), *(own / name for name in SCRIPTS)]
    viewer = viewer_files()
    fields = {
        "title": html.escape(f"{name}: what accuracy costs"),
        "style": (own / "study.css").read_text(encoding="utf-8"),
        "license": (viewer / "main.min.js.LICENSE.txt").read_text(encoding="utf-8").replace("--", "- -"),
        "meshcat": (viewer / "main.min.js").read_text(encoding="utf-8"),
        "block": block, "index": index,
        "script": "\n".join(file.read_text("utf-8") for file in scripts),
    }  # fmt: skip
    return fill_template((own / "study.html").read_text(encoding="utf-8"), fields)
