"""Scenes of runs of `simulate_many`, and what is kept of them, as functions that worker processes find by name."""

from __future__ import annotations

import os
import signal

import rigidimpulse as ri


def balls() -> ri.Scene:
    """Two balls over a floor, which meet."""
    scene = ri.Scene()
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static"))
    bouncy = ri.Material(restitution=0.7, static_friction=0.3, dynamic_friction=0.3)
    scene.add(ri.Body("a", ri.Shape.sphere(0.1), position=(0, 0, 0.3), velocity=(1.0, 0, 0), material=bouncy))
    scene.add(ri.Body("b", ri.Shape.sphere(0.1), position=(0.5, 0.02, 0.3), velocity=(-1.0, 0, 0), material=bouncy))
    return scene


def fatal(deadly: int = 0) -> ri.Scene:
    """The same; its process dies if it is to, or the function fails."""
    if deadly == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if deadly == 2:
        raise RuntimeError("no such scene")
    return balls()


def hash_and_process(run: ri.Recording) -> tuple[str, int]:
    """The bits of a run, and the process that ran it."""
    return run.state_hash(), os.getpid()
