"""Angular velocity of bodies over time, and what angular momentum follows from: for vectors in the picture, and for a plot.

The angular momentum of a body about its centre of mass is R diag(I) R^T w, with R the orientation of the principal frame. That of the
scene is plotted about the common centre of mass X, where neither the choice of an origin nor gravity shows: L_X = L - X x P.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.scene.mass import masses_of

MOST_SPINS = 20_000
"""Bodies times frames, above which the page has no vectors of them: 12 bytes each."""
LEAST_SPIN = 1e-3
"""rad/s, of a body that spins."""


def spinning(recording: Any) -> list[str]:
    """Return the names of dynamic bodies that spin; none where there would be too many numbers."""
    dynamic = [body.name for body in recording.scene.bodies if body.becomes_dynamic]
    seen = [name for name in dynamic if np.max(np.linalg.norm(recording.angular_velocity(name), axis=1), initial=0.0) > LEAST_SPIN]
    return seen if len(seen) * len(recording.times) <= MOST_SPINS else []


def spin_entries(recording: Any, names: list[str]) -> list[dict[str, Any]]:
    """Return what the manifest says of each of these bodies: name, principal moments, and principal frame (x, y, z, w) in its own."""
    if not names:
        return []
    masses = masses_of([recording.scene[name] for name in names])
    entries = []
    for name, mass in zip(names, masses, strict=True):
        entries.append({"name": name, "moments": mass.moments.tolist(), "frame": np.roll(from_matrix(mass.axes), -1).tolist()})
    return entries


def spin_rows(recording: Any, names: list[str]) -> npt.NDArray[np.float32]:
    """Return angular velocities (bodies, f, 3), rad/s, world axes."""
    return np.stack([recording.angular_velocity(name) for name in names]).astype(np.float32)


def angular_momentum(recording: Any) -> npt.NDArray[np.float32] | None:
    """Return the angular momentum (3, f) of the scene about its centre of mass; None where nothing spins, or masses change."""
    ledger, scene = recording.ledger, recording.scene
    dynamic = [i for i, body in enumerate(scene.bodies) if body.motion == "dynamic"]
    if ledger is None or not dynamic or any(hasattr(effect, "mass_flow") for effect in scene.effects):
        return None
    if any(body.becomes_dynamic != (body.motion == "dynamic") for body in scene.bodies):
        return None  # bodies that are let go later join the sums then
    if np.max(np.linalg.norm(recording.angular_velocities[:, dynamic], axis=2), initial=0.0) <= LEAST_SPIN:
        return None
    mass = np.array([mass.mass for mass in masses_of(scene.bodies[i] for i in dynamic)])
    centre = np.einsum("n,fnk->fk", mass / mass.sum(), recording.centers[:, dynamic])
    about = ledger.angular_momentum - cross_arrays(centre, ledger.momentum)
    return about.T.astype(np.float32) if np.isfinite(about).all() else None
