"""A recording as a table of text: one row a frame and body, figures with all their digits."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.files import plain_cell

if TYPE_CHECKING:
    from rigidimpulse.recording.exporters import ExportTarget
    from rigidimpulse.recording.recording import Recording

COLUMNS = (
    "time [s]", "frame", "body",
    *(f"position {k} [m]" for k in "xyz"),
    *(f"orientation {k}" for k in "wxyz"),
    *(f"velocity {k} [m/s]" for k in "xyz"),
    *(f"angular velocity {k} [rad/s]" for k in "xyz"),
)  # fmt: skip
"""Position and orientation (body to world) are of the body's origin, velocity is of its centre of mass; all in world axes."""


def write_csv(run: Recording, target: ExportTarget) -> None:
    """Write a .csv file of a run: UTF-8, with the head `COLUMNS`, frames in order, within a frame bodies in the order of `run.names`.

    A name that a spreadsheet would compute has an apostrophe in front, see `plain_cell`.
    """
    figures = np.concatenate([run.positions, run.orientations, run.velocities, run.angular_velocities], axis=2).tolist()
    names = [plain_cell(name) for name in run.names]
    with target.path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {warning}\r\n" for warning in run.status.warnings)
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for frame, (time, bodies) in enumerate(zip(run.times.tolist(), figures, strict=True)):
            rows.writerows([time, frame, name, *values] for name, values in zip(names, bodies, strict=True))
