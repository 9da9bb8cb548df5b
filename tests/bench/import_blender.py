"""Run by Blender's Python (bpy): opens a file and writes the world matrices of its objects at every frame.

    python import_blender.py JOB.json

JOB has `file`, `fps`, `names` of objects, `first` frame, number of `frames`, and `answer`: a .npy file of (n, f, 4, 4).
"""

from __future__ import annotations

import json
import sys
from fractions import Fraction
from pathlib import Path

import bpy
import numpy as np

job = json.loads(Path(sys.argv[1]).read_text())
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
fps = Fraction(job["fps"]).limit_denominator(1001)
scene.render.fps, scene.render.fps_base = fps.numerator, fps.denominator
if Path(job["file"]).suffix == ".glb":
    bpy.ops.import_scene.gltf(filepath=job["file"])
else:
    bpy.ops.wm.usd_import(filepath=job["file"])
objects = [bpy.data.objects[name] for name in job["names"]]
found = np.zeros((len(objects), job["frames"], 4, 4))
for frame in range(job["frames"]):
    scene.frame_set(int(job["first"]) + frame)
    for k, item in enumerate(objects):
        found[k, frame] = np.array(item.matrix_world)
np.save(job["answer"], found)
