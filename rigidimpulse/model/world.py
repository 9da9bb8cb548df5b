"""The compiled scene: constant arrays that the engine reads. People's body frames end here; inside, everything is principal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import CompiledShape, Geometry, Shapes
from rigidimpulse.collision.manifold.convexity import convex_depths, convex_polyhedra, several_polyhedra
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.frames import own_pose
from rigidimpulse.scene.joint import Joint
from rigidimpulse.scene.scene import Scene


class BodyConstants(NamedTuple):
    """What kernels read of n bodies: arrays of the `World`, which explains them."""

    mass: np.ndarray  # (n,) kg
    inertia: np.ndarray  # (n, 3) kg m2
    steady_acceleration: np.ndarray  # (n, 3) m/s2
    steady_strength: np.ndarray  # (n,) m/s2
    bound_radius: np.ndarray  # (n,) m
    size: np.ndarray  # (n,) m
    dynamic: np.ndarray  # (n,) bool
    moving: np.ndarray  # (n,) bool
    flat: np.ndarray  # (n,) bool
    shape: np.ndarray  # (n,)
    material: np.ndarray  # (n,)


class Margins(NamedTuple):
    """Gaps that count, as fractions of the smaller body of a pair; see `World`."""

    contact: float
    impact: float
    tolerance: float  # gap error of an impact
    largest: float  # m, the largest contact margin of all


@dataclass(eq=False)
class World:
    """Constant arrays of n bodies; see the head of `state.py` for what varies.

    Attributes:
        scene: the scene as written.
        accuracy: settings of the run.
        names: body names in order of index.
        dynamic: (n,) bool, those that will be (see `Carried`) included. moving: (n,) bool, kinematic ones with a velocity or keyframes.
        mass, inv_mass: (n,) kg, 1/kg (0 for immovable). inertia: (n, 3) kg m2, principal (1 for immovable).
        offset: (n, 3) m, centre of mass in the body frame. turn: (n, 4), principal axes in the body frame.
        position, orientation, velocity, angular_velocity: principal-frame state at time 0.
        gravity, push: (n, 3) m/s2, of gravity and of constant forces. steady_acceleration: (n, 3) m/s2, their sum.
        shape_of_body: (n,). size: (n,) m, largest extent, inf for half spaces. bound_radius: (n,) m about the centre of mass.
        static_min, static_max: (n, 3) m, world boxes of bodies where they start.
        material_of_body: (n,). coefficients: (k, k, 4), see material.combine.
        rolling: (k, k, 2) m, rolling and spinning friction, see material.combine_rolling; (0, 0, 2) where there is none.
        flat: (n,) bool, has faces or rims that must not touch those of another at gap 0.
        half_space, ball: (n,) bool, the shape is half spaces only; one sphere about the centre of mass.
        impact_margin: gap at which faces and rims meet, as a fraction of the smaller body's size.
        apart: (p,) pairs a * n + b, a < b, ascending, that do not touch each other by a joint or by their collision filters.
        joints_of_scene: the joints as written. joints: their table. force_tables: the forces that vary, by class. left_out: names of
        effects that the caller leaves out.
        contact_margin: gap at which lasting contacts are held, as a fraction of the smaller body's size.

    """

    scene: Scene
    accuracy: Accuracy
    names: list[str]
    shapes: Sequence[CompiledShape]
    geometry: Geometry
    dynamic: np.ndarray
    moving: np.ndarray
    mass: np.ndarray
    inv_mass: np.ndarray
    inertia: np.ndarray
    offset: np.ndarray
    turn: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    gravity: np.ndarray
    push: np.ndarray
    steady_acceleration: np.ndarray
    shape_of_body: np.ndarray
    size: np.ndarray
    bound_radius: np.ndarray
    static_min: np.ndarray
    static_max: np.ndarray
    material_of_body: np.ndarray
    coefficients: np.ndarray
    rolling: np.ndarray
    flat: np.ndarray
    half_space: np.ndarray
    ball: np.ndarray
    contact_margin: float
    impact_margin: float
    apart: np.ndarray
    joints_of_scene: list[Joint]
    left_out: frozenset[str]
    joints: Any = None
    force_tables: Sequence[Any] = ()

    @property
    def num_bodies(self) -> int:
        """Number of bodies."""
        return len(self.names)

    @cached_property
    def convex_depths(self) -> np.ndarray:
        """See `collision.manifold.convexity.convex_depths`."""
        return convex_depths(self.geometry)

    @cached_property
    def has_general_pairs(self) -> bool:
        """Whether a body that may collide is no half space nor made of convex polyhedra, see `collision.manifold.dispatch.GENERAL`."""
        polyhedra = convex_polyhedra(self.geometry, self.convex_depths) | several_polyhedra(self.geometry)
        return self.can_collide and bool(np.any(~self.half_space & ~polyhedra[self.shape_of_body]))

    @cached_property
    def compiled_shapes(self) -> Shapes:
        """The shapes of the bodies, for kernels."""
        return Shapes(self.geometry, self.shape_of_body)

    @cached_property
    def steady_strength(self) -> np.ndarray:
        """(n,) m/s2, magnitude of the steady acceleration."""
        return np.linalg.norm(self.steady_acceleration, axis=1)

    @cached_property
    def constants(self) -> BodyConstants:
        """What kernels read of the bodies."""
        return BodyConstants(
            self.mass, self.inertia, self.steady_acceleration, self.steady_strength, self.bound_radius, self.size, self.dynamic,
            self.moving, self.flat, self.shape_of_body, self.material_of_body,
        )  # fmt: skip

    @cached_property
    def margins(self) -> Margins:
        """Gaps that count, as fractions of the smaller body of a pair."""
        return Margins(self.contact_margin, self.impact_margin, self.accuracy.tolerance, self.largest_contact_margin)

    @cached_property
    def largest_contact_margin(self) -> float:
        """Largest gap at which any contact is held, m."""
        finite = self.size[np.isfinite(self.size)]
        return self.contact_margin * float(finite.max()) if len(finite) else 0.0

    @cached_property
    def joint_size(self) -> float:
        """Size of the smallest body that a joint joins, m."""
        ends = np.concatenate([self.joints.body_a, self.joints.body_b])
        return float(self.size[ends[ends >= 0]].min(initial=np.inf))

    @cached_property
    def triggers(self) -> list:
        """Effects of the stage observe: volumes that report overlap."""
        return [] if "triggers" in self.left_out else [effect for effect in self.scene.effects if effect.stage == "observe"]

    @cached_property
    def can_collide(self) -> bool:
        """Whether any two bodies may ever come to an impact: a dynamic one and another, unless springs push them apart.

        Bodies that are let go later count from the start: steps are taken at once by what it says then.
        """
        ever_dynamic = any(body.becomes_dynamic for body in self.scene.bodies)
        return ever_dynamic and self.num_bodies > 1 and self.accuracy.response != "penalty"

    @property
    def why_no_impacts(self) -> str:
        """What `explain` says where `can_collide` is false."""
        return "springs push bodies apart, see penalty forces" if self.accuracy.response == "penalty" else "nothing can collide"

    @property
    def can_press(self) -> bool:
        """Whether anything but impacts can press bodies together: steady forces, a moving support, the spin of what is no ball."""
        return bool(self.force_tables or np.any(self.steady_acceleration) or np.any(self.moving) or not np.all(self.ball[self.dynamic]))

    def may_collide(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs take part in contact at all: at least one of the bodies is dynamic."""
        may = (self.dynamic[a] | self.dynamic[b]) & self.can_collide
        return may & ~self.is_apart(a, b) if len(self.apart) else may

    def is_apart(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Which pairs a < b are among those that do not touch each other by order."""
        key = a * self.num_bodies + b
        place = np.searchsorted(self.apart, key)
        return (self.apart[np.minimum(place, len(self.apart) - 1)] == key) if len(self.apart) else np.zeros(np.shape(key), bool)

    def least_impact_margin(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Gap at which contact of new pairs is declared, m: 0 where normals are well defined at gap 0."""
        size = np.minimum(self.size[a], self.size[b])
        return np.where(self.flat[a] & self.flat[b], self.impact_margin * size, 0.0)

    def body_pose(self, i: int, position: np.ndarray, orientation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose of the body's own origin and axes from principal-frame poses (f, 3), (f, 4)."""
        return own_pose(position, orientation, self.offset[i], self.turn[i])
