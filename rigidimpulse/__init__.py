"""Rigid bodies that collide exactly: mesh scenes in, accurate motion for animation out.

The first hour needs five names: `Scene`, `Body`, `Shape`, `Material` and `simulate`.
"""

from __future__ import annotations

import importlib
from typing import Any

from rigidimpulse.core.version import VERSION

__version__ = VERSION

# Public names and their homes: imported when used, so that `import rigidimpulse` and `--help` stay quick.
_HOMES = {
    "Accuracy": "scene.accuracy",
    "BallJoint": "scene.joint",
    "Body": "scene.body",
    "Cache": "recording.cache",
    "CollisionFilter": "scene.collision_filter",
    "ConstantForce": "dynamics.forces.constant",
    "Curvature": "dynamics.forces.energy.path",
    "DistanceJoint": "scene.joint",
    "Drive": "scene.joint_six_axis",
    "Drag": "dynamics.forces.drag",
    "EnergyForce": "dynamics.forces.energy.force",
    "FinalState": "studies.many",
    "FixedJoint": "scene.joint",
    "FlexibleBody": "dynamics.soft_body.body",
    "ForceField": "dynamics.forces.field",
    "GravityPotential": "dynamics.forces.energy.potential",
    "HarmonicForce": "dynamics.forces.harmonic",
    "HingeJoint": "scene.joint",
    "InTime": "scene.accuracy_targets",
    "Keyframes": "scene.keyframes",
    "Limit": "scene.joint_six_axis",
    "Material": "scene.material",
    "Motor": "scene.joint",
    "NoOverlap": "dynamics.forces.energy.overlap",
    "PointAttractor": "dynamics.forces.field",
    "PDController": "dynamics.forces.pd",
    "PinFrame": "dynamics.forces.energy.path",
    "PinPoints": "dynamics.forces.energy.pin",
    "PointOnSurface": "dynamics.forces.energy.surface",
    "Recording": "recording.recording",
    "RestoreShape": "dynamics.forces.energy.restore",
    "SampledForce": "dynamics.forces.sampled",
    "Scene": "scene.scene",
    "SceneError": "core.errors",
    "Shape": "scene.shape",
    "SixAxisJoint": "scene.joint_six_axis",
    "SliderJoint": "scene.joint",
    "Spring": "dynamics.forces.spring",
    "StayNear": "dynamics.forces.energy.path",
    "Thruster": "dynamics.forces.thruster",
    "Trigger": "engine.triggers",
    "VariedRun": "studies.many",
    "Velocity": "dynamics.forces.energy.path",
    "Visual": "scene.visual",
    "Within": "scene.accuracy_targets",
    "Workers": "studies.wedges.workers",
    "compare": "studies.compare",
    "compile_scene": "engine.compile_scene",
    "contains": "collision.containment",
    "live": "studies.live.session",
    "glance": "studies.glance.glance",
    "load_recording": "recording.recording",
    "load_scene": "io.scene_file",
    "settle": "engine.settle",
    "simulate": "engine.simulate",
    "simulate_many": "studies.many",
    "smooth_path": "dynamics.forces.energy.path",
    "study": "studies.work_precision",
    "wedge": "studies.wedges.wedge",
}

__all__ = sorted(_HOMES)

for _package in ("io", "view", "studies"):
    importlib.import_module(f"rigidimpulse.{_package}.registration")


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'rigidimpulse' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"rigidimpulse.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
