"""What this package provides to lower layers: file formats of recordings, scene files and checkpoints."""

from __future__ import annotations

from rigidimpulse.core.providers import provide
from rigidimpulse.recording.exporters import register_exporter, register_reader

ANIMATED = "an animated file"

register_exporter((".npz",), "rigidimpulse.io.npz:write_npz")
register_exporter((".csv",), "rigidimpulse.io.table:write_csv")
for suffixes, module in (((".glb", ".gltf"), "gltf"), ((".usda", ".usdc", ".usd", ".usdz"), "usd")):
    register_exporter(
        suffixes, f"rigidimpulse.io.{module}.animate:write_{module}", needs_shapes=ANIMATED, takes_options=True,
        check=f"rigidimpulse.io.{module}.animate:check_{module}",
    )  # fmt: skip
register_reader((".npz",), "rigidimpulse.io.npz:read_npz")
register_reader((".h5", ".hdf5"), "rigidimpulse.io.cache.load:load_cache")
provide("write scene", "rigidimpulse.io.scene_file:write_scene")
provide("later start", "rigidimpulse.io.cache.later:later_start")
provide("checkpoints", "rigidimpulse.io.cache.checkpointer:Checkpointer")
