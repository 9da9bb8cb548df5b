"""A frame rate changes what is recorded, never what happens; and the same scene gives the same bits."""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri


def tumbling_scene() -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    material = ri.Material(restitution=0.6, static_friction=0.4)
    for k in range(4):
        scene.add(
            ri.Body(
                f"box {k}", ri.Shape.box((0.4, 0.3, 0.2)), position=(0.05 * k, 0.02 * k, 0.8 + 0.6 * k),
                orientation=(1, 0.3 * k, 0.2, 0.1), angular_velocity=(1, 2 * k, 0.5), material=material,
            )
        )
    return scene


def test_impacts_do_not_depend_on_the_frame_rate() -> None:
    slow = ri.simulate(tumbling_scene(), 1.5, fps=24)
    fast = ri.simulate(tumbling_scene(), 1.5, fps=240)
    assert len(slow.impacts) > 10
    assert slow.impacts.tobytes() == fast.impacts.tobytes()
    np.testing.assert_array_equal(slow.positions, fast.positions[::10])
    np.testing.assert_array_equal(slow.orientations, fast.orientations[::10])


def test_two_runs_agree_in_every_bit() -> None:
    hashes = {ri.simulate(tumbling_scene(), 1.0).state_hash() for _ in range(2)}
    assert len(hashes) == 1


def test_frames_are_as_many_as_promised_and_start_as_given() -> None:
    for duration, fps in ((1.0, 24), (0.999, 30), (1.01, 60), (0.0, 60)):
        run = ri.simulate(tumbling_scene(), duration, fps=fps)
        assert len(run.times) == round(duration * fps) + 1
        np.testing.assert_array_equal(run.position("box 2")[0], (0.1, 0.04, 2.0))
