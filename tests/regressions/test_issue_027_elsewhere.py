"""Issue 27: contacts of a body that was elsewhere in the meantime say nothing about where it comes back."""

from __future__ import annotations

import numpy as np

import rigidimpulse as ri
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import FINEST, ContactStepper
from rigidimpulse.model.plan import Plan
from rigidimpulse.recording.events import EventLog
from rigidimpulse.recording.recorder import Recorder

STEP = 1.0 / 60.0
RADIUS, HALF_LENGTH = 0.0433, 0.07217


def half_pipe(radius: float = 0.4, sectors: int = 24, pieces: int = 8) -> ri.Shape:
    """An open surface of 3 m along x, lowest at z = 0, with its rims at z = radius."""
    turn, along = np.linspace(np.pi, 2.0 * np.pi, sectors + 1), np.linspace(-1.5, 1.5, pieces + 1)
    x, t = np.meshgrid(along, turn, indexing="ij")
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel()
    corners = np.stack([x, radius * np.cos(t), radius * (1.0 + np.sin(t))], -1).reshape(-1, 3)
    return ri.Shape.mesh(corners, np.vstack([np.column_stack([a, b, c]), np.column_stack([b, d, c])]))


def test_a_capsule_that_rolled_over_a_rim_is_not_thrown_when_it_comes_back_below_it() -> None:
    """It touched the rim in sub-steps, flew freely, and came near the wall again.

    The plane of the old contact goes through the whole pipe, and the capsule was 6 cm behind it. So it was moved by 2 cm and turned by
    0.6 rad, and 1.2 J came from nothing. The gap of the true contact there is 47 mm.
    """
    scene = ri.Scene()
    scene.add(ri.Body("pipe", half_pipe(), motion="static"))
    scene.add(ri.Body("capsule", ri.Shape.capsule(RADIUS, 2.0 * HALF_LENGTH)))
    world = compile_scene(scene, "standard")
    run = Run(world, Plan(world, []), Recorder(np.zeros(1), 2), EventLog())
    stepper = ContactStepper(world, world.dynamic, FINEST)
    normal = np.array([0.0, -0.6625, -0.749])
    rim = np.array([-0.578, -0.4, 0.4])
    now, pipe, capsule, below = run.state.now, np.array([0]), np.array([1]), (-0.57406, -0.23363, 0.27702)
    now.position[1], now.orientation[1] = rim - (RADIUS + 1e-4) * normal + [0.0, 0.0, HALF_LENGTH], (0.0, 1.0, 0.0, 0.0)
    stepper.set_up(run, capsule, pipe, STEP)
    assert stepper.table.pairs.count.sum() > 0
    now.position[1], now.orientation[1] = below, (0.67775957, 0.56280637, 0.46157213, 0.10412553)
    now.velocity[1], now.angular_velocity[1] = (-0.161, 0.354, -1.770), (30.43, -39.98, -2.61)
    stepper.set_up(run, capsule, pipe, STEP)
    stepper.move_apart(run, capsule, 0.0)
    np.testing.assert_array_equal(now.position[1], below)
