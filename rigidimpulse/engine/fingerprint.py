"""A fingerprint of a scene and the library: a short text, equal for equal ones, else different. Kept results are found by it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from rigidimpulse.core.content_digest import feed
from rigidimpulse.core.kernel_cache import source_digest
from rigidimpulse.core.version import VERSION
from rigidimpulse.engine import simulate as simulation
from rigidimpulse.scene.scene import Scene


def fingerprint(scene: Scene, *more: object) -> str:
    """Hash of the bodies, effects and gravity of a scene, of whatever else is given, and of the library's version and sources.

    Functions that a scene has count by their code, defaults and enclosed values, not by globals that they use.
    """
    digest = hashlib.sha256()
    for part in (VERSION, source_digest(Path(simulation.__file__)), scene.gravity, *scene.bodies, *scene.effects, *more):
        feed(digest, part)
    return digest.hexdigest()[:16]
