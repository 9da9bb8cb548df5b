"""Motion into USD files, read back by usd-core itself: every body is where the run has it, at every frame.

Transforms are in double precision; those of meshes are to 1e-6. A wrong order of quaternion components,
operations in the wrong order or a frame off by one show as errors of the size of the motion.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_gltf_motion import recorded, smooth, turned

import rigidimpulse as ri
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack

pytest.importorskip("pxr")
from pxr import Usd, UsdGeom

SINGLE = 1e-6


def opened(path: Path) -> Usd.Stage:
    """The stage of a file."""
    return Usd.Stage.Open(str(path))


def world(stage: Usd.Stage, path: str, code: float) -> np.ndarray:
    """World matrix (4, 4) of a prim at a time code, acting on columns, with translation in m."""
    matrix = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T
    matrix[:3, 3] *= UsdGeom.GetStageMetersPerUnit(stage)
    return matrix


def off(stage: Usd.Stage, path: str, run: Any, name: str, start: float = 0.0, stretch: Any = 1.0) -> float:
    """How far the matrix of a prim is from the pose of a body, over all frames; `stretch`: the matrix without its rotation."""
    worst = 0.0
    for k, (x, q) in enumerate(zip(run.position(name), run.orientation(name), strict=True)):
        now = world(stage, path, start + k)
        worst = max(worst, np.abs(now[:3, 3] - x).max(), np.abs(now[:3, :3] - turned(q) @ (np.eye(3) * stretch)).max())
    return worst


def scene_of_shapes(up: int = 2) -> ri.Scene:
    """One body of every kind of shape, some with one mesh; names that are no identifiers."""
    scene = ri.Scene(gravity=-9.81 * np.eye(3)[up])
    hull = ri.Shape.convex_hull(np.random.default_rng(3).normal(size=(20, 3)))
    turn = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
    shapes = {
        "a ball": ri.Shape.sphere(0.4), "a_ball": ri.Shape.box((1, 2, 3)), "7": ri.Shape.capsule(0.2, 0.6),
        "größe": ri.Shape.cylinder(0.3, 0.5), "rock": hull, "twin": hull,
        "both": ri.Shape.compound([(hull, (1, 0, 0), turn), (ri.Shape.box(0.5), (0, 1, 0), turn)]),
    }  # fmt: skip
    scene.add(ri.Body("floor", ri.Shape.half_space(np.eye(3)[up], 0.5), motion="static"))
    for k, (name, shape) in enumerate(shapes.items()):
        scene.add(ri.Body(name, shape, position=(3.0 * k, 0, 2)))
    return scene


PRIMS = {"a ball": "a_ball", "a_ball": "a_ball_2", "7": "_7", "rock": "rock", "twin": "twin", "both": "both"}


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usd", "usdz"])
def test_every_body_is_where_the_run_has_it(tmp_path: Path, suffix: str) -> None:
    """Names become identifiers, unlike one another; the names themselves are kept for display."""
    scene = scene_of_shapes()
    run = recorded(scene, {body.name: smooth(9, body.position, 1.0 + k) for k, body in enumerate(scene.bodies[1:])}, fps=25.0)
    stage = opened(run.export(tmp_path / f"out.{suffix}", start_frame=1001))
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (25.0, 1001.0, 1009.0)
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Z", 1.0)
    for name, prim in PRIMS.items():
        assert off(stage, f"/World/{prim}", run, name, 1001) < SINGLE, name
        assert stage.GetPrimAtPath(f"/World/{prim}").GetDisplayName() == name
    samples = UsdGeom.Xformable(stage.GetPrimAtPath("/World/rock")).GetTimeSamples()
    assert samples == [1001.0 + k for k in range(9)]
    assert not UsdGeom.Xformable(stage.GetPrimAtPath("/World/floor")).GetTimeSamples()


def test_what_is_drawn_is_what_collides(tmp_path: Path) -> None:
    """Boxes about the drawn shapes, in the world, are those of the bodies; one mesh of three bodies is there once.

    A shape that is alone and in the place of its body has the name of the body: programs that make one object of both keep that one.
    """
    scene = scene_of_shapes()
    run = recorded(scene, {"a ball": smooth(2, scene["a ball"].position)})
    stage = opened(run.export(tmp_path / "out.usdc"))
    boxes = UsdGeom.BBoxCache(0.0, [UsdGeom.Tokens.default_])
    vertices = scene["rock"].shape.surface().vertices
    prims = {prim.GetDisplayName(): prim for prim in stage.GetPrimAtPath("/World").GetChildren()}
    half = {"a ball": [0.4] * 3, "a_ball": [0.5, 1, 1.5], "7": [0.2, 0.2, 0.5], "größe": [0.3, 0.3, 0.25]}
    for name, wanted in half.items():
        found = boxes.ComputeUntransformedBound(prims[name]).ComputeAlignedRange()
        assert np.abs(np.array([found.GetMin(), found.GetMax()]) - [np.negative(wanted), wanted]).max() < SINGLE, name
    found = boxes.ComputeWorldBound(stage.GetPrimAtPath("/World/rock")).ComputeAlignedRange()
    low = vertices.min(axis=0) + scene["rock"].position
    assert np.abs(np.array(found.GetMin()) - low).max() < 1e-5
    meshes = [prim for prim in stage.TraverseAll() if prim.IsA(UsdGeom.Mesh)]
    assert sorted(str(prim.GetPath()) for prim in meshes) == ["/World/floor/floor", "/_Shapes/mesh0/mesh"]
    assert len(stage.GetPrototypes()) == 1 and stage.GetPrimAtPath("/_Shapes").IsAbstract()
    floor = UsdGeom.Mesh(stage.GetPrimAtPath("/World/floor/floor"))
    assert np.array(floor.GetPointsAttr().Get())[:, 2].tolist() == [0.5] * 4


def test_up_axes(tmp_path: Path) -> None:
    """Y up is Y, Z up is Z; anything else is turned Y up, and says so."""
    for up, axis in ((1, "Y"), (2, "Z"), (0, "Y")):
        scene = scene_of_shapes(up)
        run = recorded(scene, {"rock": smooth(3, scene["rock"].position)})
        stage = opened(run.export(tmp_path / f"{up}.usda"))
        assert UsdGeom.GetStageUpAxis(stage) == axis
        if up:
            assert off(stage, "/World/rock", run, "rock") < SINGLE
        else:
            turn = world(stage, "/World", 0)[:3, :3]
            assert np.abs(turn @ [1, 0, 0] - [0, 1, 0]).max() < SINGLE
            assert np.abs(world(stage, "/World/rock", 2)[:3, 3] - turn @ run.position("rock")[2]).max() < 1e-5


def test_a_body_that_was_moved_by_hand_and_stands_is_where_the_run_has_it(tmp_path: Path) -> None:
    # Only "b" was moved since the file: "a" keeps the file's own pose, without an opinion of the layer.
    bodies = [ri.Body(name, ri.Shape.box(1), position=(k, 2, 3)) for k, name in enumerate("ab")]
    made = recorded(ri.Scene(bodies=bodies), {name: smooth(1, (k, 2, 3)) for k, name in enumerate("ab")})
    scene = ri.load_scene(made.export(tmp_path / "in.usda"))
    assert set(scene.names) == {"a", "b"}
    poses = {name: (np.tile(scene[name].position, (4, 1)), np.tile(scene[name].unit_orientation(), (4, 1))) for name in "ab"}
    poses["b"] = (poses["b"][0] + [0, 0, 5.0], poses["b"][1])
    run = recorded(scene, poses)
    stage = opened(run.export(tmp_path / "out.usda"))
    paths = {name: str(next(prim.GetPath() for prim in stage.Traverse() if prim.GetName() == name)) for name in "ab"}
    for name in "ab":
        assert off(stage, paths[name], run, name) < SINGLE
    assert stage.GetRootLayer().GetPrimAtPath(paths["a"]) is None


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), (0, -9.81, 0), (0, 0, 0), (3, -4, 5)])
@pytest.mark.parametrize(("axis", "unit"), [("y", 1.0), ("z", 1.0), ("z", 0.01), (None, 0.0254)])
def test_axis_and_unit_as_asked(tmp_path: Path, gravity: Any, axis: str | None, unit: float) -> None:
    # Up of the scene is up of the stage, and lengths in metres are those of the run, whatever the unit.
    scene = ri.Scene(gravity=gravity, bodies=[ri.Body("a", ri.Shape.box(1)), ri.Body("b", ri.Shape.box(1))])
    run = recorded(scene, {"a": smooth(4, (1, 2, 3)), "b": smooth(4, (4, 5, 9))})
    stage = opened(run.export(tmp_path / "out.usda", up_axis=axis, unit=unit))
    assert UsdGeom.GetStageMetersPerUnit(stage) == unit
    assert axis is None or UsdGeom.GetStageUpAxis(stage) == axis.upper()
    top = {"Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}[UsdGeom.GetStageUpAxis(stage)]
    up = -np.asarray(gravity, float) / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, 1.0])
    for k in range(4):
        a, b = (world(stage, f"/World/{name}", k)[:3, 3] for name in "ab")
        recorded_way = run.position("b")[k] - run.position("a")[k]
        assert abs((b - a) @ top - recorded_way @ up) < SINGLE
        assert abs(np.linalg.norm(b - a) - np.linalg.norm(recorded_way)) < SINGLE


def test_axis_and_unit_that_cannot_be(tmp_path: Path) -> None:
    run = recorded(ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1))]), {"a": smooth(4, (1, 2, 3))})
    bad = (("out.glb", {"unit": 0.01}), ("out.gltf", {"up_axis": "z"}), ("out.usda", {"up_axis": "x"}), ("out.usda", {"unit": 0.0}))
    for name, options in bad:
        with pytest.raises(ri.SceneError, match=r"up_axis|unit"):
            run.export(tmp_path / name, **options)
    usd = run.export(tmp_path / "in.usda")
    with pytest.raises(ri.SceneError, match="that file"):
        recorded(ri.load_scene(usd), {"a": smooth(4, (1, 2, 3))}).export(tmp_path / "out.usda", unit=0.01)


def test_fast_spin_does_not_alias(tmp_path: Path) -> None:
    """100 rad/s at 24 fps are 4.17 rad a frame: slerp between frames alone turns back by 2.1 rad. Signs are continuous."""
    spin, frames = 100.0, 13
    scene = ri.Scene(bodies=[ri.Body("top", ri.Shape.box(1))])
    angle = 0.5 * spin * np.arange(frames) / 24.0
    q = np.column_stack([np.cos(angle), 0 * angle, 0 * angle, np.sin(angle)])
    run = recorded(scene, {"top": (np.zeros((frames, 3)), q)}, spins={"top": (0, 0, spin)})
    stage = opened(run.export(tmp_path / "out.usda"))
    for time in np.linspace(0, run.times[-1], 100):
        wanted = turned([np.cos(spin * time / 2), 0, 0, np.sin(spin * time / 2)])
        assert np.abs(world(stage, "/World/top", 24 * time)[:3, :3] - wanted).max() < 1e-4
    orient = stage.GetPrimAtPath("/World/top").GetAttribute("xformOp:orient")
    codes = orient.GetTimeSamples()
    keys = np.array([[orient.Get(code).real, *orient.Get(code).imaginary] for code in codes])
    assert np.sum(keys[1:] * keys[:-1], axis=1).min() > 0.7 and set(range(frames)) <= set(codes)


def test_samples_between_frames_are_on_the_parabola(tmp_path: Path) -> None:
    """A thrown body at 10 fps: straight lines between frames miss its parabola by g dt^2 / 8 = 12 mm, four samples a frame are on it.

    The same in glTF, in single precision.
    """
    scene = ri.Scene(bodies=[ri.Body("ball", ri.Shape.sphere(0.1), velocity=(1, 0, 3), angular_velocity=(0, 5, 0))])
    run = ri.simulate(scene, 0.5, 10)
    stage = opened(run.export(tmp_path / "out.usda", samples=4))
    codes = UsdGeom.Xformable(stage.GetPrimAtPath("/World/ball")).GetTimeSamples()
    assert np.allclose(codes, np.arange(21) / 4, atol=1e-9, rtol=0)
    for code in codes:
        t = code / 10
        assert np.abs(world(stage, "/World/ball", code)[:3, 3] - [t, 0, 3 * t - 9.81 * t**2 / 2]).max() < 1e-9
        assert np.abs(world(stage, "/World/ball", code)[:3, :3] - turned([np.cos(2.5 * t), 0, np.sin(2.5 * t), 0])).max() < SINGLE
    with pytest.raises(ri.SceneError, match="samples"):
        run.export(tmp_path / "out.usda", samples=0)


def test_small_turns_and_far_places_survive(tmp_path: Path) -> None:
    """A beam turns by 2e-3 rad, and stands 1 km away in a stage whose up axis is another: its tip, 10 m off, is where the run has it.

    In single precision the file had turns below 1e-3 rad as none or 7e-4 rad, 2 mm at the tip, and its root was off by 3.4e-5 m at 1 km.
    """
    angle = np.linspace(0.0, 2e-3, 25)
    q = np.column_stack([np.cos(0.5 * angle), 0 * angle, 0 * angle, np.sin(0.5 * angle)])
    scene = ri.Scene(bodies=[ri.Body("beam", ri.Shape.box((20, 1, 1)), position=(1000, 700, 5))])
    run = recorded(scene, {"beam": (np.tile([1000.0, 700.0, 5.0], (25, 1)), q)})
    for axis in ("z", "y"):
        stage = opened(run.export(tmp_path / f"{axis}.usda", up_axis=axis))
        back = np.eye(3) if axis == "z" else np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
        for k in range(25):
            now = world(stage, "/World/beam", k)
            tip = np.array([1000 + 10 * np.cos(angle[k]), 700 + 10 * np.sin(angle[k]), 5.0])
            assert np.abs(back @ (now[:3, :3] @ [10, 0, 0] + now[:3, 3]) - tip).max() < 1e-6


def test_who_has_keys(tmp_path: Path) -> None:
    """Bodies that stand have none, unless all are asked for; a tolerance leaves out what lies in between."""
    scene = ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1)), ri.Body("b", ri.Shape.box(1), position=(9, 0, 0))])
    x = np.linspace([0, 0, 0], [1, 0, 0], 5)
    run = recorded(scene, {"a": (x, np.tile([1.0, 0, 0, 0], (5, 1)))})

    def count(name: str, **options: Any) -> tuple[int, int]:
        stage = opened(run.export(tmp_path / "out.usda", **options))
        prim = stage.GetPrimAtPath(f"/World/{name}")
        return tuple(prim.GetAttribute(f"xformOp:{op}").GetNumTimeSamples() for op in ("translate", "orient"))

    assert (count("a"), count("b")) == ((5, 0), (0, 0))
    assert (count("a", only_moved=False), count("b", only_moved=False)) == ((5, 5), (5, 5))
    assert count("a", tolerance=1e-3) == (2, 0)


def test_flexible_bodies_have_moving_points(tmp_path: Path) -> None:
    scene = ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1))])
    run = recorded(scene, {"a": smooth(4, (0, 0, 0))})
    points = np.random.default_rng(1).normal(size=(4, 3, 3))
    run.soft_bodies.append(FlexibleTrack("a", points, np.array([[0, 1, 2]])))
    stage = opened(run.export(tmp_path / "out.usdc", start_frame=10))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/a_2"))
    for k in range(4):
        assert np.abs(np.array(mesh.GetPointsAttr().Get(10 + k)) - points[k]).max() < SINGLE


def test_the_validators_of_usd_find_nothing(tmp_path: Path) -> None:
    from pxr import UsdValidation

    scene = scene_of_shapes()
    run = recorded(scene, {body.name: smooth(4, body.position) for body in scene.bodies[1:]})
    run.soft_bodies.append(FlexibleTrack("net", np.random.default_rng(1).normal(size=(4, 3, 3)), np.array([[0, 1, 2]])))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    for name in ("out.usdc", "out.usdz"):
        stage = opened(run.export(tmp_path / name))
        found = UsdValidation.ValidationContext(validators).Validate(stage)
        assert len(validators) > 10 and not [error.GetErrorAsString() for error in found]


def test_a_thousand_bodies(tmp_path: Path) -> None:
    """240 frames of 1,000 bodies: all samples are there, 72 bytes a pose: 24 + 32, and 16 that say where."""
    from rigidimpulse.recording.events import IMPACT_DTYPE
    from rigidimpulse.recording.recording import Recording

    rng, frames, count = np.random.default_rng(1), 240, 1000
    box = ri.Shape.box(1)
    scene = ri.Scene(bodies=[ri.Body(f"b{k}", box, position=(k, 0, 0)) for k in range(count)])
    x, q = rng.normal(size=(frames, count, 3)), rng.normal(size=(frames, count, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    still = np.zeros((frames, count, 3))
    run = Recording(np.arange(frames) / 24, list(scene.names), x, q, still, still, x, np.zeros(0, IMPACT_DTYPE), scene=scene)
    path = run.export(tmp_path / "out.usdc")
    assert frames * count * 72 < path.stat().st_size < frames * count * 74
    stage = opened(path)
    assert stage.GetPrimAtPath("/World/b999").GetAttribute("xformOp:orient").GetNumTimeSamples() == frames


def test_without_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    scene = ri.Scene(bodies=[ri.Body("a", ri.Shape.box(1))])
    for name in [name for name in sys.modules if name.startswith("rigidimpulse.io.usd.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ri.SceneError, match=r"rigidimpulse\[usd\]"):
        recorded(scene, {"a": smooth(3, (0, 0, 0))}).export(tmp_path / "out.usda")
    assert not list(tmp_path.iterdir())
