"""A study at a glance: a few telling settings of a scene, each timed and compared with a reference; the sentence first, then more.

A scene whose preview takes long is looked at in two passes: first its beginning, as long as the preview gets in PILOT s of computing, which
gives a sentence soon; then the whole of it, as far as the budget goes. Each pass runs the presets, makes the reference, and goes on with
fixed steps, other engines and penalty forces. After every run `changed` is called, so that a page can be written again.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.files import make_folder
from rigidimpulse.engine.compile_scene import compile_scene
from rigidimpulse.engine.forecast import remember
from rigidimpulse.engine.simulate import simulate_whole
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.glance import candidates
from rigidimpulse.studies.glance.candidates import Candidate
from rigidimpulse.studies.glance.known import Glance
from rigidimpulse.studies.glance.page import write_page
from rigidimpulse.studies.glance.played import GivenUp, Played, Player, watch
from rigidimpulse.studies.job import Job
from rigidimpulse.studies.reference import exact_reference, perturbed, reference_of
from rigidimpulse.studies.settings import TIGHT
from rigidimpulse.studies.work_precision import topic_of

BUDGET = 60.0
"""s for the whole study."""
SENTENCE = 11.0
"""s from the start of a study after which the reference of its first pass is not made finer."""
PILOT = 1.2
"""s of computing that a preview may take, or the first pass has the beginning only."""
PATIENCE = 5.0
"""How many times longer than the standard run another one may take, or this many s, before it is given up."""
REFERENCE_SHARE = 0.8
"""Of the budget, until which the reference is made finer."""
FINER_STEPS = (480, 960, 1920)
"""Steps a second of the runs that the reference is made of, besides exact."""


def glance(
    scene: Scene | str | Job,
    duration: float | None = None,
    fps: float | None = None,
    *,
    budget: float = BUDGET,
    peers: Sequence[str] | None = None,
    output: str | os.PathLike[str] | None = None,
    changed: Callable[[Glance], None] | None = None,
) -> Glance:
    """Say what accuracy costs in a scene: run a few telling settings and compare them with a reference.

    Args:
        scene: a scene, a job that makes one, or the name of one in the gallery.
        duration: s; fps: frames per second; by default those of the gallery scene, else 4 s at 60.
        budget: s that all may take; a first sentence comes within about 15 s.
        peers: other engines to run beside it, of `peers.PEERS`; by default those that are installed.
        output: folder for the page `study.html`, which is there at once and follows the study while it is open.
        changed: called with what is known, first before any run, then after each, and at the end.

    Raises:
        SceneError: the scene cannot be simulated, nothing in it moves freely, or the folder cannot be made.

    """
    start = perf_counter()
    if output is not None:
        make_folder(Path(output))
    topic = topic_of(scene, duration, fps)
    if not any(body.motion == "dynamic" for body in topic.scene.bodies):
        raise SceneError("nothing in the scene moves freely, so there is no error to measure", "add a body with motion='dynamic'")
    engines = candidates.installed_engines() if peers is None else list(peers)
    world = compile_scene(topic.scene)

    def tell(known: Glance) -> None:
        if output is not None:
            write_page(known, Path(output))
        if changed is not None:
            changed(known)

    tell(Glance(topic.name, topic.scene, world, topic.duration, topic.duration, topic.fps, topic.entry))
    first = _first_duration(topic.scene, topic.duration, topic.fps)
    known = Glance(topic.name, topic.scene, world, first, topic.duration, topic.fps, topic.entry)
    study = _Pass(known, start, start + budget, tell)
    study.go(engines, min(SENTENCE, budget))
    spent = perf_counter() - start
    if first < topic.duration and spent + _whole(known) < budget:
        known = Glance(topic.name, topic.scene, world, topic.duration, topic.duration, topic.fps, topic.entry)
        whole = _Pass(known, start, start + budget, lambda now: tell(now) if now.verdict is not None else None)
        whole.go(engines, spent + 0.6 * (budget - spent))
    _remember_cost(known)
    known.finished, known.waiting, known.spent = True, [], perf_counter() - start
    tell(known)
    return known


def _remember_cost(known: Glance) -> None:
    """Keep what the standard run took, for the forecasts of `explain`."""
    standard = next(played for played in known.runs if played.candidate.name == "standard")
    if standard.recording is not None and standard.recording.plan is not None:
        remember(known.world, standard.recording.plan, known.duration, standard.seconds)


def _first_duration(scene: Scene, duration: float, fps: float) -> float:
    """Time of the motion that a preview computes in PILOT s, in whole frames, at most the duration."""
    simulate_whole(scene, min(2.0 / fps, duration), fps, accuracy="preview")  # loads kernels
    try:
        simulate_whole(scene, duration, fps, accuracy="preview", progress=watch(PILOT))
    except GivenUp as reached:
        return min(max(math.floor(reached.args[0] * fps), 2) / fps, duration)
    return duration


def _whole(known: Glance) -> float:
    """Time that presets and reference of the whole duration may take, s, from those of the beginning."""
    presets = sum(played.seconds for played in known.runs if played.candidate.kind == candidates.PRESET)
    return 3.0 * presets * known.asked / known.duration


class _Pass:
    """One pass over the candidates of a glance."""

    def __init__(self, known: Glance, start: float, deadline: float, tell: Callable[[Glance], None]) -> None:
        self.known, self.start, self.deadline, self.tell = known, start, deadline, tell
        self.fine: list[Recording] = []
        self.player = Player(known.scene, known.duration, known.fps)

    def go(self, engines: list[str], sentence: float) -> None:
        """Run everything; sentence: s after the start until which the reference is made."""
        known = self.known
        coarse = candidates.fixed_step(candidates.FIXED_RATE)
        coarse_engines = [candidates.other_engine(engine, round(self.known.fps)) for engine in engines]
        others = [coarse, *coarse_engines, candidates.penalty()]
        *cheap, exact = candidates.presets()
        known.waiting = [each.name for each in (*cheap, exact, *others)]
        for candidate in cheap:
            self.play(candidate)
        # Of a pile no finer run is a reference, and an exact one may take longer than all others: the sentence does not wait for it.
        soon, late = ([], [exact]) if known.pile else ([exact], [])
        for candidate in soon:
            self.play(candidate)
        self.make_reference(sentence)
        self.tell_now()
        for candidate in late:
            self.play(candidate)
        for candidate in (coarse, *coarse_engines):
            played = self.play(candidate)
            rate = self._same_cost(played)
            if rate is not None:
                self.play(candidates.other_engine(candidate.engine, rate) if candidate.engine else candidates.fixed_step(rate))
        self.play(others[-1])
        self.make_reference(REFERENCE_SHARE * (self.deadline - self.start))

    def play(self, candidate: Candidate) -> Played:
        """Run a candidate and tell."""
        standard = self._seconds("standard")
        left = self.deadline - perf_counter()
        limit = left if candidate.kind == candidates.PRESET else min(left, PATIENCE * max(standard, 1.0))
        played = self.player.play(candidate, max(limit, 0.1))
        self.known.runs.append(played)
        if candidate.name in self.known.waiting:
            self.known.waiting.remove(candidate.name)
        self.tell_now()
        return played

    def tell_now(self) -> None:
        """Hand over what is known."""
        self.known.spent = perf_counter() - self.start
        self.tell(self.known)

    def make_reference(self, until: float) -> None:
        """The closed form, or the finest run that there is time for until `until`, s after the start; see `reference_of`."""
        known = self.known
        if known.entry is not None and known.entry.exact is not None:
            known.reference = exact_reference(known.entry, known.world, known.times)
            return
        coarse = [played.recording for played in known.runs if played.recording is not None and played.candidate.kind == candidates.PRESET]
        if known.pile:
            self._pile_reference()
            return
        before, spent = len(self.fine), self._seconds("exact")
        for rate in FINER_STEPS[before:]:
            # A finer run takes up to twice as long, and its perturbed twin as long again.
            if len(self.fine) > 0 and perf_counter() - self.start + 4.0 * spent > until:
                break
            begin = perf_counter()
            self.fine.append(self._fine(rate))
            spent = perf_counter() - begin
        if len(self.fine) > before:
            note = "compared with the two runs before it and one started off by round-off"
            self._compare_fine([*coarse, *self.fine][-3:], note)

    def _pile_reference(self) -> None:
        """The standard run, until round-off has changed it: of a pile nothing more can be told."""
        standard = next(played.recording for played in self.known.runs if played.candidate.name == "standard")
        if self.known.reference is None and standard is not None:
            self._compare_fine([standard], "compared with one started off by round-off")

    def _compare_fine(self, runs: list[Recording], note: str) -> None:
        """Take the last run for the reference, as far as the others and a perturbed one agree with it."""
        known, settings = self.known, runs[-1].settings
        assert settings is not None
        twin = simulate_whole(perturbed(known.scene), known.duration, known.fps, accuracy=settings.accuracy)
        step = f"a step of 1/{round(1.0 / settings.accuracy.step)} s"
        known.take_reference(reference_of(known.world, known.times, runs[-1], [*runs[:-1], twin], f"{step}, {note}"), runs[-1])

    def _fine(self, rate: int) -> Recording:
        return simulate_whole(self.known.scene, self.known.duration, self.known.fps, accuracy=Accuracy(step=1.0 / rate, tolerance=TIGHT))

    def _seconds(self, name: str) -> float:
        return next((played.seconds for played in self.known.runs if played.candidate.name == name), 0.0)

    def _same_cost(self, coarse: Played) -> int | None:
        """Steps a second with which a fixed step takes as long as the standard run; None if that is about what was run."""
        if coarse.recording is None:
            return None
        rate = candidates.same_cost_rate(self._seconds("standard"), coarse.seconds, coarse.candidate.rate)
        return rate if rate >= 1.5 * coarse.candidate.rate else None
