"""Motion into a USD file: a layer over the file that the scene came from, or one prim a body.

The world pose of a body is (x, Q) at each key. Over a file with L metres a unit its prim keeps its stretch K at rest, which is what its
world matrix is without the rotation. Below a parent that stands still and has the matrix s R (an even scale and a rotation)

    translate = (s R)^-1 (x / L - x_p),    orient = R^T Q,    then K / s

else the prim stands in the world by itself (`!resetXformStack!`): x / L, Q, K. Linear translation and slerp in between are
USD's own; bodies that turn fast have keys in between, see `rigidimpulse.io.keys`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.io.keys import Keys
from rigidimpulse.io.motion import Motion, check_options
from rigidimpulse.io.usd.draw import Drawing, draw_soft_body
from rigidimpulse.io.usd.layer import TYPES, attribute, define, order, place, quaternions, sample, valid_name, vectors
from rigidimpulse.io.usd.library import Gf, Layer, PrimSpec, Sdf, SdfPath, Tf, UsdUtils, Vt, cause_of
from rigidimpulse.io.usd.origin import UsdOrigin
from rigidimpulse.scene.origin import bodies_as_seen
from rigidimpulse.view.camera import stage_rotation, up_axis
from rigidimpulse.view.materials import color

if TYPE_CHECKING:
    from pathlib import Path

    from rigidimpulse.recording.exporters import ExportOptions, ExportTarget
    from rigidimpulse.recording.recording import Recording

NEAR = 1e-9
"""Share of a frame within which a key is at that frame: times are sums of rounded numbers."""
LONE_FPS = 24.0
"""Frames per second of a run of one frame."""
IS_AXIS = 1e-9
AXES = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def check_usd(_path: Path, options: ExportOptions, scene: Any = None) -> None:
    """See `Exporter.check`."""
    check_options(options)
    if isinstance(getattr(scene, "origin", None), UsdOrigin) and (options.up_axis, options.unit) != (None, 1.0):
        raise SceneError("up_axis or unit for a file that the scene came from", "leave them out: they are those of that file")


def write_usd(run: Recording, target: ExportTarget) -> None:
    """Write a .usda, .usdc, .usd or .usdz file of a run.

    Args:
        run: with its scene. target: where, and the options; the suffix of its path chooses the kind.

    Raises:
        SceneError: usd-core is missing, an option makes no sense, or a pose is not finite.
        OSError: the disk does not take the file.

    """
    motion = Motion(run, target.options)
    path = target.path
    if path.suffix != ".usdz":
        try:
            layer = Sdf.Layer.CreateNew(str(path))
            _Writer(run, motion, layer).write()
            saved = layer.Save()
        except Tf.ErrorException as error:
            raise OSError(cause_of(error)) from None
        if not saved:
            raise OSError("USD does not save it")
        return
    inner = path.with_suffix(".usdc")
    try:
        write_usd(run, target._replace(path=inner))
        if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(inner)), str(path)):
            raise OSError("USD does not pack it")
    except Tf.ErrorException as error:
        raise OSError(cause_of(error)) from None
    finally:
        inner.unlink(missing_ok=True)


class _Writer:
    """A layer that is being made of a run."""

    def __init__(self, run: Recording, motion: Motion, layer: Layer) -> None:
        self.run, self.motion, self.layer = run, motion, layer
        step = float(run.times[-1]) / (len(run.times) - 1) if len(run.times) > 1 else 1.0 / LONE_FPS
        self.fps = round(1.0 / step, 9)
        self.used: set[str] = set()

    def codes(self, times: np.ndarray) -> list[float]:
        """Time codes of times (k,) s; those of frames are whole numbers after the first."""
        frames = times * self.fps
        whole = np.round(frames)
        return (self.motion.options.start_frame + np.where(np.abs(frames - whole) < NEAR * np.maximum(whole, 1.0), whole, frames)).tolist()

    def write(self) -> None:
        """Write everything."""
        status, origin = self.run.status, self.motion.scene.origin
        told = {"ok": status.ok, "message": status.message, "warnings": Vt.StringArray(list(status.warnings)), "status": status.stored()}
        self.layer.customLayerData = {"rigidimpulse": told}
        first = self.motion.options.start_frame
        self.layer.timeCodesPerSecond = self.layer.framesPerSecond = self.fps
        self.layer.startTimeCode, self.layer.endTimeCode = first, first + len(self.run.times) - 1
        if isinstance(origin, UsdOrigin):
            origin.write_over(self.layer, self.fps, first)
            with Sdf.ChangeBlock():
                self._over(origin)
                self._bodies(Sdf.Path("/rigidimpulse"), origin.prim_of, 1.0 / origin.meters_per_unit)
            return
        with Sdf.ChangeBlock():
            self._bodies(Sdf.Path("/World"), {}, 1.0)

    def _over(self, origin: UsdOrigin) -> None:
        """Give the prims of bodies their motion."""
        for name, path in origin.prim_of.items():
            if name not in self.motion.paths:
                continue
            start = self.motion.paths[name]
            displaced = origin.is_displaced(path, start.positions[0], start.orientations[0])
            if not (self.motion.is_keyed(name) or origin.is_animated(path) or displaced):
                continue
            prim = define(self.layer, path, over=True)
            keys, names = origin.local(path, self.motion.keys(name), self.motion, prim)
            self._sample(prim, keys, names)

    def _sample(self, prim: PrimSpec, keys: Keys, names: tuple[str, str]) -> None:
        """Write the keys of a prim by the names of its operations, or those of them that change."""
        codes = self.codes(keys.times)
        for name, given, made in ((names[0], keys.positions, vectors), (names[1], keys.orientations, quaternions)):
            if not self.motion.options.only_moved or np.any(given != given[0]):
                sample(prim, name, codes, made(given))

    def _bodies(self, root: SdfPath, drawn: Mapping[str, Any], scale: float) -> None:
        """Write bodies that have no prim, below a root in metres."""
        scene, paths = self.motion.scene, self.motion.paths
        fresh = [body for body in bodies_as_seen(scene) if body.name not in drawn]
        if not fresh and not self.run.soft_bodies:
            return
        self._root(root, scale, bool(drawn))
        drawing, moving = Drawing(self.layer, self.motion.half(), fresh), 0
        for body in fresh:
            prim = drawing.body(root.AppendChild(valid_name(body.name, self.used)), body, moving)
            moving += body.motion != "static"
            path = paths[body.name]
            names = place(prim, path.positions[0], path.orientations[0])
            order(prim, list(names))
            if self.motion.is_keyed(body.name):
                self._sample(prim, self.motion.keys(body.name), names)
        codes = self.codes(self.run.times)
        for number, track in enumerate(self.run.soft_bodies):
            draw_soft_body(self.layer, root.AppendChild(valid_name(track.name, self.used)), track, codes, color(moving + number))

    def _root(self, path: SdfPath, scale: float, inside: bool) -> None:
        """Write the prim above the bodies; a stage of its own has kilograms, metres and the up axis of the scene, or what is asked for."""
        root = define(self.layer, path)
        if inside:
            attribute(root, "xformOp:scale", TYPES.Double3, Gf.Vec3d(scale, scale, scale))
            order(root, ["xformOp:scale"])
            return
        up, unit = up_axis(self.motion.scene.gravity), self.motion.options.unit
        axis = (self.motion.options.up_axis or ("z" if np.abs(up - AXES["z"]).max() < IS_AXIS else "y")).upper()
        stage = self.layer.pseudoRoot
        for key, value in (("upAxis", axis), ("metersPerUnit", unit), ("kilogramsPerUnit", 1.0)):
            stage.SetInfo(key, value)
        self.layer.defaultPrim = path.name
        names: list[str] = []
        if np.abs(up - AXES[axis.lower()]).max() >= IS_AXIS:
            # To Y up, and from there to Z up.
            names += place(root, np.zeros(3), from_matrix(stage_rotation(AXES[axis.lower()]).T @ stage_rotation(up)))
        if unit != 1.0:
            attribute(root, "xformOp:scale", TYPES.Double3, Gf.Vec3d(1.0 / unit, 1.0 / unit, 1.0 / unit))
            names.append("xformOp:scale")
        if names:
            order(root, names)
