"""A format of its own: one line of text for each frame, with the height of the first body [m]."""

from __future__ import annotations

from rigidimpulse.recording.exporters import ExportTarget
from rigidimpulse.recording.recording import Recording


def write_heights(run: Recording, target: ExportTarget) -> None:
    """Write time and height of each frame."""
    lines = [f"{time!r} {height!r}" for time, height in zip(run.times.tolist(), run.positions[:, 0, 2].tolist(), strict=True)]
    target.path.write_text("\n".join([target.title, *lines]), encoding="utf-8")
