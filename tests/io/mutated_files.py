"""Files of all kinds that the library reads, with something wrong in them: bytes, numbers, words or whole pieces."""

from __future__ import annotations

import functools
import random
import re
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from broken_files import good_files as good_gltf_files
from usd_files import File

import rigidimpulse as ri
from rigidimpulse.engine.compile_scene import compile_scene

NUMBERS = (b"nan", b"inf", b"-inf", b"1e308", b"-1", b"0", b"1e-320", b"99999999999", b"-2147483649", b"1e999", b"0x10", b"", b"1,5")
WORDS = (b"", b"none", b"../../../etc/passwd", b"/", b"\x00", b"\xff\xfe", b"{}", b"[]", b"<x/>", b"a" * 5000, b"'\"", b"%s%n", b"=1+1")
NUMBER, WORD = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?"), re.compile(rb"[A-Za-z_]\w*")
URDF = """<robot name="arm">
<link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>
<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="rod"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 -0.5" rpy="0 0.1 0"/><geometry><cylinder radius="0.05" length="1"/></geometry></collision></link>
<link name="tip"><collision><geometry><mesh filename="cube.obj" scale="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="swing" type="revolute"><parent link="base"/><child link="rod"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="10" velocity="5"/><dynamics damping="0.1" friction="0.01"/></joint>
<joint name="fixed" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="0 0 -1"/></joint></robot>"""
MJCF = """<mujoco model="legs"><compiler angle="degree"/><option gravity="0 0 -9.81"/>
<default><geom friction="0.7" density="500"/></default>
<asset><mesh name="cube" file="cube.obj" scale="0.1 0.1 0.1"/></asset>
<worldbody><geom type="plane" size="5 5 0.1"/>
<body name="trunk" pos="0 0 1"><freejoint/><geom type="capsule" size="0.1" fromto="0 0 0 0 0 0.5"/>
<body name="leg" pos="0 0 0"><joint name="hip" type="hinge" axis="0 1 0" range="-40 40" damping="0.1"/>
<geom type="box" size="0.05 0.05 0.2" pos="0 0 -0.2"/>
<body name="foot" pos="0 0 -0.4"><joint name="slide" type="slide" axis="0 0 1" range="-0.1 0.1"/>
<geom type="mesh" mesh="cube" mass="0.3"/></body>
</body></body></worldbody><equality><weld body1="trunk" body2="leg" active="false"/></equality></mujoco>"""


def _meshes() -> dict[str, bytes]:
    """A shape with few faces in all formats of meshes."""
    mesh = trimesh.creation.icosphere(subdivisions=1)
    files = {f"ball.{kind}": mesh.export(file_type=kind) for kind in ("obj", "ply", "stl", "stl_ascii", "off", "glb")}
    files["text.ply"] = trimesh.exchange.ply.export_ply(mesh, encoding="ascii")
    files["text.stl"] = files.pop("ball.stl_ascii")
    return {name: data.encode() if isinstance(data, str) else data for name, data in files.items()}


def _scene() -> ri.Scene:
    """Bodies of several kinds with a joint, a mesh and a body with keys."""
    scene = ri.Scene(gravity=(0, 0, -9.81))
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    scene.add(ri.Body("box", ri.Shape.box((0.2, 0.3, 0.1)), position=(0, 0, 0.5), material=ri.Material(restitution=0.4)))
    scene.add(ri.Body("egg", ri.Shape.from_trimesh(trimesh.creation.icosphere(1)), position=(3, 0, 2), angular_velocity=(1, 2, 3)))
    scene.add(ri.Body("pin", ri.Shape.sphere(0.1), position=(-1, 0, 1)))
    scene.add(ri.HingeJoint("pin", None, (-1, 0, 1.5), (0, 1, 0)))
    return scene


@functools.cache
def good_files() -> dict[str, bytes]:
    """The content of a good file of every kind, by name."""
    files = _meshes()
    with tempfile.TemporaryDirectory() as folder:
        run = ri.simulate(_scene(), 0.1)
        for name in ("drawn.glb", "drawn.usda", "drawn.usdc", "run.npz"):
            run.export(Path(folder) / name)
        _scene().export(Path(folder) / "scene.glb")
        for name in ("scene.usda", "scene.usdc"):
            _usd_scene().save(Path(folder) / name)
        ri.simulate(_scene(), 0.05, cache=Path(folder) / "run.h5")
        for path in Path(folder).iterdir():
            files[path.name] = path.read_bytes()
        for number, file in enumerate(_gltf_trees()):
            files[f"tree{number}.gltf"] = file
    files["arm.urdf"], files["legs.xml"] = URDF.encode(), MJCF.encode()
    return files


def _usd_scene() -> File:
    """Bodies and a joint of UsdPhysics."""
    file = File("Y", 0.01)
    file.collider("/floor", "Cube", size=2.0, at=(0, -1, 0), scale=(50, 1, 50))
    file.body("/ball", at=(0, 50, 0))
    file.collider("/ball/shape", "Sphere", radius=10.0)
    file.body("/box", at=(30, 50, 0), turn=(0.8, 0, 0.6, 0))
    file.collider("/box/mesh", "Mesh", "convexHull", scale=(10, 20, 10))
    file.joint("/hinge", "PhysicsRevoluteJoint", "/ball", "/box", localPos0=(15, 0, 0), localPos1=(-15, 0, 0), lowerLimit=-30.0)
    return file


def _gltf_trees() -> list[bytes]:
    """Scenes of glTF in JSON, with their numbers in it."""
    with tempfile.TemporaryDirectory() as folder:
        return [file.save(Path(folder) / "it.gltf").read_bytes() for file in good_gltf_files()]


def mutated(seed: int) -> tuple[str, bytes]:
    """The name and the content of a file with up to three things wrong in it."""
    numbers = random.Random(seed)
    name = numbers.choice(sorted(good_files()))
    content = good_files()[name]
    for _ in range(numbers.choice((1, 1, 2, 3))):
        content = numbers.choice(MUTATIONS)(content, numbers)
    return name, content


def _flipped(content: bytes, numbers: random.Random) -> bytes:
    """Some bytes replaced by others."""
    spoiled = bytearray(content)
    for _ in range(numbers.choice((1, 1, 4, 20))):
        if spoiled:
            spoiled[numbers.randrange(len(spoiled))] = numbers.randrange(256)
    return bytes(spoiled)


def _stretch(content: bytes, numbers: random.Random) -> tuple[int, int]:
    """Where a piece begins and ends."""
    first = numbers.randrange(len(content) + 1)
    return first, min(first + numbers.choice((1, 8, 100, 4096)), len(content))


def _cut(content: bytes, numbers: random.Random) -> bytes:
    return content[: numbers.randrange(len(content) + 1)]


def _without(content: bytes, numbers: random.Random) -> bytes:
    first, last = _stretch(content, numbers)
    return content[:first] + content[last:]


def _doubled(content: bytes, numbers: random.Random) -> bytes:
    first, last = _stretch(content, numbers)
    return content[:last] + content[first:last] * numbers.choice((1, 1, 50)) + content[last:]


def _zeroed(content: bytes, numbers: random.Random) -> bytes:
    first, last = _stretch(content, numbers)
    return content[:first] + numbers.choice((b"\x00", b"\xff")) * (last - first) + content[last:]


def _replaced(pattern: re.Pattern[bytes], others: tuple[bytes, ...]) -> Callable[[bytes, random.Random], bytes]:
    """A function that replaces one thing that looks like a pattern."""

    def replaced(content: bytes, numbers: random.Random) -> bytes:
        places = [found.span() for found in pattern.finditer(content)]
        if not places:
            return content
        first, last = numbers.choice(places)
        return content[:first] + numbers.choice(others) + content[last:]

    return replaced


def _swapped(content: bytes, numbers: random.Random) -> bytes:
    """One word in the place of another."""
    words = [found.span() for found in WORD.finditer(content)]
    if len(words) < 2:
        return content
    (first, last), (begin, end) = numbers.choice(words), numbers.choice(words)
    return content[:first] + content[begin:end] + content[last:]


MUTATIONS = (
    _flipped, _cut, _without, _doubled, _zeroed, _replaced(NUMBER, NUMBERS), _replaced(NUMBER, NUMBERS), _replaced(WORD, WORDS), _swapped,
)  # fmt: skip


def read(name: str, content: bytes) -> list[str]:
    """Read a file as a user does; return what is wrong: another error than a `SceneError`, or something left behind."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.filterwarnings("error", module=r"rigidimpulse\.")
        (Path(folder) / "cube.obj").write_bytes(trimesh.creation.box().export(file_type="obj").encode())
        path = Path(folder) / name
        path.write_bytes(content)
        try:
            if path.suffix in (".npz", ".h5"):
                assert np.isfinite(ri.load_recording(path).positions).all()
            elif name.startswith(("ball", "text")):
                shape = ri.Shape.from_file(path)
                compile_scene(ri.Scene(bodies=[ri.Body("it", shape)]))
            else:
                compile_scene(ri.load_scene(path))
        except ri.SceneError as error:
            return [] if str(error) else ["an error without a word"]
        except Exception as error:
            return [f"{name}: {type(error).__name__}: {error}"]
        left = sorted(entry.name for entry in Path(folder).iterdir() if entry.name not in (name, "cube.obj"))
        return [f"files were left behind: {', '.join(left)}"] if left else []


def read_all() -> None:
    """Read every good file, so that what is compiled and imported for them is there."""
    for name, content in good_files().items():
        assert read(name, content) == [], name
