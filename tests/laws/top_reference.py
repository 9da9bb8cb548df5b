"""Reference for the rotation of a rigid body: Euler's equations and q' = q w / 2 by power series in integer arithmetic.

Numbers are integers over 2^130 (39 decimal digits). A step takes REACH of a turn and the series to ORDER; the terms left out
are below (REACH / 1.5)^ORDER = 1e-20, so that the reference is exact for a comparison with doubles over thousands of steps.
Torques are constant in the world: n = R^T tau, n' = n x w.
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


def _step(q: list[int], w: list[int], n: list[int], coupling: list[int], inv_inertia: list[int], h: int) -> None:
    """Advance q, w and n (body frame) by h, in place."""
    Q, W, N = [[x] for x in q], [[x] for x in w], [[x] for x in n]
    forced = any(n)

    def term(a: list[int], b: list[int], m: int) -> int:
        return sum(map(int.__mul__, a[: m + 1], b[m::-1])) >> BITS

    for m in range(ORDER):
        dw = [_product(coupling[i], term(W[i - 2], W[i - 1], m)) + _product(inv_inertia[i], N[i][m]) for i in range(3)]
        dn = [term(N[i - 2], W[i - 1], m) - term(N[i - 1], W[i - 2], m) if forced else 0 for i in range(3)]
        dq = [
            -term(Q[1], W[0], m) - term(Q[2], W[1], m) - term(Q[3], W[2], m),
            term(Q[0], W[0], m) + term(Q[2], W[2], m) - term(Q[3], W[1], m),
            term(Q[0], W[1], m) + term(Q[3], W[0], m) - term(Q[1], W[2], m),
            term(Q[0], W[2], m) + term(Q[1], W[1], m) - term(Q[2], W[0], m),
        ]
        for series, rates, divisor in ((Q, dq, 2 * (m + 1)), (W, dw, m + 1), (N, dn, m + 1)):
            for coefficients, rate in zip(series, rates, strict=True):
                coefficients.append(_product(rate, h) // divisor)
    q[:], w[:], n[:] = map(sum, Q), map(sum, W), map(sum, N)


def reference(
    inertia: Sequence[float],
    q: Sequence[float],
    w_world: Sequence[float],
    times: Sequence[float],
    torque: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Quaternion and world angular velocity at increasing times.

    Time and inertia are scaled to a spin and a largest moment of order one, so that fixed point suits any size.
    """
    top = Fraction(max(float(value) for value in inertia))
    moments = [Fraction(float(value)) / top for value in inertia]
    push = [Fraction(float(value)) / top for value in torque]
    turning = max(abs(float(value)) for value in w_world)
    rate = Fraction(turning or math.sqrt(max(abs(float(value)) for value in push)))
    orientation = _normalized(q)
    w = _rotate(orientation, [_fixed(Fraction(float(value)) / rate) for value in w_world], back=True)
    n = _rotate(orientation, [_fixed(value / rate**2) for value in push], back=True)
    coupling = [_fixed((moments[i - 2] - moments[i - 1]) / moments[i]) for i in range(3)]
    inv_inertia = [_fixed(1 / value) for value in moments]
    largest = max(1.0, *(abs(value) / _ONE for value in coupling))

    now, states = Fraction(0), []
    for time in times:
        target = Fraction(float(time)) * rate
        while now < target:
            spin = max(abs(value) / _ONE for value in w)
            angular_acceleration = max(abs(a * b) / _ONE**2 for a, b in zip(n, inv_inertia, strict=True))
            pace = largest * spin + math.sqrt(angular_acceleration)
            h = min(_fixed(REACH / pace), _fixed(target - now) + 1)
            _step(orientation, w, n, coupling, inv_inertia, h)
            now += Fraction(h, _ONE)
        unscaled = [float(Fraction(value, _ONE) * rate) for value in _rotate(orientation, w)]
        states.append((np.array([value / _ONE for value in orientation]), np.array(unscaled)))
    return states
