"""Pairs of bodies on their trajectories, to be swept, and the gap along their paths."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from contact_scenes import box, capsule, half_space, mesh, prism, sphere

from rigidimpulse.collision.geometry import CYLINDER, CompiledShape, Primitive, build_geometry
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.collision.time_of_impact import bisection, conservative
from rigidimpulse.collision.time_of_impact.result import IMPACT, SEPARATE, PairsToSweep
from rigidimpulse.collision.time_of_impact.safe_step import make_scratch
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, PRESCRIBED, begin, make_trajectories, pose_at

ROUND_OFF = 1e-13
STEP = 1.0 / 60.0


def cylinder(radius, height):
    return Primitive(CYLINDER, radius, frame=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5 * height]))


def shape(*primitives):
    return CompiledShape(primitives)


SHAPES = {
    "sphere": shape(sphere(0.5)),
    "ball": shape(sphere(0.05)),
    "box": shape(mesh(box(1.0, 0.6, 0.4))),
    "needle": shape(mesh(box(3.0, 0.01, 0.01))),
    "capsule": shape(capsule(0.2, 1.0)),
    "cylinder": shape(cylinder(0.4, 0.8)),
    "disc": shape(cylinder(0.5, 0.02)),
    "hull": shape(mesh(trimesh.convex.convex_hull(np.random.default_rng(1).normal(size=(14, 3)) * 0.4))),
    "notch": shape(mesh(prism([(-0.5, -0.5), (0.5, -0.5), (0.5, -0.1), (-0.1, -0.1), (-0.1, 0.5), (-0.5, 0.5)], 0.5))),
    "half space": shape(half_space()),
    "compound": shape(sphere(0.3, at=(0.5, 0.0, 0.0)), cylinder(0.2, 1.0), capsule(0.1, 1.6)),
}
GEOMETRY = build_geometry(list(SHAPES.values()))
SCRATCH = make_scratch(GEOMETRY)
NAMES = list(SHAPES)


class Pair:
    """Two bodies on their trajectories; body 0 is fixed at the origin unless set otherwise."""

    def __init__(self, name_a, name_b, geometry=GEOMETRY, scratch=SCRATCH, names=NAMES):
        self.shapes = names.index(name_a), names.index(name_b)
        self.detector = SimpleNamespace(
            geometry=geometry, shape_of_body=np.array(self.shapes, dtype=np.int64), sweep_scratch=scratch, max_queries=10_000
        )
        self.trajectory = make_trajectories(2)

    def set(self, body, mode, position=(0, 0, 0), velocity=(0, 0, 0), spin=(0, 0, 0), turned=(1, 0, 0, 0), **rows):
        trajectory = self.trajectory
        trajectory.mode[body] = mode
        trajectory.position[body], trajectory.velocity[body], trajectory.angular_velocity[body] = position, velocity, spin
        trajectory.orientation[body] = np.array(turned) / np.linalg.norm(turned)
        for name, value in rows.items():
            getattr(trajectory, name)[body] = value
        begin(trajectory, body)
        return self

    def sweep(self, method=bisection, end=STEP, impact_margin=1e-6, tolerance=1e-15, start=0.0, swapped=False):
        """(time, status, queries, witness) of the pair."""
        rows = [np.array([float(value)]) for value in (start, impact_margin, tolerance, end)]
        pairs = PairsToSweep(np.array([int(swapped)]), np.array([int(not swapped)]), *rows)
        result = method.sweep(self.detector, self.trajectory, pairs, end)
        assert np.isnan(result.clear[0])
        return result.time[0], result.status[0], result.queries[0], result.witness[0]

    def sweep_in_pieces(self, method, end, piece):
        """(time, number of pieces) of the contact, looked for `piece` s at a time."""
        start, count = 0.0, 0
        while True:
            rows = [np.array([value]) for value in (start, 1e-6, 1e-15, min(start + piece, end))]
            result = method.sweep(self.detector, self.trajectory, PairsToSweep(np.array([0]), np.array([1]), *rows), end)
            count += 1
            if result.status[0] != SEPARATE or np.isnan(result.clear[0]):
                return result.time[0], count
            assert result.clear[0] == rows[3][0]
            start = result.clear[0]

    def gap(self, t):
        return gap_at(self.detector.geometry, self.trajectory, *self.shapes, t)


@jit_making_arrays
def gap_at(geometry, trajectory, shape_a, shape_b, t):
    """Least gap of bodies 0 and 1 at time t."""
    x, q, axes, points = np.empty((2, 3)), np.empty((2, 4)), np.empty((2, 3, 3)), np.empty(7)
    for i in range(2):
        pose_at(trajectory, i, t, x[i], q[i])
        quaternion_to_matrix(q[i], axes[i])
    return pair_gap(geometry, Posed(shape_a, x[0], axes[0]), Posed(shape_b, x[1], axes[1]), np.inf, points)


@jit
def first_sample_below(geometry, trajectory, shape_a, shape_b, start, end, samples, level):
    """First of the sampled times at which the gap is below a level; inf if none is."""
    for i in range(samples + 1):
        t = start + (end - start) * i / samples
        if gap_at(geometry, trajectory, shape_a, shape_b, t) < level:
            return t
    return np.inf


def random_pair(rng, rates=False):
    """Two random bodies a random gap apart, with jerks and torque rates if asked for; None if they overlap wherever they are put."""
    pair = Pair(*rng.choice(NAMES, 2))
    for body, kind in enumerate(pair.shapes):
        plane = NAMES[kind] == "half space"
        mode = rng.choice([FIXED, PRESCRIBED] if plane else [FREE, FREE, FREE, FORCED, PRESCRIBED, FIXED])
        split = 10 ** rng.uniform(-0.7, 0.7, size=3)
        still, free = mode == FIXED, mode in (FREE, FORCED)
        pair.set(
            body,
            mode,
            velocity=np.zeros(3) if still else rng.normal(size=3) * 10 ** rng.uniform(-1, 1.5),
            spin=np.zeros(3) if still else rng.normal(size=3) * 10 ** rng.uniform(-1, 1 if plane else 2),
            turned=rng.normal(size=4),
            acceleration=rng.normal(size=3) * 10.0 * free,
            torque=rng.normal(size=3) * 10 ** rng.uniform(-1, 2) * (mode == FORCED),
            inertia=split.sum() - split,
        )
        if rates and free:
            pair.trajectory.jerk[body] = rng.normal(size=3) * 10 ** rng.uniform(0, 5)
            pair.trajectory.torque_rate[body] = rng.normal(size=3) * 10 ** rng.uniform(0, 5)
            begin(pair.trajectory, body)
    direction, wanted = rng.normal(size=3), 10 ** rng.uniform(-4, 0.3)
    near, far = 0.0, 20.0
    for _ in range(40):
        middle = 0.5 * (near + far)
        pair.trajectory.position[1] = direction / np.linalg.norm(direction) * middle
        near, far = (middle, far) if pair.gap(0.0) < wanted else (near, middle)
    pair.trajectory.position[1] = direction / np.linalg.norm(direction) * far
    return pair if 1e-8 < pair.gap(0.0) < 10.0 else None


def check_random_pairs(rng, number, rates):
    """Both methods agree, nothing is touched before, and the gap is right at the time found; returns the numbers of pairs and impacts."""
    swept = impacts = 0
    for pair in filter(None, (random_pair(rng, rates) for _ in range(number))):
        end = STEP * 10 ** rng.uniform(-1, 1)
        impact_margin = 10 ** rng.uniform(-9, -4)
        if pair.gap(0.0) < 2.0 * impact_margin:
            continue
        time, status, _, witness = pair.sweep(end=end, impact_margin=impact_margin)
        other, other_status, _, _ = pair.sweep(conservative, end=end, impact_margin=impact_margin)
        assert status == other_status
        last = end if status == SEPARATE else time
        sample = (*pair.shapes, 0.0, last)
        assert first_sample_below(GEOMETRY, pair.trajectory, *sample, 200, impact_margin - ROUND_OFF) == np.inf
        swept += 1
        if status == SEPARATE:
            continue
        impacts += 1
        assert status == IMPACT
        assert abs(pair.gap(time) - impact_margin) < ROUND_OFF + 1e-11 * impact_margin
        assert abs(pair.gap(other) - impact_margin) < ROUND_OFF + 1e-11 * impact_margin
        assert abs(witness[9] - impact_margin) < ROUND_OFF
        assert np.linalg.norm(witness[6:9]) == pytest.approx(1.0, abs=1e-12)
        assert witness[3:6] - witness[0:3] == pytest.approx(witness[9] * witness[6:9], abs=1e-9)
    return swept, impacts
