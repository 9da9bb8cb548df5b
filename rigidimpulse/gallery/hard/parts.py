"""Parts that hard cases share: scenes with a floor, and the promises that every case must keep.

Two promises hold whatever a scene does:

    every number stays finite
    energy never grows: E(t) - min over s <= t of E(s) <= 2 delta sum_i k_i m_i g

A lasting contact is held at a gap of delta = 1e-6 of a body's size. A body that was drawn touching is moved up to that gap,
and one that stands on k others by k gaps, so the weights times the gaps bound what may honestly be gained; twice that,
because a contact may be lost and found again, plus 1e-12 of the energy at stake for rounding.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import quaternion_from_axis_angle, rotate
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.gallery.record import Check, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

GRAVITY = 9.81
DELTA = TOLERANCES.contact.margin
"""Gap of lasting contacts, of a body's size."""
ROUNDING = 1e-12
"""Of the energy at stake: some thousand operations of sixteen digits."""


def floor_scene(material: Material | None = None) -> Scene:
    """Return a scene with gravity along -z and a floor at z = 0, of the given material or of none of its own."""
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.half_space(), motion="static", material=material or Material()))
    return scene


def dull(friction: float, restitution: float = 0.0, density: float = 1000.0) -> Material:
    """Return a material with one friction for rest and motion."""
    return Material(density=density, restitution=restitution, static_friction=friction, dynamic_friction=friction)


def turned(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    """Return the quaternion (4,) of a turn by `angle` rad about an axis."""
    return quaternion_from_axis_angle(axis, angle)


def finite(run: Recording) -> Check:
    """Return the check that every number of every frame is finite."""
    arrays = (run.positions, run.orientations, run.velocities, run.angular_velocities)
    return equal("numbers that are not finite", sum(int(np.sum(~np.isfinite(a))) for a in arrays), 0, "every state is one of a body")


def energy_never_grows(run: Recording, size: float, levels: float = 1.0) -> Check:
    """Return the check that no frame has more energy than an earlier one, except by contact margins.

    Args:
        run: all of its moving bodies are dynamic.
        size: m, of the largest body that lies on something.
        levels: how many gaps a body is above the ground, at most.

    """
    assert run.ledger is not None
    total = run.ledger.total
    rise = total - np.minimum.accumulate(total)
    allowed_rise = 2.0 * DELTA * size * levels * weight(run)
    at_stake = np.ptp(run.ledger.potential) + run.ledger.kinetic.max()
    return at_most(
        "largest rise of energy, J",
        rise.max(),
        allowed_rise + ROUNDING * at_stake,
        "E never grows, except by contact margins (2 delta k m g)",
    )


def weight(run: Recording) -> float:
    """Return the weight of all dynamic bodies, N."""
    from rigidimpulse.scene.mass import body_mass

    assert run.scene is not None
    strength = float(np.linalg.norm(np.asarray(run.scene.gravity, float)))
    return strength * sum(abs(b.gravity_factor) * body_mass(b).mass for b in run.scene.bodies if b.motion == "dynamic")


def undisturbed(run: Recording) -> Check:
    """Return the check that nothing happened that a user should know of."""
    said = "" if run.status.ok else f"; the run says: {run.status.message.splitlines()[0]}"
    return equal("events that a user should know of", len(run.status.events), 0, f"default settings are enough{said}")


def lowest(shape: Shape, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
    """Return the height (f,) m of the lowest point of a sphere, cylinder, box or mesh at poses (f, 3), (f, 4)."""
    if shape.kind == "sphere":
        return position[:, 2] - shape.radius
    if shape.kind == "cylinder":
        axis = np.abs(rotate(orientation, np.array([0.0, 0.0, 1.0]))[:, 2])
        return position[:, 2] - 0.5 * shape.height * axis - shape.radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
    vertices = shape.surface().vertices
    heights = [rotate(orientation, v)[:, 2] for v in vertices] if len(vertices) < len(position) else None
    if heights is not None:
        return position[:, 2] + np.min(heights, axis=0)
    return position[:, 2] + np.array([rotate(q, vertices)[:, 2].min() for q in orientation])


def above_floor(run: Recording, bound: float = 1e-9) -> Check:
    """Return the check that no dynamic body gets below z = 0, in any frame, by more than `bound` m (rounding)."""
    assert run.scene is not None
    deepest = max(
        -float(lowest(b.shape, run.position(b.name), run.orientation(b.name)).min()) for b in run.scene.bodies if b.motion == "dynamic"
    )
    return at_most("deepest below the floor, m", deepest, bound, "bodies stay apart")


def apart(run: Recording, num_frames: int = 20) -> Check:
    """Return the check that no two bodies are inside each other, at some frames after the given one, asked of FCL."""
    from rigidimpulse.collision.distance.fcl import Narrowphase
    from rigidimpulse.core.quaternion import multiply
    from rigidimpulse.engine.compile_scene import compile_scene

    assert run.scene is not None
    world = compile_scene(run.scene)
    narrowphase = Narrowphase(world.shapes)
    radius, count = world.bound_radius, 0
    a, b = np.triu_indices(world.num_bodies, 1)
    moving = world.dynamic[a] | world.dynamic[b]
    a, b = a[moving], b[moving]
    for f in np.unique(np.linspace(1, len(run.times) - 1, num_frames).round().astype(int)).tolist():
        centers = run.centers[f]
        if not np.all(np.isfinite(centers)):
            continue
        axes = multiply(run.orientations[f], world.turn)
        near = np.linalg.norm(centers[b] - centers[a], axis=1) < radius[a] + radius[b]
        for i, j in zip(a[near].tolist(), b[near].tolist(), strict=True):
            shapes = int(world.shape_of_body[i]), int(world.shape_of_body[j])
            count += narrowphase.overlap(shapes[0], (centers[i], axes[i]), shapes[1], (centers[j], axes[j]))
    return equal("pairs inside each other, over 20 frames", count, 0, "bodies stay apart")


def farthest(run: Recording, names: list[str]) -> float:
    """Return how far the origin of any of these bodies ever is from where it began, m."""
    chosen = [run.index(name) for name in names]
    return float(np.linalg.norm(run.positions[:, chosen] - run.positions[0, chosen], axis=2).max())


def last_speed(run: Recording, size: float) -> float:
    """Return the largest speed of a point of any dynamic body of this size in the last frame, m/s."""
    assert run.scene is not None
    chosen = [run.index(b.name) for b in run.scene.bodies if b.motion == "dynamic"]
    speed = np.linalg.norm(run.velocities[-1, chosen], axis=1)
    return float((speed + size * np.linalg.norm(run.angular_velocities[-1, chosen], axis=1)).max())
