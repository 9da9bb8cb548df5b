"""Bodies: what people put into a scene."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.numeric import number_of, numbers_of
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.shape import Shape, check_orientation, normalized_quaternion
from rigidimpulse.scene.visual import Visual

MOTIONS = ("dynamic", "kinematic", "static")
"""Ways a body moves: by forces and impacts, along a given path, not at all."""


DEFAULT_MATERIAL = Material()
"""Density of water, contact coefficients not stated."""


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body. Values are checked when the scene is compiled.

    Attributes:
        name: unique in its scene.
        shape: its surface and solid, in the body frame.
        motion: "dynamic", "kinematic" (moves by `velocity` and `angular_velocity`, or along `keyframes`, whatever it
            meets) or "static".
        position: (3,) m, where the body's own origin is at the start.
        orientation: quaternion (w, x, y, z) from body to world axes; normalised when the scene is compiled.
        velocity: (3,) m/s, of the centre of mass.
        angular_velocity: (3,) rad/s, about world axes.
        mass: kg; by default the shape's volume times the material's density.
        inertia: (3,) or (3, 3) kg m^2, about the centre of mass along the body's axes; by default that of the shape.
        center_of_mass: (3,) m, body frame; by default the centroid of the shape.
        material: density and contact coefficients.
        keyframes: the path of a kinematic body.
        release_time: s, > 0, from when on a kinematic body is dynamic: let go with the pose and the velocity that it has then. None: never.
        gravity_factor: scales the scene's gravity for this body.
        collision_filter: which other bodies it touches; None: all.
        visual: what is seen of it, a colour or another shape; None: its shape, in its own colours or in one that the library chooses.

    """

    name: str
    shape: Shape
    _: KW_ONLY
    motion: Literal["dynamic", "kinematic", "static"] = "dynamic"
    position: ArrayLike = (0.0, 0.0, 0.0)
    orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0)
    velocity: ArrayLike = (0.0, 0.0, 0.0)
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0)
    mass: float | None = None
    inertia: ArrayLike | None = None
    center_of_mass: ArrayLike | None = None
    material: Material = DEFAULT_MATERIAL
    keyframes: Keyframes | None = None
    release_time: float | None = None
    gravity_factor: float = 1.0
    collision_filter: CollisionFilter | None = None
    visual: Visual | None = None

    def unit_orientation(self) -> np.ndarray:
        """Return the normalised orientation (4,)."""
        return normalized_quaternion(self.orientation)

    @property
    def drawn_shape(self) -> Shape:
        """The shape that is seen: that of the visual, if it has one, else the body's own, or what its convex parts stand for."""
        if self.visual is not None and self.visual.shape is not None:
            return self.visual.shape
        return self.shape if self.shape.whole is None else self.shape.whole

    @property
    def shows_own_colors(self) -> bool:
        """Whether the colours of its shape are seen, if that has some."""
        return self.visual is None or self.visual.color is None

    @property
    def becomes_dynamic(self) -> bool:
        """Whether the body is dynamic, or will be."""
        return self.motion == "dynamic" or self.release_time is not None

    def check(self) -> None:
        """Raise a `SceneError`, naming the body, for a value that makes no sense; masses are `mass.body_mass`'s."""
        try:
            self._check_kinds()
            self._check_state()
            self._check_mass()
            self.material.check()
            if self.keyframes is not None:
                self.keyframes.check()
            self.shape.check()
            if self.visual is not None:
                self.visual.check()
        except SceneError as error:
            raise error.within(f"body {self.name!r}") from None

    def _check_kinds(self) -> None:
        """Check that things are of their kind, and that those which exclude each other do not meet."""
        if not isinstance(self.shape, Shape):
            raise SceneError(
                f"shape is a {type(self.shape).__name__}", "give a Shape, such as Shape.sphere(0.5) or Shape.from_file"
            )
        if not isinstance(self.material, Material):
            raise SceneError(f"material is a {type(self.material).__name__}", "give a Material")
        if not isinstance(self.collision_filter, CollisionFilter | None):
            raise SceneError(f"collision_filter is a {type(self.collision_filter).__name__}", "give a CollisionFilter")
        if not isinstance(self.visual, Visual | None):
            raise SceneError(f"visual is a {type(self.visual).__name__}", 'give a Visual, such as Visual(color="#2f7fb8")')
        if not isinstance(self.motion, str) or self.motion not in MOTIONS:
            raise SceneError(f"motion is {self.motion!r}", f"give one of {', '.join(map(repr, MOTIONS))}")
        if self.keyframes is not None:
            if not isinstance(self.keyframes, Keyframes):
                raise SceneError(f"keyframes are a {type(self.keyframes).__name__}", "give Keyframes(times, positions)")
            if self.motion != "kinematic":
                raise SceneError(f"it has keyframes, but its motion is {self.motion!r}", "use motion='kinematic'")
        if self.release_time is not None:
            if self.motion != "kinematic":
                raise SceneError(f"it has a release_time, but its motion is {self.motion!r}", "use motion='kinematic'")
            if number(self.release_time, "release_time", "s") <= 0.0:
                raise SceneError(f"release_time is {self.release_time} s", "give a time > 0, or use motion='dynamic'")
        if self.becomes_dynamic and any(part.shape.kind == "half_space" for part in self.shape.parts_flat()):
            raise SceneError("a half space is infinite and cannot be dynamic", "use motion='static', or Shape.box")

    def _check_state(self) -> None:
        """Check pose, velocities and gravity factor."""
        vector(self.position, "position", "m")
        check_orientation(numbers_of(self.orientation))
        moving = [
            f"{name} is {value.tolist()}"
            for name, value in (
                ("velocity", vector(self.velocity, "velocity", "m/s")),
                ("angular_velocity", vector(self.angular_velocity, "angular_velocity", "rad/s")),
            )
            if np.any(value)
        ]
        if moving and self.motion == "static":
            raise SceneError(f"it is static, but its {moving[0]}", "use motion='kinematic' for a body on a given path")
        if moving and self.keyframes is not None:
            raise SceneError(f"it has keyframes, but its {moving[0]} too", "give one or the other")
        number(self.gravity_factor, "gravity_factor", "")

    def _check_mass(self) -> None:
        """Check the mass properties that are given."""
        if self.mass is not None and number(self.mass, "mass", "kg") <= 0.0:
            raise SceneError(f"mass is {self.mass} kg", "give a mass > 0, or use motion='static' or 'kinematic'")
        if self.center_of_mass is not None:
            vector(self.center_of_mass, "center_of_mass", "m")
        if self.inertia is not None:
            inertia = numbers_of(self.inertia)
            if inertia.shape not in ((3,), (3, 3)) or not np.all(np.isfinite(inertia)):
                raise SceneError(f"inertia is {self.inertia!r}", "give finite numbers (3,) or (3, 3), in kg m^2")


def vector(value: ArrayLike, name: str, unit: str) -> np.ndarray:
    """Return a value as a finite vector (3,), or raise a `SceneError`."""
    array = numbers_of(value)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise SceneError(f"{name} is {value!r}", f"give three finite numbers, in {unit}")
    return array


def number(value: float, name: str, unit: str) -> float:
    """Return a value as a finite number, or raise a `SceneError`."""
    result = number_of(value)
    if not np.isfinite(result):
        raise SceneError(f"{name} is {value!r}", f"give a finite number{f', in {unit}' if unit else ''}")
    return result
