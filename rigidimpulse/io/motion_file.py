"""Motion to animated files, by suffix."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import write_renamed
from rigidimpulse.io.motion import MotionOptions

if TYPE_CHECKING:
    from rigidimpulse.recording.recording import Recording


def write_motion(run: Recording, path: Path, options: MotionOptions) -> Path:
    """Write a file of animated bodies; see `Recording.export` for its options. Returns the path.

    Raises:
        SceneError: an option makes no sense, a pose is not finite, the package of a format is not installed, or the file is one
            that the scene comes from and the new one would refer to.

    """
    if run.scene is not None and run.scene.origin is not None:
        run.scene.origin.check_target(path)
    if path.suffix in (".glb", ".gltf"):
        if (options.up_axis, options.unit) != (None, 1.0):
            raise SceneError(f"up_axis or unit for {path.name!r}", "glTF is Y up and in metres: leave them out, or write USD")
        from rigidimpulse.io.gltf.animate import write_motion as write
    else:
        from rigidimpulse.io.usd.animate import write_motion as write
    return write_renamed(path, lambda target: write(run, target, options))
