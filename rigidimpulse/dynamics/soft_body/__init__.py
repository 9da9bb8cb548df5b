"""Flexible bodies: point masses with springs and dampers, implicit steps, contact with rigid bodies. See docs/guide/flexible_bodies.md."""

from rigidimpulse.dynamics.soft_body.body import FlexibleBody
from rigidimpulse.dynamics.soft_body.contact_planes import RigidMotion
from rigidimpulse.dynamics.soft_body.soft_bodies import Flexibles, FlexibleStep
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack

__all__ = ["FlexibleBody", "FlexibleStep", "FlexibleTrack", "Flexibles", "RigidMotion"]
