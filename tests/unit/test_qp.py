"""The convex solver of rows: with its fixed point it meets the same laws as newton."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.constraints.rows import BOUNDED, DISC, DISC_SECOND, make_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.dynamics.solvers.qp import solve_qp


def random_rows(seed: int, contacts: int, slides: float):
    """Contacts of two bodies of mass 1 with each other and with the ground, in random directions."""
    random = np.random.default_rng(seed)
    rows = make_rows.py_func(3 * contacts)
    for c in range(contacts):
        i = 3 * c
        q = np.linalg.qr(random.normal(size=(3, 3)))[0]
        for k in range(3):
            arm = 0.5 * random.normal(size=3)
            rows.first[i + k], rows.second[i + k] = (0, 1) if c % 2 else (-1, 0)
            rows.jacobian[i + k, :6] = -np.concatenate([q[k], np.cross(arm, q[k])])
            rows.jacobian[i + k, 6:] = np.concatenate([q[k], np.cross(arm, q[k])])
        rows.kind[i], rows.lower[i], rows.bias[i] = BOUNDED, 0.0, -random.uniform(0.5, 1.0)
        rows.kind[i + 1], rows.kind[i + 2] = DISC, DISC_SECOND
        rows.master[i + 1 : i + 3], rows.coefficient[i + 1 : i + 3] = i, 0.3
        rows.bias[i + 1 : i + 3] = slides * random.normal(size=2)
    return rows


@pytest.mark.parametrize("slides", [0.0, 0.2, 1.0])
def test_same_velocities_as_newton(slides):
    # Contacts of independent directions: impulses are unique where friction is moderate. Without the fixed point (the convex problem
    # alone) slip lifts contacts by mu |u_t|, some 0.1 m/s here.
    for seed in range(5):
        rows, other = random_rows(seed, 2, slides), random_rows(seed, 2, slides)
        assert solve_newton(rows, 2, 1e-12) < 1e-10
        assert solve_qp(other, 2, 1e-10) < 1e-5
        np.testing.assert_allclose(other.impulse, rows.impulse, atol=1e-5)


def test_block_slides_as_with_newton():
    angle = math.radians(35.0)
    up = (-math.sin(angle), 0.0, math.cos(angle))
    rough = ri.Material(density=1000.0, restitution=0.0, static_friction=0.5, dynamic_friction=0.4)
    scene = ri.Scene(gravity=(0.0, 0.0, -9.81))
    scene.add(ri.Body("plane", ri.Shape.half_space(normal=up), motion="static", material=rough))
    q = (math.cos(0.5 * angle), 0.0, -math.sin(0.5 * angle), 0.0)
    scene.add(ri.Body("block", ri.Shape.box((0.6, 0.5, 0.2)), position=0.1 * np.array(up), orientation=q, material=rough))
    runs = [ri.simulate(scene, 0.5, accuracy=ri.Accuracy(contact_solver=name)) for name in ("newton", "qp")]
    assert runs[1].status.ok
    np.testing.assert_allclose(runs[1].position("block"), runs[0].position("block"), atol=1e-5)
    expected = 0.5 * 9.81 * (math.sin(angle) - 0.4 * math.cos(angle)) * 0.25
    assert np.linalg.norm(runs[1].position("block")[-1] - runs[1].position("block")[0]) == pytest.approx(expected, rel=1e-4)


def test_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "clarabel", None)
    scene = ri.Scene()
    scene.add(ri.Body("ball", ri.Shape.sphere(1.0)))
    with pytest.raises(SceneError, match="clarabel"):
        ri.simulate(scene, 0.1, accuracy=ri.Accuracy(contact_solver="qp"))
