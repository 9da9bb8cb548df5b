"""What is varied: names of parameters, their values, and how a scene gets them.

A parameter is, in this order of precedence,

    an argument of the scene's function                     seed, height, ...
    `seed`, where the function has none                     see `with_seed`; 0 leaves the scene as it is
    duration, fps, accuracy, accuracy.FIELD                 of the run
    gravity                                                 of the scene
    FIELD                                                   of all bodies (`material.FIELD`), of all dynamic ones (others)
    BODY.FIELD, JOINT.FIELD, FORCE.FIELD                    of those whose name is, or matches, this: ball*.mass

FIELD may go on to a part: `material.restitution`, `velocity.x`, `gravity.z`.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.accuracy import Accuracy, resolve_accuracy
from rigidimpulse.scene.body import Body, number
from rigidimpulse.scene.scene import Scene

RUN = ("duration", "fps", "accuracy")
AXES = "xyz"
NUDGE = 0.02
"""Standard deviation of the velocity that a seed adds, in sqrt(g L) with the strength of gravity g and the body's size L; without
gravity of the body's speed."""
MOST_TAKES = 100_000


class UnknownParameter(SceneError):
    """Nothing of the scene has a parameter's name: no take could be made."""


def parse_vary(text: str) -> tuple[str, list[Any]]:
    """Return name and values of NAME=VALUES: numbers and words with commas, A:B:N (N numbers from A to B), A:B (whole numbers).

    Raises:
        SceneError: the text is not like that.

    """
    name, equals, values = text.partition("=")
    found = [value for item in values.split(",") for value in _values(item.strip(), text)] if equals else []
    if not name.strip() or not found:
        raise SceneError(f"--vary {text!r}", "write NAME=0.1:0.9:9, NAME=0:15 or NAME=1,2,5")
    return name.strip(), found


def _values(item: str, text: str) -> list[Any]:
    parts = item.split(":")
    try:
        if len(parts) == 3 and int(parts[2]) >= 1:
            return np.linspace(float(parts[0]), float(parts[1]), int(parts[2])).tolist()
        if len(parts) == 2:
            return list(range(int(parts[0]), int(parts[1]) + 1))
        if len(parts) == 1 and item:
            return [_number(item)]
    except ValueError:
        pass
    raise SceneError(f"--vary {text!r}: {item!r} is no value", "write numbers, A:B:N, or A:B with whole numbers")


def _number(item: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(item)
        except ValueError:
            continue
    return item


def combinations(vary: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """Return all combinations, the last name's values changing first.

    Raises:
        SceneError: nothing is varied, a name has no values, or there are too many takes.

    """
    for name, values in vary.items():
        if isinstance(values, str) or len(values) == 0:
            raise SceneError(f"{name} is varied over {values!r}", "give a list of values")
    number = int(np.prod([len(values) for values in vary.values()], dtype=float))
    if not vary or number > MOST_TAKES:
        raise SceneError(f"{number if vary else 0} takes", f"vary something, in at most {MOST_TAKES} combinations")
    plain = {name: [_plain(value) for value in values] for name, values in vary.items()}
    return [dict(zip(plain, row, strict=True)) for row in itertools.product(*plain.values())]


def _plain(value: Any) -> Any:
    """A value as JSON takes it."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else list(value) if isinstance(value, tuple) else value


def run_settings(settings: Mapping[str, Any], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return duration, fps and accuracy of a take.

    Raises:
        SceneError: an unknown accuracy or field of one.

    """
    result = dict(settings)
    for name, value in parameters.items():
        if name in RUN:
            result[name] = value
        elif name.startswith("accuracy."):
            known = resolve_accuracy(result["accuracy"]).model_dump()
            result["accuracy"] = Accuracy(**{**known, name.removeprefix("accuracy."): value})
    return result


def is_of_run(name: str) -> bool:
    """Whether a parameter is one of the run and not of the scene."""
    return name in RUN or name.startswith("accuracy.")


def with_parameter(scene: Scene, name: str, value: Any) -> Scene:
    """Return the scene with a parameter set.

    Raises:
        SceneError: nothing of the scene has this name; the value does not fit.

    """
    if name == "seed":
        return with_seed(scene, value)
    if name.split(".")[0] == "gravity":
        return copy_with(scene, {}, _part(scene.gravity, name.split(".")[1:], value, name))
    changed: dict[int, Any] = {}
    for start, path in _splits(name):
        for thing in (*scene.bodies, *scene.effects):
            if _is_meant(thing, start, path) and _has(thing, path[0]):
                changed[id(thing)] = _part(thing, path, value, name)
        if changed:
            return copy_with(scene, changed, scene.gravity)
    names = [body.name for body in scene.bodies] + [effect.name for effect in scene.effects if getattr(effect, "name", None)]
    raise UnknownParameter(
        f"nothing to vary is called {name!r}",
        f"name an argument of scene(), seed, duration, accuracy, gravity, a field of bodies such as material.restitution, "
        f"or one of {', '.join(names)} with a field",
    )


def _splits(name: str) -> list[tuple[str | None, list[str]]]:
    """Ways to read a name: a field alone, or the name of a thing, which may have dots, and its field."""
    words = name.split(".")
    return [(None, words), *((".".join(words[:k]), words[k:]) for k in range(1, len(words)))]


def _is_meant(thing: Any, start: str | None, path: list[str]) -> bool:
    if start is None:
        return isinstance(thing, Body) and (path[0] == "material" or thing.motion == "dynamic")
    own = getattr(thing, "name", None)
    return own is not None and (own == start or fnmatchcase(own, start))


def _has(thing: Any, field: str) -> bool:
    return dataclasses.is_dataclass(thing) and field != "name" and any(f.name == field and f.init for f in dataclasses.fields(thing))


def _part(thing: Any, path: list[str], value: Any, name: str) -> Any:
    """The thing with the part that a path leads to set to a value."""
    if not path:
        return value
    if _has(thing, path[0]):
        return dataclasses.replace(thing, **{path[0]: _part(getattr(thing, path[0]), path[1:], value, name)})
    if path[0] in AXES and len(path) == 1 and np.shape(thing) == (3,):
        array = np.array(thing, float)
        array[AXES.index(path[0])] = number(value, name, "")
        return tuple(array.tolist())
    raise UnknownParameter(f"{name}: there is no {path[0]!r}", "name a field of the body, of its material, or x, y, z of a vector")


def copy_with(scene: Scene, changed: Mapping[int, Any], gravity: Any) -> Scene:
    """The scene with other things in the place of some, by their identity."""
    made = Scene(gravity)
    made.origin = scene.origin
    for thing in (*scene.bodies, *scene.effects):
        made.add(changed.get(id(thing), thing))
    return made


def with_seed(scene: Scene, seed: int) -> Scene:
    """Return the scene with a small random velocity added to every dynamic body, another for each seed; 0 changes nothing.

    Each component is drawn from a normal distribution of standard deviation NUDGE sqrt(g L), L the largest side of the shape.

    Raises:
        SceneError: the seed is no whole number >= 0.

    """
    if not isinstance(seed, int) or seed < 0:
        raise SceneError(f"seed is {seed!r}", "give whole numbers >= 0")
    if seed == 0:
        return scene
    random = np.random.default_rng(seed)
    strength = float(np.linalg.norm(np.asarray(scene.gravity, float)))
    changed = {}
    for body in scene.bodies:
        nudge = random.normal(size=3)
        if body.motion == "dynamic":
            velocity = np.asarray(body.velocity, float)
            speed = np.sqrt(strength * _size(body)) if strength > 0.0 else float(np.linalg.norm(velocity))
            changed[id(body)] = dataclasses.replace(body, velocity=tuple((velocity + NUDGE * speed * nudge).tolist()))
    return copy_with(scene, changed, scene.gravity)


def _size(body: Body) -> float:
    """Largest side of a body's shape, m."""
    from rigidimpulse.engine.triggers import extent

    return extent(body.shape)
