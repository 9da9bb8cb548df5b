"""Random life cycles: scenes whose joints break, are released, reach limits and share bodies, in contact, asleep, in both regimes.

A scene has a floor, maybe a pile, and one to three assemblies above it: chains, hinged planks, held bodies. `is_broken` says from
outside what a run of it must not do.
"""

from __future__ import annotations

import numpy as np
from scene_plans import Source

import rigidimpulse as ri
from rigidimpulse.core.quaternion import rotate

ENERGY = 1e-2
"""Of the energy moved, that a run may gain: joints are of second order, and these scenes are short."""
OPEN = 1e-4
"""m, how far the ends of a whole ball joint, hinge or fixed joint may be apart."""
LATE = 1e-9
"""s, how late a joint may let go."""
CLOSED = (ri.BallJoint, ri.HingeJoint, ri.FixedJoint)
JOINTS = (*CLOSED, ri.SliderJoint, ri.DistanceJoint)


def make_life_cycle(dice: Source) -> ri.Scene:
    """The scene that the dice choose."""
    scene = ri.Scene()
    material = ri.Material(restitution=dice.pick((0.0, 0.3)), static_friction=0.5, dynamic_friction=0.4)
    scene.add(ri.Body("floor", ri.Shape.half_space(), motion="static", material=material))
    for k in range(dice.pick((0, 0, 4, 12))):
        # A pile that may be sub-stepped, below what falls.
        place = (0.21 * (k % 3) - 0.21, 0.21 * (k // 3 % 2), 0.1001 + 0.2002 * (k // 6))
        scene.add(ri.Body(f"crate {k}", ri.Shape.box((0.2, 0.2, 0.2)), position=place, mass=1.0, material=material))
    for k in range(dice.integer(1, 3)):
        dice.pick((_chain, _plank, _held))(scene, dice, k, material)
    return scene


def _ends(dice: Source) -> dict[str, float]:
    """How a joint ends: never, at a time, by a force, or by the first of both."""
    ends = {}
    if dice.integer(0, 1):
        ends["release_time"] = dice.pick((0.0, 0.1, 1.0 / 60.0, dice.real(0.0, 0.5)))
    if dice.integer(0, 1):
        ends["break_force"] = 10.0 ** dice.real(-1.0, 3.0)
    return ends


def _shape(dice: Source) -> ri.Shape:
    return dice.pick((ri.Shape.box((0.1, 0.12, 0.14)), ri.Shape.sphere(0.07), ri.Shape.capsule(0.05, 0.1), ri.Shape.cylinder(0.06, 0.1)))


def _chain(scene: ri.Scene, dice: Source, k: int, material: ri.Material) -> None:
    """Two to four bodies in a row, the first one of which may hang on the world."""
    before, x = None, -0.5
    for n in range(dice.integer(2, 4)):
        name, place = f"chain {k} {n}", np.array([x + 0.25 * n, 0.4 * k - 0.4, 1.2])
        scene.add(ri.Body(name, _shape(dice), position=place, mass=10.0 ** dice.real(-1.0, 1.0), material=material))
        if before is not None or dice.integer(0, 1):
            middle = place - [0.125, 0.0, 0.0]
            kind = dice.pick((ri.BallJoint, ri.HingeJoint, ri.SliderJoint, ri.FixedJoint))
            axis = {} if kind in (ri.FixedJoint, ri.BallJoint) else {"axis": dice.pick(((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))}
            limits = {"lower": -0.1, "upper": 0.1} if axis and dice.integer(0, 1) else {}
            scene.add(kind(before, name, anchor=middle, **axis, **limits, **_ends(dice)))
        before = name


def _plank(scene: ri.Scene, dice: Source, k: int, material: ri.Material) -> None:
    """A plank on a hinge, with a limit or without, and a body that is held above it."""
    y = 0.4 * k - 0.4
    scene.add(ri.Body(f"plank {k}", ri.Shape.box((0.8, 0.2, 0.04)), position=(0.0, y, 0.7), material=material))
    limits = dice.pick(({}, {"lower": -0.3, "upper": 0.2}))
    scene.add(
        ri.HingeJoint(f"plank {k}", None, (0.0, y, 0.7), (0.0, 1.0, 0.0), **limits, **(_ends(dice) if dice.integer(0, 3) == 0 else {}))
    )
    scene.add(ri.Body(f"above {k}", _shape(dice), position=(dice.real(-0.3, 0.3), y, dice.real(0.9, 1.1)), material=material))
    scene.add(ri.FixedJoint(f"above {k}", dice.pick((None, f"plank {k}")), **_ends(dice)))


def _held(scene: ri.Scene, dice: Source, k: int, material: ri.Material) -> None:
    """Two bodies that a joint holds together, one of which another joint holds in the world."""
    y = 0.4 * k - 0.4
    scene.add(ri.Body(f"upper {k}", _shape(dice), position=(0.1, y, 1.6), material=material))
    scene.add(ri.Body(f"lower {k}", _shape(dice), position=(0.1, y, 1.4), material=material))
    scene.add(ri.FixedJoint(f"upper {k}", None, **_ends(dice)))
    scene.add(ri.DistanceJoint(f"upper {k}", f"lower {k}", (0.1, y, 1.6), (0.1, y, 1.4), **_ends(dice)))


def broken_promises(run: ri.Recording) -> list[str]:
    """One line for each thing that a run of a life cycle does and must not."""
    if not all(np.all(np.isfinite(a)) for a in (run.positions, run.orientations, run.velocities, run.angular_velocities)):
        return ["numbers are not finite"]
    lines, ledger = [], run.ledger
    assert ledger is not None
    total, moved = ledger.kinetic + ledger.potential, float(ledger.kinetic.max() + np.ptp(ledger.potential))
    rise = float((total - np.minimum.accumulate(total)).max())
    if rise > ENERGY * moved + 1e-3:
        lines.append(f"energy grows by {rise:.1e} J of {moved:.1e} J")
    lowest = run.positions[:, 1:, 2].min()
    if lowest < 0.01:
        lines.append(f"a body is in the floor: {lowest:.3f} m")
    ended = {e.message.split(":")[0]: e.time for e in run.status.events if e.kind in ("joint let go", "joint broke")}
    joints = [effect for effect in run.scene.effects if isinstance(effect, JOINTS)]
    for j, joint in enumerate(joints):
        end = ended.get(f"joint{j}", np.inf)
        if joint.release_time < run.times[-1] and end > joint.release_time + LATE:
            lines.append(f"joint{j} lets go at {end:.4f} s, not at {joint.release_time:.4f} s")
        if isinstance(joint, CLOSED) and getattr(joint, "anchor", None) is not None:
            anchor = np.asarray(joint.anchor, float)
            apart = np.linalg.norm(_carried(run, joint.a, anchor) - _carried(run, joint.b, anchor), axis=1)[run.times < end]
            if len(apart) and apart.max() > OPEN:
                lines.append(f"joint{j} is open by {apart.max():.1e} m")
    return lines


def _carried(run: ri.Recording, name: str | None, point: np.ndarray) -> np.ndarray:
    """Where a point (3,) of the world at the start, fixed to a body, is at all frames (f, 3), m."""
    if name is None:
        return np.tile(point, (len(run.times), 1))
    turns, places = run.orientation(name), run.position(name)
    inverse = turns[0] * [1.0, -1.0, -1.0, -1.0]
    return places + rotate(turns, np.tile(rotate(inverse[None], (point - places[0])[None])[0], (len(places), 1)))
