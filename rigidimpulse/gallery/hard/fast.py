"""Fast bodies: nothing may pass through anything, however fast, thin or spinning.

A body that takes 1 / 60 s to look again misses whatever it crosses in between: a bullet at 1,000 m/s goes 17 m. Impacts here are
smooth or dull and central, so momentum and energy after them are closed forms: with e = 0 both go on with the common speed

    u = (m_a v_a + m_b v_b) / (m_a + m_b)   along the normal,

which holds to rounding: 1e-12 relative. The other side of the option: looking for overlap after each step finds nothing.

Fast spin: a free bar keeps energy and angular momentum; it is turned by 1,000 rad/s x 1 s, so rounding of its angle, and of
what depends on it, is 1e3 x 1e-16 and the bound 1e-12.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.gallery.hard.parts import dull, energy_never_grows, finite, undisturbed
from rigidimpulse.gallery.record import Check, GalleryScene, at_least, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

BULLET_SPEED, PAPER_SPEED = 1000.0, 50.0
BULLET_RADIUS, BULLET_MASS = 0.005, 0.004
PAPER = (1e-4, 0.2, 0.3)
PAPER_MASS = 0.005
BAR = (1.0, 0.02, 0.02)
BAR_SPIN = 1000.0
POST = (0.02, 0.02, 0.5)
BLIND = Accuracy(impact_time="after")


def bullet_and_paper() -> Scene:
    """Return a bullet and a sheet of paper that fly toward each other; they meet off the grid of steps."""
    smooth = dull(0.0)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    bullet = {"position": (-3.0, 0.0, 0.0), "velocity": (BULLET_SPEED, 0.0, 0.0), "mass": BULLET_MASS}
    scene.add(Body("bullet", Shape.sphere(BULLET_RADIUS), material=smooth, **bullet))
    paper = {"position": (3.0, 0.0, 0.0), "velocity": (-PAPER_SPEED, 0.0, 0.0), "mass": PAPER_MASS}
    scene.add(Body("paper", Shape.box(PAPER), material=smooth, **paper))
    return scene


def check_paper(run: Recording) -> list[Check]:
    """Check that the bullet takes the paper along."""
    common = (BULLET_MASS * BULLET_SPEED - PAPER_MASS * PAPER_SPEED) / (BULLET_MASS + PAPER_MASS)
    return _met(run, "bullet", "paper", common, (6.0 - BULLET_RADIUS - 0.5 * PAPER[0]) / (BULLET_SPEED + PAPER_SPEED))


def bullets() -> Scene:
    """Return two bullets of 10 mm that meet head-on."""
    smooth = dull(0.0)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    for name, side, mass in (("bullet", -1.0, BULLET_MASS), ("other", 1.0, 3.0 * BULLET_MASS)):
        velocity = (-side * BULLET_SPEED, 0.0, 0.0)
        scene.add(Body(name, Shape.sphere(BULLET_RADIUS), position=(3.0 * side, 0.0, 0.0), velocity=velocity, mass=mass, material=smooth))
    return scene


def check_bullets(run: Recording) -> list[Check]:
    """Check that they stop each other."""
    return _met(run, "bullet", "other", -0.5 * BULLET_SPEED, (6.0 - 2.0 * BULLET_RADIUS) / (2.0 * BULLET_SPEED))


def bar_and_post() -> Scene:
    """Return a bar that spins at 500 rad/s, pushed towards a thin post that only its ends can meet."""
    steel = dull(0.0, 1.0, 7800.0)
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    scene.add(Body("post", Shape.box(POST), motion="static", position=(0.9, 0.0, 0.0), material=steel))
    velocity, spin = (5.0, 0.0, 0.0), (0.0, 0.0, 0.5 * BAR_SPIN)
    scene.add(Body("bar", Shape.box(BAR), position=(0.0, 0.0, 0.0), velocity=velocity, angular_velocity=spin, material=steel))
    return scene


def check_bar(run: Recording) -> list[Check]:
    """Check that the bar never reaches beyond the post with its centre, and that it is struck away."""
    nearest = 0.9 - run.position("bar")[:, 0].max()
    assert run.ledger is not None
    kinetic = run.ledger.kinetic
    return [
        finite(run),
        at_least("impacts", len(run.impacts), 1, "its ends sweep a circle of 0.5 m, which reaches the post"),
        at_least("centre from the post, m", nearest, 0.3, "a turn takes 0.06 m: the post is met by an end"),
        at_most("energy, relative change", np.ptp(kinetic) / kinetic[0], 1e-12, "e = 1, smooth: kept"),
        undisturbed(run),
    ]


def fast_spin() -> Scene:
    """Return a free bar with three different moments, spun about no axis of its own at 1,000 rad/s."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    spin = BAR_SPIN * np.array([0.6, 0.64, 0.48])
    scene.add(Body("bar", Shape.box((1.0, 0.4, 0.1)), angular_velocity=spin))
    return scene


def check_spin(run: Recording) -> list[Check]:
    """Check what a free body keeps."""
    assert run.ledger is not None
    angular = run.ledger.angular_momentum
    drift = np.linalg.norm(angular - angular[0], axis=1).max() / np.linalg.norm(angular[0])
    kinetic = run.ledger.kinetic
    return [
        finite(run),
        at_most("angular momentum, relative change", drift, 1e-12, "no torque acts"),
        at_most("energy, relative change", np.ptp(kinetic) / kinetic[0], 1e-12, "no work is done"),
    ]


def _met(run: Recording, first: str, second: str, common: float, time: float) -> list[Check]:
    """Return the checks of an inelastic impact at x = the same speed for both, at a known time."""
    faster = max(abs(float(run.velocity(name)[0, 0])) for name in (first, second))
    order = (run.position(second)[:, 0] - run.position(first)[:, 0]).min()
    error = max(abs(float(run.velocity(name)[-1, 0]) - common) for name in (first, second)) / faster
    late = abs(float(run.impacts["time"][0]) - time) / time if len(run.impacts) else math.inf
    return [
        finite(run),
        equal("impacts", len(run.impacts), 1, "they meet once and go on together"),
        at_least("order along the line, m", order, 0.0, "nothing passes through anything"),
        at_most("common speed, relative error", error, 1e-12, "(m_a v_a + m_b v_b) / (m_a + m_b)"),
        at_most("error of the time, relative", late, 1e-9, "gap over speed; faces meet at 1e-10 of the size"),
        energy_never_grows(run, 0.0),
        undisturbed(run),
    ]


SCENES = (
    GalleryScene(
        "bullet_and_paper", "A bullet of 1,000 m/s and a sheet of 0.1 mm, both moving", bullet_and_paper, check_paper, 0.05,
        cheaper=BLIND, elsewhere="300 m/s at a resting 1 mm wall, passed of 20: MuJoCo, PyBullet, Rapier, Jolt 0; PhysX, ODE 20",
    ),
    GalleryScene("bullet_and_bullet", "Two bullets meet at 2,000 m/s", bullets, check_bullets, 0.05, cheaper=BLIND),
    GalleryScene("fast_bar", "A bar of 500 rad/s is struck away by a post", bar_and_post, check_bar, 0.5, 240.0, cheaper=BLIND),
    GalleryScene("fast_spin", "A free body tumbles at 1,000 rad/s", fast_spin, check_spin, 1.0),
)  # fmt: skip
