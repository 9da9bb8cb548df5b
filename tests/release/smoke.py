"""What must work where the package is installed: run with the Python of an environment, in an empty folder, outside of the clone.

    python smoke.py [first]

Prints a table of JSON: what was done with "ok" or what went wrong, hashes of the runs, seconds of the first picture, and how many kernels
its process compiled and loaded (others may compile for it). `first` does the first picture only.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

PAGE = 500_000
"""Bytes that a page has at least: the viewer is in it."""
SAVED, LOADED = "[cache] data saved", "[cache] data loaded"
"""What numba says of a kernel that it has compiled and of one that was compiled before (NUMBA_DEBUG_CACHE)."""
ROBOT = """<robot name="rod"><link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.5"/><geometry><box size="0.1 0.1 1"/></geometry></collision></link></robot>"""


def command(*arguments: str, **variables: str) -> str:
    """What the installed command prints, with variables of its environment."""
    program = Path(sys.executable).with_name("rigidimpulse")
    environment = {**os.environ, **variables}
    done = subprocess.run([str(program), *arguments], capture_output=True, text=True, timeout=1200, env=environment)
    assert done.returncode == 0, f"exit code {done.returncode}: {done.stderr[-500:]}"
    return done.stdout


def first_picture(told: dict) -> None:
    """The main demo, with its page, and what it takes: of this process and of all that it starts."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    said = command("demo", "spot", "-o", "spot.html", "-o", "spot.npz", NUMBA_DEBUG_CACHE="1")
    told["seconds"] = round(perf_counter() - start, 2)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    told["compiled"], told["loaded"] = said.count(SAVED), said.count(LOADED)
    told["processor seconds"] = round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 2)
    assert "FAILED" not in said and Path("spot.html").stat().st_size > PAGE, said
    from rigidimpulse import load_recording

    told["hashes"]["demo spot"] = load_recording("spot.npz").state_hash()


def throw_a_die(told: dict) -> None:
    """A die, thrown on a table, until it rests; saved and loaded."""
    import rigidimpulse as ri

    scene = ri.Scene(gravity=(0, 0, -9.81))
    wood = ri.Material(density=1200, restitution=0.3, static_friction=0.4, dynamic_friction=0.3)
    scene.add(ri.Body("table", ri.Shape.half_space(), motion="static", material=wood))
    pose, throw = (0.3, 0.5, -0.2, 0.8), (0.7, 0.05, 0.0)
    die = ri.Shape.box(0.016)
    scene.add(ri.Body("die", die, position=(0, 0, 0.1), orientation=pose, velocity=throw, angular_velocity=(11, -17, 5), material=wood))
    run = ri.simulate(scene, 1.0)
    assert run.status.ok, run.status.message
    told["hashes"]["die"] = run.state_hash()
    run.export("die.npz")
    assert ri.load_recording("die.npz").state_hash() == run.state_hash()
    run.export("die.glb")
    assert Path("die.glb").read_bytes()[:4] == b"glTF"
    if find_spec("h5py"):
        kept = ri.simulate(scene, 1.0, cache="die.h5")
        assert kept.state_hash() == ri.load_recording("die.h5").state_hash() == run.state_hash()
    else:
        try:
            ri.simulate(scene, 1.0, cache="die.h5")
        except ri.SceneError as error:
            assert "pip install rigidimpulse[cache]" in str(error), error
        else:
            raise AssertionError("a cache without h5py")


def explain_on_the_command_line(_told: dict) -> None:
    """The plan of a scene."""
    assert "contact detection" in command("explain", "spot")


def use_extras(told: dict) -> None:
    """What needs optional libraries: a robot, a file of USD, a quadratic program."""
    import rigidimpulse as ri

    if not find_spec("mujoco"):
        return
    Path("rod.urdf").write_text(ROBOT)
    rod = ri.simulate(ri.load_scene("rod.urdf", fixed_base=False), 0.1)
    told["hashes"]["rod"] = rod.state_hash()
    rod.export("rod.usda")
    assert "def Cube" in Path("rod.usda").read_text()
    scene = ri.Scene(gravity=(0, 0, -9.81), bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static")])
    scene.add(ri.Body("box", ri.Shape.box(1.0), position=(0, 0, 0.5)))
    told["hashes"]["box by qp"] = ri.simulate(scene, 0.1, accuracy=ri.Accuracy(contact_solver="qp")).state_hash()


STEPS: tuple[Callable[[dict], None], ...] = (first_picture, throw_a_die, explain_on_the_command_line, use_extras)


def main() -> None:
    """Do all, and print the table."""
    import rigidimpulse

    told: dict = {"hashes": {}, "steps": {}, "package": str(Path(rigidimpulse.__file__).parent)}
    for step in STEPS[: 1 if sys.argv[1:] == ["first"] else len(STEPS)]:
        try:
            step(told)
        except Exception as error:
            told["steps"][step.__name__] = f"{type(error).__name__}: {str(error)[:500]}"
        else:
            told["steps"][step.__name__] = "ok"
    print(json.dumps(told))


if __name__ == "__main__":
    main()
