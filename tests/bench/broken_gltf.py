"""Broken glTF files by the thousand: every one ends in a `SceneError` or in a scene, at once.

    python tests/bench/broken_gltf.py [NUMBER]      2,000 by default; takes half a minute
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

if __name__ == "__main__":
    number = sys.argv[1] if len(sys.argv) > 1 else "2000"
    tests = Path(__file__).parents[1] / "io" / "test_gltf_broken.py"
    command = [sys.executable, "-m", "pytest", "-q", str(tests), "-k", "refused_or_read"]
    raise SystemExit(subprocess.run(command, env={**os.environ, "BROKEN_FILES": number}, check=False).returncode)
