"""Whether other programs show what a run has: .glb files in three.js and in Blender, USD files in usd-core and in Blender.

    python tests/bench/import_gltf.py [FOLDER]

FOLDER takes three.js (npm) and a virtual environment with bpy, Blender as a module (Python 3.11); without one they are there
for this run only. A program that cannot be installed is said to be missing and left out. For every body and every frame the
world matrix is compared with the recording:

    |x - x'| <= 1e-5 max(1 m, size) + d + v e,    |R^T R' - 1| / sqrt(2) <= 1e-5 + d / r + w e

size: the greatest coordinate of a body. d: the tolerance that keys were left out with, r = 0.1 m. e: one unit in the last place of
the last time, since files and programs have times in single precision (4e-6 s near frame 1001 at 24 fps). A body that is
turned about, or a frame off by one, is off by 1e-2 and more.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "browser"))
from chromium import chromium
from import_runs import Case, gltf_cases, usd_cases

TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Y up to Blender's Z up."""
Axes = Callable[[Case], tuple[np.ndarray, np.ndarray]]
POSE = 1e-5
ARM = 0.1
"""m, least distance from the origin at which a tolerance is a turn."""
ORIGIN = "http://import.test/"
PAGE = """<!doctype html><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}
</script><script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
window.play = async (url, names, times) => {
  const gltf = await new GLTFLoader().loadAsync(url);
  const mixer = new THREE.AnimationMixer(gltf.scene);
  for (const clip of gltf.animations) {
    const action = mixer.clipAction(clip);
    action.setLoop(THREE.LoopOnce);
    action.clampWhenFinished = true;
    action.play();
  }
  const nodes = gltf.parser.json.nodes;
  const objects = await Promise.all(names.map((name) => gltf.parser.getDependency('node', nodes.findIndex((node) => node.name === name))));
  return times.map((time) => {
    mixer.setTime(time);
    gltf.scene.updateMatrixWorld(true);
    return objects.map((object) => object.matrixWorld.elements.slice());
  });
};
</script>"""


def by_three(cases: list[Case], folder: Path) -> Iterator[np.ndarray]:
    """World matrices (n, f, 4, 4) of the bodies of each case in three.js, Y up."""
    types = {".js": "text/javascript", ".glb": "model/gltf-binary"}
    files = {f"/files/{case.path.name}": case.path for case in cases}

    def answer(route: Any) -> None:
        where = route.request.url[len(ORIGIN) - 1 :]
        if where == "/":
            route.fulfill(body=PAGE, content_type="text/html")
            return
        path = files.get(where) or folder / "node_modules" / where[1:]
        route.fulfill(body=path.read_bytes(), content_type=types[path.suffix])

    with chromium() as browser:
        page = browser.new_page()
        page.route("**/*", answer)
        page.goto(ORIGIN)
        page.wait_for_function("window.play !== undefined")
        for case in cases:
            times = (np.arange(len(case.run.times)) + case.start_frame) / case.fps
            given = [f"/files/{case.path.name}", list(case.bodies.values()), times.tolist()]
            found = np.array(page.evaluate("(given) => window.play(...given)", given))
            yield found.reshape(len(times), -1, 4, 4).transpose(1, 0, 3, 2)


def by_blender(cases: list[Case], python: Path, folder: Path) -> Iterator[np.ndarray]:
    """World matrices (n, f, 4, 4) of the bodies of each case in Blender, Z up."""
    script = Path(__file__).with_name("import_blender.py")
    for case in cases:
        job, answer = folder / "job.json", folder / "answer.npy"
        given = {"file": str(case.path), "fps": case.fps, "names": list(case.bodies.values()), "first": case.start_frame}
        job.write_text(json.dumps({**given, "frames": len(case.run.times), "answer": str(answer)}))
        done = subprocess.run([python, str(script), str(job)], check=False, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"Blender with {case.name}: {done.stdout[-1000:]} {done.stderr[-2000:]}")
        yield np.load(answer)


def by_pxr(cases: list[Case]) -> Iterator[np.ndarray]:
    """World matrices (n, f, 4, 4) of the bodies of each case in usd-core."""
    from pxr import Usd, UsdGeom

    for case in cases:
        stage = Usd.Stage.Open(str(case.path))
        unit = UsdGeom.GetStageMetersPerUnit(stage)
        prims = [stage.GetPrimAtPath(f"/World/{name}") for name in case.bodies.values()]
        found = np.zeros((len(case.bodies), len(case.run.times), 4, 4))
        for frame in range(len(case.run.times)):
            cache = UsdGeom.XformCache(case.start_frame + frame)
            for k, prim in enumerate(prims):
                found[k, frame] = np.array(cache.GetLocalToWorldTransform(prim)).T
        found[:, :, :3, 3] *= unit
        yield found


def as_they_are(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Axes of a program that turns nothing."""
    return np.eye(4), np.tile(np.eye(4), (len(case.bodies), 1, 1))


def gltf_in_blender(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Blender turns the world Z up and meshes with it; cameras look along -z as in glTF."""
    meshes = [np.eye(4) if name in case.cameras else TO_Z_UP.T for name in case.bodies]
    return TO_Z_UP, np.array(meshes)


def usd_in_blender(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Blender turns stages that are Y up, and no meshes."""
    assert case.run.scene is not None
    z_up = case.run.scene.gravity[2] < 0.0
    return np.eye(4) if z_up else TO_Z_UP, as_they_are(case)[1]


def off(case: Case, found: np.ndarray, wanted: np.ndarray) -> tuple[float, float, bool]:
    """Greatest distance [m] and angle [rad] over bodies and frames, and whether all are within the bounds."""
    size = max(1.0, float(np.abs(wanted[:, :, :3, 3]).max()))
    instant = float(np.spacing(np.float32((case.start_frame + len(case.run.times)) / case.fps)))
    ways, turns = case.speeds()
    far = np.linalg.norm(found[:, :, :3, 3] - wanted[:, :, :3, 3], axis=2)
    turned = found[:, :, :3, :3] @ np.linalg.inv(wanted[:, :, :3, :3]) - np.eye(3)
    angle = np.linalg.norm(turned, axis=(2, 3)) / np.sqrt(2.0)
    good = (far <= (POSE * size + case.tolerance + ways * instant)[:, None]).all()
    good &= (angle <= (POSE + case.tolerance / ARM + turns * instant)[:, None]).all()
    return float(far.max()), float(angle.max()), bool(good)


def install_three(folder: Path) -> bool:
    """Put three.js into a folder; False where that fails."""
    if (folder / "node_modules" / "three").is_dir():
        return True
    command = ["npm", "install", "--no-audit", "--no-fund", "--prefix", str(folder), "three"]
    return subprocess.run(command, check=False, stdout=subprocess.DEVNULL).returncode == 0


def install_blender(folder: Path) -> Path | None:
    """Make an environment with bpy in a folder and return its Python; None where that fails."""
    python = folder / "blender" / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder / "blender")], check=True)
    if subprocess.run([python, "-c", "import bpy"], check=False, capture_output=True).returncode == 0:
        return python
    done = subprocess.run([python, "-m", "pip", "install", "--quiet", "bpy"], check=False)
    return python if done.returncode == 0 else None


def table(program: str, cases: list[Case], found: Iterator[np.ndarray], axes: Axes) -> bool:
    """Print a line for each case and return whether all are good; `axes`: how the program turns the world, and the meshes of bodies."""
    fine = True
    for case, matrices in zip(cases, found, strict=True):
        world, meshes = axes(case)
        wanted = world @ case.wanted() @ meshes[:, None]
        far, angle, good = off(case, matrices, wanted)
        fine &= good
        count = f"{len(case.bodies)} x {len(case.run.times)}"
        print(f"{program:18} {case.name:26} {count:>10} {far:10.1e} m {angle:10.1e} rad  {'' if good else 'FAILS'}", flush=True)
    return fine


def main(folder: Path) -> int:
    """Write all files, open them in all programs and return 1 where one shows something else."""
    fine = True
    with tempfile.TemporaryDirectory() as place:
        files = Path(place)
        cases, stages = gltf_cases(files), usd_cases(files)
        print(f"{'program':18} {'run':26} {'bodies x frames':>10}")
        if install_three(folder):
            fine &= table("three.js", cases, by_three(cases, folder), as_they_are)
        else:
            print("three.js cannot be installed")
        fine &= table("usd-core", stages, by_pxr(stages), as_they_are)
        python = install_blender(folder)
        if python is None:
            print("bpy cannot be installed")
            return 0 if fine else 1
        fine &= table("Blender, glTF", cases, by_blender(cases, python, files), gltf_in_blender)
        fine &= table("Blender, USD", stages, by_blender(stages, python, files), usd_in_blender)
    return 0 if fine else 1


if __name__ == "__main__":
    if len(sys.argv) > 1:
        raise SystemExit(main(Path(sys.argv[1]).resolve()))
    with tempfile.TemporaryDirectory() as made:
        raise SystemExit(main(Path(made)))
