"""Steps in which nothing moves but members of sub-stepped islands, one after the other.

The order of a step (`engine/step.py`) is made for events: it asks which pairs meet, and when. Where all that moves is stepped together,
without joints, on what stands still, and no island begins or ends to be sub-stepped, nothing can meet anything outside. Such a step is

    the trajectories end, the members are chosen (`begin_undisturbed_step`)
    pieces, one after the other: load, sub-steps (`ContactStepper`), new trajectories (`land_members`)

in a few calls of kernels, with the bits of the other order. A row of dominoes takes three quarters of the time. Bodies that rest elsewhere
are looked for as they are there; at the first that a member may reach, the other order goes on in the middle of the step.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from rigidimpulse.engine.cheapest import CheapestRegime
from rigidimpulse.engine.exact.step_begin import GRID, step_end
from rigidimpulse.engine.pair_events import PairEvents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import ContactStepper
from rigidimpulse.engine.substepped.member_paths import NO_JOINTS, MemberPaths
from rigidimpulse.engine.substepped.membership import Candidates
from rigidimpulse.engine.substepped.undisturbed_step import (
    BEGUN,
    NO_PAIRS,
    Choice,
    Landing,
    begin_undisturbed_step,
    is_undisturbed,
    land_members,
)
from rigidimpulse.engine.substepped.waypoints import way_of
from rigidimpulse.motion.trajectory import FIXED, LINEAR

PATIENCE = 0.1
"""s of the clock after which those who watch the run are heard, between two steps. What happens does not depend on it."""


class UndisturbedSteps:
    """Takes such steps."""

    def __init__(
        self, stepper: ContactStepper, paths: MemberPaths, candidates: Candidates, choice: Choice, cheapest: CheapestRegime,
        landing: Landing,
    ) -> None:  # fmt: skip
        """Without a step under way; choice: how members are chosen of the candidates, landing: what is brought up to date after a piece.

        cheapest: whose costs the choice knows, and what is told what pieces cost.
        """
        self._stepper, self._paths, self._candidates = stepper, paths, candidates
        self._choice, self._cheapest, self._landing = choice, cheapest, landing
        self._are_found = True

    def take(self, run: Run, end: float, until: float) -> PairEvents | None:
        """Take steps, the first one to `end` [s], as far as `until` [s], as long as they are such; nothing but members moves so far.

        Returns the pairs of a step that has begun and that the loop must finish; else None.
        """
        goes_on, last, self._are_found = True, perf_counter() + PATIENCE, True
        while goes_on:
            begin = run.state.time
            pair_events = self._take_one(run, end)
            if pair_events is not None or run.state.time == begin or until - end <= GRID * run.world.accuracy.step:
                return pair_events
            end = step_end.py_func(end, until, run.world.accuracy.step)
            goes_on = self._are_found and perf_counter() < last and is_undisturbed(run.state.trajectory, run.world.constants)
        return None

    def _take_one(self, run: Run, end: float) -> PairEvents | None:
        """Take a step; see `take`. If it is none such, members have arrived at its begin, and nothing else is done."""
        begin, state, world, choice, stepper = run.state.time, run.state, run.world, self._choice, self._stepper
        self._paths.arrive(run, np.flatnonzero(state.trajectory.mode == LINEAR), begin)
        how = NO_PAIRS
        while how == NO_PAIRS:
            scratch, pairs = stepper.fat_boxes.space_for(stepper.table.pairs), stepper.table.pairs
            how, sleeps = begin_undisturbed_step(choice, self._candidates, stepper.around, run.motion, pairs, scratch, (begin, end))
            if how == NO_PAIRS:
                stepper.renew_pairs(run, end - begin)
        if how != BEGUN:
            return None
        if len(sleeps):
            self._paths.put_to_sleep(run, stepper, np.flatnonzero(sleeps & (state.trajectory.mode != FIXED)), begin)
        pair_events = None
        if np.any(world.dynamic & ~choice.member):
            pair_events = self._look_elsewhere(run, end)
            if len(pair_events.pairs):
                return pair_events
        self._paths.most = max(self._paths.most, int(np.count_nonzero(choice.member)))
        return self._take_pieces(run, pair_events, (begin, end))

    def _look_elsewhere(self, run: Run, end: float) -> PairEvents:
        """The pairs of a step to `end` [s] that members are not in."""
        pair_events = PairEvents(run, end)
        pair_events.inside |= self._choice.member
        pair_events.asleep |= (self._candidates.label >= 0) & (run.state.trajectory.mode == FIXED)
        pair_events.find_pairs()
        return pair_events

    def _take_pieces(self, run: Run, pair_events: PairEvents | None, span: tuple[float, float]) -> PairEvents | None:
        """Step the members over a span; pair_events: of the step, if bodies rest elsewhere. Returns it if there is a pair now."""
        awake = self._choice.member & ~self._candidates.asleep
        members, arriving = self._stepper.by_place(awake), np.flatnonzero(awake)
        still, (time, end) = np.flatnonzero(~run.world.dynamic | self._candidates.asleep), span
        kept = 0.0
        while time < end and len(members):
            if time > span[0]:
                # Contacts may be kept for longer motion in the middle of a step.
                self._paths.end(run, arriving, time)
                kept = self._stepper.kept
            piece_end = self._stepper.end_of(run.state.now, members, self._stepper.at_once_alone, (time, end))
            self._take_piece(run, members, still, (time, piece_end), kept)
            # Where forces were not found, the order of events goes on: it knows how such members are stepped.
            if not self._are_found and piece_end < end:
                pair_events = pair_events or self._look_elsewhere(run, end)
            if pair_events is not None:
                pair_events.trajectories_changed(members, time)
                if len(pair_events.pairs) or (not self._are_found and piece_end < end):
                    pair_events.substepped_begun = True
                    if piece_end < end:
                        pair_events.wake[members] = piece_end
                    return pair_events
            time = piece_end
        run.state.time = end
        return None

    def _take_piece(self, run: Run, members: np.ndarray, still: np.ndarray, span: tuple[float, float], kept: float) -> None:
        """Step the members beside bodies that stand still over a span [s]; kept: see `ContactStepper.load`."""
        stepper, (time, end) = self._stepper, span
        stepper.load(run, members, still, end - time, kept)
        out = stepper.step(run, time, end)
        if not out.is_found:
            solved = run.substepped.solve_again(run, members, span, kept)
            self._are_found, out = solved is None, solved or out
        self._cheapest.note(members, stepper.parts)
        recorded, reached = (run.recorder.frames, run.recorder.written), (out.position, out.orientation, out.velocity, out.energies)
        land_members(self._landing, run.motion, run.state.correction, recorded, out.members, reached, (time, end - time))
        way = None if out.waypoints is None else way_of(out, out.waypoints, run.state.now, span, False, run.acceleration)
        self._paths.know(out.members, self._landing.energies, span, NO_JOINTS, way)
        self._paths.steps += 1
