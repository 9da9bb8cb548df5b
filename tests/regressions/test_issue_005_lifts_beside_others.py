"""Issue 5: what is lifted off one body must not be pushed into another that is near, but does not touch it yet."""

from __future__ import annotations

import rigidimpulse as ri
from rigidimpulse.gallery.hard.crowds import cloud


def test_a_light_body_between_heavy_ones_is_not_lifted_into_one_of_them() -> None:
    """26 g lie on one of 7 kg, 2.2 held gaps from another, when a lift by 1.6 um, five held gaps, took them inside that one.

    There they met it thirty times without consequence, and the status said so.
    """
    run = ri.simulate(cloud(1), 0.325, 100.0)
    assert run.status.ok
    assert run.status.events == ()
