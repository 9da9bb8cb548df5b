"""What a glance knows: the runs until now, the reference, and the verdict that follows from them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidimpulse.core.providers import provider
from rigidimpulse.engine.simulate import frame_times
from rigidimpulse.gallery.record import GalleryScene
from rigidimpulse.model.world import World
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.scene import Scene
from rigidimpulse.studies.glance.figures import DEPTH, PLACE, Figures, depth_figures, is_pile, measure_of, place_figures
from rigidimpulse.studies.glance.played import Played
from rigidimpulse.studies.glance.verdict import Evidence, Verdict, make_verdict
from rigidimpulse.studies.reference import Reference


@dataclass(eq=False)
class Glance:
    """What is known of a study until now.

    Attributes:
        name: of the scene. scene: what was run. world: compiled.
        duration: s, of the motion that was run. asked: s, of the motion that was asked for. fps: frames per second.
        entry: its record in the gallery, or None.
        runs: in the order they were made. waiting: names of runs still to come. reference: None until it is made.
        truth: the run that shows the reference; None if that has a closed form, or is still to come.
        spent: s since the start. finished: whether nothing more will come.

    """

    name: str
    scene: Scene
    world: World
    duration: float
    asked: float
    fps: float
    entry: GalleryScene | None = None
    runs: list[Played] = field(default_factory=list)
    waiting: list[str] = field(default_factory=list)
    reference: Reference | None = None
    spent: float = 0.0
    finished: bool = False
    truth: Recording | None = None
    _figures: dict[str, Figures] = field(default_factory=dict)

    def _repr_html_(self) -> str:
        """Return the page, for a cell of a notebook."""
        return str(provider("cell of glance")(self))

    def take_reference(self, reference: Reference, run: Recording) -> None:
        """Compare with a reference from now on, whose motion is that of a run."""
        self.reference, self.truth = reference, run
        self._figures.clear()

    @property
    def measure(self) -> str:
        """What errors are: of places, or depths."""
        if self.reference is None:
            return PLACE
        return measure_of(self.reference, self.pile, self.duration)

    @property
    def pile(self) -> bool:
        """Whether the scene is a pile: more than "preview" sub-steps bodies of it, which sub-steps all that touches."""
        return any(is_pile(run.recording) for run in self.runs if run.candidate.name != "preview" and run.recording is not None)

    @property
    def times(self) -> np.ndarray:
        """(f,) s, of the frames."""
        return frame_times(self.duration, self.fps)

    @property
    def until(self) -> float:
        """Time until which the measure holds, s: the reference's horizon, or the end where depth is measured."""
        if self.measure == DEPTH or self.reference is None:
            return float(self.times[-1])
        return float(min(self.reference.until, self.times[-1]))

    def figures(self, played: Played) -> Figures | None:
        """How wrong a run is; None without a motion or a reference."""
        if played.recording is None or self.reference is None:
            return None
        key = f"{self.measure} {played.candidate.name}"
        if key not in self._figures:
            place = self.measure == PLACE
            self._figures[key] = (
                place_figures(self.world, played.recording, self.reference) if place else depth_figures(self.world, played.recording)
            )
        return self._figures[key]

    @property
    def verdict(self) -> Verdict | None:
        """The sentence; None before it can be said."""
        reference = self.reference
        if reference is None:
            return None
        pairs = [(played, figures) for played in self.runs if (figures := self.figures(played)) is not None]
        until = self.until if self.measure == PLACE else reference.until
        size = float(self.world.size[self.world.dynamic].min(initial=np.inf))
        return make_verdict(Evidence(pairs, self.measure, until, self.duration, self.times, reference.uncertainty, size))
