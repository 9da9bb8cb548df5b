"""Draw the pictures of the theory pages from their formulas: `python docs/theory/make_pictures.py`. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.special import ellipj

FOLDER = Path(__file__).resolve().parent / "pictures"
BLUE, RED, GREEN, GREY = "#2f6fb2", "#b23a48", "#3b8a5a", "#8a8f98"


def save(figure: plt.Figure, name: str) -> None:
    """Write a picture, small."""
    FOLDER.mkdir(exist_ok=True)
    figure.tight_layout()
    figure.savefig(FOLDER / f"{name}.png", dpi=90)
    plt.close(figure)


def free_rotation() -> None:
    """Spin about the three principal axes by Jacobi's functions, near the middle axis."""
    moments, spin = np.array([1.0, 2.0, 3.0]), np.array([0.02, 3.0, 0.02])
    energy, squared = moments @ spin**2, (moments * spin) @ (moments * spin)
    largest, middle, least = moments[2], moments[1], moments[0]
    if squared < energy * middle:
        largest, least = least, largest
    a = np.sqrt((squared - energy * least) / (largest * (largest - least)))
    b = np.sqrt((squared - energy * largest) / (middle * (middle - largest)))
    c = np.sqrt((squared - energy * largest) / (least * (least - largest)))
    rate = np.sqrt((largest - middle) * (squared - energy * least) / (moments.prod()))
    parameter = (middle - least) * (energy * largest - squared) / ((largest - middle) * (squared - energy * least))
    times = np.linspace(0.0, 30.0, 1200)
    sn, cn, dn, _ = ellipj(rate * times, parameter)
    figure, axes = plt.subplots(figsize=(6.4, 2.6))
    for values, colour, name in ((b * sn, RED, "middle axis, sn"), (c * cn, BLUE, "cn"), (a * dn, GREEN, "dn")):
        axes.plot(times, values, color=colour, label=name)
    axes.set(xlabel="time, s", ylabel="spin, rad/s")
    axes.legend(loc="upper right", fontsize=8)
    save(figure, "free_rotation")


def impact() -> None:
    """Normal velocity over normal impulse for one contact point without friction."""
    mass, approach, restitution = 1.0, 2.0, 0.5
    end = (1.0 + restitution) * mass * approach
    impulse = np.linspace(0.0, end, 100)
    speed = -approach + impulse / mass
    figure, axes = plt.subplots(figsize=(6.4, 2.6))
    axes.plot(impulse, speed, color=BLUE)
    axes.fill_between(impulse, speed, 0.0, where=speed <= 0.0, color=RED, alpha=0.25, label="work of compression")
    axes.fill_between(impulse, speed, 0.0, where=speed >= 0.0, color=GREEN, alpha=0.3, label="work of restitution")
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set(xlabel="normal impulse p, N s", ylabel="normal velocity, m/s")
    axes.legend(fontsize=8)
    save(figure, "impact")


def friction() -> None:
    """Friction of a block that is pushed: stick below the cone, slip on it."""
    pushed = np.linspace(0.0, 1.2, 200)
    static, dynamic = 0.6, 0.5
    figure, axes = plt.subplots(figsize=(6.4, 2.6))
    axes.plot(pushed[pushed <= static], pushed[pushed <= static], color=BLUE, label="stick")
    axes.plot(pushed[pushed > static], np.full(np.count_nonzero(pushed > static), dynamic), color=RED, label="slip")
    axes.axhline(static, color=GREY, linestyle=":", linewidth=1.0)
    axes.text(1.0, static + 0.02, "static friction", fontsize=8, color=GREY)
    axes.set(xlabel="tangential load over normal force", ylabel="friction over normal force", ylim=(0.0, 0.8))
    axes.legend(fontsize=8, loc="lower right")
    save(figure, "friction")


def safe_step() -> None:
    """Gap of a turning box over a plane, and the cubic lower bounds whose roots are safe steps."""
    half, spin, speed, start, gravity = 0.5, 4.0, 0.6, 1.25, 9.81

    def height(time: np.ndarray) -> np.ndarray:
        return start - speed * time - 0.5 * gravity * time**2

    def gap(time: np.ndarray) -> np.ndarray:
        return height(time) - half * (np.abs(np.cos(spin * time)) + np.abs(np.sin(spin * time)))

    reach = half * np.sqrt(2.0)
    times = np.linspace(0.0, 0.36, 400)
    figure, axes = plt.subplots(figsize=(6.4, 2.8))
    axes.plot(times, gap(times), color=BLUE, label="gap")
    now = 0.0
    for _ in range(6):
        corners = np.pi / 4.0 + np.arange(4) * np.pi / 2.0 + spin * now
        spans = np.linspace(0.0, 0.36 - now, 2000)
        bounds = [
            height(now) - (speed + gravity * now) * spans - 0.5 * gravity * spans**2
            + reach * (np.sin(c) + np.cos(c) * spin * spans - 0.5 * np.sin(c) * (spin * spans) ** 2 - (spin * spans) ** 3 / 6.0)
            for c in corners
        ]  # fmt: skip
        bound = np.min(bounds, axis=0)
        below = np.flatnonzero(bound <= 1e-4)
        last = below[0] if len(below) else len(spans) - 1
        axes.plot(now + spans[: last + 1], bound[: last + 1], color=RED, linewidth=1.0, label="lower bounds" if now == 0.0 else None)
        axes.axvline(now + spans[last], color=GREY, linewidth=0.5)
        now += spans[last]
        if spans[last] < 1e-4:
            break
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set(xlabel="time, s", ylabel="gap, m", ylim=(-0.1, 0.8))
    axes.legend(fontsize=8)
    save(figure, "safe_step")


def penalty() -> None:
    """Restitution of a spring and damper that do not pull, and of ones that do."""
    ratio = np.linspace(0.0, 0.98, 200)
    root = np.sqrt(1.0 - ratio**2)
    figure, axes = plt.subplots(figsize=(6.4, 2.6))
    axes.plot(ratio, np.exp(-ratio * (np.pi - 2.0 * np.arcsin(ratio)) / root), color=BLUE, label="nothing pulls (here)")
    axes.plot(ratio, np.exp(-np.pi * ratio / root), color=RED, linestyle="--", label="the damper pulls (textbook)")
    axes.set(xlabel="damping ratio z", ylabel="restitution e", ylim=(0.0, 1.0))
    axes.legend(fontsize=8)
    save(figure, "penalty")


if __name__ == "__main__":
    for draw in (free_rotation, impact, friction, safe_step, penalty):
        draw()
