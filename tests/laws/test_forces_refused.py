"""Bad forces are refused by name, value and remedy; scenes without forces carry none of their modules."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.dynamics.forces import KINDS

NAN, INF = float("nan"), float("inf")
KEYS = ri.Keyframes([0, 1], [(0, 0, 0), (1, 0, 0)])


def table() -> ri.Scene:
    """A floor, a lift that moves on a path, and two blocks."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("lift", ri.Shape.box(1), position=(5, 0, 1), motion="kinematic", velocity=(0, 0, 1)))
    scene.add(ri.Body("block", ri.Shape.box(1), position=(0, 0, 1), mass=2.0))
    scene.add(ri.Body("other", ri.Shape.box(1), position=(0, 5, 1), mass=2.0))
    return scene


BAD = {
    "drag on nobody": (ri.Drag(1.0, bodies=["blok"]), r"Drag.*unknown body 'blok'; did you mean 'block'"),
    "drag on a floor": (ri.Drag(1.0, bodies=["floor"]), r"Drag.*'floor' is not dynamic.*name one of them"),
    "drag on a text": (ri.Drag(1.0, bodies="block"), r"bodies is the text 'block'.*\['block'\]"),
    "negative drag": (ri.Drag(-1.0), r"Drag.*linear is -1.0.*>= 0"),
    "drag that is no number": (ri.Drag(0.0, NAN), r"Drag.*quadratic is nan"),
    "drag without strength": (ri.Drag(), r"both coefficients are 0.*leave the drag out"),
    "harmonic on a lift": (ri.HarmonicForce("lift", 1, 1, (1, 0, 0)), r"HarmonicForce\('lift'\).*not dynamic"),
    "harmonic nowhere": (ri.HarmonicForce("block", 1, 1, (0, 0, 0)), r"direction is zero.*give the direction"),
    "harmonic of text": (ri.HarmonicForce("block", "much", 1, (1, 0, 0)), r"amplitude is 'much'"),
    "harmonic too fast": (ri.HarmonicForce("block", 1, INF, (1, 0, 0)), r"frequency is inf"),
    "harmonic at a bad point": (ri.HarmonicForce("block", 1, 1, (1, 0, 0), point=(0, 0)), r"point is \(0, 0\)"),
    "samples backwards": (ri.SampledForce("block", [1, 0], np.ones((2, 3))), r"times do not increase.*sort"),
    "samples of two times": (ri.SampledForce("block", [0, 1, 1], np.ones((3, 3))), r"times do not increase.*jump"),
    "samples of unlike length": (ri.SampledForce("block", [0, 1], np.ones((3, 3))), r"shape \(2,\), forces \(3, 3\).*\(k, 3\)"),
    "one sample": (ri.SampledForce("block", [0], np.ones((1, 3))), r"k >= 2"),
    "samples that are no numbers": (ri.SampledForce("block", [0, 1], [(0, 0, 0), (NAN, 0, 0)]), r"give finite arrays"),
    "samples on nobody": (ri.SampledForce("cow", [0, 1], np.ones((2, 3))), r"unknown body 'cow'"),
    "a push at no point": (ri.ConstantForce("block", (1, 0, 0), point=(0, 0, NAN)), r"ConstantForce\('block'\).*point is"),
    "attractor nowhere": (ri.PointAttractor((0, 0), 1.0), r"PointAttractor.*center is \(0, 0\)"),
    "attractor that is a floor": (ri.PointAttractor("floor", 1.0), r"'floor' is not dynamic"),
    "attractor with bad power": (ri.PointAttractor((0, 0, 0), 1.0, power=NAN), r"power is nan"),
    "attractor too soft": (ri.PointAttractor((0, 0, 0), 1.0, softening=-1.0), r"softening is -1.0.*>= 0, in m"),
    "attractor of nobody": (ri.PointAttractor("block", 1.0, bodies=["block"]), r"it attracts no body but its centre"),
    "field that is none": (ri.ForceField(3.0), r"force is 3.0.*give a function"),
    "field of a bad shape": (ri.ForceField(lambda t, x, v: np.zeros(3)), r"returns the shape \(3,\) for 2 bodies.*\(k, 3\)"),
    "field without bound": (ri.ForceField(lambda t, x, v: x * NAN), r"not finite"),
    "field that fails": (ri.ForceField(lambda t: 0.0), r"its function fails: TypeError.*arrays"),
    "spring on one body": (ri.Spring("block", "block", (0, 0, 0), (1, 0, 0), 1.0), r"both ends are the same"),
    "spring of two worlds": (ri.Spring(None, None, (0, 0, 0), (1, 0, 0), 1.0), r"both ends are the same"),
    "spring between what stands": (ri.Spring("floor", "lift", (0, 0, 0), (1, 0, 0), 1.0), r"neither end is dynamic"),
    "spring that pushes": (ri.Spring(None, "block", (0, 0, 0), (1, 0, 0), -1.0), r"stiffness is -1.0.*>= 0, in N/m"),
    "spring that drives": (ri.Spring(None, "block", (0, 0, 0), (1, 0, 0), 1.0, -1.0), r"damping is -1.0"),
    "spring of no length": (ri.Spring(None, "block", (0, 0, 0), (1, 0, 0), 1.0, rest_length=-0.1), r"rest_length is -0.1"),
    "spring from nowhere": (ri.Spring(None, "block", (0, 0), (1, 0, 0), 1.0), r"anchor_a is \(0, 0\)"),
    "spring to nobody": (ri.Spring(None, "blocks", (0, 0, 0), (1, 0, 0), 1.0), r"unknown body 'blocks'; did you mean 'block'"),
    "thruster of all its mass": (ri.Thruster("block", 1.0, 1.0, (1, 0, 0), 2.0), r"propellant, 2 kg.*not less than.*2 kg.*give it more"),
    "thruster that sucks": (ri.Thruster("block", 1.0, -1.0, (1, 0, 0), 1.0), r"mass_flow is -1.0.*> 0"),
    "thruster without fuel": (ri.Thruster("block", 1.0, 1.0, (1, 0, 0), 0.0), r"propellant is 0.0.*> 0"),
    "thruster nowhere": (ri.Thruster("block", 1.0, 1.0, (0, 0, 0), 1.0), r"direction is zero"),
    "thruster never": (ri.Thruster("block", 1.0, 1.0, (1, 0, 0), 1.0, start=NAN), r"start is nan"),
    "controller of nothing": (ri.PDController("block"), r"gains are 0.*give a stiffness"),
    "controller to nowhere": (ri.PDController("block", stiffness=1.0), r"stiffness is 1.0, but there is no position"),
    "controller to no turn": (ri.PDController("block", position=(0, 0, 0), angular_stiffness=1.0), r"but there is no orientation"),
    "controller of two minds": (
        ri.PDController("block", position=KEYS, orientation=(1, 0, 0, 0), stiffness=1.0, angular_stiffness=1.0),
        r"keyframes and an orientation",
    ),
    "controller without turn": (
        ri.PDController("block", orientation=(0, 0, 0, 0), angular_stiffness=1.0), r"orientation is \(0, 0, 0, 0\).*quaternion",
    ),
    "target without gain": (
        ri.PDController("block", position=(0, 0, 0), angular_damping=1.0), r"position is given, but nothing pulls to it.*stiffness",
    ),
    "velocity without gain": (
        ri.PDController("block", velocity=(1, 0, 0), position=(0, 0, 0), stiffness=1.0),
        r"velocity is given, but nothing pulls to it.*damping",
    ),
    "controller too weak": (ri.PDController("block", position=(0, 0, 0), stiffness=1.0, max_force=0.0), r"max_force.*> 0"),
    "controller of text": (ri.PDController("block", position=(0, 0, 0), stiffness=1.0, max_force="all"), r"max_force"),
    "controller of a lift": (ri.PDController("lift", position=(0, 0, 0), stiffness=1.0), r"'lift' is not dynamic"),
    "energy that is none": (ri.EnergyForce(3.0), r"term is 3.0.*give an energy term"),
    "exact pin as a force": (ri.EnergyForce(ri.PinPoints(None, "block", (0, 0, 0), (0, 0, 0))), r"infinite.*finite weight"),
    "energy of a path": (ri.EnergyForce(ri.Curvature(1.0)), r"term is Curvature.*give an energy term"),
    "heights as a force": (ri.EnergyForce(ri.GravityPotential()), r"acts in every run already.*leave it out"),
    "energy of nobody": (ri.EnergyForce(ri.RestoreShape(["block", "blok"])), r"unknown body 'blok'"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_forces_are_refused_by_name(case: str) -> None:
    force, words = BAD[case]
    scene = table()
    scene.add(force)
    with pytest.raises(ri.SceneError, match=f"(?s){words}"):
        ri.simulate(scene, 0.1)


def test_two_forces_of_one_name_are_refused() -> None:
    scene = table()
    for k in (1.0, 2.0):
        scene.add(ri.Spring(None, "block", (0, 0, 2), (0, 0, 1), k, name="rope"))
    with pytest.raises(ri.SceneError, match=r"'rope'.*different names"):
        ri.simulate(scene, 0.1)


@pytest.mark.parametrize(("one", "other"), [("both", "both"), ("drag", "impact"), ("contact", "spring")])
def test_names_that_the_ledger_cannot_keep_apart_are_refused(one: str, other: str) -> None:
    """Forces of two kinds with one name, or with that of what impacts and contacts take: one would hide the other."""
    scene = table()
    scene.add(ri.Drag(1.0, name=one))
    scene.add(ri.Spring(None, "block", (0, 0, 2), (0, 0, 1), 10.0, name=other))
    with pytest.raises(ri.SceneError, match=r"is a name of .* a name of its own"):
        ri.simulate(scene, 0.1)


@pytest.mark.parametrize("force", [ri.Drag(1.0), ri.Drag(1.0, bodies=[]), ri.PointAttractor((0, 0, 0), 1.0)])
def test_forces_on_no_body_are_refused(force: object) -> None:
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(force)
    with pytest.raises(ri.SceneError, match=r"no body of the scene is dynamic|bodies is empty"):
        ri.simulate(scene, 0.1)


WITHOUT = """
import sys, rigidimpulse as ri
scene = ri.Scene()
scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
scene.add(ri.Body("ball", ri.Shape.sphere(0.2), position=(0, 0, 0.3)))
scene.add(ri.ConstantForce("ball", (1, 0, 0)))
run = ri.simulate(scene, 0.3)
print(sorted(m for m in sys.modules if m.startswith("rigidimpulse.dynamics.forces") or m.endswith("force_step")))
for line in run.plan.lines:
    if line.included:
        print(line.name)
"""


def test_a_scene_without_varying_forces_imports_none_of_their_modules() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True)
    modules, *included = done.stdout.splitlines()
    assert modules == str([f"rigidimpulse.dynamics.forces{name}" for name in ("", ".constant")])
    assert "constant forces" in included and not {*KINDS.values(), "forced flight"}.intersection(included)


def test_every_force_has_a_line_in_the_plan() -> None:
    scene = table()
    scene.add(ri.Drag(linear=1.0, bodies=["block"]))
    run = ri.simulate(scene, 0.1)
    lines = {line.name: line for line in run.plan.lines}
    assert lines["drag"].included and lines["drag"].calls > 0 and "1" in lines["drag"].reason
    assert lines["forced flight"].included and not lines["exact flight"].included
    assert not any(lines[kind].included for kind in KINDS.values() if kind != "drag")
