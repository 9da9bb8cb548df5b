"""Pool shots (B15): aim at the ghost ball, follow, draw and swerve.

A ball of radius R slides on the cloth with friction mu. With v its velocity, q = R w x z the velocity at which its spin would roll, the
slip is

    u = v - q,    v' = -mu g u/|u|,    q' = (5/2) mu g u/|u|

so u keeps its direction: the path is a parabola until t = 2 |u| / (7 mu g), when the ball rolls straight on with v - (2/7) u. Balls are
smooth to each other: an impact along the line of centres d changes velocities alone,

    object ball (1 + e)/2 (v.d) d,    cue ball v - (1 + e)/2 (v.d) d

so the object ball leaves along d: it goes to the pocket if the cue ball strikes it from the ghost ball, the place 2 R behind it on the
line from the pocket. What the cue ball does then follows from the spin it still has: rolling it follows, with backspin it comes back, and
with spin about its own way (masse) it swerves already before.

Between events paths are polynomials and errors those of rounding and of the equations of contact, 1e-12; balls lie on a contact margin of
1e-6 of their size, which the lever arms do not feel. An error of the impact's time of 1e-12 s turns the line of centres by v 1e-12 / 2 R =
4e-11, over a metre 4e-11 m. Errors before the impact grow by some ten in a thin cut, so 1e-9 m and m/s is the bound. A ball that rolls at
once, or an impact with a friction of 0.01 between the balls, is off by 1e-2 m.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from rigidimpulse.gallery.pool_table import CUE, OBJECT, POCKETS, RADIUS, RESTITUTION, add_ball, in_pocket, table
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.scene import Scene

GRAVITY, CLOTH = 9.81, 0.2
BOUND = 1e-9
MOUTH = 0.12
"""m from the middle of a pocket, where the paths of balls that go into it are compared no more."""


@dataclass(frozen=True)
class Shot:
    """Where the balls are, (2,) m, how the cue ball starts, v and q (2,) m/s, the pocket's name, and a ball in the way if there is one."""

    cue: np.ndarray
    ball: np.ndarray
    velocity: np.ndarray
    rolling: np.ndarray
    pocket: str
    blocker: np.ndarray | None = None


def unit(vector: np.ndarray) -> np.ndarray:
    """Return the vector with length 1."""
    return vector / np.linalg.norm(vector)


def ghost(ball: np.ndarray, pocket: str) -> np.ndarray:
    """Return the place (2,) from which a ball is struck so that it goes to the pocket."""
    return ball - 2.0 * RADIUS * unit(POCKETS[pocket] - ball)


def aim() -> Shot:
    """A cut: the cue ball rolls to the ghost ball."""
    cue, ball = np.array([-0.5, -0.28]), np.array([0.35, 0.05])
    velocity = 1.6 * unit(ghost(ball, "right far") - cue)
    return Shot(cue, ball, velocity, velocity, "right far")


def straight(pocket: str, speed: float, spin: float) -> Shot:
    """A straight shot: cue ball, object ball and pocket in line; q = spin v."""
    ball = np.array([0.1, -0.05 * np.sign(POCKETS[pocket][1])])
    way = unit(POCKETS[pocket] - ball)
    return Shot(ball - 0.45 * way, ball, speed * way, spin * speed * way, pocket)


def swerve() -> Shot:
    """A masse: the cue ball goes round a ball in its way, rolls on and meets the object ball at the ghost ball."""
    cue, velocity, rolling = np.array([-0.62, -0.33]), np.array([1.35, 1.45]), np.array([1.08, -2.7])
    slip = velocity - rolling
    time = slide_time(slip)
    place, speed = advance(cue, velocity, rolling, time)[0], velocity - 2.0 / 7.0 * slip
    struck_from = place + 0.22 * unit(speed)
    ball = struck_from + 2.0 * RADIUS * unit(POCKETS["right far"] - struck_from)
    return Shot(cue, ball, velocity, rolling, "right far", blocker=np.array([-0.2, -0.095]))


def slide_time(slip: np.ndarray) -> float:
    """Return how long a ball slides, s."""
    return 2.0 * float(np.linalg.norm(slip)) / (7.0 * CLOTH * GRAVITY)


def advance(place: np.ndarray, v: np.ndarray, q: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return place, v and q (2,) of a ball on the cloth after a time, s."""
    slip = v - q
    end = slide_time(slip)
    if end == 0.0:
        return place + v * time, v, q
    t = min(time, end)
    slowing = CLOTH * GRAVITY * unit(slip)
    later = v - slowing * t
    return place + v * t - 0.5 * slowing * t**2 + later * (time - t), later, q + 2.5 * slowing * t


def meeting(shot: Shot) -> float:
    """Return when the cue ball touches the object ball, s."""
    from scipy.optimize import root_scalar

    def gap(t: float) -> float:
        return float(np.linalg.norm(shot.ball - advance(shot.cue, shot.velocity, shot.rolling, t)[0])) - 2.0 * RADIUS

    times = np.linspace(0.0, 4.0, 4001)
    first = next(k for k, t in enumerate(times) if gap(t) < 0.0)
    return float(root_scalar(gap, bracket=(times[first - 1], times[first]), xtol=1e-15, rtol=1e-15).root)


def scene(make: Callable[[], Shot]) -> Scene:
    """Return the table with the balls of a shot."""
    shot, scene = make(), table(GRAVITY, CLOTH)
    add_ball(scene, CUE, shot.cue, shot.velocity, shot.rolling)
    add_ball(scene, OBJECT, shot.ball)
    if shot.blocker is not None:
        add_ball(scene, "ball in the way", shot.blocker)
    return scene


def check(make: Callable[[], Shot], law: str, run: Recording) -> list[Check]:
    """Compare the impact, both paths and the last velocity of the cue ball with the closed forms."""
    shot = make()
    time = meeting(shot)
    place, v, q = advance(shot.cue, shot.velocity, shot.rolling, time)
    line = unit(shot.ball - place)
    given = 0.5 * (1.0 + RESTITUTION) * (v @ line) * line
    left = v - given
    balls = [run.index(name) for name in run.names if "ball" in name]
    strokes = run.impacts[np.isin(run.impacts["body_a"], balls) & np.isin(run.impacts["body_b"], balls)]
    # The normal goes from body a to body b.
    centres = strokes["normal"][0, :2] * (1.0 if strokes["body_b"][0] == run.index(OBJECT) else -1.0)
    cue = np.array(
        [advance(shot.cue, shot.velocity, shot.rolling, t)[0] if t < time else advance(place, left, q, t - time)[0] for t in run.times]
    )
    ball = np.array([shot.ball if t < time else advance(shot.ball, given, np.zeros(2), t - time)[0] for t in run.times])
    towards = np.linalg.norm(ball - POCKETS[shot.pocket], axis=1)
    free = np.arange(len(towards)) < (np.argmax(towards < MOUTH) or len(towards))
    aside = _angle(centres, POCKETS[shot.pocket] - shot.ball)
    cue_error = np.linalg.norm(run.position(CUE)[:, :2] - cue, axis=1).max()
    ball_error = np.linalg.norm(run.position(OBJECT)[free, :2] - ball[free], axis=1).max()
    speed_error = float(np.linalg.norm(run.velocity(CUE)[-1, :2] - (left - 2.0 / 7.0 * (left - q))))
    potted = in_pocket(run.position(OBJECT)[-1], shot.pocket)
    return [
        equal("impacts of balls", len(strokes), 1, "cue ball on object ball"),
        at_most("error of its time, s", abs(strokes["time"][0] - time), BOUND, "parabola, then a straight line"),
        at_most("line of centres from that to the pocket, rad", abs(aside), BOUND, "ghost ball"),
        at_most("error of the cue ball's path, m", cue_error, BOUND, law),
        at_most("error of its last velocity, m/s", speed_error, BOUND, "v - (2/7) u"),
        at_most("error of the object ball's path, m", ball_error, BOUND, "along d"),
        equal("object ball in the pocket", int(potted), 1, "the struck ball leaves along the line of centres"),
    ]


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Return the angle between two vectors (2,), rad."""
    return math.atan2(one[0] * other[1] - one[1] * other[0], float(one @ other))


def _entry(name: str, description: str, make: Callable[[], Shot], law: str, duration: float) -> GalleryScene:
    options: dict[str, Any] = {"scene": partial(scene, make), "check": partial(check, make, law)}
    return GalleryScene(name, f"Pool: {description}", duration=duration, **options)


SCENES = (
    _entry("pool_aim", "a cut shot, aimed at the ghost ball", aim, "u = v - q after the impact: a parabola", 1.3),
    _entry("pool_follow", "the cue ball rolls and follows", partial(straight, "right far", 1.6, 1.0), "u is backward: it goes on", 1.6),
    _entry(
        "pool_draw", "backspin brings the cue ball back", partial(straight, "right near", 2.0, -1.8), "u is forward: it comes back", 1.15
    ),
    _entry("pool_swerve", "the cue ball swerves round a ball", swerve, "parabola until 2 |u| / (7 mu g)", 1.6),
)
