"""Changing late: a run goes on from a frame of a cache with another scene; what is before, and what the change never reaches, stays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from kept_runs import SCENES

import rigidimpulse as ri
from rigidimpulse import gallery
from rigidimpulse.cli.cli import main

pytest.importorskip("h5py")
DURATION = 1.2
FRAME = 40
SLIPPERY = ri.Material(static_friction=0.3, dynamic_friction=0.2)
BOUNCY = ri.Material(restitution=0.8)


def yard(**changes: Any) -> ri.Scene:
    """A box at rest on a shelf, one that slides, a ball that bounces and a box that tumbles, far from each other."""
    scene = ri.Scene(gravity=changes.pop("gravity", (0, 0, -9.81)))
    bodies = [
        ri.Body("floor", ri.Shape.half_space(), motion="static"),
        ri.Body("shelf", ri.Shape.box((1, 1, 0.1)), motion="static", position=(5, 0, 1)),
        ri.Body("rest", ri.Shape.box(0.3), position=(5, 0, 1.2)),
        ri.Body("slide", ri.Shape.box(0.3), position=(-5, 0, 0.15), velocity=(3, 0, 0), material=SLIPPERY),
        ri.Body("ball", ri.Shape.sphere(0.2), position=(0, 0, 3), velocity=(0.3, 0.1, 0), angular_velocity=(1, 2, 3), material=BOUNCY),
        ri.Body("tumble", ri.Shape.box((0.3, 0.2, 0.5)), position=(0, 5, 2), velocity=(0, 0.2, 1), angular_velocity=(1, 4, 3)),
    ]
    for body in bodies:
        change = changes.pop(body.name, {})
        if change is not None:
            scene.add(replace(body, **change))
    for thing in changes.pop("add", ()):
        scene.add(thing)
    assert not changes
    return scene


class Kept:
    """A finished run of the yard in a cache."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "yard.h5"
        self.whole = ri.simulate(yard(), DURATION, cache=self.path)

    def later(self, frame: int = FRAME, **changes: Any) -> ri.SimulatedRecording:
        """The run with a changed scene from a frame on."""
        run = ri.simulate(yard(**changes), DURATION, cache=self.path, from_frame=frame)
        known = [name for name in run.names if name in self.whole.names]
        for name in known:
            for part in ("position", "orientation", "velocity", "angular_velocity"):
                np.testing.assert_array_equal(getattr(run, part)(name)[:frame], getattr(self.whole, part)(name)[:frame])
        loaded = ri.load_recording(self.path)
        assert loaded.state_hash() == run.state_hash()
        assert loaded.status == run.status
        # What every cause took, the change of the scene among them, is what is missing.
        lost = run.ledger.total + sum(run.ledger.dissipated.values())
        np.testing.assert_allclose(lost, lost[0], atol=1e-9 * np.abs(run.ledger.total).max())
        return run

    def unchanged(self, run: ri.Recording) -> set[str]:
        """Bodies that moved with the same bits."""
        parts = ("position", "orientation", "velocity", "angular_velocity")
        both = [name for name in run.names if name in self.whole.names]
        return {
            name for name in both if all(np.array_equal(getattr(run, part)(name), getattr(self.whole, part)(name)) for part in parts)
        }  # fmt: skip


@pytest.fixture
def kept(tmp_path: Path) -> Kept:
    return Kept(tmp_path)


OTHERS = {"floor", "shelf", "rest", "slide", "tumble"}


@pytest.mark.parametrize(("name", "duration", "frame"), [("pile", 0.5, 14), ("gas", 2.0, 40), ("spot", 1.2, 30), ("arm", 0.6, 20)])
def test_an_unchanged_scene_goes_on_with_the_same_bits(name: str, duration: float, frame: int, tmp_path: Path) -> None:
    make = SCENES[name] if name in SCENES else gallery.load(name).scene
    whole = ri.simulate(make(), duration, cache=ri.Cache(tmp_path / "run.h5", every=0.05))
    later = ri.simulate(make(), duration, cache=tmp_path / "run.h5", from_frame=frame)
    assert later.state_hash() == whole.state_hash()
    assert later.status == whole.status
    for name in whole.names:
        mine, theirs = later.impulses(name), whole.impulses(name)
        size = max(float(np.abs(impulse).max()) for impulse in theirs.values()) if theirs else 0.0
        for cause in {*mine, *theirs}:
            np.testing.assert_allclose(mine.get(cause, 0.0), theirs.get(cause, 0.0), atol=1e-12 * size)
    for cause, lost in whole.ledger.dissipated.items():
        np.testing.assert_allclose(later.ledger.dissipated[cause], lost, atol=1e-12 * np.abs(whole.ledger.total).max())


def test_a_material_changes_what_its_body_does_and_nothing_else(kept: Kept) -> None:
    run = kept.later(ball={"material": ri.Material(restitution=0.0)})
    assert kept.unchanged(run) == OTHERS
    # It lands at 0.756 s, once: from then on it rolls on the floor, where it would have risen again.
    assert kept.whole.position("ball")[-1, 2] > 0.5
    assert run.position("ball")[-1, 2] == pytest.approx(0.2, abs=1e-4)
    assert run.status.ok


def test_what_a_scene_says_of_the_start_of_a_body_counts_where_it_changed(kept: Kept) -> None:
    run = kept.later(ball={"velocity": (2.0, 0.0, 0.0)})
    assert kept.unchanged(run) == OTHERS
    moved = run.position("ball")[FRAME + 1] - run.position("ball")[FRAME]
    np.testing.assert_allclose(moved, (2.0 / 60.0, 0.0, -9.81 / 7200.0), atol=1e-12)
    np.testing.assert_array_equal(run.position("ball")[FRAME], kept.whole.position("ball")[FRAME])
    run = kept.later(ball={"position": (0.0, 2.0, 3.0)})
    np.testing.assert_allclose(run.position("ball")[FRAME], (0.0, 2.0, 3.0), atol=1e-12)
    np.testing.assert_array_equal(run.velocity("ball")[FRAME], kept.whole.velocity("ball")[FRAME])


def test_what_rests_on_a_body_that_is_taken_away_falls(kept: Kept) -> None:
    run = kept.later(shelf=None)
    assert kept.unchanged(run) == OTHERS - {"shelf", "rest"} | {"ball"}
    fall = run.position("rest")[FRAME, 2] - run.position("rest")[FRAME + 15, 2]
    assert fall == pytest.approx(0.5 * 9.81 * 0.25**2, rel=1e-9)
    assert run.status.ok


def test_a_new_body_stands_where_it_begins_until_the_change(kept: Kept) -> None:
    run = kept.later(add=[ri.Body("new", ri.Shape.box(0.2), position=(5, 0, 2))])
    assert kept.unchanged(run) == {"floor", "shelf", "slide", "ball", "tumble"}
    assert np.all(run.position("new")[: FRAME + 1] == (5.0, 0.0, 2.0))
    # From a height of 2 m to the box, whose top is at 1.35 m.
    assert run.position("new")[-1, 2] == pytest.approx(1.45, abs=1e-4)
    assert run.status.ok


def test_gravity_and_keyframes_and_forces_change(kept: Kept) -> None:
    run = kept.later(gravity=(0.0, 0.0, 9.81))
    for name in ("rest", "slide"):
        since = run.velocity(name)[-1, 2] - run.velocity(name)[FRAME, 2]
        assert since == pytest.approx(9.81 * (DURATION - FRAME / 60.0), rel=1e-6)
    lift = ri.Keyframes([0.0, FRAME / 60.0, FRAME / 60.0 + 1.0], [(5.0, 0.0, 1.0), (5.0, 0.0, 1.0), (5.0, 0.0, 2.0)])
    run = kept.later(shelf={"motion": "kinematic", "keyframes": lift})
    assert kept.unchanged(run) == {"floor", "slide", "ball", "tumble"}
    assert run.velocity("rest")[-1, 2] == pytest.approx(1.0, abs=1e-6)
    run = kept.later(add=[ri.ConstantForce("ball", (20.0, 0.0, 0.0))])
    assert kept.unchanged(run) == OTHERS
    run = kept.later(add=[ri.Drag(linear=5.0, bodies=["tumble"])])
    assert kept.unchanged(run) == OTHERS - {"tumble"} | {"ball"}


def test_the_cache_keeps_both_takes_and_goes_on_from_either(kept: Kept) -> None:
    elastic = {"ball": {"material": ri.Material(restitution=1.0)}}
    second = kept.later(**elastic)
    assert ri.simulate(yard(), DURATION, cache=kept.path).state_hash() == kept.whole.state_hash()
    looks: list[float] = []
    again = ri.simulate(yard(**elastic), DURATION, cache=kept.path, from_frame=FRAME, progress=looks.append)
    assert again.state_hash() == second.state_hash()
    assert looks == []
    # A change of the changed run, and then one before the first change, which begins from the first take.
    third = ri.simulate(yard(**elastic, rest={"velocity": (0, 0, 5)}), DURATION, cache=kept.path, from_frame=50)
    for name in second.names:
        assert (name == "rest") != np.array_equal(third.position(name), second.position(name))
    np.testing.assert_array_equal(third.positions[:50], second.positions[:50])
    fourth = ri.simulate(yard(slide={"velocity": (0, 3, 0)}), DURATION, cache=kept.path, from_frame=20)
    assert kept.unchanged(fourth) == {"floor", "shelf", "rest", "ball", "tumble"}
    assert ri.load_recording(kept.path).state_hash() == fourth.state_hash()


@pytest.mark.parametrize("stop", [0.68, 0.9])
def test_a_take_that_is_stopped_goes_on(kept: Kept, stop: float) -> None:
    class Stopped(Exception):
        pass

    def progress(time: float) -> None:
        if time > stop:
            raise Stopped

    changed = yard(tumble={"velocity": (0, 3, 0)})
    cache = ri.Cache(kept.path, every=0.0)
    with pytest.raises(Stopped):
        ri.simulate(changed, DURATION, cache=cache, from_frame=FRAME, progress=progress)
    left = ri.load_recording(kept.path)
    assert FRAME < len(left.times) < 75
    assert left.status.is_partial
    whole = kept.later(tumble={"velocity": (0, 3, 0)})
    np.testing.assert_array_equal(whole.positions[: len(left.times)], left.positions)
    assert kept.unchanged(whole) == {"floor", "shelf", "rest", "slide", "ball"}


def mechanism(upper: float = 1.0, release: float = 0.2, **changes: Any) -> ri.Scene:
    """A wheel that a hinge lets turn by 20 rad, one on a joint that lets go, and a cloth."""
    scene = ri.Scene()
    disk = ri.Shape.cylinder(0.2, 0.1)
    for k, name in enumerate(("wheel", "loose")):
        scene.add(ri.Body(name, disk, position=(2.0 * k, 0, 3), angular_velocity=(0, 0, 40.0)))
    scene.add(ri.HingeJoint("wheel", None, (0, 0, 3), (0, 0, 1), lower=-20.0, upper=upper))
    scene.add(ri.BallJoint("loose", None, (2, 0, 3), release_time=release))
    scene.add(ri.Body("far", ri.Shape.sphere(0.1), position=(9, 0, 5), **changes))
    corners = np.array([(-3 + 0.2 * x, 0.2 * y, 3) for x in range(4) for y in range(4)])
    faces = [(4 * x + y, 4 * x + y + 5 - k, 4 * x + y + (5 if k else 1)) for x in range(3) for y in range(3) for k in (0, 1)]
    scene.add(ri.FlexibleBody("cloth", corners, faces, stiffness=200, bending=1e-4, damping=0.002, area_density=0.2, pinned=[0, 3]))
    return scene


def test_joints_and_soft_bodies_go_on_from_where_they_are(tmp_path: Path) -> None:
    whole = ri.simulate(mechanism(), 0.7, cache=tmp_path / "run.h5")
    run = ri.simulate(mechanism(mass=3.0), 0.7, cache=tmp_path / "run.h5", from_frame=24)
    # The wheel has turned by 16 rad and meets its limit, 20, at 0.5 s; what let go at 0.2 s goes on falling.
    for name in ("wheel", "loose"):
        np.testing.assert_allclose(run.position(name), whole.position(name), atol=1e-9)
        np.testing.assert_allclose(run.angular_velocity(name), whole.angular_velocity(name), atol=1e-6)
    np.testing.assert_allclose(run.soft_body("cloth")[0], whole.soft_body("cloth")[0], atol=1e-9)
    assert abs(run.angular_velocity("wheel")[24, 2] - 40.0) < 1e-9
    assert run.angular_velocity("wheel")[-1, 2] < 1.0


def test_joints_that_change_count_their_turns_on_and_stay_broken(tmp_path: Path) -> None:
    whole = ri.simulate(mechanism(), 0.7, cache=tmp_path / "run.h5")
    run = ri.simulate(mechanism(upper=2.0, release=5.0), 0.7, cache=tmp_path / "run.h5", from_frame=24)
    # It meets its limit of 20 rad at 0.5 s, not three turns later, and what fell goes on falling.
    np.testing.assert_allclose(run.angular_velocity("wheel"), whole.angular_velocity("wheel"), atol=1e-6)
    np.testing.assert_allclose(run.position("loose"), whole.position("loose"), atol=1e-9)


def blown(strength: float, **changes: Any) -> ri.Scene:
    scene = ri.Scene()
    scene.add(ri.Body("leaf", ri.Shape.sphere(0.1), **changes))
    scene.add(ri.ForceField(lambda time, position, velocity: np.full_like(position, strength), bodies=["leaf"]))
    return scene


def test_functions_are_those_of_the_program(tmp_path: Path) -> None:
    whole = ri.simulate(blown(1.0), 0.5, cache=tmp_path / "run.h5")
    run = ri.simulate(blown(1.0, velocity=(5.0, 0.0, 0.0)), 0.5, cache=tmp_path / "run.h5", from_frame=15)
    np.testing.assert_array_equal(run.positions[:15], whole.positions[:15])
    assert run.velocity("leaf")[15, 0] == 5.0
    with pytest.raises(ri.SceneError, match="look at the time"):
        ri.simulate(blown(2.0), 0.5, cache=tmp_path / "run.h5", from_frame=15)


def test_what_cannot_go_on_is_refused(kept: Kept, tmp_path: Path) -> None:
    for frame in (0, -3, 40.5, 72, 100):
        with pytest.raises(ri.SceneError, match="give a frame from 1 to 71"):
            ri.simulate(yard(), DURATION, cache=kept.path, from_frame=frame)
    with pytest.raises(ri.SceneError, match="give fps=60"):
        ri.simulate(yard(), DURATION, 24.0, cache=kept.path, from_frame=FRAME)
    with pytest.raises(ri.SceneError, match="longer duration"):
        ri.simulate(yard(), 0.5, cache=kept.path, from_frame=FRAME)
    with pytest.raises(ri.SceneError, match="no such file"):
        ri.simulate(yard(), DURATION, cache=tmp_path / "none.h5", from_frame=FRAME)
    with pytest.raises(ri.SceneError, match="give the cache"):
        ri.simulate(yard(), DURATION, from_frame=FRAME)
    assert ri.simulate(yard(), DURATION, cache=kept.path).state_hash() == kept.whole.state_hash()


def test_frames_between_steps_of_the_run_and_a_longer_run(tmp_path: Path) -> None:
    # At 24 frames a second every other frame lies in the middle of a step.
    whole = ri.simulate(yard(), DURATION, 24.0, cache=tmp_path / "run.h5")
    run = ri.simulate(yard(rest={"velocity": (0, 0, 3)}), 2.0, 24.0, cache=tmp_path / "run.h5", from_frame=13)
    np.testing.assert_array_equal(run.positions[:13], whole.positions[:13])
    assert len(run.times) == 49
    np.testing.assert_allclose(run.position("ball")[: len(whole.times)], whole.position("ball"), atol=1e-9)
    assert run.status.ok


def test_a_sub_stepped_crowd_goes_on(tmp_path: Path) -> None:
    def crowd(**changes: Any) -> ri.Scene:
        scene, random = ri.Scene(), np.random.default_rng(3)
        scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
        for k in range(16):
            place = (0.25 * (k % 2), 0.25 * (k // 2 % 2), 0.2 + 0.25 * (k // 4))
            scene.add(ri.Body(f"box{k}", ri.Shape.box(0.2), position=place, orientation=(1, *random.normal(0.0, 0.02, 3))))
        scene.add(ri.Body("far", ri.Shape.sphere(0.1), position=(9, 0, 5), **changes))
        return scene

    accuracy = ri.Accuracy(contact_solver="substepped")
    whole = ri.simulate(crowd(), 1.0, accuracy=accuracy, cache=tmp_path / "run.h5")
    run = ri.simulate(crowd(mass=3.0), 1.0, accuracy=accuracy, cache=tmp_path / "run.h5", from_frame=30)
    np.testing.assert_array_equal(run.positions[:30], whole.positions[:30])
    assert run.status.ok
    # The boxes begin again where they are, without what the solver knew of their contacts: they settle 3.4 mm elsewhere, of 200.
    assert np.abs(run.positions[-1, 1:-1] - whole.positions[-1, 1:-1]).max() < 0.005


def test_the_command_line_goes_on_from_a_frame(tmp_path: Path) -> None:
    cache = str(tmp_path / "run.h5")
    program = tmp_path / "drop.py"
    text = (
        "import rigidimpulse as ri\n\n\ndef scene():\n    made = ri.Scene()\n"
        "    made.add(ri.Body('ball', ri.Shape.sphere(0.1), velocity=(SPEED, 0, 0)))\n    return made\n"
    )
    arguments = ["simulate", str(program), "--duration", "0.5", "--cache", cache, "-o", str(tmp_path / "run.npz")]
    program.write_text(text.replace("SPEED", "1"))
    assert CliRunner().invoke(main, arguments).exit_code == 0
    program.write_text(text.replace("SPEED", "4"))
    done = CliRunner().invoke(main, [*arguments, "--from-frame", "15"])
    assert done.exit_code == 0, done.output
    run = ri.load_recording(cache)
    np.testing.assert_allclose(run.velocity("ball")[[14, 15], 0], (1.0, 4.0))


def fastened(*things: Any) -> ri.Scene:
    """A ball that falls, held by what is given."""
    scene = ri.Scene()
    scene.add(ri.Body("ball", ri.Shape.sphere(0.2), position=(0, 0, 3), velocity=(0.5, 0, 0)))
    for thing in things:
        scene.add(thing)
    return scene


def test_new_joints_and_springs_are_fastened_where_bodies_are(tmp_path: Path) -> None:
    whole = ri.simulate(fastened(), 1.0, cache=tmp_path / "run.h5")
    anchor = np.array([0.0, 0.0, 2.0])
    joint = ri.BallJoint("ball", None, anchor)
    arm = np.linalg.norm(whole.position("ball")[30] - anchor)
    first = ri.simulate(fastened(joint), 1.0, cache=tmp_path / "run.h5", from_frame=30)
    # A change of the changed run: the joint stays where it is.
    for run in (first, ri.simulate(fastened(joint, ri.Drag(0.1)), 1.0, cache=tmp_path / "run.h5", from_frame=45)):
        np.testing.assert_allclose(np.linalg.norm(run.position("ball")[30:] - anchor, axis=1), arm, rtol=1e-9)
        # It hangs by its point at the anchor: it turns with its arm, at v = w x r.
        lever = run.position("ball")[50] - anchor
        np.testing.assert_allclose(np.cross(run.angular_velocity("ball")[50], lever), run.velocity("ball")[50], atol=1e-3)
    # A spring from the ball's centre at that frame, unstretched there: adding it adds no energy. Fastened where the ball began, it would
    # be stretched by some decimetres, and hold kilojoules.
    place = whole.position("ball")[20]
    spring = ri.Spring("ball", None, place, place + (0, 0, 1.0), stiffness=1e5)
    run = ri.simulate(fastened(spring), 1.0, cache=tmp_path / "run.h5", from_frame=20)
    assert abs(run.ledger.dissipated.get("change of the scene", np.zeros(1))[-1]) < 1e-6
    assert run.position("ball")[-1, 2] > whole.position("ball")[-1, 2] + 1.0


def test_a_joint_that_changes_stays_where_it_is_fastened(tmp_path: Path) -> None:
    def arm(speed: float) -> ri.Scene:
        scene = ri.Scene()
        scene.add(ri.Body("upper", ri.Shape.box((0.4, 0.1, 0.1)), position=(0.2, 0, 3)))
        scene.add(ri.Body("lower", ri.Shape.box((0.4, 0.1, 0.1)), position=(0.6, 0, 3)))
        scene.add(ri.HingeJoint("upper", None, (0, 0, 3), (0, 1, 0)))
        scene.add(ri.HingeJoint("upper", "lower", (0.4, 0, 3), (0, 1, 0), motor=ri.Motor(velocity=speed, damping=50.0)))
        return scene

    whole = ri.simulate(arm(0.0), 1.0, cache=tmp_path / "run.h5")
    run = ri.simulate(arm(2.0), 1.0, cache=tmp_path / "run.h5", from_frame=20)
    assert np.linalg.norm(whole.position("upper")[20] - whole.position("upper")[0]) > 0.1
    ends = [run.position(name) + sign * 0.2 * axis(run.orientation(name)) for name, sign in (("upper", 1.0), ("lower", -1.0))]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
    spins = run.angular_velocity("lower")[:, 1] - run.angular_velocity("upper")[:, 1]
    np.testing.assert_allclose((spins[15], abs(spins[-1])), (0.0, 2.0), atol=0.05)


def axis(orientation: np.ndarray) -> np.ndarray:
    """The x axes (f, 3) of a body."""
    w, x, y, z = orientation.T
    return np.column_stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)])
