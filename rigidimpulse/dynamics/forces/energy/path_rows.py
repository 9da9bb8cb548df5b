"""Sums of squares along a path, and their least: the equations are at the head of `path`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import block_array, bsr_array, csc_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import splu

from rigidimpulse.core.quaternion import conjugate, multiply, normalize, quaternion_from_rotation_vector, rotation_vector
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.energy.minimise import Report, Terms, minimise
from rigidimpulse.dynamics.forces.energy.term import cross_matrix

LEAST_SHIFT = TOLERANCES.energy.least_path_shift
SMALL = 1e-2
"""rad; below it a factor of the logarithm's derivative is taken from its series, exact there to 1e-13."""

Ends = tuple[np.ndarray | None, np.ndarray | None]


class Weights(NamedTuple):
    """Weights of the three sums; 0 leaves one out."""

    stay: float
    velocity: float
    curvature: float


class Frames(NamedTuple):
    """Steps h (f - 1,) s, and the frames held (p,), ascending."""

    step: np.ndarray
    held: np.ndarray

    @property
    def number(self) -> int:
        """Number of frames."""
        return len(self.step) + 1

    @property
    def free(self) -> np.ndarray:
        """Frames that are not held."""
        return np.setdiff1d(np.arange(self.number), self.held)

    @property
    def share(self) -> np.ndarray:
        """Shares of time w (f,) s."""
        return 0.5 * (np.append(self.step, 0.0) + np.insert(self.step, 0, 0.0))

    def velocities(self) -> csc_array:
        """Return the matrix (f - 1, f) of v."""
        return csc_array(
            diags_array(1.0 / self.step) @ (eye_array(self.number - 1, self.number, k=1) - eye_array(self.number - 1, self.number))
        )

    def differences(self, start: bool, end: bool) -> tuple[csc_array, np.ndarray]:
        """Return the matrix (k, f - 1) of k from v, without velocities given beyond the ends, and the frames (k,) of its rows."""
        rows = np.arange(0 if start else 1, self.number if end else self.number - 1)
        full = diags_array(1.0 / self.share) @ (eye_array(self.number, self.number - 1) - eye_array(self.number, self.number - 1, k=-1))
        return csc_array(csc_array(full)[rows]), rows


def least_positions(frames: Frames, weights: Weights, x: np.ndarray, ends: Ends) -> tuple[np.ndarray, Report]:
    """Return the positions of least energy.

    Args:
        frames: steps and frames held.
        weights: of the sums; all 0 leaves x as it is.
        x: (f, 3) m, the path given, held frames where they are held.
        ends: velocities (3,) m/s at the ends, or None.

    Returns:
        (f, 3) m and a report.

    """
    A, D, b = _position_rows(frames, weights, x, ends)
    x, free = x.copy(), frames.free
    if len(D) and len(free):
        # Without the columns of frames held, which go to the right; scaled so that no entry is above 1.
        rest = b + A[:, frames.held] @ x[frames.held]
        root = np.sqrt(D)
        rows = diags_array(root) @ A[:, free]
        scale = 1.0 / float(np.abs(rows).max())
        system = csc_array(block_array([[eye_array(len(D)), scale * rows], [scale * rows.T, None]]))
        factors = splu(system)
        right = np.concatenate([-root[:, None] * rest, np.zeros((len(free), 3))])
        answer = factors.solve(right)
        answer += factors.solve(right - system @ answer)
        x[free] = scale * answer[len(D) :]
    r = A @ x + b
    gradient = (A.T @ (D[:, None] * r))[free]
    value = 0.5 * float(np.sum(D[:, None] * r * r))
    return x, Report(True, "exact: one linear system", value, float(np.abs(gradient).max(initial=0.0)), 1)


def _position_rows(frames: Frames, weights: Weights, x: np.ndarray, ends: Ends) -> tuple[csc_array, np.ndarray, np.ndarray]:
    """Return A (k, f), D (k,) and b (k, 3)."""
    velocities = frames.velocities()
    blocks, D, b = [csc_array((0, frames.number))], [np.zeros(0)], [np.zeros((0, 3))]
    if weights.stay:
        blocks.append(csc_array(eye_array(frames.number)))
        D.append(weights.stay * frames.share)
        b.append(-x)
    if weights.velocity:
        blocks.append(velocities)
        D.append(weights.velocity * frames.step)
        b.append(np.zeros((frames.number - 1, 3)))
    if weights.curvature:
        differences, rows = frames.differences(*(end is not None for end in ends))
        given = np.zeros((frames.number, 3))
        for frame, sign, end in ((0, -1.0, ends[0]), (frames.number - 1, 1.0, ends[1])):
            # A given velocity at an end stands for v beyond that end.
            if end is not None:
                given[frame] += sign * end / frames.share[frame]
        blocks.append(differences @ velocities)
        D.append(weights.curvature * frames.share[rows])
        b.append(given[rows])
    return csc_array(vstack(blocks)), np.concatenate(D), np.concatenate(b)


def least_rotations(frames: Frames, weights: Weights, q: np.ndarray, max_iterations: int) -> tuple[np.ndarray, Report]:
    """Return the orientations of least energy.

    Args:
        frames: steps and frames held.
        weights: of the sums; all 0 leaves q as it is.
        q: (f, 4), the path given, held frames as they are held.
        max_iterations: steps tried at most.

    Returns:
        (f, 4) and a report.

    """
    free = frames.free
    if not any(weights) or not len(free):
        return q, Report(True, "nothing acts", rotation_terms(frames, weights, q, q).value, 0.0, 0)
    columns = (3 * free[:, None] + np.arange(3)).ravel()

    def expand(now: np.ndarray) -> Terms:
        terms = rotation_terms(frames, weights, q, now)
        return terms._replace(gradient=terms.gradient[columns], hessian=terms.hessian[columns][:, columns])

    def move(now: np.ndarray, step: np.ndarray) -> np.ndarray:
        moved = now.copy()
        moved[free] = normalize(multiply(now[free], quaternion_from_rotation_vector(step.reshape(-1, 3))))
        return moved

    return minimise(expand, move, q, np.ones(len(columns)), 1.0, 1.0, max_iterations, LEAST_SHIFT)


def rotation_terms(frames: Frames, weights: Weights, given: np.ndarray, q: np.ndarray) -> Terms:
    """Return the sum of the energies of orientations q (f, 4), by rotation vectors in body axes, q exp(t).

    Second derivatives are those of Gauss and Newton, without the curvature of the residuals.

    Args:
        frames: steps.
        weights: of the sums.
        given: (f, 4), what `stay` draws to.
        q: (f, 4).

    """
    number = frames.number
    r, D, J = [np.zeros(0)], [np.zeros(0)], [csc_array((0, 3 * number))]
    if weights.stay:
        away = rotation_vector(multiply(conjugate(given), q))
        r.append(away.ravel())
        D.append(np.repeat(weights.stay * frames.share, 3))
        J.append(_blocks([(np.arange(number), logarithm_slope(away))], number))
    if weights.velocity or weights.curvature:
        turn = rotation_vector(multiply(conjugate(q[:-1]), q[1:]))
        rate = turn / frames.step[:, None]
        first = np.arange(number - 1)
        step = frames.step[:, None, None]
        slope = _blocks([(first, -logarithm_slope(-turn) / step), (first + 1, logarithm_slope(turn) / step)], number)
        if weights.velocity:
            r.append(rate.ravel())
            D.append(np.repeat(weights.velocity * frames.step, 3))
            J.append(slope)
        if weights.curvature:
            differences, rows = frames.differences(False, False)
            r.append(np.asarray(differences @ rate).ravel())
            D.append(np.repeat(weights.curvature * frames.share[rows], 3))
            J.append(kron(differences, eye_array(3)) @ slope)
    residual, weight, jacobian = np.concatenate(r), np.concatenate(D), csc_array(vstack(J))
    value = 0.5 * float(np.sum(weight * residual**2))
    # Gauss and Newton's second derivatives: J^T D J.
    weighted = jacobian.T @ diags_array(weight)
    return Terms(value, value, weighted @ residual, csc_array(weighted @ jacobian))


def _blocks(parts: list[tuple[np.ndarray, np.ndarray]], number: int) -> csc_array:
    """Return the matrix (3 k, 3 f) with blocks (k, 3, 3) at the frames (k,) of each part, columns ascending."""
    columns = np.stack([frames for frames, _ in parts], axis=1).ravel()
    entries = np.stack([blocks for _, blocks in parts], axis=1).reshape(-1, 3, 3)
    rows = len(parts[0][0])
    return csc_array(bsr_array((entries, columns, len(parts) * np.arange(rows + 1)), shape=(3 * rows, 3 * number)))


def logarithm_slope(u: np.ndarray) -> np.ndarray:
    """Return the derivatives (k, 3, 3) of log(exp(u) exp(t)) by t at 0, u (k, 3) rad.

    With U t = u x t and a = |u| they are 1 + U / 2 + (1 / a^2 - cot(a / 2) / (2 a)) U U.
    """
    U = cross_matrix(u)
    a = np.linalg.norm(u, axis=1)
    small = a < SMALL
    b = np.where(small, 1.0, a)
    factor = np.where(small, 1.0 / 12.0 + a**2 / 720.0, 1.0 / b**2 - 1.0 / (2.0 * b * np.tan(0.5 * b)))
    return np.eye(3) + 0.5 * U + factor[:, None, None] * (U @ U)
