"""Forces of lasting contacts against statics and steady motion.

Laws. What rests bears its weight at every frame: the forces on a body sum to -m g to 1e-9 of it, and to no moment about
its centre of mass. On an incline the force leans by friction: m g sin along it. A block pushed at constant speed feels
mu m g from the wall. Force acts on b and its opposite on a. One that forgot sleeping bodies would be off by all of m g.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidimpulse as ri

G = 9.81
DULL = ri.Material(restitution=0.0, static_friction=0.6, dynamic_friction=0.4)


def scene_with_floor(gravity: tuple[float, float, float] = (0, 0, -G)) -> ri.Scene:
    scene = ri.Scene(gravity=gravity)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    return scene


def table() -> ri.Scene:
    scene = scene_with_floor()
    legs = [(ri.Shape.box((0.1, 0.1, 0.7)), (x, y, 0.35), (1, 0, 0, 0)) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    top = (ri.Shape.box((1.2, 0.8, 0.1)), (0.05, 0, 0.75), (1, 0, 0, 0))
    scene.add(ri.Body("table", ri.Shape.compound([*legs, top]), mass=20.0, material=DULL))
    scene.add(ri.Body("load", ri.Shape.box((0.2, 0.2, 0.2)), position=(0.3, 0.1, 0.9), mass=5.0, material=DULL))
    return scene


def test_table_bears_itself_and_its_load_at_every_frame() -> None:
    run = ri.simulate(table(), 1.0)
    np.testing.assert_allclose(run.contact_force("table"), [(0, 0, 20 * G)] * len(run.times), atol=1e-9 * 25 * G)
    np.testing.assert_allclose(run.contact_force("load"), [(0, 0, 5 * G)] * len(run.times), atol=1e-9 * 5 * G)
    np.testing.assert_allclose(run.contact_force("floor"), [(0, 0, -25 * G)] * len(run.times), atol=1e-9 * 25 * G)
    for frame in (0, 1, -1):
        rows = run.contacts_at(frame)
        under = rows[rows["body_a"] == run.index("floor")]
        assert len(under) >= 3
        assert np.all(under["force"][:, 2] >= 0)
        np.testing.assert_allclose(under["normal"], [(0, 0, 1)] * len(under), atol=1e-9)
        centre = (20 * run.center_of_mass("table")[frame] + 5 * run.center_of_mass("load")[frame]) / 25
        moment = np.cross(under["point"] - centre, under["force"]).sum(0)
        np.testing.assert_allclose(moment, 0, atol=1e-8 * 25 * G)
    with pytest.raises(IndexError, match=f"frame {len(run.times)} of a run of {len(run.times)} frames"):
        run.contacts_at(len(run.times))


def test_stack_bears_what_is_above() -> None:
    scene, masses = scene_with_floor(), (4.0, 1.0, 8.0, 2.0)
    for k, mass in enumerate(masses):
        scene.add(ri.Body(f"box{k}", ri.Shape.box((0.5, 0.5, 0.5)), position=(0, 0, 0.25 + 0.5 * k), mass=mass, material=DULL))
    run = ri.simulate(scene, 0.5)
    for frame in range(len(run.times)):
        rows = run.contacts_at(frame)
        for k in range(len(masses)):
            upper = run.index(f"box{k}")
            lower = run.index(f"box{k - 1}") if k else run.index("floor")
            between = rows[(rows["body_a"] == min(lower, upper)) & (rows["body_b"] == max(lower, upper))]
            np.testing.assert_allclose(between["force"].sum(0), (0, 0, sum(masses[k:]) * G), atol=1e-9 * 15 * G)


@pytest.mark.parametrize("slides", [False, True])
def test_block_on_an_incline(slides: bool) -> None:
    angle = 0.7 if slides else 0.4
    scene = scene_with_floor((G * np.sin(angle), 0, -G * np.cos(angle)))
    scene.add(ri.Body("block", ri.Shape.box((0.4, 0.4, 0.2)), position=(0, 0, 0.1), mass=3.0, material=DULL))
    run = ri.simulate(scene, 0.5, fps=100)
    friction = 0.4 * np.cos(angle) if slides else np.sin(angle)
    expected = 3 * G * np.array([-friction, 0, np.cos(angle)])
    np.testing.assert_allclose(run.contact_force("block"), [expected] * len(run.times), atol=1e-9 * 3 * G)


def test_cube_pushed_over_the_floor() -> None:
    scene = scene_with_floor()
    slick = ri.Material(static_friction=0.0, friction_combine="minimum")
    moving = {"motion": "kinematic", "position": (-0.4, 0, 1.1), "velocity": (0.5, 0, 0)}
    scene.add(ri.Body("wall", ri.Shape.box((0.2, 2, 2)), material=slick, **moving))
    smooth = ri.Material(restitution=0, static_friction=0.3, dynamic_friction=0.3, friction_combine="minimum")
    scene.add(ri.Body("cube", ri.Shape.box((0.4, 0.4, 0.4)), position=(0, 0, 0.2), mass=2.0, material=smooth))
    run = ri.simulate(scene, 2.0)
    pushed = run.times > 0.6
    wall, cube, floor = (run.contact_force(name)[pushed] for name in ("wall", "cube", "floor"))
    np.testing.assert_allclose(cube, 0 * cube + (0, 0, 2 * G), atol=1e-7)
    np.testing.assert_allclose(wall, 0 * wall - (0.3 * 2 * G, 0, 0), atol=1e-7)
    np.testing.assert_allclose(wall + cube + floor, 0, atol=1e-9)


def test_no_force_in_flight_and_one_row_while_at_rest(tmp_path: Path) -> None:
    scene = scene_with_floor()
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 0, 0.6), mass=1.0, material=DULL))
    run = ri.simulate(scene, 10.0, fps=1000)
    falls = run.times < np.sqrt(2 * 0.5 / G)
    assert not run.contact_force("ball")[falls].any()
    np.testing.assert_allclose(run.contact_force("ball")[~falls], [(0, 0, G)] * int(np.sum(~falls)), atol=1e-9 * G)
    assert len(run.contacts) <= 3  # sparse: a row a frame would be 9,700
    loaded = ri.load_recording(run.export(tmp_path / "ball.npz"))
    np.testing.assert_array_equal(loaded.contacts, run.contacts)
    np.testing.assert_array_equal(loaded.contact_force("ball"), run.contact_force("ball"))
