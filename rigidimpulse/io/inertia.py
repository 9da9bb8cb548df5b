"""Inertias of files that no body has, brought to the nearest that one has.

A body has second moments of mass s_i >= 0 along its principal axes, and the moments of inertia I_i = s_j + s_k. The tensor nearest to a
given one, in the Frobenius norm, has the same principal axes, for the norm and the set of possible tensors are the same in all axes. Its
moments I are nearest to the given ones g:

    least |I - g|    with    I_j + I_k - I_i = 2 s_i >= 2 s_0

Of the bounds that hold as equalities, none to three, some are known to be right by trial. s_0 is as much above 0 as rounding needs.

Scenes written in Python are still refused: there a wrong figure is a mistake that its author can correct.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.mass import is_possible, principal_axes

_SIDES = np.ones((3, 3)) - 2.0 * np.eye(3)
"""Row i: I_j + I_k - I_i."""


def with_possible_inertia(body: Body, notes: list[str]) -> Body:
    """Return a body of a file, with the nearest possible inertia where the given one is none of a body.

    Args:
        body: that was read. notes: where the line of the report goes.

    """
    if body.inertia is None or not body.becomes_dynamic:
        return body
    given = np.asarray(body.inertia, float)
    tensor = np.diag(given) if given.shape == (3,) else 0.5 * (given + given.T)
    nearest = nearest_inertia(body.name, tensor, notes)
    if nearest is not None:
        return body if nearest is tensor else replace(body, inertia=nearest)
    try:
        body.shape.solid()
    except SceneError:
        return body  # compiling the scene says what is missing
    notes.append(f"body {body.name!r}: its inertia is none of a body; that of its shape is taken")
    return replace(body, inertia=None)


def nearest_inertia(name: str, tensor: np.ndarray, notes: list[str]) -> np.ndarray | None:
    """Return the possible inertia (3, 3) kg m^2 nearest to a symmetric one: itself if it is possible, None if the nearest is 0.

    Args:
        name: of the body. tensor: (3, 3) kg m^2, about the centre of mass. notes: where the line of the report goes.

    """
    moments, axes = principal_axes(tensor)
    if is_possible(moments) or not np.all(np.isfinite(moments)):
        return tensor
    nearest = nearest_moments(moments)
    if not is_possible(nearest):
        return None
    notes.append(
        f"body {name!r}: no body has the principal moments of inertia {_figures(moments)} kg m^2; "
        f"the nearest that one has are taken, {_figures(nearest)}"
    )
    return axes @ np.diag(nearest) @ axes.T


def nearest_moments(moments: np.ndarray) -> np.ndarray:
    """Return the principal moments (3,) kg m^2 of a body that are nearest to given ones (3,)."""
    least = 2.0 * TOLERANCES.inertia.realizable * float(np.abs(moments).max())
    best, off = moments, np.inf
    for count in range(4):
        for held in combinations(range(3), count):
            sides = _SIDES[list(held)]
            found = moments + np.linalg.pinv(sides) @ (least - sides @ moments) if count else moments
            # Half of the least: what is held there is off it by rounding.
            distance = float(np.linalg.norm(found - moments))
            if np.all(_SIDES @ found >= 0.5 * least) and distance < off:
                best, off = found, distance
    return best


def _figures(moments: np.ndarray) -> str:
    return ", ".join(f"{moment:.6g}" for moment in moments)
