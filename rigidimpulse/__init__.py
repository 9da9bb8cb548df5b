"""Rigid bodies that collide exactly: mesh scenes in, accurate motion for animation out.

The first hour needs five names: `Scene`, `Body`, `Shape`, `Material` and `simulate`.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

# Public names and their homes: imported when used, so that `import rigidimpulse` and `--help` stay quick.
_HOMES = {
    "Accuracy": "accuracy",
    "BallJoint": "constrain.joint",
    "Body": "body",
    "Cache": "io.cache.keeper",
    "CollisionFilter": "collision_filter",
    "ConstantForce": "forces.constant",
    "Curvature": "forces.energy.path",
    "DistanceJoint": "constrain.joint",
    "Drive": "constrain.six_axis",
    "Drag": "forces.drag",
    "EnergyForce": "forces.energy.force",
    "FixedJoint": "constrain.joint",
    "FlexibleBody": "flexible.body",
    "ForceField": "forces.field",
    "GravityPotential": "forces.energy.potential",
    "HarmonicForce": "forces.harmonic",
    "HingeJoint": "constrain.joint",
    "InTime": "studies.wishes",
    "Keyframes": "keyframes",
    "Limit": "constrain.six_axis",
    "Material": "material",
    "Motor": "constrain.joint",
    "NoOverlap": "forces.energy.overlap",
    "PointAttractor": "forces.field",
    "PDController": "forces.pd",
    "PinFrame": "forces.energy.path",
    "PinPoints": "forces.energy.pin",
    "PointOnSurface": "forces.energy.surface",
    "Recording": "recording",
    "RestoreShape": "forces.energy.restore",
    "SampledForce": "forces.sampled",
    "Scene": "scene",
    "SceneError": "errors",
    "Shape": "shape",
    "SixAxisJoint": "constrain.six_axis",
    "SliderJoint": "constrain.joint",
    "Spring": "forces.spring",
    "StayNear": "forces.energy.path",
    "Thruster": "forces.thruster",
    "Trigger": "observe.trigger",
    "Velocity": "forces.energy.path",
    "Within": "studies.wishes",
    "compare": "studies.compare",
    "compile_scene": "world",
    "contains": "detect.inside",
    "load_recording": "recording",
    "load_scene": "io.scene_file",
    "settle": "forces.energy.layout",
    "simulate": "simulation",
    "smooth_path": "forces.energy.path",
    "study": "studies.work_precision",
    "wedge": "studies.wedges.wedge",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'rigidimpulse' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"rigidimpulse.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
