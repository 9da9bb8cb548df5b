"""What the viewer reads: any object with these members can be shown, a `Recording` above all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class SceneLike(Protocol):
    """The scene that was simulated."""

    gravity: Any

    @property
    def bodies(self) -> Sequence[Any]:
        """The bodies (name, shape, motion, material), in the order in which impacts count them."""
        ...


class SoftBodyLike(Protocol):
    """Frames of a flexible body."""

    @property
    def name(self) -> str:
        """Of the body."""
        ...

    @property
    def vertices(self) -> FloatArray:
        """Vertices (f, v, 3), m, world."""
        ...

    @property
    def faces(self) -> npt.NDArray[np.integer]:
        """Triangles (t, 3)."""
        ...


class RecordingLike(Protocol):
    """A simulated motion: f frames of every body, and the impacts between them."""

    @property
    def status(self) -> Any:
        """How the run went, a `Status`."""
        ...

    @property
    def times(self) -> FloatArray:
        """Frame times (f,), s, rising."""
        ...

    @property
    def scene(self) -> Any:
        """The scene, a `SceneLike`."""
        ...

    @property
    def impacts(self) -> npt.NDArray[Any]:
        """Structured array of `recording.events.IMPACT_DTYPE`."""
        ...

    @property
    def soft_bodies(self) -> Sequence[SoftBodyLike]:
        """The flexible bodies."""
        ...

    @property
    def contacts(self) -> npt.NDArray[Any]:
        """Structured array of lasting contacts: start, end, body_a, body_b, point, normal, force; may be empty."""
        ...

    @property
    def ledger(self) -> Any:
        """Energy and momentum at each frame, a `Ledger`; None where it is not known."""
        ...

    def center_of_mass(self, name: str, /) -> FloatArray:
        """Centre of mass (f, 3), m, world."""
        ...

    def position(self, name: str, /) -> FloatArray:
        """Body origin (f, 3), m, world."""
        ...

    def orientation(self, name: str, /) -> FloatArray:
        """Body frame (f, 4), unit quaternions (w, x, y, z), body to world."""
        ...
