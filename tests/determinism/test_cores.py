"""Sub-stepped islands on several cores: the same bits as on one core, however the work is shared and however memory grows."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.collision.contact_cache import BLOCK, find_contacts, share_of
from rigidimpulse.core.kernels import MOST_CORES, Kernel, number_of_cores
from rigidimpulse.dynamics.solvers.tgs_soft.solver import BATCHES_EACH
from rigidimpulse.engine.simulate import complete, frame_times, prepare
from rigidimpulse.engine.substepped.advance import SubsteppedIslands
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.engine.substepped.stages import COLOURS, work_on

ROUGH = ri.Material(density=500, restitution=0.0, static_friction=0.5, dynamic_friction=0.5)


def cloud(shapes: list[ri.Shape], number: int, pitch: float = 0.3) -> ri.Scene:
    """Bodies of 0.2 m that fall on each other and the floor, turned and thrown at random."""
    random = np.random.default_rng(7)
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    for k in range(number):
        place = pitch * np.array([k % 6, k // 6 % 6, k // 36 + 0.7])
        throw = {"velocity": random.normal(0.0, 0.5, 3), "angular_velocity": random.normal(0.0, 3.0, 3)}
        shape = shapes[k % len(shapes)]
        scene.add(ri.Body(f"body {k}", shape, position=place, orientation=random.normal(size=4), material=ROUGH, **throw))
    return scene


def rings() -> list[ri.Shape]:
    """Rings and boxes."""
    ring = trimesh.creation.torus(0.07, 0.03, major_sections=12, minor_sections=6)
    return [ri.Shape.mesh(ring.vertices, ring.faces), ri.Shape.box((0.2, 0.15, 0.1))]


def shared(scene: ri.Scene, duration: float, sharing: Sharing) -> str:
    """The hash of a run whose islands share their work so."""
    run = prepare(scene, frame_times(duration, 60.0))
    run.substepped = SubsteppedIslands(run.world, sharing)
    return complete(run, duration).state_hash()


@pytest.mark.parametrize(("shapes", "number", "duration"), [([ri.Shape.box(0.2)], 144, 0.6), (rings(), 72, 0.45)], ids=["boxes", "rings"])
def test_substepped_islands_have_the_same_bits_on_one_core_and_on_several(shapes, number, duration) -> None:
    hashes, dealt = set(), []

    def together(kernel: Kernel, calls: Sequence[tuple]) -> list[Any]:
        if kernel is find_contacts:
            dealt.append(len(calls))
        return kernel.together(calls)

    soon = {"pairs": 20, "general_pairs": 4, "together": together}
    # Two have so little memory at first that points, patches and batches are moved when they become more.
    little = {"first_points": 48, "points_of_a_body": 0, "patches_of_a_body": 0}
    usual = Sharing(most_cores=1, **soon), Sharing(most_cores=2, **soon)
    for sharing in (*usual, Sharing(most_cores=1, **soon, **little), Sharing(most_cores=3, **soon, **little)):
        dealt.clear()
        hashes.add(shared(cloud(shapes, number), duration, sharing))
        assert max(dealt, default=1) == sharing.most_cores
    assert len(hashes) == 1


@pytest.fixture(scope="module")
def alone() -> str:
    """The hash of a pile whose sub-steps had no helper."""
    return crowded(Sharing(batches=10**9))


def block(number: int) -> ri.Scene:
    """Boxes, a millimetre apart."""
    scene, random = ri.Scene(), np.random.default_rng(7)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ROUGH))
    for k in range(number):
        place = 0.201 * np.array([k % 6, k // 6 % 6, k // 36 + 0.5])
        scene.add(ri.Body(f"body {k}", ri.Shape.box(0.2), position=place, velocity=random.normal(0.0, 0.5, 3), material=ROUGH))
    return scene


def crowded(sharing: Sharing) -> str:
    """The hash of a block of boxes with colours of many batches."""
    return shared(block(396), 0.1, sharing)


@pytest.mark.parametrize("how", ["at once", "nobody helps", "help comes too late"])
def test_sub_steps_have_the_same_bits_however_much_the_helper_does(alone: str, how: str) -> None:
    asked, largest = [], 0

    def workers(kernel: Kernel, calls: Sequence[tuple]) -> list[Any]:
        nonlocal largest
        if kernel is not work_on:
            return kernel.together(calls)
        _, _, memory, _, progress, _, _ = calls[0]
        batches = int(np.diff(memory.begins[: progress[COLOURS] + 1]).max(initial=0))
        largest = max(largest, batches)
        # Before the first contact there is nothing to help with.
        if batches:
            asked.append(len(calls))
        if how == "at once":
            return kernel.together(calls)
        return [kernel(*arguments) for arguments in (calls[:1] if how == "nobody helps" else calls)]

    assert crowded(Sharing(most_cores=2, batches=0, together=workers)) == alone
    assert set(asked) == {2}
    # Some colours have more than two pieces, so that both take of them.
    assert largest > 2 * BATCHES_EACH


def test_contacts_that_find_no_space_are_found_again() -> None:
    """Whatever a buffer holds at first, in whichever share."""
    usual = shared(cloud(rings(), 72), 0.3, Sharing(most_cores=2, general_pairs=4))
    for number in (1, 2):
        assert shared(cloud(rings(), 72), 0.3, Sharing(most_cores=number, general_pairs=4, buffer=40)) == usual


def test_a_body_that_flies_far_away_changes_nothing() -> None:
    """Where all bodies are stepped together a step goes to its end without the loop of events. It has the same bits as with it."""
    poses = []
    for is_alone in (True, False):
        scene = block(72)
        if not is_alone:
            scene.add(ri.Body("far", ri.Shape.box(0.2), position=(0.0, 900.0, 500.0), velocity=(1.0, 2.0, 3.0)))
        run = ri.simulate(scene, 0.5)
        assert run.status.ok
        poses.append(b"".join(run.position(f"body {k}").tobytes() + run.orientation(f"body {k}").tobytes() for k in range(72)))
    assert poses[0] == poses[1]


@pytest.mark.parametrize("shares", [1, 2, 3])
@pytest.mark.parametrize("number", [0, 1, BLOCK - 1, BLOCK, 5 * BLOCK + 3, 1000])
def test_every_share_has_capacity_for_its_pairs(number: int, shares: int) -> None:
    dealt = [sum(len(range(b, min(b + BLOCK, number))) for b in range(s * BLOCK, number, shares * BLOCK)) for s in range(shares)]
    begins = [share_of(number, share, shares) for share in range(shares + 1)]
    assert sum(dealt) == number
    assert all(after - before >= mine for before, after, mine in zip(begins[:-1], begins[1:], dealt, strict=True))


def _ask(answers) -> None:
    answers.put((number_of_cores(), share_of.together([(1000, share, 4) for share in range(4)])))


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_processes_of_a_pool_use_one_core_each_and_threads_of_their_own(method: str) -> None:
    """One that is forked off while its parent has threads would wait for ever for them."""
    assert share_of.together([(1000, share, 4) for share in range(4)]) == [share_of(1000, share, 4) for share in range(4)]
    context = multiprocessing.get_context(method)
    answers = context.Queue()
    process = context.Process(target=_ask, args=(answers,))
    process.start()
    cores, places = answers.get(timeout=120)
    process.join()
    assert cores == 1
    assert places == [share_of(1000, share, 4) for share in range(4)]


@pytest.mark.parametrize(("threads", "cores"), [("1", 1), ("3", 3), ("64", MOST_CORES)])
def test_the_number_of_cores_is_that_of_numba(threads: str, cores: int) -> None:
    code = "from rigidimpulse.core.kernels import number_of_cores; print(number_of_cores())"
    environment = {**os.environ, "NUMBA_NUM_THREADS": threads}
    answer = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert int(answer.stdout) == cores
