"""A scene from a USD file, through the parser of UsdPhysics; figures are read in double precision where the file has them so.

Units are those of the stage: metersPerUnit, kilogramsPerUnit and degrees become metres, kilograms and radians; the up axis stays.
"""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.usd.bodies import TRIGGER, BodyReader
from rigidimpulse.io.usd.frames import Frames
from rigidimpulse.io.usd.instancing import expand_instancers
from rigidimpulse.io.usd.joints import JointReader
from rigidimpulse.io.usd.layers import checked_layers
from rigidimpulse.io.usd.library import SdfPath, Stage, Tf, Usd, UsdGeom, UsdPhysics, cause_of
from rigidimpulse.io.usd.origin import UsdOrigin
from rigidimpulse.io.usd.plain import is_seen, plain_bodies
from rigidimpulse.scene.scene import Scene

EARTH = 9.81
"""m/s^2, where the file does not say."""
FOREIGN = ("Physx", "Newton", "Mjc", "Isaac")
"""Schemas of physics that are not those of UsdPhysics begin so."""
READ = {TRIGGER, "PhysxMaterialAPI"}
MOST_PATHS = 8
"""Paths of prims at most in a line of the report."""


def load_usd(path: Path, gravity: ArrayLike | None, allow_outside: bool) -> Scene:
    """Read a .usda, .usdc, .usd or .usdz file; see `rigidimpulse.load_scene`."""
    where = repr(path.name)
    if not path.is_file():
        raise SceneError(f"there is no such file (looked for {path.absolute()})", "check the path", where)
    try:
        fresh = {} if allow_outside else checked_layers(path)
        stage = Usd.Stage.Open(str(path))
        # Layers that are open somewhere in the process would be taken as they were; what somebody edits there is left alone.
        for layer in stage.GetUsedLayers():
            if not layer.anonymous and not layer.dirty and layer.identifier not in fresh:
                layer.Reload(True)
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        raise SceneError(f"it is no readable USD file ({cause_of(error)})", "export it again", where) from None
    try:
        # Transforms and points are looked at after they are computed, so what overflows here is no number that a message could miss.
        with np.errstate(all="ignore"):
            return _scene(stage, gravity)
    except SceneError as error:
        raise error.within(where) from None
    except (Tf.ErrorException, RuntimeError, TypeError, ValueError, ArithmeticError) as error:  # values of another type than their schema's
        raise SceneError(f"it could not be read ({cause_of(error)})", "export it again", where) from None


def _scene(stage: Stage, gravity: ArrayLike | None) -> Scene:
    frames = Frames(stage)
    if not (np.isfinite(frames.meters_per_unit) and frames.meters_per_unit > 0.0):
        raise SceneError(f"metersPerUnit is {frames.meters_per_unit}", "give a length > 0")
    notes = expand_instancers(stage, frames.start)
    parsed = _parsed(stage)
    reader = BodyReader(frames, parsed)
    notes += _unresolved(stage) + _unknown(frames) + _stray_masses(reader, frames)
    if not reader.bodies:
        plain = plain_bodies(frames)
        reader = BodyReader(frames, plain.parsed, plain.hulls)
        notes += plain.notes
    if not reader.bodies:
        raise SceneError("it has no rigid body, no collider and no surface", "give prims PhysicsRigidBodyAPI and PhysicsCollisionAPI")
    joints = JointReader(reader)
    scene = Scene(_gravity(stage, parsed, frames.meters_per_unit, notes) if gravity is None else gravity)
    for thing in (*reader.bodies.values(), *joints.read(parsed), *reader.triggers):
        scene.add(thing)
    report = tuple(dict.fromkeys([*notes, *reader.shapes.notes, *reader.notes, *joints.notes, *_drawn_only(reader, frames)]))
    scene.origin = UsdOrigin(report, frames, {name: path for path, name in reader.name_of.items()})
    return scene


def _parsed(stage: Stage) -> dict[str, list[tuple[SdfPath, Any]]]:
    """Return what the parser of UsdPhysics found, by kind."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = UsdPhysics.UsdPhysicsLoadStageFromPrimRange(stage, ["/"])
    return {str(kind.name): list(zip(paths, descs, strict=True)) for kind, (paths, descs) in found.items()}


def _gravity(stage: Stage, parsed: dict, meters_per_unit: float, notes: list[str]) -> np.ndarray:
    """Return the gravity of the stage (3,) m/s^2: what is not given is 9.81 against the up axis."""
    up = np.array([0.0, 0.0, 1.0]) if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z else np.array([0.0, 1.0, 0.0])
    scenes = [path for path, _ in parsed.get("Scene", [])]
    if not scenes:
        return -EARTH * up
    if len(scenes) > 1:
        notes.append(f"the file has {len(scenes)} physics scenes: all bodies are in one, with the gravity of {scenes[0]}")
    api = UsdPhysics.Scene(stage.GetPrimAtPath(scenes[0]))
    strength, way = api.GetGravityMagnitudeAttr().Get(), np.array(api.GetGravityDirectionAttr().Get(), float)
    length = float(np.linalg.norm(way))
    direction = way / length if np.isfinite(length) and length > 0.0 else -up
    return direction * (strength * meters_per_unit if np.isfinite(strength) and strength >= 0.0 else EARTH) + 0.0


def _unresolved(stage: Stage) -> list[str]:
    """Return lines about layers, references and payloads that were not found."""
    return [f"not found: {str(error).splitlines()[0][:200]}" for error in stage.GetCompositionErrors()]


def _unknown(frames: Frames) -> list[str]:
    """Return lines about physics that other programs have words for and UsdPhysics has not."""
    count: Counter[str] = Counter()
    for prim in frames.prims():
        names = [str(name).split(":")[0] for name in prim.GetPrimTypeInfo().GetAppliedAPISchemas()]
        count.update(name for name in {*names, str(prim.GetTypeName())} if name.startswith(FOREIGN) and name not in READ)
    return [f"{name} of {number} {'prim' if number == 1 else 'prims'} is not read" for name, number in sorted(count.items())]


def _stray_masses(reader: BodyReader, frames: Frames) -> list[str]:
    """Return lines about mass properties of prims that are neither a body nor a collider: they hold for nothing below them."""
    taken = {path for path, _ in reader.colliders} | set(reader.name_of)
    stray = [str(prim.GetPath()) for prim in frames.prims() if prim.HasAPI(UsdPhysics.MassAPI) and prim.GetPath() not in taken]
    return [f"{_listed(stray)}: no body and no collider, the PhysicsMassAPI there is not read"] if stray else []


def _drawn_only(reader: BodyReader, frames: Frames) -> list[str]:
    """Return lines about surfaces that are no body and belong to none."""
    taken = {path for path, _ in reader.colliders}
    drawn: list[str] = []
    unseen: list[str] = []
    for prim in frames.prims():
        if prim.IsA(UsdGeom.Gprim) and prim.GetPath() not in taken and reader.owner(prim) is None:
            (drawn if is_seen(prim) else unseen).append(str(prim.GetPath()))
    lines = [f"{_listed(drawn)}: drawn where the file has it, and collides with nothing"] if drawn else []
    return lines + ([f"{_listed(unseen)}: invisible, a guide or a proxy, left out"] if unseen else [])


def _listed(paths: list[str]) -> str:
    """The first of some paths, and how many more there are."""
    more = len(paths) - MOST_PATHS
    return ("prims " if len(paths) > 1 else "prim ") + ", ".join(paths[:MOST_PATHS]) + (f" and {more} more" if more > 0 else "")
