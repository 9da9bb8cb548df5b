"""One recording of two runs: one until the time T of a frame, and one of a changed scene from T on.

Frames before T are those of the first run, all others those of the second. Sums over time, such as what friction took, go on from where
they were. What the change itself adds or takes is in the ledger as "change of the scene".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import SceneError, unknown_name
from rigidimpulse.recording.impulses import Impulses
from rigidimpulse.recording.ledger import Ledger
from rigidimpulse.recording.recording import Recording, SimulatedRecording
from rigidimpulse.recording.status import Status

if TYPE_CHECKING:
    from rigidimpulse.dynamics.soft_body.track import FlexibleTrack

CHANGE = "change of the scene"
FRAMES = ("positions", "orientations", "velocities", "angular_velocities", "centers")
AT_REST = ("velocities", "angular_velocities")
"""Of a body that the first run does not have: its place is that where it begins, and it does not move."""


def joined_frames(first: Recording, then: Recording) -> Recording:
    """Return the frames, impacts, contacts and status of both; first: its last frame is at the time of the first one of `then`."""
    time = float(first.times[-1])
    index = np.array([then.names.index(name) if name in then.names else -1 for name in first.names], np.int64)
    impacts, contacts = _renumbered(first.impacts, index), _renumbered(first.contacts, index)
    contacts = contacts[contacts["start"] < time]
    contacts["end"] = np.minimum(contacts["end"], time)
    return replace(
        then, times=np.concatenate([first.times[:-1], then.times]), **{name: _frames(first, then, index, name) for name in FRAMES},
        impacts=np.concatenate([impacts[impacts["time"] < time], then.impacts]),
        contacts=np.concatenate([contacts, then.contacts]),
        status=_status(first.status, then.status, time),
        soft_bodies=_tracks(first, then),
    )  # fmt: skip


def cut(run: Recording, last: int) -> Recording:
    """Return the frames of a recording up to number `last`.

    Raises:
        SceneError: it has no such frame.

    """
    if last >= len(run.times):
        raise SceneError(f"it has no frame {last}", "delete it, and run again", "cache")
    here = slice(0, last + 1)
    tracks = [replace(track, vertices=track.vertices[here]) for track in run.soft_bodies]
    return replace(run, times=run.times[here], **{name: getattr(run, name)[here] for name in FRAMES}, soft_bodies=tracks)


def joined_runs(first: SimulatedRecording, then: SimulatedRecording) -> SimulatedRecording:
    """Return the recording of both; first: its last frame is at the time of the first one of `then`."""
    before = len(first.times) - 1
    frames = joined_frames(first, then)
    reactions = {
        name: np.concatenate([first.reactions.get(name, np.zeros((before + 1, 3)))[:before], force])
        for name, force in then.reactions.items()
    }
    by_cause = JoinedImpulses(**{**vars(then.by_cause), "times": frames.times}, first=first.by_cause, then=then.by_cause)
    return replace(
        then, **{name: getattr(frames, name) for name in (*FRAMES, "times", "impacts", "contacts", "status", "soft_bodies")},
        reactions=reactions, ledger=_ledger(first.ledger, then.ledger), by_cause=by_cause,
    )  # fmt: skip


@dataclass(frozen=True, repr=False)
class JoinedImpulses(Impulses):
    """Impulses by body and cause of two runs, one after the other. first, then: those of each; all else: of the second run."""

    first: Impulses
    then: Impulses

    def of(self, name: str) -> dict[str, np.ndarray]:
        """Impulses (f, 3) N s on a body by cause; see `Impulses.of`."""
        if name not in self.then.names:
            raise unknown_name("body", name, self.then.names)
        before = self.first.of(name) if name in self.first.names else {}
        return _summed_on(before, self.then.of(name), len(self.first.times), len(self.then.times))


def _renumbered(table: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Rows of impacts or contacts whose bodies are all there, with the indices that these have; index: by that in the table."""
    rows = table[(index[table["body_a"]] >= 0) & (index[table["body_b"]] >= 0)]
    for name in ("body_a", "body_b"):
        rows[name] = index[rows[name]]
    return rows


def _frames(first: Recording, then: Recording, index: np.ndarray, name: str) -> np.ndarray:
    """One kind of frames of both (f, n, ...)."""
    before, after = getattr(first, name)[:-1], getattr(then, name)
    rows = np.zeros((len(before), *after.shape[1:]))
    if name not in AT_REST:
        rows[:] = after[:1]
    rows[:, index[index >= 0]] = before[:, index >= 0]
    return np.concatenate([rows, after])


def _tracks(first: Recording, then: Recording) -> list[FlexibleTrack]:
    """Frames of the flexible bodies of the second run; those that the first does not have stand where they begin."""
    known = {track.name: track.vertices[:-1] for track in first.soft_bodies}
    tracks = []
    for track in then.soft_bodies:
        before = known.get(track.name)
        if before is None or before.shape[1:] != track.vertices.shape[1:]:
            before = np.repeat(track.vertices[:1], len(first.times) - 1, axis=0)
        tracks.append(replace(track, vertices=np.concatenate([before, track.vertices])))
    return tracks


def _status(first: Status, then: Status, time: float) -> Status:
    """Events of both. What lasts over the change is told once."""
    events = [event for event in first.events if event.time < time]
    last = {(event.bodies, event.kind.partition(" ")[0]): event.kind for event in events}
    told = {(event.kind, event.bodies) for event in events if event.is_problem}
    for event in then.events:
        lasts = event.time <= time and last.get((event.bodies, event.kind.partition(" ")[0])) == event.kind
        if not lasts and (event.kind, event.bodies) not in told:
            events.append(event)
    return Status.of(events)


def _summed_on(
    before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray], begun: int, lasted: int
) -> dict[str, np.ndarray]:
    """Sums over time by cause: those of the first run (begun, ...), without its last frame, and what the second (lasted, ...) adds."""
    causes: Iterable[str] = dict.fromkeys([*before, *after])
    out = {}
    for cause in causes:
        shape = next(iter(sums for sums in (before.get(cause), after.get(cause)) if sums is not None)).shape[1:]
        earlier, later = before.get(cause, np.zeros((begun, *shape))), after.get(cause, np.zeros((lasted, *shape)))
        out[cause] = np.concatenate([earlier[:-1], earlier[-1] + (later - later[0])])
    return out


def _ledger(first: Ledger, then: Ledger) -> Ledger:
    """The ledger of both."""
    kept = ("kinetic", "potential", "momentum", "angular_momentum")
    sums = {name: np.concatenate([getattr(first, name)[:-1], getattr(then, name)]) for name in ("times", *kept)}
    taken = _summed_on(first.dissipated, then.dissipated, len(first.times), len(then.times))
    gained = float(then.total[0] - first.total[-1])
    if gained != 0.0:
        taken[CHANGE] = np.concatenate([np.zeros(len(first.times) - 1), np.full(len(then.times), -gained)])
    return Ledger(**sums, dissipated=taken)
