"""Materials and how two of them combine."""

import itertools

import pytest

from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.material import COMBINE_MODES, Material, combine

OPERATION = {
    "average": lambda a, b: (a + b) / 2,
    "minimum": min,
    "maximum": max,
    "multiply": lambda a, b: a * b,
}


@pytest.mark.parametrize(("mode_a", "mode_b"), list(itertools.product(COMBINE_MODES, repeat=2)))
def test_modes_combine_by_the_rule_of_gltf(mode_a, mode_b):
    """KHR_physics_rigid_bodies: average before minimum before maximum before multiply, whichever body has it."""
    a = Material(1, 0.25, 0.5, 0.375, 0.125, restitution_combine=mode_a, friction_combine=mode_b)
    b = Material(1, 0.75, 0.875, 0.625, 0.5, restitution_combine=mode_b, friction_combine=mode_a)
    operation = OPERATION[next(mode for mode in COMBINE_MODES if mode in (mode_a, mode_b))]
    expected = tuple(operation(*pair) for pair in ((0.25, 0.75), (0.5, 0.875), (0.375, 0.625), (0.125, 0.5)))
    assert combine(a, b) == expected == combine(b, a)


def test_what_one_body_leaves_unstated_is_the_others():
    ball = Material(restitution=0.8, static_friction=0.0, tangential_restitution=1.0)
    assert combine(ball, Material()) == (0.8, 0.0, 0.0, 1.0) == combine(Material(), ball)
    assert combine(Material(), Material()) == (0.0, 0.5, 0.5, 0.0)
    assert combine(Material(restitution=0.4), Material(restitution=0.0))[0] == 0.2


def test_one_friction_stands_for_both():
    assert Material(static_friction=0.6).frictions() == (0.6, 0.6)
    assert Material(dynamic_friction=0.3).frictions() == (0.3, 0.3)
    assert Material(static_friction=0.6, dynamic_friction=0.3).frictions() == (0.6, 0.3)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"restitution": 1.5}, "restitution is 1.5; give a value from 0 .* any_restitution"),
        ({"restitution": -0.1}, "restitution is -0.1"),
        ({"restitution": float("nan")}, "restitution is nan"),
        ({"restitution": "high"}, "restitution is 'high'"),
        ({"tangential_restitution": 2}, "tangential_restitution is 2"),
        ({"static_friction": -1}, "static_friction is -1"),
        ({"static_friction": 0.2, "dynamic_friction": 0.3}, "dynamic_friction 0.3 is above static_friction 0.2"),
        ({"density": 0}, "density is 0 kg/m"),
        ({"density": float("inf")}, "density is inf"),
        ({"density": None}, "density is None"),
        ({"friction_combine": "mean"}, "friction_combine is 'mean'; give one of 'average'"),
    ],
)
def test_values_without_meaning_are_refused(settings, words):
    with pytest.raises(SceneError, match=words):
        Material(**settings).check()


def test_restitution_outside_its_range_can_be_asked_for():
    Material(restitution=1.2, any_restitution=True).check()
    with pytest.raises(SceneError):
        Material(restitution=float("nan"), any_restitution=True).check()
