"""References for impacts with friction: the plane process in closed form, the spatial one by a Runge-Kutta method.

Everything in the frame (normal, tangent, tangent); static and dynamic friction are the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

LAWS = ("newton", "poisson", "energetic")


class Plane(NamedTuple):
    """An impact in a plane: inverse effective mass, velocity before (slip > 0), friction."""

    nn: float
    nt: float
    tt: float
    un: float
    slip: float
    mu: float

    @property
    def kinetic(self) -> float:
        """The most energy an impulse can take, u.K^-1 u / 2."""
        k = np.array([[self.nn, self.nt], [self.nt, self.tt]])
        u = np.array([self.un, self.slip])
        return 0.5 * u @ np.linalg.solve(k, u)


def plane_impact(plane: Plane, e: float, law: str) -> tuple[float, float, str]:
    """Normal and tangential impulse and what becomes of the slip (Stronge 1990, Batlle 1996), by u_n linear in p on two stretches.

    Needs u_n to grow on the first stretch, or slip to stop on it before compression ends (jamb).
    """
    nn, nt, tt, un, slip, mu = plane
    a1, b1 = nn - mu * nt, nt - mu * tt
    stop = -slip / b1 if b1 < 0 else np.inf
    if abs(nt) <= mu * tt:
        f2, kind = -nt / tt, "sticks"
    else:
        f2 = -mu * np.sign(nt)
        kind = "reverses" if nt < 0 else "slips on"
    a2 = nn + nt * f2
    if a1 > 0 and -un / a1 <= stop:
        # Compression ends while it slips; the first stretch of restitution lasts p1.
        pc, wc, p1, a_first = -un / a1, un * un / (2 * a1), stop + un / a1, a1
    else:
        at_stop = un + a1 * stop
        pc, wc, p1, a_first = stop - at_stop / a2, -stop * (un + at_stop) / 2 + at_stop**2 / (2 * a2), 0.0, a1
    full = {
        "newton": lambda v, a, p, w: (-e * un - v) / a,
        "poisson": lambda v, a, p, w: e * pc - p,
        "energetic": lambda v, a, p, w: (np.sqrt(v * v + 2 * a * (e * e * wc - w)) - v) / a,
    }[law]
    first = full(0.0, a_first, 0.0, 0.0) if p1 > 0 else np.inf
    if first <= p1:
        return pc + first, -mu * (pc + first), "slips on"
    v, w = a_first * p1, a_first * p1 * p1 / 2
    p = pc + p1 + full(v, a2, p1, w)
    return p, -mu * stop + f2 * (p - stop), kind


def slope_without(k: np.ndarray, mu: float) -> np.ndarray:
    """What friction passes per normal impulse once the slip (components 1, 2) is zero."""
    stick = -np.linalg.solve(k[1:, 1:], k[1:, 0])
    if np.hypot(*stick) <= mu:
        return np.concatenate([[1.0], stick])

    def growth(angle: float) -> np.ndarray:
        d = np.array([np.cos(angle), np.sin(angle)])
        g = k[1:, 0] - mu * k[1:, 1:] @ d
        return np.array([d[0] * g[1] - d[1] * g[0], d @ g])

    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    turning = [growth(angle)[0] for angle in angles]
    roots = [
        brentq(lambda angle: growth(angle)[0], low, high, xtol=1e-15)
        for low, high, x, y in zip(angles, angles[1:], turning, turning[1:])
        if x * y < 0
    ]
    (angle,) = [root for root in roots if growth(root)[1] > 0]
    return np.array([1.0, -mu * np.cos(angle), -mu * np.sin(angle)])


def space_impact(k: np.ndarray, u: np.ndarray, mu: float, e: float, law: str) -> np.ndarray:
    """Impulse (3,) of an impact: compression and restitution each by DOP853 in x with dp = |slip| dx, then straight."""
    scale = np.abs(k).sum() * (1.0 + mu)
    least = 1e-15 * max(np.hypot(u[1], u[2]), scale * -u[0] / k[0, 0])

    def rates(_x: float, y: np.ndarray) -> np.ndarray:
        # y: impulse (3), work of its normal part.
        v = u + k @ y[:3]
        slip = np.hypot(v[1], v[2])
        return np.array([slip, -mu * v[1], -mu * v[2], v[0] * slip]) / scale

    def slip_left(_x: float, y: np.ndarray) -> float:
        v = u + k @ y[:3]
        return np.hypot(v[1], v[2]) - least

    def energy(j: np.ndarray) -> float:
        return u @ j + 0.5 * j @ k @ j

    y, compression = np.zeros(4), None

    def due(_x: float, y: np.ndarray) -> float:
        """Rises through zero at the end of the phase."""
        v = u[0] + k[0] @ y[:3]
        if compression is None:
            return v
        if law == "newton":
            return max(v + e * u[0], energy(y[:3]))
        if law == "poisson":
            return y[0] - (1.0 + e) * compression[0]
        return y[3] - (1.0 - e * e) * compression[3]

    slip_left.terminal = due.terminal = True
    due.direction = 1.0
    for _phase in range(2):
        if slip_left(0.0, y) > 0:
            path = solve_ivp(rates, (0.0, 1e6), y, method="DOP853", rtol=3e-14, atol=1e-18, events=[slip_left, due])
            y = path.y[:, -1]
            slips = len(path.t_events[1]) > 0
        else:
            slips = False
        if not slips:
            along = slope_without(k, mu)
            v, a = u[0] + k[0] @ y[:3], k[0] @ along
            if compression is None:
                length = -v / a
            elif law == "newton":
                b, c = (u + k @ y[:3]) @ along, along @ k @ along
                length = min((-e * u[0] - v) / a, (-b + np.sqrt(b * b - 2.0 * c * min(energy(y[:3]), 0.0))) / c)
            elif law == "poisson":
                length = (1.0 + e) * compression[0] - y[0]
            else:
                length = (np.sqrt(max(v * v - 2.0 * a * (y[3] - (1.0 - e * e) * compression[3]), 0.0)) - v) / a
            y = y + length * np.append(along, v + 0.5 * a * length)
        if compression is None:
            compression = y.copy()
    return y[:3]
