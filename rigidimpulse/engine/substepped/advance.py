"""Sub-stepped islands: which bodies are advanced by sub-steps, how they arrive, and when they sleep.

Islands are chosen at the start of a step (`regime.py`). Their bodies get trajectories (mode LINEAR) that end in the poses that the solver
found for the end of the step. Pairs inside such an island are not swept. Pairs of a member and any other body are swept: at their contact
the impulse is found exactly, and the island is stepped again from there, with the other body if it is slow enough. Contacts are held at a
gap, the skin.

A member is sleepy if it stays within SLEEP_MOTION skins of one place and below SLEEP_SPEED sqrt(g r) for REST sqrt(r / g) s (r: inner
radius). Sleepy members that no moving one wakes (`sleeping.wake_by_contact`) sleep: they stay exactly still and bear the others. An island
whose members are all asleep stands still until something touches it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rigidimpulse.collision.contact_buffer import Question
from rigidimpulse.collision.contact_records import MEMBER, SUPPORT
from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.dispatch import PairQuery
from rigidimpulse.core.portable import length
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.cheapest import CheapestRegime, Near
from rigidimpulse.engine.exact.advance import NOT_HELD
from rigidimpulse.engine.exact.energy_limit import note_end_energy
from rigidimpulse.engine.exact.step_begin import SolveCounts
from rigidimpulse.engine.exact.trajectories import account_contact_work, begin_trajectory
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.participants import Substepping
from rigidimpulse.engine.regime import (
    EXPENSIVE_TALL,
    FAST,
    SPIN,
    TALL,
    Judged,
    crowded,
    is_crowd,
    island_roots,
    jointed,
    lively,
    may_begin,
    only_expensive,
    refusals,
    roll,
    solves_in_islands,
    support_levels,
)
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.sleeping import advance_sleep_timers
from rigidimpulse.engine.substepped.contact_forces import COARSE, FINE, FINEST, ContactStepper, Fineness, Outcome
from rigidimpulse.engine.substepped.hand_over import HandOver
from rigidimpulse.engine.substepped.jointed import JointedStepper
from rigidimpulse.engine.substepped.member_paths import MemberPaths
from rigidimpulse.engine.substepped.membership import Candidates, connect_members, gather_members, settle_islands
from rigidimpulse.engine.substepped.sharing import Sharing
from rigidimpulse.engine.substepped.trajectories import depart, let_fly, mark_slow
from rigidimpulse.engine.substepped.undisturbed_step import KEEPS_CHEAP, KEEPS_LARGE, KEEPS_TOUCHING, Choice, Landing, is_undisturbed
from rigidimpulse.engine.substepped.undisturbed_steps import UndisturbedSteps
from rigidimpulse.engine.substepped.waypoints import way_of
from rigidimpulse.engine.warm_up import prepare_kernels
from rigidimpulse.model.contact_memory import held_pairs, rebounded_pairs
from rigidimpulse.model.island import Island, island_without_contacts
from rigidimpulse.model.world import World
from rigidimpulse.motion.evaluate import bring_all
from rigidimpulse.motion.trajectory import FIXED, LINEAR

NAME = "sub-stepped islands"
"""What `explain` calls them."""
WITHOUT_ROLLING = (
    "rolling and spinning friction do not act in sub-stepped islands, as large piles are: contact_solver='newton' has it, and may take long"
)
REST = 3.0
"""For how long members must have hardly moved to be sleepy, in sqrt(r / g), see `sleeping.py`."""
LEAVING = 0.1
"""Part of its speed at which a fast body must leave an island that it has hit to be no part of it."""
TOUCHES = 5.0
"""Skins within which a body at rest belongs to the island that comes near it."""
MOST_SOLVED = 40
"""Bodies without joints of which a step is made again with all contacts solved together, at most: that takes as long as ten steps."""
WEDGED = 8
"""Pieces of steps for which they are stepped so, before it is tried again without."""



class SubsteppedIslands:
    """The sub-stepped islands of a run.

    Attributes:
        label: (n,) the island that a body belongs to, -1 for none; sleeping ones keep theirs.
        sleep_timer: (n,) s, for how long a member has hardly moved.
        asleep: (n,) bool, members that stand still while others of their island move.
        hand_over: which exact islands come to sub-steps in the middle of a step.

    """

    def __init__(self, world: World, sharing: Sharing | None = None, rest: float = REST) -> None:
        """No island is sub-stepped yet.

        Args:
            world: the compiled scene.
            sharing: of the work by several cores; None: what suits this machine.
            rest: for how long members must have hardly moved to be sleepy, in sqrt(r / g); inf: none ever sleeps.

        """
        self._sharing, self._rest = sharing, rest
        solver = world.accuracy.contact_solver
        self._world, self._movable = world, world.dynamic.copy()
        finer = solver in ("auto", "substepped") and not is_crowd(world)
        self._parts = COARSE if not finer else FINEST if solver == "auto" and only_expensive(world) else FINE
        self.label = np.full(world.num_bodies, -1, np.int64)
        self.sleep_timer = np.zeros(world.num_bodies)
        self.asleep = np.zeros(world.num_bodies, bool)
        self._let_go = np.zeros(world.num_bodies, bool)
        self._root = np.zeros(world.num_bodies, np.int64)
        self._near_islands = Near(np.zeros(world.num_bodies, bool), np.zeros(world.num_bodies, bool))
        self._stood = np.full((world.num_bodies, 7), np.inf)
        self._taken = np.zeros(world.num_bodies, bool)
        self._auto = solver == "auto"
        self._jointed = jointed(world)
        self._stays = self._jointed | _tied(world)
        self._mean = np.zeros((world.num_bodies, 6))
        self.hand_over = HandOver(world, self._jointed, CheapestRegime(self._jointed) if solver == "cheapest" else None)
        self._joint_stepper: JointedStepper | None = None
        self._paths = MemberPaths(world, self.label)
        self._outcomes: list[tuple[Outcome, float]] = []
        self._outcome_begin = 0.0
        self._refused: dict[str, int] = {}
        self._said_it = False
        self._solved_again, self._wedged = 0, np.zeros(world.num_bodies, np.int64)

    @cached_property
    def stepper(self) -> ContactStepper:
        """The solver and its contacts; its kernels are compiled here where they were not needed at the start."""
        prepare_kernels(self._world, with_events=False, with_substepped=True)
        return ContactStepper(self._world, self._movable, self._parts, self._sharing)

    @cached_property
    def _limits(self) -> tuple[float, float]:
        """Beyond what bodies are too fast for the sub-steps that all movable bodies together would have, see `is_slow`."""
        # What is carried and let go later is among them.
        h = self.stepper.sub_step(np.flatnonzero([body.becomes_dynamic for body in self._world.scene.bodies]))
        return FAST / h, SPIN / h

    @cached_property
    def _candidates(self) -> Candidates:
        """What is known of the bodies where members are chosen."""
        world = self._world
        return Candidates(
            world.dynamic, world.moving, self._stays, world.mass, self.stepper.inner, world.steady_acceleration, world.steady_strength,
            self.label, self.sleep_timer, self.asleep, self._let_go,
        )  # fmt: skip

    @property
    def counts(self) -> SolveCounts:
        """How often the exact regime deals with the bodies."""
        return self.hand_over.counts

    def carry_on(self, earlier: Substepping, old: np.ndarray, new: np.ndarray) -> None:
        """Know of exact bodies `new` (k,) what an earlier run knew of them as `old` (k,)."""
        self.counts.solves[new] = earlier.counts.solves[old]
        if isinstance(earlier, SubsteppedIslands):
            self.hand_over.carry_on(earlier.hand_over, old, new)

    def is_idle(self) -> bool:
        """Whether no island is sub-stepped and none may begin to be."""
        return self._is_idle(np.maximum(self.counts.solves, 0.0))

    def _is_idle(self, solve_count: np.ndarray) -> bool:
        """The same for these counts (n,) of solves in the last step."""
        if np.any(self.label >= 0):
            return False
        if self.hand_over.cheapest is not None:
            return not self.hand_over.cheapest.may_begin(solve_count, int(np.count_nonzero(self._world.dynamic)), self._jointed)
        return self._auto and not may_begin(self.counts.most, self._jointed, solve_count)

    def let_go(self, bodies: np.ndarray) -> None:
        """What held bodies (k,) holds them no more: they and what stands on them do not sleep on."""
        self._let_go[bodies], self.sleep_timer[bodies] = True, 0.0

    def may_take(self, bodies: np.ndarray) -> bool:
        """Whether islands of bodies that no impulse keeps apart are handed over, see `HandOver.may_take`."""
        return self.hand_over.may_take(bodies)

    def summary(self) -> str:
        """What became of sub-stepped islands in the run."""
        refused = ", ".join(f"{reason} ({count})" for reason, count in sorted(self._refused.items()))
        text = f"{self._paths.steps} steps, largest {self._paths.most} bodies" if self._paths.steps else "none"
        if times := self.hand_over.times_handed_over():
            text += f", {times} times handed over by the exact regime in the middle of a step"
        if self._joint_stepper is not None:
            text += f", {self._joint_stepper.halved} sub-steps halved so that joints close" if self._jointed.any() else ""
            text += f", {self._solved_again} steps made again with all contacts solved together" if self._solved_again else ""
        return f"{text}; left to the exact regime, islands times steps: {refused}" if refused else text

    @cached_property
    def _undisturbed(self) -> UndisturbedSteps:
        """Takes steps in which nothing else moves."""
        world, cheapest, n = self._world, self.hand_over.cheapest, self._world.num_bodies
        rule = KEEPS_LARGE if self._auto else KEEPS_TOUCHING if cheapest is None else KEEPS_CHEAP
        cheapest = cheapest or CheapestRegime(self._jointed)
        choice = Choice(
            rule, self._limits, self._rest, self.counts, cheapest.costs, self._taken,
            np.zeros(n, bool), self._root, self._near_islands, np.zeros((0, 2), np.int64), np.zeros(n, bool),
        )  # fmt: skip
        landing = Landing(
            world.constants, self.label, np.zeros((4, n)), self._stood, self.sleep_timer, self.stepper.inner,
            self.stepper.skin,
        )  # fmt: skip
        return UndisturbedSteps(self.stepper, self._paths, self._candidates, choice, cheapest, landing)

    def take_undisturbed_steps(self, run: Run, end: float, until: float) -> PairEvents | None:
        """Take steps, the first one to `end` [s], as far as `until` [s], as long as nothing but members moves, see `undisturbed_steps`.

        Returns the pairs of a step that has begun and that the loop must finish; else None.
        """
        # Nobody looks at the run between such steps, no force is evaluated, and members without joints are asked for.
        watched = run.plan.observe or self._world.force_tables or self._jointed.any() or self._wedged.any()
        if watched or not self._taken.any() or not is_undisturbed(run.state.trajectory, self._world.constants):
            return None
        with run.plan.clock(NAME):
            return self._undisturbed.take(run, end, until)

    def choose(self, run: Run, pair_events: PairEvents) -> None:
        """Choose the islands of the step: `pair_events.inside` marks their bodies, `pair_events.asleep` the sleepers."""
        solve_count = self.hand_over.begin_step(pair_events.end)
        if self._is_idle(solve_count):
            return
        world, trajectory, time = run.world, run.state.trajectory, pair_events.begin
        ended = trajectory.mode == LINEAR
        # Those that undisturbed steps could not go on with have arrived.
        self._paths.arrive(run, np.flatnonzero(ended), time)
        chosen = self._choose(run, pair_events, solve_count) if pair_events.end > time else np.zeros_like(ended)
        # Members that are in no island any more fly freely.
        left = np.flatnonzero(ended & ~chosen & (trajectory.mode == LINEAR))
        if len(left):
            let_fly(trajectory, left, world.steady_acceleration)
            self.sleep_timer[left] = 0.0
        self._taken &= chosen
        self._wedged[~chosen] = 0
        self.asleep &= chosen
        pair_events.inside |= chosen
        pair_events.asleep |= (self.label >= 0) & (trajectory.mode == FIXED)

    def _choose(self, run: Run, pair_events: PairEvents, solve_count: np.ndarray) -> np.ndarray:
        """Which bodies (n,) bool are stepped; those whose trajectories ended are at the begin of the step already."""
        world, time, candidates, root = run.world, pair_events.begin, self._candidates, self._root
        member = np.empty(world.num_bodies, bool)
        number, left, resting = gather_members(run.motion, candidates, time, self._limits, member)
        if number == 0:
            return member
        if left:
            before = world.dynamic & ((run.state.trajectory.mode != FIXED) | self.asleep)
            member |= self.stepper.inside_others(run, before & ~member & (self.label >= 0))
        near = self.stepper.near(run, member, pair_events.end - time)
        # A member may touch a sleeping island, whose bodies then touch others.
        while resting and len(woken := self._touched(run, member, near)):
            member[woken] = True
            near = self.stepper.near(run, member, pair_events.end - time)
        links = np.concatenate([run.joints.links(), run.forces.links()])
        connect_members(near, links, candidates, member, root, self._near_islands)
        joined = np.zeros_like(member)
        if self._jointed.any():
            joined[run.joints.bodies_of(run.joints.at(np.flatnonzero(member & self._jointed)))] = True
        refused = self._refusals(run, pair_events, near, member, joined, solve_count)
        chosen = member & ~np.isin(root, list(refused)) if refused else member.copy()
        # Tall columns are found from contacts, so only in islands that are not refused yet.
        if self._auto and np.any(chosen & (self.label < 0)):
            exempt = joined | (solves_in_islands(root, solve_count) > EXPENSIVE_TALL)[root] | crowded(root, near[0, near[2] > 0])[root]
            chosen = self._low(run, pair_events, chosen, root, exempt, refused)
        for reason in refused.values():
            self._refused[reason] = self._refused.get(reason, 0) + 1
        if refused:
            self.label[member & ~chosen] = -1
        self._say_what_does_not_roll(run, chosen, near, time)
        self._settle(run, chosen, near, links, time)
        return chosen

    def _refusals(
        self, run: Run, pair_events: PairEvents, near: np.ndarray, member: np.ndarray, joined: np.ndarray, solve_count: np.ndarray
    ) -> dict[int, str]:
        """Why islands stay exact, by their root; of tall ones see `_low`."""
        world, root = run.world, self._root
        if self.hand_over.cheapest is not None:
            refused = self.hand_over.cheapest.refusals(root, self.label, joined, self._near_islands, solve_count)
        else:
            moves = lively(run.state.now, world.steady_strength, self.stepper.inner)
            judged = Judged(root, self.label >= 0, joined, _struck(run, joined, pair_events.begin), moves, solve_count)
            refused = refusals(world, judged, (near[0], near[1]), self._auto)
        if self._world.force_tables and self._world.accuracy.contact_solver != "substepped":
            # At a hit half of a sub-step's force acts on what the body was before it: gravity does little by that, a stiff controller much.
            pulled = np.unique(root[joined & self._is_pulled_hard(run)]).tolist()
            refused.update(dict.fromkeys([r for r in pulled if r >= 0], "strong forces at joints"))
        if refused:
            inside = self.stepper.inside_others(run, member & (self.label >= 0) & np.isin(root, list(refused)))
            refused = {r: reason for r, reason in refused.items() if r not in root[inside]}
        if self.hand_over.open.any():
            refused.update(dict.fromkeys(np.unique(root[member & self.hand_over.open]).tolist(), "joints that sub-steps do not close"))
        return refused

    def _say_what_does_not_roll(self, run: Run, chosen: np.ndarray, near: np.ndarray, time: float) -> None:
        """Report once that rolling friction does not act in sub-stepped islands, where it would on chosen bodies (n,) bool."""
        world, (a, b) = self._world, near[:2]
        if not world.rolling.size or self._said_it or not chosen.any():
            return
        rolls = (chosen[a] | chosen[b]) & roll(world, a, b)
        if rolls.any():
            self._said_it = True
            bodies = np.union1d(a[rolls], b[rolls])
            names = tuple(world.names[i] for i in bodies[world.dynamic[bodies]].tolist())
            run.log.report(time, "effect left out", names, WITHOUT_ROLLING)

    def _is_pulled_hard(self, run: Run) -> np.ndarray:
        """Which bodies (n,) bool varying forces pulled or turned by more than gravity does, when they were evaluated last."""
        world, acted, out = self._world, np.flatnonzero(run.forces.acts), np.zeros(self._world.num_bodies, bool)
        force = np.abs(run.forces.value[acted])
        turned = force[:, 3:].max(axis=1) * self.stepper.inner[acted] / world.inertia[acted].min(axis=1)
        out[acted] = np.maximum(force[:, :3].max(axis=1) * world.inv_mass[acted], turned) > world.steady_strength[acted]
        return out

    def _leave_out_fast(self, run: Run, member: np.ndarray) -> None:
        """Unmark those that are too fast for sub-steps; what joints and forces join stays together, and is given more of them."""
        joined = member & self._stays
        mark_slow(run.state.now, self.stepper.inner, self._limits, member)
        member |= joined

    def _touched(self, run: Run, member: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Bodies at rest that members touch, and all of the islands they belong to."""
        world, links = run.world, np.concatenate([run.joints.links(), run.forces.links()])
        resting = world.dynamic & ~member & (run.state.trajectory.mode == FIXED)
        which = np.flatnonzero(resting[near[0]] | resting[near[1]])
        if not len(which):
            return which
        a, b = near[0, which], near[1, which]
        margin = TOUCHES * np.minimum(self.stepper.skin[a], self.stepper.skin[b])
        buffer = run.contact_buffer
        shapes = Shapes(self.stepper.smaller.geometry, self.stepper.smaller.of_body[world.num_bodies :])
        count = buffer.find(Question(shapes, run.state.now, run.state.rotation, PairQuery(a, b, margin)))
        touched = np.unique(buffer.integer[:count, :2])
        touched = touched[resting[touched]]
        labels = self.label[touched]
        # Sleeping islands wake as a whole, and so does what joints and forces join.
        joined = island_roots(world.num_bodies, links[:, 0], links[:, 1], world.dynamic)
        mates = np.isin(self.label, labels[labels >= 0]) | np.isin(joined, joined[touched])
        return np.flatnonzero(resting & mates)

    def _low(
        self, run: Run, pair_events: PairEvents, chosen: np.ndarray, root: np.ndarray, exempt: np.ndarray, refused: dict[int, str]
    ) -> np.ndarray:
        """Leave out islands that begin as tall columns; exempt (n,) bool: bodies whose islands may be."""
        begins = chosen & (self.label < 0) & ~np.isin(root, root[exempt])
        if not self._auto or not begins.any():
            return chosen
        begins &= ~np.isin(root, np.unique(root[chosen & ~begins]))
        if not begins.any():
            return chosen
        stepper = self.stepper
        self._load(run, np.flatnonzero(begins), pair_events.begin, pair_events.end - pair_events.begin, 0.0)
        stepper.look(run)
        level = support_levels(stepper.bodies, stepper.table.pairs, stepper.table.points, TALL)
        tall = np.unique(root[stepper.order[level[: len(root)] == TALL + 1]])
        tall = tall[tall >= 0]
        refused.update(dict.fromkeys(tall.tolist(), "tall"))
        return chosen & ~np.isin(root, tall)

    def _settle(self, run: Run, chosen: np.ndarray, near: np.ndarray, links: np.ndarray, time: float) -> None:
        """Label the islands; put to sleep those that have been sleepy for long, and members that are far from moving ones."""
        root, driven = self._root, np.zeros_like(chosen)
        if self._jointed.any():
            for r in np.unique(root[chosen & self._jointed]).tolist():
                driven[r] = self._is_driven(run, np.flatnonzero(chosen & (root == r)))
        if self._world.force_tables:
            acted = np.flatnonzero(chosen & run.forces.acts)
            for r in np.unique(root[acted]).tolist():
                driven[r] |= not run.forces.may_rest(acted[root[acted] == r])
        sleeps = settle_islands(run.state.now, self._candidates, near, links, chosen, root, driven, self._rest)
        if len(sleeps):
            self._paths.put_to_sleep(run, self.stepper, np.flatnonzero(sleeps & (run.state.trajectory.mode != FIXED)), time)

    def _is_driven(self, run: Run, members: np.ndarray) -> bool:
        """Whether joints of members hang from something that moves, or will let go."""
        which = run.joints.at(members[self._jointed[members]])
        return bool(len(which)) and (bool(run.world.moving[run.joints.bodies_of(which)].any()) or run.joints.will_let_go(which))

    def finish(self, run: Run) -> None:
        """Account for the energy of sub-steps that last until the end of the run, and tell the plan what was done."""
        refused = {f"refused: {reason}": count for reason, count in self._refused.items()}
        run.plan.tell(NAME, self.summary(), {"steps": self._paths.steps, "largest island": self._paths.most, **refused})
        members, time = np.flatnonzero(run.state.trajectory.mode == LINEAR), run.state.time
        if not len(members):
            return
        self._paths.end(run, members, time)
        self.stepper.report_crossed(run, members, time)
        let_fly(run.state.trajectory, members, run.world.steady_acceleration)

    def join(self, run: Run, pair_events: PairEvents, time: float, islands: list[Island]) -> list[Island]:
        """The islands at `time` with the sub-stepped ones that they touch; at the start of a step all that are sub-stepped."""
        self.hand_over.count(islands)
        if pair_events.end <= pair_events.begin:  # the end of the run: there is no time to step over
            return [island for island in islands if np.all(self.label[island.members] < 0)]
        for island in islands:
            exact = bool(np.all(self.label[island.members] < 0))
            if exact and self.hand_over.runs_away(run, island) and self.hand_over.hands_over(run, pair_events, island):
                self.label[island.members] = island.members.min()
        if len(lost := self.hand_over.lost(pair_events, islands, self.label < 0)):
            # One sub-stepped island from here on.
            self.label[lost] = lost.min()
            pair_events.inside[lost] = True
        first = not pair_events.substepped_begun
        pair_events.substepped_begun = True
        hit = [island for island in islands if np.any(self.label[island.members] >= 0)]
        members = np.flatnonzero(pair_events.inside) if first else np.union1d(self._due(pair_events, time), lost)
        if len(members) and not hit:
            bare = _bare_island(time)
            self._bring_in(run, bare, members)
            return [*islands, bare]
        # An island that is hit is stepped again, with all of its members; what else is due comes with the first, once.
        if not hit:
            return islands
        stepped = [np.flatnonzero(np.isin(self.label, self._labels_of(island.members))) for island in hit]
        rest = np.setdiff1d(members, np.concatenate(stepped))
        for island, own in zip(hit, stepped, strict=True):
            self._bring_in(run, island, np.union1d(own, rest))
            rest = rest[:0]
        return islands

    def _labels_of(self, bodies: np.ndarray) -> np.ndarray:
        """Sub-stepped islands that some of the bodies are in."""
        labels = self.label[bodies]
        return labels[labels >= 0]

    def _due(self, pair_events: PairEvents, time: float) -> np.ndarray:
        """Members whose trajectories end at `time`."""
        due = [label for label, end in self._paths.ends.items() if end <= time]
        return np.flatnonzero(pair_events.inside & np.isin(self.label, due)) if due else np.zeros(0, np.int64)

    def _bring_in(self, run: Run, island: Island, members: np.ndarray) -> None:
        """Let the members be advanced with an island; bring them to its time. (Those that it does not touch are no members of it.)"""
        state, time = run.state, island.time
        stepped = state.trajectory.mode[members] == LINEAR
        self._paths.end(run, members[stepped & (state.trajectory.start[members] < time)], time)
        away = members[~(stepped | self.asleep[members])]
        if len(away) and len(away := np.setdiff1d(away, island.members)):
            bring_all(state.trajectory, away, time, state.now, state.rotation, run.acceleration, run.angular_acceleration)
            run.acceleration[away] = run.world.steady_acceleration[away]
        island.substepped = members

    def contact_forces(self, run: Run, pair_events: PairEvents, island: Island) -> None:
        """Step an island, with what touches it and is slow, to the end of the step, or until its trajectories must begin again."""
        world, members = run.world, island.substepped
        assert members is not None
        run.contact_log.close(np.union1d(island.members, members) if len(island.members) else members, island.time)
        if len(island.members):
            stays = np.zeros(world.num_bodies, bool)
            stays[island.members] = True
            # Bodies that touch the island join it, except jointed ones, and those that are too fast for sub-steps and leave it.
            self._leave_out_fast(run, stays)
            stays[island.members] |= ~self._leaves(run, island)
            stays[island.members] |= self._stays[island.members]
            near = island.members[stays[island.members]]
            island.substepped = members = np.union1d(members, near)
            # What an island connects is one sub-stepped island from here on; others that are stepped with it stay their own.
            labels = self._labels_of(near)
            connected = np.union1d(near, members[np.isin(self.label[members], labels)])
            self.label[connected] = labels.max() if len(labels) else connected.min(initial=len(self.label))
            pair_events.inside[members] = True
            run.wrench[island.members] = 0.0
            self.asleep[members] = pair_events.asleep[members] = False
            self.sleep_timer[island.members] = 0.0
        fresh = members[~self._taken[members]]
        if len(fresh):
            self._take_in(run, fresh, island.time)
        self._paths.most = max(self._paths.most, len(members))
        members = members[~self.asleep[members]]
        if self._jointed.any() and len(joints := run.joints.at(members[self._jointed[members]])):
            run.joints.break_at(run, joints, island.time)
        # In the middle of a step contacts may be kept for longer motion.
        kept = self.stepper.kept if island.time > pair_events.begin else 0.0
        self._outcomes, self._outcome_begin = [], island.time
        for part in self._solved_together(run, pair_events, members):
            self._paths.steps += 1
            end = self._end_of(run, pair_events, island.time, part)
            if world.force_tables:
                end = self._press(run, part, island.time, end)
            out = self._step(run, part, np.intersect1d(fresh, part) if len(fresh) else fresh, (island.time, end), kept)
            if out is None:
                self._give_back(run, pair_events, part, island.time)
                continue
            self._outcomes.append((out, end))
            if end < pair_events.end:
                # The island was not stepped to the end of the step: it is woken there.
                pair_events.wake[part] = end

    def _give_back(self, run: Run, pair_events: PairEvents, members: np.ndarray, time: float) -> None:
        """Let the exact regime go on with an island whose joints no sub-steps close, from `time` on and until the end of the run."""
        self.label[members], self._taken[members] = -1, False
        self.hand_over.leave(members)
        pair_events.inside[members] = False
        for i in members.tolist():
            begin_trajectory(run, pair_events, i, time, NOT_HELD, rests=False)
        pair_events.wake[members] = time

    def _solved_together(self, run: Run, pair_events: PairEvents, members: np.ndarray) -> list[np.ndarray]:
        """Members that are solved together: islands with joints one by one, and all others at once.

        Where it is worth it, those that nothing else may meet are apart from those that others may meet: they are stepped farther at once.
        """
        parts, rest = [], members
        if len(joined := members[self._jointed[members]]):
            labels = np.unique(self.label[np.intersect1d(joined, run.joints.bodies_of(run.joints.at(joined)))])
            parts = [members[self.label[members] == label] for label in labels.tolist()]
            rest = members[~np.isin(self.label[members], labels)]
        if self.stepper.alone_length > self.stepper.step_length:
            met = np.isin(self.label[rest], self.label[rest[pair_events.may_meet()[rest]]])
            parts = [rest[met], rest[~met], *parts]
        else:
            parts = [rest, *parts]
        return [part for part in parts if len(part)]

    def _step(self, run: Run, members: np.ndarray, fresh: np.ndarray, span: tuple[float, float], kept: float) -> Outcome | None:
        """Step members that are solved together; fresh: those of them that were in no sub-stepped island. None if joints stay open."""
        time, end = span
        which, out = run.joints.at(members[self._jointed[members]]), None
        if len(which):
            out = self._solve(run, members, span, kept)
        elif self._is_wedged(members):
            out = self._solve(run, members, span, kept)
            self._wedged[members] = np.maximum(self._wedged[members] - 1, 0)
        if out is None and not len(which):
            self._load(run, members, time, end - time, kept)
            if len(fresh):
                self.stepper.look(run)
                before = mechanical_energy(run.state.now, run.world.constants, members)
                self.stepper.move_apart(run, fresh, time)
                change = mechanical_energy(run.state.now, run.world.constants, members) - before
                run.log.account(time, "position correction", change)
            out = self.stepper.step(run, time, end)
            if not out.is_found:
                out = self.solve_again(run, members, span, kept) or out
        if self.hand_over.cheapest is not None:
            self.hand_over.cheapest.note(members, self.stepper.parts)
        if out is None:
            return None
        way = None
        if out.waypoints is not None:
            way = way_of(out, out.waypoints, run.state.now, span, len(which) > 0 and self._flies(run, which), run.acceleration)
        self._paths.begin(run, out, span, which, way)
        return out

    def _flies(self, run: Run, which: np.ndarray) -> bool:
        """Whether neither the joints `which` nor contacts hold the island that was stepped to anything that is no member."""
        part, pairs = self.stepper.bodies.part, self.stepper.table.pairs
        held = (pairs.count > 0) & ((part[pairs.first] == SUPPORT) | (part[pairs.second] == SUPPORT))
        members = (part[pairs.first] == MEMBER) | (part[pairs.second] == MEMBER)
        return not len(run.joints.supports_of(which)) and not np.any(held & members)

    def solve_again(self, run: Run, members: np.ndarray, span: tuple[float, float], kept: float) -> Outcome | None:
        """Step members without joints again, whose forces sub-steps did not find; None if they are many, or not held so, either."""
        if len(members) > MOST_SOLVED:
            return None
        self._wedged[members] = WEDGED
        out = self._solve(run, members, span, kept)
        self._solved_again += out is not None
        return out

    def _is_wedged(self, members: np.ndarray) -> bool:
        """Whether sub-steps did not find the forces of such members a short while ago, and are not likely to."""
        return bool(self._wedged[members].any()) and len(members) <= MOST_SOLVED

    def _solve(self, run: Run, members: np.ndarray, span: tuple[float, float], kept: float) -> Outcome | None:
        """Step an island with all its contacts and joints solved together; None if no sub-steps hold it."""
        if self._joint_stepper is None:
            prepare_kernels(self._world, with_events=False, with_substepped=True)
            self._joint_stepper = JointedStepper(run, self.stepper)
        return self._joint_stepper.step(
            run, members, span, lambda fineness: self._load(run, members, span[0], span[1] - span[0], kept, fineness)
        )

    def _take_in(self, run: Run, fresh: np.ndarray, time: float) -> None:
        """What exact contact did to bodies ends where they come to a sub-stepped island."""
        self._taken[fresh] = True
        if self._jointed[fresh].any():
            run.joints.begin_sub_steps(run, fresh, time)
        run.wrench[fresh] = 0.0
        run.contact_log.close(fresh, time)
        if run.world.force_tables:
            self._mean[fresh] = 0.0
            for i in fresh.tolist():
                run.forces.log.end(i, time, run.state.now)
        note_end_energy(run.state.limiter, run.state.now, run.world.constants, fresh)
        for i in fresh[run.state.under_contact[fresh]].tolist():
            account_contact_work(run, i, time)
            run.state.under_contact[i] = False

    def _end_of(self, run: Run, pair_events: PairEvents, time: float, members: np.ndarray) -> float:
        """When trajectories of members that are solved together end: before the step if they are tiny or spin fast, or joints let go.

        So they do where others may meet members in the step: what meets a body that turns, in the middle of its straight way, meets it
        elsewhere than it is.
        """
        stepper, joints = self.stepper, run.joints.at(members[self._jointed[members]])
        alone = (len(joints) > 0 or stepper.at_once_alone != stepper.at_once) and not pair_events.may_meet()[members].any()
        at_once, straight = stepper.at_once_alone if alone else stepper.at_once
        if len(joints):
            at_once, straight = run.world.accuracy.step, np.inf if alone else straight
        end = stepper.end_of(run.state.now, members, (at_once, straight), (time, pair_events.end))
        return min(end, run.joints.next_release(joints, time)) if len(joints) else end

    def _press(self, run: Run, members: np.ndarray, time: float, end: float) -> float:
        """Let varying forces act on members that are solved together from `time` to `end` at most; returns until when they do."""
        stepper, steady, inv_mass = self.stepper, run.world.steady_acceleration, run.state.now.inv_mass
        run.acceleration[members], stepper.torque[members] = steady[members], 0.0
        stepper.strength[members] = run.world.steady_strength[members]
        acted = members[run.forces.acts[members]]
        if len(acted):
            end = run.forces.push(run, acted, (time, end), self._mean)
            force = run.forces.value[acted]
            run.acceleration[acted] += inv_mass[acted, None] * force[:, :3]
            stepper.torque[acted] = force[:, 3:]
            stepper.strength[acted] = np.maximum(stepper.strength[acted], length(run.acceleration[acted]))
        return end

    def _leaves(self, run: Run, island: Island) -> np.ndarray:
        """Which members (k,) bool leave all that they touch at a speed worth the name."""
        slowest = np.full(run.world.num_bodies, np.inf)
        np.minimum.at(slowest, island.contacts.body_a, island.approach)
        np.minimum.at(slowest, island.contacts.body_b, island.approach)
        speed = np.linalg.norm(run.state.now.velocity[island.members], axis=1)
        return slowest[island.members] > LEAVING * speed

    def _load(
        self, run: Run, members: np.ndarray, time: float, ahead: float, kept: float, fineness: Fineness | None = None
    ) -> None:
        """Put members, in their order, and bodies near them that stand still before the solver; kept, fineness: see `stepper.load`."""
        world, order = run.world, self.stepper.order
        marked = np.zeros(world.num_bodies, bool)
        marked[members] = True
        members = order[marked[order]]
        fixed = np.flatnonzero(~world.dynamic | self.asleep)
        if len(moving := fixed[world.moving[fixed]]):
            bring_all(
                run.state.trajectory, moving, time, run.state.now, run.state.rotation, run.acceleration,
                run.angular_acceleration,
            )  # fmt: skip
        # In sub-steps supports go on parabolas: with the acceleration that brings them to where they are at the end.
        now, before = run.state.now, run.acceleration[moving].copy()
        for i in moving[before.any(axis=1)].tolist():
            missed = run.pose_matrix(i, time + ahead)[0] - now.position[i] - ahead * now.velocity[i]
            run.acceleration[i] = 2.0 * missed / ahead**2
        self.stepper.load(run, members, fixed, ahead, kept, fineness)
        run.acceleration[moving] = before

    def begin_trajectories(self, run: Run, pair_events: PairEvents) -> None:
        """Give the members the trajectories that the solver found."""
        state, time = run.state, self._outcome_begin
        if not self._outcomes:
            return
        for out, end in self._outcomes:
            if run.world.force_tables:
                before = np.column_stack([state.now.velocity[out.members], state.now.angular_velocity[out.members]])
                self._mean[out.members] = (out.velocity - before) / (end - time)
            run.recorder.flush_all(state.trajectory, out.members, time)
            depart(state.trajectory, out.members, time, end - time, state.now, out.position, out.orientation, out.velocity)
            state.correction[out.members] = 0.0
            self._update_sleep_timers(run, out, end - time)
        pair_events.trajectories_changed(np.concatenate([out.members for out, _ in self._outcomes]), time)

    def _update_sleep_timers(self, run: Run, out: Outcome, length: float) -> None:
        """For how long each member has hardly moved from where it was."""
        stepper = self.stepper
        advance_sleep_timers(
            out.members, (out.position, out.orientation, out.velocity), (run.world.steady_strength, stepper.inner, stepper.skin), length,
            self._stood, self.sleep_timer,
        )  # fmt: skip


def _struck(run: Run, joined: np.ndarray, time: float) -> np.ndarray:
    """Which bodies (n,) bool the exact regime has found in contact in the step before `time`, s; asked where any are joined, (n,) bool."""
    out, memory = np.zeros(len(joined), bool), run.state.memory
    if joined.any():
        out[held_pairs(memory, run.state.trajectory.start)] = True
        out[rebounded_pairs(memory, time - run.world.accuracy.step, len(joined))] = True
    return out


def _tied(world: World) -> np.ndarray:
    """Which bodies (n,) bool varying forces tie to others: they are stepped together."""
    out = np.zeros(world.num_bodies, bool)
    for table in world.force_tables:
        out[table.links] = True
    return out


def _bare_island(time: float) -> Island:
    """An island in which nothing touches."""
    return island_without_contacts(time, np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
