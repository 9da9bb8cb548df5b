"""Energies of paths, and the path of least energy.

Frames i at times t_i, steps h_i = t_(i+1) - t_i, shares of time w_i = (h_(i-1) + h_i) / 2, half a step at the ends:

    stay near   sum w_i |x_i - x0_i|^2 / 2                                   for the integral of |x - x0|^2 / 2
    velocity    sum h_i |v_i|^2 / 2,      v_i = (x_(i+1) - x_i) / h_i        for the integral of |x'|^2 / 2
    curvature   sum w_i |k_i|^2 / 2,      k_i = (v_i - v_(i-1)) / w_i        for the integral of |x''|^2 / 2 (thin plate)

each times its weight. Where the velocity at an end is given it stands for v beyond that end; else the sum of curvatures has no term there.
All are of second order in the step. For rotations x_i - x0_i is the rotation vector log(q0_i* q_i), and v_i is log(q_i* q_(i+1)) / h_i,
both in body axes.

Positions: a sum of squares of rows A x + b with weights D, least at  D^-1 y + A x = -b,  A' y = 0:  one sparse system, which keeps the
digits that A' D A would square away. Rotations: Gauss and Newton's method on rotation vectors, with the derivatives of the logarithm.

Sources: M. Kass, A. Witkin, D. Terzopoulos, Snakes: active contour models, 1988; A. Witkin, M. Kass, Spacetime constraints, 1988; augmented
system: A. Björck, Numerical methods for least squares problems, 1996; logarithm: J. Solà, J. Deray, D. Atchuthan, A micro Lie theory, 2018.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.forces.energy.minimise import Report
from rigidimpulse.dynamics.forces.energy.path_rows import Frames, Weights, least_positions, least_rotations
from rigidimpulse.scene.body import number, vector
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.shape import check_orientation, normalized_quaternion


@dataclass(frozen=True)
class _Weighted:
    """A term with a weight for positions and one for orientations, not both 0."""

    weight: float = 0.0
    angular_weight: float = 0.0


@dataclass(frozen=True)
class StayNear(_Weighted):
    """Draws a path to the one given: integral of weight |x - x0|^2 / 2 + angular_weight |log(q0* q)|^2 / 2.

    With a `Curvature` of weight c it lets waves of the circular frequency w pass by 1 / (1 + c w^4 / weight).

    Attributes:
        weight, angular_weight: of positions and of orientations, >= 0; only ratios of weights matter for the path.

    Source: smoothing spline, C. Reinsch, Numer. Math. 10, 1967.
    """


@dataclass(frozen=True)
class Velocity(_Weighted):
    """Makes a path short and even: integral of weight |v|^2 / 2 + angular_weight |w|^2 / 2.

    Between two frames that are held, its least is the straight line, or the turn about one axis, at a constant rate.

    Attributes:
        weight, angular_weight: of positions (that of `StayNear` times s^2) and of orientations, >= 0.

    Source: Kass, Witkin, Terzopoulos 1988, elasticity.
    """


@dataclass(frozen=True, eq=False)
class Curvature(_Weighted):
    """Makes a path smooth: integral of weight |x''|^2 / 2 + angular_weight |w'|^2 / 2.

    Between frames that are held, its least is the cubic spline: 6 d^2 / T^3 for a way d from rest to rest within T.

    Attributes:
        weight, angular_weight: of positions (that of `StayNear` times s^4) and of orientations, >= 0.
        start_velocity, end_velocity: (3,) m/s, held at the ends; None leaves them free.

    Source: Kass, Witkin, Terzopoulos 1988, stiffness.
    """

    start_velocity: ArrayLike | None = None
    end_velocity: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class PinFrame:
    """Holds one frame of a path, exactly.

    Attributes:
        frame: index; negative ones count from the end.
        position: (3,) m; None, where it is in the path given.
        orientation: (w, x, y, z); None, as in the path given.

    """

    frame: int
    position: ArrayLike | None = None
    orientation: ArrayLike | None = None


class SmoothPath(NamedTuple):
    """A path of least energy. Unpacks as `positions, orientations, report`.

    Attributes:
        positions: (f, 3) m. orientations: (f, 4), None if none were given.
        report: value: sum of the energies.

    """

    positions: np.ndarray
    orientations: np.ndarray | None
    report: Report

    def keyframes(self, times: ArrayLike) -> Keyframes:
        """Return the path as keyframes of a kinematic body, at times (f,) s."""
        return Keyframes(times, self.positions, self.orientations)


def smooth_path(
    times: ArrayLike,
    positions: ArrayLike,
    orientations: ArrayLike | None = None,
    energies: Sequence[StayNear | Velocity | Curvature | PinFrame] = (),
    *,
    max_iterations: int = 200,
) -> SmoothPath:
    """Return the path that minimises a sum of energies.

    Positions are exact to rounding, whatever is given. Orientations are found from those given; frames next to each other should differ by
    less than half a turn.

    Args:
        times: (f,) s, increasing, f >= 2.
        positions: (f, 3) m.
        orientations: (f, 4), (w, x, y, z); None to leave them out.
        energies: StayNear, Velocity, Curvature, each with the weights of what it shall act on, and PinFrame.
        max_iterations: steps tried at most for the orientations.

    Returns:
        Positions, orientations and a report.

    Raises:
        SceneError: arrays that make no path, unknown energies, bad weights, frames out of range or held twice, energies that leave the
            path undetermined.

    Source: see the head of the module.

    """
    path = Keyframes(times, positions, orientations)
    path.check()
    t, x, q = path.arrays()
    if len(t) < 2:
        raise SceneError(f"the path has {len(t)} frame", "give two or more")
    terms = _one_of_each(energies)
    pins = _pins([term for term in energies if isinstance(term, PinFrame)], x, q, turns=orientations is not None)
    kinds = (StayNear, Velocity, Curvature)
    weights, angular = (Weights(*(_weight(terms.get(kind), name) for kind in kinds)) for name in ("weight", "angular_weight"))
    ends = _ends(terms.get(Curvature))
    tangents = sum(end is not None for end in ends)
    frames = Frames(np.diff(t), np.array(sorted(pins), np.int64))
    if any(weights):
        _check_determined("positions", weights, len(pins), tangents)
    if any(angular):
        _check_determined("orientations", angular, len(pins), 0)
    for frame, (position, orientation) in pins.items():
        x[frame], q[frame] = position, orientation
    x, report = least_positions(frames, weights, x, ends)
    if orientations is None:
        return SmoothPath(x, None, report)
    q, turned = least_rotations(frames, angular, q, max_iterations)
    message = turned.message if any(angular) else report.message
    gradient = max(report.gradient, turned.gradient)
    return SmoothPath(x, q, Report(turned.ok, message, report.value + turned.value, gradient, report.iterations + turned.iterations))


def _one_of_each(energies: Sequence) -> dict[type, _Weighted]:
    """Return the terms but pins by kind; raise a `SceneError` for what is none, or a kind that comes twice."""
    if isinstance(energies, str) or not isinstance(energies, Sequence):
        raise SceneError(f"energies are {energies!r}", "give a list, such as [Curvature(1.0), PinFrame(0), PinFrame(-1)]")
    terms: dict[type, _Weighted] = {}
    for term in energies:
        if isinstance(term, PinFrame):
            continue
        if not isinstance(term, (StayNear, Velocity, Curvature)):
            raise SceneError(f"{term!r} is no energy of paths", "give StayNear, Velocity, Curvature or PinFrame")
        if type(term) in terms:
            raise SceneError(f"{type(term).__name__} comes twice", "give one, with the sum of the weights")
        terms[type(term)] = term
    if not terms:
        raise SceneError("no energy acts on the path", "give StayNear, Velocity or Curvature")
    for term in terms.values():
        if not (_weight(term, "weight") or _weight(term, "angular_weight")):
            raise SceneError("neither weight is above 0", "give weight= or angular_weight=", type(term).__name__)
    return terms


def _weight(term: _Weighted | None, name: str) -> float:
    """Return a weight of a term, 0 where there is no term, or raise a `SceneError`."""
    if term is None:
        return 0.0
    try:
        weight = number(getattr(term, name), name, "")
        if weight < 0.0:
            raise SceneError(f"{name} is {weight!r}", "give a number >= 0")
    except SceneError as error:
        raise error.within(type(term).__name__) from None
    return weight


def _ends(curvature: _Weighted | None) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the velocities (3,) held at the start and the end."""
    if not isinstance(curvature, Curvature):
        return None, None
    try:
        start, end = (
            None if value is None else vector(value, name, "m/s")
            for name, value in (("start_velocity", curvature.start_velocity), ("end_velocity", curvature.end_velocity))
        )
    except SceneError as error:
        raise error.within("Curvature") from None
    if (start is not None or end is not None) and not curvature.weight:
        raise SceneError("it has a velocity at an end, but no weight", "give weight=", "Curvature")
    return start, end


def _pins(terms: list[PinFrame], x: np.ndarray, q: np.ndarray, *, turns: bool) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Return position and orientation by frame held, or raise a `SceneError`."""
    pins = {}
    for term in terms:
        where = f"PinFrame({term.frame!r})"
        if isinstance(term.frame, bool) or not isinstance(term.frame, (int, np.integer)) or not -len(x) <= term.frame < len(x):
            raise SceneError(f"frame is {term.frame!r}", f"give a whole number from {-len(x)} to {len(x) - 1}", where)
        frame = int(term.frame) % len(x)
        if frame in pins:
            raise SceneError(f"frame {frame} is held twice", "hold it once", where)
        if term.orientation is not None and not turns:
            raise SceneError("it has an orientation, but the path has none", "give orientations to smooth_path", where)
        try:
            position = x[frame].copy() if term.position is None else vector(term.position, "position", "m")
            orientation = q[frame].copy()
            if term.orientation is not None:
                check_orientation(np.asarray(term.orientation, dtype=np.float64))
                orientation = normalized_quaternion(term.orientation)
        except (SceneError, TypeError, ValueError) as error:
            if not isinstance(error, SceneError):
                error = SceneError(f"orientation is {term.orientation!r}", "give a quaternion (w, x, y, z)")
            raise error.within(where) from None
        pins[frame] = position, orientation
    return pins


def _check_determined(what: str, weights: Weights, pins: int, tangents: int) -> None:
    """Raise a `SceneError` if the energies do not tell the path: of speeds alone a shift is left open, of curvatures a line."""
    needed = 0 if weights.stay else 1 if weights.velocity or tangents else 2
    if pins < needed:
        by = "velocities" if weights.velocity else "curvatures"
        raise SceneError(
            f"energies of {by} leave the {what} undetermined with {pins} frame{'' if pins == 1 else 's'} held",
            f"hold {needed} with PinFrame, or add StayNear",
        )
