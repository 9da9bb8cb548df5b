"""How wrong a run is, against a reference.

    position     largest |x - x_ref| of the bodies compared, over all frames until a time, m
    angle        largest angle of q q_ref^-1 of the same, rad
    energy       largest |E - E_ref| of the mechanical energy, over the most that moved: max kinetic + range of potential
    impact_time  largest |t_i - t_i,ref| over the impacts until the time, matched in their order, s
    impacts      number of impacts less that of the reference until the time
    penetration  deepest that two bodies are inside each other in a frame, m (see `penetration`)

What is not told by the reference or by the run is NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.core.quaternion import angle_between, multiply, rotate
from rigidimpulse.model.world import World
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.ledger import Masses, make_ledger
from rigidimpulse.recording.recorder import Frames
from rigidimpulse.recording.recording import Recording

MOST_FRAMES = 120
"""Frames at most in which penetration is looked for, evenly spread."""
HALVINGS = 12
"""Of the least way out of an overlap: three digits."""

Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,) m and orientation (4,) wxyz."""


class Errors(NamedTuple):
    """Error measures of one run until one time; see the head of the module."""

    position: float
    angle: float
    energy: float
    impact_time: float
    impacts: float
    penetration: float


@dataclass(frozen=True, eq=False)
class Truth:
    """What runs are compared with, at the frames (f,) s.

    Attributes:
        position: (f, n, 3) m, NaN for bodies that are not compared. orientation: (f, n, 4), the same.
        energy: (f,) J, or None. scale: J, the most that moved.
        impacts: (k,) s, or None.

    """

    times: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    energy: np.ndarray | None
    scale: float
    impacts: np.ndarray | None


def truth_of(world: World, run: Recording) -> Truth:
    """A run as what others are compared with: its dynamic bodies, its impacts if it lists them."""
    still = ~world.dynamic
    position, orientation = run.positions.copy(), run.orientations.copy()
    position[:, still], orientation[:, still] = np.nan, np.nan
    energy, scale = mechanical_energy(world, run)
    return Truth(run.times, position, orientation, energy, scale, run.impacts["time"] if run.impacts.dtype.names else None)


def mechanical_energy(world: World, run: Recording) -> tuple[np.ndarray, float]:
    """Energy (f,) of the dynamic bodies, J, and the most that moved, J. Recordings without a ledger have gravity's potential alone."""
    ledger = run.ledger
    if ledger is None:
        ledger = make_ledger(
            Frames(run.times, run.centers, multiply(run.orientations, world.turn), run.velocities, run.angular_velocities),
            Masses(np.where(world.dynamic, world.mass, 0.0), world.inertia, world.steady_acceleration),
            EventLog(),
        )
    return ledger.total, float(ledger.kinetic.max() + np.ptp(ledger.potential))


def measure(world: World, run: Recording, truth: Truth, until: float, deep: np.ndarray) -> Errors:
    """Compare a run with the truth, in the frames until a time [s]; deep: (f,) m of the run, see `penetration`."""
    seen = truth.times <= until
    distance = np.linalg.norm(run.positions[seen] - truth.position[seen], axis=2)
    turn = angle_between(run.orientations[seen], np.nan_to_num(truth.orientation[seen]))
    turn[~np.isfinite(truth.orientation[seen]).all(axis=2)] = np.nan
    known = np.isfinite(truth.position[seen])[:, :, 0]
    distance[known & ~np.isfinite(distance)] = np.inf
    energy = np.nan
    if truth.energy is not None and truth.scale > 0.0:
        own = mechanical_energy(world, run)[0]
        change = (own - own[0])[seen] - (truth.energy - truth.energy[0])[seen]
        energy = float(np.abs(change).max()) / truth.scale
    late, surplus = _compare_impacts(run, truth, until)
    return Errors(_largest(distance), _largest(turn), energy, late, surplus, _largest(deep[seen]))


def _compare_impacts(run: Recording, truth: Truth, until: float) -> tuple[float, float]:
    """Largest error of an impact's time, s, and surplus of impacts."""
    if truth.impacts is None or run.impacts.dtype.names is None:
        return np.nan, np.nan
    expected = truth.impacts[truth.impacts <= until]
    # One that comes a little late is one of the expected all the same.
    found = np.sort(run.impacts["time"])
    surplus = float(np.count_nonzero(found <= until) - len(expected))
    number = min(len(found), len(expected))
    late = float(np.abs(found[:number] - expected[:number]).max()) if number else np.nan
    return late, surplus


def _largest(values: np.ndarray) -> float:
    """The largest of what is told."""
    told = values[~np.isnan(values)]
    return float(told.max()) if len(told) else np.nan


def penetration(world: World, run: Recording, most_frames: int = MOST_FRAMES) -> np.ndarray:
    """Depth (f,) m by which the deepest pair of bodies is inside each other in each frame; NaN in frames left out.

    Exact for balls, capsules and half spaces; else the least way out along the axes of either body and the line of their centres, an upper
    bound, to three digits. Pairs that cannot touch in the scene (jointed ones, say) are left out.

    Args:
        world: the compiled scene. run: its motion.
        most_frames: frames that are looked at, evenly spread.

    """
    depth = np.full(len(run.times), np.nan)
    chosen = np.unique(np.linspace(0, len(run.times) - 1, most_frames).astype(int))
    depth[chosen] = 0.0
    narrowphase = Narrowphase(world.shapes, world.geometry)
    a, b = np.triu_indices(world.num_bodies, 1)
    wanted = (world.dynamic[a] | world.dynamic[b]) & ~np.isin(a * world.num_bodies + b, world.apart)
    a, b = a[wanted], b[wanted]
    for f in chosen.tolist():
        centers = run.centers[f]
        axes = multiply(run.orientations[f], world.turn)
        if not (np.all(np.isfinite(centers)) and np.all(np.isfinite(axes))):
            continue
        near = np.linalg.norm(centers[b] - centers[a], axis=1) < world.bound_radius[a] + world.bound_radius[b]
        for i, j in zip(a[near].tolist(), b[near].tolist(), strict=True):
            depth[f] = max(depth[f], _depth(world, narrowphase, i, (centers[i], axes[i]), j, (centers[j], axes[j])))
    return depth


def _depth(world: World, narrowphase: Narrowphase, i: int, pose_i: Pose, j: int, pose_j: Pose) -> float:
    """Depth of a pair, 0 if it is apart, m."""
    shapes = int(world.shape_of_body[i]), int(world.shape_of_body[j])
    found = narrowphase.separation(shapes[0], pose_i, shapes[1], pose_j)
    if found.gap > 0.0 or np.all(np.isfinite(found.normal)):
        return max(-found.gap, 0.0)
    directions = [pose_j[0] - pose_i[0]]
    for pose in (pose_i, pose_j):
        directions += [sign * rotate(pose[1], axis) for axis in np.eye(3) for sign in (1.0, -1.0)]
    least = float(min(world.size[i], world.size[j]))
    for direction in directions:
        length = float(np.linalg.norm(direction))
        if length > 0.0:
            least = min(least, _way_out(narrowphase, shapes, (pose_i, pose_j), direction / length, least))
    return least


def _way_out(narrowphase: Narrowphase, shapes: tuple[int, int], poses: tuple[Pose, Pose], direction: np.ndarray, most: float) -> float:
    """Least way along a direction after which a pair is apart, m; inf if it is longer than `most`."""

    pose_i, (position_j, orientation_j) = poses

    def inside(way: float) -> bool:
        return narrowphase.overlap(shapes[0], pose_i, shapes[1], (position_j + way * direction, orientation_j))

    low, high = 0.0, most
    if inside(high):
        return np.inf
    # Shallow overlaps are the rule: come down by powers of ten first.
    while high > 1e-12 * most and not inside(0.1 * high):
        high *= 0.1
    low = 0.1 * high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if inside(middle) else (low, middle)
    return high
