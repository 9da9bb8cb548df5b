"""The sweeps find the first contact, to rounding, and never pass one.

Where a closed form exists it is the law; elsewhere the least gap of the two bodies (`manifold.dispatch.pair_gap`, tested on its own) is
sampled along the paths. Coordinates are a few metres, so gaps are good to ROUND_OFF = 1e-13 m, way travelled included.
"""

import numpy as np
import pytest
import trimesh
from contact_scenes import box, capsule, half_space, mesh, sphere
from sweep_pairs import ROUND_OFF, SHAPES, Pair, check_random_pairs, cylinder, random_pair, shape

from rigidimpulse.collision.geometry import ROUND, CompiledShape, Primitive, build_geometry
from rigidimpulse.collision.time_of_impact import bisection, conservative, linear
from rigidimpulse.collision.time_of_impact import end_of_step as after
from rigidimpulse.collision.time_of_impact.result import IMPACT, SEPARATE, TOUCHING
from rigidimpulse.collision.time_of_impact.safe_step import make_scratch
from rigidimpulse.motion.trajectory import FIXED, FREE, PRESCRIBED

GUARDED = [bisection, conservative]


@pytest.mark.parametrize("seed", range(8))
def test_random_pairs_against_dense_sampling(seed):
    """All kinds, random motions: both methods agree, nothing is touched before, and the gap is right at the time found."""
    check_random_pairs(np.random.default_rng(seed), 120, rates=False)


def test_swapped_bodies_meet_at_the_same_time():
    rng = np.random.default_rng(99)
    for pair in filter(None, (random_pair(rng) for _ in range(60))):
        time, status, _, witness = pair.sweep(end=0.1)
        other, other_status, _, other_witness = pair.sweep(end=0.1, swapped=True)
        assert status == other_status
        if status == IMPACT:
            assert abs(pair.gap(time) - pair.gap(other)) < ROUND_OFF
            assert other_witness[6:9] == pytest.approx(-witness[6:9], abs=1e-5)


@pytest.mark.parametrize("method", GUARDED)
def test_a_sweep_in_pieces_finds_the_same_contact(method):
    """Also where it begins at a gap that is barely above the margin. A closed form answers at once to the end."""
    rng, most = np.random.default_rng(7), 0
    for pair in filter(None, (random_pair(rng) for _ in range(60))):
        time, status, _, _ = pair.sweep(method, end=0.1)
        other, pieces = pair.sweep_in_pieces(method, 0.1, 0.013)
        most = max(most, pieces)
        assert (other == np.inf) == (status == SEPARATE)
        if status == IMPACT:
            assert abs(pair.gap(time) - pair.gap(other)) < ROUND_OFF
    assert most == 8


@pytest.mark.parametrize("method", GUARDED)
def test_ball_falls_on_a_plane(method):
    """1/2 g t^2 = z - r - impact_margin."""
    pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 2), acceleration=(0, 0, -9.81), spin=(3, 2, 1))
    time, status, queries, witness = pair.sweep(method, end=1.0, impact_margin=0.0)
    assert status == IMPACT
    assert time == pytest.approx(np.sqrt(2.0 * 1.5 / 9.81), abs=1e-15)
    assert queries <= 3
    assert witness[6:9] == pytest.approx([0.0, 0.0, 1.0], abs=1e-15)


@pytest.mark.parametrize("method", GUARDED)
def test_balls_graze_or_miss(method):
    """A ball at 1,000 m/s passes a fixed one at the distance of centres 1 +- e: it hits from the front if closer than 1."""
    for miss in (1e-3, 1e-9, 1e-13):
        for side in (-1.0, 1.0):
            pair = Pair("sphere", "sphere").set(1, FREE, (-8, 0, 1.0 + side * miss), velocity=(1000, 0, 0))
            time, status, _, _ = pair.sweep(method, impact_margin=0.0)
            if side > 0.0:
                assert status == SEPARATE
            else:
                reach = np.sqrt((2.0 - miss) * miss)  # of the chord at that height
                assert time == pytest.approx((8.0 - reach) / 1000.0, abs=1e-16 + 1e-17 / reach)


@pytest.mark.parametrize("method", GUARDED)
def test_ball_thrown_at_a_ball_meets_the_root_of_the_quartic(method):
    rng = np.random.default_rng(5)
    for _ in range(50):
        x, v = rng.normal(size=3) * 3.0 + [0, 0, 4.0], rng.normal(size=3) * 4.0
        a = np.array([0.0, 0.0, -9.81])
        pair = Pair("sphere", "sphere").set(1, FREE, x, velocity=v, acceleration=a)
        time, status, _, _ = pair.sweep(method, end=2.0, impact_margin=0.0)
        square = np.polynomial.Polynomial([x @ x - 1.0, 2.0 * x @ v, v @ v + x @ a, v @ a, 0.25 * a @ a])
        roots = [r.real for r in square.roots() if abs(r.imag) < 1e-9 and 0.0 < r.real < 2.0]
        assert (status == IMPACT) == bool(roots)
        if roots:
            assert time == pytest.approx(min(roots), abs=1e-9)


@pytest.mark.parametrize("method", GUARDED)
@pytest.mark.parametrize("name", ["ball", "box", "capsule", "cylinder", "hull"])
def test_bullet_against_a_thin_wall(method, name):
    """A body 1 cm long at 1,000 m/s meets a wall 1 mm thick that flies towards it; head on it would cross it in 1 microsecond."""
    small = {
        "ball": sphere(0.005),
        "box": mesh(box(0.01, 0.01, 0.01)),
        "capsule": capsule(0.003, 0.004),
        "cylinder": cylinder(0.005, 0.01),
        "hull": mesh(trimesh.convex.convex_hull(np.random.default_rng(2).normal(size=(12, 3)) * 0.003)),
    }
    geometry = build_geometry([shape(mesh(box(0.001, 2.0, 2.0))), shape(small[name])])
    pair = Pair("wall", "bullet", geometry, make_scratch(geometry), ["wall", "bullet"])
    rng = np.random.default_rng(3)
    for _ in range(10):
        pair.set(0, FREE, velocity=(-300, 0, 0), turned=np.array([1, 0, 0, 0]) + 0.1 * rng.normal(size=4))
        velocity, spin, turned = (1000, 3, 2), rng.normal(size=3) * 500, rng.normal(size=4)
        pair.set(1, FREE, (-10.0, 0.1, 0.2), velocity=velocity, spin=spin, turned=turned, inertia=(1.0, 1.2, 0.9))
        time, status, _, _ = pair.sweep(method)
        assert status == IMPACT
        assert 9.0 / 1300.0 < time < 11.0 / 1300.0
        assert abs(pair.gap(time) - 1e-6) < ROUND_OFF


@pytest.mark.parametrize("method", GUARDED)
def test_bar_at_500_radians_per_second_meets_a_thin_post(method):
    """The side of a bar, half as wide as a, turning at w, meets a post of radius r at the distance D when
    sin(phi - w t) = (a + r + impact_margin) / D: here after up to half a turn, of 1.3 turns in the step. Two posts: the first one counts.
    """
    names = ["bar", "post"]
    geometry = build_geometry([shape(mesh(box(2.0, 0.01, 0.01))), shape(cylinder(0.002, 1.0))])
    pair = Pair("bar", "post", geometry, make_scratch(geometry), names)
    w, distance, impact_margin = 500.0, 0.7, 1e-6
    for phi in (0.1, 1.0, 2.0, 3.1):
        pair.set(0, PRESCRIBED, spin=(0, 0, w))
        pair.set(1, FIXED, (distance * np.cos(phi), distance * np.sin(phi), 0.0))
        time, status, _, _ = pair.sweep(method, impact_margin=impact_margin)
        assert status == IMPACT
        assert time == pytest.approx((phi - np.arcsin((0.005 + 0.002 + impact_margin) / distance)) / w, abs=1e-16 / w * 1e3)


@pytest.mark.parametrize("method", GUARDED)
def test_the_first_of_two_contacts_is_found(method):
    """A ball at 400 m/s meets one ball of a dumb-bell, and would meet the other 2 m later, in the same step."""
    names = ["two", "ball"]
    geometry = build_geometry([shape(sphere(0.1, at=(-1, 0, 0)), sphere(0.1, at=(1, 0, 0))), shape(sphere(0.1))])
    pair = Pair("two", "ball", geometry, make_scratch(geometry), names)
    pair.set(1, FREE, (-3, 0, 0), velocity=(400, 0, 0))
    time, status, _, witness = pair.sweep(method, impact_margin=0.0)
    assert status == IMPACT
    assert time == pytest.approx(1.8 / 400.0, abs=1e-16)
    assert witness[0:3] == pytest.approx([-1.1, 0, 0], abs=1e-12)


def grid(cells, size):
    """A flat square of 2 cells^2 triangles."""
    ticks = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    vertices = np.array([(x, y, 0.0) for x in ticks for y in ticks])
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    lower = np.column_stack([corner, corner + cells + 1, corner + cells + 2])
    upper = np.column_stack([corner, corner + cells + 2, corner + 1])
    return Primitive(ROUND, vertices=vertices, faces=np.concatenate([lower, upper]))


RESTING = {
    # shape: height of the centre, turned so, velocity and spin that keep the gap
    "box": (0.5, (1, 0, 0, 0.3), (1.0, 0.3, 0.0), (0.0, 0.0, 0.0)),
    "spinning box": (0.5, (1, 0, 0, 0), (1.0, 0.3, 0.0), (0.0, 0.0, 5.0)),
    "standing cylinder": (0.4, (1, 0, 0, 0), (0.0, 1.0, 0.0), (0.0, 0.0, 5.0)),
    "rolling cylinder": (0.4, (1, 1, 0, 0), (1.0, 0.0, 0.0), (0.0, 2.5, 0.0)),
    "rolling capsule": (0.2, (1, 0, 0, 1), (0.5, 0.0, 0.0), (0.0, 2.5, 0.0)),
    "rolling ball": (0.5, (1, 0, 0, 0), (1.0, 0.0, 0.0), (0.0, 2.0, 0.0)),
}


@pytest.mark.parametrize("method", GUARDED)
@pytest.mark.parametrize("floor", ["half space", "grid", "slab"])
@pytest.mark.parametrize("name", RESTING)
def test_what_slides_or_rolls_at_a_gap_does_not_stall(method, floor, name):
    """1e-6 m above the floor, contact at half of that: the gap never changes, so few steps must be enough."""
    solids = {
        "box": mesh(box(1.0, 1.0, 1.0)),
        "cylinder": cylinder(0.4, 0.8),
        "capsule": capsule(0.2, 1.0),
        "ball": sphere(0.5),
    }
    floors = {"half space": half_space(), "grid": grid(20, 4.0), "slab": mesh(box(4.0, 4.0, 1.0, at=(0, 0, -0.5)))}
    geometry = build_geometry([shape(p) for p in (*floors.values(), *solids.values())])
    pair = Pair(floor, name.split()[-1], geometry, make_scratch(geometry), [*floors, *solids])
    height, turned, velocity, spin = RESTING[name]
    pair.set(1, FREE, (0.013, 0.017, height + 1e-6), velocity=velocity, spin=spin, turned=turned)
    _, status, queries, _ = pair.sweep(method, impact_margin=5e-7)
    assert status == SEPARATE
    assert queries <= 30


@pytest.mark.parametrize("method", GUARDED)
@pytest.mark.parametrize("name", ["ball", "box", "cylinder"])
def test_at_the_gap_of_contact(method, name):
    """At `impact_margin`: leaving is free until the return, hovering is free, approaching is contact at once."""
    impact_margin = 1e-3
    pair = Pair("half space", name)
    height = {"ball": 0.05, "box": 0.2, "cylinder": 0.4}[name] + impact_margin
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, 2))
    assert pair.sweep(method, impact_margin=impact_margin)[1] == SEPARATE
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, 1e-17))
    assert pair.sweep(method, impact_margin=impact_margin)[1] == SEPARATE
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, -1e-17))
    assert pair.sweep(method, impact_margin=impact_margin)[1] == SEPARATE
    pair.set(1, FREE, (0, 0, height - 1e-16), velocity=(1, 0, -1.0))
    time, status, _, _ = pair.sweep(method, impact_margin=impact_margin)
    assert (time, status) == (0.0, TOUCHING) or (status == IMPACT and time < 1e-15)
    # Thrown up at 1 m/s it is back after 2 v / g; and from half the gap, it passes `impact_margin` upwards and comes down on it.
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, 1), acceleration=(0, 0, -9.81))
    assert pair.sweep(method, end=0.5, impact_margin=impact_margin)[0] == pytest.approx(2.0 / 9.81, abs=1e-12)
    pair.set(1, FREE, (0, 0, height - 0.5 * impact_margin), velocity=(1, 0, 1), acceleration=(0, 0, -9.81))
    late = (1.0 + np.sqrt(1.0 - 9.81 * impact_margin)) / 9.81
    assert pair.sweep(method, end=0.5, impact_margin=impact_margin)[0] == pytest.approx(late, abs=1e-12)


def test_crossing_bodies_touch_at_the_start():
    pair = Pair("box", "notch").set(1, FREE, (0.1, 0.05, 0.0), velocity=(-1, 0, 0))
    for method in GUARDED:
        time, status, _, _ = pair.sweep(method)
        assert (time, status) == (0.0, TOUCHING)


def test_scaling_by_a_power_of_two_changes_no_bit():
    """Lengths times 1024: the same operations on scaled numbers."""
    rng = np.random.default_rng(8)
    large = build_geometry(
        [
            CompiledShape(
                tuple(
                    Primitive(
                        p.kind,
                        p.radius * 1024.0,
                        p.frame * np.repeat([1.0, 1024.0], [6, 1]),  # of cylinders at the origin
                        p.vertices * 1024.0,
                        p.faces,
                    )
                    for p in s.primitives
                )
            )
            for s in (SHAPES["box"], SHAPES["hull"], SHAPES["cylinder"], SHAPES["capsule"])
        ]
    )
    names = ["box", "hull", "cylinder", "capsule"]
    small = build_geometry([SHAPES[name] for name in names])
    for _ in range(20):
        a, b = rng.choice(names, 2)
        first = Pair(a, b, small, make_scratch(small), names)
        second = Pair(a, b, large, make_scratch(large), names)
        turned, spin = rng.normal(size=4), rng.normal(size=3) * 5.0
        for pair, unit in ((first, 1.0), (second, 1024.0)):
            pull, velocity = np.array([0, 0, -9.81 * unit]), np.array([0.5, 0.2, -20.0]) * unit
            position = np.array([0, 0, 1.6 * unit])
            pair.set(1, FREE, position, velocity, spin, turned, acceleration=pull, inertia=(1.0, 1.5, 2.0))
        one, other = first.sweep(end=0.1), second.sweep(end=0.1, impact_margin=1024e-6, tolerance=1024e-15)
        assert one[:3] == other[:3]


def test_linear_may_miss_what_is_not_yet_approaching():
    """A ball dropped from rest: the safe methods find it, the linear one does not look again."""
    pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 0.55), acceleration=(0, 0, -9.81))
    assert pair.sweep(linear, end=0.5)[1] == SEPARATE
    assert pair.sweep(end=0.5)[1] == IMPACT
    pair.set(1, FREE, (0, 0, 0.75), velocity=(0, 0, -2), acceleration=(0, 0, 0))
    time, status, queries, witness = pair.sweep(linear, end=0.5, impact_margin=0.05)
    assert status == IMPACT
    assert queries <= 3
    assert time == pytest.approx(0.1, abs=1e-15)
    assert witness[9] == pytest.approx(0.05, abs=1e-15)


def test_after_reports_what_overlaps_at_the_end_and_misses_what_passed():
    pair = Pair("box", "ball").set(1, FREE, (0.0, 0.0, 1.0), velocity=(0, 0, -50))
    time, status, _, witness = pair.sweep(after, end=0.02)  # deep inside the box: its surfaces do not cross the ball's
    assert (time, status) == (0.02, IMPACT)
    assert witness[6:9] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    assert pair.sweep(after, end=0.04)[1] == SEPARATE  # out again on the far side
    assert pair.sweep(end=0.04)[1] == IMPACT
    assert pair.sweep(after, end=0.005)[1] == SEPARATE
