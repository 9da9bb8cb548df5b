"""Position correction: sunk contacts get their contact margin back, by the smallest displacement in the metric of mass.

Law of two balls on one line: their gap grows from g to d, and their common centre of mass stays, so that m_a dx_a = -m_b dx_b. A
correction the other way would leave the gap at 2 g - d.
"""

from __future__ import annotations

import numpy as np
import pytest

from rigidimpulse.dynamics.constraints.position_correction import CLEAR, Sunk, correct_positions
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState

R, MARGIN, GAP = 0.5, 1e-6, 0.4e-6


@pytest.mark.parametrize("masses", [(1.0, 1.0), (1.0, 3.0), (0.0, 2.0)])
@pytest.mark.parametrize(("gap", "lifted", "target"), [(GAP, True, MARGIN), (-GAP, False, CLEAR * MARGIN)])
def test_a_contact_gets_its_gap_and_the_centre_of_mass_stays(
    masses: tuple[float, float], gap: float, lifted: bool, target: float
) -> None:
    """One that has sunk gets its margin back; one inside that leaves is only just apart."""
    inverse = np.array([1.0 / m if m else 0.0 for m in masses])
    position = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0 * R + gap]])
    at_rest, upright = np.zeros((2, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    bodies = BodyState(position.copy(), upright, at_rest, at_rest, inverse, 2.5 / R**2 * inverse[:, None, None] * np.eye(3))
    up, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(1)
    contacts = Contacts(np.array([0]), np.array([1]), R * up, -R * up, up, np.array([gap]), none, none, none, none)
    members = np.flatnonzero(inverse)
    number = np.full(2, -1)
    number[members] = np.arange(len(members))
    correct_positions(bodies, contacts, Sunk(np.array([lifted]), np.array([not lifted]), np.array([MARGIN])), members, number)
    way = bodies.position - position
    assert way[1, 2] - way[0, 2] == pytest.approx(target - gap, rel=1e-6)
    if inverse.all():
        assert np.abs(np.asarray(masses) @ way).max() < 1e-9 * MARGIN
    else:
        assert not way[0].any()
