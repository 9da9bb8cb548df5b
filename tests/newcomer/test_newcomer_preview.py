"""The first second of every newcomer scene at "preview" has status ok: nothing is more than 1 to 2 % of its size inside anything.

What was lost between two looks for contacts showed here. `dice`: of the four corners of a face that comes down three were kept, where the
two that are deepest are the ends of an edge and all others on one side of it: a die was 2.7 % of its size inside the floor.
`dice_in_a_cup`: contacts of meshes are those of corners that are nearly the lowest: a die that turned by 0.08 rad from look to look came
down on another one, 22 %. `stones`: a corner wide open took the place of one that was about to touch, 2.6 %.
"""

from __future__ import annotations

import pytest
from scenes import CORPUS

import rigidimpulse as ri


@pytest.mark.parametrize("name", CORPUS)
def test_newcomer_scene_at_preview(name: str) -> None:
    """The status looks at all frames of few bodies."""
    case = CORPUS[name]
    stage, _ = case.make()
    run = ri.simulate(stage.scene, min(case.duration, 1.0), accuracy="preview")
    assert run.status.ok, run.status.message
