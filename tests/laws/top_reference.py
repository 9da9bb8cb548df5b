"""Reference for the rotation of a rigid body: Euler's equations and q' = q w / 2 by power series in integer arithmetic.

Numbers are integers over 2^130 (39 decimal digits). A step takes REACH of a turn and the series to ORDER; the terms left out
are below (REACH / 1.5)^ORDER = 1e-20, so that the reference is exact for a comparison with doubles over thousands of steps.
Torques are tau0 + tau1 t in the world: n = R^T tau, m = R^T tau1, n' = n x w + m, m' = m x w.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

BITS = 130
ORDER = 32
REACH = 0.35

_ONE = 1 << BITS


def _fixed(value: float | Fraction) -> int:
    return int(Fraction(value) * _ONE)


def _product(a: int, b: int) -> int:
    return (a * b) >> BITS


def _quaternion_product(a: list[int], b: list[int]) -> list[int]:
    signs = ((1, -1, -1, -1), (1, 1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1))
    return [sum(signs[k][i] * _product(a[i], b[i ^ k]) for i in range(4)) for k in range(4)]


def _rotate(q: list[int], v: list[int], back: bool = False) -> list[int]:
    inverse = [q[0], -q[1], -q[2], -q[3]]
    if back:
        q, inverse = inverse, q
    return _quaternion_product(_quaternion_product(q, [0, *v]), inverse)[1:]


def _normalized(q: Sequence[float]) -> list[int]:
    fixed = [_fixed(float(value)) for value in q]
    norm = math.isqrt(sum(value * value for value in fixed))
    return [(value << BITS) // norm for value in fixed]


def _step(q: list[int], w: list[int], n: list[int], m: list[int], coupling: list[int], inv_inertia: list[int], h: int) -> None:
    """Advance q, w, n and m (body frame) by h, in place."""
    Q, W, N, M = [[x] for x in q], [[x] for x in w], [[x] for x in n], [[x] for x in m]
    varies = any(m)
    forced = varies or any(n)

    def term(a: list[int], b: list[int], k: int) -> int:
        return sum(map(int.__mul__, a[: k + 1], b[k::-1])) >> BITS

    for k in range(ORDER):
        dw = [_product(coupling[i], term(W[i - 2], W[i - 1], k)) + _product(inv_inertia[i], N[i][k]) for i in range(3)]
        dn = [term(N[i - 2], W[i - 1], k) - term(N[i - 1], W[i - 2], k) + M[i][k] if forced else 0 for i in range(3)]
        dm = [term(M[i - 2], W[i - 1], k) - term(M[i - 1], W[i - 2], k) if varies else 0 for i in range(3)]
        dq = [
            -term(Q[1], W[0], k) - term(Q[2], W[1], k) - term(Q[3], W[2], k),
            term(Q[0], W[0], k) + term(Q[2], W[2], k) - term(Q[3], W[1], k),
            term(Q[0], W[1], k) + term(Q[3], W[0], k) - term(Q[1], W[2], k),
            term(Q[0], W[2], k) + term(Q[1], W[1], k) - term(Q[2], W[0], k),
        ]
        for series, rates, divisor in ((Q, dq, 2 * (k + 1)), (W, dw, k + 1), (N, dn, k + 1), (M, dm, k + 1)):
            for coefficients, rate in zip(series, rates, strict=True):
                coefficients.append(_product(rate, h) // divisor)
    q[:], w[:], n[:], m[:] = map(sum, Q), map(sum, W), map(sum, N), map(sum, M)


def reference(
    inertia: Sequence[float],
    q: Sequence[float],
    w_world: Sequence[float],
    times: Sequence[float],
    torque: Sequence[float] = (0.0, 0.0, 0.0),
    torque_rate: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Quaternion and world angular velocity at increasing times.

    Time and inertia are scaled to a spin and a largest moment of order one, so that fixed point suits any size.
    """
    top = Fraction(max(float(value) for value in inertia))
    moments = [Fraction(float(value)) / top for value in inertia]
    push = [Fraction(float(value)) / top for value in torque]
    growth = [Fraction(float(value)) / top for value in torque_rate]
    turning = max(abs(float(value)) for value in w_world)
    turning = turning or math.sqrt(max(abs(float(value)) for value in push))
    rate = Fraction(turning or max(abs(float(value)) for value in growth) ** (1.0 / 3.0))
    orientation = _normalized(q)
    w = _rotate(orientation, [_fixed(Fraction(float(value)) / rate) for value in w_world], back=True)
    n = _rotate(orientation, [_fixed(value / rate**2) for value in push], back=True)
    m = _rotate(orientation, [_fixed(value / rate**3) for value in growth], back=True)
    coupling = [_fixed((moments[i - 2] - moments[i - 1]) / moments[i]) for i in range(3)]
    inv_inertia = [_fixed(1 / value) for value in moments]
    largest = max(1.0, *(abs(value) / _ONE for value in coupling))

    now, states = Fraction(0), []
    for time in times:
        target = Fraction(float(time)) * rate
        while now < target:
            spin = max(abs(value) / _ONE for value in w)
            angular_acceleration = max(abs(a * b) / _ONE**2 for a, b in zip(n, inv_inertia, strict=True))
            angular_jerk = max(abs(a * b) / _ONE**2 for a, b in zip(m, inv_inertia, strict=True))
            pace = largest * spin + math.sqrt(angular_acceleration) + angular_jerk ** (1.0 / 3.0)
            h = min(_fixed(REACH / pace), _fixed(target - now) + 1)
            _step(orientation, w, n, m, coupling, inv_inertia, h)
            now += Fraction(h, _ONE)
        unscaled = [float(Fraction(value, _ONE) * rate) for value in _rotate(orientation, w)]
        states.append((np.array([value / _ONE for value in orientation]), np.array(unscaled)))
    return states
