"""What is compiled ahead of a first run is what runs call: with other types it would be compiled for nothing, and again."""

import subprocess
import sys

import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.core.kernels import Kernel
from rigidimpulse.engine import warm_up
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.gallery import load

PROGRAM = """
import numpy as np
import rigidimpulse as ri
from rigidimpulse.engine.absent import NoCompiledLoop
from rigidimpulse.engine.simulate import complete, prepare
from rigidimpulse.engine import warm_up_parts
from rigidimpulse.core.kernels import KERNELS
from rigidimpulse.gallery import load

for part in range(len(warm_up_parts.PARTS["{kind}"])):
    warm_up_parts.compile_part("{kind}", part)
ahead = {{kernel.name: set(kernel.entry.overloads) for kernel in KERNELS if kernel.entry.overloads}}
entry = load("{scene}")
run = prepare(entry.scene(), np.arange(19) / 60.0, entry.accuracy)
run.compiled = NoCompiledLoop()
complete(run, 0.3)
for kernel in KERNELS:
    if kernel.name in ahead and set(kernel.entry.overloads) - ahead[kernel.name]:
        print(kernel.name)
print(len(ahead), "compared")
"""


@pytest.mark.parametrize(
    ("kind", "scene"),
    [("contacts", "stack_10"), ("sub-stepped islands", "pile"), ("joints", "arm")],
    ids=["contacts", "sub-stepped islands", "joints"],
)
def test_runs_call_what_was_compiled_ahead(kind, scene):
    program = PROGRAM.format(kind=kind, scene=scene)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    *again, compared = done.stdout.splitlines()
    assert again == []
    assert int(compared.split()[0]) > 5


FIRST_RUN = """
import numpy as np
import rigidimpulse as ri
from rigidimpulse.engine.absent import NoCompiledLoop
from rigidimpulse.engine.simulate import complete, prepare
from rigidimpulse.engine import warm_up_parts
from rigidimpulse.core.kernels import KERNELS

def used():
    return {kernel.name for kernel in KERNELS if kernel.calls or kernel.preparing}

for part in range(len(warm_up_parts.PARTS["contacts"])):
    warm_up_parts.compile_part("contacts", part)
ahead = used()
floor = ri.Body("floor", ri.Shape.half_space(), motion="static")
prepared = prepare(ri.Scene(bodies=[floor, ri.Body("box", ri.Shape.box(0.2), position=(0, 0, 1))]), np.arange(61) / 60.0)
prepared.compiled = NoCompiledLoop()
run = complete(prepared, 1.0)
assert len(run.impacts) > 1 and len(run.contacts) > 0
print(*sorted(used() - ahead))
"""


def test_nothing_is_left_to_compile_for_a_box_that_falls_on_a_floor():
    done = subprocess.run([sys.executable, "-c", FIRST_RUN], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_only_what_a_scene_needs_and_the_cache_lacks_is_compiled():
    ball = ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 0, 1))
    flies = compile_scene(ri.Scene(bodies=[ball]))
    arm = compile_scene(load("arm").scene())
    assert warm_up.kernels_to_compile(flies, False, False, never) == []
    assert warm_up.kernels_to_compile(flies, True, True, never) == ["impacts of balls", "sub-stepped islands"]
    assert "joints" in warm_up.kernels_to_compile(arm, False, False, never)
    assert warm_up.kernels_to_compile(arm, True, True, always) == []


def test_kernels_of_any_shapes_are_for_what_is_not_made_of_polyhedra():
    """A bowl that stands counts as well as what falls into it."""
    ring = ri.Shape.mesh(*_square_ring())
    box, capsule = ri.Shape.box(0.2), ri.Shape.capsule(0.1, 0.2)
    for shape, motion, needed in ((box, "static", False), (ring, "static", True), (capsule, "dynamic", True)):
        scene = ri.Scene(bodies=[ri.Body("box", box, position=(0, 0, 1)), ri.Body("other", shape, motion=motion)])
        kinds = warm_up.kernels_to_compile(compile_scene(scene), False, True, never)
        assert ("any shapes in sub-stepped islands" in kinds) == needed


def _square_ring():
    """Vertices and faces of a ring of square section."""
    ring = trimesh.creation.annulus(0.2, 0.4, 0.2, sections=8)
    return ring.vertices, ring.faces


SECOND_SCENE = """
import rigidimpulse as ri
from rigidimpulse.core.kernels import KERNELS

def run_of_two(shape, rolling_friction):
    material = ri.Material(rolling_friction=rolling_friction)
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    for k in range(2):
        scene.add(ri.Body(f"body {k}", shape, position=(0, 0.05 * k, 0.2 + 0.3 * k), material=material))
    ri.simulate(scene, 0.5)

def types():
    return {kernel.name: len(kernel.entry.overloads) for kernel in KERNELS if kernel.calls}

run_of_two(ri.Shape.box((0.1, 0.2, 0.2)), 0.0)
first = types()
run_of_two(ri.Shape.cylinder(0.1, 0.2), 0.001)
second = types()
print(len(first), *[name for name in first if second[name] != first[name]])
"""


def test_cylinders_and_rolling_friction_need_no_kernels_of_their_own():
    """The first scene with a cylinder compiled for 19 s more, and one with rolling friction for 20 s: kernels had other types there."""
    done = subprocess.run([sys.executable, "-c", SECOND_SCENE], capture_output=True, text=True, check=True)
    compared, *compiled_again = done.stdout.split()
    assert int(compared) > 5
    assert compiled_again == []


def never(_kernel: Kernel) -> bool:
    """A machine that has run nothing yet."""
    return False


def always(_kernel: Kernel) -> bool:
    """A machine that has run everything."""
    return True
