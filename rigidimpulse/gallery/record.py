"""What a gallery scene is: a scene, how long to run it, and checks of the result against laws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rigidimpulse.errors import SceneError

if TYPE_CHECKING:
    from rigidimpulse.recording import Recording
    from rigidimpulse.scene import Scene

PACKAGE = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Check:
    """One comparison of a run with a law.

    Attributes:
        what: the quantity, with its unit.
        value: what the run gave: an error to be kept below `bound`, or a count to be equal to it.
        bound: see `value`.
        passed: whether it holds.
        law: the law it follows from.

    """

    what: str
    value: float
    bound: float
    passed: bool
    law: str


def at_most(what: str, value: float, bound: float, law: str) -> Check:
    """Return the check that an error, which must be a number, is at most `bound`."""
    return Check(what, float(value), float(bound), bool(math.isfinite(value) and value <= bound), law)


def equal(what: str, value: float, expected: float, law: str) -> Check:
    """Return the check that a count is the expected one."""
    return Check(what, float(value), float(expected), bool(value == expected), law)


@dataclass(frozen=True)
class GalleryScene:
    """A named scene with its checks.

    Attributes:
        name: what commands call it.
        description: one line.
        scene: makes the scene.
        check: compares a recording of `duration`, at any frame rate, with the laws of the scene.
        duration: s. fps: frames per second. accuracy: preset.

    """

    name: str
    description: str
    scene: Callable[[], Scene]
    check: Callable[[Recording], list[Check]]
    duration: float
    fps: float = 60.0
    accuracy: str = "standard"


def asset_path(name: str, folder: str = "meshes") -> Path:
    """Return the path of a file that comes with the library, in an installed package as well as in a clone.

    Args:
        name: of the file.
        folder: of the assets, "meshes" or "tosses".

    Raises:
        SceneError: there is none of this name.

    """
    places = [PACKAGE / "assets" / folder / name, PACKAGE.parent / "assets" / folder / name]
    for place in places:
        if place.is_file():
            return place
    raise SceneError(f"file {name!r} is not in {' or '.join(str(place.parent) for place in places)}", "install again")
