"""How several cores share the work of sub-stepped islands, and how much memory it takes at first. A run has the same bits with any."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from rigidimpulse.collision.contact_buffer import CONTACT_CAPACITY
from rigidimpulse.collision.contact_table import FIRST_POINTS, POINTS_OF_A_BODY
from rigidimpulse.core.kernels import Kernel, number_of_cores
from rigidimpulse.core.simd import Simd, machine_simd
from rigidimpulse.dynamics.solvers.tgs_soft.records import PATCHES_OF_A_BODY

Together = Callable[[Kernel, Sequence[tuple]], list[Any]]
"""Calls a kernel with several tuples of arguments at once; returns the results in their order."""


@dataclass(frozen=True)
class Sharing:
    """How many cores work, what makes several cores worthwhile, and first sizes of memory.

    Attributes:
        most_cores: that work at once. simd: width of the vectors.
        pairs, general_pairs: beyond which several cores look at them: some hundreds of microseconds are lost by it.
        batches: each counted in every sub-step, beyond which several cores solve them. solvers: how many of them at most.
        first_points, points_of_a_body: see `ContactTable`. patches_of_a_body: patches that are reserved for each body.
        buffer: contacts that a buffer of general pairs holds at first.
        together: how a kernel is called on several cores; None: by `Kernel.together`.

    """

    most_cores: int = field(default_factory=number_of_cores)
    simd: Simd = field(default_factory=machine_simd)
    pairs: int = 400
    general_pairs: int = 40
    batches: int = 2000
    solvers: int = 2
    first_points: int = FIRST_POINTS
    points_of_a_body: int = POINTS_OF_A_BODY
    patches_of_a_body: int = PATCHES_OF_A_BODY
    buffer: int = CONTACT_CAPACITY
    together: Together | None = None

    def call(self, kernel: Kernel, calls: Sequence[tuple]) -> list[Any]:
        """Call a kernel with each of these tuples of arguments at once."""
        return self.together(kernel, calls) if self.together else kernel.together(calls)
