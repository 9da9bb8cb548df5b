"""Bodies that are carried along keyframes and let go: from then on they move as dynamic bodies do, with what they had."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rigidimpulse as ri
from rigidimpulse.engine.simulate import simulate_whole

G = np.array([0.0, 0.0, -9.81])


def carried(velocity, release_time, shape=None, **more):
    """A body on a straight path of 2 s, let go on the way."""
    times = np.linspace(0.0, 2.0, 49)
    keys = ri.Keyframes(times, times[:, None] * np.asarray(velocity) + (0.0, 0.0, 5.0))
    shape = shape or ri.Shape.box((0.3, 0.2, 0.1))
    return ri.Body("thrown", shape, motion="kinematic", position=(0, 0, 5), keyframes=keys, release_time=release_time, **more)


def test_it_flies_on_with_the_velocity_of_its_keys():
    # Between 1/24 s apart keys and frames both: x(T) + v (t - T) + g (t - T)^2 / 2. A body that began at rest would be 0.5 m off.
    v, release = np.array([2.0, 0.5, 1.0]), 0.51
    run = ri.simulate(ri.Scene(bodies=[carried(v, release)]), 1.2, 60.0)
    after = np.maximum(run.times - release, 0.0)[:, None]
    expected = np.array([0.0, 0.0, 5.0]) + v * run.times[:, None] + 0.5 * G * after**2
    np.testing.assert_allclose(run.position("thrown"), expected, rtol=0, atol=1e-13)
    # In frame 0, too, in which it had none.
    np.testing.assert_allclose(run.velocity("thrown"), v + G * after, rtol=0, atol=1e-13)


def test_it_spins_on():
    # About a principal axis the spin stays: 3 rad/s, from keys that turn by 0.125 rad each; 1 s after the release it has turned by 4.5 rad.
    times = np.linspace(0.0, 2.0, 49)
    turns = np.stack([np.cos(1.5 * times), 0 * times, 0 * times, np.sin(1.5 * times)], axis=1)
    keys = ri.Keyframes(times, np.zeros((49, 3)), turns)
    body = ri.Body("top", ri.Shape.box((0.3, 0.2, 0.1)), motion="kinematic", keyframes=keys, release_time=0.5)
    run = ri.simulate(ri.Scene(gravity=(0, 0, 0), bodies=[body]), 1.5, 60.0)
    angle = 2.0 * np.arctan2(run.orientation("top")[-1, 3], run.orientation("top")[-1, 0])
    assert np.cos(angle - 4.5) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(run.angular_velocity("top")[-1], (0, 0, 3), atol=1e-12)


def test_until_then_nothing_moves_it():
    # A ball of a tonne drops on a plate of 1 kg that is carried: the plate stays until it is let go, then both fall.
    scene = ri.Scene(bodies=[
        ri.Body("plate", ri.Shape.box((1, 1, 0.1)), motion="kinematic", position=(0, 0, 3), mass=1.0, release_time=1.0),
        ri.Body("ball", ri.Shape.sphere(0.2), position=(0, 0, 3.5), mass=1000.0, material=ri.Material(restitution=0.0)),
    ])  # fmt: skip
    run = ri.simulate(scene, 1.5, 60.0)
    before = run.times <= 1.0
    np.testing.assert_array_equal(run.position("plate")[before], np.tile((0, 0, 3), (before.sum(), 1)))
    assert run.position("ball")[before][-1, 2] == pytest.approx(3.25, abs=1e-4)
    for name in ("plate", "ball"):  # g t^2 / 2 of half a second
        fall = run.position(name)[before][-1, 2] - run.position(name)[-1, 2]
        assert fall == pytest.approx(0.5 * 9.81 * 0.25, abs=1e-4)


@pytest.mark.parametrize("count", [1, 8])
def test_what_rests_on_it_wakes(count):
    # Boxes sleep on a tray; when it is let go all fall with g: after 0.2 s by 0.196 m. Eight times eight boxes are sub-stepped.
    scene = ri.Scene(bodies=[ri.Body("tray", ri.Shape.box((5, 5, 0.1)), motion="kinematic", position=(0, 0, 2), release_time=0.5)])
    for k in range(count):
        for j in range(count):
            scene.add(ri.Body(f"box{k}{j}", ri.Shape.box((0.3, 0.3, 0.3)), position=(-2 + 0.5 * k, -2 + 0.5 * j, 2.2)))
    run = ri.simulate(scene, 0.7, 60.0)
    before = int(np.flatnonzero(run.times <= 0.5)[-1])
    for name in run.names:
        assert run.position(name)[before, 2] - run.position(name)[-1, 2] == pytest.approx(0.5 * 9.81 * 0.04, rel=0.01)


def test_joints_and_forces_hold_it_from_then_on():
    # A bob hangs from a trolley; let go, their centre of mass falls with g, and nothing of their energy is lost.
    scene = ri.Scene(bodies=[carried((1, 0, 0), 0.5, ri.Shape.box((0.3, 0.3, 0.3)))])
    scene.add(ri.Body("bob", ri.Shape.sphere(0.1), position=(0, 0, 4)))
    scene.add(ri.BallJoint("thrown", "bob", (0, 0, 5)))
    run = ri.simulate(scene, 1.5, 120.0)
    masses = np.array([0.3**3, 4 / 3 * np.pi * 0.1**3])
    centre = (masses[0] * run.center_of_mass("thrown") + masses[1] * run.center_of_mass("bob")) / masses.sum()
    acceleration = np.diff(centre, 2, axis=0)[70:] * 120.0**2
    np.testing.assert_allclose(acceleration, np.tile(G, (len(acceleration), 1)), atol=1e-7)
    arm = run.position("bob") - run.position("thrown")
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 1.0, atol=1e-6)


def held(**more):
    """A box of 2 kg that is carried at 1 m/s until 1 s, 3 m from a post."""
    box = ri.Body(
        "held", ri.Shape.box((0.2, 0.2, 0.2)), motion="kinematic", mass=2.0, position=(0, 0, 5), velocity=(1, 0, 0), release_time=1.0
    )
    box = replace(box, **more)
    return ri.Scene(bodies=[box, ri.Body("post", ri.Shape.sphere(0.1), motion="static", position=(0, 3, 5))])


def test_a_rocket_waits_until_it_is_let_go_and_has_the_mass_of_that_instant():
    """Lit at 0.5 s, let go at 1 s: it stands until then, then v = u ln(m_1 / m) - g (t - 1) from then on, 1e-9 m/s. It fell."""
    scene = held(mass=10.0, velocity=(0, 0, 0))
    scene.add(ri.Thruster("held", 200.0, 2.0, (0, 0, 1), 6.0, start=0.5))
    run = ri.simulate(scene, 1.5, 60.0)
    waits = run.times <= 1.0
    np.testing.assert_array_equal(run.position("held")[waits], np.tile((0, 0, 5), (waits.sum(), 1)))
    np.testing.assert_array_equal(run.velocity("held")[waits], np.zeros((waits.sum(), 3)))
    t = run.times[~waits]
    expected = 200.0 * np.log(9.0 / (10.0 - 2.0 * (t - 0.5))) - 9.81 * (t - 1.0)
    np.testing.assert_allclose(run.velocity("held")[~waits, 2], expected, rtol=0, atol=1e-9)
    assert run.status.ok


@pytest.mark.parametrize(
    "force",
    [
        ri.Drag(linear=1.0),
        ri.HarmonicForce("held", 3.0, 1.0, (0, 1, 0)),
        ri.PDController("held", position=(0, 0, 0), stiffness=10.0),
        ri.Spring("post", "held", anchor_a=(0, 3, 5), anchor_b=(0, 0, 5), stiffness=20.0, rest_length=2.0),
    ],
    ids=["drag", "harmonic", "controller", "spring"],
)
def test_forces_do_not_move_what_is_held_and_do_no_work(force):
    """Under a force that varies it fell with g from the start: 4.9 m in 1 s. Energy that nobody had given was in the ledger."""
    scene = held()
    scene.add(force)
    run = ri.simulate(scene, 2.0, 60.0)
    waits = run.times <= 1.0
    path = run.times[waits, None] * np.array([1.0, 0.0, 0.0]) + (0.0, 0.0, 5.0)
    np.testing.assert_allclose(run.position("held")[waits], path, rtol=0, atol=1e-14)
    work = {cause: taken for cause, taken in run.ledger.dissipated.items() if cause != "let go" and "spring" not in cause}
    assert all(np.all(taken[waits] == 0.0) for taken in work.values())
    whole = run.ledger.total + sum(run.ledger.dissipated.values())
    np.testing.assert_allclose(whole, whole[0], rtol=0, atol=1e-6)
    assert run.status.ok
    # As if it had been dynamic with that pose and velocity: 1e-6 m, of 5 m that it falls.
    free = ri.Scene(bodies=[ri.Body("held", ri.Shape.box((0.2, 0.2, 0.2)), mass=2.0, position=(1, 0, 5), velocity=(1, 0, 0))])
    if isinstance(force, ri.Drag):
        free.add(force)
        fall = ri.simulate(free, 1.0, 60.0).position("held")[-1]
        np.testing.assert_allclose(run.position("held")[-1], fall, rtol=0, atol=1e-6)


@pytest.mark.parametrize("floor", [False, True])
def test_a_spring_to_what_is_held_pulls_as_one_to_what_is_carried(floor):
    """Until the release it is a support. The work on the held end was counted, too: 0.36 J, "energy made"; and it was taken to fall."""
    pulled, amounts = [], []
    for release in (None, 5.0):
        scene = held(release_time=release, position=(0, 0, 0.5))
        scene.add(ri.Body("free", ri.Shape.box((0.2, 0.2, 0.2)), mass=1.0, position=(-0.5, 0, 0.1)))
        scene.add(ri.Spring("held", "free", anchor_a=(0, 0, 0.5), anchor_b=(-0.5, 0, 0.1), stiffness=10.0, rest_length=0.6))
        if floor:
            scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=ri.Material(static_friction=0.3)))
        run = ri.simulate(scene, 1.5, 60.0)
        assert run.status.ok
        pulled.append(run.position("free"))
        amounts.append(run.ledger.dissipated["spring held - free"])
    np.testing.assert_allclose(pulled[0], pulled[1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(amounts[0], amounts[1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("shape", [ri.Shape.box(0.2), ri.Shape.sphere(0.1)])
def test_what_it_lifts_before_is_no_energy_that_comes_from_nothing(shape):
    """The lift works on what lies on it. After the release it was no support any more, and 109 J were said to come from nothing."""
    keys = ri.Keyframes([0.0, 0.5, 1.0], [(0, 0, 0.5), (0, 0, 1.5), (0.5, 0, 2.0)], [(1, 0, 0, 0)] * 3)
    lift = ri.Body("lift", ri.Shape.box((1, 1, 0.1)), motion="kinematic", keyframes=keys, release_time=0.8, mass=5)
    floor = ri.Body("floor", ri.Shape.half_space(), motion="static")
    run = ri.simulate(ri.Scene(bodies=[floor, lift, ri.Body("load", shape, position=(0, 0, 0.66))]), 1.2)
    assert run.status.ok, run.status.message
    whole = run.ledger.total + sum(run.ledger.dissipated.values())
    assert np.ptp(whole) < 1e-9 * run.ledger.kinetic.max()


def test_the_ledger_counts_it_from_then_on():
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static"), carried((2, 0, 1), 0.51)])
    run = ri.simulate(scene, 2.5, 60.0)
    whole = run.ledger.total + sum(run.ledger.dissipated.values())
    np.testing.assert_allclose(whole, whole[0], atol=1e-10)
    assert np.all(run.ledger.kinetic[run.times < 0.51] == 0.0)
    pulled = run.impulses("thrown")["gravity"][-1]
    np.testing.assert_allclose(pulled, 6.0 * G * (2.5 - 0.51), rtol=1e-12)


def test_it_bounces_and_comes_to_rest_like_any_other_body():
    """Watched or not: where nobody listens several steps may be taken at once, and it fell through the floor."""
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static"), carried((0.3, 0, 0), 0.4)])
    run = ri.simulate(scene, 5.0, 60.0)
    assert run.status.ok
    assert np.all(run.velocity("thrown")[-1] == 0.0)
    assert run.position("thrown")[:, 2].min() > 0.049
    assert simulate_whole(scene, 5.0, 60.0).state_hash() == run.state_hash()


def test_the_same_bits_with_a_cache_that_is_gone_on_with(tmp_path):
    pytest.importorskip("h5py")
    scene = ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static"), carried((2, 0, 1), 0.5)])

    def stop_after(end):
        def progress(time):
            if time > end:
                raise KeyboardInterrupt

        return progress

    for end in (0.3, 0.7):
        part = ri.simulate(scene, 2.0, cache=ri.Cache(tmp_path / "run.h5", every=0.0), progress=stop_after(end))
        assert part.status.is_partial
    whole = ri.simulate(scene, 2.0)
    assert ri.simulate(scene, 2.0, cache=tmp_path / "run.h5").state_hash() == whole.state_hash()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"release_time": 0.0}, "release_time is 0.0"),
        ({"release_time": np.nan}, "release_time"),
        ({"motion": "dynamic", "keyframes": None}, "motion is 'dynamic'"),
        ({"shape": ri.Shape.half_space()}, "half space"),
        ({"shape": ri.Shape.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])}, "encloses no volume|open|not closed"),
    ],
)
def test_what_cannot_be_let_go_is_refused(change, words):
    with pytest.raises(ri.SceneError, match=words):
        ri.simulate(ri.Scene(bodies=[replace(carried((0, 0, 0), 0.5), **change)]), 0.1)


def test_the_origin_of_a_turning_body_goes_straight() -> None:
    """A door with its frame at the hinge turns by 90 degrees between two keys: the hinge stays. It moved 0.146 m."""
    half = np.sqrt(0.5)
    keys = ri.Keyframes([0.0, 1.0], [(0, 0, 0), (0, 0, 0)], [(1, 0, 0, 0), (half, 0, 0, half)])
    door = ri.Shape.convex_hull([(x, y, z) for x in (0.0, 1.0) for y in (-0.02, 0.02) for z in (-1.0, 1.0)])
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("door", door, motion="kinematic", keyframes=keys))
    run = ri.simulate(scene, 1.0, 240.0)
    # The centre leaves its arc by 1e-8 of the size at most. Along chords of 0.02 rad it left it by 2.5e-5 m.
    assert np.linalg.norm(run.position("door"), axis=1).max() < 1e-8 * np.sqrt(0.5**2 + 0.02**2 + 1.0)
    assert np.linalg.norm(run.position("door")[[0, -1]], axis=1).max() < 1e-12


def turning(rate: float, time: float) -> ri.Keyframes:
    """Keys of a body that turns about z through its origin."""
    times = np.linspace(0.0, time, int(rate * time) + 2)
    turns = np.stack([np.cos(0.5 * rate * times), 0 * times, 0 * times, np.sin(0.5 * rate * times)], axis=1)
    return ri.Keyframes(times, np.zeros((len(times), 3)), turns)


def off_its_origin(size: tuple[float, float, float], offset: tuple[float, float, float]) -> ri.Shape:
    return ri.Shape.compound([(ri.Shape.box(size), offset, (1, 0, 0, 0))])


@pytest.mark.parametrize("rate", [2.0, 10.0])
def test_a_centre_off_the_origin_is_let_go_with_its_own_velocity(rate: float) -> None:
    """w x r, and straight on without gravity. The path's velocity is off by R w b^3 / 125, b = 0.04 rad: 1e-6. Chords were off by 1e-2."""
    scene = ri.Scene(gravity=(0, 0, 0))
    shape = off_its_origin((1, 0.1, 0.1), (0.5, 0, 0))
    scene.add(ri.Body("arm", shape, motion="kinematic", keyframes=turning(rate, 2.0), release_time=1.0))
    run = ri.simulate(scene, 2.0, 60.0)
    law = 0.5 * np.array([np.cos(rate), np.sin(rate), 0.0]), 0.5 * rate * np.array([-np.sin(rate), np.cos(rate), 0.0])
    np.testing.assert_allclose(run.velocity("arm")[-1], law[1], atol=1e-6 * rate)
    np.testing.assert_allclose(run.center_of_mass("arm")[-1], law[0] + law[1], atol=1e-6 * rate)


@pytest.mark.parametrize("offset", [0.0, 0.5, 2.0])
@pytest.mark.parametrize(("solver", "tolerance"), [("auto", 1e-5), ("substepped", 1e-3)])
def test_a_turntable_off_its_origin_takes_along_what_stands_on_it(offset: float, solver: str, tolerance: float) -> None:
    """Friction holds a box at r w^2 = 1.4 m/s2 < mu g = 4.9 m/s2. Where the velocity of the table jumped, it crept out 1.5 cm in 4 s.

    In sub-steps a body may lag by what friction lets through, as on a table about its centre: 4e-4 m.
    """
    rate, scene, material = 1.2, ri.Scene(gravity=(0, 0, -9.81)), ri.Material(static_friction=0.5)
    table = off_its_origin((8, 8, 0.2), (offset, 0, -0.1))
    scene.add(ri.Body("table", table, motion="kinematic", keyframes=turning(rate, 4.0), material=material))
    moving = {"velocity": (0, rate, 0), "angular_velocity": (0, 0, rate), "material": material}
    scene.add(ri.Body("box", ri.Shape.box((0.1, 0.1, 0.05)), position=(1, 0, 0.025), **moving))
    run = ri.simulate(scene, 4.0, 60.0, accuracy=ri.Accuracy(contact_solver=solver))
    assert run.status.ok
    assert np.abs(np.linalg.norm(run.position("box")[:, :2], axis=1) - 1.0).max() < tolerance


@pytest.mark.parametrize("first", [-0.5, 0.0, 0.5])
def test_a_body_with_keys_begins_where_they_have_it(first: float) -> None:
    """Frame 0 shows the path at time 0, or the first key before it; the body's own position says nothing. It was shown at the origin."""
    keys = ri.Keyframes([first, first + 2.0], [(1.0, 0, 0), (3.0, 0, 0)])
    scene = ri.Scene(gravity=(0, 0, 0))
    scene.add(ri.Body("hand", ri.Shape.box((0.8, 0.8, 0.8)), motion="kinematic", keyframes=keys))
    run = ri.simulate(scene, 1.0, 24.0)
    assert run.position("hand")[:, 0] == pytest.approx(np.maximum(1.0 + run.times - first, 1.0), abs=1e-12)
