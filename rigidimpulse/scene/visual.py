"""What is seen of a body, where that is not its shape in a colour that the library chooses. It takes no part in the motion."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.colors import hex_of
from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.shape import Shape

HEX = re.compile(r"#[0-9a-fA-F]{6}")


@dataclass(frozen=True, eq=False)
class Visual:
    """What is seen of a body: on the page, in pictures, and in .glb and .usd files. Values are checked when the scene is compiled.

    Attributes:
        color: "#rrggbb", or three numbers (r, g, b) in [0, 1], as people see them (sRGB). None: the colours of the shape, if it has some
            (see `Shape.mesh` and `Shape.from_file`), else one that the library chooses.
        shape: what is drawn, in the body's frame, instead of the body's own shape. It does not collide. None: the body's own shape.

    """

    color: str | Sequence[float] | None = None
    shape: Shape | None = None

    def hex_color(self) -> str | None:
        """Return the colour as "#rrggbb", None if there is none."""
        if self.color is None or isinstance(self.color, str):
            return None if self.color is None else self.color.lower()
        return hex_of(self.color)

    def check(self) -> None:
        """Raise a `SceneError` for a value that makes no sense."""
        if self.shape is not None:
            if not isinstance(self.shape, Shape):
                raise SceneError(f"visual shape is a {type(self.shape).__name__}", "give a Shape, such as Shape.from_file")
            self.shape.check()
            if any(part.shape.kind == "half_space" for part in self.shape.parts_flat()):
                raise SceneError("visual shape is a half space, which has no surface to draw", "give another shape")
        if self.color is None:
            return
        if isinstance(self.color, str):
            good = HEX.fullmatch(self.color) is not None
        else:
            try:
                numbers = np.asarray(self.color, float)
            except (TypeError, ValueError):
                numbers = np.zeros(0)
            good = numbers.shape == (3,) and bool(np.all((numbers >= 0.0) & (numbers <= 1.0)))
        if not good:
            raise SceneError(f"visual color is {self.color!r}", 'give "#rrggbb", or (r, g, b) with numbers from 0 to 1')
