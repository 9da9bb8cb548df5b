"""Where a run is stored on disk while it goes on."""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True)
class Cache:
    """Where a run is stored on disk while it goes on, see `simulate`.

    Attributes:
        path: a file that ends in .h5 or .hdf5.
        every: s of computing between checkpoints, at least; 20 times the duration of one checkpoint if that is longer. 0: a checkpoint
            after every step, however long that takes.
        trust: go on from checkpoints that this user has not written on this machine. Whoever wrote them can do with your process what they
            like: see docs/guide/security.md.

    """

    path: str | os.PathLike[str]
    every: float = 5.0
    trust: bool = False
