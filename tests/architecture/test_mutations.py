"""Law tests have teeth: with one sign wrong in a central formula, a law fails.

Each mutation changes one fragment of one file in a copy of the package. Its law tests then run against the copy in a process of their own,
in which kernels run as the Python that they are written in (NUMBA_DISABLE_JIT), so that nothing is compiled. At least one of them must fail
by an assertion: an error of import, collection or arithmetic proves nothing. Unchanged, the copy passes all of them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest
from package_copy import changed, copy_package, run_against
from rules import ROOT


class Mutation(NamedTuple):
    """A formula with one sign wrong."""

    formula: str
    source: str  # in the package
    right: str  # occurs once in the source
    wrong: str
    tests: tuple[str, ...]  # in tests/, of which at least one fails


MUTATIONS = (
    Mutation(
        "n.K n of a contact point: the angular part adds",
        "dynamics/impact/point.py",
        "k[i, j] += r[i1] * (",
        "k[i, j] -= r[i1] * (",
        ("laws/test_restitution.py::test_rod_on_the_floor_follows_the_plane_process[newton-slips on]",),
    ),
    Mutation(
        "restitution: (1 + e)",
        "dynamics/impact/friction.py",
        "smooth = -(1.0 + e) * un / k_nn",
        "smooth = -(1.0 - e) * un / k_nn",
        ("laws/test_collisions.py::test_two_smooth_bodies_meet_anywhere[sphere-1]",),
    ),
    Mutation(
        "Coulomb friction of an impact: against the slip",
        "dynamics/impact/friction.py",
        "impulse[a] -= along * t1[a]",
        "impulse[a] += along * t1[a]",
        ("laws/test_restitution.py::test_static_friction_decides_whether_a_sphere_grips[newton]",),
    ),
    Mutation(
        "impulse on a body: torque r x J",
        "dynamics/impact/point.py",
        "tx, ty, tz = r[1] * z - r[2] * y, r[2] * x - r[0] * z, r[0] * y - r[1] * x\n    for k",
        "tx, ty, tz = r[2] * y - r[1] * z, r[0] * z - r[2] * x, r[1] * x - r[0] * y\n    for k",
        ("laws/test_restitution.py::test_rod_on_the_floor_follows_the_plane_process[newton-slips on]",),
    ),
    Mutation(
        "Euler's equations: I w' = -w x I w + torque",
        "motion/forced_rotation.py",
        "k1, k2, k3 = (i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3",
        "k1, k2, k3 = (i3 - i2) / i1, (i1 - i3) / i2, (i2 - i1) / i3",
        ("laws/test_forced_rotation.py::test_order_of_the_series",),
    ),
    Mutation(
        "product of quaternions: first b, then a",
        "core/quaternion.py",
        "a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,",
        "a0 * b1 + a1 * b0 - a2 * b3 + a3 * b2,",
        ("laws/test_free_rotation.py::test_hard_cases_against_reference[light]",),
    ),
    Mutation(
        "parallel axes: inertia grows away from the centre of mass",
        "scene/solid.py",
        "return inertia + mass * (dot(offset, offset)",
        "return inertia - mass * (dot(offset, offset)",
        ("unit/test_mass.py::test_compound_of_two_halves_is_the_whole", "unit/test_mass.py::test_given_centre_moves_the_inertia_along"),
    ),
    Mutation(
        "row of a joint: the lever arm ends at the anchor",
        "dynamics/constraints/joint.py",
        "rb[r] = pb[r] - (bodies.position[b, r] if b >= 0 else 0.0)",
        "rb[r] = -pb[r] + (bodies.position[b, r] if b >= 0 else 0.0)",
        ("laws/test_joint_release.py",),
    ),
    Mutation(
        "penalty method: the damper acts against the approach",
        "dynamics/penalty/penalty.py",
        "stiffness[a, b] * depth - (damping",
        "stiffness[a, b] * depth + (damping",
        ("laws/test_penalty.py::test_a_damper_that_never_pulls[0.3]",),
    ),
    Mutation(
        "position correction: towards the contact margin",
        "dynamics/constraints/position_correction.py",
        "rows.bias[c] = contacts.gap[c] - target",
        "rows.bias[c] = target - contacts.gap[c]",
        ("laws/test_position_correction.py",),
    ),
    Mutation(
        "rolling friction: against the roll",
        "dynamics/constraints/rolling_friction.py",
        "wrench[contacts.body_a[c], 3 + r] -= moment\n                wrench[contacts.body_b[c], 3 + r] += moment",
        "wrench[contacts.body_a[c], 3 + r] += moment\n                wrench[contacts.body_b[c], 3 + r] -= moment",
        ("laws/test_rolling.py::test_spinning_ball_stops_on_the_spot",),
    ),
    Mutation(
        "time of impact with a plane: the speed of approach",
        "collision/time_of_impact/spheres.py",
        "gap, closing = dot(normal, x) - level, -dot(normal, v)",
        "gap, closing = dot(normal, x) - level, dot(normal, v)",
        ("laws/test_bounce.py::test_inelastic_ball_comes_to_rest_in_time[0.5]",),
    ),
)


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package."""
    return copy_package(tmp_path_factory.mktemp("mutated"))


def failures(folder: Path, tests: Sequence[str], **variables: str) -> list[str]:
    """What went wrong in tests that ran against the package in a folder: the first words of each exception."""
    report = folder / "report.xml"
    options = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:warnings", "-c", str(ROOT / "pyproject.toml")]
    chosen = [str(ROOT / "tests" / test) for test in tests]
    done = run_against(folder, ["-m", "pytest", *options, f"--rootdir={ROOT}", f"--junitxml={report}", *chosen], **variables)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    suite = ElementTree.parse(report).getroot()
    assert suite.findall(".//testcase"), done.stdout
    return [entry.get("message", "") for kind in ("failure", "error") for entry in suite.iter(kind)]


def fails_by_assertion(messages: Sequence[str]) -> bool:
    """Whether one of the messages is that of an assertion."""
    return any(message.startswith(("AssertionError", "assert ")) for message in messages)


def test_without_a_mutation_all_laws_hold(copied: Path) -> None:
    assert failures(copied, sorted({test for mutation in MUTATIONS for test in mutation.tests})) == []


@pytest.mark.parametrize("mutation", MUTATIONS, ids=[mutation.formula for mutation in MUTATIONS])
def test_a_wrong_sign_breaks_a_law(mutation: Mutation, copied: Path) -> None:
    with changed(copied, mutation.source, (mutation.right, mutation.wrong)):
        messages = failures(copied, mutation.tests)
    assert fails_by_assertion(messages), messages


def test_a_wrong_sign_of_the_bias_of_soft_contacts_breaks_its_law(copied: Path, tmp_path: Path) -> None:
    """Vectors have no Python, so this one kernel is compiled."""
    compiled = {"NUMBA_DISABLE_JIT": "0", "NUMBA_CACHE_DIR": str(tmp_path)}
    with changed(copied, "dynamics/solvers/tgs_soft/passes.py", ("speed + bias", "speed - bias")):
        messages = failures(copied, ["unit/test_soft_contact.py"], **compiled)
    assert fails_by_assertion(messages), messages
