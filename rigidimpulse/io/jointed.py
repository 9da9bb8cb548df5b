"""Bodies that touch where a joint holds them.

Bodies whose surfaces meet where a joint holds them together touch there for ever: a contact that the joint says already, at
a point where no force of it can be told from the joint's. Such bodies do not collide, also where their file wants it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigidimpulse.collision.distance.fcl import Narrowphase
from rigidimpulse.collision.geometry import compile_shape
from rigidimpulse.engine.triggers import extent
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.joint_six_axis import AXES, Limit
from rigidimpulse.scene.shape import Shape

NEAR = 1e-3
"""Distance of a joint from a surface, relative to the size of the body, at which it is on it: figures of files are rounded."""


def touch_at_joint(
    name: str, a: str | None, b: str | None, bodies: Mapping[str, Body], limits: Sequence[Limit], anchor: np.ndarray, notes: list[str]
) -> bool:
    """Return whether two bodies touch at the place of a joint that holds them there, and note it.

    Args:
        name: of the joint. a, b: names of the bodies, None for the world. bodies: by name. limits: of the joint.
        anchor: (3,) m, its place in the world. notes: where the line of the report goes.

    """
    if a is None or b is None or not _holds_place(limits) or not all(_is_on(bodies[k], anchor) for k in (a, b)):
        return False
    notes.append(f"bodies {a!r} and {b!r} touch at joint {name!r} itself: they do not collide")
    return True


def _holds_place(limits: Sequence[Limit]) -> bool:
    """Whether limits lock all translations, hard."""
    locked = "".join(limit.translation for limit in limits if limit.lower == limit.upper == 0.0 and limit.stiffness is None)
    return set(locked) == set(AXES)


def _is_on(body: Body, point: np.ndarray) -> bool:
    """Whether a point (3,) of the world lies in a body or on it."""
    probe = Shape.sphere(NEAR * extent(body.shape))
    shapes = [compile_shape(shape, np.zeros(3), np.eye(3)) for shape in (body.shape, probe)]
    pose = np.asarray(body.position, float), body.unit_orientation()
    return bool(Narrowphase(shapes).overlap(0, pose, 1, (point, np.array([1.0, 0.0, 0.0, 0.0]))))
