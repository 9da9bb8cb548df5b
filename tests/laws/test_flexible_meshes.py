"""Soft bodies without contact against closed forms and conservation laws.

Chain of N masses between fixed ends: w_j = 2 sqrt(k / m) sin(j pi / 2 (N + 1)). Implicit Euler's period is too long by (w h)^2 / 3 and its
amplitude falls by pi w h a period, the midpoint rule's period by (w h)^2 / 12: 200 steps a period are within 0.1 % for both. Energy: K + E
never grows by more than round-off of the sum (1e-12 of it): an explicit step at k h^2 / m = 1e6 multiplies it by 1e12.
"""

from __future__ import annotations

import numpy as np
import pytest
from flexible_scene import Run, anchor_scene, cube_mesh, sheet_mesh, spring_mesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve

from rigidimpulse.dynamics.soft_body import FlexibleBody
from rigidimpulse.dynamics.soft_body.mass_spring import sheet

N, K, M = 5, 100.0, 0.5


def chain_period(scheme: str, mode: int, steps: int) -> tuple[float, float]:
    """Error of the period of a mode of the chain, relative to the law's, and its amplitude after one period."""
    x = np.column_stack([np.arange(N + 2.0), np.zeros(N + 2), np.zeros(N + 2)])
    springs = np.column_stack([np.arange(N + 1), np.arange(1, N + 2)])
    run = Run(anchor_scene(spring_mesh(x, M, springs, K, pinned=(0, N + 1)), gravity=(0, 0, 0)), scheme=scheme, tolerance=1e-12)
    shape = np.sin(mode * np.pi * np.arange(N + 2) / (N + 1))
    shape[[0, -1]] = 0.0
    period = np.pi / np.sqrt(K / M) / np.sin(mode * np.pi / (2 * (N + 1)))
    run.soft_bodies.position[:, 0] += 0.01 * shape
    h, amplitude = period / steps, [1.0]
    for _ in range(3 * steps // 2):
        run.step(h)
        amplitude.append(float((run.soft_bodies.position[:, 0] - x[:, 0]) @ shape) / float(shape @ shape) / 0.01)
    q = np.array(amplitude)
    falls = np.flatnonzero((q[:-1] > 0.0) & (q[1:] <= 0.0))
    zeros = h * (falls + q[falls] / (q[falls] - q[falls + 1]))
    return float(zeros[1] - zeros[0]) / period - 1.0, float(q[steps])


@pytest.mark.parametrize("mode", [1, 2, 5])
@pytest.mark.parametrize("scheme", ["euler", "midpoint"])
def test_modes_of_a_chain(scheme: str, mode: int) -> None:
    error, _ = chain_period(scheme, mode, 200)
    assert 0.0 < error < 1e-3


def test_order_of_the_schemes() -> None:
    """Halved steps: the midpoint rule's errors fall by 4, Euler's amplitude error by 2."""
    coarse, fine = chain_period("midpoint", 2, 100), chain_period("midpoint", 2, 200)
    assert np.log2(coarse[0] / fine[0]) == pytest.approx(2.0, abs=0.05)
    assert abs(fine[1] - 1.0) < 1e-4
    coarse, fine = chain_period("euler", 2, 200), chain_period("euler", 2, 400)
    assert np.log2(np.log(coarse[1]) / np.log(fine[1])) == pytest.approx(1.0, abs=0.05)


def test_damping_ratio() -> None:
    """Two masses on a spring with c = tau k: amplitudes fall by exp(-tau w^2 t / 2), w^2 = 2 k / m."""
    tau, w = 0.004, np.sqrt(2.0 * K / M)
    soft_body = spring_mesh([[0, 0, 0], [1, 0, 0]], M, [[0, 1]], K, damping=tau)
    run = Run(anchor_scene(soft_body, gravity=(0, 0, 0)), scheme="midpoint", tolerance=1e-12)
    run.soft_bodies.velocity[:] = [[-0.1, 0, 0], [0.1, 0, 0]]
    start = run.soft_bodies.energy()
    h = 2.0 * np.pi / w / 200
    for _ in range(400):
        run.step(h)
    expected = np.exp(-tau * w * w * 400 * h)
    assert run.soft_bodies.energy() / start == pytest.approx(expected, rel=2e-3)  # (w h)^2 = 1e-3; no damping at all: 1, expected 0.0065


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), stiffness=st.sampled_from([1.0, 1e3, 1e6]), scheme=st.sampled_from(["euler", "midpoint"]))
def test_energy_never_grows(seed: int, stiffness: float, scheme: str) -> None:
    rng = np.random.default_rng(seed)
    n, h = 10, 1.0 / 60.0
    x, mass = rng.normal(size=(n, 3)), rng.uniform(0.1, 1.0, n)
    springs = [(i, j) for i in range(n) for j in range(i) if j == i - 1 or rng.random() < 0.4]
    run = Run(anchor_scene(spring_mesh(x, mass, springs, stiffness * mass.min() / h**2), gravity=(0, 0, 0)), scheme=scheme)
    run.soft_bodies.velocity += 3.0 * rng.normal(size=x.shape)
    run.soft_bodies.position += 0.3 * rng.normal(size=x.shape)
    energy = [run.soft_bodies.energy()]
    momentum = mass @ run.soft_bodies.velocity
    angular = (mass[:, None] * np.cross(run.soft_bodies.position, run.soft_bodies.velocity)).sum(0)
    for _ in range(10):
        run.step(h)
        energy.append(run.soft_bodies.energy())
    assert np.all(np.diff(energy) <= 1e-12 * energy[0])
    scale = mass @ np.linalg.norm(x, axis=1) * np.abs(run.soft_bodies.velocity).max() + np.abs(angular).max()
    np.testing.assert_allclose(mass @ run.soft_bodies.velocity, momentum, rtol=0, atol=1e-12 * scale)
    now = (mass[:, None] * np.cross(run.soft_bodies.position, run.soft_bodies.velocity)).sum(0)
    np.testing.assert_allclose(now, angular, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("scheme", ["euler", "midpoint"])
def test_rest_is_kept_to_the_bit(scheme: str) -> None:
    cloth = FlexibleBody("cloth", *sheet_mesh(5), stiffness=1e4, bending=0.1, mass=0.3, damping=0.01, orientation=(1, 2, 3, 4))
    cube = FlexibleBody("cube", *cube_mesh(4), stiffness=1e4, inner_stiffness=1e6, position=(3, 0, 0))
    run = Run(anchor_scene(cloth, cube, gravity=(0, 0, 0)), scheme=scheme)
    start = run.soft_bodies.position.copy()
    for _ in range(20):
        run.step(1.0 / 60.0)
    np.testing.assert_array_equal(run.soft_bodies.position, start)
    assert not run.soft_bodies.velocity.any()


def test_free_net_falls_and_turns_with_its_momenta() -> None:
    """P = P0 + M g t to 1e-13; its angular momentum about its centre stays, to 1e-12: plain implicit Euler loses a tenth in 1 s here."""
    body = FlexibleBody("cube", *cube_mesh(4), stiffness=1e3, inner_stiffness=1e4, velocity=(1, 2, 3), angular_velocity=(1, 2, 0.5))
    run = Run(anchor_scene(body))
    mass, total = run.soft_bodies.soft_body.mass, run.soft_bodies.soft_body.mass.sum()

    def spin() -> np.ndarray:
        x, v = run.soft_bodies.position, run.soft_bodies.velocity
        return (mass[:, None] * np.cross(x - mass @ x / total, v)).sum(0)

    start, momentum = spin(), mass @ run.soft_bodies.velocity
    for _ in range(60):
        run.step(1.0 / 60.0)
    expected = momentum + total * np.array([0.0, 0.0, -9.81])
    np.testing.assert_allclose(mass @ run.soft_bodies.velocity, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    np.testing.assert_allclose(spin(), start, rtol=0, atol=1e-12 * np.abs(start).max())


def test_midpoint_rule_falls_on_the_parabola() -> None:
    run = Run(anchor_scene(FlexibleBody("cloth", *sheet_mesh(4), stiffness=1e3, mass=0.3, velocity=(1, 0, 2))), scheme="midpoint")
    mass = run.soft_bodies.soft_body.mass
    start = mass @ run.soft_bodies.position / mass.sum()
    for _ in range(30):
        run.step(1.0 / 60.0)
    place = mass @ run.soft_bodies.position / mass.sum()
    np.testing.assert_allclose(place, start + [0.5, 0.0, 1.0 - 0.125 * 9.81], rtol=0, atol=1e-12)


def test_gradient_is_that_of_the_energy() -> None:
    """Springs and hinges, at a crumpled sheet, against central differences: 1e-6 m of 0.2 m leave 1e-10 of the force."""
    x, faces = sheet_mesh(5)
    soft_body = sheet(x, faces, 1.0, 100.0, 0.3, 0.0, 0.0)
    y, e = x + 0.05 * np.random.default_rng(0).normal(size=x.shape), 1e-6
    numeric = np.zeros_like(y)
    for i, k in np.ndindex(y.shape):
        step = np.zeros_like(y)
        step[i, k] = e
        numeric[i, k] = (soft_body.energy(y + step) - soft_body.energy(y - step)) / (2.0 * e)
    np.testing.assert_allclose(soft_body.gradient(y), numeric, rtol=0, atol=1e-8 * np.abs(numeric).max())
    alone = sheet(x, faces, 1.0, 1e-9, 0.3, 0.0, 0.0)  # hinges only
    assert np.abs(alone.gradient(y)).max() > 0.1


def test_sheet_has_its_stiffness_whatever_the_mesh() -> None:
    """A strip stretched by 1 % along x carries E_s width strain, within what a net of springs leaves to its mesh."""
    forces = []
    for n in (6, 11, 21):
        x, faces = sheet_mesh(n)
        soft_body = sheet(x, faces, 1.0, 100.0, 0.0, 0.0, 0.0)
        pull = soft_body.gradient(x * [1.01, 1.0, 1.0])
        forces.append(float(pull[x[:, 0] == 1.0, 0].sum()))
    assert max(forces) / min(forces) < 1.01  # springs of equal k each would carry n times as much
    assert 0.8 < forces[-1] / (100.0 * 0.01) < 1.6


def squares(n: int, m: int, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of n x m vertices in squares, each cut by the same diagonal."""
    i = np.arange(n * m).reshape(n, m)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    x, y = np.divmod(np.arange(n * m), m)
    places = side * np.column_stack([x, y, np.zeros(n * m)])
    return places, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def equilateral(n: int, m: int, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of m rows along x of n vertices each, in equilateral triangles."""
    row, column = np.divmod(np.arange(n * m), n)
    places = side * np.column_stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row, np.zeros(n * m)])
    faces = []
    for j, i in np.ndindex(m - 1, n - 1):
        a, b, c, d = n * j + i, n * j + i + 1, n * (j + 1) + i, n * (j + 1) + i + 1
        faces += [(a, b, c), (b, d, c)] if j % 2 == 0 else [(a, b, d), (a, d, c)]
    return places, np.array(faces)


def rolled_energy(mesh: tuple[np.ndarray, np.ndarray], curvature: float, angle: float) -> float:
    """Bending energy of a sheet of B = 1 N m, rolled to a cylinder along a direction, relative to B c^2 / 2 per area."""
    x, faces = mesh
    flat = sheet(x, faces, 1.0, 1e-12, 1.0, 0.0, 0.0)  # springs of nothing: the stretch of chords is none of bending
    along, across = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
    turn = curvature * x @ along
    places = np.outer(np.sin(turn) / curvature, along) + np.outer(x @ across, across)
    places[:, 2] = (1.0 - np.cos(turn)) / curvature
    corners = x[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    return flat.energy(places) / (0.5 * curvature**2 * area)


@pytest.mark.parametrize("curvature", [0.003, 0.03])
def test_rolled_sheet_has_its_flexural_rigidity(curvature: float) -> None:
    """B c^2 / 2 per area. Edges of the rim do not bend, and they are half of one row in n - 1 rows: 1 - 1 / (n - 1) of it is there.

    Squares along their sides have exactly that. Equilateral triangles have it in every direction, up to what the shape of the rim
    changes of that row. Faces turn by up to 0.03 rad: sines of it are of order 2e-4.
    """
    n = 41
    for angle in (0.0, 0.5 * np.pi):
        assert rolled_energy(squares(n, n, 1.0), curvature, angle) == pytest.approx(1.0 - 1.0 / (n - 1), rel=1e-6)
    for angle in np.linspace(0.0, np.pi, 13):
        assert 1.0 - 1.0 / (n - 1) - 2e-4 < rolled_energy(equilateral(n, n, 1.0), curvature, angle) < 1.0


def test_rolled_squares_depend_on_the_direction_of_their_diagonals() -> None:
    """Across a direction at angle a to the sides: 1 + 2 b + 4 b^2 with b = sin(2 a) / 2, from 0.75 to 3, less what the rim lacks."""
    n = 81
    for angle in np.radians([-45.0, -15.0, 15.0, 30.0, 45.0, 60.0]):
        b = 0.5 * np.sin(2.0 * angle)
        expected = 1.0 + 2.0 * b + 4.0 * b * b
        assert rolled_energy(squares(n, n, 1.0), 1e-3, angle) == pytest.approx(expected, rel=2.0 / (n - 1))


@pytest.mark.parametrize(("make", "free"), [(squares, 4.0 / 5.0), (equilateral, 8.0 / 9.0)])
def test_cantilever_strip_bends_by_its_weight(make, free: float) -> None:
    """w = q L^4 / 8 B', with B' what B leaves to a strip whose sides are free: it also bends across, and twists.

    Energy per area of hinges on curvatures a, c and twist b. Equilateral: a plate of Poisson's ratio 1/3, B' = 8/9 B. Squares:
    B ((a + b)^2 + (c + b)^2 + 4 b^2) / 2, least at c = -b = a / 5: B' = 4/5 B. Within the half edge by which the clamp is off: 2 s / L.
    """
    n, bending, side = 41, 0.2, 0.01
    x, faces = make(n, 5, side)
    clamp = 1.01 * side
    length = x[:, 0].max() - side
    load = 0.05 * 8.0 * bending / length**3
    strip = FlexibleBody(
        "strip", x, faces, stiffness=2e4, bending=bending, damping=0.05, area_density=load / 9.81,
        pinned=np.flatnonzero(x[:, 0] < clamp).tolist(),
    )  # fmt: skip
    run = Run(anchor_scene(strip), tolerance=1e-9)
    for _ in range(60):
        run.step(0.5)
    tip = -run.soft_bodies.position[x[:, 0] > x[:, 0].max() - 1e-9, 2].mean()
    assert free * tip == pytest.approx(load * length**4 / (8.0 * bending), rel=2.0 * side / length)


def test_hanging_chain_is_where_statics_puts_it() -> None:
    """Elastic chain under its weight between two pins: forces balance in every joint; the horizontal pull and the first vertical one
    are found so that the links reach from pin to pin. Settled in long steps, kh^2/m = 1e4."""
    n, k, m, rest, g = 11, 2e3, 0.05, 0.13, 9.81
    x = np.column_stack([np.linspace(0, 1, n), np.zeros(n), np.zeros(n)])
    soft_body = spring_mesh(x, m, np.column_stack([np.arange(n - 1), np.arange(1, n)]), k, np.full(n - 1, rest), 0.01, pinned=(0, n - 1))
    run = Run(anchor_scene(soft_body), tolerance=1e-10)
    run.soft_bodies.position[1:-1, 2] -= 0.01  # straight it would not know where to buckle
    for _ in range(400):
        run.step(0.5)

    def places(pull: np.ndarray) -> np.ndarray:
        tension = np.column_stack([np.full(n - 1, pull[0]), pull[1] + m * g * np.arange(n - 1)])
        size = np.linalg.norm(tension, axis=1)[:, None]
        return np.concatenate([np.zeros((1, 2)), np.cumsum((rest + size / k) * tension / size, axis=0)])

    pull = fsolve(lambda f: places(f)[-1] - [1.0, 0.0], [1.0, -0.5 * (n - 2) * m * g], xtol=1e-12)
    np.testing.assert_allclose(run.soft_bodies.position[:, [0, 2]], places(pull), rtol=0, atol=1e-8)
