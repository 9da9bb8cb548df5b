"""Rows of a study on disk, written as they come: a study that was stopped goes on where it was.

The first line names the fingerprint of what was studied; a file with another one is not gone on with but put aside.
"""

from __future__ import annotations

import csv
from pathlib import Path

from rigidimpulse.studies.row import COLUMNS, Row

MARK = "# study "


class KeptRows:
    """The rows in a file; none are kept without one."""

    def __init__(self, path: Path | None, fingerprint: str) -> None:
        """Read the rows that the file has of this study, or begin the file."""
        self._path = path
        self._rows: dict[str, Row] = {}
        if path is None:
            return
        first = MARK + fingerprint
        if path.is_file():
            lines = path.read_text(encoding="utf-8").splitlines()
            if lines and lines[0] == first:
                # A line that was cut off while it was written is left out.
                whole = [cells for cells in csv.DictReader(lines[1:]) if None not in cells.values() and None not in cells]
                self._rows = {cells["name"]: Row.of(cells) for cells in whole}
            else:
                path.replace(path.with_suffix(".old.csv"))
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", encoding="utf-8", newline="") as file:
            file.write(first + "\n")
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(row.cells() for row in self._rows.values())

    def get(self, name: str) -> Row | None:
        """The row of a setting, if there is one."""
        return self._rows.get(name)

    def add(self, row: Row) -> None:
        """Keep a row."""
        self._rows[row.name] = row
        if self._path is not None:
            with self._path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file).writerow(row.cells())
