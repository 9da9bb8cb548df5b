"""An effect that a scene does not call for is not in its plan and leaves no trace.

For every effect there is a scene that calls for it and a plain one that does not (`EFFECTS`; forces join by being registered in
`rigidimpulse.dynamics.forces.KINDS`). In a fresh process the plain scene

    (a) has the effect out of its plan, and the other scene has it in,
    (b) gives the same bits as in a process that ran the other scene first,
    (c) imports no module of the effect that a scene has to ask for, and no optional package,
    (d) calls no kernel of the effect.

That it takes the same time is measured by `tests/bench/unused_effects.py`.
"""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from rigidimpulse.dynamics.forces import KINDS

FLIGHT = '''
scene = ri.Scene(gravity=(0, 0, -9.81))
scene.add(ri.Body("a", ri.Shape.box((0.2, 0.3, 0.5)), velocity=(1, 0, 3), angular_velocity=(1, 2, 3), mass=2.0))
'''
BALLS = '''
scene = ri.Scene(gravity=(0, 0, 0))
smooth = ri.Material(static_friction=0, dynamic_friction=0, restitution=0.9)
for k in range(3):
    scene.add(ri.Body("abc"[k], ri.Shape.sphere(0.1), position=(0.5 * k, 0.02 * k, 0), velocity=(1.0 - k, 0, 0), mass=2.0, material=smooth))
'''
GROUND = '''
scene = ri.Scene(gravity=(0, 0, -9.81))
rough = ri.Material(static_friction=0.4, dynamic_friction=0.3, restitution=0.2)
scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=rough))
for k in range(2):
    place = (0.5 * k, 0, 0.3)
    scene.add(ri.Body("ab"[k], ri.Shape.box((0.2, 0.3, 0.5)), position=place, velocity=(1, 0.3, 0), mass=2.0, material=rough))
'''
PLAIN = {"flight": FLIGHT, "balls": BALLS, "ground": GROUND}

EFFECTS = {
    "forces at points": ("ground", 'scene.add(ri.ConstantForce("a", (0, 0, 1), point=(0.1, 0, 0.3)))', ["dynamics.forces.timed"]),
    "drag": ("flight", "scene.add(ri.Drag(0.1))", ["dynamics.forces.drag"]),
    "energy terms": (
        "ground", 'scene.add(ri.EnergyForce(ri.PinPoints("a", "b", (0, 0, 0.3), (0.5, 0, 0.3), 9.0)))', ["dynamics.forces.energy"]
    ),
    "force fields": ("ground", "scene.add(ri.ForceField(lambda t, x, v: -v))", ["dynamics.forces.field"]),
    "PD controllers": ("flight", 'scene.add(ri.PDController("a", velocity=(1, 0, 0), damping=1.0))', ["dynamics.forces.pd"]),
    "attractors": ("balls", "scene.add(ri.PointAttractor((0, 0, 9), 1.0))", ["dynamics.forces.field"]),
    "springs": ("ground", 'scene.add(ri.Spring("a", "b", (0, 0, 0.3), (0.5, 0, 0.3), 9.0))', ["dynamics.forces.spring"]),
    "thrusters": ("flight", 'scene.add(ri.Thruster("a", 10.0, 0.1, (0, 0, 1), 1.0))', ["dynamics.forces.thruster"]),
    "harmonic forces": ("ground", 'scene.add(ri.HarmonicForce("a", 1.0, 2.0, (1, 0, 0)))', ["dynamics.forces.harmonic"]),
    "sampled forces": ("balls", 'scene.add(ri.SampledForce("a", [0, 1], [(0, 0, 1), (0, 0, 0)]))', ["dynamics.forces.sampled"]),
    "flexible bodies": (
        "flight", 'scene.add(ri.FlexibleBody("net", [(5, 0, 0), (6, 0, 0), (5, 1, 0)], [(0, 1, 2)], mass=0.1, stiffness=100.0))',
        ["dynamics.soft_body"],
    ),
    "constant forces": ("ground", 'scene.add(ri.ConstantForce("a", (1, 0, 0)))', []),
    "gravity": ("balls", "scene.gravity = (0, 0, -1)", []),
    "joints": ("ground", 'scene.add(ri.BallJoint("a", "b", (0.25, 0, 0.3)))', ["dynamics.constraints.joint_sub_step"]),
    "friction": ("balls", 'scene.add(ri.Body("d", ri.Shape.sphere(0.1), position=(9, 9, 9), material=ri.Material(static_friction=1)))', []),
    "rolling friction": (
        "ground", 'scene.add(ri.Body("c", ri.Shape.sphere(0.1), position=(2, 0, 0.2), material=ri.Material(rolling_friction=0.01)))',
        ["dynamics.constraints.rolling_friction"],
    ),
    "sub-stepped islands": (
        "ground", "settings = {'accuracy': ri.Accuracy(contact_solver='substepped')}", ["engine.substepped.stages"]
    ),
    "contact forces": (
        "balls", 'scene.gravity = (0, 0, -1)\nscene.add(ri.Body("floor", ri.Shape.half_space(offset=-0.1), motion="static"))',
        ["engine.exact.step_size", "engine.exact.event_loop"],
    ),
    "contact detection": (
        "flight", 'scene.add(ri.Body("b", ri.Shape.box(1), position=(0, 0, -9)))', ["collision.broad_phase", "collision.time_of_impact"]
    ),
    "FCL contacts": (
        "ground", 'settings = {"accuracy": "classic"}', ["collision.time_of_impact.fcl_gaps"]
    ),
    "event kernel": (
        "ground", 'scene.add(ri.Body("c", ri.Shape.sphere(0.1), position=(9, 9, 2), material=rough))', ["engine.spheres"]
    ),
    "triggers": ("flight", 'scene.add(ri.Trigger("gate", ri.Shape.box(1), position=(0, 0, 2)))', ["engine.triggers"]),
    "gyroscopic term": ("balls", 'scene.add(ri.Body("d", ri.Shape.box((1, 2, 3)), position=(9, 9, 9)))', []),
}
"""Name in the plan: the plain scene, what calls for the effect, modules of the package whose kernels are the effect's."""
IN_RESERVE = {"sub-stepped islands"}
KERNELS = {"FCL contacts", "springs", "joints", "sub-stepped islands", "contact forces", "contact detection", "event kernel"}
"""Effects with kernels of their own."""
ASKED_FOR = (
    "rigidimpulse.dynamics.forces.", "rigidimpulse.dynamics.soft_body", "rigidimpulse.io", "rigidimpulse.engine.triggers",
    "rigidimpulse.engine.varying_forces", "rigidimpulse.engine.soft_bodies", "rigidimpulse.engine.fcl_contacts",
    "rigidimpulse.collision.distance.fcl_trees", "rigidimpulse.collision.manifold.fcl_contacts",
    "rigidimpulse.collision.time_of_impact.fcl_gaps",
)  # fmt: skip
"""Modules that are imported only where a scene asks for them; those of forces that do not vary are in ALWAYS."""
ALWAYS = {"rigidimpulse.dynamics.forces.constant", "rigidimpulse.io", "rigidimpulse.io.registration"}
OPTIONAL = {"clarabel", "defusedxml", "meshcat", "mujoco", "pybullet", "dask", "h5py", "pxr", "matplotlib", "playwright"}

REPORT = '''
import gc, json, sys
from rigidimpulse.core.kernels import Kernel
called = {k.__module__ for k in gc.get_objects() if type(k) is Kernel and "entry" in k.__dict__ and k.entry.signatures}
plan = {line.name: line.included for line in run.plan.lines}
used = {line.name for line in first.plan.lines if line.included}
print(json.dumps({"used": sorted(used), "hash": run.state_hash(), "plan": plan, "modules": sorted(sys.modules), "kernels": sorted(called)}))
'''


def process(*parts: str) -> dict:
    """Run parts of a program in a fresh process; returns what it reports of its last run."""
    program = "import rigidimpulse as ri\nsettings = {}\n" + "\n".join(parts)
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1])
    return json.loads(out.stdout.splitlines()[-1])


RUN = "run = ri.simulate(scene, 0.5, **settings)\nsettings = {}"


@cache
def plain(kind: str) -> dict:
    """What a plain scene reports by itself."""
    return process(PLAIN[kind], RUN, "first = run", REPORT)


def test_every_registered_force_is_listed() -> None:
    assert set(KINDS.values()) <= set(EFFECTS)


@pytest.mark.parametrize("name", EFFECTS)
def test_unused_effect_leaves_no_trace(name: str) -> None:
    kind, call, modules = EFFECTS[name]
    without, after = plain(kind), process(PLAIN[kind], call, RUN, "first = run", PLAIN[kind], RUN, REPORT)
    # What may be called upon in the middle of a run is in the plan of a scene that does not call for it; its kernels are not called.
    assert name in after["used"] and (name in IN_RESERVE or not without["plan"][name])
    assert after["hash"] == without["hash"]
    asked = [m for m in without["modules"] if m.startswith(ASKED_FOR) and m not in ALWAYS]
    assert not asked and not OPTIONAL.intersection(without["modules"])
    names = tuple(f"rigidimpulse.{module}" for module in modules)
    called = [{kernel for kernel in run["kernels"] if kernel.startswith(names)} for run in (without, after)]
    assert not modules or not called[0]
    # The list has teeth: the scene that calls for the effect does call its kernels, where it has some.
    assert name not in KERNELS or called[1]
