"""The same scene in other engines, for the benchmarks: MuJoCo, Bullet (`pip install '.[peers]'`), PhysX (`pip install sapien`) and Rapier's
SIMD build (`npm install --prefix FOLDER @dimforge/rapier3d-simd-compat`, RAPIER=FOLDER/node_modules in the environment).

Each gives the time of every step, ms of processor time (Rapier: wall clock of its own process), poses on the way, and the last velocities.
What is not installed is left out, with a word why.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numba.core import config

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Part
from rigidimpulse.studies.peers import load_peer
from rigidimpulse.studies.peers.common import PeerBody, read_scene

ENGINES = ("MuJoCo", "Bullet", "PhysX", "Rapier")
WALL, DEEP = 60.0, 2.0
"""m: half of the width of the box that stands for a half space, and its half depth."""


class EngineRun(NamedTuple):
    """What an engine did with n bodies."""

    times: np.ndarray  # (k,) ms of each step
    position: np.ndarray  # (f, n, 3) m, body origins at frames, the last of them after the last step
    orientation: np.ndarray  # (f, n, 4)
    velocity: np.ndarray  # (n, 3) m/s, after the last step
    spin: np.ndarray  # (n, 3) rad/s


class Steps(NamedTuple):
    """How an engine is run."""

    step: float  # s
    number: int
    each: int  # steps from frame to frame
    sleeping: bool = False

    def is_frame(self, k: int) -> bool:
        """Whether there is a frame after step k."""
        return (self.number - 1 - k) % self.each == 0


def use_cores(number: int) -> None:
    """Let the kernels here use `number` cores, as NUMBA_NUM_THREADS does."""
    vars(config)["NUMBA_NUM_THREADS"] = number


def run_engines(
    scene: Scene, step: float, steps: int, sleeping: bool = False, names: tuple[str, ...] = ENGINES, each: int | None = None
) -> dict[str, EngineRun | str]:
    """Run a scene in the engines named, one after the other; a text says why one is left out.

    each: steps from frame to frame; None: the last step is the only frame.
    """
    engines: dict[str, Callable] = {"MuJoCo": _peer("mujoco"), "Bullet": _peer("pybullet"), "PhysX": _physx, "Rapier": _rapier}
    out: dict[str, EngineRun | str] = {}
    for name in names:
        try:
            out[name] = engines[name](scene, Steps(step, steps, each or steps, sleeping))
        except (SceneError, ImportError, OSError) as error:
            out[name] = str(error).splitlines()[0]
    return out


def _peer(name: str) -> Callable:
    def run(scene: Scene, steps: Steps) -> EngineRun:
        if steps.sleeping:
            raise SceneError("its adapter lets no body sleep")
        peer = load_peer(name, scene, steps.step)
        times, states = [], []
        for k in range(steps.number):
            start = process_time()
            peer.advance(1)
            times.append(1e3 * (process_time() - start))
            if steps.is_frame(k):
                states.append(peer.state())
        peer.close()
        position, orientation = (np.array([state[k] for state in states]) for k in range(2))
        return EngineRun(np.array(times), position, orientation, *states[-1][2:4])

    return run


def _as_box(part: Part) -> Part:
    """A half space as a box; every other part as it is."""
    if part.shape.kind != "half_space":
        return part
    from rigidimpulse.scene.shape import Shape

    normal, offset = part.shape.plane()
    normal = part.rotation @ normal
    across = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = across - (across @ normal) * normal
    first /= np.linalg.norm(first)
    box = Shape.box((2.0 * WALL, 2.0 * WALL, 2.0 * DEEP))
    return Part(box, part.position + (offset - DEEP) * normal, np.column_stack([first, np.cross(normal, first), normal]))


def _rapier(scene: Scene, steps: Steps) -> EngineRun:
    node, folder = shutil.which("node"), os.environ.get("RAPIER")
    if node is None or folder is None:
        raise OSError("Node, or RAPIER=.../node_modules in the environment, is missing")
    bodies, joints = read_scene(scene, "Rapier")
    if joints:
        raise SceneError("joints are not passed on to Rapier")
    data = {
        "gravity": np.asarray(scene.gravity, float).tolist(), "step": steps.step, "steps": steps.number, "each": steps.each,
        "sleeping": steps.sleeping, "iterations": 4,
        "bodies": [_body_data(body) for body in bodies],
    }  # fmt: skip
    script = Path(__file__).with_name("rapier.mjs")
    command = [node, str(script), str(Path(folder).resolve())]
    answer = subprocess.run(command, input=json.dumps(data), capture_output=True, text=True, check=False)
    if answer.returncode:
        raise OSError(f"Rapier: {answer.stderr.strip().splitlines()[-1] if answer.stderr.strip() else 'no answer'}")
    out = json.loads(answer.stdout)
    poses, speeds = np.array(out["poses"]), np.array(out["speeds"])
    return EngineRun(np.array(out["times"]), poses[..., :3], poses[..., 3:], speeds[:, :3], speeds[:, 3:])


def _body_data(entry: PeerBody) -> dict[str, Any]:
    body, m = entry.body, entry.mass
    dynamic = body.motion == "dynamic"
    out = {
        "dynamic": dynamic, "position": np.asarray(body.position, float).tolist(), "orientation": body.unit_orientation().tolist(),
        "velocity": np.asarray(body.velocity, float).tolist(), "spin": np.asarray(body.angular_velocity, float).tolist(),
        "friction": entry.friction, "restitution": entry.restitution, "parts": [_part_data(_as_box(part)) for part in entry.parts],
    }  # fmt: skip
    if dynamic:
        out |= {"mass": m.mass, "centre": m.center_of_mass.tolist(), "moments": m.moments.tolist(), "axes": from_matrix(m.axes).tolist()}
    return out


def _part_data(part: Part) -> dict[str, Any]:
    shape = part.shape
    out: dict[str, Any] = {"kind": shape.kind, "position": part.position.tolist(), "orientation": from_matrix(part.rotation).tolist()}
    if shape.kind == "sphere":
        return out | {"radius": shape.radius}
    if shape.kind == "box":
        return out | {"half": (0.5 * np.broadcast_to(np.asarray(shape.size, float), 3)).tolist()}
    if shape.kind == "mesh":
        return out | {"vertices": shape.surface().vertices.tolist()}
    raise SceneError(f"a {shape.kind} is not passed on to Rapier")


def _physx(scene: Scene, steps: Steps) -> EngineRun:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import sapien
        from sapien import physx

    config = physx.get_scene_config()
    config.gravity, config.enable_tgs, config.enable_pcm, config.bounce_threshold = np.asarray(scene.gravity, float), True, True, 0.0
    physx.set_scene_config(config)
    bodies, joints = read_scene(scene, "PhysX")
    if joints:
        raise SceneError("joints are not passed on to PhysX")
    system = physx.PhysxCpuSystem()
    world = sapien.Scene([system])
    world.set_timestep(steps.step)
    added = [_physx_body(sapien, physx, world, body) for body in bodies]
    times, position, orientation = [], [], []
    for k in range(steps.number):
        start = process_time()
        world.step()
        times.append(1e3 * (process_time() - start))
        if steps.is_frame(k):
            poses = [entity.pose for entity, _ in added]
            position.append([pose.p for pose in poses])
            orientation.append([pose.q for pose in poses])
    speeds = [(c.linear_velocity, c.angular_velocity) if c is not None else (np.zeros(3), np.zeros(3)) for _, c in added]
    velocity, spin = (np.array([speed[k] for speed in speeds]) for k in range(2))
    return EngineRun(np.array(times), np.array(position), np.array(orientation), velocity, spin)


def _physx_body(sapien: Any, physx: Any, world: Any, entry: PeerBody) -> tuple[Any, Any]:
    body, m = entry.body, entry.mass
    material = physx.PhysxMaterial(entry.friction, entry.friction, entry.restitution)
    dynamic = body.motion == "dynamic"
    component = physx.PhysxRigidDynamicComponent() if dynamic else physx.PhysxRigidStaticComponent()
    for part in entry.parts:
        placed = _as_box(part)
        shape = _physx_shape(physx, placed, material)
        shape.local_pose = sapien.Pose(placed.position, from_matrix(placed.rotation))
        component.attach(shape)
    if dynamic:
        component.mass, component.cmass_local_pose = m.mass, sapien.Pose(m.center_of_mass, from_matrix(m.axes))
        component.inertia = m.moments
        component.linear_damping = component.angular_damping = 0.0
        component.sleep_threshold = 0.0
        component.max_depenetration_velocity = 10.0
    entity = sapien.Entity()
    entity.add_component(component)
    entity.set_pose(sapien.Pose(np.asarray(body.position, float), body.unit_orientation()))
    world.add_entity(entity)
    if dynamic:
        component.set_linear_velocity(np.asarray(body.velocity, float))
        component.set_angular_velocity(np.asarray(body.angular_velocity, float))
    return entity, component if dynamic else None


def _physx_shape(physx: Any, part: Part, material: Any) -> Any:
    shape = part.shape
    if shape.kind == "sphere":
        return physx.PhysxCollisionShapeSphere(shape.radius, material)
    if shape.kind == "box":
        return physx.PhysxCollisionShapeBox(0.5 * np.broadcast_to(np.asarray(shape.size, float), 3), material)
    if shape.kind == "mesh":
        vertices = shape.surface().vertices.astype(np.float32)
        import tempfile

        import trimesh

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "hull.obj"
            trimesh.Trimesh(vertices, shape.surface().faces).export(path)
            return physx.PhysxCollisionShapeConvexMesh(str(path), np.ones(3), material)
    raise SceneError(f"a {shape.kind} is not passed on to PhysX")
