"""Errors that people see: each says where, what, and what to change."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class RigidImpulseError(Exception):
    """Base of all errors raised on purpose by this package."""


class SceneError(RigidImpulseError, ValueError):
    """A scene, or a file of one, that cannot be simulated as it is.

    Attributes:
        problem: what is wrong, with the offending value.
        remedy: what to change.
        where: the thing it is about, such as "body 'spot'"; empty if not known yet.

    """

    def __init__(self, problem: str, remedy: str = "", where: str = "") -> None:
        """Keep the three parts; `str` joins them."""
        super().__init__(problem, remedy, where)
        self.problem = problem
        self.remedy = remedy
        self.where = where

    def __str__(self) -> str:
        """Return "where: problem; remedy"."""
        text = f"{self.where}: {self.problem}" if self.where else self.problem
        return f"{text}; {self.remedy}" if self.remedy else text

    def within(self, where: str) -> SceneError:
        """Return the same error, placed inside something larger: "body 'spot', sphere"."""
        return SceneError(self.problem, self.remedy, f"{where}, {self.where}" if self.where else where)


def unknown_name(what: str, name: object, known: Iterable[str], where: str = "") -> SceneError:
    """Return the error for a name that is not among the known ones; it lists them, the likeliest first.

    Args:
        what: the kind of thing, such as "body".
        name: what was asked for.
        known: the names there are.
        where: see `SceneError`.

    """
    known = list(known)
    close = difflib.get_close_matches(str(name), known, n=1)
    listing = ", ".join(repr(entry) for entry in known) or "none"
    remedy = f"did you mean {close[0]!r}? known: {listing}" if close else f"known: {listing}"
    return SceneError(f"unknown {what} {name!r}", remedy, where)
