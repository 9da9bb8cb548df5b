"""Newton's method with a shift, on what can be moved by steps: positions and orientations.

    (H + m M) s = -g,    z <- move(z, s),    m smaller after good steps, larger after bad ones

M measures steps: s.M s is a square of lengths. m is at least what makes H + m M positive definite, which its sparse factors tell; where
the gradient vanishes and H still has a negative direction (a pendulum on its head), that direction is followed. Source: J. Nocedal,
S. Wright, Numerical Optimization, 2006, chapters 3.4 and 10.3 (Levenberg and Marquardt).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from rigidimpulse.core.tolerances import TOLERANCES

STEP = TOLERANCES.energy.converged
START = TOLERANCES.energy.first_shift
LEAST = TOLERANCES.energy.least_shift
MOST = 1000000000000.0
"""Shift at the start, least and largest one, relative to the largest curvature."""
ROUND_OFF = TOLERANCES.energy.value_round_off
GRADIENT_ROUND_OFF = TOLERANCES.energy.gradient_round_off
GRADIENT_FALL = 0.9
"""Factor by which the gradient must fall where rounding hides the value."""
LONGEST = 0.5
"""Component of a step, relative to `length`, beyond which it is shortened."""
NEGATIVE = TOLERANCES.energy.negative_curvature
SIDESTEP = 0.1
"""Step along a negative direction, relative to `length`."""
FAR = 500.0
"""Way, relative to `length`, after which there is no minimum."""

ENDLESS = "there is no minimum: bodies go away without end; pin them, or let something hold them"
KINK = "no step lowers the value any more: the energies have a kink here"
MORE = "not at a minimum after {} iterations: allow more with max_iterations"


@dataclass(frozen=True)
class Report:
    """How a minimisation went.

    Attributes:
        ok: whether a minimum was found. message: what happened, and what to change if it was not.
        value: J for layouts, at the end.
        gradient: largest component of the gradient there that is left (N, N m; of paths: by m and rad).
        iterations: steps tried.
        residual: m, largest distance of exact pins that is left.

    """

    ok: bool
    message: str
    value: float
    gradient: float
    iterations: int
    residual: float = 0.0


class Terms(NamedTuple):
    """Value, sum of the absolute values of its parts, gradient (k,) and second derivatives (k, k) at a point."""

    value: float
    magnitude: float
    gradient: np.ndarray
    hessian: csc_array


Expand = Callable[[Any], Terms]
Move = Callable[[Any, np.ndarray], Any]


def _factors(matrix: csc_array) -> Any:
    """Return the factors of a symmetric matrix, None if it is not positive definite."""
    try:
        factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return None
    definite = np.array_equal(factors.perm_r, factors.perm_c) and np.all(factors.U.diagonal() > 0.0)
    return factors if definite else None


class _Search:
    """State of a minimisation; in coordinates in which M is 1.

    Attributes:
        z: the point. at: terms there, in the coordinates of `root`. shift: m.

    """

    def __init__(self, expand: Expand, move: Move, z: Any, metric: np.ndarray, sizes: tuple[float, float]) -> None:
        self._expand, self._move = expand, move
        self.root, (self.length, self.extent) = np.sqrt(metric), sizes
        self.z = z
        self.at = self.terms(z)
        self.shift = START * self.scale

    def terms(self, z: Any) -> Terms:
        """Return the terms at a point, in scaled coordinates."""
        raw = self._expand(z)
        unit = diags_array(1.0 / self.root)
        return raw._replace(gradient=raw.gradient / self.root, hessian=csc_array(unit @ raw.hessian @ unit))

    @property
    def gradient_round_off(self) -> float:
        """Gradient that is rounding of the coordinates."""
        return GRADIENT_ROUND_OFF * self.scale * self.extent * len(self.root) ** 0.5

    @property
    def noise(self) -> float:
        """Value that is rounding of the coordinates where all terms are next to nothing."""
        return self.scale * (GRADIENT_ROUND_OFF * self.extent) ** 2 * len(self.root)

    @property
    def scale(self) -> float:
        """Largest curvature, or the gradient over `length` where that is larger."""
        curvature = float(np.abs(self.at.hessian.diagonal()).max(initial=0.0))
        return max(curvature, float(np.linalg.norm(self.at.gradient)) / self.length)

    def moved(self, step: np.ndarray) -> Any:
        """Return the point after a step in scaled coordinates."""
        return self._move(self.z, step / self.root)

    def factors(self, shift: float) -> Any:
        """Return the factors of H + m M, None if it is not positive definite."""
        return _factors(csc_array(self.at.hessian + shift * eye_array(len(self.root), format="csc")))

    def step(self) -> np.ndarray:
        """Return the step, shortened if it is long, and raise the shift as far as it needs."""
        while (factors := self.factors(self.shift)) is None:
            self.shift = max(10.0 * self.shift, 1e-6 * self.scale)
        step = -factors.solve(self.at.gradient)
        return step * min(1.0, LONGEST * self.length / float(np.abs(step).max(initial=1e-300)))

    def definite(self) -> bool:
        """Whether no curvature is negative."""
        return self.scale == 0.0 or self.factors(NEGATIVE * self.scale) is not None

    def sidestep(self) -> bool:
        """Follow the most negative curvature; whether there is one that lowers the value."""
        curvature, axes = np.linalg.eigh(self.at.hessian.toarray())
        if curvature[0] >= -NEGATIVE * self.scale:
            return False
        direction = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
        for way in (SIDESTEP, -SIDESTEP, 0.01 * SIDESTEP, -0.01 * SIDESTEP):
            z = self.moved(way * self.length * direction)
            at = self.terms(z)
            if at.value < self.at.value:
                self.z, self.at = z, at
                return True
        return False

    def try_step(self, step: np.ndarray) -> bool | None:
        """Take a step if it is good, and adapt the shift; None where rounding hides whether it is."""
        z = self.moved(step)
        at = self.terms(z)
        promised = -float(self.at.gradient @ step + 0.5 * step @ (self.at.hessian @ step))
        gained = self.at.value - at.value
        # Where rounding hides the fall of the value, the gradient must fall instead.
        blind = promised <= ROUND_OFF * (self.at.magnitude + at.magnitude) + self.noise
        gradient_fell = bool(np.linalg.norm(at.gradient) < GRADIENT_FALL * np.linalg.norm(self.at.gradient))
        if not (gained >= 1e-4 * promised or (blind and gradient_fell)):
            self.shift = max(8.0 * self.shift, 1e-6 * self.scale)
            return None if blind else False
        # The model was good: less shift, so that steps become Newton's.
        if blind or gained > 0.75 * promised:
            self.shift *= 0.1
        elif gained < 0.25 * promised:
            self.shift *= 4.0
        self.z, self.at = z, at
        return True


def minimise(
    expand: Expand,
    move: Move,
    start: Any,
    metric: np.ndarray,
    length: float,
    extent: float,
    max_iterations: int,
    least_shift: float = LEAST,
) -> tuple[Any, Report]:
    """Find a point z of least value near `start`.

    Args:
        expand: gives the terms at a point.
        move: gives the point after a step (k,).
        start: the first point.
        metric: (k,) diagonal of M.
        length: size of things, in the unit of M. extent: size of the coordinates, whose rounding shows in the gradient.
        max_iterations: steps tried at most.
        least_shift: relative to the largest curvature; what H has below it counts as flat.

    Returns:
        The point, and how it went.

    """
    search = _Search(expand, move, start, metric, (length, extent))
    ok, message, iteration, way, probed = False, MORE.format(max_iterations), 0, 0.0, False
    while iteration < max_iterations:
        stationary = float(np.linalg.norm(search.at.gradient)) <= search.gradient_round_off
        if stationary and (search.definite() or not search.sidestep()):
            ok, message = True, "at a minimum"
            break
        least = least_shift * search.scale
        search.shift = max(search.shift, least)
        step = search.step()
        small = float(np.linalg.norm(step)) <= STEP * length
        if small and search.shift > least and not probed:
            # Small by the shift alone, perhaps.
            if search.definite():
                search.shift, probed = least, True
                step = search.step()
                small = float(np.linalg.norm(step)) <= STEP * length
            elif search.sidestep():
                iteration += 1
                continue
        if small:
            ok, message = True, "at a minimum"
            break
        iteration += 1
        taken = search.try_step(step)
        probed = probed and not taken
        way += float(np.abs(step).max()) if taken else 0.0
        if taken is None:
            ok, message = True, "at a minimum, within rounding"
            break
        if way > FAR * length or (not taken and search.shift > MOST * search.scale):
            message = ENDLESS if way > FAR * length else KINK
            break
    gradient = float(np.abs(search.at.gradient * search.root).max(initial=0.0))
    return search.z, Report(ok, message, search.at.value, gradient, iteration)
