"""Materials: density and the coefficients of contact, and how two materials combine.

What a material leaves unstated (None) is taken from the other body's material, so a plain floor bounces a ball with the
ball's own restitution. Where both state a value they combine by the rule of glTF's KHR_physics_rigid_bodies: of the two
modes the one that comes first in `COMBINE_MODES` counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.numeric import number_of

COMBINE_MODES = ("average", "minimum", "maximum", "multiply")
"""Ways to combine two coefficients, the first of two taking precedence."""

DEFAULT_RESTITUTION = 0.0
"""Restitution where neither body states one: no bounce."""

DEFAULT_FRICTION = 0.5
"""Static and dynamic friction where neither body states one."""


@dataclass(frozen=True)
class Material:
    """What a body is made of.

    Attributes:
        density: kg/m^3; used where the body does not give its mass.
        restitution: e in [0, 1]. Without friction, and for spheres, the ratio of separation speed to approach speed along
            the normal; with friction e^2 is the share of the normal work of compression that restitution gives back
            (Stronge), or what `Accuracy.restitution` says.
        static_friction: mu_s >= 0, bound of tangential over normal force without sliding; decides whether an impact
            sticks. If only one of the two frictions is stated the other is the same.
        dynamic_friction: mu_k in [0, mu_s], tangential over normal force while sliding.
        tangential_restitution: in [0, 1], share of the slip at an impact that is reversed, as far as friction is able
            (1: Garwin's superball; 0: slip at most stops).
        rolling_friction: b >= 0, m: a contact that presses with N resists rolling by a moment of up to b N. A ball of radius
            r holds on inclines below tan = b / r.
        spinning_friction: s >= 0, m: it resists spinning about the normal by a moment of up to s N.
        restitution_combine: one of "average", "minimum", "maximum", "multiply"; also for tangential_restitution.
        friction_combine: the same, for all frictions.
        any_restitution: accept a restitution outside [0, 1] on purpose: above 1 an impact feeds energy in, below 0
            bodies pass into each other.

    None means not stated: the other body's value counts, or the defaults (restitutions 0, friction 0.5, rolling and
    spinning friction 0) if neither body states one. Values are checked when the scene is compiled.

    """

    density: float = 1000.0
    restitution: float | None = None
    static_friction: float | None = None
    dynamic_friction: float | None = None
    tangential_restitution: float | None = None
    restitution_combine: str = "average"
    friction_combine: str = "average"
    any_restitution: bool = False
    rolling_friction: float | None = None
    spinning_friction: float | None = None

    def frictions(self) -> tuple[float | None, float | None]:
        """Return static and dynamic friction, each standing in for the other where only one is stated."""
        static, dynamic = self.static_friction, self.dynamic_friction
        return (dynamic if static is None else static), (static if dynamic is None else dynamic)

    def check(self) -> None:
        """Raise a `SceneError` for values that have no physical meaning."""
        density = _number("density", self.density, "kg/m^3")
        if density is None or density <= 0.0:
            raise SceneError(f"density is {self.density} kg/m^3", "give a density > 0, or the body's mass=", "material")
        if not isinstance(self.any_restitution, bool | np.bool_):
            raise SceneError(f"any_restitution is {self.any_restitution!r}", "give True or False", "material")
        for name in ("restitution", "tangential_restitution"):
            value = _number(name, getattr(self, name))
            if value is not None and not 0.0 <= value <= 1.0 and not (self.any_restitution and name == "restitution"):
                remedy = "give a value from 0 (no bounce) to 1 (elastic)"
                if name == "restitution":
                    remedy += ", or ask for it with any_restitution=True"
                raise SceneError(f"{name} is {value}", remedy, "material")
        for name in ("static_friction", "dynamic_friction"):
            value = _number(name, getattr(self, name))
            if value is not None and value < 0.0:
                raise SceneError(f"{name} is {value}", "give a value >= 0", "material")
        for name in ("rolling_friction", "spinning_friction"):
            value = _number(name, getattr(self, name), "m")
            if value is not None and value < 0.0:
                raise SceneError(f"{name} is {value} m", "give a length >= 0", "material")
        static, dynamic = self.frictions()
        if static is not None and dynamic is not None and dynamic > static:
            raise SceneError(
                f"dynamic_friction {dynamic} is above static_friction {static}",
                "sliding never grips more than sticking: lower dynamic_friction or raise static_friction",
                "material",
            )
        for name in ("restitution_combine", "friction_combine"):
            mode = getattr(self, name)
            if not isinstance(mode, str) or mode not in COMBINE_MODES:
                listing = ", ".join(repr(mode) for mode in COMBINE_MODES)
                raise SceneError(f"{name} is {mode!r}", f"give one of {listing}", "material")


def combine(material_a: Material, material_b: Material) -> tuple[float, float, float, float]:
    """Return restitution, static, dynamic friction and tangential restitution of a pair; its order does not matter."""
    static_a, dynamic_a = material_a.frictions()
    static_b, dynamic_b = material_b.frictions()
    bounce = _mode(material_a.restitution_combine, material_b.restitution_combine)
    grip = _mode(material_a.friction_combine, material_b.friction_combine)
    return (
        _combined(bounce, material_a.restitution, material_b.restitution, DEFAULT_RESTITUTION),
        _combined(grip, static_a, static_b, DEFAULT_FRICTION),
        _combined(grip, dynamic_a, dynamic_b, DEFAULT_FRICTION),
        _combined(bounce, material_a.tangential_restitution, material_b.tangential_restitution, DEFAULT_RESTITUTION),
    )


def combine_rolling(material_a: Material, material_b: Material) -> tuple[float, float]:
    """Return rolling and spinning friction of a pair [m]; its order does not matter."""
    grip = _mode(material_a.friction_combine, material_b.friction_combine)
    return (
        _combined(grip, material_a.rolling_friction, material_b.rolling_friction, 0.0),
        _combined(grip, material_a.spinning_friction, material_b.spinning_friction, 0.0),
    )


def _mode(mode_a: str, mode_b: str) -> str:
    """Return the mode of the two that takes precedence."""
    return min(mode_a, mode_b, key=COMBINE_MODES.index)


def _combined(mode: str, value_a: float | None, value_b: float | None, default: float) -> float:
    """Combine two coefficients, of which none, one or both are stated."""
    if value_a is None or value_b is None:
        stated = value_b if value_a is None else value_a
        return float(default if stated is None else stated)
    if mode == "average":
        return 0.5 * (value_a + value_b)
    if mode == "minimum":
        return float(min(value_a, value_b))
    if mode == "maximum":
        return float(max(value_a, value_b))
    return float(value_a * value_b)


def _number(name: str, value: object, unit: str = "") -> float | None:
    """Return a stated value as a finite float, None if it is not stated."""
    if value is None:
        return None
    number = number_of(value)
    if not math.isfinite(number):
        raise SceneError(f"{name} is {value!r}", f"give a finite number{' in ' + unit if unit else ''}", "material")
    return number
