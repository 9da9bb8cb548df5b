"""Units, frames, signs and small numbers, written once.

Units
    SI: metres, kilograms, seconds, newtons, radians.
Frames
    Right-handed. Z is up unless the scene's gravity says otherwise. The *body frame* is the one people see: its origin
    is where the shape was drawn. The *principal frame* is the one computed in: origin at the centre of mass, axes
    along the principal axes of inertia. World vectors have the suffix `_world` where both occur, body vectors `_body`.
Rotations
    Unit quaternions (w, x, y, z) that turn body vectors into world vectors.
Contacts
    The normal runs from body a to body b. The gap is positive between separate bodies, negative is penetration. An
    impulse acts with a plus sign on b and with a minus sign on a.
Small numbers
    `Tolerances` is their only home. All are relative: to a body's size, its mass, or a stated quantity.
"""

from __future__ import annotations

from dataclasses import dataclass

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""Default gravity, m/s^2, along -Z."""


@dataclass(frozen=True)
class Tolerances:
    """Relative tolerances. Each says what it is relative to."""

    round_off: float = 2e-15
    """Guard against rounding, relative to the quantity itself (a few units in the last place)."""
    flat_angle: float = 1e-5
    """Sine of the angle between neighbouring faces, or along a crease, below which they count as flat or straight."""
    weld: float = 1e-9
    """Distance between vertices that are joined where a surface is open, relative to the size of the mesh."""
    thin_triangle: float = 1e-9
    """Height of a triangle over its longest edge below which that edge is flipped."""
    enclosed_volume: float = 1e-12
    """Least volume of a solid, relative to its area times its size."""
    equal_moments: float = 1e-12
    """Principal moments of inertia that differ by less, relative to the largest, are made equal."""
    diagonal_inertia: float = 1e-13
    """Off-diagonal inertia, relative to the largest moment, below which the tensor counts as diagonal."""
    realizable_inertia: float = 1e-9
    """Excess of the largest moment over the sum of the others, relative to it, that passes as rounding."""
    symmetric_inertia: float = 1e-9
    """Difference of mirrored entries of a given inertia tensor, relative to the largest, that passes as rounding."""
    least_moment: float = 1e-14
    """Least principal moment of inertia, relative to the largest."""
    contact_margin: float = 1e-6
    """Gap at which lasting contacts are held (delta), relative to the size of the smaller body."""
    impact_margin: float = 1e-10
    """Gap at which impacts of faces, edges and rims with each other take place, relative to the size of the smaller body."""
    joint: float = 1e-12
    """Distance at which joints are closed, relative to the size of what they join; also their angles, in rad."""
    approach: float = 1e-13
    """Approach speed that counts as none, relative to the speed of the bodies."""
    skin: float = 8e-3
    """Gap at which contacts of heaps are held, relative to the distance from the centre of mass to the nearest face."""
    rest: float = 1e-8
    """Speed below which a body that is held is at rest, relative to the speed that gravity and constant forces give it in a step."""


TOLERANCES = Tolerances()
"""The values in use."""
