"""One step of sub-stepped islands: bodies are handed to the kernels, contacts found, sub-steps taken, energy balanced."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_buffer import ContactBuffer, Question, find_together
from rigidimpulse.collision.contact_cache import (
    TOO_FEW_PLACES,
    Convex,
    Share,
    classify,
    find_contacts,
    make_workspace,
    share_of,
)
from rigidimpulse.collision.contact_records import MEMBER, OUTSIDE, ROUND_A, ROUND_B, SKELETON_A, SKELETON_B, SUPPORT
from rigidimpulse.collision.contact_table import ContactTable
from rigidimpulse.collision.contact_update import Asked, Deep, make_asked, mark_apart
from rigidimpulse.collision.fat_boxes import BodyBounds, FatBoxes
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.convexity import convex_polyhedra, inner_radii, several_polyhedra
from rigidimpulse.collision.manifold.dispatch import GENERAL, PairQuery, Posed, pair_gap
from rigidimpulse.collision.manifold.make_smaller_shapes import make_smaller_shapes
from rigidimpulse.collision.manifold.penetrating import solids
from rigidimpulse.collision.manifold.polyhedra import make_polyhedra
from rigidimpulse.collision.manifold.smaller_shapes import LEVELS, SmallerShapes
from rigidimpulse.core.memory import reserve
from rigidimpulse.core.portable import dot, length
from rigidimpulse.core.quaternion import rotate, to_matrix
from rigidimpulse.core.simd import ROW, aligned
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.workers import empty_work_queue
from rigidimpulse.dynamics.impact.restitution import LAWS
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import SolverBodies
from rigidimpulse.dynamics.solvers.tgs_soft.depenetration import move_apart
from rigidimpulse.dynamics.solvers.tgs_soft.energy_balance import (
    Weights,
    begin_balance,
    make_balance,
    pay_for_rise,
)
from rigidimpulse.dynamics.solvers.tgs_soft.records import POINTS, Batches, empty_patches, more_batches, more_patches
from rigidimpulse.dynamics.solvers.tgs_soft.solver import FREQUENCY, softness
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.island_step import (
    DEMANDS,
    GIVEN,
    RAISED,
    TAKEN,
    Surroundings,
    load_island,
    unload_island,
    unload_pressed,
)
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.engine.substepped.stages import (
    ASK,
    AT_STAGE,
    COLUMNS,
    END,
    FIND,
    FOUND,
    KEEP,
    LEAST_SUB_STEPS_BETWEEN,
    LEFT,
    LENGTH,
    LIST,
    LOOKED_AT,
    MARK,
    MORE_ASKED,
    MORE_COLOURS,
    MORE_CONTACTS,
    MORE_PATCHES,
    MORE_PLACES,
    MORE_POINTS,
    MORE_WAYPOINTS,
    NEEDED,
    NEEDS_GENERAL,
    NEXT,
    PLAN,
    SHARE,
    SOME,
    STAGE,
    STORE,
    WAITING,
    General,
    Island,
    Memory,
    Step,
    go_on,
    go_on_with_polyhedra,
    limits_of,
    work_on,
)
from rigidimpulse.engine.substepped.trajectories import Ends, end_of_piece
from rigidimpulse.model.world import World
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import refresh_pose
from rigidimpulse.motion.trajectory import FIXED
from rigidimpulse.motion.waypoints import Waypoints, grown_waypoints, make_waypoints, waypoints_of

COLUMN = 20.0
"""Bodies whose weight may press the skin in by PRESSED."""
PRESSED = 0.25
LEAST_SUB_STEPS = 16
"""Sub-steps in a whole step."""
UNLIKE, MOST_UNLIKE = 6.0, 96.0
"""How many times as heavy as a body one that it touches is, from which sub-steps go with the root of it, and to which: a light body bears a
heavy one by impulses that sub-steps find bit by bit. A box under a ball of 25 times its mass was up to 5 skins inside the floor."""
CROSSED = TOLERANCES.sub_stepping.crossed
LOOKS_FOR = TOLERANCES.manifold.depth
MOST_LOOKS = 1024
"""Looks for contacts in what is stepped at once that speed may ask for. Beyond that an island would cost more than it advances: a light
rod that a heavy press had spun up to 15,000 rad/s took 60,000 sub-steps in 1/60 s. Bodies may then pass each other: the status says so."""
SAME, KEPT = 0.02, 0.2
"""Parts of the motion until a look (`Accuracy.substep_motion`) that a pair may make with the contacts it has: at any time, and in the
middle of a step."""
TOO_FAST_REMEDY = "contacts would have to be looked for {looks} times in {ahead:.2g} s, and were {most} times; use a smaller step"
CLEAR = 0.2
"""Inner radii within which bodies may meet, beside the way they go."""
MOTION_TAKEN_REMEDY = "it was raised to the margin of contacts, and its speed paid for that; contact_solver='newton' needs no such margin"


class Parts(NamedTuple):
    """Parts of the settings `step` and `substep_motion` that bodies without joints are stepped with."""

    step: float  # of `step`, what is stepped at once at most
    alone: float  # the same where nothing else may meet what is stepped
    sub_step: float  # of the longest sub-step
    motion: float  # of `substep_motion`, until touching bodies are looked at again
    straight: float  # of `substep_motion`, skins by which trajectories may stray from the ways of turning bodies
    all_stray: bool  # whether that is asked of all bodies that turn, and not of those alone that contacts acted on


COARSE = Parts(1.0, 1.0, 1.0, 1.0, 10.0, all_stray=False)
"""For crowds."""
FINE = Parts(1.0 / 2.0, 1.0 / 2.0, 1.0 / 8.0, 1.0 / 2.0, 5.0, all_stray=True)
"""For scenes that are no crowd (`regime.CROWD`): no body is deeper in another than the skin in thirty scenes of 12 to 60 bodies, where in
nine of them one was, up to 13 skins (`tests/bench/both_regimes.py`). A whole step at once is too long: where a heavy body hits a light one
that stands, sub-steps become shorter when the next ones begin (see UNLIKE)."""
FINEST = Parts(1.0 / 8.0, 1.0, 1.0 / 32.0, 1.0 / 2.0, 1.0, all_stray=True)
"""For islands of scenes of few bodies that stand in for exact ones: a row of dominoes keeps its energy to 1e-7 of it. Stepped twice as far
at once, as finely, it gains up to 1e-2 of a domino's from what hits it in the middle, where its ways are straight."""


@dataclass
class Outcome:
    """Result of a step: bodies (k,) of the scene in the solver's order, and their poses and velocities (k, 6) at its end.

    is_found: whether the balance had to take little, so that the forces are the right ones.
    rank: (k,) of the bodies. waypoints: of these bodies, if frames fall into the step.
    energies: (3, k) J. taken, raised: what the balance of energy took off their speeds, and what they gained and could not pay.
    given: work of drives and moving supports in islands with joints.
    """

    members: np.ndarray
    rank: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    energies: np.ndarray
    waypoints: Waypoints | None
    is_found: bool = True

    @property
    def places(self) -> tuple[np.ndarray, ...]:
        """Ranks, and what is written for them."""
        return self.rank, self.position, self.orientation, self.velocity, self.energies

    @property
    def taken(self) -> np.ndarray:
        """(k,) J."""
        return self.energies[TAKEN]

    @property
    def raised(self) -> np.ndarray:
        """(k,) J."""
        return self.energies[RAISED]


@dataclass(frozen=True)
class Fineness:
    """How finely a set of bodies is stepped.

    Attributes:
        sub_step: s, the longest. motion: inner radii that touching bodies move until they are looked at again.
        motion_of_new: the same of what comes to contact in the middle of the step; inf: no more often than others.

    """

    sub_step: float
    motion: float
    motion_of_new: float = np.inf


class ContactStepper:
    """Steps sets of bodies by the sub-stepped solver; holds what does not change, and the contacts.

    Attributes:
        order: (n,) bodies by their places at the start of the run; rank: (n,) place of each in it.
        inner: (n,) m, distance from the centre of mass to the nearest face; inf for what cannot be moved. skin: (n,) m.
        step_length, alone_length: s, that is stepped at once at most, and where nothing else may meet what is stepped.
        motion: inner radii, see `Accuracy.substep_motion`.
        kept: inner radii that a pair may come past each other with the contacts it has, in the middle of a step.
        at_once, at_once_alone: the same with the skins by which trajectories may stray from the ways of turning bodies.
        strength: (n,) m/s2, of gravity and forces. torque: (n, 3) N m, of forces that vary.
        bodies: by rank. table: pairs and contact points. balance: of their energy. island: what kernels need of the bodies.
        around: what does not change of them, and who takes part.
        pressed: (n,) bool, contacts acted on the body when it was last stepped.

    """

    def __init__(self, world: World, movable: np.ndarray, parts: Parts, sharing: Sharing | None = None) -> None:
        """Make the arrays of the bodies.

        Args:
            world: the compiled scene.
            movable: (n,) bool, bodies that are dynamic, or will be when they are let go.
            parts: how finely bodies without joints are stepped.
            sharing: of the work by several cores; None: what suits this machine.

        """
        n = world.num_bodies
        self.world, self._sharing = world, sharing or Sharing()
        self.order = np.lexsort(np.column_stack([np.arange(n), world.position[:, ::-1]]).T)
        self.rank = np.argsort(self.order, kind="stable")
        self._moves = np.zeros(len(world.geometry.shape_first) - 1, bool)
        self._moves[world.shape_of_body[movable]] = True
        self.inner = np.where(movable, inner_radii(world.geometry, world.convex_depths)[world.shape_of_body], np.inf)
        self.skin = TOLERANCES.sub_stepping.skin * self.inner
        self.strength, self.torque = world.steady_strength.copy(), np.zeros((n, 3))
        self.reach = np.where(world.ball, 0.0, world.bound_radius)
        convex = convex_polyhedra(world.geometry, world.convex_depths)
        self.shapes = make_polyhedra(world.geometry, convex, several=several_polyhedra(world.geometry))
        self._has_general = world.has_general_pairs
        solid_shapes, drum, inset_of_solids = solids(world.shapes, world.geometry, convex, self.shapes)
        self._deep = Deep((convex | drum)[world.shape_of_body[self.order]], solid_shapes)
        self._convex, self._asked = Convex(self.shapes, solid_shapes, inset_of_solids), make_asked(0, LEVELS * n)
        self._cornered = (world.flat & ~world.half_space)[self.order]
        self.bodies = self._make_bodies()
        self._weights = Weights(world.mass[self.order], np.ascontiguousarray(world.steady_acceleration[self.order]))
        self.balance = make_balance(n)
        self._shares = self._sharing.most_cores
        self._workspaces = [make_workspace() for _ in range(self._shares)]
        self._buffers = [ContactBuffer(self._sharing.buffer, keeps=True)]
        self.table = ContactTable(self._shares, n, self._sharing.first_points, self._sharing.points_of_a_body)
        least = CLEAR * np.where(movable, self.inner, 0.0)
        moves = world.dynamic | world.moving
        bounds = BodyBounds(self.order, moves, world.bound_radius, self.inner, least, world.static_min, world.static_max)
        self.fat_boxes = FatBoxes(bounds, world.dynamic, world.may_collide if len(world.apart) else None)
        self.simd, patches = self._sharing.simd, self._sharing.patches_of_a_body * n
        self._patches, (self._lists, self._target) = empty_patches(patches), _special_lists(patches)
        none = Batches(np.zeros(0, np.float32), np.zeros(0), *np.zeros((4, 0), np.int32))
        self._batches = more_batches(none, patches // self.simd.width + 1, self.simd.width)
        self._begins = np.zeros(256, np.int64)
        self._held: Memory | None = None
        self._general_held: General | None = None
        self._work_queue, self._waypoints = empty_work_queue(), make_waypoints(0, n)
        self._places_of_bodies = aligned(n + 1)
        self._part = np.zeros(n, np.int64)
        self.step_length, self.alone_length = world.accuracy.step * parts.step, world.accuracy.step * parts.alone
        self._least_sub_steps = LEAST_SUB_STEPS / parts.sub_step
        self.motion = world.accuracy.substep_motion * parts.motion
        # Where a step is cut into pieces, what is new is known when the next one begins.
        self._motion_of_new = self.motion if parts.alone > parts.step else np.inf
        straight = world.accuracy.substep_motion * parts.straight
        self.at_once = self.step_length, straight
        self.at_once_alone = (self.alone_length, np.inf) if self.alone_length > self.step_length else self.at_once
        self._ends = Ends(self.inner, self.strength, self.reach, self.skin, parts.all_stray)
        self.kept = KEPT * self.motion
        # Balls and moving supports: all contacts are found again in the middle of a step.
        self._all_quick = bool(world.moving.any() or world.ball.any())
        is_special = self._all_quick or bool(world.coefficients[:, :, :2].any())
        self.pressed = np.zeros(n, bool)
        self._places, self._margins = np.zeros(0, np.int64), np.zeros(0)
        self.members, self._progress = np.zeros(0, np.int64), np.zeros(COLUMNS, np.int64)
        self.around = Surroundings(bounds, self.fat_boxes.fat, world.inv_mass, self.strength, self.torque, self._part)
        self._demands = np.zeros(DEMANDS)
        self.island = Island(
            self._convex, self.bodies, self.balance, self._weights, self.order, self._cornered, world.coefficients
        )
        self._step = Step(
            h=0.0, ahead=0.0, same=SAME * self.motion, first_kept=0.0, kept=self.kept, motion=np.inf, fall=0.0, strength=0.0,
            soft=np.zeros((2, 3)), sub_steps=1, parts=1, law=LAWS[world.accuracy.restitution],
            all_quick=self._all_quick, is_special=is_special, has_frames=False, balances=False,
            most_cores=self._shares, many_pairs=self._sharing.pairs, many_general=self._sharing.general_pairs,
            many_batches=self._sharing.batches,
        )  # fmt: skip

    @cached_property
    def smaller(self) -> SmallerShapes:
        """The shapes that kernels for bodies which are apart are asked about; made where they are."""
        world = self.world
        return make_smaller_shapes(world.shapes, world.geometry, world.convex_depths, self._moves, world.shape_of_body, self.order)

    def _make_bodies(self) -> SolverBodies:
        """Rows of all bodies by rank, and one of none."""
        world, n = self.world, self.world.num_bodies

        def by_rank(column: np.ndarray, none: float) -> np.ndarray:
            return np.concatenate([column[self.order], np.full((1, *column.shape[1:]), none, column.dtype)])

        unlike = world.inertia.max(axis=1) > world.inertia.min(axis=1)
        return SolverBodies(
            shape=by_rank(world.shape_of_body, 0), material=by_rank(world.material_of_body, 0), inertia=by_rank(world.inertia, 1.0),
            alike=by_rank(~unlike, True), inner=by_rank(self.inner, np.inf), skin=by_rank(self.skin, np.inf),
            reach=by_rank(self.reach, 0.0), radius=by_rank(world.bound_radius, 0.0), part=np.zeros(n + 1, np.int64),
            position=np.zeros((n + 1, 3)), orientation=np.zeros((n + 1, 4)), rotation=np.zeros((n + 1, 3, 3)),
            gravity=np.zeros((n + 1, 3)), torque=np.zeros((n + 1, 3)), work=np.zeros(n + 1), velocity=aligned(n + 1),
            before=aligned(n + 1), moved=aligned(n + 1), drift=aligned(n + 1), quick=np.zeros(n + 1, bool), mass=aligned(n + 1),
            change=np.zeros(n + 1), held=np.zeros(n + 1, bool),
        )  # fmt: skip

    def sub_step(self, members: np.ndarray) -> float:
        """Length of a sub-step of members, s, see `_sub_step`."""
        return self._sub_step(float(self.world.steady_strength[members].max()), float(self.skin[members].min()))

    def _sub_step(self, strength: float, skin: float) -> float:
        """Length of a sub-step, s: short enough for the load of a column, so that it scales with the size of bodies."""
        step, pieces = self.world.accuracy.step, self._least_sub_steps
        if strength > 0.0:
            # The load of k bodies presses the skin in by k g / w^2, w = 2 pi F / h.
            h = 2.0 * math.pi * FREQUENCY * math.sqrt(PRESSED * skin / (COLUMN * strength))
            pieces = max(math.ceil(step / h), pieces)
        return step / pieces

    def end_of(self, now: BodyState, members: np.ndarray, at_once: tuple[float, float], span: tuple[float, float]) -> float:
        """When what members are stepped at once from the begin of a span [s] on ends, s: at the end of the span, or before.

        at_once: s, that is stepped at once at most, and skins by which trajectories may stray from the ways of turning bodies.
        """
        return float(end_of_piece(now, members, self._ends, self.pressed, at_once, span))

    def by_place(self, marked: np.ndarray) -> np.ndarray:
        """Bodies that are marked (n,) bool, in their order."""
        return self.order[marked[self.order]]

    def renew_pairs(self, run: Run, ahead: float) -> None:
        """Find again the pairs of bodies that take part and may meet in `ahead` s."""
        self.table.replace(*self.fat_boxes.renewed(run.state.now, run.acceleration, self._part, ahead))
        classify(self.table.pairs, self.bodies, self.shapes)

    def near(self, run: Run, member: np.ndarray, ahead: float) -> np.ndarray:
        """Pairs (3, k) of members (n,) bool with each other and with what stands, that may meet in `ahead` s, see `FatBoxes.near`."""
        part = self._part
        part[:] = SUPPORT
        # Movable bodies under way that are no members are swept.
        part[self.world.dynamic & (run.state.trajectory.mode != FIXED)] = OUTSIDE
        part[member] = MEMBER
        while (near := self.fat_boxes.near(self.table.pairs, run.state.now, run.acceleration, part, ahead)) is None:
            self.renew_pairs(run, ahead)
        return near

    def set_up(self, run: Run, members: np.ndarray, supports: np.ndarray, ahead: float) -> None:
        """Put members and what they may touch before the kernels, and find their contacts; see `load`."""
        self.load(run, members, supports, ahead)
        self.look(run)

    def look(self, run: Run) -> None:
        """Find the contacts of what was loaded."""
        self._go_on(run, PLAN)

    def load(
        self, run: Run, members: np.ndarray, supports: np.ndarray, ahead: float, kept: float = 0.0, fineness: Fineness | None = None
    ) -> None:
        """Put members and what they may touch before the kernels at the present instant, for a step of `ahead` s.

        kept: see `review`; fineness: None for that of bodies without joints.
        """
        self.members, part, demands = members, self._part, self._demands
        part[:] = OUTSIDE
        part[supports], part[members] = SUPPORT, MEMBER
        while not load_island(self.island, self.table.pairs, self.around, run.motion, ahead, demands):
            self.renew_pairs(run, ahead)
        self.table.pack()
        strength, skin, ratio, motion, pieces, approach = demands.tolist()
        has_joints = fineness is not None
        unlike = math.sqrt(max(min(ratio, MOST_UNLIKE) / UNLIKE, 1.0))
        fineness = fineness or Fineness(self._sub_step(strength, skin) / unlike, self.motion, self._motion_of_new)
        # Fast bodies are looked at more often, with enough sub-steps between the looks. So are those that come from farther than
        # contacts are looked for: a big ball met small bricks only when it was a third inside of them (issue 28).
        needed = math.ceil(max(pieces, approach))
        if needed > MOST_LOOKS:
            self._report_fastest(run, members, needed, ahead)
            needed = MOST_LOOKS
        sub_steps = max(math.ceil(ahead / fineness.sub_step - 1e-9), LEAST_SUB_STEPS_BETWEEN * needed, 1)
        # What is stepped at once because nothing else meets it is looked at, and its energy balanced, as often as if it were not. Islands
        # with joints always are, and the work of their drives counts for the whole of it.
        pieces_at_once = 1 if has_joints else math.ceil(ahead / self.step_length - 1e-9)
        parts = min(max(math.ceil(motion / fineness.motion), needed, pieces_at_once, 1), max(sub_steps // LEAST_SUB_STEPS_BETWEEN, 1))
        one, h = ahead / parts, ahead / sub_steps
        self._step = self._step._replace(
            h=h, ahead=one, first_kept=kept, motion=fineness.motion_of_new, fall=0.5 * one * strength, strength=strength,
            soft=softness(h, fineness.sub_step), sub_steps=sub_steps, parts=parts, all_quick=self._all_quick,
            balances=pieces_at_once > 1,
        )  # fmt: skip
        capacity = share_of.py_func(len(self.table.pairs.first), self._shares, self._shares)
        if capacity > len(self._places):
            self._places, self._margins = reserve((2 * capacity,), np.int64), reserve((2 * capacity,), np.float64)
        looked_at = self._progress[LOOKED_AT]
        self._progress[:] = 0
        self._progress[[STAGE, LENGTH, LEFT, LOOKED_AT]] = FIND, sub_steps // parts, sub_steps // parts, looked_at

    @property
    def sub_step_length(self) -> float:
        """Length of the sub-steps of the step that is set up, s."""
        return float(self._step.h)

    @property
    def parts(self) -> int:
        """Parts of the step that is set up: contacts are looked for again between them."""
        return self._step.parts

    def _report_fastest(self, run: Run, members: np.ndarray, looks: int, ahead: float) -> None:
        """Say that a member moves too fast: the one whose surface passes most of its own inner radii."""
        now = run.state.now
        speed = length(now.velocity[members]) + self.reach[members] * length(now.angular_velocity[members])
        i = int(members[np.argmax(speed / self.inner[members])])
        message = TOO_FAST_REMEDY.format(looks=looks, ahead=ahead, most=MOST_LOOKS)
        run.log.report(run.state.time, "too fast for sub-steps", (self.world.names[i],), message)

    def _go_on(self, run: Run, last: int) -> None:
        """Go on with the step that is set up to the stage `last`, or to its end."""
        while (how := self._try_stages(last)) != AT_STAGE:
            if how == SHARE:
                self._share_stage(run)
            else:
                self._make_space(how, int(self._progress[NEEDED]))

    def _try_stages(self, last: int) -> int:
        """Go on as far as memory and one core go; returns why not farther."""
        if not self._has_general:
            return go_on_with_polyhedra(self.simd, self.island, self._memory(), self._step, self._progress, last)
        return go_on(self.simd, self.island, self._memory(), self._general(), self._step, self._progress, last)

    def _memory(self) -> Memory:
        """The arrays as they are now; the same tuple as long as they are the same, as in `ContactTable.arrays`."""
        table = self.table
        now = (
            table.arrays, table.lines, self._places, self._margins, self._workspaces[0], self._patches, self._lists, self._target,
            self._batches, self._begins, self._places_of_bodies, self._work_queue, self._waypoints,
        )  # fmt: skip
        if self._held is None or any(array is not other for array, other in zip(now, self._held, strict=True)):
            self._held = Memory(*now)
        return self._held

    def _general(self) -> General:
        """What general pairs need; the same tuple, likewise."""
        asked, contacts = self._asked, self._buffers[0].contacts
        if self._general_held is None or self._general_held.asked is not asked or self._general_held.contacts is not contacts:
            self._general_held = General(self.smaller, self._deep, asked, contacts)
        return self._general_held

    def _make_space(self, how: int, needed: int) -> None:
        """Make space for what had none."""
        if how == NEEDS_GENERAL:
            self._has_general = True
        elif how == MORE_PLACES:
            self._workspaces = [make_workspace(2 * needed) for _ in self._workspaces]
            self.table.grow(2 * needed)
        elif how == MORE_POINTS:
            self.table.grow(needed)
        elif how == MORE_ASKED:
            self._asked = make_asked(2 * needed, LEVELS * self.world.num_bodies)
        elif how == MORE_CONTACTS:
            self._buffers[0].grow(needed)
        elif how == MORE_PATCHES:
            self._patches = more_patches(self._patches, needed)
            self._lists, self._target = _special_lists(needed)
        elif how == MORE_COLOURS:
            self._begins = np.concatenate([self._begins, np.zeros(needed, np.int64)])
        elif how == MORE_WAYPOINTS:
            self._waypoints = grown_waypoints(self._waypoints, needed)
        else:
            self._batches = more_batches(self._batches, needed, self.simd.width)

    def _share_stage(self, run: Run) -> None:
        """Do the present stage of the step."""
        stage = self._progress[STAGE]
        if stage == FIND:
            self._find_contacts()
        elif stage == MARK:
            self._look_at_general(run)
        else:
            self._work_queue[:] = empty_work_queue()
            self._sharing.call(work_on, [
                (self.simd, self.island, self._memory(), self._step, self._progress, share, self._sharing.solvers)
                for share in range(min(self._shares, self._sharing.solvers))
            ])  # fmt: skip
            self._progress[STAGE] = KEEP

    def _find_contacts(self) -> None:
        """Find the contacts of pairs that are not general, on several cores."""
        table, progress, shares, limits = self.table, self._progress, self._shares, limits_of.py_func(self._step, self._progress)
        while True:
            outcome = self._sharing.call(find_contacts, [
                (
                    self._convex, self.bodies, table.arrays, Share(share, shares, self._places, self._margins), limits,
                    self.world.coefficients, self._workspaces[share],
                )
                for share in range(shares)
            ])  # fmt: skip
            # A share whose points were too few says so; all shares are searched again with more.
            lacks = min(waiting for _, waiting in outcome)
            if lacks >= 0:
                break
            self._make_space(int(MORE_PLACES if lacks == TOO_FEW_PLACES else MORE_POINTS), len(self._workspaces[0].parts.real))
        begins = [share_of(len(table.pairs.first), share, shares) for share in range(shares)]
        waits = np.concatenate([np.arange(begin, begin + waiting) for begin, (_, waiting) in zip(begins, outcome, strict=True)])
        # In order of the pairs, however many shares there are.
        waits = waits[np.argsort(self._places[waits])]
        self._places[: len(waits)], self._margins[: len(waits)] = self._places[waits], self._margins[waits]
        progress[LOOKED_AT], progress[WAITING] = sum(looked_at for looked_at, _ in outcome), len(waits)
        progress[STAGE] = ASK if len(waits) else PLAN

    def _look_at_general(self, run: Run) -> None:
        """Find the contacts of general pairs that have been asked about, on several cores."""
        count, asked, shares, buffers = int(self._progress[WAITING]), self._asked, self._shares, self._buffers
        pairs, places = self.table.pairs, self._places[: count]
        self._sharing.call(mark_apart, [
            (self.smaller, self.bodies, asked, pairs, places, (count * share // shares, count * (share + 1) // shares))
            for share in range(shares)
        ])  # fmt: skip
        while len(buffers) < shares:
            buffers.append(ContactBuffer(self._sharing.buffer, keeps=True))
        # A pair goes to the same buffer each time: what is near is kept there.
        share = (asked.a[:count] + asked.b[:count]) % shares
        parts = [np.flatnonzero((share == k) & ~asked.is_apart[:count]) for k in range(shares)]
        now = run.state.now._replace(position=asked.position, orientation=asked.orientation)
        shapes = Shapes(self.smaller.geometry, self.smaller.of_body)
        questions = [
            Question(shapes, now, asked.rotation, PairQuery(asked.a[part], asked.b[part], asked.shown[part])) for part in parts
        ]  # fmt: skip
        for part, buffer, found in zip(parts, buffers, find_together(buffers, questions), strict=True):
            self._store(places[part], self._margins[part], asked._replace(far=asked.far[part]), buffer, found)

    def _store(self, places: np.ndarray, margins: np.ndarray, asked: Asked, buffer: ContactBuffer, found: int) -> None:
        """Put the contacts of general pairs (k,) into the table."""
        progress = self._progress
        progress[[STAGE, WAITING, FOUND]] = STORE, len(places), found
        while True:
            memory = self._memory()._replace(places=places, margins=margins)
            general = self._general()._replace(asked=asked, contacts=buffer.contacts)
            how = go_on(self.simd, self.island, memory, general, self._step, progress, PLAN)
            if how == AT_STAGE:
                return
            self._make_space(how, int(progress[NEEDED]))

    def inside_others(self, run: Run, asked: np.ndarray) -> np.ndarray:
        """Which bodies (n,) bool of those asked for, brought to the present, are inside others: the exact regime must not get them.

        It looks for contacts up to a few contact margins deep: a box that a turning bar pushed was deeper, and flew through that.
        And it cannot find surfaces that cross: it took a ring that lay 10 um inside a floor for one that is past it.
        """
        out = np.zeros(self.world.num_bodies, bool)
        if not asked.any():
            return out
        pairs, depth, mine = self.table.pairs, self.smaller.depth, asked[self.order]
        which = np.flatnonzero((mine[pairs.first] | mine[pairs.second]) & (pairs.count > 0))
        p, gap = self._gaps(which)
        a, b = self.order[pairs.first[p]], self.order[pairs.second[p]]
        seen = LOOKS_FOR * self.world.margins.contact * np.minimum(self.world.size[a], self.world.size[b])
        deep = p[gap < -np.minimum(seen, np.minimum(self.bodies.skin[pairs.first[p]], self.bodies.skin[pairs.second[p]]))]
        out[self.order[np.append(pairs.first[deep], pairs.second[deep])]] = True
        out &= asked
        if not depth.any():
            return out
        world, now = self.world, run.state.now
        which = (mine[pairs.first] | mine[pairs.second]) & (depth[pairs.first] + depth[pairs.second] > 0.0)
        for i, j in zip(self.order[pairs.first[which]].tolist(), self.order[pairs.second[which]].tolist(), strict=True):
            posed = [Posed(int(world.shape_of_body[k]), now.position[k], to_matrix(now.orientation[k])) for k in (i, j)]
            if pair_gap(world.geometry, posed[0], posed[1], self.skin[[i, j]].min(), np.zeros(7)) <= 0.0:
                out[[i, j]] = asked[[i, j]]
        return out

    def _gaps(self, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gaps (c,) m of all contact points of pairs (k,) as the bodies are now, and whose they are (c,)."""
        pairs, bodies = self.table.pairs, self.bodies
        p = np.repeat(which, pairs.count[which])
        begins = np.repeat(pairs.start[which] - (np.cumsum(pairs.count[which]) - pairs.count[which]), pairs.count[which])
        points = self.table.points[begins + np.arange(len(p))]
        a, b, q = pairs.first[p], pairs.second[p], bodies.orientation
        from_a = bodies.position[a] + rotate(q[a], points[:, SKELETON_A : SKELETON_A + 3])
        from_b = bodies.position[b] + rotate(q[b], points[:, SKELETON_B : SKELETON_B + 3])
        normal = rotate(q[np.where(pairs.carrier[p], b, a)], points[:, :3])
        return p, dot(from_b - from_a, normal) - points[:, ROUND_A] - points[:, ROUND_B]

    def report_crossed(self, run: Run, members: np.ndarray, time: float) -> None:
        """Report pairs of members, brought to the present, whose inset surfaces cross: the place of contact is not known any more."""
        pairs, world, now = self.table.pairs, self.world, run.state.now
        mine = np.zeros(world.num_bodies, bool)
        mine[self.rank[members]] = True
        asked = (mine[pairs.first] | mine[pairs.second]) & (pairs.kind == GENERAL)
        # Smaller shapes take long to make: they are not made for this.
        if not asked.any():
            return
        smaller, depth, n = self.smaller, self.smaller.depth, world.num_bodies
        asked &= depth[pairs.first] + depth[pairs.second] > 0.0
        for i, j in zip(self.order[pairs.first[asked]].tolist(), self.order[pairs.second[asked]].tolist(), strict=True):
            a, b, limit = int(smaller.of_body[n + i]), int(smaller.of_body[n + j]), CROSSED * min(self.inner[i], self.inner[j])
            rotation = to_matrix(now.orientation[i]), to_matrix(now.orientation[j])
            posed = Posed(a, now.position[i], rotation[0]), Posed(b, now.position[j], rotation[1])
            if pair_gap(smaller.geometry, *posed, limit, np.zeros(7)) < limit:
                run.log.report(
                    time, "overlap in a sub-stepped island", (world.names[min(i, j)], world.names[max(i, j)]),
                    "the bodies are deeper inside each other than their contacts can tell; use a smaller step",
                )  # fmt: skip

    def move_apart(self, run: Run, fresh: np.ndarray, time: float) -> None:
        """Move members that are fresh apart from each other and from all else to the gaps of contacts; their speeds pay."""
        bodies, now, at = self.bodies, run.state.now, self.rank[fresh]
        mine = np.zeros(len(bodies.part), bool)
        mine[at] = True
        before = bodies.position.copy()
        if not move_apart(bodies, self.table.pairs, self.table.points, mine):
            return
        slowed = pay_for_rise(self.balance, bodies, self._weights, self.table.pairs, bodies.position - before, at)
        for i in fresh[slowed].tolist():
            run.log.report(time, "motion taken in a sub-stepped island", (self.world.names[i],), MOTION_TAKEN_REMEDY)
        now.position[fresh], now.orientation[fresh] = bodies.position[at], bodies.orientation[at]
        velocity = bodies.velocity.reshape(-1, ROW)[self.rank[self.members]]
        now.velocity[self.members], now.angular_velocity[self.members] = velocity[:, :3], velocity[:, 3:6]
        refresh_pose(fresh, now, run.state.rotation, self.world.inertia)
        begin_balance(self.balance, bodies, self._weights)

    def step(self, run: Run, begin: float, end: float) -> Outcome:
        """Step what was loaded from `begin` to `end`, s."""
        has_frames = self.begin_step(run, begin, end)
        self._go_on(run, END)
        out = self._outcome(self._waypoints if has_frames else None)
        out.is_found = bool(unload_pressed(self.island, *out.places, self.pressed))
        out.energies[GIVEN] = 0.0
        return out

    def step_by(self, run: Run, solve: Callable[[int, float], None]) -> None:
        """Step what was set up, and begun, with another solver; solve: makes as many sub-steps of such a length, s, and waypoints."""
        progress = self._progress
        self._step = self._step._replace(all_quick=True, has_frames=False)
        self._go_on(run, LIST)
        while progress[STAGE] != END:
            solve(int(progress[SOME]), self._step.h)
            progress[STAGE] = NEXT
            self._go_on(run, LIST)

    def begin_step(self, run: Run, begin: float, end: float) -> bool:
        """Begin the step of what was loaded; returns whether frames fall between `begin` and `end`, s."""
        has_frames = run.recorder.has_frames(begin, end)
        self._step = self._step._replace(has_frames=has_frames)
        self._waypoints.number[0] = 0
        return has_frames

    def end_step(self, waypoints: Waypoints | None) -> Outcome:
        """Balance the energy, and say where the members are; waypoints: of all bodies, by rank."""
        out = self._outcome(waypoints)
        unload_island(self.island, *out.places)
        return out

    def _outcome(self, waypoints: Waypoints | None) -> Outcome:
        """Space for where the members are; waypoints: of all bodies, by rank."""
        at, k = self.rank[self.members], len(self.members)
        own = None if waypoints is None else waypoints_of(waypoints, at)
        return Outcome(self.members, at, np.empty((k, 3)), np.empty((k, 4)), np.empty((k, 6)), np.empty((3, k)), own)


def _special_lists(patches: int) -> tuple[np.ndarray, np.ndarray]:
    """Lists of special patches, and their targets, of as many patches."""
    return reserve((3, 2 * patches), np.int64), reserve((patches, POINTS), np.float64)
