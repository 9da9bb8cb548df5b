"""The sweeps find the first contact, to rounding, and never pass one.

Where a closed form exists it is the law; elsewhere the least gap of the two bodies (`detect.manifold.pair_gap`, tested on its own) is
sampled along the paths. Coordinates are a few metres, so gaps are good to ROUND_OFF = 1e-13 m, way travelled included.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from contact_scenes import box, capsule, half_space, mesh, prism, sphere

from rigidimpulse._jit import jit
from rigidimpulse.detect.manifold import pair_gap
from rigidimpulse.geometry import CYLINDER, ROUND, CompiledShape, Primitive, build_geometry
from rigidimpulse.integrate.course import FIXED, FORCED, FREE, PRESCRIBED, begin, make_course, pose_at
from rigidimpulse.rotation import quaternion_to_matrix
from rigidimpulse.sweep import after, bisection, conservative, linear
from rigidimpulse.sweep.guard import make_scratch
from rigidimpulse.sweep.impact_time import IMPACT, SEPARATE, TOUCHING

ROUND_OFF = 1e-13
GUARDED = [bisection, conservative]
STEP = 1.0 / 60.0


def cylinder(radius, height):
    return Primitive(CYLINDER, radius, frame=np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5 * height]))


def shape(*primitives):
    return CompiledShape(primitives)


SHAPES = {
    "sphere": shape(sphere(0.5)),
    "ball": shape(sphere(0.05)),
    "box": shape(mesh(box(1.0, 0.6, 0.4))),
    "needle": shape(mesh(box(3.0, 0.01, 0.01))),
    "capsule": shape(capsule(0.2, 1.0)),
    "cylinder": shape(cylinder(0.4, 0.8)),
    "disc": shape(cylinder(0.5, 0.02)),
    "hull": shape(mesh(trimesh.convex.convex_hull(np.random.default_rng(1).normal(size=(14, 3)) * 0.4))),
    "notch": shape(mesh(prism([(-0.5, -0.5), (0.5, -0.5), (0.5, -0.1), (-0.1, -0.1), (-0.1, 0.5), (-0.5, 0.5)], 0.5))),
    "half space": shape(half_space()),
    "compound": shape(sphere(0.3, at=(0.5, 0.0, 0.0)), cylinder(0.2, 1.0), capsule(0.1, 1.6)),
}
GEOMETRY = build_geometry(list(SHAPES.values()))
SCRATCH = make_scratch(GEOMETRY)
NAMES = list(SHAPES)


class Pair:
    """Two bodies on their courses; body 0 is fixed at the origin unless set otherwise."""

    def __init__(self, name_a, name_b, geometry=GEOMETRY, scratch=SCRATCH, names=NAMES):
        self.shapes = names.index(name_a), names.index(name_b)
        self.detector = SimpleNamespace(
            geometry=geometry, shape_of_body=np.array(self.shapes, dtype=np.int64), sweep_scratch=scratch, max_queries=10_000
        )
        self.course = make_course(2)

    def set(self, body, mode, position=(0, 0, 0), velocity=(0, 0, 0), spin=(0, 0, 0), turned=(1, 0, 0, 0), **rows):
        course = self.course
        course.mode[body] = mode
        course.position[body], course.velocity[body], course.angular_velocity[body] = position, velocity, spin
        course.orientation[body] = np.array(turned) / np.linalg.norm(turned)
        for name, value in rows.items():
            getattr(course, name)[body] = value
        begin(course, body)
        return self

    def sweep(self, method=bisection, end=STEP, touch=1e-6, tolerance=1e-15, start=0.0, swapped=False):
        """(time, status, queries, witness) of the pair."""
        a, b = np.array([int(swapped)]), np.array([int(not swapped)])
        rows = [np.array([float(value)]) for value in (start, touch, tolerance)]
        result = method.sweep(self.detector, self.course, a, b, rows[0], end, rows[1], rows[2])
        return result.time[0], result.status[0], result.queries[0], result.witness[0]

    def gap(self, t):
        return gap_at(self.detector.geometry, self.course, *self.shapes, t)


@jit
def gap_at(geometry, course, shape_a, shape_b, t):
    """Least gap of bodies 0 and 1 at time t."""
    x, q, axes, points = np.empty((2, 3)), np.empty((2, 4)), np.empty((2, 3, 3)), np.empty(7)
    for i in range(2):
        pose_at(course, i, t, x[i], q[i])
        quaternion_to_matrix(q[i], axes[i])
    return pair_gap(geometry, shape_a, x[0], axes[0], shape_b, x[1], axes[1], np.inf, points)


@jit
def first_sample_below(geometry, course, shape_a, shape_b, start, end, samples, level):
    """First of the sampled times at which the gap is below a level; inf if none is."""
    for i in range(samples + 1):
        t = start + (end - start) * i / samples
        if gap_at(geometry, course, shape_a, shape_b, t) < level:
            return t
    return np.inf


def random_pair(rng, rates=False):
    """Two random bodies a random gap apart, with jerks and torque rates if asked for; None if they overlap wherever they are put."""
    pair = Pair(*rng.choice(NAMES, 2))
    for body, kind in enumerate(pair.shapes):
        plane = NAMES[kind] == "half space"
        mode = rng.choice([FIXED, PRESCRIBED] if plane else [FREE, FREE, FREE, FORCED, PRESCRIBED, FIXED])
        split = 10 ** rng.uniform(-0.7, 0.7, size=3)
        still, free = mode == FIXED, mode in (FREE, FORCED)
        pair.set(
            body,
            mode,
            velocity=np.zeros(3) if still else rng.normal(size=3) * 10 ** rng.uniform(-1, 1.5),
            spin=np.zeros(3) if still else rng.normal(size=3) * 10 ** rng.uniform(-1, 1 if plane else 2),
            turned=rng.normal(size=4),
            acceleration=rng.normal(size=3) * 10.0 * free,
            torque=rng.normal(size=3) * 10 ** rng.uniform(-1, 2) * (mode == FORCED),
            inertia=split.sum() - split,
        )
        if rates and free:
            pair.course.jerk[body] = rng.normal(size=3) * 10 ** rng.uniform(0, 5)
            pair.course.torque_rate[body] = rng.normal(size=3) * 10 ** rng.uniform(0, 5)
            begin(pair.course, body)
    direction, wanted = rng.normal(size=3), 10 ** rng.uniform(-4, 0.3)
    near, far = 0.0, 20.0
    for _ in range(40):
        middle = 0.5 * (near + far)
        pair.course.position[1] = direction / np.linalg.norm(direction) * middle
        near, far = (middle, far) if pair.gap(0.0) < wanted else (near, middle)
    pair.course.position[1] = direction / np.linalg.norm(direction) * far
    return pair if 1e-8 < pair.gap(0.0) < 10.0 else None


@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_random_pairs_against_dense_sampling(seed, rates):
    """All kinds, random motions: both methods agree, nothing is touched before, and the gap is right at the time found.

    Jerks and torque rates move points by centimetres to metres in a step, ten decades more than the rounding allowed for.
    """
    rng = np.random.default_rng(seed)
    for pair in filter(None, (random_pair(rng, rates) for _ in range(300 if rates else 120))):
        end = STEP * 10 ** rng.uniform(-1, 1)
        touch = 10 ** rng.uniform(-9, -4)
        if pair.gap(0.0) < 2.0 * touch:
            continue
        time, status, _, witness = pair.sweep(end=end, touch=touch)
        other, other_status, _, _ = pair.sweep(conservative, end=end, touch=touch)
        assert status == other_status
        last = end if status == SEPARATE else time
        sample = (*pair.shapes, 0.0, last)
        assert first_sample_below(GEOMETRY, pair.course, *sample, 200, touch - ROUND_OFF) == np.inf
        if status == SEPARATE:
            continue
        assert status == IMPACT
        assert abs(pair.gap(time) - touch) < ROUND_OFF + 1e-11 * touch
        assert abs(pair.gap(other) - touch) < ROUND_OFF + 1e-11 * touch
        assert abs(witness[9] - touch) < ROUND_OFF
        assert np.linalg.norm(witness[6:9]) == pytest.approx(1.0, abs=1e-12)
        assert witness[3:6] - witness[0:3] == pytest.approx(witness[9] * witness[6:9], abs=1e-9)


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
def test_ball_falls_on_a_plane(method):
    """1/2 g t^2 = z - r - touch."""
    pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 2), acceleration=(0, 0, -9.81), spin=(3, 2, 1))
    time, status, queries, witness = pair.sweep(method, end=1.0, touch=0.0)
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
            time, status, _, _ = pair.sweep(method, touch=0.0)
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
        time, status, _, _ = pair.sweep(method, end=2.0, touch=0.0)
        square = np.polynomial.Polynomial([x @ x - 1.0, 2.0 * x @ v, v @ v + x @ a, v @ a, 0.25 * a @ a])
        roots = [r.real for r in square.roots() if abs(r.imag) < 1e-9 and 0.0 < r.real < 2.0]
        assert (status == IMPACT) == bool(roots)
        if roots:
            assert time == pytest.approx(min(roots), abs=1e-9)


@pytest.mark.parametrize("method", GUARDED)
def test_ball_with_jerk_meets_a_plane_at_the_root_of_the_cubic(method):
    """z = z0 + v t + a t^2 / 2 + j t^3 / 6, with three real roots, one, or one that is missed by a little: the first one counts.

    A parabola in its place is off by j t^3 / 6, up to metres.
    """
    rng = np.random.default_rng(6)
    for trial in range(400):
        roots = rng.uniform(-1.0, 2.0, size=3)
        growth = rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-1, 2)
        cubic = np.polynomial.Polynomial.fromroots(roots) * growth
        if trial % 2:
            turns = cubic.deriv().roots()
            cubic += 10 ** rng.uniform(-6, 0) - cubic(turns[np.argmax(cubic.deriv(2)(turns))])  # its valley is above 0
        z, v, a, j = cubic.coef * (1.0, 1.0, 2.0, 6.0)
        if z < 1e-3:
            continue
        pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 0.5 + z), (1, 0, v), acceleration=(0, 2, a), jerk=(3, 0, j))
        time, status, queries, _ = pair.sweep(method, end=2.0, touch=0.0)
        real = [r.real for r in cubic.roots() if abs(r.imag) < 1e-12 and 0.0 < r.real < 2.0]
        assert (status == IMPACT) == bool(real)
        assert queries <= 3
        if real:
            steepness = abs(cubic.deriv()(min(real)))
            assert abs(time - min(real)) < 1e-13 * np.abs(cubic.coef).max() / steepness


@pytest.mark.parametrize("method", GUARDED)
def test_ball_with_jerk_returns_to_a_plane(method):
    """From the very gap of contact it leaves, slower and slower, by v t + a t^2 / 2 - |j| t^3 / 6, and is back at the root of that."""
    pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 0.5), (0, 0, 1.0), acceleration=(0, 0, 2.0), jerk=(0, 0, -30.0))
    back = (1.0 + np.sqrt(1.0 + 4.0 * 5.0)) / 10.0  # 1 + t - 5 t^2 = 0
    assert pair.sweep(method, end=2.0, touch=0.0)[0] == pytest.approx(back, abs=1e-14)
    assert pair.sweep(method, end=0.5 * back, touch=0.0)[1] == SEPARATE


@pytest.mark.parametrize("method", GUARDED)
def test_balls_with_jerk_meet_at_the_root_of_the_sextic(method):
    rng = np.random.default_rng(7)
    for _ in range(100):
        x, v, a, j = rng.normal(size=(4, 3)) * np.array([3.0, 3.0, 6.0, 20.0])[:, None]
        x[2] += 4.0
        pair = Pair("sphere", "sphere").set(1, FREE, x, velocity=v, acceleration=a, jerk=j)
        time, status, _, _ = pair.sweep(method, end=2.0, touch=0.0)
        square = sum(np.polynomial.Polynomial([x[k], v[k], a[k] / 2.0, j[k] / 6.0]) ** 2 for k in range(3)) - 1.0
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
    sin(phi - w t) = (a + r + touch) / D: here after up to half a turn, of 1.3 turns in the step. Two posts: the first one counts.
    """
    names = ["bar", "post"]
    geometry = build_geometry([shape(mesh(box(2.0, 0.01, 0.01))), shape(cylinder(0.002, 1.0))])
    pair = Pair("bar", "post", geometry, make_scratch(geometry), names)
    w, distance, touch = 500.0, 0.7, 1e-6
    for phi in (0.1, 1.0, 2.0, 3.1):
        pair.set(0, PRESCRIBED, spin=(0, 0, w))
        pair.set(1, FIXED, (distance * np.cos(phi), distance * np.sin(phi), 0.0))
        time, status, _, _ = pair.sweep(method, touch=touch)
        assert status == IMPACT
        assert time == pytest.approx((phi - np.arcsin((0.005 + 0.002 + touch) / distance)) / w, abs=1e-16 / w * 1e3)


@pytest.mark.parametrize("method", GUARDED)
def test_the_first_of_two_contacts_is_found(method):
    """A ball at 400 m/s meets one ball of a dumb-bell, and would meet the other 2 m later, in the same step."""
    names = ["two", "ball"]
    geometry = build_geometry([shape(sphere(0.1, at=(-1, 0, 0)), sphere(0.1, at=(1, 0, 0))), shape(sphere(0.1))])
    pair = Pair("two", "ball", geometry, make_scratch(geometry), names)
    pair.set(1, FREE, (-3, 0, 0), velocity=(400, 0, 0))
    time, status, _, witness = pair.sweep(method, touch=0.0)
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
    _, status, queries, _ = pair.sweep(method, touch=5e-7)
    assert status == SEPARATE
    assert queries <= 30


@pytest.mark.parametrize("method", GUARDED)
@pytest.mark.parametrize("name", ["ball", "box", "cylinder"])
def test_at_the_gap_of_contact(method, name):
    """At `touch`: leaving is free until the return, hovering is free, approaching is contact at once."""
    touch = 1e-3
    pair = Pair("half space", name)
    height = {"ball": 0.05, "box": 0.2, "cylinder": 0.4}[name] + touch
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, 2))
    assert pair.sweep(method, touch=touch)[1] == SEPARATE
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, 1e-17))
    assert pair.sweep(method, touch=touch)[1] == SEPARATE
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, -1e-17))
    assert pair.sweep(method, touch=touch)[1] == SEPARATE
    pair.set(1, FREE, (0, 0, height - 1e-16), velocity=(1, 0, -1.0))
    time, status, _, _ = pair.sweep(method, touch=touch)
    assert (time, status) == (0.0, TOUCHING) or (status == IMPACT and time < 1e-15)
    # Thrown up at 1 m/s it is back after 2 v / g; and from half the gap, it passes `touch` upwards and comes down on it.
    pair.set(1, FREE, (0, 0, height), velocity=(1, 0, 1), acceleration=(0, 0, -9.81))
    assert pair.sweep(method, end=0.5, touch=touch)[0] == pytest.approx(2.0 / 9.81, abs=1e-12)
    pair.set(1, FREE, (0, 0, height - 0.5 * touch), velocity=(1, 0, 1), acceleration=(0, 0, -9.81))
    late = (1.0 + np.sqrt(1.0 - 9.81 * touch)) / 9.81
    assert pair.sweep(method, end=0.5, touch=touch)[0] == pytest.approx(late, abs=1e-12)


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
        one, other = first.sweep(end=0.1), second.sweep(end=0.1, touch=1024e-6, tolerance=1024e-15)
        assert one[:3] == other[:3]


def test_linear_may_miss_what_is_not_yet_approaching():
    """A ball dropped from rest: the guarded sweeps find it, the linear one does not look again."""
    pair = Pair("half space", "sphere").set(1, FREE, (0, 0, 0.55), acceleration=(0, 0, -9.81))
    assert pair.sweep(linear, end=0.5)[1] == SEPARATE
    assert pair.sweep(end=0.5)[1] == IMPACT
    pair.set(1, FREE, (0, 0, 0.75), velocity=(0, 0, -2), acceleration=(0, 0, 0))
    time, status, queries, witness = pair.sweep(linear, end=0.5, touch=0.05)
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
