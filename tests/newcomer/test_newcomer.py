"""Every scene of the newcomer corpus shows what it must, at defaults, with status ok and nothing inside anything."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import CORPUS
from stage import look

NOT_YET: dict[str, str] = {}
"""Scenes that do not pass, and what is seen instead."""

MOST = 5.0
"""s of processor time, after which a scene that does not pass yet is given up."""


def _case(name: str):
    marks = [pytest.mark.xfail(strict=True, reason=NOT_YET[name])] if name in NOT_YET else []
    return pytest.param(name, marks=marks)


@pytest.mark.parametrize("name", [_case(name) for name in CORPUS])
def test_newcomer_scene(name: str) -> None:
    """What is missed is listed, a line each."""
    assert look(CORPUS[name], MOST if name in NOT_YET else np.inf).missed == []
