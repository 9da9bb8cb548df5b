"""How a run went: the events that a user should know of, as text, and as the data that files keep.

This is the only place that makes the text. Exporters write what `Status.data` or `Status.stored` gives.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from rigidimpulse.recording.events import Event

STOPPED = "stopped"
"""Kind of the event of a run that was stopped before its end."""


def line(event: Event) -> str:
    """Return an event as a line of text: time, kind, bodies, and what to change."""
    bodies = f" ({', '.join(event.bodies)})" if event.bodies else ""
    text = f"t = {event.time:.6g} s, {event.kind}{bodies}: {event.message}"
    return " ".join(text.splitlines())


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

    def __repr__(self) -> str:
        """Return the first problem, and the number of the others."""
        first, *others = self.message.splitlines() or [""]
        rest = f", and {len(others)} more" if others else ""
        return f"Status({'ok' if self.ok else 'not ok'}: {first}{rest})"

    @staticmethod
    def of(events: Sequence[Event]) -> Status:
        """Return the status that the events of a run add up to."""
        lines = [line(event) for event in events if event.is_problem]
        return Status(not lines, "\n".join(lines) or "finished", tuple(events))

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each problem: time, kind, bodies, amount and remedy; none if the run is ok."""
        return () if self.ok else tuple(self.message.splitlines())

    @property
    def problems(self) -> tuple[Event, ...]:
        """The events that are problems."""
        return tuple(event for event in self.events if event.is_problem)

    @property
    def is_partial(self) -> bool:
        """Whether the run was stopped before its end, or still goes on: the recording has the frames until then."""
        return any(event.kind == STOPPED for event in self.events)

    def later(self, shift: float) -> Status:
        """Return the status of the same run with a clock that is `shift` s ahead."""
        return Status.of([replace(event, time=event.time + shift) for event in self.events]) if self.events else self

    def data(self) -> dict[str, Any]:
        """Return the status as plain data: ok, message, and the fields of all events."""
        return {"ok": self.ok, "message": self.message, "events": [asdict(e) | {"bodies": list(e.bodies)} for e in self.events]}

    def stored(self) -> str:
        """Return the status as JSON, which `restored` reads."""
        return json.dumps(self.data(), ensure_ascii=False)


def restored(text: str) -> Status:
    """Return the status that `Status.stored` wrote.

    Raises:
        ValueError, KeyError, TypeError: the text is something else.

    """
    data = json.loads(text)
    events = tuple(Event(**(fields | {"bodies": tuple(fields["bodies"])})) for fields in data["events"])
    return Status(bool(data["ok"]), str(data["message"]), events)
