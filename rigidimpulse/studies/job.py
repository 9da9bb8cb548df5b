"""Scenes to run, found by the name of a gallery scene or in a file."""

from __future__ import annotations

import runpy
import sys
import traceback
from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rigidimpulse.core.errors import RigidImpulseError, SceneError

if TYPE_CHECKING:
    from rigidimpulse.gallery.record import GalleryScene
    from rigidimpulse.scene.accuracy import Accuracy
    from rigidimpulse.scene.accuracy_targets import AccuracyTarget
    from rigidimpulse.scene.scene import Scene

DEFAULT_DURATION = 4.0
"""s, of scenes from files."""
DEFAULT_FPS = 60.0


class Job(NamedTuple):
    """A scene to run: name, function that makes it, duration [s], frames per second, accuracy, gallery record."""

    name: str
    make: Callable[..., Scene]
    duration: float
    fps: float
    accuracy: str | Accuracy | AccuracyTarget
    entry: GalleryScene | None


def job_of(entry: GalleryScene) -> Job:
    """Return the job that a gallery scene describes."""
    return Job(entry.name, entry.scene, entry.duration, entry.fps, entry.accuracy, entry)


def find_job(scene: str) -> Job:
    """Return the job for a gallery name or a file.

    Raises:
        SceneError: it is neither, with the ways to name a scene.

    """
    from rigidimpulse import gallery
    from rigidimpulse.io.scene_file import SCENE_SUFFIXES

    path = Path(scene)
    if path.suffix == ".py":
        return Job(path.stem, _scene_function(path), DEFAULT_DURATION, DEFAULT_FPS, "standard", None)
    if path.suffix in SCENE_SUFFIXES:
        return Job(path.stem, partial(_load_scene, path), DEFAULT_DURATION, DEFAULT_FPS, "standard", None)
    if path.suffix or len(path.parts) > 1:
        known = "a gallery scene (`rigidimpulse demo` lists them), a .glb, .gltf, .usd, .urdf or .xml file, a file.py that defines scene()"
        raise SceneError(f"cannot read a scene from {scene!r}", f"supported: {known}")
    return job_of(gallery.load(scene))


def _load_scene(path: Path) -> Scene:
    """Return the scene of a file; what of the file is not in it is printed."""
    from rigidimpulse.io.scene_file import load_scene

    scene = load_scene(path)
    for line in scene.report:
        print(f"{path.name}: {line}", file=sys.stderr)
    return scene


def _scene_function(path: Path) -> Callable[[], Scene]:
    """Return the function `scene` of a Python file, wrapped so that its errors name the file and the line."""
    from rigidimpulse.scene.scene import Scene

    where = f"scene file {str(path)!r}"
    if not path.is_file():
        raise SceneError("there is no such file", "check the path", where)

    def call(function: Callable[[], Any]) -> Any:
        try:
            return function()
        except RigidImpulseError:
            raise
        except Exception as error:
            lines = [entry.lineno for entry in traceback.extract_tb(error.__traceback__) if entry.filename == str(path)]
            line = getattr(error, "lineno", None) or (lines[-1] if lines else "?")
            raise SceneError(f"line {line}: {type(error).__name__}: {error}", "correct the file", where) from error

    function = call(lambda: runpy.run_path(str(path))).get("scene")
    if not callable(function):
        raise SceneError("it defines no function scene()", "write: def scene(): ... return a Scene", where)

    @wraps(function)
    def make(**arguments: Any) -> Scene:
        made = call(partial(function, **arguments))
        if not isinstance(made, Scene):
            raise SceneError(f"scene() returned a {type(made).__name__}", "return a Scene", where)
        return made

    return make
