"""Real tosses: an acrylic cube thrown on a board, recorded at 148 Hz, and the same throws simulated.

The data are 120 tosses of Pfrommer, Halm & Posa 2020 (ContactNets: Learning Discontinuous Contact Dynamics with Smooth,
Implicit Representations). Their lengths read 2.1 % short: free fall measures 9.61 m/s^2, the cube rests at 51.3 mm. Here
lengths stay as recorded, with g = 9.61 and half width h = 0.0513.

A roll-out starts 3 frames before frame n, the first at which the lowest corner of the recorded cube can touch:

    z - h (|R_zx| + |R_zy| + |R_zz|) < 1 mm.

Its initial state is the flight that fits the frames 0 ... n - 1 best. The inertia of a cube is spherical, so exactly

    x(t) = x0 + v0 t + g t^2 / 2,     q(t) = exp(w0 t) q0,

and x0, v0 (a linear problem) and q0, w0 (a nonlinear one) minimise the sums of |x_i - x(t_i)|^2 and |log(q_i q(t_i)^-1)|^2.
The errors of a roll-out x(t), q(t) against the recorded frames from the start on are

    mean |x - x_i| / 0.1048,     mean angle(q, q_i),

0.1048 m the width of the cube. That a cube looks the same in 24 orientations is not used: landing on another face counts
as an error of 90 degrees or more.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import angle_between, conjugate, multiply, quaternion_from_rotation_vector, rotation_vector, to_matrix
from rigidimpulse.gallery.record import Check, Exact, GalleryScene, asset_path, at_most
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

FPS = 148.0
GRAVITY = 9.61
HALF_WIDTH = 0.0513
"""Of the cube, in lengths as recorded, m."""
WIDTH = 0.1048
"""Of the cube as its makers state it: the unit of position errors, m."""
MASS = 0.37
INERTIA = 8.1e-4
"""About any axis, as the makers state it, kg m^2."""
TOUCH = 1e-3
"""Height of the lowest corner below which it may touch, m."""
DIGITS = 9
"""Decimals of the state at the start of a roll-out."""
LEAD = 3
"""Frames from the start to the first that may touch."""
NOISE = 6e-5
"""m: what is left of a free flight after the fit."""
SHOWN = 5
"""The toss of the gallery scene: one of the half that was not fitted to, with errors below the mean of that half."""
DURATION = 81 / FPS
"""From the start of that toss to its last frame, s."""
BESIDE = 0.3
"""How far beside the simulated cube the recorded one is shown, m."""


class Toss(NamedTuple):
    """One recorded toss: number in the source, position (f, 3) [m] of the centre, orientation (f, 4) wxyz."""

    number: int
    position: np.ndarray
    orientation: np.ndarray


class Flight(NamedTuple):
    """State at frame `start`: position (3,) [m], orientation (4,), velocity (3,) [m/s], spin (3,) [rad/s, world axes]."""

    start: int
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray


class Cube(NamedTuple):
    """What is fitted: friction, restitution; and what may be varied: moment of inertia [kg m^2], radius of the corners [m].

    Against a board only the corners count. With a radius they are balls, and the cube is nothing else.
    """

    friction: float
    restitution: float
    inertia: float = INERTIA
    corner_radius: float = 0.0


FITTED = Cube(0.185, 0.08)
"""Friction and restitution fitted on the tosses of even index (tests/bench/fit_tosses.py)."""


@cache
def load_tosses() -> tuple[Toss, ...]:
    """Return the 120 recorded tosses.

    Raises:
        SceneError: the file is missing.

    """
    with np.load(asset_path("cube_tosses.npz", "tosses"), allow_pickle=False) as data:
        state, start, numbers = np.asarray(data["state"], dtype=np.float64), data["start"], data["ids"]
    return tuple(
        Toss(int(number), state[a:b, :3], state[a:b, 3:7])
        for number, a, b in zip(numbers, start[:-1], start[1:], strict=True)
    )


def first_touch(toss: Toss) -> int:
    """Return the first frame at which the lowest corner may touch the board."""
    up = to_matrix(toss.orientation)[:, 2, :]
    lowest = toss.position[:, 2] - HALF_WIDTH * np.abs(up).sum(axis=1)
    return int(np.argmax(lowest < TOUCH))


def flight(toss: Toss) -> Flight:
    """Return the state at the start of the roll-out, from a fit of all frames before the first touch."""
    from scipy.optimize import least_squares

    end = first_touch(toss)
    start = max(end - LEAD, 0)
    t = ((np.arange(end) - start) / FPS)[:, None]
    straight = toss.position[:end] + 0.5 * GRAVITY * t**2 * np.array([0.0, 0.0, 1.0])
    (position, velocity), *_ = np.linalg.lstsq(np.hstack([np.ones_like(t), t]), straight, rcond=None)
    measured = toss.orientation[:end]

    def path(unknown: np.ndarray) -> np.ndarray:
        at_start = multiply(quaternion_from_rotation_vector(unknown[:3]), measured[start])
        return multiply(quaternion_from_rotation_vector(t * unknown[3:]), at_start)

    def residual(unknown: np.ndarray) -> np.ndarray:
        return rotation_vector(multiply(measured, conjugate(path(unknown)))).ravel()

    turned = rotation_vector(multiply(measured[-1], conjugate(measured[0]))) / float(t[-1, 0] - t[0, 0])
    unknown = least_squares(residual, np.concatenate([np.zeros(3), turned])).x
    # Least squares call LAPACK, whose last digits depend on the processor; the data have six.
    unknown, position, velocity = (np.round(values, DIGITS) for values in (unknown, position, velocity))
    return Flight(start, position, path(unknown)[start], velocity, unknown[3:])


def toss_scene(state: Flight, cube: Cube = FITTED) -> Scene:
    """Return board and cube at the start of a roll-out.

    Raises:
        SceneError: when the scene is compiled, for a `cube` without physical meaning.

    """
    shape = Shape.box((2.0 * HALF_WIDTH,) * 3)
    if cube.corner_radius > 0.0:
        ball, at = Shape.sphere(cube.corner_radius), HALF_WIDTH - cube.corner_radius
        corners = [(x, y, z) for x in (-at, at) for y in (-at, at) for z in (-at, at)]
        shape = Shape.compound([(ball, corner, (1.0, 0.0, 0.0, 0.0)) for corner in corners])
    acrylic = Material(restitution=cube.restitution, static_friction=cube.friction, dynamic_friction=cube.friction)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("board", Shape.half_space(), motion="static"))
    scene.add(
        Body(
            "cube", shape, position=state.position, orientation=state.orientation, velocity=state.velocity,
            angular_velocity=state.angular_velocity, mass=MASS, inertia=(cube.inertia,) * 3,
            center_of_mass=(0.0, 0.0, 0.0), material=acrylic,
        )
    )  # fmt: skip
    return scene


def roll_out(toss: Toss, cube: Cube = FITTED, state: Flight | None = None) -> tuple[Flight, Recording]:
    """Simulate a toss from its start to its last frame, at the frames of the recording.

    Args:
        toss: the recorded one.
        cube: parameters of the simulated one.
        state: where it starts; by default the fit of its flight.

    Returns:
        The state at the start and the run.

    """
    from rigidimpulse.engine.simulate import simulate

    state = flight(toss) if state is None else state
    return state, simulate(toss_scene(state, cube), (len(toss.position) - 1 - state.start) / FPS, FPS)


def errors(toss: Toss, state: Flight, run: Recording) -> tuple[float, float]:
    """Return the mean position error, in widths of the cube, and the mean rotation error [rad] of a roll-out."""
    away = np.linalg.norm(run.position("cube") - toss.position[state.start :], axis=1)
    turned = angle_between(run.orientation("cube"), toss.orientation[state.start :])
    return float(away.mean()) / WIDTH, float(turned.mean())


def scene() -> Scene:
    """Return board, simulated cube, and the recorded one beside it; steps end at its keyframes, which moves the run by some millimetres."""
    toss = load_tosses()[SHOWN]
    state = flight(toss)
    scene = toss_scene(state)
    position, orientation = toss.position[state.start :] + _aside(toss), toss.orientation[state.start :]
    keyframes = Keyframes(np.arange(len(position)) / FPS, position, orientation)
    shape = Shape.box((2.0 * HALF_WIDTH,) * 3)
    scene.add(Body("recorded", shape, motion="kinematic", position=position[0], orientation=orientation[0], keyframes=keyframes))
    return scene


def _aside(toss: Toss) -> np.ndarray:
    """Return the way (3,) from the cube to where its recording is shown: level, across the direction of the toss."""
    x, y, _ = toss.position[-1] - toss.position[0]
    return BESIDE * np.array([-y, x, 0.0]) / np.hypot(x, y)


def check(run: Recording) -> list[Check]:
    """Compare with the recorded toss, at any frame rate."""
    toss = load_tosses()[SHOWN]
    away = run.position("cube") + _aside(toss) - run.position("recorded")
    turned = np.degrees(angle_between(run.orientation("cube"), run.orientation("recorded")))
    law = "the recorded cube"
    return [
        at_most("mean position error, widths", float(np.linalg.norm(away, axis=1).mean()) / WIDTH, 0.12, law),
        at_most("mean rotation error, degrees", float(turned.mean()), 15.0, law),
    ]


def alone() -> Scene:
    """Return board and simulated cube of the toss that is shown."""
    return toss_scene(flight(load_tosses()[SHOWN]))


def measured(times: np.ndarray) -> Exact:
    """Return the recorded motion, at the frames of the recording.

    Raises:
        SceneError: the times are none of its frames.

    """
    toss = load_tosses()[SHOWN]
    frames = np.round(times * FPS).astype(int)
    if np.abs(times * FPS - frames).max() > 1e-6 or flight(toss).start + frames[-1] >= len(toss.position):
        raise SceneError("the toss is recorded at other times", f"run it for at most {DURATION:.3f} s, at {FPS:g} frames per second")
    frames += flight(toss).start
    return Exact({"cube": toss.position[frames]}, {"cube": toss.orientation[frames]}, noise=NOISE)


def check_alone(run: Recording) -> list[Check]:
    """Compare with the recorded toss."""
    toss = load_tosses()[SHOWN]
    away, turned = errors(toss, flight(toss), run)
    return [
        at_most("mean position error, widths", away, 0.12, "the recorded cube"),
        at_most("mean rotation error, degrees", float(np.degrees(turned)), 15.0, "the recorded cube"),
    ]


SCENES = (
    GalleryScene("toss", "A cube is thrown on a board, beside the recording of the same throw", scene, check, DURATION, FPS),
    GalleryScene(
        "toss_alone", "The same throw without its recording, which is what a study compares it with", alone, check_alone, DURATION, FPS,
        exact=measured, elsewhere="mean errors over 120 tosses, best fits: Bullet 14.5 % of the width, 16.3 degrees, MuJoCo 27.6 %, 21.4",
    ),
)  # fmt: skip
