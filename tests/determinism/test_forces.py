"""Forces that vary do not know of frames, of other bodies far away, or of where a scene lies.

The same bits at any frame rate, twice, and beside a body that no force ties to the others, whose steps are its own. Moved or turned as a
whole a scene moves and turns as a whole, to rounding: 1e-14 of the place, grown by some hundred steps that follow each other, 1e-11;
choices of step length could differ by rounding, and then results by 1e-8.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rigidimpulse as ri

BLEND = ri.Material(restitution=0.6, static_friction=0.4, dynamic_friction=0.3)


def scene(*, far: bool = False, shift: tuple[float, float, float] = (0, 0, 0), turn: Rotation | None = None) -> ri.Scene:
    """Two boxes on a spring in drag that fall on a floor, a ball under a harmonic force that hits one of them."""
    turn = turn or Rotation.identity()

    def at(point: object) -> np.ndarray:
        return turn.apply(point) + shift

    quaternion = turn.as_quat()[[3, 0, 1, 2]]
    scene = ri.Scene(gravity=turn.apply((0, 0, -9.81)))
    floor = ri.Shape.box((10, 10, 1))
    scene.add(ri.Body("floor", floor, motion="static", position=at((0, 0, -0.5)), orientation=quaternion, material=BLEND))
    for k, name in enumerate(("a", "b")):
        spin = turn.apply((1.0, 2.0 * k, 0.5))
        scene.add(
            ri.Body(
                name, ri.Shape.box((0.3, 0.2, 0.4)), mass=1.0 + k, position=at((0.8 * k, 0, 0.9)), orientation=quaternion,
                angular_velocity=spin, material=BLEND,
            )
        )  # fmt: skip
    scene.add(ri.Body("ball", ri.Shape.sphere(0.15), mass=0.5, position=at((0.4, 0, 1.6)), orientation=quaternion, material=BLEND))
    scene.add(ri.Spring("a", "b", at((0.1, 0, 1.0)), at((0.75, 0.05, 1.0)), 60.0, 0.4))
    scene.add(ri.Drag(linear=0.1, quadratic=0.05, bodies=["a", "b", "ball"]))
    scene.add(ri.HarmonicForce("ball", 3.0, 2.0, turn.apply((1, 0, 0)), point=at((0.4, 0.1, 1.6))))
    if far:
        scene.add(ri.Body("far", ri.Shape.sphere(0.2), mass=1.0, position=at((0, 80, 5)), orientation=quaternion))
        scene.add(ri.Spring(None, "far", at((0, 80, 6)), at((0, 80, 5)), 700.0, rest_length=0.3))
    return scene


def test_frames_change_nothing_that_happens() -> None:
    slow, fast = (ri.simulate(scene(), 1.2, fps=fps) for fps in (20, 200))
    assert len(slow.impacts) > 3 and slow.impacts.tobytes() == fast.impacts.tobytes()
    for field in ("positions", "orientations", "velocities", "angular_velocities"):
        np.testing.assert_array_equal(getattr(slow, field), getattr(fast, field)[::10])
    for cause, taken in slow.ledger.dissipated.items():
        np.testing.assert_allclose(taken, fast.ledger.dissipated[cause][::10], rtol=0, atol=1e-12, err_msg=cause)


def test_two_runs_agree_in_every_bit() -> None:
    assert ri.simulate(scene(), 1.0).state_hash() == ri.simulate(scene(), 1.0).state_hash()


def test_a_body_far_away_changes_nothing() -> None:
    alone, beside = ri.simulate(scene(), 1.2), ri.simulate(scene(far=True), 1.2)
    for name in ("a", "b", "ball"):
        np.testing.assert_array_equal(alone.position(name), beside.position(name))
        np.testing.assert_array_equal(alone.orientation(name), beside.orientation(name))


@pytest.mark.parametrize("shift", [(0, 0, 0), (3, -7, 2)])
@pytest.mark.parametrize("turn", [None, (0.3, -1.1, 0.7)])
def test_a_scene_moved_as_a_whole_moves_as_a_whole(shift: tuple, turn: tuple | None) -> None:
    """Until the first impacts, that double small differences."""
    turn = Rotation.identity() if turn is None else Rotation.from_rotvec(turn)
    plain, moved = ri.simulate(scene(), 0.35), ri.simulate(scene(shift=shift, turn=turn), 0.35)
    for name in ("a", "b", "ball"):
        np.testing.assert_allclose(moved.position(name), turn.apply(plain.position(name)) + shift, rtol=0, atol=1e-11)
