"""Coulomb friction of lasting contact, at masses, sizes and slopes of any kind (animation notes A10, dynamics notes B2, B15).

    locked wheels stop after V / (mu g); the front axle bears m g (b + mu h) / L, b from the centre of mass to the rear axle
    a block on an incline holds if mu > tan t and slides with g (sin t - mu cos t) otherwise
    a ball with the slip u slides until 2 |u| / (7 mu g) along a parabola, and rolls on with v - (2/7) u

Forces are constant over each stretch, so paths are polynomials: rounding and the equations' 1e-12, and the contact margin of 1e-6 of the
size by which a body is raised. 1e-9 relative; a slide that ends on a grid of 1/60 s is off by 1e-3, friction along each axis on its own by
up to 40 %.
"""

from __future__ import annotations

import numpy as np
import pytest

import rigidimpulse as ri

G = 9.81
BOUND = 1e-9


def rough(friction: float) -> ri.Material:
    return ri.Material(static_friction=friction, dynamic_friction=friction, restitution=0.0)


@pytest.mark.parametrize(
    ("speed", "friction", "mass", "length", "height", "share"), [(13.0, 0.35, 900, 2.1, 0.4, 0.6), (40.0, 0.6, 2e4, 5.0, 1.1, 0.4)]
)
def test_locked_wheels_stop_and_the_load_moves_forward(speed, friction, mass, length, height, share) -> None:
    """A cart on four balls for feet; its centre of mass is `share` of the wheelbase before the rear axle."""
    upright, foot = (1, 0, 0, 0), 0.1 * length
    parts = [(ri.Shape.box((length, 0.6 * length, 0.2 * length)), (0, 0, 0.25 * length), upright)]
    parts += [(ri.Shape.sphere(foot), (x * length, y * length, foot), upright) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    scene = ri.Scene(gravity=(0, 0, -G), bodies=[ri.Body("road", ri.Shape.half_space(), motion="static")])
    centre, velocity = ((share - 0.5) * length, 0, height), (0.6 * speed, 0.8 * speed, 0)
    turn = (np.sqrt(0.8), 0, 0, np.sqrt(0.2))  # its x axis lies along (0.6, 0.8)
    scene.add(
        ri.Body(
            "cart",
            ri.Shape.compound(parts),
            orientation=turn,
            velocity=velocity,
            mass=mass,
            center_of_mass=centre,
            material=rough(friction),
        )
    )
    stop = speed / (friction * G)
    run = ri.simulate(scene, 1.2 * stop, fps=30)
    t = np.minimum(run.times, stop)
    way = run.center_of_mass("cart") - run.center_of_mass("cart")[0]
    np.testing.assert_allclose(way @ [0.6, 0.8, 0], speed * t - 0.5 * friction * G * t**2, atol=BOUND * speed * stop)
    np.testing.assert_allclose(way @ [0.8, -0.6, 0], 0, atol=BOUND * speed * stop)
    feet = run.contacts_at(len(run.times) // 2)
    ahead = (feet["point"] - run.position("cart")[len(run.times) // 2]) @ [0.6, 0.8, 0] > 0
    up = np.where(feet["body_a"] == run.index("road"), 1, -1) * feet["force"][:, 2]
    assert up[ahead].sum() == pytest.approx(mass * G * (share + friction * height / length), rel=1e-6)
    assert not np.any(run.velocity("cart")[run.times > stop])


@pytest.mark.parametrize(("slope", "friction", "holds"), [(0.2, 0.21, True), (0.2, 0.19, False), (0.9, 1.27, True), (0.9, 0.3, False)])
def test_a_block_on_an_incline_holds_or_slides(slope: float, friction: float, holds: bool) -> None:
    turn = (np.cos(slope / 2), 0, np.sin(slope / 2), 0)
    up, down = np.array([np.sin(slope), 0, np.cos(slope)]), np.array([np.cos(slope), 0, -np.sin(slope)])
    scene = ri.Scene(gravity=(0, 0, -G), bodies=[ri.Body("slope", ri.Shape.half_space(normal=up), motion="static")])
    box = ri.Shape.box((3.0, 2.0, 0.5))
    scene.add(ri.Body("block", box, position=0.25 * up, orientation=turn, mass=500.0, material=rough(friction)))
    run = ri.simulate(scene, 2.0)
    a = 0.0 if holds else G * (np.sin(slope) - friction * np.cos(slope))
    way = (run.position("block") - run.position("block")[0]) @ down
    np.testing.assert_allclose(way, 0.5 * a * run.times**2, atol=BOUND * G * 2.0**2)
    if holds:
        assert not np.any(run.velocity("block")[1:])


@pytest.mark.parametrize("seed", range(6))
def test_a_ball_with_any_spin_slides_along_a_parabola_and_rolls_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    radius, friction, mass = rng.uniform(0.02, 1.0), rng.uniform(0.1, 0.6), 10.0 ** rng.uniform(-2, 3)
    v, w = rng.normal(size=2) * 3.0, rng.normal(size=3) * 4.0 / radius
    u = v - radius * np.array([w[1], -w[0]])
    scene = ri.Scene(gravity=(0, 0, -G), bodies=[ri.Body("cloth", ri.Shape.half_space(), motion="static")])
    motion = {"velocity": (*v, 0), "angular_velocity": w}
    scene.add(ri.Body("ball", ri.Shape.sphere(radius), position=(0, 0, radius), mass=mass, material=rough(friction), **motion))
    end = 2.0 * np.linalg.norm(u) / (7.0 * friction * G)
    run = ri.simulate(scene, 1.5 * end)
    t = np.minimum(run.times, end)[:, None]
    slowing, rolls = friction * G * u / np.linalg.norm(u), v - 2.0 / 7.0 * u
    way = v * t - 0.5 * slowing * t**2 + rolls * (run.times[:, None] - t)
    np.testing.assert_allclose(run.position("ball")[:, :2], way, atol=BOUND * np.linalg.norm(u) * end)
    last = run.times > end
    assert last.any()
    np.testing.assert_allclose(run.velocity("ball")[last, :2], np.broadcast_to(rolls, (last.sum(), 2)), atol=BOUND * np.linalg.norm(u))
    # It rolls: R w x z is the velocity; the spin about the vertical stays.
    np.testing.assert_allclose(
        radius * run.angular_velocity("ball")[-1], [-rolls[1], rolls[0], radius * w[2]], atol=BOUND * np.linalg.norm(u)
    )
