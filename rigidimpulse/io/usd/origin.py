"""What a scene keeps of the USD file that it was read from, so that motion can be written over that file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import conjugate, from_matrix, multiply, quaternion_continuity, to_matrix
from rigidimpulse.io.keys import Keys
from rigidimpulse.io.motion import Motion
from rigidimpulse.io.usd.frames import Frames, is_even
from rigidimpulse.io.usd.layer import TYPES, attribute, define, order, place
from rigidimpulse.io.usd.library import Gf, Layer, Prim, PrimSpec, Sdf, SdfPath, Stage, UsdGeom
from rigidimpulse.scene.origin import FileOrigin

DISPLACED = 1e-6
"""Relative to places, and of matrices of rotation, by which a body is off its prim that someone has moved."""
SUFFIX = ":rigidimpulse"
"""Of the names of operations on prims of the file: those of the file itself stay as they are, unused."""
STAGE = ("upAxis", "metersPerUnit", "kilogramsPerUnit", "defaultPrim")


@dataclass(frozen=True)
class UsdOrigin(FileOrigin):
    """A USD file and what became of it.

    Attributes:
        frames: of its prims at rest. prim_of: path of each body's prim, by name.

    """

    frames: Frames
    prim_of: dict[str, SdfPath]

    @property
    def meters_per_unit(self) -> float:
        """Length of a unit of the file, m."""
        return self.frames.meters_per_unit

    def check_target(self, path: Path) -> None:
        """See `FileOrigin`: the new file refers to this one and its layers, so it cannot take their place."""
        for layer in self.frames.stage.GetUsedLayers():
            if layer.realPath and Path(layer.realPath).resolve() == path.resolve():
                raise SceneError(f"{path.name!r} is a file that the scene comes from", "give another name: the new one refers to it")

    def write_over(self, layer: Layer, fps: float, start_frame: float) -> None:
        """Put the file below a new layer, its first time code at the frame given."""
        source: Stage = self.frames.stage
        root = source.GetRootLayer()
        folder = Path(layer.realPath).resolve().parent
        try:
            name = Path(os.path.relpath(root.realPath, folder)).as_posix()
        except ValueError:  # another drive
            name = root.realPath
        layer.subLayerPaths.append(name if name.startswith((".", "/")) else f"./{name}")
        offset = start_frame - self.frames.start * fps / source.GetTimeCodesPerSecond()
        if offset != 0.0:
            layer.subLayerOffsets[0] = Sdf.LayerOffset(offset)
        # Prims that stand for instances are said in the session layer.
        for prim in source.GetSessionLayer().rootPrims:
            Sdf.CopySpec(source.GetSessionLayer(), prim.path, layer, prim.path)
        for key in STAGE:
            if root.pseudoRoot.HasInfo(key):
                layer.pseudoRoot.SetInfo(key, root.pseudoRoot.GetInfo(key))

    def is_animated(self, path: SdfPath) -> bool:
        """Whether the file moves a prim by itself."""
        return self.frames.moves(self.frames.stage.GetPrimAtPath(path))

    def is_displaced(self, path: SdfPath, position: np.ndarray, orientation: np.ndarray) -> bool:
        """Whether a body begins elsewhere than the file has its prim: someone has moved it since."""
        source = self.frames.stage.GetPrimAtPath(path)
        matrix = self.frames.matrix(source)
        place, turn = matrix[:3, 3] * self.meters_per_unit, matrix[:3, :3] @ np.linalg.inv(self.frames.stretch(source))
        scale = 1.0 + float(np.abs(place).max())
        return bool(np.abs(place - position).max() > DISPLACED * scale or np.abs(turn - to_matrix(orientation)).max() > DISPLACED)

    def local(self, path: SdfPath, keys: Keys, motion: Motion, prim: PrimSpec) -> tuple[Keys, tuple[str, str]]:
        """Give the prim of a body its operations; return its keys as it has them, and the names of position and orientation."""
        source = self.frames.stage.GetPrimAtPath(path)
        _free_instances(prim.layer, source)
        stretch = self.frames.stretch(source)
        parent, above = self._parent(source, motion)
        places = keys.positions / self.meters_per_unit
        turns = keys.orientations
        if parent is not None:
            scale = float(np.cbrt(np.linalg.det(parent[:3, :3])))
            places = (places - parent[:3, 3]) @ np.linalg.inv(parent[:3, :3]).T
            turns = quaternion_continuity(multiply(conjugate(from_matrix(parent[:3, :3] / scale)), turns))
            stretch = stretch / scale
        names = place(prim, places[0], turns[0], SUFFIX)
        order(prim, [*above, *names, *_stretch(prim, stretch)])
        return Keys(keys.times, places, turns), names

    def _parent(self, source: Prim, motion: Motion) -> tuple[np.ndarray | None, list[str]]:
        """World matrix (4, 4) of the parent of a prim, in units of the file, or None and the operation that leaves parents out."""
        parent = source.GetParent()
        carried = set(self.prim_of.values())
        moving = self.frames.moves(parent)
        while parent and not parent.IsPseudoRoot():
            moving = moving or parent.GetPath() in carried
            parent = parent.GetParent()
        matrix = self.frames.matrix(source.GetParent())
        if moving or not is_even(matrix[:3, :3]):
            return None, [UsdGeom.XformOpTypes.resetXformStack]
        return matrix, []


def _stretch(prim: PrimSpec, stretch: np.ndarray) -> list[str]:
    """Write K (3, 3) of a prim, where there is one; return the names of its operations."""
    if np.abs(stretch - np.eye(3)).max() < 1e-12:
        return []
    diagonal = np.diag(stretch)
    if np.abs(stretch - np.diag(diagonal)).max() < 1e-12 * np.abs(diagonal).max():
        name = f"xformOp:scale{SUFFIX}"
        attribute(prim, name, TYPES.Double3, Gf.Vec3d(*diagonal.tolist()))
        return [name]
    name, matrix = f"xformOp:transform{SUFFIX}", np.eye(4)
    matrix[:3, :3] = stretch.T  # USD's matrices act on rows
    attribute(prim, name, TYPES.Matrix4d, Gf.Matrix4d(*matrix.ravel().tolist()))
    return [name]


def _free_instances(layer: Layer, source: Any) -> None:
    """Let what is below an instance have opinions of its own."""
    above = source.GetParent()
    while above and not above.IsPseudoRoot():
        if above.IsInstance() and not above.IsInstanceProxy():
            define(layer, above.GetPath(), over=True).instanceable = False
        above = above.GetParent()
