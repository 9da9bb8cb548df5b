"""Units, frames and signs, written once. Small numbers are in `tolerances`.

Units
    SI: metres, kilograms, seconds, newtons, radians.
Frames
    Right-handed. Z is up unless the scene's gravity says otherwise. The *body frame* is the one that people see: its origin
    is where the shape was drawn. The *principal frame* is the one of the computation: its origin is the centre of mass, its axes
    are the principal axes of inertia. World vectors have the suffix `_world` where both occur, body vectors `_body`.
Rotations
    Unit quaternions (w, x, y, z) that turn body vectors into world vectors.
Contacts
    The normal runs from body a to body b. The gap is positive between separate bodies; a negative gap is penetration. An
    impulse acts with a plus sign on b and with a minus sign on a.
"""

from __future__ import annotations

STANDARD_GRAVITY: tuple[float, float, float] = (0.0, 0.0, -9.81)
"""Default gravity, m/s^2, along -Z."""
