"""Flexible bodies: nets of springs and dampers, implicit steps, contact with rigid bodies. See docs/flexible.md."""

from rigidimpulse.flexible.body import FlexibleBody
from rigidimpulse.flexible.contact_planes import RigidMotion
from rigidimpulse.flexible.flexibles import Flexibles, FlexibleStep
from rigidimpulse.flexible.track import FlexibleTrack

__all__ = ["FlexibleBody", "FlexibleStep", "FlexibleTrack", "Flexibles", "RigidMotion"]
