"""The closed tables of what a checkpoint may name: classes, functions and methods of this library.

A name in a file is looked up here, and nothing is imported or called because a file says so. The classes are those that the modules of
`HOMES` define. Functions and methods stand here one by one: they are what a run keeps in its state, to call it later.
"""

from __future__ import annotations

import dataclasses
import dis
import importlib
import inspect
import pkgutil
from abc import ABCMeta
from collections.abc import Callable
from functools import cache, cached_property
from types import FunctionType, MemberDescriptorType
from typing import Any, NamedTuple

PACKAGE = "rigidimpulse."
HOMES = (
    "core.simd", "scene.body", "scene.collision_filter", "scene.joint", "scene.joint_six_axis", "scene.keyframes", "scene.mass",
    "scene.material", "scene.shape", "scene.visual", "collision", "motion", "model", "dynamics", "engine.exact",
    "engine.substepped", "engine.spheres", "engine.absent", "engine.cheapest", "engine.islands", "engine.finder", "engine.touching",
    "engine.narrow_phase", "engine.fcl_contacts", "engine.keyframe_paths", "engine.pair_events", "engine.pair_table", "engine.regime",
    "engine.run", "engine.soft_bodies", "engine.triggers", "engine.varying_forces", "recording.contact_log", "recording.contacts",
    "recording.events", "recording.impulses", "recording.joint_log", "recording.recorder",
)  # fmt: skip
"""Packages and modules whose classes a state is made of: nothing in them reads or runs files."""
FUNCTIONS = {
    "strength of constant forces": ("dynamics.forces.constant", "_strength"),
    "strength of sampled forces": ("dynamics.forces.sampled", "_strength"),
    "strength of harmonic forces": ("dynamics.forces.harmonic", "_strength"),
    "solver of rows": ("dynamics.solvers.qp", "solve_qp"),
}
"""Functions that a state may hold: modules and names."""
METHODS = {("model.plan.Plan", "clock"), ("model.world.World", "may_collide")}
"""Classes and names of the methods that a state may hold, bound to an object of just that class."""
MADE_AGAIN = (
    "engine.exact.compiled_loop.CompiledLoop", "engine.fcl_contacts.FclContacts", "collision.distance.fcl.Narrowphase",
    "collision.distance.fcl_trees.TriangleTrees",
)  # fmt: skip
"""Classes of the homes whose objects hold addresses or trees of other libraries: a run that goes on has made its own."""


class Schema(NamedTuple):
    """A class that a checkpoint may name: its label, whether it is a named tuple, the fields that it has and those that it may have.

    slots: the fields that are no part of `__dict__`.
    """

    label: str
    made: type
    is_tuple: bool
    fields: frozenset[str]
    optional: frozenset[str]
    slots: frozenset[str]


def held_by(thing: Any, schema: Schema) -> dict[str, Any]:
    """The fields of an object of a schema by name. Nothing is computed for it."""
    if schema.is_tuple:
        return dict(zip(schema.made._fields, thing, strict=True))  # type: ignore[attr-defined]
    inside = {name: getattr(thing, name) for name in schema.slots if hasattr(thing, name)}
    return {**getattr(thing, "__dict__", {}), **inside}


@cache
def schema_of(made: type) -> Schema | None:
    """The schema of a class; None for a class that is no part of a state."""
    if not _is_home(made.__module__) or made.__qualname__ != made.__name__ or type(made) not in (type, ABCMeta):
        return None
    label = f"{made.__module__.removeprefix(PACKAGE)}.{made.__name__}"
    if label in MADE_AGAIN:
        return None
    if made.__mro__[1:] == (tuple, object) and hasattr(made, "_fields"):
        return Schema(label, made, True, frozenset(made._fields), frozenset(), frozenset())
    if made.__new__ is not object.__new__:
        return None
    own = [base for base in made.__mro__ if base is not object]
    slots = frozenset(name for base in own for name, value in vars(base).items() if isinstance(value, MemberDescriptorType))
    return Schema(label, made, False, *_fields(made, own), slots)


def _fields(made: type, own: list[type]) -> tuple[frozenset[str], frozenset[str]]:
    """Names that every object of a class has, and those that some have: what its methods assign, and what is computed once."""
    assigned = {base: {name: _assigned(method) for name, method in vars(base).items() if inspect.isfunction(method)} for base in own}
    computed = {name for base in own for name, value in vars(base).items() if isinstance(value, cached_property)}
    some = computed.union(*(names for methods in assigned.values() for names in methods.values()))
    if dataclasses.is_dataclass(made):
        every = {field.name for field in dataclasses.fields(made)}
    else:
        every = set().union(*(methods.get("__init__", ()) for methods in assigned.values()))
    barred = {name for base in own for name, value in vars(base).items() if isinstance(value, property | FunctionType)}
    return frozenset(every - barred), frozenset(name for name in some - every - barred if not name.startswith("__"))


def _assigned(method: Callable[..., Any]) -> set[str]:
    """Names of attributes that a method assigns."""
    return {str(step.argval) for step in dis.get_instructions(method) if step.opname == "STORE_ATTR"}


def _is_home(module: str) -> bool:
    """Whether what a state is made of may come from a module."""
    return any(f"{module}.".startswith(f"{PACKAGE}{home}.") for home in HOMES)


@cache
def classes() -> dict[str, Schema]:
    """All classes that a checkpoint may name, by label."""
    found: dict[str, Schema] = {}
    for home in HOMES:
        module = importlib.import_module(PACKAGE + home)
        below = [each.name for each in pkgutil.walk_packages(getattr(module, "__path__", ()), f"{module.__name__}.")]
        for name in [module.__name__, *below]:
            for made in _classes_in(name):
                schema = schema_of(made)
                if schema is not None:
                    found[schema.label] = schema
    return found


def _classes_in(module: str) -> list[type]:
    """Classes that a module of this library defines, none where it needs a library that is not installed."""
    try:
        inside = vars(importlib.import_module(module))
    except ImportError:
        return []
    return [thing for thing in inside.values() if isinstance(thing, type) and thing.__module__ == module]


def function_name(function: Any) -> str | None:
    """The name of a function of the table, None for another one."""
    place = (str(getattr(function, "__module__", "")).removeprefix(PACKAGE), getattr(function, "__qualname__", ""))
    return next((name for name, known in FUNCTIONS.items() if known == place and named_function(name) is function), None)


def named_function(name: str) -> Any:
    """The function of a name in the table; a KeyError says that there is none."""
    module, attribute = FUNCTIONS[name]
    return getattr(importlib.import_module(PACKAGE + module), attribute)


def named_method(owner: Any, name: str) -> Any:
    """A method of the table, bound to its owner; None if the table has none of this name for the owner's class."""
    made = type(owner)
    if (f"{made.__module__.removeprefix(PACKAGE)}.{made.__qualname__}", name) not in METHODS:
        return None
    return vars(made)[name].__get__(owner, made)
