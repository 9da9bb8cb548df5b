"""What newcomers' scenes call is among the kernels that `rigidimpulse warmup` compiles.

After it a door on a hinge compiled for 25 s more, bowling for 36: contacts of bodies with joints, and of capsules in sub-stepped islands,
were in no part.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCENES = (
    "door", "newtons_cradle", "ragdoll_on_stairs", "bowling", "six_machines", "domino_spiral", "brick_wall_hit", "crane", "stones",
    "cow_on_table",
)  # fmt: skip
SMALL = {
    "core.quaternion.quaternion_to_matrix", "dynamics.constraints.joint_flight.length_that_follows",
    "engine.pair_table.sweep_pairs_again",
}  # fmt: skip
"""Kernels that take less than a second to compile."""
PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
import rigidimpulse as ri
from rigidimpulse.core.kernels import KERNELS
from rigidimpulse.engine.warm_up import LOOP
from rigidimpulse.engine.warm_up_parts import PARTS, compile_part
from scenes import CORPUS

for kind in PARTS:
    for part in range(len(PARTS[kind]) if kind != LOOP else 0):
        compile_part(kind, part)
ahead = {{kernel.name: set(kernel.entry.overloads) for kernel in KERNELS}}
for name in {scenes!r}:
    for accuracy in ("standard", "preview"):
        stage, _ = CORPUS[name].make()
        ri.simulate(stage.scene, 0.4, accuracy=accuracy)
print(*[kernel.name for kernel in KERNELS if set(kernel.entry.overloads) - ahead[kernel.name]])
"""


def test_nothing_of_weight_is_left_to_compile_after_a_warm_up() -> None:
    """The order of events is compiled in the background: runs go without it."""
    folder = str(Path(__file__).parent)
    program = PROGRAM.format(folder=folder, scenes=SCENES)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) - SMALL <= {"engine.exact.event_loop.run_events"}
