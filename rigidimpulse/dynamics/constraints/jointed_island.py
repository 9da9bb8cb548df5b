"""The joints of an island, the bodies they act on, and what joints remember from sub-step to sub-step."""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.model.joint_table import Joints
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import Trajectories, make_trajectories


class JointMemory(NamedTuple):
    """What joints keep from one sub-step to the next, and working memory; n bodies, k rows."""

    angle: np.ndarray  # (k,) last coordinates
    force: np.ndarray  # (k,) N or N m
    active: np.ndarray  # (k,) bool, active rows: rows that are not at one of their bounds
    start_value: np.ndarray  # (k,) coordinate less target at the start of the sub-step
    start_rate: np.ndarray  # (k,)
    end_value: np.ndarray  # (k,) the same at its end
    slack: np.ndarray  # (k,) bool, limits that are not reached
    weight: np.ndarray  # (k,) W of soft rows, see `joint_limits`
    steepness: np.ndarray  # (k,) length of the direction: 1; more for a twist near its singularity
    wrench: np.ndarray  # (n, 6) half of the joints' part of the wrench; the end of the sub-step takes it back
    trial: Trajectories
    end_position: np.ndarray  # (n, 3) at the end of the sub-step; the caller sets it for bodies that are no members
    end_rotation: np.ndarray  # (n, 3, 3)


class JointedIsland(NamedTuple):
    """The joints of an island at one instant."""

    joints: Joints  # of the whole scene
    which: np.ndarray  # (i,) joints of the island
    bodies: BodyState
    rotation: np.ndarray  # (n, 3, 3) the orientations of all bodies as matrices
    members: np.ndarray  # movable bodies of the island
    number: np.ndarray  # (n,) working memory: the number of each member among the members
    memory: JointMemory
    allowed: float  # m or rad, error of a coordinate that counts as closed


def make_memory(joints: Joints, inertia: np.ndarray) -> JointMemory:
    """Memory of joints that have not acted yet; inertia (n, 3), principal moments."""
    k, n = len(joints.coordinate), len(inertia)
    trial = make_trajectories(n)
    trial.inertia[:] = inertia
    hard = (joints.stiffness == np.inf) & (joints.lower == -np.inf) & (joints.upper == np.inf)
    return JointMemory(
        angle=np.zeros(k),
        force=np.zeros(k),
        active=hard,
        start_value=np.zeros(k),
        start_rate=np.zeros(k),
        end_value=np.zeros(k),
        slack=np.zeros(k, bool),
        weight=np.zeros(k),
        steepness=np.ones(k),
        wrench=np.zeros((n, 6)),
        trial=trial,
        end_position=np.zeros((n, 3)),
        end_rotation=np.zeros((n, 3, 3)),
    )


@jit
def count_joint_rows(joints, which):
    """Rows of the joints listed in `which`."""
    count = np.int64(0)
    for j in which:
        count += joints.first[j + 1] - joints.first[j]
    return count
