"""Random scenes of which something changes from a frame on, and what a run that goes on from there must keep.

Frames before are those of the first run. Where nothing changes, or only a body far away, bodies that fly, rest or are in exact contact have
the same bits to the end. Energy that the change makes is in the ledger: what is there and what went away add up to the same at all frames.
The cache gives the run back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scene_laws import broken_laws
from scene_plans import ScenePlan, Source, make_plan, make_scene

import rigidimpulse as ri

CHANGES = ("nothing", "far away", "gravity", "mass", "restitution", "friction", "one less")
"""The simplest first."""
FPS = 60.0
PARTS = ("position", "orientation", "velocity", "angular_velocity")
ROUND_OFF = 1e-8
"""Of the largest energy, by which the books may be off after 10^4 events."""


@dataclass(frozen=True)
class LateChange:
    """A scene, the part of its frames after which it changes, what changes, and of which body."""

    plan: ScenePlan
    part: float
    change: str
    body: int


def make_late_change(source: Source) -> LateChange:
    """Choose a scene and its change."""
    plan = make_plan(source)
    change = source.pick(CHANGES if len(plan.bodies) > 2 and not plan.joints else CHANGES[:-1])
    return LateChange(plan, source.real(0.1, 0.9), change, source.integer(0, len(plan.bodies) - 1))


def changed_plan(case: LateChange) -> ScenePlan:
    """The scene from the frame on."""
    plan, k = case.plan, case.body
    body = plan.bodies[k]
    if case.change == "gravity":
        return replace(plan, gravity=(0.5, 0.0, -4.0))
    if case.change == "one less":
        return replace(plan, bodies=plan.bodies[:-1])
    others = {"mass": {"mass": 2.0 * body.mass}, "restitution": {"restitution": 0.4}, "friction": {"friction": (0.4, 0.4)}}
    return replace(plan, bodies=(*plan.bodies[:k], replace(body, **others.get(case.change, {})), *plan.bodies[k + 1 :]))


def broken_promises_later(case: LateChange, folder: Path) -> list[str]:
    """What the run that goes on breaks, a line each."""
    path, plan = folder / "run.h5", case.plan
    first = ri.simulate(make_scene(plan), plan.duration, FPS, cache=ri.Cache(path, every=0.0))
    frame = max(1, int(case.part * len(first.times)))
    scene = make_scene(changed_plan(case))
    if case.change == "far away":
        scene.add(ri.Body("far", ri.Shape.sphere(0.1), position=(0.0, 0.0, 1e4)))
    later = ri.simulate(scene, plan.duration, FPS, cache=path, from_frame=frame)
    both = [name for name in later.names if name in first.names]
    broken = [f"{name}: other frames before" for name in both if not _equal(first, later, name, frame)]
    if ri.load_recording(path).state_hash() != later.state_hash():
        broken.append("the cache has other bits")
    books = later.ledger.total + sum(later.ledger.dissipated.values())
    if not np.allclose(books, books[0], rtol=0.0, atol=ROUND_OFF * max(float(np.abs(later.ledger.total).max()), 1e-9)):
        broken.append(f"the ledger is off by {float(np.abs(books - books[0]).max()):.1e} J")
    if case.change == "nothing":
        broken += [law for law in broken_laws(plan, later) if later.status.ok or not law.startswith("overlap")]
    if case.change in ("nothing", "far away") and not plan.joints and not any(plan.force) and not _substepped(first):
        broken += [f"{name}: other frames after" for name in both if not _equal(first, later, name, len(first.times))]
    return broken


def _equal(first: ri.Recording, later: ri.Recording, name: str, end: int) -> bool:
    """Whether a body has the same bits at all frames before `end`."""
    return all(np.array_equal(getattr(first, part)(name)[:end], getattr(later, part)(name)[:end]) for part in PARTS)


def _substepped(run: ri.SimulatedRecording) -> bool:
    return any(line.counts.get("steps", 0) > 0 for line in run.plan.lines if line.name == "sub-stepped islands")
