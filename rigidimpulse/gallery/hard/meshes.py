"""Meshes that are not clean, and meshes at the ends of the scale: many triangles, needles, plates.

Dirty: a cube whose mesh has every vertex three times, faces twice, and triangles without area. Its film must be that of the
clean cube: cleaning moves no vertex, so they differ by rounding; bound 1e-6 of the side as for the same film.

A floor whose triangles are wound at random has no inside; it is a sheet that stops bodies from both sides. A body that is
inside out has a negative volume: it has no mass, and the scene must be refused by name with the remedy, never run.

Many: a ball of 81,920 triangles and a ring of 100,352 fall on the floor. Needle and plate: bodies of aspect 1e4, whose
moments of inertia differ by 1e8. All of them: promises, and rest at the end.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.simulate import simulate
from rigidimpulse.gallery.hard.parts import (
    GRAVITY,
    above_floor,
    dull,
    energy_never_grows,
    finite,
    floor_scene,
    last_speed,
    turned,
    undisturbed,
)
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SIDE = 0.5
DURATION = 1.0
RING, TUBE, AROUND, ACROSS = 0.5, 0.15, 448, 112
LONG, THIN = 1.0, 1e-4


def cube(dirty: bool) -> Scene:
    """Return a cube of triangles that tumbles on the floor."""
    material = dull(0.5, 0.4)
    scene = floor_scene(material)
    shape = Shape.mesh(*(_dirty_cube() if dirty else _cube()))
    scene.add(
        Body(
            "cube",
            shape,
            position=(0.0, 0.0, 0.9),
            orientation=turned((1.0, 2.0, 0.5), 0.7),
            angular_velocity=(1.0, 2.0, 3.0),
            material=material,
        )
    )
    return scene


def _cube() -> tuple[np.ndarray, np.ndarray]:
    surface = Shape.box(SIDE).surface()
    return surface.vertices, surface.faces


def _dirty_cube() -> tuple[np.ndarray, np.ndarray]:
    """Return the cube with repeated vertices and faces, points and lines as triangles, and a T-junction."""
    vertices, faces = _cube()
    n = len(vertices)
    many = np.concatenate([vertices, vertices, vertices, 0.5 * (vertices[[0]] + vertices[[1]])])
    middle = 3 * n
    dirt = [(0, n, 2 * n), (1, 1, 2), (3, 3, 3)]
    whole, split = [], []
    for k, face in enumerate(faces.tolist()):
        at = next((i for i in range(3) if {face[i], face[(i + 1) % 3]} == {0, 1}), None)
        if at is None or split:
            whole.append(tuple(v + n * (k % 3) for v in face))
        else:
            # On one side of the edge 0-1 a vertex splits it; a triangle without area fills the gap to the other side.
            a, b, c = face[at], face[(at + 1) % 3], face[(at + 2) % 3]
            split = [(a, middle, c), (middle, b, c), (a, b, middle)]
    return many, np.array([*dirt, *whole, *whole[:5], *split])


def check_cube(run: Recording) -> list[Check]:
    """Compare with the film of the clean cube."""
    clean = simulate(cube(False), float(run.times[-1]), 60.0)
    moved = np.linalg.norm(run.position("cube") - clean.position("cube"), axis=1).max() / SIDE
    return [
        finite(run),
        at_most("positions differ by, of the side", moved, 1e-6, "the same surface, the same film"),
        equal("impacts more or less", abs(len(run.impacts) - len(clean.impacts)), 0, "the same surface, the same film"),
        energy_never_grows(run, SIDE),
    ]


def flipped() -> Scene:
    """Return a box and a ball that fall on a sheet of triangles wound at random."""
    from rigidimpulse.gallery.hard.ghost import TILE, TILES, grid

    sheet = grid()
    assert sheet.vertices is not None and sheet.faces is not None
    faces = sheet.faces.copy()
    wrong = np.random.default_rng(1).random(len(faces)) < 0.5
    faces[wrong] = faces[wrong][:, ::-1]
    middle = 0.5 * TILE * np.array([*TILES, 0.0])
    material = dull(0.5, 0.3)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    scene.add(Body("floor", Shape.mesh(sheet.vertices, faces), motion="static", position=-middle, material=material))
    scene.add(Body("box", Shape.box(SIDE), position=(-0.6, 0.1, 1.0), orientation=turned((1.0, 1.0, 0.0), 0.5), material=material))
    scene.add(Body("ball", Shape.sphere(0.5 * SIDE), position=(0.6, 0.0, 1.0), velocity=(0.3, 0.0, 0.0), material=material))
    return scene


def inside_out() -> Scene:
    """Return a ball on the floor; the check asks for an inside-out cube besides, which must be refused."""
    scene = floor_scene()
    scene.add(Body("ball", Shape.sphere(0.1), position=(0.0, 0.0, 0.1)))
    return scene


def check_inside_out(run: Recording) -> list[Check]:
    """Check that an inside-out cube and an open one are refused by name, with the remedy."""
    vertices, faces = _cube()
    refused = 0
    for bad in (faces[:, ::-1], faces[:-1]):
        scene = floor_scene()
        scene.add(Body("culprit", Shape.mesh(vertices, bad), position=(0.0, 0.0, 1.0)))
        try:
            simulate(scene, 0.1)
        except SceneError as error:
            refused += "culprit" in str(error) and bool(error.remedy)
    return [finite(run), equal("bad meshes refused with name and remedy", refused, 2, "bad input never reaches a kernel")]


def many() -> Scene:
    """Return a ball of 81,920 triangles and a ring of 100,352 that fall beside each other."""
    from trimesh.creation import icosphere

    material = dull(0.5, 0.3)
    scene = floor_scene(material)
    ball = icosphere(subdivisions=6)
    shape = Shape.mesh(0.4 * np.asarray(ball.vertices), ball.faces)
    scene.add(Body("ball", shape, position=(-1.0, 0.0, 0.8), angular_velocity=(0.0, 2.0, 0.0), material=material))
    tilt = turned((1.0, 0.0, 0.0), 0.4)
    scene.add(Body("ring", _ring(), position=(0.6, 0.0, 0.9), orientation=tilt, angular_velocity=(0.5, 0.0, 3.0), material=material))
    return scene


def _ring() -> Shape:
    """Return a torus of 2 x 448 x 112 triangles."""
    u = 2.0 * math.pi * np.arange(AROUND)[:, None] / AROUND
    v = 2.0 * math.pi * np.arange(ACROSS)[None, :] / ACROSS
    out = RING + TUBE * np.cos(v)
    vertices = np.stack([out * np.cos(u), out * np.sin(u), TUBE * np.sin(v) + 0.0 * u], axis=2).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(AROUND), np.arange(ACROSS), indexing="ij")
    here, up = i * ACROSS + j, i * ACROSS + (j + 1) % ACROSS
    right, across = (i + 1) % AROUND * ACROSS + j, (i + 1) % AROUND * ACROSS + (j + 1) % ACROSS
    faces = np.concatenate([np.stack([here, right, across], 2), np.stack([here, across, up], 2)]).reshape(-1, 3)
    return Shape.mesh(vertices, faces)


def slender(size: tuple[float, float, float]) -> Scene:
    """Return a box of aspect 1e4 thrown on the floor, turning about all axes."""
    material = dull(0.4, 0.2, 7800.0)
    scene = floor_scene(material)
    turn = turned((1.0, 0.4, 0.2), 0.6)
    spin = (1.0, 2.0, -1.5)
    scene.add(
        Body(
            "body",
            Shape.box(size),
            position=(0.0, 0.0, 1.0),
            orientation=turn,
            velocity=(0.5, 0.0, 0.0),
            angular_velocity=spin,
            material=material,
        )
    )
    return scene


def check_rest(size: float, run: Recording) -> list[Check]:
    """Check the promises, and rest."""
    return [
        finite(run),
        above_floor(run),
        energy_never_grows(run, size),
        at_most("speed at the end, m/s", last_speed(run, size), 1e-3, "friction and impacts stop it"),
        undisturbed(run),
    ]


def check_moving(size: float, run: Recording) -> list[Check]:
    """Check the promises of bodies that may still roll at the end."""
    return check_rest(size, run)[:3] + [undisturbed(run)]


def check_sheet(run: Recording) -> list[Check]:
    """Check that the sheet holds both, whichever way its triangles are wound."""
    return [finite(run), above_floor(run), energy_never_grows(run, SIDE), undisturbed(run)]


SCENES = (
    GalleryScene(
        "dirty_mesh", "A cube of repeated vertices and faces and triangles without area", partial(cube, True), check_cube, DURATION
    ),
    GalleryScene("flipped_floor", "A floor of triangles wound at random", flipped, check_sheet, 3.0),
    GalleryScene("inside_out", "Inside-out and open meshes are refused by name", inside_out, check_inside_out, 0.5),
    GalleryScene("many_triangles", "A ball of 81,920 triangles and a ring of 100,352", many, partial(check_moving, 1.3), 3.0),
    GalleryScene("needle", "A needle, 10,000 times as long as thick", partial(slender, (LONG, THIN, THIN)), partial(check_rest, LONG), 4.0),
    GalleryScene("plate", "A sheet, 10,000 times as wide as thick", partial(slender, (LONG, LONG, THIN)), partial(check_rest, LONG), 6.0),
)
