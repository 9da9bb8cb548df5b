"""All effects of a run: when a scene calls for each of them, and in which verbs of a step it takes part.

The functions that do the work are in the modules of the verbs. `all_effects` gives the effects in the order of the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigidimpulse.dynamics.forces import KINDS
from rigidimpulse.engine.exact.contact_forces import hold
from rigidimpulse.engine.exact.impacts import REASONS as RESPONSES
from rigidimpulse.engine.exact.impacts import respond
from rigidimpulse.engine.exact.trajectories import begin_trajectories
from rigidimpulse.engine.impact_time import REASONS as IMPACT_TIMES
from rigidimpulse.engine.impact_time import sweep_with
from rigidimpulse.engine.loads import add_gyroscopic_term, keep_steady_load, set_steady_load
from rigidimpulse.engine.narrow_phase import FCL, mesh_bodies, why_not_fcl
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.regime import MANY, only_expensive, why_not_substepped
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.spheres.effect import BALL, kinds, why_not
from rigidimpulse.model.effect import Bound, Effect, Skip
from rigidimpulse.model.island import Island
from rigidimpulse.model.world import World


def find_pairs(run: Run, pair_events: PairEvents) -> None:
    """Which islands are sub-stepped in the step, and which pairs may meet in it."""
    run.substepped.choose(run, pair_events)
    pair_events.find_pairs()


@dataclass(frozen=True)
class BroadPhase:
    """Pairs of overlapping swept boxes; manifolds are looked for among them."""

    stage: str = "detect"
    name: str = "contact detection"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a dynamic body may meet another."""
        if not world.can_collide:
            springs = world.accuracy.response == "penalty"
            return Skip(world.why_no_impacts if springs else "a dynamic body and another are needed for contact")
        return Bound(f"{world.num_bodies} bodies may touch", {"pairs": find_pairs})


@dataclass(frozen=True)
class FclNarrowPhase:
    """FCL's contacts and gaps of meshes; the narrow phase of a run calls it."""

    stage: str = "detect"
    name: str = FCL

    def bind(self, world: World) -> Bound | Skip:
        """Included where the accuracy asks for it and two meshes may meet."""
        reason = why_not_fcl(world)
        if reason:
            return Skip(reason)
        meshes, others = int(np.count_nonzero(mesh_bodies(world))), int(np.count_nonzero(~mesh_bodies(world)))
        elsewhere = ["where surfaces meet"]
        elsewhere += [f"at pairs with the {others} other bodies"] if others else []
        elsewhere += [] if why_not_substepped(world) else ["in sub-stepped islands"]
        return Bound(f"fcl: contacts and gaps of {meshes} meshes with each other; own manifolds {', '.join(elsewhere)}")


@dataclass(frozen=True)
class ImpactResponse:
    """Impulses at impacts."""

    stage: str = "respond"
    name: str = "impulses"

    def bind(self, world: World) -> Bound | Skip:
        """Included where something can collide."""
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        method = world.accuracy.response
        return Bound(f"{method}: {RESPONSES[method]}", {"impacts": respond})


@dataclass(frozen=True)
class Gravity:
    """Uniform gravity; it is in all trajectories."""

    stage: str = "forces"
    name: str = "gravity"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a dynamic body feels it."""
        if not np.any(world.gravity):
            return Skip("no gravity, or no body feels it")
        return Bound(f"{np.linalg.norm(world.scene.gravity):.6g} m/s2")


@dataclass(frozen=True)
class ConstantForces:
    """Constant forces at centres of mass; they are in all trajectories."""

    stage: str = "forces"
    name: str = "constant forces"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a force that is not zero acts."""
        if not np.any(world.push):
            return Skip("no constant force acts")
        pushed = [world.names[i] for i in np.flatnonzero(world.push.any(axis=1))]
        named = f"{pushed[0]!r}" if len(pushed) == 1 else f"{len(pushed)} bodies"
        return Bound(f"on {named} at the centre of mass: paths stay parabolas")


@dataclass(frozen=True)
class KindOfForce:
    """All forces of one class; they are evaluated where bodies move."""

    name: str
    stage: str = "forces"

    def bind(self, world: World) -> Bound | Skip:
        """Included where the scene has one."""
        for table in world.force_tables:
            if table.kind == self.name:
                return Bound(table.reason)
        return Skip("the scene has none")


@dataclass(frozen=True)
class SteadyLoad:
    """Accelerations of an island's bodies without contacts, joints and forces that vary, for those that add to them."""

    stage: str = "forces"
    name: str = "steady load"

    def bind(self, world: World) -> Bound | Skip:
        """Included where something may add."""
        if not (world.can_collide or world.joints_of_scene or world.force_tables):
            return Skip("nothing can collide, no joints, no force varies")
        return Bound("what contacts, joints and other forces work against", {"loads": set_steady_load})


@dataclass(frozen=True)
class FreeRotation:
    """Angular acceleration of torque-free bodies."""

    stage: str = "forces"
    name: str = "gyroscopic term"

    def bind(self, world: World) -> Bound | Skip:
        """Included where contacts or joints may act on bodies whose moments of inertia differ."""
        verbs: dict[str, Callable[..., Any]] = {"loads": add_gyroscopic_term}
        if not world.can_collide and not world.joints_of_scene:
            return Skip(f"{world.why_no_impacts}; free rotation is in closed form", verbs)
        moments = world.inertia[world.dynamic]
        if np.all(moments == moments[:, :1]):
            return Skip("all bodies have equal moments of inertia", verbs)
        return Bound("spins change the load of contacts and joints", verbs)


@dataclass(frozen=True)
class VaryingLoad:
    """Marks the islands that varying forces act on."""

    stage: str = "forces"
    name: str = "varying load"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a force varies."""
        if not world.force_tables:
            return Skip("no force varies")
        return Bound("where contacts hold bodies it is constant over a sub-step", {"loads": keep_steady_load})


@dataclass(frozen=True)
class JointRows:
    """Rows of joints."""

    stage: str = "constrain"
    name: str = "joints"

    def bind(self, world: World) -> Bound | Skip:
        """Included where the scene has joints."""
        if not world.joints_of_scene:
            return Skip("the scene has none")
        return Bound(", ".join(dict.fromkeys(type(joint).__name__ for joint in world.joints_of_scene)))


@dataclass(frozen=True)
class Friction:
    """Tangential rows of contacts, and tangential impulses."""

    stage: str = "constrain"
    name: str = "friction"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a pair of materials that may meet has a coefficient."""
        if not world.can_collide:
            return Skip("nothing can collide")
        greatest = float(world.coefficients[:, :, 1:3].max())
        return Bound(f"coefficients up to {greatest:g}") if greatest > 0.0 else Skip("no pair of materials has a coefficient")


@dataclass(frozen=True)
class RollingFriction:
    """Rows of moments at contacts."""

    stage: str = "constrain"
    name: str = "rolling friction"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a pair of materials has a length."""
        if not (world.rolling.size and world.can_collide):
            return Skip("no material asks for it")
        return Bound(f"lengths up to {float(np.max(world.rolling)):g} m")


@dataclass(frozen=True)
class ContactForces:
    """Lasting contact and joints, solved exactly for each island of touching or joined bodies."""

    stage: str = "constrain"
    name: str = "contact forces"

    def bind(self, world: World) -> Bound | Skip:
        """Included where something can press bodies together."""
        how, verbs = f"{world.accuracy.contact_solver}: ", {"exact.contact_forces": hold}
        if world.joints_of_scene:
            return Bound(f"{how}{len(world.joints_of_scene)} joints", verbs)
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        if not world.can_press:
            return Skip("no force, no moving support and no spin presses bodies together", verbs)
        return Bound(f"{how}bodies may come to rest on each other", verbs)


def choose_islands(run: Run, pair_events: PairEvents) -> None:
    """Which islands are sub-stepped in the step, where no contact is looked for."""
    run.substepped.choose(run, pair_events)


def substep_contacts(run: Run, pair_events: PairEvents, island: Island) -> None:
    """Contact forces of a sub-stepped island, by sub-steps to the end of the step."""
    run.substepped.contact_forces(run, pair_events, island)


def begin_substepped_trajectories(run: Run, pair_events: PairEvents, _island: Island) -> None:
    """Trajectories of its members to where the solver found them, and of those that left it."""
    run.substepped.begin_trajectories(run, pair_events)


@dataclass(frozen=True)
class SubsteppedContact:
    """Contacts and joints of islands that the exact regime would take long for."""

    stage: str = "constrain"
    name: str = "sub-stepped islands"

    def bind(self, world: World) -> Bound | Skip:
        """Included where such islands are possible; the plan's line says at the end of the run what they did."""
        reason = why_not_substepped(world)
        if reason:
            return Skip(reason)
        when = f"once the exact regime gets expensive: fewer than {MANY} bodies" if only_expensive(world) else "bodies may pile up"
        if world.accuracy.contact_solver == "cheapest":
            when = "where that takes less time than the exact regime"
        verbs: dict[str, Callable[..., Any]] = {
            "substepped.contact_forces": substep_contacts, "substepped.trajectories": begin_substepped_trajectories
        }  # fmt: skip
        if not world.can_collide:
            verbs["pairs"] = choose_islands
        return Bound(f"sub-stepped: {when}", verbs)


@dataclass(frozen=True)
class ImpactTime:
    """Time of impact of pairs, by one of the methods of `Accuracy.impact_time`."""

    stage: str = "sweep"
    name: str = "impact time"

    def bind(self, world: World) -> Bound | Skip:
        """Included where something can collide."""
        if not world.can_collide:
            return Skip(world.why_no_impacts)
        method = world.accuracy.impact_time
        return Bound(f"{method}: {IMPACT_TIMES[method]}", {"time_of_impact": sweep_with(method)})


@dataclass(frozen=True)
class EventKernel:
    """Flight of balls from impact to impact in one kernel; it saves time and changes no result."""

    stage: str = "sweep"
    name: str = "event kernel"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a ball may collide and nothing in the scene needs every step."""
        reason = why_not(world)
        if reason:
            return Skip(reason)
        count = int(np.count_nonzero((kinds(world) == BALL) & world.dynamic))
        return Bound(f"impacts of {count} balls with each other and with planes, as long as nothing lasting touches")


@dataclass(frozen=True)
class ExactFlight:
    """Parabola and free rotation in closed form; constant contact forces between events."""

    stage: str = "integrate"
    name: str = "exact flight"

    def bind(self, world: World) -> Bound | Skip:
        """Included where no force varies."""
        if world.force_tables:
            return Skip("forces vary")
        return Bound("paths between impacts are exact", {"trajectories": begin_trajectories})


@dataclass(frozen=True)
class ForcedFlight:
    """Steps of order 4 where nothing holds bodies; forces of the middle of the sub-step where contacts or joints do."""

    stage: str = "integrate"
    name: str = "forced flight"

    def bind(self, world: World) -> Bound | Skip:
        """Included where a force varies."""
        if not world.force_tables:
            return Skip("no force varies")
        verbs = {"trajectories": begin_trajectories}
        if world.accuracy.integrator != "exact":
            return Bound(f"{world.accuracy.integrator}: steps of the accuracy's length, whatever their error", verbs)
        impacts = "; impacts are exact on them" if world.can_collide else ""
        return Bound(f"steps of order 4, as long as their error allows{impacts}", verbs)


def look_at_triggers(run: Run, begin: float, end: float) -> None:
    """What came into the triggers of a run, and what left them, in a step [s]."""
    run.triggers.look(begin, end)


@dataclass(frozen=True)
class TriggerVolumes:
    """Volumes that report overlap."""

    stage: str = "observe"
    name: str = "triggers"

    def bind(self, world: World) -> Bound | Skip:
        """Included where the scene has one."""
        number = len(world.triggers)
        return Bound(f"{number} looked at after every step", {"observe": look_at_triggers}) if number else Skip("the scene has none")


def all_effects(world: World) -> list[Effect]:
    """All effects, in the order in which those of a verb are called."""
    kinds_of_force = [*KINDS.values(), *(table.kind for table in world.force_tables)]
    return [
        BroadPhase(),
        FclNarrowPhase(),
        ImpactResponse(),
        Gravity(),
        ConstantForces(),
        *(KindOfForce(name) for name in dict.fromkeys(kinds_of_force)),
        SteadyLoad(),
        FreeRotation(),
        VaryingLoad(),
        JointRows(),
        Friction(),
        RollingFriction(),
        ContactForces(),
        SubsteppedContact(),
        ImpactTime(),
        EventKernel(),
        ExactFlight(),
        ForcedFlight(),
        TriggerVolumes(),
    ]
