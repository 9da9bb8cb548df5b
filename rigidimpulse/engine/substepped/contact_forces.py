"""One step of sub-stepped islands: bodies are handed to the kernels, contacts found, sub-steps taken, energy balanced."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_buffer import ContactBuffer, Question, find_together
from rigidimpulse.collision.contact_cache import (
    TOO_FEW_PLACES,
    Convex,
    Limits,
    Share,
    classify,
    find_contacts,
    make_workspace,
    most_approach,
    most_motion,
    most_turn,
    note_changes,
    share_of,
)
from rigidimpulse.collision.contact_records import MEMBER, OUTSIDE, SUPPORT
from rigidimpulse.collision.contact_table import ContactTable
from rigidimpulse.collision.contact_update import Searched, SmallerShapes, ask_general, make_asked, mark_apart, store_contacts
from rigidimpulse.collision.fat_boxes import BodyBounds, FatBoxes
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.contact_points import TILT
from rigidimpulse.collision.manifold.dispatch import GENERAL, PairQuery, Posed, pair_gap
from rigidimpulse.collision.manifold.inset_surface import inset_surfaces
from rigidimpulse.collision.manifold.penetrating import solids
from rigidimpulse.collision.manifold.polyhedra import make_polyhedra
from rigidimpulse.collision.manifold.shrunk_shapes import convex_polyhedra, inner_radii, several_polyhedra, shrunk_geometry
from rigidimpulse.core.memory import reserve
from rigidimpulse.core.portable import length
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.core.simd import ROW, aligned
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.workers import empty_work_queue
from rigidimpulse.dynamics.impact.restitution import LAWS
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import SolverBodies, load_bodies
from rigidimpulse.dynamics.solvers.tgs_soft.body_motion import mark_quick, note_pressed
from rigidimpulse.dynamics.solvers.tgs_soft.depenetration import move_apart
from rigidimpulse.dynamics.solvers.tgs_soft.energy_balance import (
    Weights,
    begin_balance,
    connect,
    end_balance,
    make_balance,
    pay_for_rise,
)
from rigidimpulse.dynamics.solvers.tgs_soft.fill import fill, keep_impulses, place_bodies
from rigidimpulse.dynamics.solvers.tgs_soft.records import (
    POINTS,
    Batches,
    colour_patches,
    empty_patches,
    leave_out_quick,
    list_patches,
    more_batches,
    more_patches,
    place_patches,
)
from rigidimpulse.dynamics.solvers.tgs_soft.solver import FREQUENCY, Solve, SpecialPatches, advance, softness, special_patches
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.model.world import World
from rigidimpulse.motion.evaluate import refresh_pose

COLUMN = 20.0
"""Bodies whose weight may press the skin in by PRESSED."""
PRESSED = 0.25
LEAST_SUB_STEPS = 16
"""Sub-steps in a whole step."""
UNLIKE, MOST_UNLIKE = 6.0, 96.0
"""How many times as heavy as a body one that it touches is, from which sub-steps go with the root of it, and to which: a light body bears a
heavy one by impulses that sub-steps find bit by bit. A box under a ball of 25 times its mass was up to 5 skins inside the floor."""
SPAN = 1.0
"""Longest time that is stepped at once, in sqrt(r / g) of the smallest inner radius r."""
CROSSED = TOLERANCES.sub_stepping.crossed
LEAST_SUB_STEPS_BETWEEN = 2
"""Sub-steps from look to look."""
COARSEST = 0.3
"""Inner radii by which bodies with inset surfaces may pass each other from look to look: sub-steps are made shorter for it."""
TURNED = 2.0 * TILT
"""Angle by which meshes may turn against each other from look to look, rad: of their corners those that come down by less are found. A die
that turned by twice that over an edge, in a cup, was 3.5 mm inside of it."""
MOST_LOOKS = 1024
"""Looks for contacts in what is stepped at once that speed may ask for. Beyond that an island would cost more than it advances: a light
rod that a heavy press had spun up to 15,000 rad/s took 60,000 sub-steps in 1/60 s. Bodies may then pass each other: the status says so."""
SAME, KEPT = 0.02, 0.2
"""Parts of the motion until a look (`Accuracy.substep_motion`) that a pair may make with the contacts it has: at any time, and in the
middle of a step."""
QUICK = 0.4
"""Part of `kept` beyond which a body is quick: its contacts are looked for, and their records made, again in the middle of a step."""
MOSTLY = 0.3
"""Part of the bodies that are quick beyond which all count as such."""
_NO_STEADY = 0, np.zeros(1, np.int64)
"""Patches, and edges of the colours of batches, that were made before the last find_contacts."""
TOO_FAST_REMEDY = "contacts would have to be looked for {looks} times in {ahead:.2g} s, and were {most} times; use a smaller step"
CLEAR = 0.2
"""Inner radii within which bodies may meet, beside the way they go."""
MOTION_TAKEN_REMEDY = "it was raised to the margin of contacts, and its speed paid for that; contact_solver='newton' needs no such margin"


class Parts(NamedTuple):
    """Parts of the settings `step` and `substep_motion` that bodies without joints are stepped with."""

    step: float  # of `step`, what is stepped at once at most
    sub_step: float  # of the longest sub-step
    motion: float  # of `substep_motion`, until touching bodies are looked at again
    straight: float  # of `substep_motion`, skins by which trajectories may stray from the ways of turning bodies


COARSE = Parts(1.0, 1.0, 1.0, 10.0)
"""For crowds."""
FINE = Parts(1.0 / 2.0, 1.0 / 8.0, 1.0 / 2.0, 5.0)
"""For scenes that are no crowd (`regime.CROWD`): no body is deeper in another than the skin in thirty scenes of 12 to 60 bodies, where in
nine of them one was, up to 13 skins (`tests/bench/both_regimes.py`)."""
FINEST = Parts(1.0 / 8.0, 1.0 / 32.0, 1.0 / 2.0, 1.0)
"""For islands of scenes of few bodies that stand in for exact ones: a row of dominoes keeps its energy to 1e-7 of it."""


@dataclass
class Outcome:
    """Result of a step: bodies (k,) of the scene in the solver's order, and their poses and velocities (k, 6) at its end.

    taken, raised: (k,) J that the balance of energy took off their speeds, and that they gained and could not pay.
    given: (k,) J, work of drives and moving supports in islands with joints.
    """

    members: np.ndarray
    position: np.ndarray
    orientation: np.ndarray
    velocity: np.ndarray
    taken: np.ndarray
    raised: np.ndarray
    given: np.ndarray


def joined_outcomes(outcomes: list[Outcome]) -> Outcome:
    """The outcomes of several sets of bodies as one; there is at least one."""
    if len(outcomes) == 1:
        return outcomes[0]
    return Outcome(*(np.concatenate([getattr(out, column.name) for out in outcomes]) for column in fields(Outcome)))


@dataclass(frozen=True)
class Fineness:
    """How finely a set of bodies is stepped.

    Attributes:
        sub_step: s, the longest. motion: inner radii that touching bodies move until they are looked at again.

    """

    sub_step: float
    motion: float


class ContactStepper:
    """Steps sets of bodies by the sub-stepped solver; holds what does not change, and the contacts.

    Attributes:
        order: (n,) bodies by their places at the start of the run; rank: (n,) place of each in it.
        inner: (n,) m, distance from the centre of mass to the nearest face; inf for what cannot be moved. skin: (n,) m.
        step_length: s, that is stepped at once at most; motion: inner radii, see `Accuracy.substep_motion`.
        kept: inner radii that a pair may come past each other with the contacts it has, in the middle of a step.
        straight: skins by which trajectories may stray from the ways of turning bodies.
        bodies: by rank. table: pairs and contact points. balance: of their energy. sub_steps, parts: of the step that is set up; between
            parts contacts are looked for again. pressed: (n,) bool, contacts acted on the body when it was last stepped.

    """

    def __init__(self, world: World, movable: np.ndarray, parts: Parts, sharing: Sharing | None = None) -> None:
        """Make the arrays of the bodies; shrink the shapes for the contact kernels.

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
        dynamic_shapes = np.zeros(len(world.geometry.shape_first) - 1, bool)
        dynamic_shapes[world.shape_of_body[movable]] = True
        self.inner = np.where(movable, inner_radii(world.geometry, world.convex_depths)[world.shape_of_body], np.inf)
        self.skin = TOLERANCES.sub_stepping.skin * self.inner
        self.reach = np.where(world.ball, 0.0, world.bound_radius)
        convex = convex_polyhedra(world.geometry, world.convex_depths)
        # Soft contacts sink in, and the contact kernels need a gap: smaller shapes for the search.
        inset, depth, back = inset_surfaces(world.shapes, world.geometry, convex, dynamic_shapes)
        self.geometry, factor = shrunk_geometry(inset, world.convex_depths, dynamic_shapes)
        self.shapes = make_polyhedra(world.geometry, convex, several=several_polyhedra(world.geometry))
        solid_shapes, drum, inset_of_solids = solids(world.shapes, world.geometry, convex, self.shapes)
        convex |= drum
        kinds = world.shape_of_body[self.order]
        self._depth = depth[kinds]
        self._smaller = SmallerShapes(world.geometry, self.geometry, factor[kinds], back, self._depth, convex[kinds], solid_shapes)
        self._convex, self._asked = Convex(self.shapes, solid_shapes, inset_of_solids), make_asked(0, n)
        bound = np.where(np.isfinite(world.bound_radius), world.bound_radius, 0.0)
        self._cornered = (world.flat & ~world.half_space)[self.order]
        self._taken_off = self._depth + (1.0 - self._smaller.factor) * bound[self.order]
        self.bodies = self._make_bodies()
        self._weights = Weights(world.mass[self.order], np.ascontiguousarray(world.steady_acceleration[self.order]))
        self.balance = make_balance(n)
        self._shares, self._looked_at = self._sharing.most_cores, 0
        self._workspaces = [make_workspace() for _ in range(self._shares)]
        self._buffers: list[ContactBuffer] = []
        self.table = ContactTable(self._shares, n, self._sharing.first_points, self._sharing.points_of_a_body)
        least = CLEAR * np.where(movable, self.inner, 0.0)
        moves = world.dynamic | world.moving
        bounds = BodyBounds(self.order, moves, world.bound_radius, self.inner, least, world.static_min, world.static_max)
        self.fat_boxes = FatBoxes(bounds, world.dynamic, world.may_collide if len(world.apart) else None)
        self.simd, patches = self._sharing.simd, self._sharing.patches_of_a_body * n
        self._patches, self._count, self._steady = empty_patches(patches), 0, _NO_STEADY
        none = Batches(np.zeros(0, np.float32), np.zeros(0), *np.zeros((4, 0), np.int32))
        self._batches = more_batches(none, patches // self.simd.width + 1, self.simd.width)
        self._begins, self._edges = np.zeros(256, np.int64), np.zeros(1, np.int64)
        self._work_queue = empty_work_queue()
        self._places_of_bodies = aligned(n + 1)
        self._part = np.zeros(n, np.int64)
        self.step_length = world.accuracy.step * parts.step
        self._least_sub_steps = LEAST_SUB_STEPS / parts.sub_step
        self.motion = world.accuracy.substep_motion * parts.motion
        self.straight = world.accuracy.substep_motion * parts.straight
        self.kept = KEPT * self.motion
        # Balls and moving supports: all contacts are found again in the middle of a step.
        self._all_quick = bool(world.moving.any() or world.ball.any())
        self._special = self._all_quick or bool(world.coefficients[:, :, :2].any())
        self.pressed = np.zeros(n, bool)
        self._places, self._margins = np.zeros(0, np.int64), np.zeros(0)
        self.members, self.ahead, self.parts, self.sub_steps, self._pull = np.zeros(0, np.int64), 0.0, 1, 1, 0.0
        self._usual = self.step_length

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
            gravity=np.zeros((n + 1, 3)), velocity=aligned(n + 1), before=aligned(n + 1), moved=aligned(n + 1), drift=aligned(n + 1),
            quick=np.zeros(n + 1, bool), mass=aligned(n + 1), change=np.zeros(n + 1), held=np.zeros(n + 1, bool),
        )  # fmt: skip

    def sub_step(self, members: np.ndarray) -> float:
        """Length of a sub-step, s: short enough for the load of a column, so that it scales with the size of bodies."""
        strength = float(self.world.steady_strength[members].max())
        step, pieces = self.world.accuracy.step, self._least_sub_steps
        if strength > 0.0:
            # The load of k bodies presses the skin in by k g / w^2, w = 2 pi F / h.
            h = 2.0 * math.pi * FREQUENCY * math.sqrt(PRESSED * float(self.skin[members].min()) / (COLUMN * strength))
            pieces = max(math.ceil(step / h), pieces)
        return step / pieces

    def _unlike(self) -> float:
        """How many times as many sub-steps bodies of unlike masses ask for that touch each other."""
        pairs, mass = self.table.pairs, self._weights.mass
        inside = (pairs.count > 0) & (self._part[self.order[pairs.first]] == MEMBER) & (self._part[self.order[pairs.second]] == MEMBER)
        a, b = mass[pairs.first[inside]], mass[pairs.second[inside]]
        ratio = float((np.maximum(a, b) / np.minimum(a, b)).max(initial=1.0))
        return math.sqrt(max(min(ratio, MOST_UNLIKE) / UNLIKE, 1.0))

    def span(self, members: np.ndarray, step: float) -> float:
        """Longest time of a step [s] that members are stepped at once, s: bodies may fall by half an inner radius in it."""
        strength = float(self.world.steady_strength[members].max())
        return min(step, SPAN * math.sqrt(float(self.inner[members].min()) / strength)) if strength > 0.0 else step

    def find_pairs(self, run: Run, members: np.ndarray, others: np.ndarray, ahead: float) -> None:
        """See that the pairs hold all that members may meet in `ahead` s, among themselves and of the others."""
        found = self.fat_boxes.renewed(run.state.now, run.acceleration, members, others, ahead)
        if found is not None:
            self.table.replace(*found)
            classify(self.table.pairs, self.bodies, self.shapes)

    def near(self, run: Run, member: np.ndarray, other: np.ndarray, ahead: float) -> np.ndarray:
        """Pairs (3, k) of members with each other and with others, (n,) bool each, that may meet in `ahead` s, see `FatBoxes.near`."""
        return self.fat_boxes.near(self.table.pairs, run.state.now, run.acceleration, member, other, ahead)

    def set_up(
        self, run: Run, members: np.ndarray, supports: np.ndarray, ahead: float, kept: float = 0.0, fineness: Fineness | None = None
    ) -> None:
        """Put members and what they may touch before the kernels at the present instant, with their contacts.

        kept: see `review`; fineness: None for that of bodies without joints.
        """
        self.find_pairs(run, members, supports, ahead)
        self.table.pack()
        self.members = members
        self._part[:] = OUTSIDE
        self._part[supports], self._part[members] = SUPPORT, MEMBER
        fineness = fineness or Fineness(self.sub_step(members) / self._unlike(), self.motion)
        load_bodies(self.bodies, self.order, run.state.now, run.acceleration, self.world.inv_mass, self._part)
        self._pull = float(self.world.steady_strength[members].max(initial=0.0))
        self._note_changes(ahead)
        motion = most_motion(self.bodies, self.table.pairs, ahead)
        # Fast bodies are looked at more often, with enough sub-steps between the looks. So are those that come from farther than
        # contacts are looked for: a big ball met small bricks only when it was a third inside of them (issue 28).
        needed = math.ceil(max(self._pieces(motion, ahead), most_approach(self.bodies, self.table.pairs, ahead, self._fall(ahead))))
        if needed > MOST_LOOKS:
            self._report_fastest(run, members, needed, ahead)
            needed = MOST_LOOKS
        self.sub_steps = max(math.ceil(ahead / fineness.sub_step - 1e-9), LEAST_SUB_STEPS_BETWEEN * needed, 1)
        most = max(self.sub_steps // LEAST_SUB_STEPS_BETWEEN, 1)
        self.parts = min(max(math.ceil(motion / fineness.motion), needed, 1), most)
        self.ahead, self._usual = ahead / self.parts, fineness.sub_step
        self._look(run, kept)

    def _report_fastest(self, run: Run, members: np.ndarray, looks: int, ahead: float) -> None:
        """Say that a member moves too fast: the one whose surface passes most of its own inner radii."""
        now = run.state.now
        speed = length(now.velocity[members]) + self.reach[members] * length(now.angular_velocity[members])
        i = int(members[np.argmax(speed / self.inner[members])])
        message = TOO_FAST_REMEDY.format(looks=looks, ahead=ahead, most=MOST_LOOKS)
        run.log.report(run.state.time, "too fast for sub-steps", (self.world.names[i],), message)

    def _pieces(self, motion: float, ahead: float) -> float:
        """Pieces into which `ahead` s is cut, so that pairs that have contacts are looked at often enough; motion: see `most_motion`."""
        return max(motion / COARSEST, most_turn(self.bodies, self.table.pairs, self._cornered, ahead) / TURNED)

    def _fall(self, ahead: float) -> float:
        """Half of what steady forces may add to a speed in `ahead` s, m/s."""
        return 0.5 * ahead * self._pull

    def _note_changes(self, ahead: float) -> None:
        """Note how much contacts may change velocities in `ahead` s."""
        note_changes(self.bodies, self.table.pairs, ahead, self._fall(ahead), self.world.coefficients)

    def _look(self, run: Run, kept: float) -> None:
        """Look at the contacts of all pairs in play, on several cores where the last look had much to do; kept: see `review`."""
        table, number = self.table, len(self.table.pairs.first)
        shares = self._shares if self._looked_at > self._sharing.pairs else 1
        capacity = share_of(number, shares, shares)
        if capacity > len(self._places):
            self._places, self._margins = reserve((2 * capacity,), np.int64), reserve((2 * capacity,), np.float64)
        while True:
            limits = Limits(self.ahead, SAME * self.motion, kept, self._fall(self.ahead))
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
            if lacks == TOO_FEW_PLACES:
                self._workspaces = [make_workspace(2 * len(workspace.parts.real)) for workspace in self._workspaces]
            table.grow(len(self._workspaces[0].parts.real))
        self._looked_at = sum(looked_at for looked_at, _ in outcome)
        if shares == 1:
            waits = slice(0, outcome[0][1])
        else:
            begins = [share_of(number, share, shares) for share in range(shares)]
            waits = np.concatenate([np.arange(begin, begin + waiting) for begin, (_, waiting) in zip(begins, outcome, strict=True)])
            # In order of the pairs, however many shares there are.
            waits = waits[np.argsort(self._places[waits])]
        if len(self._places[waits]):
            self._look_at_general(run, self._places[waits], self._margins[waits])

    def _look_at_general(self, run: Run, places: np.ndarray, margin: np.ndarray) -> None:
        """Find the contacts of pairs at `places` within margins (k,) m by the kernels of `collision.manifold`."""
        table, world, count = self.table, self.world, len(places)
        if count > len(self._asked.a):
            self._asked = make_asked(2 * count, world.num_bodies)
        asked, smaller = self._asked, self._smaller
        ask_general(smaller, self._taken_off, self.bodies, table.pairs, places, margin, self.order, asked)
        now = run.state.now._replace(position=asked.position, orientation=asked.orientation)
        shares, is_apart = self._shares if count > self._sharing.general_pairs else 1, np.zeros(count, bool)
        if self._depth.any():
            edges = pairwise(count * share // shares for share in range(shares + 1))
            self._sharing.call(mark_apart, [
                (smaller, world.shape_of_body, self.bodies, asked, table.pairs, places, edge, is_apart) for edge in edges
            ])  # fmt: skip
        while len(self._buffers) < self._shares:
            self._buffers.append(ContactBuffer(self._sharing.buffer, keeps=True))
        # A pair goes to the same buffer each time: what is near is kept there.
        share = (asked.a[:count] + asked.b[:count]) % self._shares
        parts = [np.flatnonzero((share == k) & ~is_apart) for k in range(self._shares)]
        shapes = Shapes(self.geometry, world.shape_of_body)
        questions = [
            Question(shapes, now, asked.rotation, PairQuery(asked.a[part], asked.b[part], asked.shown[part])) for part in parts
        ]  # fmt: skip
        for part, buffer, found in zip(parts, self._buffers, find_together(self._buffers, questions, shares > 1), strict=True):
            # Beside what was found, bodies that sank get contacts of their own, and each row is written before it is known to be kept.
            table.grow(found + POINTS * len(part) + 1)
            store_contacts(
                smaller, self.bodies, table.arrays, Searched(places[part], margin[part], asked.far[part]), (buffer.real, buffer.integer),
                found, self.order, world.coefficients,
            )  # fmt: skip

    def inside_others(self, run: Run, asked: np.ndarray) -> np.ndarray:
        """Which bodies (n,) bool of those asked for, brought to the present, have true surfaces inside others, where theirs are inset.

        Exact contact cannot find such a pair again: it took a ring that lay 10 um inside a floor for one that is past it.
        """
        out = np.zeros(self.world.num_bodies, bool)
        if not (self._depth.any() and asked.any()):
            return out
        pairs, world, now = self.table.pairs, self.world, run.state.now
        mine = asked[self.order]
        which = (mine[pairs.first] | mine[pairs.second]) & (self._depth[pairs.first] + self._depth[pairs.second] > 0.0)
        for i, j in zip(self.order[pairs.first[which]].tolist(), self.order[pairs.second[which]].tolist(), strict=True):
            posed = [Posed(int(world.shape_of_body[k]), now.position[k], to_matrix(now.orientation[k])) for k in (i, j)]
            if pair_gap(world.geometry, posed[0], posed[1], self.skin[[i, j]].min(), np.zeros(7)) <= 0.0:
                out[[i, j]] = asked[[i, j]]
        return out

    def report_crossed(self, run: Run, members: np.ndarray, time: float) -> None:
        """Report pairs of members, brought to the present, whose inset surfaces cross: the place of contact is not known any more."""
        if not self._depth.any():
            return
        pairs, world, now = self.table.pairs, self.world, run.state.now
        mine = np.zeros(world.num_bodies, bool)
        mine[self.rank[members]] = True
        asked = (mine[pairs.first] | mine[pairs.second]) & (self._depth[pairs.first] + self._depth[pairs.second] > 0.0)
        asked &= pairs.kind == GENERAL
        for i, j in zip(self.order[pairs.first[asked]].tolist(), self.order[pairs.second[asked]].tolist(), strict=True):
            a, b, limit = int(world.shape_of_body[i]), int(world.shape_of_body[j]), CROSSED * min(self.inner[i], self.inner[j])
            rotation = to_matrix(now.orientation[i]), to_matrix(now.orientation[j])
            posed = Posed(a, now.position[i], rotation[0]), Posed(b, now.position[j], rotation[1])
            if pair_gap(self.geometry, *posed, limit, np.zeros(7)) < limit:
                run.log.report(
                    time, "overlap in a sub-stepped island", (world.names[min(i, j)], world.names[max(i, j)]),
                    "the bodies are deeper inside each other than their contacts can tell; use a smaller step",
                )  # fmt: skip

    def _look_again(self, run: Run) -> None:
        """Find the contacts of quick bodies again in the middle of a step; those of all others stay in the steady batches."""
        bodies, width = self.bodies, self.simd.width
        all_quick = self._all_quick or mark_quick(bodies, self.ahead, QUICK * self.kept) > MOSTLY
        if all_quick:
            bodies.quick[:] = True
        self._note_changes(self.ahead)
        self._look(run, self.kept)
        # All batches are made again: what has drifted counts from here.
        if all_quick:
            bodies.drift[:] = 0.0
            self._steady = _NO_STEADY
        leave_out_quick(width, bodies, self.table.pairs, self._patches, self._steady[0], self._batches)

    def _fill(self, h: float) -> int:
        """Make patches, colours and records of quick bodies after the steady ones, for sub-steps of h s; returns the number of batches."""
        bodies, table, width, (begin, edges) = self.bodies, self.table, self.simd.width, self._steady
        first = int(edges[-1])
        count = list_patches(bodies, table.pairs, table.points, self._patches, begin)
        if count < 0:
            self._patches = more_patches(self._patches, -2 * count)
            count = list_patches(bodies, table.pairs, table.points, self._patches, begin)
        self._count = count
        number, colours = colour_patches(width, bodies, table.pairs, self._patches, begin, count, first, self._begins)
        if colours < 0:
            self._begins = np.zeros(1 - 2 * colours, np.int64)
            number, colours = colour_patches(width, bodies, table.pairs, self._patches, begin, count, first, self._begins)
        if number > len(self._batches.points):
            self._batches = more_batches(self._batches, 2 * number, width)
        self._edges = np.concatenate([edges[:-1], self._begins[: colours + 1]])
        place_patches(width, bodies, table.pairs, self._patches, (begin, count), self._batches, (first, number))
        place_bodies(bodies, self._places_of_bodies)
        fill(self.simd, self._batches, first, number, self._places_of_bodies, bodies.mass, table.lines, softness(h, self._usual))
        return number

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

    def step(self, run: Run, time: float, end: float) -> Outcome:
        """Step what `set_up` put before the kernels from `time` to `end`."""
        h = (end - time) / self.sub_steps
        self.begin_step()
        self._steady = _NO_STEADY
        for some in self.sub_steps_between(partial(self._look_again, run)):
            self._advance(some, h)
        note_pressed(self.bodies, self.order, self.pressed)
        out = self.end_step()
        out.given[:] = 0.0
        return out

    def sub_steps_between(self, look_again: Callable[[], None]) -> Iterator[int]:
        """Sub-steps from look to look, of a step that begins with a look; in between it looks again.

        What a look has found may be faster than what was known when the parts of the step were made: then a part is cut into more.
        """
        looked = True
        for part in range(self.parts):
            length = left = (part + 1) * self.sub_steps // self.parts - part * self.sub_steps // self.parts
            while left:
                if not looked:
                    look_again()
                ahead = self.ahead * left / length
                # Speeds may be no numbers by now: the end of the step finds them.
                pieces = max(math.ceil(min(left, self._pieces(most_motion(self.bodies, self.table.pairs, ahead), ahead))), 1)
                some = min(max(left // pieces, LEAST_SUB_STEPS_BETWEEN), left)
                yield some
                left, looked = left - some, False

    def begin_step(self) -> None:
        """Remember the energies of the members."""
        begin_balance(self.balance, self.bodies, self._weights)

    def look_again_at_all(self, run: Run) -> None:
        """Find the contacts of all bodies again in the middle of a step."""
        self._note_changes(self.ahead)
        self._look(run, self.kept)

    def end_step(self) -> Outcome:
        """Balance the energy, and say where the members are."""
        bodies, balance, members, at = self.bodies, self.balance, self.members, self.rank[self.members]
        # Sub-steps must not make energy beyond what moving supports and drives gave.
        given = balance.given[at]
        end_balance(balance, bodies, self._weights)
        velocity = bodies.velocity.reshape(-1, ROW)[at, :6]
        return Outcome(
            members, bodies.position[at], bodies.orientation[at], velocity, balance.taken[at], balance.raised[at], given
        )  # fmt: skip

    def _advance(self, sub_steps: int, h: float) -> None:
        """Sub-steps of h s with the contacts as they are known."""
        bodies, table, width = self.bodies, self.table, self.simd.width
        number, steady = self._fill(h), len(self._steady[1]) - 1
        connect(self.balance, bodies, table.pairs, self._patches, self._count)
        solve = Solve(bodies, table.pairs, self._patches, self._batches, table.points, self._edges, steady)
        lists, target = np.empty((3, 2 * self._count), np.int64), np.empty((self._count, POINTS))
        law = LAWS[self.world.accuracy.restitution]
        balls = rebounds = supports = 0
        if self._special:
            strength = float(self.world.steady_strength[self.members].max())
            balls, rebounds, supports = special_patches(
                width, solve, self._steady[0], self._count, self.world.coefficients, strength, lists, target
            )
        special = SpecialPatches(
            lists[0, :balls], lists[1, :rebounds], lists[2, :supports], target, self.world.coefficients, law, self.balance.given
        )
        shares = min(self._shares, self._sharing.solvers) if number * sub_steps > self._sharing.batches else 1
        self._work_queue[:] = empty_work_queue()
        self._sharing.call(advance, [
            (self.simd, solve, special, sub_steps, h, self._work_queue, share, shares) for share in range(shares)
        ])  # fmt: skip
        keep_impulses(self.simd, self._batches, number, table.lines)
        # The first part of a step has all contacts in its batches: they are the steady ones of later parts.
        if not steady:
            bodies.quick[:] = False
            self._steady = self._count, self._edges
