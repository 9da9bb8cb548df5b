"""Where joints and forces are fastened to bodies. They are the same as before if they are fastened there, whatever else of them changes."""

from __future__ import annotations

from typing import Any

from rigidimpulse.core.content_digest import digest_of

FASTENED_BY = frozenset({"a", "b", "body", "anchor", "anchor_a", "anchor_b", "axis", "axes", "axes_b", "point", "direction"})
"""What joints and forces say of where they are fastened."""


def fastening(effect: Any) -> tuple[type, str]:
    """Return the class of a joint or force, and a digest of what it says of where it is fastened."""
    return type(effect), digest_of({name: getattr(effect, name) for name in sorted(FASTENED_BY) if hasattr(effect, name)})
