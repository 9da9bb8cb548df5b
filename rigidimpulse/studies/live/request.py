"""What the process that computes is asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigidimpulse.scene.scene import Scene


@dataclass(frozen=True)
class Throw:
    """A body's velocity (3,) m/s is set at a time [s]."""

    body: str
    time: float
    velocity: tuple[float, float, float]


@dataclass(frozen=True)
class Source:
    """What is run: a name or file as `rigidimpulse simulate` takes it, or a scene that is made already, with the controls of its function.

    Attributes:
        name: what the page calls it.
        settings: duration, fps and accuracy that were asked for, in the place of those of the scene.

    """

    name: str
    file: str = ""
    scene: Scene | None = None
    controls: tuple[Any, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Request:
    """A run: its number, what is run, the values that were chosen on the page, and the throws."""

    number: int
    source: Source
    values: dict[str, Any]
    throws: tuple[Throw, ...] = ()
