"""Rows of a study on disk, written as they come, and its reference: a study that was stopped goes on where it was.

The first line names the fingerprint of what was studied; a file with another one is not gone on with but put aside. The reference is
stored, too: a new one, made in another time, would be another scale for the rows to come.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.files import make_folder, write_renamed
from rigidimpulse.studies.measures import Truth
from rigidimpulse.studies.reference import Reference
from rigidimpulse.studies.row import COLUMNS, Row

MARK = "# study "


class StoredRows:
    """The rows in a file; without a file they are only held in memory."""

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
                complete = [cells for cells in csv.DictReader(lines[1:]) if None not in cells.values() and None not in cells]
                self._rows = {cells["name"]: Row.of(cells) for cells in complete}
            else:
                path.replace(path.with_suffix(".old.csv"))
        make_folder(path.parent)
        with path.open("w", encoding="utf-8", newline="") as file:
            file.write(first + "\n")
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(row.cells() for row in self._rows.values())

    def get(self, name: str) -> Row | None:
        """The row of a setting, if there is one."""
        return self._rows.get(name)

    def add(self, row: Row) -> None:
        """Add a row, and write it to the file."""
        self._rows[row.name] = row
        if self._path is not None:
            with self._path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file).writerow(row.cells())


def stored_reference(path: Path | None, fingerprint: str, make: Callable[[], Reference]) -> Reference:
    """The reference in a file of this study, or a new one, which is written there; None: it is only made."""
    if path is not None and path.is_file():
        try:
            with np.load(path, allow_pickle=False) as data:
                if str(data["fingerprint"]) == fingerprint:
                    return _read(data)
        except (OSError, KeyError, ValueError):
            pass  # cut off while it was written: made again
    reference = make()
    if path is not None:
        make_folder(path.parent)
        write_renamed(path, lambda target: np.savez_compressed(target, **_arrays(reference, fingerprint)))
    return reference


def _arrays(reference: Reference, fingerprint: str) -> dict[str, Any]:
    arrays: dict[str, Any] = {
        "fingerprint": np.array(fingerprint), "kind": np.array(reference.kind), "note": np.array(reference.note),
        "names": np.array(list(reference.horizon), dtype=str), "horizon": np.array(list(reference.horizon.values())),
        "uncertainty": np.array(reference.uncertainty),
    }  # fmt: skip
    truth = reference.truth
    if truth is not None:
        told = {"times": truth.times, "position": truth.position, "orientation": truth.orientation, "scale": np.array(truth.scale)}
        arrays.update(told, **{name: value for name in ("energy", "impacts") if (value := getattr(truth, name)) is not None})
    return arrays


def _read(data: Mapping[str, Any]) -> Reference:
    """Return the reference in the arrays of a file."""
    truth = None
    if "times" in data:
        energy, impacts = (data[name] if name in data else None for name in ("energy", "impacts"))
        truth = Truth(data["times"], data["position"], data["orientation"], energy, float(data["scale"]), impacts)
    horizon = dict(zip(data["names"].tolist(), data["horizon"].tolist(), strict=True))
    return Reference(str(data["kind"]), str(data["note"]), truth, horizon, float(data["uncertainty"]))
