"""A joint of its own: a point of b stays on a straight wire that is fixed to a; b turns freely."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from rigidimpulse.scene.body import vector
from rigidimpulse.scene.joint import Anchors, Joint, PlacedBodies, Row, bounds
from rigidimpulse.scene.joint_coordinates import ALONG


@dataclass(frozen=True, eq=False)
class WireJoint(Joint):
    """A bead on a wire along `axis` through `anchor`; `lower` and `upper` bound its way, m."""

    anchor: ArrayLike
    axis: ArrayLike

    def points(self, _world: PlacedBodies) -> Anchors:
        """See `Joint`."""
        anchor = vector(self.anchor, "anchor", "m")
        return anchor, anchor, vector(self.axis, "axis", "")

    def rows(self, _distance: float) -> list[Row]:
        """See `Joint`."""
        return [Row(ALONG + 1), Row(ALONG + 2), *bounds(ALONG, self.lower, self.upper)]
