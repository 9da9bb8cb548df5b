"""`Shape.convex_parts`: what it keeps of a mesh, what it refuses, and what it remembers."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import rigidimpulse as ri
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import rotate
from rigidimpulse.scene.mass import body_mass

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the user's cache, empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "rigidimpulse" / "convex_parts"


def ring() -> ri.Shape:
    """A ring of 400 triangles."""
    return ri.Shape.from_trimesh(trimesh.creation.torus(0.1, 0.03, major_sections=20, minor_sections=10))


def bracket() -> ri.Shape:
    """An angle, as one concave mesh."""
    profile = [(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)]
    corners = [(x, y, z) for z in (0.0, 0.1) for x, y in profile]
    caps = [(0, k + 1, k) for k in range(1, 5)] + [(6, k + 6, k + 7) for k in range(1, 5)]
    sides = [(k, (k + 1) % 6, 6 + (k + 1) % 6) for k in range(6)] + [(k, 6 + (k + 1) % 6, 6 + k) for k in range(6)]
    return ri.Shape.mesh(corners, caps + sides)


def test_parts_have_the_mass_and_the_looks_of_the_mesh() -> None:
    """Hulls of a ring have another volume: the mass is that of the ring, to the bit."""
    whole = ring()
    parts = whole.convex_parts(0.1)
    assert len(parts.parts) > 3
    of_parts, of_whole = (body_mass(ri.Body("ring", shape)) for shape in (parts, whole))
    assert of_parts.mass == of_whole.mass
    np.testing.assert_array_equal(of_parts.inertia, of_whole.inertia)
    assert ri.Body("ring", parts).drawn_shape is whole
    assert sum(part.solid().volume for part, _, _ in parts.parts) != of_whole.mass


def test_parts_keep_the_hole_of_a_ring() -> None:
    """Its hull has none."""
    assert not ri.contains(ring().convex_parts(), [(0.0, 0.0, 0.0)])[0]
    assert ri.contains(ri.Shape.convex_hull(ring()), [(0.0, 0.0, 0.0)])[0]


def test_hulls_are_near_the_surface() -> None:
    """No corner of a hull is farther than the concavity from the bracket: 0.05 of half of its longest side, 7.5 mm. Its hull: 71 mm."""
    corners = np.concatenate([part.vertices for part, _, _ in bracket().convex_parts().parts if part.vertices is not None])
    planks = [(np.zeros(3), np.array([0.3, 0.1, 0.1])), (np.zeros(3), np.array([0.1, 0.3, 0.1]))]
    beside = [np.maximum(np.maximum(low - corners, corners - high), 0.0) for low, high in planks]
    assert np.min([np.linalg.norm(way, axis=1) for way in beside], axis=0).max() < 7.5e-3


def test_what_is_convex_stays_as_it_is() -> None:
    """No part is made, and no library asked for."""
    for shape in (ri.Shape.box(1.0), ri.Shape.sphere(0.5), ri.Shape.from_trimesh(trimesh.creation.icosphere(2))):
        assert shape.convex_parts() is shape


def test_parts_of_a_compound_keep_their_places() -> None:
    """A ring on a stick: the stick stays a capsule, and hulls are where the ring was."""
    stick = ri.Shape.capsule(0.02, 0.3)
    whole = ri.Shape.compound([(stick, (0.0, 0.0, -0.3), UPRIGHT), (ring(), (0.0, 0.0, 0.1), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))])
    parts = whole.convex_parts(0.1)
    assert parts.parts[0][0] is stick
    corners = np.concatenate([part.vertices for part, _, _ in parts.parts[1:] if part.vertices is not None])
    np.testing.assert_allclose(corners.min(axis=0), (-0.13, -0.03, -0.03), atol=5e-3)
    np.testing.assert_allclose(corners.max(axis=0), (0.13, 0.03, 0.23), atol=5e-3)


def test_one_part_is_the_hull() -> None:
    """Of at most one part, the volume is that of the hull; CoACD computes with coarser numbers."""
    parts = bracket().convex_parts(most=1)
    assert len(parts.parts) == 1
    np.testing.assert_allclose(parts.parts[0][0].solid().volume, ri.Shape.convex_hull(bracket()).solid().volume, rtol=1e-4)


def test_parts_are_found_once(cache: Path) -> None:
    """The second time they are read, even without the library; a file that cannot be read is written again."""
    first = ring().convex_parts(0.1)
    (kept,) = cache.glob("*.npz")
    again = ring().convex_parts(0.1)
    assert again.key == first.key
    kept.write_bytes(b"no hulls")
    assert ring().convex_parts(0.1).key == first.key
    assert kept.stat().st_size > 100
    assert len(list(cache.iterdir())) == 1


def test_nothing_is_lost_where_nothing_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of the cache is a file."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert len(ring().convex_parts(0.1).parts) > 3


@pytest.mark.parametrize(
    ("shape", "arguments", "message"),
    [
        (ring, {"concavity": 0.001}, "concavity is 0.001"),
        (ring, {"concavity": "fine"}, "concavity is 'fine'"),
        (ring, {"most": 0}, "most is 0"),
        (lambda: ri.Shape.mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]), {}, "open"),
    ],
)
def test_bad_input_is_refused(shape, arguments: dict, message: str) -> None:
    """With what is wrong, and a remedy."""
    with pytest.raises(SceneError, match=message):
        shape().convex_parts(**arguments)


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """And how to get it."""
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(SceneError, match=r"pip install 'rigidimpulse\[parts\]'"):
        ring().convex_parts()


@pytest.mark.parametrize("floor", [ri.Shape.half_space(), ri.Shape.box((4.0, 4.0, 0.2))], ids=("half space", "box"))
def test_rings_in_parts_do_not_sink(floor: ri.Shape) -> None:
    """Twelve rings fall on a floor at "preview". Their hulls reach into each other: contacts at places that each of two parts took for
    covered by the other were left out, and rings sank in by 2 % of their size."""
    scene, link = ri.Scene(), ring().convex_parts(0.05)
    scene.add(ri.Body("floor", floor, motion="static", position=(0, 0, 0 if floor.kind == "half_space" else -0.1)))
    random = np.random.default_rng(2)
    for k in range(12):
        place = (0.28 * (k % 2), 0.28 * (k // 2 % 2), 0.2 + 0.28 * (k // 4))
        scene.add(ri.Body(f"{k}", link, position=place, orientation=random.normal(size=4)))
    run = ri.simulate(scene, 1.5, accuracy="preview")
    assert run.status.ok, run.status.message
    corners = link.whole.surface().vertices if link.whole is not None else None
    for k in range(12):
        x, q = run.position(f"{k}"), run.orientation(f"{k}")
        lowest = [rotate(turn, corners)[:, 2].min() + place[2] for place, turn in zip(x, q, strict=True)]
        assert min(lowest) > -2e-3


def test_a_chain_of_rings_in_parts_hangs_together() -> None:
    """Ten rings at "preview", held by contact alone, swing down from one that stands: none slips off, none is inside another."""
    scene = ri.Scene()
    mesh = ri.Shape.from_trimesh(trimesh.creation.torus(0.05, 0.011, major_sections=24, minor_sections=10))
    link = mesh.convex_parts(0.03)
    for k in range(10):
        turned = UPRIGHT if k % 2 else (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
        scene.add(ri.Body(f"ring {k}", link, position=(0.077 * k, 0, 0), orientation=turned, motion="dynamic" if k else "static"))
    run = ri.simulate(scene, 1.0, accuracy="preview")
    assert run.status.ok, run.status.message
    far = np.linalg.norm(np.diff(run.positions, axis=1), axis=2)
    assert far.max() < 2.0 * (0.05 - 0.011) + 0.005
