"""What a scene keeps of the file that it was read from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigidimpulse.scene.body import Body


@dataclass(frozen=True)
class FileOrigin:
    """A file and what became of it.

    Attributes:
        report: lines about what is not in the scene, or not as the file says.

    """

    report: tuple[str, ...]

    def check_target(self, path: Path) -> None:
        """Raise a `SceneError` where motion cannot be written to a path for the sake of this file: by default never."""

    def as_seen(self, bodies: list[Body]) -> list[Body]:
        """Return bodies with what the file shows of them as their visuals, where its reader leaves that until it is drawn."""
        return bodies


def bodies_as_seen(scene: Any) -> list[Body]:
    """Return the bodies of a scene as they are drawn: what its file shows of them is their visual, unless they have one."""
    origin = getattr(scene, "origin", None)
    return list(scene.bodies) if origin is None else origin.as_seen(list(scene.bodies))
