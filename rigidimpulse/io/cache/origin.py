"""The scene and the settings of a run as bytes, from which the run can be prepared again.

They are written as the state of a run is (`encode`): as plain data. What is no plain data, such as the function of a `ForceField`, is not
in the bytes. Its digest is, and it is looked for in the scene of the program that reads them.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.content_digest import digest_of
from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.cache.arrays import Damaged
from rigidimpulse.io.cache.constants import ATOMS, Constants
from rigidimpulse.io.cache.decode import thaw
from rigidimpulse.io.cache.encode import freeze
from rigidimpulse.io.cache.registry import schema_of
from rigidimpulse.recording.recording import RunSettings
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.scene import Scene


class Origin(NamedTuple):
    """What a run was made of."""

    scene: Scene
    settings: RunSettings


def frozen(origin: Origin) -> bytes:
    """Return the bytes of a scene and of settings."""
    scene, settings = origin
    outside: dict[int, Any] = {}
    parts = _plain([np.array(scene.gravity, float), list(scene.bodies), list(scene.effects)], outside, {})
    accuracy = settings.accuracy.model_dump()
    told = [settings.duration, settings.fps, accuracy, dict(settings.effects)]
    digests = [digest_of(thing) for thing in outside.values()]
    inside = freeze([*parts, told], Constants.of(outside.values()))
    return freeze([digests, inside], Constants.of(()))


def thawed(data: bytes, program: Scene) -> Origin:
    """Return what `frozen` wrote; program: the scene in which functions and the like are looked for.

    Raises:
        SceneError: the bytes are damaged, or a function is not found.

    """
    digests, inside = thaw(data, Constants.of(()))
    known: dict[int, Any] = {}
    _plain([list(program.bodies), list(program.effects)], known, {})
    found = {digest_of(thing): thing for thing in known.values()}
    if any(digest not in found for digest in digests):
        raise SceneError(
            "a function, or an object of a class of your own, is another one than before: a cache holds no program, so that it cannot be "
            "called for the frames before the change",
            "leave it as it was; to change a force, let its function look at the time",
        )
    gravity, bodies, effects, (duration, fps, accuracy, chosen) = thaw(inside, Constants.of(found[digest] for digest in digests))
    try:
        scene = Scene(gravity, bodies)
        for effect in effects:
            scene.add(effect)
        return Origin(scene, RunSettings(float(duration), float(fps), Accuracy(**accuracy), dict(chosen)))
    except (TypeError, ValueError) as error:
        raise Damaged(f"the scene of its run: {error}") from None


def _plain(thing: Any, outside: dict[int, Any], copies: dict[int, tuple[Any, Any]]) -> Any:
    """A copy of something without what it has computed; objects that are no plain data are noted in `outside`, and are in it themselves.

    copies: by identity, a thing and its copy; what is shared stays shared.
    """
    if isinstance(thing, ATOMS + (np.generic, np.ndarray)):
        return thing
    if id(thing) in copies:
        return copies[id(thing)][1]
    if type(thing) in (list, tuple, set, frozenset):
        made = type(thing)(_plain(item, outside, copies) for item in thing)
    elif isinstance(thing, tuple) and schema_of(type(thing)) is not None:
        made = tuple.__new__(type(thing), (_plain(item, outside, copies) for item in thing))
    elif type(thing) is dict:
        made = {key: _plain(item, outside, copies) for key, item in thing.items()}
    elif dataclasses.is_dataclass(thing) and schema_of(type(thing)) is not None:
        made = object.__new__(type(thing))
        for field in dataclasses.fields(thing):
            object.__setattr__(made, field.name, _plain(getattr(thing, field.name), outside, copies))
    else:
        outside[id(thing)] = made = thing
    copies[id(thing)] = thing, made
    return made
