"""What the loop asks of the participants of a run. Those that a scene does not call for are in `absent.py`, with the same answers.

A run and its pair events are `Any` here: their types are made of these.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from rigidimpulse.collision.time_of_impact.result import ImpactTimes, PairsToSweep
    from rigidimpulse.dynamics.constraints.joint_impact import JointBlock
    from rigidimpulse.dynamics.constraints.jointed_island import JointMemory
    from rigidimpulse.dynamics.constraints.rolling_friction import Rolling
    from rigidimpulse.dynamics.forces.force import ForceTable
    from rigidimpulse.dynamics.forces.force_log import ForceWork
    from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
    from rigidimpulse.engine.exact.step_begin import SolveCounts
    from rigidimpulse.engine.pair_table import PairTable
    from rigidimpulse.engine.touching import Shared
    from rigidimpulse.model.contacts import Contacts
    from rigidimpulse.model.island import Island
    from rigidimpulse.model.joint_table import Joints
    from rigidimpulse.model.world import World
    from rigidimpulse.motion.body_state import BodyState
    from rigidimpulse.recording.joint_log import JointLog
    from rigidimpulse.recording.ledger import Ledger
    from rigidimpulse.recording.recorder import Recorder


class RunJoints(Protocol):
    """The joints of a run: `JointState`, or `NoJoints`. What follows `moving_bodies` is asked for islands that have joints."""

    @property
    def log(self) -> JointLog:
        """What joints give."""
        ...

    def at(self, bodies: np.ndarray, /) -> np.ndarray:
        """Whole joints at any of the given dynamic bodies, in order."""
        ...

    def bodies_of(self, joints: np.ndarray, /) -> np.ndarray:
        """Bodies of the joints, without the world."""
        ...

    def moving_bodies(self, run: Any, /) -> np.ndarray:
        """Dynamic bodies with joints that do not rest."""
        ...

    def movable_end(self, joint: int, /) -> int:
        """A dynamic body of a joint."""
        ...

    def are_passive(self, which: np.ndarray, /) -> bool:
        """Whether joints are neither driven nor springs."""
        ...

    def will_let_go(self, which: np.ndarray, /) -> bool:
        """Whether a joint has a time at which it lets go."""
        ...

    def supports_of(self, which: np.ndarray, /) -> np.ndarray:
        """What stands at the joints: bodies that are not dynamic, -1 for the world."""
        ...

    def links(self) -> np.ndarray:
        """Bodies (l, 2) that whole joints join."""
        ...

    def joined(self) -> np.ndarray:
        """Dynamic bodies (n,) bool at whole joints."""
        ...

    def carry_on(self, run: Any, earlier: Any, /) -> None:
        """Begin at the time of the run, where the joints of an earlier run are."""
        ...

    def project_velocities(self, run: Any, island: Island, /) -> None:
        """End the sub-step of an island's joints: velocities are projected."""
        ...

    def follow(self, run: Any, island: Island, contacts: Contacts, /) -> None:
        """Move what hangs on bodies that a position correction has moved as far."""
        ...

    def impact_block(self, run: Any, island: Island, /) -> JointBlock:
        """Rows of an island's joints at an impact."""
        ...

    def hold(
        self, run: Any, island: Island, contacts: Contacts, turning: np.ndarray, force: np.ndarray, rest: float, rolling: Rolling, /
    ) -> tuple[float, float]:
        """Forces into run.wrench over a sub-step of at most `rest`; returns (its length, the residual)."""
        ...

    def let_go(self, island: Island, /) -> None:
        """Forget the forces of the island's joints, which are not to be used."""
        ...

    def log_rest(self, island: Island, /) -> None:
        """Forces on b from here on, while the island sleeps."""
        ...

    def report_start(self, run: Any, /) -> None:
        """Report joints that the poses of the scene do not close."""
        ...

    def report_open(self, run: Any, island: Island, /) -> None:
        """Report joints of an island that the forces found last do not close."""
        ...

    def begin_sub_steps(self, run: Any, bodies: np.ndarray, time: float, /) -> None:
        """End what exact sub-steps do to bodies that come to a sub-stepped island."""
        ...

    def note_sub_steps(self, which: np.ndarray, force: np.ndarray, span: tuple[float, float], /) -> None:
        """Note the mean forces (j, 3) N on b over a span of sub-steps."""
        ...

    def account_sub_steps(self, which: np.ndarray, began: float, time: float, /) -> None:
        """Record the impulses of sub-steps that lasted from `began` to `time`, s."""
        ...

    def break_at(self, run: Any, which: np.ndarray, time: float, /) -> np.ndarray:
        """Take out joints that are overloaded or due; returns those that stay."""
        ...

    def next_release(self, which: np.ndarray, time: float, /) -> float:
        """Time after `time` at which the first of these joints lets go, inf if none does."""
        ...

    @property
    def table(self) -> Joints:
        """The rows of all joints."""
        ...

    @property
    def are_closed(self) -> bool:
        """Whether the forces found last close the joints."""
        ...

    @property
    def memory(self) -> JointMemory:
        """What joints keep from one sub-step to the next."""
        ...

    @property
    def moment(self) -> np.ndarray:
        """(j, 3) N s on b in the first half of the sub-step."""
        ...


class RunForceLog(Protocol):
    """What forces did to bodies."""

    work: np.ndarray

    def end(self, i: int, time: float, now: BodyState | None = None, /) -> None:
        """The lines that act on body i end at `time`, if there are any; now: where it is then, None if its trajectory leads there."""
        ...

    def keep(self, count: int, /) -> None:
        """Leave the first `count` frames only."""
        ...


class RunForces(Protocol):
    """The varying forces of a run: `VaryingForces`, or `NoForces`. What follows `finish` is asked for bodies that they act on."""

    acts: np.ndarray

    @property
    def log(self) -> RunForceLog:
        """What each force did."""
        ...

    def weigh(self, bodies: np.ndarray, time: float, /) -> None:
        """Let bodies whose mass changes have that of `time` [s]."""
        ...

    def links(self) -> np.ndarray:
        """Bodies (l, 2) that forces tie together."""
        ...

    def carry_on(self, earlier: Any, /) -> None:
        """Leave out what broke in an earlier run."""
        ...

    def finish(self, world: World, times: np.ndarray, recorder: Recorder, /) -> ForceWork | None:
        """What the forces did until the frames; None where there are none."""
        ...

    @property
    def value(self) -> np.ndarray:
        """(n, 6) force and torque on bodies at the start of their trajectories."""
        ...

    @property
    def rate(self) -> np.ndarray:
        """(n, 6) how they change a second."""
        ...

    def let_act(self, bodies: np.ndarray, /) -> None:
        """From now on forces that come and go act on these bodies, (n,) bool, and on no others."""
        ...

    def present(self, table: ForceTable, time: float, /) -> np.ndarray:
        """Wrenches (k, 6) of the rows of a table at `time`."""
        ...

    def may_rest(self, bodies: np.ndarray, /) -> bool:
        """Whether the forces on bodies at rest stay as they are."""
        ...

    def fly(self, run: Any, members: np.ndarray, time: float, end: float, /) -> np.ndarray:
        """Forces on members that nothing holds; returns for how long, (m,) s."""
        ...

    def load(self, run: Any, island: Island, h: float, /) -> float:
        """Forces on an island that contacts or joints hold, over h s at most; returns for how long."""
        ...

    def of_flight(self, run: Any, island: Island, /) -> Any:
        """`FlightForces` of an island that joints hold and nothing touches; None where they do not let it fly."""
        ...

    def push(self, run: Any, members: np.ndarray, span: tuple[float, float], mean: np.ndarray, /) -> float:
        """Forces on sub-stepped members over a span [s] at most, into `value`; returns until when."""
        ...


class RunSoftBodies(Protocol):
    """The soft bodies of a run: `RunningSoftBodies`, or `NoSoftBodies`."""

    moves: bool
    pressed: np.ndarray

    def advance(self, run: Any, end: float, /) -> float:
        """Step the soft bodies to `end` [s] or less far; returns how far."""
        ...

    def keep(self, count: int, /) -> None:
        """Leave the first `count` frames only."""
        ...

    def tracks(self) -> list[FlexibleTrack]:
        """Frames of each flexible body."""
        ...

    def carry_on(self, run: Any, earlier: Any, /) -> None:
        """Begin at the time of the run, where the soft bodies of an earlier run are."""
        ...

    def add_to(self, ledger: Ledger, /) -> None:
        """Give the ledger their energy and momenta."""
        ...


class Substepping(Protocol):
    """The sub-stepped islands of a run: `SubsteppedIslands`, or `NoSubstepping`. What follows `finish` is asked for such islands."""

    label: np.ndarray

    @property
    def counts(self) -> SolveCounts:
        """How often the exact regime deals with the bodies."""
        ...

    def take_undisturbed_steps(self, run: Any, end: float, until: float, /) -> Any:
        """Take steps as long as nothing moves but members; returns the pairs of a step that the loop must finish, else None."""
        ...

    def choose(self, run: Any, pair_events: Any, /) -> None:
        """Choose the islands of the step."""
        ...

    def join(self, run: Any, pair_events: Any, time: float, islands: list[Island], /) -> list[Island]:
        """The islands at `time` with the sub-stepped ones that they touch."""
        ...

    def let_go(self, bodies: np.ndarray, /) -> None:
        """What held bodies (k,) holds them no more."""
        ...

    def may_take(self, bodies: np.ndarray, /) -> bool:
        """Whether islands of bodies that no impulse keeps apart are handed over; they are, when they are looked at next."""
        ...

    def is_idle(self) -> bool:
        """Whether no island is sub-stepped and none may begin to be."""
        ...

    def carry_on(self, earlier: Any, old: np.ndarray, new: np.ndarray, /) -> None:
        """Know of bodies `new` (k,) what an earlier run knew of them as `old` (k,)."""
        ...

    def finish(self, run: Any, /) -> None:
        """Account for what the sub-steps under way take until the end of the run."""
        ...

    def contact_forces(self, run: Any, pair_events: Any, island: Island, /) -> None:
        """Step an island from its time to the end of the step."""
        ...

    def begin_trajectories(self, run: Any, pair_events: Any, /) -> None:
        """Trajectories of the members that were stepped last, to where the solver found them."""
        ...

    def solve_again(self, run: Any, members: np.ndarray, span: tuple[float, float], kept: float, /) -> Any:
        """Step members again whose forces sub-steps did not find; their outcome, None if that does not hold them, either."""
        ...


class Flight(Protocol):
    """The kernel of balls: `EventRun`, or `NoFlight`. It is asked to fly where it says that it may."""

    def may_fly(self) -> bool:
        """Whether balls may be flown from here."""
        ...

    def fly(self, end: float, /, at_boundary: bool = True) -> tuple[int, float, float]:
        """Fly towards `end` [s]; returns how that ended, and the step that is under way."""
        ...


class NarrowPhase(Protocol):
    """Who finds contacts and gaps: `OwnContacts`, or `FclContacts`."""

    def find_touching(self, run: Any, table: PairTable, shared: Shared, time: float, /) -> int:
        """Write the contacts of all that hangs together with the bodies marked as reached; see `touching.find_touching`."""
        ...

    def contacts_at(self, run: Any, table: PairTable, places: np.ndarray, margin: float, count: int, /) -> int:
        """Append the contacts of the pairs at these places, within `margin` contact margins; see `touching.contacts_at`."""
        ...

    def sweep(self, run: Any, method: Callable[..., ImpactTimes], pairs: PairsToSweep, end: float, /) -> ImpactTimes:
        """First contacts of pairs until `end` [s]; method: of the accuracy."""
        ...


class Observer(Protocol):
    """The triggers of a run: `Triggers`, or `NoTriggers`. narrowphase: what they ask, which no step changes."""

    narrowphase: Any

    def look(self, begin: float, end: float, /) -> None:
        """Look at what happened in the step from `begin` to `end` [s]."""
        ...

    def turn(self, bodies: np.ndarray, time: float, /) -> None:
        """Keep the trajectories of bodies that get others at `time` [s]."""
        ...


class Keyframed(Protocol):
    """The paths of kinematic bodies: `KeyframePaths`, or `NoKeyframes`."""

    def next_key(self, time: float, /) -> float:
        """The first key time after `time`, inf if there is none."""
        ...

    def start_segments(self, run: Any, time: float, /) -> None:
        """Put bodies whose key is at or before `time` on their new trajectory."""
        ...


class Compiled(Protocol):
    """The compiled order of events: `CompiledLoop`, or `NoCompiledLoop`."""

    def advance(self, run: Any, pair_events: Any, event: tuple[float, np.ndarray], until: float, /) -> tuple[float, np.ndarray]:
        """Deal with events from this one on, its time [s] and bodies; returns the first event for the loop in Python.

        It may take more steps than that of the pairs, up to `until` [s].
        """
        ...
