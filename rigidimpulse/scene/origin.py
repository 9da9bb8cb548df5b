"""What a scene keeps of the file that it was read from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class FileOrigin:
    """A file and what became of it.

    Attributes:
        report: lines about what is not in the scene, or not as the file says.

    """

    report: tuple[str, ...]

    def check_target(self, path: Path) -> None:
        """Raise a `SceneError` where motion cannot be written to a path for the sake of this file: by default never."""
