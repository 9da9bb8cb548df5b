"""The events to come, earliest first: a priority queue that knows where each entry stands, so that its time may change.

Entries are numbered; entry p has the time key[p], and at equal times the lower owner[p] comes first. An entry whose time
is inf is not in the queue. order (k,) holds the entries, place (k,) where each stands, -1 outside; size (1,) how many.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit


class Queue(NamedTuple):
    """See the head of the file."""

    key: np.ndarray  # (k,) s
    owner: np.ndarray  # (k,) int64
    order: np.ndarray  # (k,) int64
    place: np.ndarray  # (k,) int64
    size: np.ndarray  # (1,) int64


def make_queue(capacity: int) -> Queue:
    """Make an empty queue for entries 0 ... capacity - 1."""
    owner, order = np.zeros((2, capacity), np.int64)
    return Queue(np.full(capacity, np.inf), owner, order, np.full(capacity, -1, np.int64), np.zeros(1, np.int64))


@jit
def _before(queue, p, q):
    """Whether entry p comes before entry q."""
    return queue.key[p] < queue.key[q] or (queue.key[p] == queue.key[q] and queue.owner[p] < queue.owner[q])


@jit
def _put(queue, at, p):
    queue.order[at] = p
    queue.place[p] = at


@jit
def _sift(queue, at, p):
    """Bring entry p from `at` to where it belongs."""
    while at > 0:
        parent = (at - 1) // 2
        if not _before(queue, p, queue.order[parent]):
            break
        _put(queue, at, queue.order[parent])
        at = parent
    while True:
        # Downwards: the earlier child moves up.
        child = 2 * at + 1
        if child >= queue.size[0]:
            break
        if child + 1 < queue.size[0] and _before(queue, queue.order[child + 1], queue.order[child]):
            child += 1
        if not _before(queue, queue.order[child], p):
            break
        _put(queue, at, queue.order[child])
        at = child
    _put(queue, at, p)


@jit
def clear(queue):
    """Take all entries out."""
    for at in range(queue.size[0]):
        queue.place[queue.order[at]] = -1
    queue.size[0] = 0


@jit
def schedule(queue, p, time, owner):
    """Let entry p come at `time` [s]; inf takes it out."""
    at = queue.place[p]
    queue.key[p], queue.owner[p] = time, owner
    if time < inf:
        if at < 0:
            at = queue.size[0]
            queue.size[0] = at + 1
        _sift(queue, at, p)
    elif at >= 0:
        queue.size[0] -= 1
        queue.place[p] = -1
        if at < queue.size[0]:
            _sift(queue, at, queue.order[queue.size[0]])
