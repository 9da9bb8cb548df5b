"""Which contacts of a sub-stepped island the solver sees within a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import rigidimpulse as ri
from rigidimpulse.collision.contact_records import MEMBER, in_play
from rigidimpulse.core.kernels import Kernel
from rigidimpulse.dynamics.solvers.tgs_soft.records import LINES, POINTS
from rigidimpulse.engine.simulate import complete, frame_times, prepare
from rigidimpulse.engine.substepped.advance import SubsteppedIslands
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.engine.substepped.stages import COLOURS, COLOURS_BEGUN, work_on


def pile(number: int) -> ri.Scene:
    """Boxes that fall on each other: some lie already while others arrive."""
    random = np.random.default_rng(4)
    material = ri.Material(density=500, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    for k in range(number):
        place, turn = (0.18 * (k % 5), 0.18 * (k // 5 % 5), 0.1 + 0.2 * (k // 25)), random.normal(size=4)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.12, 0.1, 0.08)), position=place, orientation=turn, material=material))
    return scene


def test_every_contact_is_in_one_element_with_the_motion_since_it_was_put_there() -> None:
    """In the middle of a step only contacts of quick bodies are written again; none may be lost or doubled by it.

    And what a body has drifted is how far it has come since the steady batches were made, to round-off of places of 1 m.
    """
    made, steps = {}, {"whole": 0, "steady": 0}

    def checked(kernel: Kernel, calls: Sequence[tuple]) -> list[Any]:
        if kernel is not work_on:
            return kernel.together(calls)
        simd, island, memory, _, progress, *_ = calls[0]
        bodies, pairs, steady = island.bodies, memory.table.pairs, progress[COLOURS_BEGUN]
        rows = memory.batches.row[: POINTS * memory.begins[progress[COLOURS]] * simd.width]
        seen = np.sort(rows[rows > 0] // LINES)
        listed = [
            range(start, start + count)
            for a, b, start, count in zip(pairs.first, pairs.second, pairs.start, pairs.count, strict=True)
            if in_play.py_func(bodies.part, a, b)
        ]
        assert np.array_equal(seen, np.sort(np.concatenate([*listed, []]).astype(np.int64)))
        steps["steady" if steady else "whole"] += 1
        if steady == 0:
            made["place"] = bodies.position.copy()
        drift = bodies.drift.reshape(-1, 8)[:, :3]
        moves = bodies.part == MEMBER
        assert np.abs(drift - (bodies.position - made["place"]))[moves].max(initial=0.0) < 1e-13
        return kernel.together(calls)

    run = prepare(pile(100), frame_times(1.2, 60.0))
    run.substepped = SubsteppedIslands(run.world, Sharing(most_cores=2, batches=-1, together=checked))
    assert complete(run, 1.2).status.ok
    assert min(steps.values()) > 50
