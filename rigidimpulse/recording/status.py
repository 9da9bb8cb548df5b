"""How a run went, and how files keep that."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Event:
    """Something a user should know of: `kind`, time in s, names of the bodies, and the text with the remedy."""

    time: float
    kind: str
    bodies: tuple[str, ...]
    message: str
    is_problem: bool = True


@dataclass(frozen=True)
class Status:
    """How a run went.

    Attributes:
        ok: nothing happened that a user should know of.
        message: what happened and what to change.
        events: all of it, in order of time.

    """

    ok: bool
    message: str
    events: tuple[Event, ...] = ()

    @staticmethod
    def of(events: Sequence[Event]) -> Status:
        """Return the status that the events of a run add up to."""
        problems = [e for e in events if e.is_problem]
        if not problems:
            return Status(True, "finished", tuple(events))
        lines = [f"t = {e.time:.6g} s, {e.kind} ({', '.join(e.bodies)}): {e.message}" for e in problems]
        return Status(False, "\n".join(lines), tuple(events))

    @property
    def problems(self) -> tuple[Event, ...]:
        """The events because of which the status is not ok."""
        return tuple(event for event in self.events if event.is_problem)

    @property
    def lines(self) -> list[str]:
        """What `message` says, a line for each problem; none if the run is ok."""
        return [] if self.ok else self.message.splitlines()

    def as_json(self) -> str:
        """The status as JSON, for files: {"ok", "message", "events": [{"time", "kind", "bodies", "message", "is_problem"}]}; s."""
        return json.dumps({"ok": self.ok, "message": self.message, "events": [asdict(event) for event in self.events]})

    @staticmethod
    def from_json(text: str) -> Status:
        """Return the status that `as_json` wrote.

        Raises:
            ValueError: the text is something else.

        """
        said = json.loads(text)
        try:
            events = tuple(
                Event(float(e["time"]), str(e["kind"]), tuple(map(str, e["bodies"])), str(e["message"]), bool(e["is_problem"]))
                for e in said["events"]
            )
            return Status(bool(said["ok"]), str(said["message"]), events)
        except (KeyError, TypeError) as error:
            raise ValueError(f"no status of a run: {error!r}") from None


LOADED = Status(True, "loaded")
"""Of a recording whose file does not tell."""
