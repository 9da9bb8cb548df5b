"""Accuracy: one named strategy for each slot, and the presets, which are nothing but named values."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from rigidimpulse.core.errors import SceneError, unknown_name


class Accuracy(BaseModel):
    """Settings of a run.

    Attributes:
        impact_time: how the first contact in an interval is found (stage sweep).
        response: how impulses are computed (stage respond); "penalty": none are, springs push bodies apart that are inside each
            other, with penalty_stiffness [N/m] and penalty_damping [N s/m] at every point that is inside; None: from weights,
            speeds and restitutions, see docs/theory/penalty.md.
        narrow_phase: who finds contacts and measures gaps: "exact": own manifolds; "fcl": FCL's contact points and normals for
            pairs of meshes, boxes and hulls, and time is backed up by bisection on FCL's gaps; own manifolds for pairs with a half
            space, a sphere, a capsule or a cylinder, where surfaces meet, and in sub-stepped islands.
        restitution: law that ends an impact: "newton" (speeds), "poisson" (impulses), "energetic" (works; Stronge), or "auto":
            energetic where a contact has friction, Newton's where it has none. They differ only with friction, and there where the
            contact couples normal and tangential motion (see dynamics/impact/restitution.py).
        integrator: how bodies move between impacts (stage integrate): "exact" (forces that vary: steps of order 4, as long as their
            error allows), or in steps of one length, where forces vary and nothing collides by impulses: "runge_kutta" (of order
            4), "semi_implicit" (Euler's, of order 1).
        contact_solver: how lasting contacts are solved (stage constrain): "newton" (exact), "substepped" (soft, for large islands:
            see docs/theory/sub_stepping.md), "qp" (the exact laws by a convex solver library: a reference), "auto": newton, and
            sub-stepped for large islands of bodies that may touch in a step, or "cheapest": newton, and sub-stepped where that
            takes less time.
        substep_motion: how far touching bodies of a sub-stepped island may move past each other until their contacts are searched
            again, as a fraction of the distance from the centre of mass to the nearest face.
        step: s; contact forces are constant over it, impacts are found inside it at any time.
        tolerance: gap error at an impact, as a fraction of the size of the smaller body.
        iterations: limit of gap queries for one pair and one interval.

    Example:
        >>> Accuracy(impact_time="conservative", step=1 / 120).response
        'sequential'

    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    impact_time: Literal["bisection", "conservative", "linear", "after"] = "bisection"
    response: Literal["sequential", "simultaneous", "kinematic", "penalty"] = "sequential"
    narrow_phase: Literal["exact", "fcl"] = "exact"
    restitution: Literal["auto", "newton", "poisson", "energetic"] = "auto"
    penalty_stiffness: float | None = Field(default=None, gt=0.0, allow_inf_nan=False)
    penalty_damping: float | None = Field(default=None, ge=0.0, allow_inf_nan=False)
    integrator: Literal["exact", "semi_implicit", "runge_kutta"] = "exact"
    contact_solver: Literal["auto", "cheapest", "newton", "substepped", "qp"] = "auto"
    substep_motion: float = Field(default=0.1, gt=0.0, le=1.0, allow_inf_nan=False)
    step: float = Field(default=1.0 / 60.0, gt=0.0, allow_inf_nan=False)
    tolerance: float = Field(default=1e-13, gt=0.0, le=1e-2, allow_inf_nan=False)
    iterations: int = Field(default=10_000, ge=1)

    @field_validator("penalty_stiffness", "penalty_damping", "substep_motion", "step", "tolerance", "iterations", mode="before")
    @classmethod
    def _is_no_text(cls, value: object) -> object:
        """Refuse digits in text, which pydantic reads."""
        if isinstance(value, str | bytes):
            raise ValueError("give a number")
        return value

    @model_validator(mode="after")
    def _fit_each_other(self) -> Accuracy:
        """Refuse what a narrow phase cannot do."""
        if self.narrow_phase == "fcl":
            if self.impact_time != "bisection":
                raise ValueError(f"it backs time up by bisection on FCL's gaps, not by {self.impact_time!r}; leave impact_time out")
            if self.response == "penalty":
                raise ValueError("springs push bodies apart, no contacts are found; leave narrow_phase out, or use another response")
            if self.contact_solver == "substepped":
                raise ValueError("FCL finds no contacts of soft islands; use contact_solver='auto' or 'newton'")
        return self

    def __init__(self, **settings: object) -> None:
        try:
            super().__init__(**settings)
        except ValidationError as error:
            unknown = [e["loc"][0] for e in error.errors() if e["type"] == "extra_forbidden"]
            if unknown:
                raise unknown_name("setting", unknown[0], type(self).model_fields, "accuracy") from None
            lines = [f"accuracy: {_named(e)}: {e['msg'].removeprefix('Value error, ')}" for e in error.errors()]
            raise SceneError("\n".join(lines)) from None


def _named(error: Any) -> str:
    """The setting that an error is about, and its value; all errors of settings that do not fit each other are about narrow_phase."""
    return f"{'.'.join(map(str, error['loc']))} = {error['input']!r}" if error["loc"] else "narrow_phase = 'fcl'"


PRESETS: dict[str, dict[str, Any]] = {
    "preview": {"impact_time": "conservative", "tolerance": 1e-7, "substep_motion": 0.3, "contact_solver": "cheapest"},
    "standard": {},
    "exact": {"step": 1.0 / 240.0, "tolerance": 1e-15, "iterations": 100000},
    "classic": {"narrow_phase": "fcl", "impact_time": "bisection", "response": "sequential"},
}
Preset = Literal["preview", "standard", "exact", "classic"]
"""Their names, for type checkers."""
LADDER = ("preview", "standard", "exact")
"""Presets from fast to accurate; "classic" is as accurate as "standard", by another way."""


def resolve_accuracy(accuracy: str | Accuracy) -> Accuracy:
    """The settings behind a preset's name; settings pass through.

    Raises:
        SceneError: for an unknown name, listing the known ones.

    """
    if isinstance(accuracy, Accuracy):
        return accuracy
    if accuracy not in PRESETS:
        raise SceneError(f"accuracy {accuracy!r} is not known; use {', '.join(map(repr, PRESETS))} or ri.Accuracy(...)")
    return Accuracy(**PRESETS[accuracy])
