"""The sentence: what the standard run is worth, what the others are beside it, and which one to take.

All lengths are bounds. "Within" is the largest distance to the reference plus its uncertainty, rounded up; "off" is the distance to the
reference less its uncertainty, rounded down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.studies.glance import words
from rigidimpulse.studies.glance.candidates import FIXED, PEER, PRESET, TITLES
from rigidimpulse.studies.glance.figures import DEPTH, DEPTH_FRAMES, Figures
from rigidimpulse.studies.glance.played import Played

NEAR_WORST = 0.9
"""A run is called off from the frame at which it is off by this share of its largest error."""
CLEAR = 2.0
"""How many times deeper, or further off, a run must be to be called worse."""


@dataclass(frozen=True)
class Claim:
    """What the sentence says of one run, to be checked.

    Attributes:
        name: of the run. seconds: it took. time: s, the claim is about the motion until this time, or at it.
        within: m, the run is not further off (or deeper) until then; nan if this is not claimed.
        off: m, the run is at least so far off at that time; nan if this is not claimed.

    """

    name: str
    seconds: float
    time: float
    within: float = np.nan
    off: float = np.nan


@dataclass(frozen=True)
class Verdict:
    """What is told of a study.

    Attributes:
        headline: of the run that is recommended or standard. details: of the others, a sentence each.
        trust: until when motion can be told, or why depth is the measure; or "".
        recommended: name of a preset, or "". reason: why.
        claims: what the sentences claim.

    """

    headline: str
    details: tuple[str, ...]
    trust: str
    recommended: str
    reason: str
    claims: tuple[Claim, ...]

    def text(self) -> str:
        """Lines for a terminal."""
        choice = [f'Recommended: accuracy="{self.recommended}", {self.reason}.'] if self.recommended else []
        return "\n".join(line for line in (self.headline, *self.details, self.trust, *choice) if line)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a verdict is made of: the runs with their figures, the measure, times in s, and the uncertainty of the reference in m."""

    runs: list[tuple[Played, Figures]]
    measure: str
    until: float
    duration: float
    times: np.ndarray
    uncertainty: float
    size: float
    """m, of the smallest body that moves."""

    def find(self, name: str) -> tuple[Played, Figures] | None:
        """The run of a name."""
        return next((pair for pair in self.runs if pair[0].candidate.name == name), None)

    def sure(self, figures: Figures, frame: int) -> float:
        """Distance to the truth at a frame, m, that a run has at least."""
        return float(figures.curve[frame]) - (0.0 if self.measure == DEPTH else self.uncertainty)


def make_verdict(evidence: Evidence) -> Verdict | None:
    """Say what the runs showed; None before there is a standard run."""
    standard = evidence.find("standard")
    if standard is None:
        return None
    claims = [Claim("standard", standard[0].seconds, evidence.until, standard[1].bound)]
    headline = f"Standard {_holds(evidence, standard[1])} and takes {words.seconds(standard[0].seconds)} to compute."
    details = []
    for name in ("preview", "exact"):
        other = evidence.find(name)
        if other is not None:
            claims.append(Claim(name, other[0].seconds, evidence.until, other[1].bound))
            bound, spent = _worth(evidence, other[1]), words.cost(other[0].seconds, standard[0].seconds)
            details.append(f"{name.capitalize()}: {bound}, {spent}.")
    for other in _rivals(evidence, standard[0].seconds):
        sentence, claim = _beside(evidence, other, standard)
        details.append(sentence)
        claims.append(claim)
    name, reason = _choose(evidence)
    return Verdict(headline, tuple(details), _trust(evidence), name, reason, tuple(claims))


def _holds(evidence: Evidence, figures: Figures) -> str:
    """What a run keeps to."""
    if evidence.measure == DEPTH:
        share = figures.bound / evidence.size
        return (
            f"lets no body be deeper inside another than {words.length(figures.bound)} ({100.0 * share:.2g} % of a body)"
            if figures.bound > 0.0 else "lets no body be inside another"
        )  # fmt: skip
    return f"stays within {words.length(figures.bound)} of the truth for {words.motion_time(evidence.until)}"


def _worth(evidence: Evidence, figures: Figures) -> str:
    """The bound of a run in words."""
    if evidence.measure == DEPTH:
        return f"{words.length(figures.bound)} deep" if figures.bound > 0.0 else "no overlap"
    return words.length(figures.bound)


def _rivals(evidence: Evidence, spent: float) -> list[tuple[Played, Figures]]:
    """Of fixed steps and of each other engine, the run whose time is nearest to that of the standard run."""
    found: dict[str, tuple[Played, Figures]] = {}
    for pair in evidence.runs:
        played = pair[0]
        if played.candidate.kind in (FIXED, PEER):
            key, gap = played.candidate.engine, abs(np.log(max(played.seconds, 1e-6) / max(spent, 1e-6)))
            if key not in found or gap < abs(np.log(max(found[key][0].seconds, 1e-6) / max(spent, 1e-6))):
                found[key] = pair
    return list(found.values())


def _beside(evidence: Evidence, other: tuple[Played, Figures], standard: tuple[Played, Figures]) -> tuple[str, Claim]:
    """A sentence about a rival, and what it claims."""
    played, figures = other
    engine = played.candidate.engine
    who = f"{TITLES.get(engine, engine)} with steps of" if engine else "A fixed step of"
    who = f"{who} 1/{played.candidate.rate} s"
    spent = words.cost(played.seconds, standard[0].seconds)
    spent = "at the same cost" if spent == "the same time" else f"in {spent}"
    if evidence.measure == DEPTH:
        claim = Claim(played.candidate.name, played.seconds, evidence.until, figures.bound)
        return f"{who} {spent}: {_worth(evidence, figures)}.", claim
    told = np.flatnonzero(np.isfinite(figures.curve))
    frame = int(told[np.argmax(figures.curve[told] >= NEAR_WORST * figures.largest)]) if len(told) else 0
    sure = evidence.sure(figures, frame)
    if sure > CLEAR * standard[1].bound:
        time = float(evidence.times[frame])
        text = f"{who} {spent}: {words.length(sure, up=False)} off after {words.motion_time(time)}."
        return text, Claim(played.candidate.name, played.seconds, time, off=sure)
    text = f"{who} {spent}: within {_worth(evidence, figures)}."
    return text, Claim(played.candidate.name, played.seconds, evidence.until, figures.bound)


def _trust(evidence: Evidence) -> str:
    """Until when motion can be told."""
    if evidence.measure == DEPTH:
        until = f" after {words.motion_time(evidence.until)}" if np.isfinite(evidence.until) and evidence.until > 0.0 else ""
        return f"Motion is chaotic{until}: round-off decides where each body ends. So depth is measured, not place ({DEPTH_FRAMES} frames)."
    if evidence.until < evidence.duration:
        time = words.motion_time(evidence.until)
        return f"After {time} the finest runs differ, or round-off decides: no setting can tell where the bodies are."
    return ""


def _choose(evidence: Evidence) -> tuple[str, str]:
    """Name of the preset to take, and why: the cheapest of those that nobody can tell from the truth; standard among equals."""
    presets = [pair for pair in evidence.runs if pair[0].candidate.kind == PRESET]
    good = [pair for pair in presets if np.isinf(pair[1].left)]
    if not good:
        best = min(presets, key=lambda pair: pair[1].bound)
        return best[0].candidate.name, "the best of those that were run, though its error can be seen"
    cheapest = min(good, key=lambda pair: pair[0].seconds)
    equal = [pair for pair in good if pair[0].seconds < words.EQUAL * cheapest[0].seconds]
    chosen = min(equal, key=lambda pair: (pair[0].candidate.name != "standard", pair[1].bound))
    what = "overlap" if evidence.measure == DEPTH else "error"
    return chosen[0].candidate.name, f"the cheapest whose {what} nobody sees ({_worth(evidence, chosen[1])})"
