"""Layouts: the poses of a scene's dynamic bodies as variables, and those that minimise a sum of energies.

Newton's method on positions and rotation vectors about the present orientations (see `minimise`), with the exact second derivatives of the
terms; exact pins by the method of multipliers around it (see `pin`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import multiply, normalize, quaternion_from_rotation_vector
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.energy.minimise import Report, Terms, minimise
from rigidimpulse.dynamics.forces.energy.pin import CompiledPin
from rigidimpulse.dynamics.forces.energy.term import CompiledEnergy, Energy, Expansion, Poses, poses
from rigidimpulse.model.world import World

MAX_ROUNDS = 30
STIFFER = 10.0
"""Factor of the stiffness of exact pins after a round that did not bring them much nearer, and over what else acts at first."""


def compile_energies(world: World, energies: Sequence[Energy]) -> list[CompiledEnergy]:
    """Bind energies to a compiled scene.

    Raises:
        SceneError: it is no sequence of energies of bodies, or a term refuses what it is given.

    """
    if not isinstance(energies, Sequence) or isinstance(energies, str) or not energies:
        raise SceneError(f"energies are {energies!r}", "give a list with one or more, such as [NoOverlap(), GravityPotential()]")
    for energy in energies:
        if isinstance(energy, type) or not callable(getattr(energy, "compile", None)):
            remedy = "give PinPoints, RestoreShape, NoOverlap, PointOnSurface or GravityPotential"
            raise SceneError(f"{energy!r} is no energy of bodies", remedy)
    return [energy.compile(world) for energy in energies]


def expanded(compiled: Sequence[CompiledEnergy], at: Poses) -> Expansion:
    """Return value, gradient and second derivatives of a sum of energies."""
    total = Expansion(len(at.position))
    for term in compiled:
        term.expand(at, total)
    return total


class Layout:
    """The dynamic bodies of a scene as variables."""

    def __init__(self, world: World, compiled: list[CompiledEnergy]) -> None:
        self.world, self.compiled = world, compiled
        self.free = np.flatnonzero(np.repeat(world.dynamic, 6))
        # A turn of one radian counts as a way of the radius about the centre of mass.
        radius = world.bound_radius[world.dynamic]
        self.metric = np.stack([np.ones_like(radius)] * 3 + [radius**2] * 3, axis=1).ravel()
        self.length = float(radius.max())
        self.pins = [term for term in compiled if isinstance(term, CompiledPin) and term.hard]

    def terms(self, at: Poses) -> Terms:
        """Return the sum of the energies, by the variables."""
        total = expanded(self.compiled, at)
        hessian = total.hessian()[self.free][:, self.free]
        return Terms(total.value, total.magnitude, total.gradient.ravel()[self.free], hessian)

    def move(self, at: Poses, step: np.ndarray) -> Poses:
        """Return the poses after a step."""
        both = np.zeros((self.world.num_bodies, 6))
        both.ravel()[self.free] = step
        turned = normalize(multiply(quaternion_from_rotation_vector(both[:, 3:]), at.orientation))
        return poses(at.position + both[:, :3], np.where(np.any(both[:, 3:], axis=1)[:, None], turned, at.orientation))

    def settled(self, max_iterations: int) -> tuple[Poses, Report]:
        """Return the poses at the minimum, and how it went."""
        at = poses(self.world.position, self.world.orientation)
        self._set_stiffness(at)
        last, done = np.inf, 0
        for _ in range(MAX_ROUNDS):
            at, report = minimise(self.terms, self.move, at, self.metric, self.length, self._extent(at), max_iterations - done)
            done += report.iterations
            apart = self._apart(at)
            report = replace(report, iterations=done, residual=apart, value=self._value(at))
            if not report.ok or apart <= self._closed(at):
                return at, report
            for pin in self.pins:
                pin.multiplier = pin.multiplier + pin.stiffness * pin.apart(at)
                pin.stiffness *= STIFFER if apart > 0.1 * last else 1.0
            last = apart
        worst = max(self.pins, key=lambda pin: float(np.linalg.norm(pin.apart(at))))
        message = f"{worst.name} stays open by {apart:.3g} m: exact pins contradict each other; give one of them a finite weight"
        return at, replace(report, ok=False, message=message)

    def _set_stiffness(self, at: Poses) -> None:
        """Give exact pins a stiffness that other terms do not drown."""
        others = [term for term in self.compiled if term not in self.pins]
        if not self.pins or not others:
            return
        total = expanded(others, at)
        curvature = np.abs(total.hessian().diagonal()[self.free]) / self.metric
        force = np.abs(total.gradient.ravel()[self.free]) / np.sqrt(self.metric)
        stiffness = STIFFER * (float(curvature.max()) + float(force.max()) / self.length)
        for pin in self.pins:
            pin.stiffness = stiffness if stiffness > 0.0 else 1.0

    def _apart(self, at: Poses) -> float:
        """Return the largest distance of exact pins, m."""
        return max((float(np.linalg.norm(pin.apart(at))) for pin in self.pins), default=0.0)

    def _extent(self, at: Poses) -> float:
        """Return the size of coordinates, m."""
        return max(self.length, float(np.abs(at.position).max()))

    def _closed(self, at: Poses) -> float:
        """Return the distance at which pins are closed, m: rounding of where they are."""
        return TOLERANCES.joint.closed * self.length + 4.0 * TOLERANCES.arithmetic.round_off * self._extent(at)

    def _value(self, at: Poses) -> float:
        """Return the sum of all but exact pins, J."""
        return expanded([term for term in self.compiled if term not in self.pins], at).value
