"""What can be changed on the live page while a scene runs: sliders, switches and choices.

A scene file declares its own by the arguments of `scene()`, as for wedges; the type and the default say what each looks like:

    height: float = 2.0                            slider from 0 to twice the default (-1 to 1 for 0.0)
    count: int = 3                                 slider of whole numbers
    height: Annotated[float, (0.5, 5.0)] = 2.0     slider from 0.5 to 5; a third number is its step
    spin: bool = False                             switch
    kind: Literal["box", "ball"] = "box"           choice

Every scene has `OWN` ones besides: restitution, friction, mass, gravity, accuracy and duration. An argument of the same name stands in
for one of them.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.accuracy import PRESETS, Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.job import Job
from rigidimpulse.studies.wedges.vary import copy_with, with_parameter

STEPS = 200
"""Steps of a slider that states none."""
MOST_FRICTION, MOST_GRAVITY = 1.5, 25.0
MASS_FACTOR = 10.0
"""Up to how many times heavier or lighter all bodies can be made."""
LONGEST = 20.0
"""s, of the slider for the duration, unless the scene lasts longer."""
DEFAULT_FRICTION = 0.5
"""What counts where no material states a friction, see `Material`."""


@dataclasses.dataclass(frozen=True)
class Control:
    """One slider ("range"), "switch" or "choice".

    Attributes:
        name: how a page and `Live.set` call it. label: for people. kind: see above.
        value: as the scene has it; None if its bodies differ.
        low, high, step: of a slider. logarithmic: whether it goes by factors. unit: for people. choices: of a choice.
        declared: whether the scene declares it.

    """

    name: str
    label: str
    kind: str
    value: Any
    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    logarithmic: bool = False
    unit: str = ""
    choices: tuple[str, ...] = ()
    declared: bool = False


def declared_controls(function: Callable[..., Scene]) -> list[Control]:
    """Return the controls that the arguments of a scene's function declare; an argument of another type is none.

    Raises:
        SceneError: an argument states a range that is none.

    """
    try:
        hints = get_type_hints(function, include_extras=True)
    except (NameError, TypeError):
        hints = {}  # annotations that cannot be read declare nothing; the defaults still do
    found = [_declared(name, each.default, hints.get(name)) for name, each in _arguments(function).items()]
    return [control for control in found if control is not None]


def _arguments(function: Callable[..., Scene]) -> dict[str, inspect.Parameter]:
    """Arguments of a function that have a default and can be given by name."""
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    known = inspect.signature(function).parameters
    return {name: each for name, each in known.items() if each.kind in named and each.default is not each.empty}


def _declared(name: str, default: Any, hint: Any) -> Control | None:
    label = name.replace("_", " ")
    stated = next((part for part in get_args(hint)[1:] if isinstance(part, tuple)), None) if get_origin(hint) is Annotated else None
    kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if get_origin(kind) is Literal:
        return Control(name, label, "choice", default, choices=get_args(kind), declared=True)
    if isinstance(default, bool):
        return Control(name, label, "switch", default, declared=True)
    if not isinstance(default, int | float) or not math.isfinite(default):
        return None
    whole = isinstance(default, int) and kind is not float
    low, high, step = _range(name, default, whole, stated)
    return Control(name, label, "range", default, low, high, step, declared=True)


def _range(name: str, default: float, whole: bool, stated: tuple[Any, ...] | None) -> tuple[float, float, float]:
    """Lowest and highest value of a slider, and its step."""
    if stated is None:
        least = 10.0 if whole else 1.0 if default == 0.0 else 0.0
        low, high = min(2.0 * default, 0.0), max(2.0 * default, least)
        stated = (-high if default == 0.0 and not whole else low, high)
    numbers = all(isinstance(part, int | float) and math.isfinite(part) for part in stated)
    if not (numbers and len(stated) in (2, 3) and stated[0] < stated[1]):
        raise SceneError(f"argument {name!r} of scene() has the range {stated!r}", "write Annotated[float, (lowest, highest)]")
    step = stated[2] if len(stated) == 3 else 1 if whole else 10.0 ** math.floor(math.log10((stated[1] - stated[0]) / STEPS))
    return stated[0], stated[1], step


def own_controls(scene: Scene, job: Job) -> list[Control]:
    """Return the controls that every scene has, with the values of this one."""
    materials = [body.material for body in scene.bodies if body.becomes_dynamic]
    gravity = float(np.linalg.norm(np.asarray(scene.gravity, float)))
    accuracy = job.accuracy if isinstance(job.accuracy, str) else None
    restitution = _common([material.restitution for material in materials], 0.0)
    friction = _common([material.frictions()[1] for material in materials], DEFAULT_FRICTION)
    return [
        Control("restitution", "restitution e", "range", restitution),
        Control("friction", "friction \u03bc", "range", friction, 0.0, MOST_FRICTION),
        Control("mass", "mass", "range", 1.0, 1.0 / MASS_FACTOR, MASS_FACTOR, logarithmic=True, unit="\u00d7"),
        Control("gravity", "gravity", "range", gravity, 0.0, max(MOST_GRAVITY, 2.0 * gravity), unit="m/s\u00b2"),
        Control("accuracy", "accuracy", "choice", accuracy, choices=tuple(PRESETS)),
        Control("duration", "duration", "range", job.duration, 0.5, max(LONGEST, 2.0 * job.duration), 0.5, unit="s"),
    ]


def _common(values: list[float | None], default: float) -> float | None:
    """The value that all have; None if they differ."""
    different = {default if value is None else value for value in values}
    return different.pop() if len(different) == 1 else None


def all_controls(scene: Scene, job: Job) -> list[Control]:
    """Return the declared controls of a scene, then its own."""
    declared = declared_controls(job.make)
    names = {control.name for control in declared}
    return declared + [control for control in own_controls(scene, job) if control.name not in names]


def make_scene(job: Job, values: Mapping[str, Any]) -> Scene:
    """Return the scene with the chosen values of its declared arguments; values of other names are left alone.

    Raises:
        SceneError: as the scene's function.

    """
    known = _arguments(job.make)
    return job.make(**{name: value for name, value in values.items() if name in known})


def with_own_values(scene: Scene, job: Job, values: Mapping[str, Any]) -> tuple[Scene, Job]:
    """Return scene and job with the chosen values of the controls that every scene has.

    Raises:
        SceneError: a value that does not fit.

    """
    chosen = {name: value for name, value in values.items() if name not in _arguments(job.make)}
    if "restitution" in chosen:
        scene = with_parameter(scene, "material.restitution", chosen["restitution"])
    if "friction" in chosen:
        scene = with_parameter(scene, "material.static_friction", chosen["friction"])
        scene = with_parameter(scene, "material.dynamic_friction", chosen["friction"])
    if "mass" in chosen:
        scene = copy_with(scene, {id(body): _heavier(body, chosen["mass"]) for body in scene.bodies}, scene.gravity)
    if "gravity" in chosen:
        scene = with_parameter(scene, "gravity", _stronger(scene.gravity, chosen["gravity"]))
    accuracy = job.accuracy if isinstance(job.accuracy, str | Accuracy) else "standard"
    return scene, job._replace(accuracy=chosen.get("accuracy", accuracy), duration=float(chosen.get("duration", job.duration)))


def _heavier(body: Body, factor: float) -> Body:
    """The body with its mass, and with it its inertia, times a factor."""
    changes: dict[str, Any] = {}
    if body.mass is None:
        changes["material"] = dataclasses.replace(body.material, density=body.material.density * factor)
    else:
        changes["mass"] = body.mass * factor
    if body.inertia is not None:
        changes["inertia"] = (np.asarray(body.inertia, float) * factor).tolist()
    return dataclasses.replace(body, **changes)


def _stronger(gravity: Any, strength: float) -> tuple[float, ...]:
    """Gravity of another strength [m/s^2]; downwards along z where there was none."""
    vector = np.asarray(gravity, float)
    size = float(np.linalg.norm(vector))
    return tuple(float(part) for part in (strength * vector / size if size > 0.0 else np.array([0.0, 0.0, -strength])))
