"""What is no number is refused when the scene is compiled, by name, wherever a number is asked for: text with digits in it, too."""

from __future__ import annotations

import inspect
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.core.numeric import number_of, numbers_of
from rigidimpulse.engine.compile_scene import compile_scene

NO_NUMBERS: tuple[Any, ...] = ("5", b"5", object(), 1 + 2j, ["1", "2", "3"], {"x": 1.0}, float("nan"))
NAMES = {"name", "a", "b", "motion", "mode", "translation", "rotation", "restitution_combine", "friction_combine"}
BOX = ri.Shape.box((1.0, 1.0, 1.0))
JOINTS: dict[Any, dict[str, Any]] = {
    ri.BallJoint: {"anchor": (1.0, 0.0, 0.0)},
    ri.HingeJoint: {"anchor": (1.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)},
    ri.SliderJoint: {"anchor": (1.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)},
    ri.FixedJoint: {},
    ri.DistanceJoint: {"anchor_a": (0.0, 0.0, 0.0), "anchor_b": (2.0, 0.0, 0.0)},
    ri.SixAxisJoint: {"anchor": (1.0, 0.0, 0.0)},
}


def two_boxes(*effects: Any, **changed: Any) -> ri.Scene:
    """Two boxes, one of them changed."""
    scene = ri.Scene()
    scene.add(ri.Body("a", **{"shape": BOX, **changed}))
    scene.add(ri.Body("b", BOX, position=(2.0, 0.0, 0.0)))
    for effect in effects:
        scene.add(effect)
    return scene


def parameters_of(kind: Any) -> list[str]:
    """What it takes beside names."""
    return [name for name in inspect.signature(kind).parameters if name not in NAMES]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", parameters_of(ri.Body))
def test_a_body_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ri.SceneError, match=r"body 'a'"):
        compile_scene(two_boxes(**{name: value}))


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", parameters_of(ri.Material))
def test_a_material_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ri.SceneError, match=name):
        compile_scene(two_boxes(material=ri.Material(**{name: value})))


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in JOINTS for name in parameters_of(kind)])
def test_a_joint_is_refused(kind: Any, name: str, value: Any) -> None:
    arguments = {**JOINTS[kind], name: value}
    with pytest.raises(ri.SceneError, match=kind.__name__):
        compile_scene(two_boxes(kind("a", "b", **arguments)))


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", parameters_of(ri.Motor))
def test_a_motor_is_refused(name: str, value: Any) -> None:
    motor = ri.Motor(**{"damping": 1.0, name: value})
    with pytest.raises(ri.SceneError, match=name):
        compile_scene(two_boxes(ri.HingeJoint("a", "b", (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), motor=motor)))


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", ["lower", "upper", "stiffness", "damping"])
def test_a_limit_is_refused(name: str, value: Any) -> None:
    limit = ri.Limit(translation="x", **{"stiffness": 1.0, name: value})
    with pytest.raises(ri.SceneError, match="SixAxisJoint"):
        compile_scene(two_boxes(ri.SixAxisJoint("a", "b", (1.0, 0.0, 0.0), limits=[limit])))


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("make", [ri.Shape.sphere, ri.Shape.box, lambda x: ri.Shape.capsule(1.0, x), lambda x: ri.Shape.cylinder(x, 1.0)])
def test_a_shape_is_refused(make: Any, value: Any) -> None:
    with pytest.raises(ri.SceneError):
        compile_scene(two_boxes(shape=make(value)))


@pytest.mark.parametrize("value", [*NO_NUMBERS, None], ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", ["duration", "fps"])
def test_a_run_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ri.SceneError, match=name):
        ri.simulate(two_boxes(), **{"duration": 0.0, name: value})


@pytest.mark.parametrize("name", ["step", "tolerance", "substep_motion", "iterations", "penalty_stiffness", "penalty_damping"])
def test_text_is_no_setting(name: str) -> None:
    with pytest.raises(ri.SceneError, match=f"{name} = '1'"):
        ri.Accuracy(**{name: "1"})


def test_numbers_of_all_kinds_are_numbers() -> None:
    one: Any = np.float32(1.0)
    assert [number_of(value) for value in (1, 1.0, one, np.int64(1), True, np.array(1.0))] == [1.0] * 6
    assert numbers_of([one, 1, 1.0]).tolist() == [1.0] * 3
    assert numbers_of(np.ones(3, np.float32)).dtype == np.float64
    fractions: Any = [Fraction(1, 2), 1]
    assert numbers_of(fractions).tolist() == [0.5, 1.0]


def test_what_no_float_holds_is_none() -> None:
    ragged: Any = [1.0, [2.0]]
    assert np.isnan(number_of(10**400))
    assert np.isnan(numbers_of(ragged)).all()
    assert np.isnan(numbers_of(np.array(["1", 2.0], object))).tolist() == [True, False]
    with pytest.raises(ri.SceneError, match="mass"):
        compile_scene(two_boxes(mass=10**400))
