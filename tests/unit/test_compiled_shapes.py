"""Shapes of a scene, compiled: once for each frame they are used in, and kept for runs of the same shapes if they are small."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import trimesh

import rigidimpulse as ri
from rigidimpulse.core.kept import kept_with_argument
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.compile_shapes import SMALL
from rigidimpulse.model.world import World


def world_of(*shapes: ri.Shape, **settings: object) -> World:
    """The world of one body of each of these shapes."""
    bodies = [ri.Body(f"body {k}", shape, position=(3.0 * k, 0, 1), **settings) for k, shape in enumerate(shapes)]  # type: ignore[arg-type]
    return compile_scene(ri.Scene(bodies=[ri.Body("floor", ri.Shape.half_space(), motion="static"), *bodies]))


def test_a_shape_is_compiled_once_for_each_frame() -> None:
    ball, box = ri.Shape.sphere(0.1), ri.Shape.box((0.1, 0.2, 0.3))
    world = world_of(ball, box, ri.Shape.sphere(0.1), box)
    assert world.shape_of_body.tolist() == [0, 1, 2, 1, 2]
    np.testing.assert_array_equal(world.ball, [False, True, False, True, False])
    np.testing.assert_array_equal(world.half_space, [True, False, False, False, False])
    np.testing.assert_allclose(world.size[1:], [0.2, 0.3, 0.2, 0.3])
    assert len(world_of(box, center_of_mass=(0, 0, 0.1)).shapes) == 2


def test_small_shapes_are_kept_for_the_next_run_and_others_are_not_mixed_up() -> None:
    one, again = world_of(ri.Shape.box(0.2)), world_of(ri.Shape.box(0.2), velocity=(1, 0, 0))
    assert again.geometry is one.geometry and again.shapes is one.shapes
    moved = world_of(ri.Shape.box(0.2), center_of_mass=(0.0, 0.0, 0.05))
    for other in (world_of(ri.Shape.box(0.3)), moved, world_of(ri.Shape.sphere(0.1))):
        assert other.geometry is not one.geometry
        assert not np.array_equal(other.size, one.size) or not np.array_equal(other.geometry.vertex, one.geometry.vertex)


def test_large_shapes_go_with_their_world() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=5)
    assert len(mesh.faces) > SMALL
    shape = ri.Shape.mesh(mesh.vertices, mesh.faces)
    world = world_of(shape)
    known = weakref.ref(world.shapes[1])
    assert world_of(shape).geometry is not world.geometry
    del world
    gc.collect()
    assert known() is None


class Thing:
    """Something to ask of."""


def test_what_is_kept_with_an_argument_goes_with_it() -> None:
    asked = []

    @kept_with_argument
    def answer(thing: Thing) -> list[int]:
        asked.append(id(thing))
        return [len(asked)]

    one, other = Thing(), Thing()
    assert answer(one) is answer(one) and answer(other) == [2] and len(asked) == 2
    result, gone = weakref.ref(one), answer(one)
    del one
    gc.collect()
    assert result() is None and gone == [1]
