"""What the scenes of flexible bodies share: their meshes and the laws that hold in all of them."""

from __future__ import annotations

import numpy as np

from rigidimpulse.gallery.record import Check, at_most
from rigidimpulse.recording.recording import Recording

GRAVITY = 9.81


def square_sheet(side: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices ((cells + 1)^2, 3) m and faces of a square about the origin, z = 0, its diagonals in turn."""
    u = np.linspace(-0.5 * side, 0.5 * side, cells + 1)
    x, y = np.meshgrid(u, u, indexing="ij")
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    row, column = np.divmod(np.arange(cells**2), cells)
    even = ((row + column) % 2 == 0)[:, None, None]
    one = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1)
    other = np.stack([np.stack([a, b, d], 1), np.stack([b, c, d], 1)], 1)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), np.where(even, one, other).reshape(-1, 3)


def cube_surface(side: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (v, 3) m and outward faces of the surface of a cube about the origin."""
    flat, faces = square_sheet(side, cells)
    points, triangles = [], []
    for axis in range(3):
        for end in (-0.5, 0.5):
            face = np.roll(flat + [0.0, 0.0, end * side], axis + 1, axis=1)
            triangles.append((faces if end > 0.0 else faces[:, ::-1]) + len(flat) * len(points))
            points.append(face)
    _, first, index = np.unique(np.round(np.concatenate(points), 9), axis=0, return_index=True, return_inverse=True)
    return np.concatenate(points)[first], index.ravel()[np.concatenate(triangles)]


def enclosed_volume(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the volumes (f,) m^3 of a closed mesh with vertices (f, v, 3) m."""
    a, b, c = (vertices[:, faces[:, k]] for k in range(3))
    return np.einsum("fti,fti->f", a, np.cross(b, c)) / 6.0


def laws_of_energy(run: Recording, rise: float) -> list[Check]:
    """Return the checks that energy rises by no more than a share of the largest potential energy that is lost, and that it balances."""
    if run.ledger is None:
        return []
    total = run.ledger.total
    scale = float(np.ptp(run.ledger.potential))
    taken = np.sum(list(run.ledger.dissipated.values()), axis=0)
    return [
        at_most("largest rise of energy from frame to frame, relative", np.diff(total).max() / scale, rise, "soft bodies only take"),
        at_most("error of the ledger, relative", np.abs(total + taken - total[0]).max() / scale, 1e-9, "energy balance"),
    ]
