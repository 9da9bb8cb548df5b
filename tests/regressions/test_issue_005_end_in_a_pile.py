"""Issue 5: a run that ends while a body of a pile touches another."""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri


def test_a_run_ends_where_a_member_of_a_substepped_island_touches_the_floor() -> None:
    """Hulls in a pit: one had turned on the floor by itself before it came to the pile, and touched the floor at the end.

    What was remembered of its own contact made it end a sub-step once more, and the island was stepped over a time of 0: division by zero.
    """
    random = np.random.default_rng(3)
    stone = ri.Material(density=900, restitution=0.1, static_friction=0.4, dynamic_friction=0.4)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=stone))
    for normal in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
        scene.add(ri.Body(f"wall {normal}", ri.Shape.half_space(normal=normal, offset=-0.35), motion="static", material=stone))
    shapes = [ri.Shape.convex_hull(random.normal(size=(20, 3)) * 0.02) for _ in range(5)]
    for k in range(96):
        jitter = 0.005 * random.normal(size=2)
        place = 0.17 * (k % 4) - 0.255 + jitter[0], 0.17 * (k // 4 % 4) - 0.255 + jitter[1], 0.15 + 0.17 * (k // 16)
        turn, spin = random.normal(size=4), random.normal(size=3)
        scene.add(ri.Body(f"stone {k}", shapes[k % 5], position=place, orientation=turn, angular_velocity=spin, material=stone))
    run = ri.simulate(scene, 3.0)
    assert run.status.ok, run.status.message
    assert run.positions[:, 5:, 2].min() > 0.0
