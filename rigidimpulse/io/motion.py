"""Shared by all animated files: their options, and the keys of every body of a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.keys import Keys, Path, reduced

if TYPE_CHECKING:
    from rigidimpulse.recording.exporters import ExportOptions
    from rigidimpulse.recording.recording import Recording
    from rigidimpulse.scene.body import Body
    from rigidimpulse.scene.scene import Scene

MOST_SAMPLES = 1000
"""Keys a frame that make sense."""


def check_options(options: ExportOptions) -> None:
    """Raise a `SceneError` for an option that makes no sense."""
    start, tolerance, samples, unit = options.start_frame, options.tolerance, options.samples, options.unit
    if not (math.isfinite(start) and start >= 0.0):
        raise SceneError(f"start_frame = {start!r}", "give the number of a frame, >= 0")
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0.0):
        raise SceneError(f"tolerance = {tolerance!r}", "give a length in m, > 0, or None for a key a frame")
    if isinstance(samples, bool) or not isinstance(samples, int) or not 1 <= samples <= MOST_SAMPLES:
        raise SceneError(f"samples = {samples!r}", f"give a whole number of keys a frame, 1 to {MOST_SAMPLES}")
    if options.up_axis not in (None, "y", "z"):
        raise SceneError(f"up_axis = {options.up_axis!r}", "give 'y', 'z', or None for that of the scene")
    if not (math.isfinite(unit) and unit > 0.0):
        raise SceneError(f"unit = {unit!r}", "give the metres in a unit of the file, 0.01 for centimetres")


class Motion:
    """The motion of all bodies of a run.

    Attributes:
        paths: by name. scene: of the run. options: of the file.

    """

    def __init__(self, run: Recording, options: ExportOptions) -> None:
        """Raise a `SceneError` for a pose that is not finite; the options are checked, see `check_options`."""
        assert run.scene is not None
        if not (np.isfinite(run.positions).all() and np.isfinite(run.orientations).all()):
            raise SceneError("a pose of the run is not finite", "look at run.status")
        self.scene: Scene = run.scene
        self.options = options
        self.paths = _paths(run, self.scene, options.impact_keys)

    def is_keyed(self, name: str) -> bool:
        """Whether a body has keys."""
        return self.paths[name].moves or not self.options.only_moved

    def keys(self, name: str) -> Keys:
        """Keys of a body."""
        path, tolerance = self.paths[name], self.options.tolerance
        keys = path.at(path.key_times(self.options.samples))
        if tolerance is None:
            return keys
        places = reduced(keys, _reach(self.scene[name]), tolerance)
        return Keys(keys.times[places], keys.positions[places], keys.orientations[places])

    def half(self) -> float:
        """Half the side of a square that the whole motion takes place above, m."""
        return 2.0 * max((float(np.abs(path.positions).max(initial=0.0)) for path in self.paths.values()), default=0.0)


def _paths(run: Recording, scene: Scene, impact_keys: bool) -> dict[str, Path]:
    """The motion of all bodies, with the impacts of dynamic ones where they are asked for."""
    if not impact_keys or not len(run.impacts):
        return {name: Path(run, name) for name in run.names}
    paths = {}
    for name in run.names:
        i, body = run.index(name), scene[name]
        mine = (run.impacts["body_a"] == i) | (run.impacts["body_b"] == i)
        times = np.unique(run.impacts["time"][mine]) if body.motion == "dynamic" else np.zeros(0)
        paths[name] = Path(run, name, times, body.gravity_factor * np.asarray(scene.gravity, float))
    return paths


def _reach(body: Body) -> float:
    """Radius about the origin of a body that holds all its points, m; 0 for half spaces."""
    from rigidimpulse.view.display import display_mesh

    drawn = display_mesh(body.shape, 16)
    return 0.0 if drawn is None else float(np.linalg.norm(drawn.vertices, axis=1).max())
