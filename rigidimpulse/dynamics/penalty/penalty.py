"""The penalty method: bodies go into each other, and springs push them out.

At every point that is inside (see `penetrating_points`), of depth d, with u the velocity of b less that of a there and n the normal from
a to b,

    N = k d - c u.n,  none where that would pull,        force on b:  N n + F_t,  on a the opposite, on the same line
    F_t = -mu N c_t u_t / sqrt((c_t |u_t|)^2 + (mu N)^2),    u_t = u - (u.n) n,    c_t = 2 sqrt(k m),    1 / m = n.K n

so friction is mu N against the slip, mu the dynamic friction, and a damper c_t below a slip of about mu N / c_t: nothing sticks, what
should stand on a slope creeps. Stored: V = k d^2 / 2. For a mass m at one point, w = sqrt(k/m), z = c / (2 sqrt(k m)), speed v, no gravity:

    without damping  duration pi / w,  greatest depth v / w
    with damping     e = exp(-z (pi - 2 asin z) / sqrt(1 - z^2)),  duration (pi - 2 asin z) / (w sqrt(1 - z^2)),   z < 1
                     e = exp(-2 z acosh z / sqrt(z^2 - 1)),                                                        z > 1

The textbook's e = exp(-pi z / sqrt(1 - z^2)) is that of a damper that pulls at the end; to first order in z they are the same.

What is not given is found for each pair: c from its restitution by the law above, with the m of the point; k as the larger of

    g M / (REST_DEPTH s)            the heavier body M sinks at rest by REST_DEPTH of the smaller one's size s
    m (U / (IMPACT_DEPTH s))^2      at their speeds at the start, U, they go in by IMPACT_DEPTH of it; 1 / m = 1 / m_a + 1 / m_b

and, without weight and speed at the start, m (pi / (2 step))^2: contact lasts two steps, as many as steps of one length need.

Sources: P. Moore, J. Wilhelms, Collision detection and response for computer animation, SIGGRAPH 1988 (the method); T. Schwager,
T. Poeschel, Coefficient of restitution and linear-dashpot model revisited, Granular Matter 9, 2007 (restitution without pull).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import root_scalar

from rigidimpulse.collision.manifold.penetrating_points import find_points
from rigidimpulse.collision.manifold.penetrating_surface import BodyPoses, PointBuffer, Solids, inward_axes, solid_geometry
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.force import ForceTable, Instant
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring_all

REST_DEPTH = TOLERANCES.penalty.rest_depth
IMPACT_DEPTH = 0.02
MOST_DAMPING = 3.0
"""z where restitutions below 0.024 ask for more."""
CAPACITY = 256


def restitution_of(z: float) -> float:
    """Restitution of a mass on a spring of damping ratio z >= 0 that does not pull (see the head of the module)."""
    if abs(z - 1.0) < 1e-9:
        return math.exp(-2.0)
    if z < 1.0:
        return math.exp(-z * (math.pi - 2.0 * math.asin(z)) / math.sqrt(1.0 - z * z))
    return math.exp(-2.0 * z * math.acosh(z) / math.sqrt(z * z - 1.0))


def damping_ratio(restitution: float) -> float:
    """Damping ratio z that gives a restitution; MOST_DAMPING where it would be larger."""
    if restitution >= 1.0:
        return 0.0
    if restitution <= restitution_of(MOST_DAMPING):
        return MOST_DAMPING
    return float(root_scalar(lambda z: restitution_of(z) - restitution, bracket=(0.0, MOST_DAMPING), xtol=1e-15).root)


@jit
def _inverse_mass(inv_mass, inv_inertia, i, r, n):
    """n.K n of one body, 1/kg."""
    t = (r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0])
    total = inv_mass[i]
    if total > 0.0:
        for k in range(3):
            for m in range(3):
                total += t[k] * inv_inertia[i, k, m] * t[m]
    return total


class PenaltySprings(NamedTuple):
    """The springs and dampers of all pairs of n bodies of k materials."""

    stiffness: np.ndarray  # (n, n) N/m
    damping: float  # N s/m, or negative: from ratio
    ratio: np.ndarray  # (k, k) damping ratio z of two materials
    friction: np.ndarray  # (k, k)


@jit_making_arrays
def push(points, count, asked, bodies, springs, material_of_body, out, pushes):
    """Add the forces and torques of points (count,) to out (n, 6), where asked (count,); mark those that push in pushes (count,)."""
    real, integer = points
    stiffness, damping, ratio, friction = springs
    u, f, n, r = np.empty(3), np.empty(3), np.empty(3), np.empty((2, 3))
    for c in range(count):
        a, b, depth = integer[c, 0], integer[c, 1], real[c, 6]
        normal_speed = 0.0
        for k in range(3):
            n[k] = real[c, 3 + k]
            r[0, k], r[1, k] = real[c, k] - bodies.position[a, k], real[c, k] - bodies.position[b, k]
        for k in range(3):
            m, p = (k + 1) % 3, (k + 2) % 3
            v_a = bodies.velocity[a, k] + bodies.angular_velocity[a, m] * r[0, p] - bodies.angular_velocity[a, p] * r[0, m]
            v_b = bodies.velocity[b, k] + bodies.angular_velocity[b, m] * r[1, p] - bodies.angular_velocity[b, p] * r[1, m]
            u[k] = v_b - v_a
            normal_speed += u[k] * n[k]
        # 1 / m = n.K n, for the damping of this point.
        mass = 1.0 / (
            _inverse_mass(bodies.inv_mass, bodies.inv_inertia, a, r[0], n) + _inverse_mass(bodies.inv_mass, bodies.inv_inertia, b, r[1], n)
        )
        first, second = material_of_body[a], material_of_body[b]
        critical = 2.0 * math.sqrt(stiffness[a, b] * mass)
        force = stiffness[a, b] * depth - (damping if damping >= 0.0 else ratio[first, second] * critical) * normal_speed
        # Springs push only; a pull of the damper is left out.
        pushes[c] = force > 0.0
        if not (pushes[c] and asked[c]):
            continue
        slip = 0.0
        for k in range(3):
            u[k] -= normal_speed * n[k]
            slip += u[k] * u[k]
        bound, sticking = friction[first, second] * force, critical * math.sqrt(slip)
        # Regularised friction: mu N against the slip, a damper below a slip of about mu N / c_t.
        drag = bound * critical / math.sqrt(sticking * sticking + bound * bound) if bound > 0.0 else 0.0
        for k in range(3):
            f[k] = force * n[k] - drag * u[k]
        for k in range(3):
            m, p = (k + 1) % 3, (k + 2) % 3
            out[a, k] -= f[k]
            out[b, k] += f[k]
            out[a, 3 + k] -= r[0, m] * f[p] - r[0, p] * f[m]
            out[b, 3 + k] += r[1, m] * f[p] - r[1, p] * f[m]


def penalty_tables(world: World) -> list[PenaltyForces]:
    """The springs of a compiled scene: none where no two bodies can touch."""
    a, b = np.triu_indices(world.num_bodies, 1)
    may_meet = (world.dynamic[a] | world.dynamic[b]) & ~world.is_apart(a, b)
    return [PenaltyForces(world, np.stack([a[may_meet], b[may_meet]], axis=1))] if may_meet.any() else []


class PenaltyForces(ForceTable):
    """Springs between all bodies that may touch: a row for each dynamic body.

    Attributes:
        stiffness: (n, n) N/m, k of each pair of bodies, 0 where they never touch.

    """

    kind = "penalty forces"
    switches = True

    def __init__(self, world: World, pairs: np.ndarray) -> None:
        """Springs between pairs (p, 2), one at least, of bodies of a compiled scene whose response is "penalty"."""
        dynamic = np.flatnonzero(world.dynamic)
        self.names, self.body, self.cause = ["penalty"], dynamic, np.zeros(len(dynamic), np.int64)
        self.links = np.array([(dynamic[0], i) for i in dynamic[1:]], np.int64).reshape(-1, 2)
        self.is_steady = not world.moving.any()
        self._world, self._carried = world, np.flatnonzero(~world.dynamic)
        # Cylinders take part as prisms: the method needs corners and faces.
        geometry = solid_geometry(world.shapes)
        self._solids = Solids(geometry, *inward_axes(geometry))
        self._pairs = pairs
        self.stiffness = _stiffness(world, self._pairs)
        given = world.accuracy.penalty_damping
        self._damping = -1.0 if given is None else float(given)
        e, friction = world.coefficients[:, :, 0], np.ascontiguousarray(world.coefficients[:, :, 2])
        ratio = np.array([[damping_ratio(float(value)) for value in line] for line in e])
        self._springs = PenaltySprings(self.stiffness, self._damping, ratio, friction)
        self._bodies = BodyState(
            world.position.copy(), world.orientation.copy(), np.zeros((world.num_bodies, 3)), np.zeros((world.num_bodies, 3)),
            world.inv_mass, np.zeros((world.num_bodies, 3, 3)),
        )
        self._rotation = np.array([to_matrix(q) for q in world.orientation])
        self._unused = np.empty((2, world.num_bodies, 3))
        self._points_found = PointBuffer(np.empty((CAPACITY, 7)), np.empty((CAPACITY, 4), np.int64))
        self._frozen: np.ndarray | None = None
        self.reason = self._told()

    def _told(self) -> str:
        k = self.stiffness[self._pairs[:, 0], self._pairs[:, 1]]
        damping = "damping from restitution" if self._damping < 0.0 else f"damping {self._damping:g} N s/m"
        return f"bodies that touch push each other as springs, {k.min():.3g} to {k.max():.3g} N/m, {damping}"

    def _find(self) -> int:
        """Points at the present poses, into the buffers; returns their number."""
        world = self._world
        while True:
            count = find_points(
                self._solids, world.shape_of_body, world.bound_radius, self._pairs,
                BodyPoses(self._bodies.position, self._rotation), self._points_found,
            )  # fmt: skip
            if count <= len(self._points_found.real):
                return int(count)
            self._points_found = PointBuffer(np.empty((2 * count, 7)), np.empty((2 * count, 4), np.int64))

    def _points(self, at: Instant) -> int:
        """Take over the states of an instant and find the points."""
        mine, dynamic = self._bodies, self.body
        for own, given in zip(mine[:4], at.bodies[:4], strict=True):
            own[dynamic] = given[dynamic]
        mine.inv_inertia[dynamic], self._rotation[dynamic] = at.bodies.inv_inertia[dynamic], at.rotation[dynamic]
        bring_all(at.trajectory, self._carried, float(at.time[dynamic[0]]), mine, self._rotation, *self._unused)
        return self._find()

    def _push(self, count: int, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces and torques (n, 6) of the points asked for (count,), and what pushes: rows of a, b and what touches."""
        out, pushes = np.zeros((self._world.num_bodies, 6)), np.zeros(count, np.bool_)
        push(self._points_found, count, asked, self._bodies, self._springs, self._world.material_of_body, out, pushes)
        return out, self._points_found.integer[:count][pushes]

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque of rows."""
        count = self._points(at)
        asked = np.ones(count, np.bool_)
        if self._frozen is not None:
            asked = (self._points_found.integer[:count, None] == self._frozen[None]).all(axis=2).any(axis=1)
        return self._push(count, asked)[0][self.body[rows]]

    def freeze(self, at: Instant | None) -> None:
        """From here on only the points that push at an instant do, or all again (None)."""
        self._frozen = None if at is None else self._pushing(at).copy()

    def switched(self, at: Instant) -> bool:
        """Whether other points push than those of `freeze`."""
        return self._frozen is None or not np.array_equal(self._pushing(at), self._frozen)

    def _pushing(self, at: Instant) -> np.ndarray:
        count = self._points(at)
        return self._push(count, np.zeros(count, np.bool_))[1]

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Energy of all springs (f, 1) J."""
        values = np.zeros((len(times), 1))
        for f in range(len(times)):
            self._bodies.position[:] = position[f]
            self._rotation[:] = [to_matrix(q) for q in orientation[f]]
            count = self._find()
            k = self.stiffness[self._points_found.integer[:count, 0], self._points_found.integer[:count, 1]]
            values[f, 0] = 0.5 * float(k @ self._points_found.real[:count, 6] ** 2)
        return values


def _stiffness(world: World, pairs: np.ndarray) -> np.ndarray:
    """Stiffness (n, n) N/m of all pairs (p, 2): as given, or as the head of the module says."""
    accuracy, (a, b) = world.accuracy, pairs.T
    stiffness = np.zeros((world.num_bodies, world.num_bodies))
    if accuracy.penalty_stiffness is not None:
        stiffness[a, b] = accuracy.penalty_stiffness
        return stiffness
    mass = 1.0 / (world.inv_mass[a] + world.inv_mass[b])
    heavier = np.maximum(np.where(world.dynamic[a], world.mass[a], 0.0), np.where(world.dynamic[b], world.mass[b], 0.0))
    size = np.minimum(world.size[a], world.size[b])
    turning = np.linalg.norm(world.angular_velocity, axis=1) * np.where(np.isfinite(world.bound_radius), world.bound_radius, 0.0)
    speed = np.linalg.norm(world.velocity, axis=1) + turning
    strength = np.maximum(world.steady_strength[a], world.steady_strength[b])
    at_rest = strength * heavier / (REST_DEPTH * size)
    in_impact = mass * ((speed[a] + speed[b]) / (IMPACT_DEPTH * size)) ** 2
    # The stiffer of both laws of the head; without weight and speed a contact of two steps.
    known = np.maximum(at_rest, in_impact)
    stiffness[a, b] = np.where(known > 0.0, known, mass * (0.5 * np.pi / accuracy.step) ** 2)
    return stiffness
