"""Copies the kernels that an installed package has compiled to a folder, as they lie in wheels: `python collect_kernels.py FOLDER`.

Run it with the Python of the environment, and with the variables under which the kernels were compiled.
"""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numba

from rigidimpulse.core.kernel_cache import CLAIM, kernel_folder
from rigidimpulse.core.kernel_places import PACKAGE
from rigidimpulse.core.ready_kernels import ABOUT, Fit


def main(target: Path) -> None:
    """Copy, and write what the kernels fit."""
    config: Any = vars(numba)["config"]
    for module in sorted(PACKAGE.rglob("*.py")):
        folder = kernel_folder(module, config.CACHE_DIR)
        files = [file for file in folder.rglob("*") if file.is_file() and file.suffix != CLAIM]
        place = target / module.relative_to(PACKAGE).with_suffix("") / folder.name
        for file in files:
            place.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, place / file.name)
    fit = Fit.here(config.CPU_NAME, config.CPU_FEATURES)
    (target / ABOUT).write_text(json.dumps(asdict(fit), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
