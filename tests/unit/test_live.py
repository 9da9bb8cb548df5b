"""What the live page is made of, without a browser: controls, throws, and what is said of errors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.engine.simulate import complete, prepare
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.frame_times import frame_times
from rigidimpulse.studies.job import Job
from rigidimpulse.studies.live.controls import all_controls, declared_controls, with_own_values
from rigidimpulse.studies.live.problem import problem_of
from rigidimpulse.studies.live.request import Throw
from rigidimpulse.studies.live.throws import Throws

GRAVITY, RADIUS, FPS = 9.81, 0.1, 60.0


def drop(
    height: float = 1.0, count: int = 3, spin: bool = False, kind: Literal["ball", "box"] = "ball",
    angle: Annotated[float, (-90.0, 90.0, 5.0)] = 0.0, place: tuple[float, float] = (0.0, 0.0), mass: float = 2.0,
) -> ri.Scene:  # fmt: skip
    """A ball over the floor; most arguments are only looked at."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    ball = ri.Body("ball", ri.Shape.sphere(RADIUS), position=(0, 0, RADIUS + height), mass=mass, inertia=(0.1, 0.1, 0.1))
    scene.add(ball)
    return scene


def job(accuracy: str = "standard") -> Job:
    return Job("drop", drop, 1.0, FPS, accuracy, None)


def test_arguments_declare_controls() -> None:
    found = {control.name: (control.kind, control.value, control.low, control.high) for control in declared_controls(drop)}
    assert found["height"] == ("range", 1.0, 0.0, 2.0)
    assert found["count"] == ("range", 3, 0.0, 10.0)
    assert found["angle"] == ("range", 0.0, -90.0, 90.0)
    assert found["spin"][:2] == ("switch", False) and found["kind"][:2] == ("choice", "ball")
    assert "place" not in found
    assert {control.name: control.step for control in declared_controls(drop)}["angle"] == 5.0


@pytest.mark.parametrize("stated", [(1.0,), (2.0, 1.0), ("a", "b"), (0.0, float("inf"))])
def test_a_range_that_is_none_is_refused(stated: Any) -> None:
    def scene(height: Any = 1.0) -> ri.Scene:
        return drop(height)

    scene.__annotations__ = {"height": Annotated[float, stated]}
    with pytest.raises(ri.SceneError, match="'height'"):
        declared_controls(scene)


def test_a_declared_control_stands_in_for_one_that_every_scene_has() -> None:
    names = [control.name for control in all_controls(drop(), job())]
    assert names.count("mass") == 1 and {"restitution", "friction", "gravity", "accuracy", "duration"} <= set(names)


def test_own_values_change_all_bodies() -> None:
    heavy = Job("drop", lambda: drop(), 1.0, FPS, "standard", None)
    values = {"restitution": 0.3, "friction": 0.9, "mass": 4.0, "gravity": 2.0, "accuracy": "exact", "duration": 3.0, "unknown": 1}
    scene, changed = with_own_values(drop(), heavy, values)
    ball = scene.bodies[1]
    assert (ball.material.restitution, ball.material.static_friction, ball.material.dynamic_friction) == (0.3, 0.9, 0.9)
    assert ball.mass == 8.0 and np.allclose(ball.inertia, 0.4)
    assert np.allclose(np.asarray(scene.gravity), (0.0, 0.0, -2.0))
    assert (changed.accuracy, changed.duration) == ("exact", 3.0)


def thrown(throws: tuple[Throw, ...], duration: float = 1.0) -> Recording:
    run = prepare(drop(), frame_times(duration, FPS))
    run.keyframes = Throws(run, throws)
    return complete(run, duration)


@pytest.mark.parametrize("time", [0.25, 0.9])  # in flight, and at rest on the floor
def test_a_throw_leaves_what_was_before_and_flies_on_a_parabola(time: float) -> None:
    plain, velocity = complete(prepare(drop(), frame_times(1.0, FPS)), 1.0), np.array([1.0, 0.5, 3.0])
    run = thrown((Throw("ball", time, (1.0, 0.5, 3.0)), Throw("floor", time, (1.0, 0.0, 0.0)), Throw("nobody", time, (1.0, 0.0, 0.0))))
    first = round(time * FPS)
    assert np.array_equal(run.position("ball")[: first + 1], plain.position("ball")[: first + 1])
    passed = (run.times - time)[first : first + 5, None]
    parabola = plain.position("ball")[first] + passed * velocity - 0.5 * passed**2 * np.array([0.0, 0.0, GRAVITY])
    assert np.abs(run.position("ball")[first : first + 5] - parabola).max() < 1e-9
    assert run.status.ok, run.status.message


def test_an_error_names_the_line_that_names_the_body(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text("import rigidimpulse as ri\n\nNAME = 'ball'\n")
    shown = problem_of(ri.SceneError("mass is -1", "give a mass > 0", "body 'ball'"), str(file))
    assert (shown["line"], shown["source"]) == (3, "NAME = 'ball'")
    assert (shown["where"], shown["problem"], shown["remedy"]) == ("body 'ball'", "mass is -1", "give a mass > 0")
    assert problem_of(ri.SceneError("mass is -1", "", "body 'other'"), str(file))["line"] is None
    assert problem_of(ZeroDivisionError("division by zero"), "")["problem"] == "ZeroDivisionError: division by zero"
