"""Named scenes, each with a check against a law. A scene's module is imported when the scene is asked for.

`names` are scenes to look at and learn from; `hard_names` those of the hard-case suite (`gallery.hard`).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from rigidimpulse.core.errors import unknown_name
from rigidimpulse.gallery.hard import FAMILIES
from rigidimpulse.gallery.record import asset_path

if TYPE_CHECKING:
    from rigidimpulse.gallery.record import GalleryScene

__all__ = ["asset_path", "hard_names", "load", "module_name", "names"]

_MODULES = {
    "spot": "spot",
    "bounce": "bounce",
    "tumbling_box": "tumbling_box",
    "disks_in_a_box": "disks_in_a_box",
    "pool_break": "pool_break",
    "dice": "dice",
    "cradle_one": "cradle",
    "cradle_two": "cradle",
    "cradle_strings": "cradle_on_strings",
    "superball": "superball",
    "wing_nut": "wing_nut",
    "galperin_0": "galperin",
    "galperin_1": "galperin",
    "galperin_2": "galperin",
    "galperin_3": "galperin",
    "two_spheres": "two_spheres",
    "off_centre_disk": "off_centre_disk",
    "rifle": "rifle",
    "toss": "tosses",
    "toss_alone": "tosses",
    "rolling": "rolling",
    "arm": "arm",
    "pile": "pile",
    "penalty_bounce": "penalty_bounce",
    "smoothed_path": "smoothed_path",
    "settled_layout": "settled_layout",
    "emergency_stop": "emergency_stop",
    "rear_end_crash": "rear_end_crash",
    "pendulum": "pendulum",
    "kinematic_bounce": "kinematic_bounce",
    "backing_up_bisection": "backing_up",
    "backing_up_linear": "backing_up",
    "pool_aim": "pool",
    "pool_follow": "pool",
    "pool_draw": "pool",
    "pool_swerve": "pool",
    "table_on_four_feet": "table_on_four_feet",
    "pendulum_drift": "pendulum_drift",
    "soft_hinge": "soft_hinge",
    "crowd_momentum": "crowd_momentum",
    "marbles": "marbles",
    "rocket": "rocket",
    "launcher": "launcher",
    "handgun": "handgun",
    "driven_oscillator": "driven_oscillator",
    "parachute": "parachute",
    "planets": "planets",
    "coupled_springs": "coupled_springs",
    "held_arm": "held_arm",
    "pinned_shapes": "pinned_shapes",
    "cloth_on_ball": "cloth_on_ball",
    "trampoline": "trampoline",
    "jelly_on_stairs": "jelly_on_stairs",
}
"""Module of each scene; it holds the records of its scenes in a tuple `SCENES`."""


_HARD_MODULES = {name: family for family, (_, cases) in FAMILIES.items() for name in cases}


def names() -> tuple[str, ...]:
    """Return the names of all scenes without the hard cases."""
    return tuple(_MODULES)


def hard_names() -> tuple[str, ...]:
    """Return the names of the scenes of the hard-case suite."""
    return tuple(_HARD_MODULES)


def module_name(name: str) -> str:
    """Return the module that makes the scene of a name, hard cases included.

    Raises:
        SceneError: for an unknown name, listing the known ones.

    """
    if name in _MODULES:
        return f"rigidimpulse.gallery.{_MODULES[name]}"
    if name in _HARD_MODULES:
        return f"rigidimpulse.gallery.hard.{_HARD_MODULES[name]}"
    raise unknown_name("gallery scene", name, names() + hard_names())


def load(name: str) -> GalleryScene:
    """Return the scene of a name, hard cases included.

    Raises:
        SceneError: for an unknown name, listing the known ones.

    """
    module = importlib.import_module(module_name(name))
    return next(entry for entry in module.SCENES if entry.name == name)
