"""FCL's contacts against the own manifolds: the same impulses where contacts are unique, the same rest where faces lie on faces.

Of FCL's answers its distance is exact to 1e-15 of a mesh's size, so times of impact agree to that over the speed. The normal of an impact
comes from points that are 5e-6 of a size apart: good to 1e-10. An impulse depends on it with a factor of some 10, for slender bodies of
some 100. The bound of 1e-6 is far above, and far below what a wrong contact gives: FCL's own collision has normals off by a radian.
"""

from __future__ import annotations

import numpy as np
import pytest
from mesh_pairs import DURATION, concave_pair, convex_pair

import rigidimpulse as ri
from rigidimpulse.collision.distance.fcl_trees import TriangleTrees
from rigidimpulse.collision.manifold.fcl_contacts import FclManifolds, Limits, Placed
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.studies.narrow_phases import compare_narrow_phases

IMPULSE = 1e-6
CONVEX, CONCAVE = (3, 21, 47, 90, 128, 163), (0, 3, 13)
"""Seeds of pairs; `tests/bench/narrow_phases.py` has all of them."""
WOOD = ri.Material(density=500.0, restitution=0.2, static_friction=0.5, dynamic_friction=0.4)


def table_scene(*bodies: ri.Body) -> ri.Scene:
    """Bodies above a table that is a mesh."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("table", ri.Shape.box((10, 10, 1)), position=(0, 0, -0.5), motion="static", material=WOOD))
    for body in bodies:
        scene.add(body)
    return scene


@pytest.mark.parametrize("seed", CONVEX)
def test_first_impulses_of_hulls_agree(seed: int) -> None:
    found = compare_narrow_phases(convex_pair(seed), DURATION, 10.0)
    assert not found.only_own and not found.only_fcl
    for impact in found.first_impacts:
        assert impact.impulse < IMPULSE and impact.turn < IMPULSE and impact.place < IMPULSE
        assert (impact.own, impact.fcl, impact.common) == (1, 1, 1)
    assert found.run_own.status.ok and found.run_fcl.status.ok


def test_concave_meshes_keep_their_contacts_and_lose_the_ghosts() -> None:
    """FCL's collision by itself gives points that are no contacts; none of them is left."""
    ghosts = 0
    for seed in CONCAVE:
        for impact in compare_narrow_phases(concave_pair(seed), DURATION, 10.0).first_impacts:
            assert impact.impulse < IMPULSE and impact.own == impact.fcl == impact.common
            ghosts += impact.ghosts
    assert ghosts > 0


def test_a_face_on_a_face_has_its_corners() -> None:
    """Not unique, so the impulse may be shared out otherwise; but the contacts are the same four, and the sum is."""
    cube = ri.Body("cube", ri.Shape.box((1, 1, 1)), position=(0.3, 0.2, 1.5), material=WOOD)
    found = compare_narrow_phases(table_scene(cube), 0.6, 10.0)
    (impact,) = found.first_impacts
    assert (impact.own, impact.fcl, impact.common) == (4, 4, 4)
    assert impact.impulse < IMPULSE and impact.raw > 4


def hollow() -> ri.Shape:
    """A tray with four sides, of one mesh that is a union of boxes."""
    sides = [((0.2, 3, 1), (1.4, 0, 0.5)), ((0.2, 3, 1), (-1.4, 0, 0.5)), ((3, 0.2, 1), (0, 1.4, 0.5)), ((3, 0.2, 1), (0, -1.4, 0.5))]
    return ri.Shape.compound([(ri.Shape.box(size), at, (1, 0, 0, 0)) for size, at in [((3, 3, 0.2), (0, 0, 0.1)), *sides]])


def test_two_sides_of_a_hollow_are_touched_at_once() -> None:
    """A cube slides over the floor of a tray to its side, and stays in the corner: contacts with two normals."""
    scene = ri.Scene(gravity=(6, 0, -9.81))
    scene.add(ri.Body("tray", hollow(), motion="static", material=WOOD))
    scene.add(ri.Body("cube", ri.Shape.box(0.5), position=(0.6, 0.1, 0.46), velocity=(2, 0, 0), material=WOOD))
    runs = [ri.simulate(scene, 1.0, accuracy=accuracy) for accuracy in ("standard", "classic")]
    for run in runs:
        assert run.status.ok
        assert np.abs(run.position("cube")[-1, [0, 2]] - (1.05, 0.45)).max() < 1e-5
    assert np.abs(runs[0].positions - runs[1].positions).max() < 1e-6


def test_stacks_rest_and_slides_end_where_they_do_with_own_manifolds() -> None:
    stack = [ri.Body(f"cube {k}", ri.Shape.box(0.4), position=(0.01 * k, 0, 0.2 + 0.42 * k), material=WOOD) for k in range(3)]
    plank, motion = ri.Shape.box((0.6, 0.4, 0.2)), {"velocity": (2, 0.5, 0), "angular_velocity": (0, 0, 2)}
    slider = ri.Body("slider", plank, position=(2, 0, 0.1), material=WOOD, **motion)
    runs = [ri.simulate(table_scene(*stack, slider), 1.0, accuracy=accuracy) for accuracy in ("standard", "classic")]
    for run in runs:
        assert run.status.ok and np.abs(run.velocity("cube 2")[-1]).max() == 0.0
    assert np.abs(runs[0].positions - runs[1].positions).max() < 1e-5


def test_the_same_bits_twice() -> None:
    hashes = {ri.simulate(concave_pair(3), DURATION, 10.0, accuracy="classic").state_hash() for _ in range(2)}
    assert len(hashes) == 1


def test_half_spaces_balls_and_moving_supports_take_part() -> None:
    """Pairs that FCL cannot do keep their own contacts, in the same bits; `explain` says so."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("ground", ri.Shape.half_space(), motion="static", material=WOOD))
    scene.add(ri.Body("belt", ri.Shape.box((4, 1, 0.2)), position=(0, 0, 0.6), motion="kinematic", velocity=(0.5, 0, 0), material=WOOD))
    scene.add(ri.Body("box", ri.Shape.box(0.3), position=(0, 0, 0.9), material=WOOD))
    scene.add(ri.Body("ball", ri.Shape.sphere(0.1), position=(5, 0, 0.5), material=WOOD))
    scene.add(ri.Body("rod", ri.Shape.cylinder(0.1, 0.5), position=(5, 2, 0.5), material=WOOD))
    own, fcl = (ri.simulate(scene, 0.8, accuracy=accuracy) for accuracy in ("standard", "classic"))
    assert fcl.status.ok
    for name in ("ball", "rod"):
        np.testing.assert_array_equal(own.position(name), fcl.position(name))
    assert np.abs(own.position("box") - fcl.position("box")).max() < 1e-6
    assert fcl.velocity("box")[-1, 0] == pytest.approx(0.5, abs=1e-6)
    line = fcl.plan.line("FCL contacts")
    assert line.included and "2 meshes" in line.reason and "3 other bodies" in line.reason
    line = own.plan.line("FCL contacts")
    assert not line.included and "'exact': own manifolds" in line.reason


def test_a_scene_without_two_meshes_has_no_use_for_fcl() -> None:
    scene = ri.Scene(bodies=[ri.Body("box", ri.Shape.box(1), position=(0, 0, 2))])
    scene.add(ri.Body("ground", ri.Shape.half_space(), motion="static"))
    run = ri.simulate(scene, 0.8, accuracy="classic")
    assert "no two meshes" in run.plan.line("FCL contacts").reason
    assert run.state_hash() == ri.simulate(scene, 0.8).state_hash()
    with pytest.raises(ri.SceneError, match="no two meshes may meet"):
        compare_narrow_phases(scene, 0.5)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"impact_time": "linear"}, "leave impact_time out"),
        ({"response": "penalty"}, "leave narrow_phase out"),
        ({"contact_solver": "substepped"}, "contact_solver='auto'"),
        ({"narrow_phase": "gjk"}, "narrow_phase = 'gjk'"),
    ],
)
def test_what_fcl_cannot_do_is_refused(settings: dict, words: str) -> None:
    with pytest.raises(ri.SceneError, match=words):
        ri.Accuracy(**{"narrow_phase": "fcl", **settings})


def test_a_ghost_would_be_seen() -> None:
    """A corner beside a face lies below its plane, as FCL reports it, and is no contact; moved over the face it is one."""
    scene = ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1)), ri.Body("b", ri.Shape.box(1), position=(0, 0, 9))])
    world = compile_scene(scene)
    trees = TriangleTrees(world.shapes, world.geometry)
    gap, limits = 1e-7, Limits(2e-6, 1e-6)
    for aside, number in ((0.3, 4), (1.0 - 1e-3, 4), (1.0 + 1e-3, 0)):
        place = np.array([aside, 0.2, 1.0 + gap])
        raw, _ = trees.raw_contacts(0, 0, np.eye(3), place - (0, 0, 2e-4))
        contacts = FclManifolds(trees).contacts(Placed(0, 0, np.eye(3), place), limits)
        assert contacts is not None and len(contacts) == number
        for contact in contacts:
            assert contact.gap == pytest.approx(gap, rel=1e-6) and contact.normal == pytest.approx((0, 0, 1), abs=1e-9)
            assert np.all(np.abs(contact.point_a) <= 0.5 + 1e-9)
        assert len(raw) > number or not number
    assert FclManifolds(trees).contacts(Placed(0, 0, np.eye(3), np.array([0.0, 0.0, 1.0])), limits) is None
