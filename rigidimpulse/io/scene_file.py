"""Scenes from files, by suffix."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.scene import Scene

logger = logging.getLogger("rigidimpulse")

GLTF_SUFFIXES = (".glb", ".gltf")
USD_SUFFIXES = (".usda", ".usdc", ".usd", ".usdz")
SCENE_SUFFIXES = (*GLTF_SUFFIXES, *USD_SUFFIXES, ".urdf", ".xml", ".mjcf")
GLTF_GRAVITY = (0.0, -9.81, 0.0)
"""m/s^2, of scenes that say nothing else: glTF is Y up."""


def load_scene(
    path: str | os.PathLike[str], gravity: ArrayLike | None = None, *, allow_outside: bool = False, fixed_base: bool | None = None
) -> Scene:
    """Read a scene from a file: the suffix says how.

    .glb, .gltf: glTF 2.0 with KHR_physics_rigid_bodies and KHR_implicit_shapes, or without physics, see docs/guide/gltf.md.
    .usda, .usdc, .usd, .usdz: USD with UsdPhysics (extra `usd`), see docs/guide/usd.md.
    .urdf: robots, URDF; .xml, .mjcf: MuJoCo models, MJCF (extra `robot`), see docs/guide/robots.md.

    Bodies have the names of their nodes, prims or links. Units become metres, kilograms and radians; the up axis stays.

    Args:
        path: the file.
        gravity: (3,) m/s^2; by default what the file says of it, else 9.81 m/s^2 against its up axis.
        allow_outside: let files that the file names lie outside its folder, and be named by absolute paths.
        fixed_base: of .urdf: whether the root link stands still; by default it does if it is called "world", or has no mass and
            links move against it.

    Returns:
        The scene; `scene.report` lists, line by line, what of the file is not in it or not as it is written there.

    Raises:
        SceneError: no such file, another kind of file, a broken one, or a package that is not installed; names the file,
            the part and the remedy.

    """
    place = Path(path)
    suffix = place.suffix.lower()
    if fixed_base is not None and suffix != ".urdf":
        raise SceneError(f"fixed_base for {place.name!r}", "give it for .urdf only")
    if suffix in GLTF_SUFFIXES:
        from rigidimpulse.io.gltf.load import load_gltf

        return load_gltf(place, gravity, allow_outside)
    if suffix in USD_SUFFIXES:
        from rigidimpulse.io.usd.load import load_usd

        return load_usd(place, gravity, allow_outside)
    if suffix == ".urdf":
        from rigidimpulse.io.robots.urdf import load_urdf

        return load_urdf(place, gravity, allow_outside, fixed_base)
    if suffix in (".xml", ".mjcf"):
        from rigidimpulse.io.robots.mjcf import load_mjcf

        return load_mjcf(place, gravity, allow_outside)
    raise SceneError(f"cannot read a scene from {place.name!r}", f"give a file that ends in {', '.join(SCENE_SUFFIXES)}")


def write_scene(scene: Scene, path: Path) -> Path:
    """Write a scene as a file with physics; see `Scene.export`."""
    if path.suffix not in GLTF_SUFFIXES:
        raise SceneError(f"cannot write a scene to {path.name!r}", f"use a name that ends in {' or '.join(GLTF_SUFFIXES)}")
    from rigidimpulse.core.files import write_renamed
    from rigidimpulse.io.gltf.write import write_physics

    left_out: list[str] = []
    written = write_renamed(path, lambda target: left_out.extend(write_physics(scene, target)))
    for line in left_out:
        logger.warning("%s: %s", path.name, line)
    return written
