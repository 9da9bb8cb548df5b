"""Keyframes: the path of a kinematic body, given by poses at times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.numeric import numbers_of
from rigidimpulse.scene.shape import normalized_quaternion


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Poses of a body's own origin at times. Between keys the body moves evenly; outside them it stands still.

    Attributes:
        times: (k,) s, increasing.
        positions: (k, 3) m, of the body's origin.
        orientations: (k, 4) quaternions (w, x, y, z), normalised when used; None keeps the body's own orientation.
            Between two keys the body takes the shorter way round.

    """

    times: ArrayLike
    positions: ArrayLike
    orientations: ArrayLike | None = None

    def arrays(self, orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times (k,), positions (k, 3) and unit orientations (k, 4).

        Args:
            orientation: (w, x, y, z) that stands in where the keyframes have none.

        """
        times = np.array(self.times, dtype=np.float64)
        keys = np.tile(np.asarray(orientation, dtype=np.float64), (len(times), 1))
        if self.orientations is not None:
            keys = np.asarray(self.orientations, dtype=np.float64)
        unit = np.array([normalized_quaternion(key) for key in keys])
        return times, np.array(self.positions, dtype=np.float64), unit

    def check(self) -> None:
        """Raise a `SceneError` unless the keyframes describe a path."""
        times = self._array("times", self.times, ())
        positions = self._array("positions", self.positions, (3,))
        if len(times) == 0:
            raise SceneError("there are no keyframes", "give at least one time and position", "keyframes")
        late = np.flatnonzero(np.diff(times) <= 0.0)
        if len(late):
            pair = times[late[0] : late[0] + 2].tolist()
            raise SceneError(
                f"times do not increase: {pair[0]} s is followed by {pair[1]} s",
                "sort the keys, and give two keys of a jump times that differ",
                "keyframes",
            )
        lengths = {"positions": len(positions)}
        if self.orientations is not None:
            orientations = self._array("orientations", self.orientations, (4,))
            lengths["orientations"] = len(orientations)
            zero = np.flatnonzero(~np.any(orientations, axis=1))
            if len(zero):
                raise SceneError(f"orientation {zero[0]} is all zero", "give quaternions (w, x, y, z)", "keyframes")
        for name, length in lengths.items():
            if length != len(times):
                raise SceneError(f"{len(times)} times but {length} {name}", "give one for each time", "keyframes")

    @staticmethod
    def _array(name: str, value: ArrayLike, entry: tuple[int, ...]) -> np.ndarray:
        """Return a finite array (k, *entry), or raise a `SceneError`."""
        array = numbers_of(value)
        if array.ndim == 0 or array.shape[1:] != entry or not np.all(np.isfinite(array)):
            form = ", ".join(["k", *map(str, entry)]) if entry else "k,"
            raise SceneError(f"{name} are {value!r}", f"give finite numbers ({form})", "keyframes")
        return array
