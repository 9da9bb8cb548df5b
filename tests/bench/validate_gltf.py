"""What Khronos' glTF validator says of our exports: errors and warnings, of which there shall be none.

    npm install --prefix FOLDER gltf-validator
    python tests/bench/validate_gltf.py FOLDER

It does not know the extensions of physics, and says so as an information for each file.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import rigidimpulse as ri
from rigidimpulse import gallery

sys.path.insert(0, str(Path(__file__).parents[1] / "io"))
from broken_files import good_files
from test_gltf_motion import recorded, smooth
from test_gltf_round_trip import bodies, joints

SCRIPT = """
import { createRequire } from 'module'; import fs from 'fs';
const validator = createRequire(process.argv[1] + '/')('gltf-validator');
let bad = 0;
for (const file of process.argv.slice(2)) {
  const { issues } = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { maxIssues: 100 });
  console.log(`${issues.numErrors} errors, ${issues.numWarnings} warnings, ${issues.numInfos} infos: ${file.split('/').pop()}`);
  bad += issues.numErrors + issues.numWarnings;
  for (const issue of issues.messages.filter((entry) => entry.severity < 2)) console.log('   ', issue.code, issue.message, issue.pointer);
}
process.exit(bad ? 1 : 0);
"""


def write_files(folder: Path) -> list[Path]:
    """Write exports of every kind."""
    scene = ri.Scene(gravity=(0, 0, -9.81), bodies=bodies())
    for joint in joints():
        scene.add(joint)
    scene.add(ri.Trigger("gate", ri.Shape.compound([(ri.Shape.box(1.0), (0, 0, 1), (1, 0, 0, 0))])))
    files = [scene.export(folder / name) for name in ("scene.glb", "scene.gltf")]
    paths = {body.name: smooth(49, body.position) for body in scene.bodies if body.motion == "dynamic"}
    files.append(recorded(scene, paths).export(folder / "motion.glb"))
    files.append(recorded(scene, paths, spins={"ball": (0, 0, 90.0)}).export(folder / "spin.gltf", start_frame=1001, tolerance=1e-3))
    for number, file in enumerate(good_files()):
        loaded = ri.load_scene(file.save(folder / f"in{number}.glb"))
        # Players draw skinned meshes where their bones are: moving the node of one is a warning, and rightly so.
        moved = {body.name: smooth(9, body.position) for body in loaded.bodies if body.name != "arm"}
        files.append(recorded(loaded, moved).export(folder / f"out{number}.glb"))
    made = gallery.load("spot").scene()
    moved = {body.name: smooth(9, body.position) for body in made.bodies if body.motion == "dynamic"}
    files.append(recorded(made, moved).export(folder / "spot.glb"))
    return files


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        files = write_files(Path(folder))
        modules = Path(sys.argv[1]).resolve() / "node_modules"
        command = ["node", "--input-type=module", "-e", SCRIPT, str(modules), *map(str, files)]
        raise SystemExit(subprocess.run(command, check=False).returncode)
