"""Frames of the prims of a USD file: world matrices, the rigid part of them, and how they move.

A prim's world matrix, acting on columns, is M = (x, Q K) in units of the file: Q a rotation, K what is left of it. Where a prim
stands below scales and rotations only in such a way that M has orthogonal columns, K is diagonal with its scales; else Q is the
rotation nearest to M (polar decomposition). A mirror is in K.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.io.keys import MOST_KEYS, refined
from rigidimpulse.io.usd.library import Prim, Stage, Usd, UsdGeom

EVEN = 1e-6
"""Unevenness of a scale, relative, that is none."""
ORTHOGONAL = 1e-9
FLAT = 1e-9
"""Determinant over the product of the lengths of columns, below which a matrix flattens space."""
QUARTER_TURN = 0.5 * np.pi
LARGEST = 1e9
"""m, greatest number that makes sense."""
SNAP = 1e-12
"""Entries of K nearer to 0 and 1 than this, relative to the largest, are 0 and 1: round-off of rotations."""


class Frames:
    """World frames of the prims of a stage at its first time code.

    Attributes:
        stage: of the file. meters_per_unit: m. start: first time code. codes_per_second: of time codes.

    """

    def __init__(self, stage: Stage) -> None:
        """Nothing is read before it is asked for."""
        self.stage = stage
        self.meters_per_unit = float(UsdGeom.GetStageMetersPerUnit(stage))
        self.start = float(stage.GetStartTimeCode()) if stage.HasAuthoredTimeCodeRange() else 0.0
        self.codes_per_second = float(stage.GetTimeCodesPerSecond())
        self._cache = UsdGeom.XformCache(Usd.TimeCode(self.start))

    def matrix(self, prim: Prim) -> np.ndarray:
        """World matrix (4, 4) of a prim, acting on columns, in units of the file."""
        return self._checked(self._cache, prim)

    def _checked(self, cache: Any, prim: Prim) -> np.ndarray:
        """World matrix (4, 4) of a prim by a cache; raises a `SceneError` where it is none."""
        matrix = np.array(cache.GetLocalToWorldTransform(prim)).T
        columns = np.linalg.norm(matrix[:3, :3], axis=0)
        if not np.abs(matrix).max() * self.meters_per_unit <= LARGEST or not abs(np.linalg.det(matrix[:3, :3])) > FLAT * columns.prod():
            raise SceneError("its transform is not finite, flattens space or is beyond all bounds", "correct it", f"prim {prim.GetPath()}")
        return matrix

    def rigid(self, prim: Prim) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) m and rotation Q (3, 3) of a prim."""
        matrix = self.matrix(prim)
        return matrix[:3, 3] * self.meters_per_unit, rotation_of(matrix[:3, :3])

    def stretch(self, prim: Prim) -> np.ndarray:
        """K (3, 3) of a prim."""
        linear = self.matrix(prim)[:3, :3]
        return snapped(rotation_of(linear).T @ linear)

    def prims(self) -> Iterator[Prim]:
        """All prims that are there, those of instances too, in the order of the file."""
        return iter(self.stage.Traverse(Usd.TraverseInstanceProxies()))

    def is_animated(self, prim: Prim) -> bool:
        """Whether a prim has transforms of its own that vary with time."""
        xform = UsdGeom.Xformable(prim)
        return bool(xform) and xform.TransformMightBeTimeVarying()

    def moves(self, prim: Prim) -> bool:
        """Whether a prim, or one above it, has transforms that vary with time."""
        return bool(self._codes(prim))

    def _codes(self, prim: Prim) -> list[float]:
        """Time codes at which transforms of a prim or one above it have samples, ascending."""
        codes: set[float] = set()
        while prim and not prim.IsPseudoRoot():
            xform = UsdGeom.Xformable(prim)
            if xform:
                if xform.TransformMightBeTimeVarying():
                    codes.update(xform.GetTimeSamples())
                if xform.GetResetXformStack():
                    break
            prim = prim.GetParent()
        return sorted(codes)

    def keys(self, prim: Prim, between: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (k,) s after the first time code, positions (k, 3) m and quaternions (k, 4) wxyz of a prim that moves.

        Args:
            prim: it. between: s, longest time from key to key: transforms in between are no even motion. Keys are nearer where the
                prim turns by more than a quarter turn in that time, or where the way of its origin is bent.

        """
        codes = np.array(self._codes(prim))
        step = between * self.codes_per_second
        count = int((codes[-1] - codes[0]) / step) + 1
        all_codes = np.unique(np.concatenate([codes, codes[0] + step * np.arange(1, count)]))
        all_codes = all_codes[np.concatenate([[True], np.diff(all_codes) > 1e-6 * step])]
        parts = np.maximum(np.ceil(self._turns(prim, all_codes) / QUARTER_TURN), 1.0)
        if parts.sum() > MOST_KEYS:
            raise SceneError(f"its animation takes {parts.sum():.3g} keys", "shorten it, or let it turn less", f"prim {prim.GetPath()}")
        share = np.concatenate([np.zeros(0), *(np.arange(int(part)) / part for part in parts)])
        first = np.repeat(np.arange(len(parts)), parts.astype(int))
        all_codes = np.append(all_codes[first] + share * np.diff(all_codes)[first], all_codes[-1])
        keys = refined((all_codes - self.start) / self.codes_per_second, lambda times: self._poses(prim, times))
        return keys.times, keys.positions, keys.orientations

    def _turns(self, prim: Prim, codes: np.ndarray) -> np.ndarray:
        """Bounds (k - 1,) rad of the turns of a prim between time codes (k,), by the angles on it and on what is above it.

        Quaternions turn the shorter way from sample to sample.
        """
        turns = np.zeros(len(codes) - 1)
        while prim and not prim.IsPseudoRoot():
            xform = UsdGeom.Xformable(prim)
            for operation in xform.GetOrderedXformOps() if xform else ():
                if operation.MightBeTimeVarying() and "rotate" in operation.GetOpName():
                    angles = np.array([operation.Get(code) for code in codes.tolist()], float).reshape(len(codes), -1)
                    turns += np.radians(np.abs(np.diff(angles, axis=0)).sum(axis=1))
            if xform and xform.GetResetXformStack():
                break
            prim = prim.GetParent()
        return turns

    def _poses(self, prim: Prim, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (k, 3) m and quaternions (k, 4) wxyz of a prim at times (k,) s after the first time code."""
        codes = times * self.codes_per_second + self.start
        places, turns = np.zeros((len(codes), 3)), np.zeros((len(codes), 4))
        for k, code in enumerate(codes.tolist()):
            matrix = self._checked(UsdGeom.XformCache(Usd.TimeCode(code)), prim)
            places[k], turns[k] = matrix[:3, 3] * self.meters_per_unit, from_matrix(rotation_of(matrix[:3, :3]))
        return places, turns


def rotation_of(linear: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a linear map (3, 3), see the head of the module."""
    scale = np.linalg.norm(linear, axis=0)
    if np.linalg.det(linear) < 0.0:
        scale = -scale
    columns = linear / scale
    if np.abs(columns.T @ columns - np.eye(3)).max() <= ORTHOGONAL:
        linear = columns
    u, _, v = np.linalg.svd(linear)
    return (u * [1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v


def snapped(stretch: np.ndarray) -> np.ndarray:
    """Return K (3, 3) without round-off next to whole numbers."""
    near, size = np.round(stretch), float(np.abs(stretch).max())
    return np.where(np.abs(stretch - near) <= SNAP * max(size, 1.0), near, stretch) + 0.0


def is_even(linear: np.ndarray) -> bool:
    """Whether a linear map (3, 3) is a rotation times a positive number."""
    determinant = float(np.linalg.det(linear))
    if determinant <= 0.0:
        return False
    unit = linear / np.cbrt(determinant)
    return bool(np.abs(unit @ unit.T - np.eye(3)).max() <= EVEN)
