"""Effects left out or had in by name: what changes is what the effect does, the status says so, and nonsense is refused."""

from __future__ import annotations

import pytest

import rigidimpulse as ri

ROUGH = ri.Material(static_friction=0.5, dynamic_friction=0.5, rolling_friction=0.01, restitution=0.0)


def block() -> ri.Scene:
    """A block that slides on a floor, pushed and held by a hinge, and a ball in the air with drag."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    scene.add(ri.Body("block", ri.Shape.box((0.4, 0.3, 0.2)), position=(0, 0, 0.1), velocity=(2, 0, 0), mass=2.0, material=ROUGH))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 3, 3), velocity=(0, 1, 0), mass=1.0, material=ROUGH))
    scene.add(ri.ConstantForce("ball", (0.5, 0, 0)))
    scene.add(ri.Drag(0.3, bodies=["ball"]))
    return scene


SEEN = {
    "friction": ("block", lambda run: run.velocity("block")[-1, 0], 2.0),
    "gravity": ("ball", lambda run: run.position("ball")[-1, 2], 3.0),
    "constant forces": ("ball", lambda run: run.velocity("ball")[-1, 0], 0.0),
    "drag": ("ball", lambda run: run.velocity("ball")[-1, 1], 1.0),
    "contact detection": ("block", lambda run: run.position("block")[-1, 2], 0.1 - 0.5 * 9.81 * 0.25**2),
}
"""What shows that an effect is out: the body, what to look at, and its value."""


@pytest.mark.parametrize("name", SEEN)
def test_effect_left_out_does_nothing_and_the_status_says_so(name: str) -> None:
    _, look, value = SEEN[name]
    with_it, without = ri.simulate(block(), 0.25), ri.simulate(block(), 0.25, effects={name: False})
    assert with_it.status.ok and look(with_it) != pytest.approx(value, rel=1e-2)
    assert look(without) == pytest.approx(value, rel=1e-9)
    assert not without.status.ok and f"effect left out ({name})" in without.status.message
    line = next(line for line in without.plan.lines if line.name == name)
    assert not line.included


def test_choices_that_change_nothing_change_nothing() -> None:
    plain = ri.simulate(block(), 0.25)
    for choice in ({"joints": False}, {"springs": False}, {"friction": True}, {}):
        run = ri.simulate(block(), 0.25, effects=choice)
        assert run.status.ok and run.state_hash() == plain.state_hash()


def test_effect_had_in_is_in() -> None:
    scene = ri.Scene(gravity=(0, 0, 0))
    for k in range(2):
        scene.add(ri.Body("ab"[k], ri.Shape.sphere(0.1), position=(k, 0, 0), velocity=(1 - 2 * k, 0, 0)))
    plain, forced = ri.simulate(scene, 1.0), ri.simulate(scene, 1.0, effects={"contact forces": True, "gyroscopic term": True})
    included = [{line.name for line in run.plan.lines if line.included} for run in (plain, forced)]
    assert included[1] - included[0] == {"contact forces", "gyroscopic term"}
    # Lasting contact is held at its gap, 1e-6 of the size.
    assert plain.positions == pytest.approx(forced.positions, abs=1e-6)


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        ({"fricton": False}, "unknown effect 'fricton'; did you mean 'friction'"),
        ({"springs": True}, "'springs' cannot be enabled: the scene has none"),
        ({"contact forces": False}, "'contact forces' cannot be left out"),
        ({"forced flight": False}, "'forced flight' cannot be left out"),
    ],
)
def test_nonsense_is_refused(choice: dict[str, bool], words: str) -> None:
    with pytest.raises(ri.SceneError, match=words):
        ri.simulate(block(), 0.1, effects=choice)
