"""Signatures of checkpoints: a run goes on only from what this user has written.

Compiled kernels take indices out of the arrays of a state. No check of single numbers makes a state of others safe for them, so a state is
signed when it is written, and its signature is compared before anything in it is read. The signature is

    s = HMAC-SHA256(k, what it is of | fingerprint of the run | digest)        (RFC 2104; RFC 6234)

with 32 random bytes k that only this user can read. They are made once, and kept in `rigidimpulse/cache_key` of the folder for states of
programs (XDG Base Directory Specification), or in the file that RIGIDIMPULSE_CACHE_KEY names: that is how several machines share one.

Where no key can be kept, nothing is signed, and a run goes on only from caches that the program trusts (`Cache.trust`).
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path

from rigidimpulse.core.errors import SceneError

VARIABLE = "RIGIDIMPULSE_CACHE_KEY"
LENGTH = 32
"""Bytes of a key."""
FOR_THE_USER = 0o600
NO_KEY = b"none"
CHECKPOINT, ORIGIN = "checkpoint", "origin"
"""What signatures are of."""
REMEDY = (
    "ri.load_recording shows its frames. If you trust who wrote it, go on with cache=ri.Cache(path, trust=True), or with --trust-cache; "
    "else delete it, and run again"
)


def signature(kind: str, fingerprint: str, digest: bytes) -> bytes:
    """Return the signature of a digest, in hexadecimal digits, or the word `NO_KEY` where this user has none."""
    key = _key()
    return NO_KEY if key is None else _signed(key, kind, fingerprint, digest)


def check_signature(found: bytes, kind: str, fingerprint: str, digest: bytes, where: str) -> None:
    """Compare the signature that was found with a digest; where: how a message names the file.

    Raises:
        SceneError: it is none of this user.

    """
    key = _key()
    if key is None:
        raise SceneError(f"it cannot be seen who wrote its checkpoints: {_why_not()}", REMEDY, where)
    if not hmac.compare_digest(found, _signed(key, kind, fingerprint, digest)):
        raise SceneError("its checkpoints were not written by this user on this machine", REMEDY, where)


def _signed(key: bytes, kind: str, fingerprint: str, digest: bytes) -> bytes:
    """The signature of a digest by a key. No part of what is signed can hold the bar between them."""
    return hmac.new(key, b"|".join([kind.encode(), fingerprint.encode(), digest]), hashlib.sha256).hexdigest().encode()


def _place() -> Path | None:
    """The file of the key, None for a user without a home."""
    if named := os.environ.get(VARIABLE):
        return Path(named)
    folder = os.environ.get("XDG_STATE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.local/state")
    return None if folder.startswith("~") else Path(folder) / "rigidimpulse" / "cache_key"


def _key() -> bytes | None:
    """The key of this user, made where there is none; None where it cannot be kept, or where others can read it."""
    place = _place()
    if place is None:
        return None
    with suppress(OSError):
        if not place.exists():
            _make(place)
        if not _others_can_read(place):
            key = place.read_bytes()
            return key if len(key) == LENGTH else None
    return None


def _make(place: Path) -> None:
    """Write a new key. Of two processes that do so at once, one gets the other's; nobody ever sees half of one."""
    place.parent.mkdir(parents=True, exist_ok=True)
    temporary = place.with_name(f"{place.name}.{secrets.token_hex(8)}")
    try:
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, FOR_THE_USER), "wb") as file:
            file.write(secrets.token_bytes(LENGTH))
        with suppress(FileExistsError):
            os.link(temporary, place)
    finally:
        temporary.unlink(missing_ok=True)


def _others_can_read(place: Path) -> bool:
    """Whether somebody else may know a key, or have put it there. The administrator is nobody else."""
    if os.name == "nt":  # there files of a user are his own, and no bits say more
        return False
    status = place.stat()
    return status.st_uid not in (0, os.geteuid()) or bool(status.st_mode & (stat.S_IRWXG | stat.S_IRWXO))


def _why_not() -> str:
    """Why this user has no key."""
    place = _place()
    if place is None:
        return "this user has no home in which a key could be kept"
    if not place.exists():
        return f"the key {str(place)!r} cannot be written"
    return f"{str(place)!r} is no key of {LENGTH} bytes that only this user can read (chmod 600, or delete it)"
