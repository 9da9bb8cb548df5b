"""Dampers and springs of joints whose bodies other joints hold, too: the row alone would be far lighter than what hangs on it.

Planted fault, once real: a row that is stopped at the rate that it would have alone. A door on a hinge plate that is welded to the world
turned 0.15 rad too far in 1 s, whatever the step; the last link of a damped chain was 0.5 m off.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rigidimpulse as ri

G = 9.81


@pytest.mark.parametrize("accuracy", ["preview", "standard", "exact"])
@pytest.mark.parametrize("plate", [5.0, 0.05])
def test_a_damped_door_on_a_welded_plate(plate: float, accuracy: str) -> None:
    """J w' = -c w: w = w_0 exp(-c t / J), whatever the plate weighs."""
    mass, damping, first = 20.0, 2.0, 2.0
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("plate", ri.Shape.box((0.04, 0.04, 0.1)), position=(0, 0, 1), mass=plate))
    door = ri.Body(
        "door", ri.Shape.box((0.8, 0.04, 2)), position=(0.42, 0, 1), mass=mass, angular_velocity=(0, 0, first), velocity=(0, 0.4 * first, 0)
    )
    scene.add(door)
    scene.add(ri.FixedJoint(None, "plate"))
    scene.add(ri.HingeJoint("plate", "door", (0.02, 0, 1), (0, 0, 1), motor=ri.Motor(damping=damping)))
    run = ri.simulate(scene, 1.0, accuracy=accuracy)
    inertia = mass * (0.8**2 + 0.04**2) / 12 + mass * 0.4**2
    q = run.orientation("door")[-1]
    assert run.status.ok, run.status.message
    assert 2 * np.arctan2(q[3], q[0]) == pytest.approx(first * inertia / damping * -np.expm1(-damping / inertia), abs=4e-3)
    assert run.angular_velocity("door")[-1, 2] == pytest.approx(first * np.exp(-damping / inertia), abs=4e-3)


def chain_angles(number: int, mass: float, size: float, damping: float, time: float) -> np.ndarray:
    """Angles of a chain of rods that falls from the horizontal, by the equations of motion in them.

    sum_j a_ij cos(t_i - t_j) t_j'' + a_ij sin(t_i - t_j) t_j'^2 = Q_i, with a_ij = m L^2 (1/2 + links behind both), and the rods' inertia.
    """
    order = np.arange(number)
    behind = number - 1 - np.maximum(order[:, None], order)
    weight = mass * size**2 * (0.5 + behind) + np.diag(np.full(number, mass * size**2 * (1 / 12 + 1 / 4 - 1 / 2)))
    drop = mass * G * size * (0.5 + number - 1 - order)

    def rates(_time: float, state: np.ndarray) -> np.ndarray:
        angle, rate = state[:number], state[number:]
        apart = angle[:, None] - angle
        torque = damping * np.diff(rate, prepend=0.0)
        pull = np.append(torque[1:], 0.0) - torque + drop * np.cos(angle)
        return np.concatenate([rate, np.linalg.solve(weight * np.cos(apart), pull - (weight * np.sin(apart)) @ rate**2)])

    return solve_ivp(rates, (0.0, time), np.zeros(2 * number), rtol=1e-9, atol=1e-10, method="LSODA").y[:number, -1]


@pytest.mark.parametrize(
    ("number", "mass", "size", "damping"), [(3, 2.0, 0.3, 1.0), (6, 1.0, 0.2, 2.0), (10, 0.05, 0.05, 0.02), (10, 0.05, 0.05, 0.1)]
)
def test_a_damped_chain_falls_as_its_equations_say(number: int, mass: float, size: float, damping: float) -> None:
    """Alone each of the small links has cW h of 100 and more, and all together fall slowly."""
    scene = ri.Scene(gravity=(0, 0, -G))
    for k in range(number):
        thin = 1e-3 * size
        scene.add(ri.Body(f"link {k}", ri.Shape.box((size, thin, thin)), position=((k + 0.5) * size, 0, 0), mass=mass))
        motor = ri.Motor(damping=damping)
        scene.add(ri.HingeJoint(None if k == 0 else f"link {k - 1}", f"link {k}", (k * size, 0, 0), (0, 1, 0), motor=motor))
    run = ri.simulate(scene, 0.4)
    assert run.status.ok, run.status.message
    angle = chain_angles(number, mass, size, damping, 0.4)
    tip = size * np.array([np.cos(angle[:-1]).sum() + 0.5 * np.cos(angle[-1]), -np.sin(angle[:-1]).sum() - 0.5 * np.sin(angle[-1])])
    assert np.linalg.norm(run.position(f"link {number - 1}")[-1][[0, 2]] - tip) < 0.01 * number * size
