"""What docs/architecture.md says of adding something is true: an exporter, a force and a joint are added from outside, and obey their laws.

Each is one file of `worked_examples/`. It stands for the new file of the list in the documentation; the files where such things are
registered must be in that list, too. Numba takes kernels from names of a module only, so a pair of the narrow phase is added to a copy
of the package: a file, and its entry in the table.
"""

from __future__ import annotations

import inspect
import math
import re
from pathlib import Path
from shutil import copy2
from typing import Any

import numpy as np
import pytest
from package_copy import changed, copy_package, run_against
from rules import ROOT
from worked_examples.exporter import write_heights
from worked_examples.force import MagneticForce
from worked_examples.joint import WireJoint

import rigidimpulse as ri
from rigidimpulse.collision.geometry import HALF_SPACE, ROUND, compile_shape
from rigidimpulse.collision.manifold import dispatch
from rigidimpulse.dynamics import forces
from rigidimpulse.dynamics.constraints.joint import joint_rows
from rigidimpulse.recording.exporters import find_exporter, register_exporter
from rigidimpulse.scene import joint_coordinates
from rigidimpulse.scene.solid import compute_solid
from rigidimpulse.view.display import display_mesh

G = 9.81


def test_an_exporter_is_a_function_and_a_line(tmp_path: Path) -> None:
    register_exporter((".heights",), f"{write_heights.__module__}:{write_heights.__name__}")
    run = ri.simulate(ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(0.1), position=(0, 0, 5))]), 0.5, fps=10)
    run.export(tmp_path / "fall.heights")
    title, *lines = (tmp_path / "fall.heights").read_text(encoding="utf-8").splitlines()
    assert title == "fall"
    for line in lines:
        time, height = map(float, line.split())
        assert height == pytest.approx(5.0 - 0.5 * G * time**2, abs=1e-12)


def test_a_force_is_a_class_with_a_table() -> None:
    # A charge goes round in a circle of radius m v / (q B) with the angular velocity -q B / m: after a full turn it is back.
    mass, speed, strength = 2.0, 3.0, 4.0
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("charge", ri.Shape.sphere(0.1), mass=mass, velocity=(speed, 0, 0)))
    scene.add(MagneticForce("charge", (0, 0, strength)))
    turn, radius = 2.0 * math.pi * mass / strength, mass * speed / strength
    run = ri.simulate(scene, turn, fps=8.0 / turn)
    angle = -2.0 * math.pi * np.arange(9) / 8
    circle = radius * np.column_stack([-np.sin(angle), np.cos(angle) - 1.0, np.zeros(9)])
    np.testing.assert_allclose(run.position("charge"), circle, atol=1e-5 * radius)
    assert run.plan.line(MagneticForce.kind).included


def test_a_joint_is_a_class_with_rows() -> None:
    # A bead slides down a smooth wire of slope a: s = g sin(a) t^2 / 2, and stays on the wire.
    slope = 0.4
    down = np.array([math.cos(slope), 0.0, -math.sin(slope)])
    scene = ri.Scene(gravity=(0, 0, -G))
    scene.add(ri.Body("bead", ri.Shape.sphere(0.1), mass=1.0))
    scene.add(WireJoint(None, "bead", (0, 0, 0), down))
    run = ri.simulate(scene, 0.25, fps=20)
    way = 0.5 * G * math.sin(slope) * run.times**2
    np.testing.assert_allclose(run.position("bead"), way[:, None] * down, atol=1e-9)


QUESTION = """
import numpy as np
import rigidimpulse as ri
from rigidimpulse.collision.contact_buffer import ContactBuffer, Question
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.dispatch import PairQuery
from rigidimpulse.engine.compile_scene import compile_scene

balls = [ri.Body("a", ri.Shape.sphere(1.0)), ri.Body("b", ri.Shape.sphere(2.0), position=(0, 3, 4))]
world, buffer = compile_scene(ri.Scene(bodies=balls)), ContactBuffer()
pairs = PairQuery(np.array([0]), np.array([1]), np.array([9.0]))
shapes = Shapes(world.geometry, world.shape_of_body)
count = buffer.find(Question(shapes, world, np.tile(np.eye(3), (2, 1, 1)), pairs))
print(count, *buffer.real[0, 6:10])
"""


def test_a_narrow_phase_pair_is_a_file_and_an_entry_of_the_table(tmp_path: Path) -> None:
    # Centres 5 m apart along (0, 0.6, 0.8), radii 1 and 2 m: the gap is 2 m, less that of both coats.
    folder, source = copy_package(tmp_path), "collision/manifold/dispatch.py"
    copy2(Path(__file__).parent / "worked_examples" / "pair.py", folder / "rigidimpulse" / "collision" / "manifold" / "coated.py")
    given = "from rigidimpulse.collision.manifold.box_box import box_box_contacts\n"
    line = "from rigidimpulse.collision.manifold.coated import coated_ball_contacts\n"
    entry = ("PairKernels(sphere_sphere_contacts, ", "PairKernels(coated_ball_contacts, ")
    with changed(folder, source, (given, given + line), entry):
        done = run_against(folder, ["-c", QUESTION])
    assert done.returncode == 0, done.stderr
    assert list(map(float, done.stdout.split())) == pytest.approx([1.0, 0.0, 0.6, 0.8, 2.0 - 2.0 * 0.25], abs=1e-14)


def listed(heading: str) -> set[str]:
    """Files that the documentation lists under "How to add" something."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = text.split(f"## How to add {heading}\n")[1].split("\n## ")[0]
    return set(re.findall(r"^- `([^`]+)`", section, re.MULTILINE))


def home(thing: Any) -> str:
    """The file, in the repository, that a module, a function, a kernel or a class stands in."""
    return Path(inspect.getsourcefile(inspect.unwrap(thing)) or "").resolve().relative_to(ROOT).as_posix()


def files_with(text: str) -> set[str]:
    """Files of the package that have a text; gallery scenes are not asked."""
    package = ROOT / "rigidimpulse"
    files = (path for path in package.rglob("*.py") if "gallery" not in path.relative_to(package).parts)
    return {path.relative_to(ROOT).as_posix() for path in files if text in path.read_text(encoding="utf-8")}


def writer(suffix: str) -> set[str]:
    """The file with the function that writes a format, and the one that registers it."""
    function = find_exporter(Path(f"a{suffix}")).function
    return {f"{function.split(':')[0].replace('.', '/')}.py"} | files_with(f'"{function}"')


@pytest.mark.parametrize(
    ("heading", "files"),
    [
        ("an exporter", writer(".csv")),
        ("a force", {home(ri.Drag), home(forces), home(ri)}),
        ("a joint", {home(ri.HingeJoint), home(joint_coordinates), home(joint_rows), home(ri)}),
        ("a narrow-phase pair", {home(dispatch), home(dispatch.TABLE[ROUND, HALF_SPACE].contacts)}),
        ("a shape kind", {home(ri.Shape.capsule), home(compute_solid), home(compile_shape), home(display_mesh)}),
    ],
)
def test_the_lists_name_the_files_where_things_are_registered(heading: str, files: set[str]) -> None:
    assert files <= listed(heading)


@pytest.mark.parametrize("text", ['"capsule"', "geometry import CYLINDER"], ids=["a shape", "a primitive"])
def test_only_the_files_of_the_list_ask_for_a_kind_of_shape(text: str) -> None:
    """Else the next kind would be forgotten there."""
    assert files_with(text) <= listed("a shape kind")
