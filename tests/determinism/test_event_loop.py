"""The compiled order of events changes nothing but the time a run takes: with it and with the loop in Python runs agree in every bit.

Frames, impacts, ledger, contact forces and status are compared exactly: a single rounding that differs breaks the hash. The scenes fall,
rub, rock, come to rest, sink and are corrected, sleep, are carried, and have events that the compiled loop hands over: to sub-stepped
islands, and where it asks for more memory. In some of them other bodies are jointed or on springs, which the loop in Python looks after.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.engine.absent import NoCompiledLoop
from rigidimpulse.engine.exact.compiled_loop import CompiledLoop
from rigidimpulse.engine.exact.event_loop import MOST_EVENTS, run_events
from rigidimpulse.engine.simulate import complete, prepare
from rigidimpulse.scene.accuracy import Preset

FPS = 60.0


def floor(scene: ri.Scene) -> ri.Scene:
    """The scene with a floor."""
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    return scene


def falling_boxes() -> ri.Scene:
    """Six boxes that fall onto a floor and each other."""
    scene, dice = floor(ri.Scene()), np.random.default_rng(6)
    for k in range(6):
        place = (0.25 * (k % 2), 0.05 * k, 0.4 + 0.25 * k)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.2, 0.15, 0.1)), position=place, orientation=dice.normal(size=4)))
    return scene


def tetrahedra_in_a_tray() -> ri.Scene:
    """Hulls with restitution in a tray that moves; two of them start inside each other."""
    scene, dice = floor(ri.Scene()), np.random.default_rng(11)
    points = np.array([(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)]) - 0.05
    material = ri.Material(restitution=0.6, static_friction=0.3, dynamic_friction=0.2)
    scene.add(ri.Body("tray", ri.Shape.box((1.0, 1.0, 0.05)), motion="kinematic", position=(0, 0, 0.1), velocity=(0.2, 0.0, 0.0)))
    for k in range(5):
        place = (0.15 * (k % 3), 0.12 * (k // 3), 0.25 + 0.02 * k)
        shape = ri.Shape.convex_hull(points * dice.uniform(0.6, 1.2))
        scene.add(ri.Body(f"tetrahedron {k}", shape, position=place, angular_velocity=dice.normal(size=3), material=material))
    return scene


def balls_and_boxes() -> ri.Scene:
    """What balls do with boxes and with each other, and a body that nothing touches."""
    scene, dice = floor(ri.Scene()), np.random.default_rng(5)
    for k in range(4):
        scene.add(ri.Body(f"ball {k}", ri.Shape.sphere(0.1), position=(0.3 * k, 0.0, 0.5 + 0.1 * k), velocity=dice.normal(size=3)))
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.2), position=(0.3 * k, 0.05, 0.1 + 1e-6)))
    scene.add(ri.Body("flies", ri.Shape.box(0.2), position=(0, 0, 50), velocity=(0, 0, 9), angular_velocity=(1, 2, 3)))
    return scene


def many_boxes() -> ri.Scene:
    """Boxes of which some are in a sub-stepped island while another is exact."""
    scene = floor(ri.Scene())
    for k in range(64):
        place = (0.11 * (k % 4), 0.11 * (k // 4 % 4), 0.2 + 0.11 * (k // 16))
        scene.add(ri.Body(f"box {k}", ri.Shape.box(0.1), position=place))
    scene.add(ri.Body("aside", ri.Shape.box((0.3, 0.1, 0.2)), position=(3, 0, 0.5), orientation=(0.9, 0.3, 0.1, 0.2)))
    return scene


def plate_under_a_load() -> ri.Scene:
    """A load of 511 kg drops on a leaning plate of 0.2 kg; the plate rebounds so often that it is looked at in the middle of a step."""
    scene, elastic = floor(ri.Scene()), ri.Material(restitution=1.0)
    turned, fast = (1.0, 0.06, 0.05, 0.0), (0, 0, -2.5)
    scene.add(ri.Body("plate", ri.Shape.box((0.3, 0.25, 0.02)), mass=0.19, position=(0, 0, 0.05), orientation=turned, material=elastic))
    scene.add(ri.Body("load", ri.Shape.box((0.4, 0.4, 0.3)), mass=511.0, position=(0.02, 0.01, 0.26), velocity=fast, material=elastic))
    return scene


def necklace_among_boxes() -> ri.Scene:
    """Beads on ball joints that fall among boxes, and boxes that meet each other alone; the necklace is sub-stepped where it lands."""
    scene, dice = floor(ri.Scene()), np.random.default_rng(8)
    for k in range(4):
        scene.add(ri.Body(f"bead {k}", ri.Shape.sphere(0.05), position=(0.11 * k, 0.0, 0.3)))
        if k:
            scene.add(ri.BallJoint(f"bead {k - 1}", f"bead {k}", (0.11 * k - 0.055, 0.0, 0.3)))
    for k in range(6):
        place = (0.25 * (k % 3), 0.3 * (k // 3), 0.15 + 0.1 * k)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.2, 0.15, 0.1)), position=place, orientation=dice.normal(size=4)))
    return scene


def doors_and_dice() -> ri.Scene:
    """Two doors that swing all the time, exactly, while dice fall: some of them on a door, the others aside."""
    scene, dice = floor(ri.Scene()), np.random.default_rng(2)
    for k in range(2):
        turns = (0, 0, 1.5 - 2.0 * k)
        scene.add(ri.Body(f"door {k}", ri.Shape.box((0.8, 0.05, 1.0)), position=(0.4 + k, 0.0, 0.6), angular_velocity=turns))
        scene.add(ri.HingeJoint(None, f"door {k}", (float(k), 0.0, 0.6), (0, 0, 1)))
    for k in range(8):
        place = (0.25 * k, 0.02 if k % 3 == 0 else 0.6, 0.5 + 0.12 * k)
        scene.add(ri.Body(f"die {k}", ri.Shape.box(0.1), position=place, orientation=dice.normal(size=4), velocity=dice.normal(size=3)))
    return scene


def springs_beside_boxes() -> ri.Scene:
    """Weights that bounce on springs, through two of which boxes fall."""
    scene, dice = floor(ri.Scene()), np.random.default_rng(4)
    for k in range(3):
        scene.add(ri.Body(f"weight {k}", ri.Shape.sphere(0.1), position=(0.5 * k, 0.0, 1.0)))
        scene.add(ri.Spring(None, f"weight {k}", (0.5 * k, 0.0, 2.0), (0.5 * k, 0.0, 1.0), stiffness=30.0))
    for k in range(5):
        place = (0.25 * k, 0.03, 1.4 + 0.1 * k)
        scene.add(ri.Body(f"box {k}", ri.Shape.box((0.2, 0.15, 0.1)), position=place, orientation=dice.normal(size=4)))
    return scene


OF_CONTACT = falling_boxes, tetrahedra_in_a_tray, balls_and_boxes, many_boxes, plate_under_a_load


@pytest.mark.parametrize("make", [*OF_CONTACT, necklace_among_boxes, doors_and_dice, springs_beside_boxes])
def test_both_loops_give_the_same_bits(make: Callable[[], ri.Scene]) -> None:
    recordings: list[ri.Recording] = []
    for compiled, progress in ((True, None), (True, lambda _time: None), (False, None)):
        run = prepare(make(), np.arange(61) / FPS)
        run.compiled = CompiledLoop(run) if compiled else NoCompiledLoop()
        recordings.append(complete(run, 1.0, progress))
    one, watched, other = recordings
    assert len(one.impacts) > 3
    assert one.state_hash() == watched.state_hash() == other.state_hash()
    np.testing.assert_array_equal(one.contacts, other.contacts)
    assert one.ledger.dissipated.keys() == other.ledger.dissipated.keys()
    for cause, energy in one.ledger.dissipated.items():
        np.testing.assert_array_equal(energy, other.ledger.dissipated[cause])


@pytest.mark.parametrize("seed", [58, 72, 90])
def test_a_pair_that_is_given_up_is_handed_over_at_once(seed: int) -> None:
    """Cylinders roll over the edge of a box. The exact regime gives a pair up, at an instant after which nothing else happens in the step.

    The compiled loop went to the end of the step then, and the cylinder went into the box on its way.
    """
    hashes = []
    for compiled in (True, False):
        scene, dice = floor(ri.Scene()), np.random.default_rng(seed)
        scene.add(ri.Body("step", ri.Shape.box((1.0, 1.0, 0.4)), motion="static", position=(0, 0, 0.2)))
        for k in range(5):
            place, turn = (0.25 * k - 0.5, 0.0, 0.55 + 0.02 * k), dice.normal(size=4)
            velocity, spin = dice.normal(size=3), 5.0 * dice.normal(size=3)
            shape = ri.Shape.cylinder(0.06, 0.1)
            scene.add(ri.Body(f"cylinder {k}", shape, position=place, orientation=turn, velocity=velocity, angular_velocity=spin))
        run = prepare(scene, np.arange(31) / FPS, "preview")
        run.compiled = CompiledLoop(run) if compiled else NoCompiledLoop()
        hashes.append(complete(run, 0.5).state_hash())
    assert hashes[0] == hashes[1]


def test_a_loop_that_asks_for_more_memory_gives_the_same_bits() -> None:
    """Buffers that hold next to nothing at first: the loop ends before an event for which there is no space, and comes back."""
    run = prepare(falling_boxes(), np.arange(61) / FPS)
    run.compiled = CompiledLoop(run)
    plain = complete(run, 1.0)
    tight = prepare(falling_boxes(), np.arange(61) / FPS)
    tight.log.buffers = tight.log.buffers._replace(energy=tight.log.buffers.energy[:1], stretches=tight.log.buffers.stretches[:1])
    tight.contact_log.buffers = tight.contact_log.buffers._replace(rows=tight.contact_log.buffers.rows[:8])
    tight.compiled = CompiledLoop(tight)
    assert complete(tight, 1.0).state_hash() == plain.state_hash()


def test_steps_of_exact_contact_follow_each_other_without_python() -> None:
    """A die falls, rebounds, rubs and comes to rest; Python is asked again only after MOST_EVENTS events, since somebody may wait."""
    scene = floor(ri.Scene())
    scene.add(ri.Body("die", ri.Shape.box(0.016), position=(0, 0, 0.1), orientation=(0.9, 0.3, 0.1, 0.2), velocity=(0.3, 0.0, 0.0)))
    run = prepare(scene, np.arange(91) / FPS)
    run.compiled = CompiledLoop(run)
    before = run_events.calls
    recording = complete(run, 1.5)
    events = run.plan.line("impact time").calls
    assert np.all(recording.velocities[-1] == 0.0) and events > 20
    assert run_events.calls - before <= 2 + events // MOST_EVENTS


@pytest.mark.parametrize("accuracy", ["standard", "preview"])
def test_who_listens_only_is_not_asked_at_every_step(accuracy: Preset) -> None:
    """`simulate` always listens to Ctrl-C. Steps that need nothing but exact contact follow each other all the same, with the same bits."""
    scene = floor(ri.Scene())
    scene.add(ri.Body("die", ri.Shape.box(0.016), position=(0, 0, 1.0), orientation=(0.9, 0.3, 0.1, 0.2), velocity=(0.3, 0.0, 0.0)))
    calls, hashes = [], []
    for every_step in (True, False):
        run, heard = prepare(scene, np.arange(25) / FPS, accuracy), []
        run.compiled = CompiledLoop(run)
        before = run_events.calls
        hashes.append(complete(run, 0.4, heard.append, every_step).state_hash())
        calls.append((run_events.calls - before, len(heard)))
    # It falls for 0.44 s: nothing happens in 24 steps.
    assert calls == [(24, 24), (1, 1)]
    assert hashes[0] == hashes[1] == ri.simulate(scene, 0.4, accuracy=accuracy).state_hash()


def test_problems_are_told_alike_by_runs_that_are_watched_and_others() -> None:
    """A plate that moves by itself presses a box into the floor, and passes on: why is seen in the step of it only."""
    scene, start, down = floor(ri.Scene()), (0.0, 0.0, 0.35), (0.0, 0.0, -1.5)
    scene.add(ri.Body("plate", ri.Shape.box((0.6, 0.6, 0.1)), motion="kinematic", position=start, velocity=down))
    scene.add(ri.Body("box", ri.Shape.box(0.2), position=(0.0, 0.0, 0.1)))
    told = []
    for compiled, progress in ((True, None), (True, lambda _time: None), (False, None)):
        run = prepare(scene, np.arange(61) / FPS, "exact")
        run.compiled = CompiledLoop(run) if compiled else NoCompiledLoop()
        recording = complete(run, 1.0, progress)
        told.append([(event.time, event.kind, event.bodies) for event in recording.status.events])
    assert "squeezed" in {kind for _, kind, _ in told[0]}
    assert told[0] == told[1]
    # The loop in Python meets a pair that is given up at the begin of the next step already, 7e-8 s before.
    assert [what for _, *what in told[0]] == [what for _, *what in told[2]]
