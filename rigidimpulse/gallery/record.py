"""The record of a gallery scene: the scene, how long to run it, and checks of the result against laws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import SceneError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from rigidimpulse.recording.recording import Recording
    from rigidimpulse.scene.accuracy import Accuracy, Preset
    from rigidimpulse.scene.scene import Scene

PACKAGE = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Check:
    """One comparison of a run with a law.

    Attributes:
        what: the quantity, with its unit.
        value: what the run gave. bound: what it is compared with, in the way of `relation`.
        passed: whether it holds.
        law: the law it follows from.
        relation: "at most", "at least" or "equal to".

    """

    what: str
    value: float
    bound: float
    passed: bool
    law: str
    relation: str = "at most"


def at_most(what: str, value: float, bound: float, law: str) -> Check:
    """Return the check that an error, which must be a number, is at most `bound`."""
    return Check(what, float(value), float(bound), bool(math.isfinite(value) and value <= bound), law)


def at_least(what: str, value: float, bound: float, law: str) -> Check:
    """Return the check that a quantity, which must be a number, is at least `bound`."""
    return Check(what, float(value), float(bound), bool(math.isfinite(value) and value >= bound), law, "at least")


def equal(what: str, value: float, expected: float, law: str) -> Check:
    """Return the check that a count is the expected one."""
    return Check(what, float(value), float(expected), bool(value == expected), law, "equal to")


def rotations(orientations: np.ndarray) -> Rotation:
    """Return scipy's rotations of quaternions (n, 4) wxyz: they are computed apart from the library's."""
    from scipy.spatial.transform import Rotation

    # Its own option for this order came with scipy 1.14.
    return Rotation.from_quat(np.roll(orientations, -1, axis=-1))


def figure(value: float | None) -> str:
    """Return a value for a table: counts in full, quantities with three digits, errors with two; a dash for what is not finite."""
    if value is None or not math.isfinite(value):
        return "-"
    if abs(value) < 1e15 and value == int(value):
        return f"{int(value):,}"
    return f"{value:.3g}" if 0.01 <= abs(value) < 1000.0 else f"{value:.1e}"


@dataclass(frozen=True)
class Exact:
    """The exact motion of a scene at f times, as far as its law says; or a measured one.

    Attributes:
        position: (f, 3) m of the origin, by body. orientation: (f, 4) wxyz, by body. Bodies that are not named are not known.
        energy: (f,) J, change of the mechanical energy since the start; None where it is not known.
        impacts: (k,) s, times of all impacts until the last of the times; None where they are not known.
        noise: m, how far a measured motion may be off itself; 0 for a closed form.

    """

    position: dict[str, np.ndarray] = field(default_factory=dict)
    orientation: dict[str, np.ndarray] = field(default_factory=dict)
    energy: np.ndarray | None = None
    impacts: np.ndarray | None = None
    noise: float = 0.0


@dataclass(frozen=True)
class GalleryScene:
    """A named scene with its checks.

    Attributes:
        name: what commands call it.
        description: one line.
        scene: makes the scene.
        check: compares a recording of `duration`, at any frame rate, with the laws of the scene.
        duration: s. fps: frames per second. accuracy: preset, or settings where they are the point.
        cheaper: settings that are not enough for this scene: with them at least one check fails, or the run does.
            Shows both sides of an option; None where no option is the point.
        elsewhere: what common engines reach in this scene, as measured; empty if nobody measured it.
        exact: the motion by closed form at given times [s], where there is one.

    """

    name: str
    description: str
    scene: Callable[[], Scene]
    check: Callable[[Recording], list[Check]]
    duration: float
    fps: float = 60.0
    accuracy: Preset | Accuracy = "standard"
    cheaper: Accuracy | None = None
    elsewhere: str = ""
    exact: Callable[[np.ndarray], Exact] | None = None


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
