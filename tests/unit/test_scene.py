"""Scenes and bodies: what is kept, and the words with which bad input is refused."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.effect import SceneEffect
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene, validate
from rigidimpulse.scene.shape import Shape

BALL = Shape.sphere(0.5)
BOX = Shape.box(1).surface()


class Wind(SceneEffect):
    """An effect, as far as a scene can tell."""

    stage = "forces"


def test_bodies_keep_their_order_and_are_found_by_name():
    scene = Scene(bodies=[Body("floor", Shape.half_space(), motion="static")])
    ball = scene.add(Body("ball", BALL))
    assert scene.names == ("floor", "ball") and scene["ball"] is ball is scene.bodies[1]
    assert "ball" in scene and "bell" not in scene
    assert np.array_equal(scene.gravity, (0, 0, -9.81))
    validate(scene)


def test_unknown_names_list_the_known_ones():
    scene = Scene(bodies=[Body("floor", BALL), Body("ball", BALL)])
    with pytest.raises(SceneError, match=r"unknown body 'bell'; did you mean 'ball'\? known: 'floor', 'ball'"):
        scene["bell"]
    assert str(unknown_name("preset", "x", [])) == "unknown preset 'x'; known: none"


def test_names_are_given_once():
    scene = Scene(bodies=[Body("ball", BALL)])
    with pytest.raises(SceneError, match="body 'ball': the scene has a body of this name already"):
        scene.add(Body("ball", BALL))
    with pytest.raises(SceneError, match="not empty"):
        scene.add(Body("", BALL))


def test_a_body_is_put_in_the_place_of_the_one_of_its_name():
    scene = Scene(bodies=[Body("ball", BALL), Body("other", BALL)])
    scene["ball"] = heavy = replace(scene["ball"], mass=7.0)
    assert scene.bodies[0] is heavy and scene.names == ("ball", "other")
    for name, thing, words in (
        ("bell", heavy, "did you mean 'ball'"),
        ("other", heavy, "body 'other': a body called 'ball' is put in its place; give one of the same name"),
        ("ball", BALL, "body 'ball': a Shape is put in its place; give a Body"),
    ):
        with pytest.raises(SceneError, match=words):
            scene[name] = thing
    assert scene.bodies[0] is heavy


def test_effects_are_kept_apart_from_bodies():
    wind = Wind()
    scene = Scene()
    scene.add(wind)
    assert scene.effects == (wind,) and scene.bodies == ()


@pytest.mark.parametrize("thing", [BALL, "ball", 3, Body, Wind, None])
def test_other_things_are_not_added(thing):
    with pytest.raises(SceneError, match="cannot be added"):
        Scene().add(thing)


def test_scenes_survive_pickling():
    """Worker processes get scenes, not compiled worlds."""
    scene = Scene(bodies=[Body("ball", BALL, material=Material(restitution=0.5))])
    again = pickle.loads(pickle.dumps(scene))
    assert again["ball"].material == scene["ball"].material
    error = SceneError("mass is -1 kg", "give a mass > 0", "body 'ball'")
    assert str(pickle.loads(pickle.dumps(error))) == str(error) == "body 'ball': mass is -1 kg; give a mass > 0"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"position": (0, 0, np.nan)}, "position is"),
        ({"position": (0, 0)}, "three finite numbers, in m"),
        ({"position": "origin"}, "position is 'origin'"),
        ({"velocity": (np.inf, 0, 0)}, "velocity is"),
        ({"angular_velocity": 3.0}, "angular_velocity is 3.0"),
        ({"orientation": (0, 0, 0, 0)}, "orientation is .* not all zero"),
        ({"orientation": (1, 0, 0)}, "orientation is"),
        ({"orientation": (1, 0, 0, np.nan)}, "orientation is"),
        ({"orientation": "up"}, "orientation is"),
        ({"motion": "frozen"}, "motion is 'frozen'; give one of 'dynamic', 'kinematic', 'static'"),
        ({"mass": 0}, "mass is 0 kg; give a mass > 0"),
        ({"mass": -2.0}, "mass is -2.0 kg"),
        ({"mass": np.inf}, "mass is inf"),
        ({"mass": "heavy"}, "mass is 'heavy'"),
        ({"inertia": (1, 2)}, "inertia is"),
        ({"inertia": (1, 1, np.nan)}, "inertia is"),
        ({"inertia": (1, 1, 5)}, "moments of inertia"),
        ({"center_of_mass": (0, np.nan, 0)}, "center_of_mass is"),
        ({"gravity_factor": np.nan}, "gravity_factor is nan"),
        ({"material": Material(restitution=2)}, "material: restitution is 2.0; give"),
        ({"material": "steel"}, "material is a str"),
        ({"material": Material(density=-1)}, "material: density is -1"),
        ({"shape": Shape.sphere(-1)}, "sphere: radius is -1.0 m"),
        ({"shape": "sphere"}, "shape is a str"),
        ({"shape": Shape.half_space()}, "half space is infinite .* motion='static'"),
        ({"shape": Shape.compound([(Shape.half_space(), (0, 0, 0), (1, 0, 0, 0))])}, "half space is infinite"),
        ({"shape": Shape.mesh(BOX.vertices, BOX.faces[1:])}, "mesh: it is open .*convex_hull"),
        ({"shape": Shape.mesh(BOX.vertices, BOX.faces[:, ::-1])}, "mesh: it is inside out .* flip"),
        ({"shape": Shape.mesh(BOX.vertices, [])}, "mesh: it is empty"),
        ({"motion": "static", "velocity": (1, 0, 0)}, "it is static, but its velocity .*kinematic"),
        ({"keyframes": Keyframes([0], [(0, 0, 0)])}, "keyframes, but its motion is 'dynamic'"),
        ({"motion": "kinematic", "keyframes": [0, 1]}, "keyframes are a list"),
        (
            {"motion": "kinematic", "keyframes": Keyframes([0], [(0, 0, 0)]), "velocity": (1, 0, 0)},
            "one or the other",
        ),
        ({"motion": "kinematic", "keyframes": Keyframes([0, 0], [(0, 0, 0)] * 2)}, "keyframes: times do not increase"),
        ({"motion": "kinematic", "keyframes": Keyframes([], [])}, "keyframes"),
        ({"motion": "kinematic", "keyframes": Keyframes([0, 1], [(0, 0, 0)])}, "2 times but 1 positions"),
        ({"motion": "kinematic", "keyframes": Keyframes([0], [(0, 0, 0)], [(0, 0, 0, 0)])}, "orientation 0 is all"),
        ({"motion": "kinematic", "keyframes": Keyframes([0], [(0, 0, np.nan)])}, "positions are"),
    ],
)
def test_bad_bodies_are_refused_by_name(settings, words):
    body = Body("thing", **{"shape": BALL, **settings})
    with pytest.raises(SceneError, match=words) as caught:
        validate(Scene(bodies=[Body("good", BALL), body]))
    assert str(caught.value).startswith("body 'thing'")
    assert caught.value.remedy


@pytest.mark.parametrize("gravity", [(0, 0), (0, 0, np.nan), "down", 9.81])
def test_bad_gravity_is_refused(gravity):
    with pytest.raises(SceneError, match="gravity is"):
        validate(Scene(gravity=gravity, bodies=[Body("ball", BALL)]))


def test_a_scene_needs_a_body():
    with pytest.raises(SceneError, match="no bodies"):
        validate(Scene())


def test_static_and_kinematic_bodies_may_be_open_or_inside_out():
    """A terrain has no inside, a room seen from within is an inverted box; neither may be dynamic without its mass."""
    bodies = [
        Body("terrain", Shape.mesh(BOX.vertices, BOX.faces[:4]), motion="static"),
        Body("room", Shape.mesh(BOX.vertices, BOX.faces[:, ::-1]), motion="kinematic"),
    ]
    scene = Scene(bodies=bodies)
    validate(scene)
    assert scene.names == ("terrain", "room")
    for body in bodies:
        with pytest.raises(SceneError, match=f"body '{body.name}'"):
            validate(Scene(bodies=[Body(body.name, body.shape)]))


@pytest.mark.parametrize("length", [1e-200, 1e-3, 1.0, 3.0, 1e200])
def test_orientations_are_normalised(length):
    """Any length will do, tiny and huge ones included; a unit quaternion is kept as it is."""
    body = Body("ball", BALL, orientation=np.array([0.6, 0.0, 0.8, 0.0]) * length)
    assert np.allclose(body.unit_orientation(), [0.6, 0, 0.8, 0], rtol=0, atol=2e-16)
    assert Body("ball", BALL).unit_orientation().tolist() == [1.0, 0.0, 0.0, 0.0]


def test_keyframes_fill_in_the_orientation_of_the_body():
    times, positions, orientations = Keyframes([0, 1], [(0, 0, 0), (1, 0, 0)]).arrays((0, 0, 0, 2))
    assert times.tolist() == [0, 1] and positions.shape == (2, 3)
    assert orientations.tolist() == [[0, 0, 0, 1], [0, 0, 0, 1]]
    turned = Keyframes([0], [(0, 0, 0)], [(0, 3, 0, 4)]).arrays()[2]
    assert np.allclose(turned, [[0, 0.6, 0, 0.8]], rtol=1e-15)
