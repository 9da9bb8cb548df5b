"""Spikes, a wedge in a crack, tetrahedra in a pit, a cube in a hole of its own size.

The places of rest are not known in closed form. But bodies must come to rest inside, energy must not grow, and nothing may enter
anything else.

Wedge of half angle b in a crack of the same angle: with mu < tan b it slides in until its sides touch, with mu > tan b it would jam.
Here mu = 0: it goes in as far as the geometry allows, z = z_touch, to the contact gap over sin b.

Cube in a hole: with walls exactly at its sides and no friction, the walls carry nothing, so it falls freely to the bottom:
it arrives at t = sqrt(2 h / g). Contacts held at a gap of 1e-6 do not fit in here, which makes it hard.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.core.portable import length
from rigidimpulse.core.quaternion import normalize
from rigidimpulse.gallery.hard.parts import GRAVITY, above_floor, apart, dull, energy_never_grows, finite, floor_scene, last_speed
from rigidimpulse.gallery.record import Check, GalleryScene, at_most, equal
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

SPIKE, CORE = 0.5, 0.12
HALF_ANGLE = math.radians(15.0)
DEEP = 0.6
PIT, PIT_WALL = 1.0, 0.2
NUM_TETRAHEDRA, EDGE = 24, 0.35
HOLE, DROP = 0.5, 1.0


def spikes() -> Scene:
    """Return stars of twenty sharp spikes that fall on the floor and on each other."""
    material = dull(0.5, 0.3)
    scene = floor_scene(material)
    star = _star()
    scene.add(Body("first", star, position=(0.0, 0.0, 0.8), angular_velocity=(1.0, 2.0, 0.5), material=material))
    scene.add(Body("second", star, position=(0.1, 0.05, 2.2), angular_velocity=(-2.0, 1.0, 3.0), material=material))
    return scene


def _star() -> Shape:
    """Return an icosahedron whose twenty faces carry a spike each: a closed concave mesh."""
    from trimesh.creation import icosahedron

    base = icosahedron()
    vertices = [CORE * v for v in np.asarray(base.vertices)]
    faces = []
    for a, b, c in np.asarray(base.faces):
        tip = vertices[a] + vertices[b] + vertices[c]
        vertices.append(SPIKE * tip / length(tip))
        n = len(vertices) - 1
        faces += [(a, b, n), (b, c, n), (c, a, n)]
    return Shape.mesh(vertices, faces)


def check_spikes(run: Recording) -> list[Check]:
    """Check the promises, and rest."""
    return [
        finite(run),
        above_floor(run),
        apart(run),
        energy_never_grows(run, 2.0 * SPIKE, 2),
        at_most("speed at the end, m/s", last_speed(run, SPIKE), 1e-3, "friction and impacts stop them"),
    ]


def wedge() -> Scene:
    """Return a smooth wedge above a crack of its own angle."""
    smooth = dull(0.0)
    scene = Scene(gravity=(0.0, 0.0, -GRAVITY))
    for side in (-1.0, 1.0):
        normal = (-side * math.cos(HALF_ANGLE), 0.0, math.sin(HALF_ANGLE))
        scene.add(Body(f"side {side:+.0f}", Shape.half_space(normal=normal), motion="static", material=smooth))
    half = DEEP * math.tan(HALF_ANGLE)
    points = [(0.0, y, 0.0) for y in (-0.3, 0.3)] + [(x, y, DEEP) for x in (-half, half) for y in (-0.3, 0.3)]
    center = np.array([0.0, 0.0, 2.0 / 3.0 * DEEP])
    shape = Shape.convex_hull(np.array(points) - center)
    scene.add(Body("wedge", shape, position=center + [0.0, 0.0, 0.3], material=smooth))
    return scene


def check_wedge(run: Recording) -> list[Check]:
    """Check that it goes in until its faces lie on the crack's, and stays."""
    depth = run.position("wedge")[-1, 2] - 2.0 / 3.0 * DEEP
    gap = 2.0 * 1e-6 * DEEP / math.sin(HALF_ANGLE)
    tilt = np.abs(run.orientation("wedge")[-1, 1:]).max()
    return [
        finite(run),
        at_most("height above the crack's bottom, m", abs(depth), gap, "faces on faces, up to two contact margins over sin b"),
        at_most("tilt at the end", tilt, 1e-5, "faces on faces"),
        at_most("speed at the end, m/s", last_speed(run, DEEP), 1e-9, "e = 0: it stays"),
        energy_never_grows(run, DEEP),
    ]


def pit() -> Scene:
    """Return tetrahedra that fall into a pit with four walls."""
    material = dull(0.4, 0.1)
    scene = floor_scene(material)
    reach = 0.5 * (PIT + PIT_WALL)
    for name, x, y in (("-x", -reach, 0.0), ("+x", reach, 0.0), ("-y", 0.0, -reach), ("+y", 0.0, reach)):
        size = (PIT_WALL, PIT + 2.0 * PIT_WALL, 3.0) if x else (PIT, PIT_WALL, 3.0)
        scene.add(Body(f"wall {name}", Shape.box(size), motion="static", position=(x, y, 1.5), material=material))
    corners = EDGE / math.sqrt(8.0) * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    shape = Shape.convex_hull(corners)
    random = np.random.default_rng(2)
    for k in range(NUM_TETRAHEDRA):
        place = (0.5 * (k % 2) - 0.25, 0.5 * (k // 2 % 2) - 0.25, 0.4 + 0.45 * (k // 4))
        q = random.normal(size=4)
        scene.add(Body(f"tetrahedron {k + 1}", shape, position=place, orientation=normalize(q), material=material))
    return scene


def check_pit(run: Recording) -> list[Check]:
    """Check that all stay in the pit, apart, and come to rest."""
    inside = np.abs(run.positions[:, 5:, :2]).max() - 0.5 * PIT
    return [
        finite(run),
        at_most("centre beyond a wall, m", inside, 0.0, "walls hold"),
        above_floor(run),
        apart(run),
        energy_never_grows(run, EDGE, 6),
        at_most("speed at the end, m/s", last_speed(run, EDGE), 1e-3, "friction and impacts stop them"),
    ]


def hole() -> Scene:
    """Return a cube that falls into a shaft whose walls are exactly at its sides."""
    smooth = dull(0.0)
    scene = floor_scene(smooth)
    reach = 0.5 * HOLE + 0.1
    for name, x, y in (("-x", -reach, 0.0), ("+x", reach, 0.0), ("-y", 0.0, -reach), ("+y", 0.0, reach)):
        scene.add(
            Body(
                f"wall {name}",
                Shape.box((0.2, HOLE, 3.0) if x else (HOLE, 0.2, 3.0)),
                motion="static",
                position=(x, y, 1.5),
                material=smooth,
            )
        )
    scene.add(Body("cube", Shape.box(HOLE), position=(0.0, 0.0, DROP + 0.5 * HOLE), material=smooth))
    return scene


def check_hole(run: Recording) -> list[Check]:
    """Check that it falls freely, lands and stays."""
    landing = math.sqrt(2.0 * DROP / GRAVITY)
    falling = run.times < landing
    path = DROP + 0.5 * HOLE - 0.5 * GRAVITY * run.times[falling] ** 2
    floor = run.index("floor")
    landings = run.impacts["time"][(run.impacts["body_a"] == floor) | (run.impacts["body_b"] == floor)]
    late = abs(float(landings[0]) - landing) if len(landings) else math.inf
    return [
        finite(run),
        at_most("error of the fall, m", np.abs(run.position("cube")[falling, 2] - path).max(), 1e-6, "smooth walls carry nothing"),
        at_most("error of the landing, s", late, 1e-6, "sqrt(2 h / g)"),
        at_most("sideways, m", np.abs(run.position("cube")[:, :2]).max(), 1e-6, "walls on all sides"),
        equal("turned (frames)", int(np.sum(np.abs(run.orientation("cube")[:, 1:]).max(axis=1) > 1e-5)), 0, "walls on all sides"),
        at_most("speed at the end, m/s", last_speed(run, HOLE), 1e-9, "e = 0: it stays"),
        energy_never_grows(run, HOLE),
    ]


SCENES = (
    GalleryScene("spikes", "Two stars of twenty spikes fall on the floor and on each other", spikes, check_spikes, 6.0),
    GalleryScene("wedge_in_crack", "A smooth wedge falls into a crack of its own angle", wedge, check_wedge, 4.0),
    GalleryScene("tetrahedra_in_pit", "Tetrahedra fall into a pit", pit, check_pit, 6.0),
    GalleryScene("cube_in_hole", "A cube falls down a shaft of exactly its own size", hole, check_hole, 2.0),
)
