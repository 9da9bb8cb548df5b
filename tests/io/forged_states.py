"""States and caches that somebody has put together by hand, for tests of what reads them."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.io.cache.constants import Constants
from rigidimpulse.io.cache.decode import thaw
from rigidimpulse.io.cache.encode import LENGTHS, MARK, freeze
from rigidimpulse.io.cache.layout import COMMIT, digest_of


def state(*nodes: Any, arrays: bytes = b"", constants: int = 0) -> bytes:
    """The bytes of a state with these nodes, of which the last one is the state."""
    return packed(json.dumps([constants, [len(nodes) - 1], nodes]).encode(), arrays)


def packed(table: bytes, arrays: bytes = b"") -> bytes:
    """The bytes of a state with this table, in JSON."""
    return MARK + LENGTHS.pack(len(table), len(arrays)) + table + arrays


def again(thing: Any) -> Any:
    """A thing, written and read."""
    return thaw(freeze(thing, Constants([])), Constants([]))


def put_state(path: Path, content: bytes, length: int | None = None, **claims: Any) -> None:
    """Put a state into the last checkpoint of a cache, with a digest that agrees; claims: other numbers of its commit."""
    import h5py

    data = zlib.compress(content, 1)
    with h5py.File(path, "r+") as file:
        commits = file["checkpoint/commits"][()]
        slot = int(np.argmax(commits["number"]))
        del file[f"checkpoint/{slot}"]
        file[f"checkpoint/{slot}"] = np.frombuffer(data, np.uint8)
        commit = commits[slot : slot + 1]
        commit["size"], commit["length"] = len(data), len(content) if length is None else length
        for name, value in claims.items():
            commit[name] = value
        commit["digest"] = digest_of(commit[0], data)
        assert commits.dtype == COMMIT
        file["checkpoint/commits"][...] = commits
