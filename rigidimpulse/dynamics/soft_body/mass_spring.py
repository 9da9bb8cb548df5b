"""Soft bodies: the point masses, springs and hinges that flexible bodies are compiled to.

    E(x) = sum over springs of k (l - L)^2 / 2  +  sum over hinges of kappa (phi - phi_0)^2 / 2

Dampers have c = tau k and tau kappa: every mode of frequency w is damped by the ratio tau w / 2 (Rayleigh damping). The stiffness of
a sheet is a property of its material, not of its mesh: with A the area of the faces at an edge, L its length,

    k = E_s A / L^2     (van Gelder 1998; E_s N/m, force per width and strain: Young's modulus times thickness)
    kappa = B L^2 / A     (hinges: Grinspun et al. 2003; their stiffness: Seung, Nelson 1988; B N m, flexural rigidity)

On equilateral triangles this is Seung and Nelson's 2 B / sqrt(3): a sheet that is rolled has B c^2 / 2 per area, whatever its curvature
and direction. On squares with a diagonal it has that where it is rolled along their sides. Grinspun's own factor of 3 is no rigidity.

Struts hold a closed mesh open, see `struts`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rigidimpulse.core.triangles import unique_edges
from rigidimpulse.dynamics.soft_body.elements import (
    add_hinge_gradient,
    add_hinge_hessian,
    add_spring_gradient,
    add_spring_hessian,
    hinge_angles,
    hinge_energy,
    spring_energy,
    spring_lengths,
)
from rigidimpulse.dynamics.soft_body.pattern import Pattern, build_pattern
from rigidimpulse.dynamics.soft_body.struts import inner_struts


def _nothing() -> np.ndarray:
    return np.zeros(0)


def _no_hinges() -> np.ndarray:
    return np.zeros((0, 4), np.int64)


def _no_faces() -> np.ndarray:
    return np.zeros((0, 3), np.int64)


@dataclass(frozen=True, eq=False)
class SpringMesh:
    """n point masses with s springs and g hinges.

    Attributes:
        position: (n, 3) m at the start. mass: (n,) kg, > 0.
        spring: (s, 2) vertices. spring_rest: (s,) m. spring_stiffness: (s,) N/m. spring_damping: (s,) N s/m.
        hinge: (g, 4) vertices a, b of the edge, c, d opposite. hinge_rest: (g,) rad. hinge_stiffness: (g,) N m.
            hinge_damping: (g,) N m s.
        face: (f, 3) triangles, for contact and for the eye; may be empty.

    """

    position: np.ndarray
    mass: np.ndarray
    spring: np.ndarray
    spring_rest: np.ndarray
    spring_stiffness: np.ndarray
    spring_damping: np.ndarray
    hinge: np.ndarray = field(default_factory=_no_hinges)
    hinge_rest: np.ndarray = field(default_factory=_nothing)
    hinge_stiffness: np.ndarray = field(default_factory=_nothing)
    hinge_damping: np.ndarray = field(default_factory=_nothing)
    face: np.ndarray = field(default_factory=_no_faces)

    @cached_property
    def pattern(self) -> Pattern:
        """Where the blocks of its matrices are."""
        return build_pattern(len(self.mass), self.spring, self.hinge)

    def lengths(self, x: np.ndarray) -> np.ndarray:
        """Lengths (s,) m of the springs at vertices x (n, 3)."""
        length = np.empty(len(self.spring))
        spring_lengths(x, self.spring, length)
        return length

    def angles(self, x: np.ndarray) -> np.ndarray:
        """Angles (g,) rad of the hinges at vertices x (n, 3)."""
        angle = np.empty(len(self.hinge))
        hinge_angles(x, self.hinge, angle)
        return angle

    def energy(self, x: np.ndarray) -> float:
        """Elastic energy in J at vertices x (n, 3)."""
        return float(
            spring_energy(x, self.spring, self.spring_rest, self.spring_stiffness)
            + hinge_energy(x, self.hinge, self.hinge_rest, self.hinge_stiffness)
        )

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient (n, 3) in N of the elastic energy at vertices x (n, 3)."""
        gradient = np.zeros_like(x)
        add_spring_gradient(x, self.spring, self.spring_rest, self.spring_stiffness, gradient)
        add_hinge_gradient(x, self.hinge, self.hinge_rest, self.hinge_stiffness, gradient)
        return gradient

    def hessian(self, x: np.ndarray, exact: bool = False) -> np.ndarray:
        """Blocks (b, 3, 3) in N/m, by `pattern`, of the second derivatives at vertices x (n, 3).

        Of those of springs the positive semidefinite part, or all; of those of hinges always Gauss and Newton's part.
        """
        block = np.zeros((len(self.pattern.column), 3, 3))
        least = -np.inf if exact else 0.0
        add_spring_hessian(x, self.spring, self.spring_rest, self.spring_stiffness, least, self.pattern.spring_slot, block)
        add_hinge_hessian(x, self.hinge, self.hinge_stiffness, self.pattern.hinge_slot, block)
        return block

    def damped(self, x: np.ndarray, h: float) -> SpringMesh:
        """Springs that act as springs and dampers do over an implicit step h from x (n, 3).

        Up to a constant their energy is E + c (l - l(x))^2 / 2 h + ...

        A spring and a damper of rate (l - l(x)) / h add up to one spring of stiffness k + c / h with another rest length.
        """
        if not (np.any(self.spring_damping) or np.any(self.hinge_damping)):
            return self
        stiffness = self.spring_stiffness + self.spring_damping / h
        # A spring and a damper of rate (l - l(x)) / h are one spring of stiffness k + c / h with another rest length.
        share = np.divide(self.spring_damping / h, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0.0)
        bending = self.hinge_stiffness + self.hinge_damping / h
        hinge_share = np.divide(self.hinge_damping / h, bending, out=np.zeros_like(bending), where=bending > 0.0)
        turn = self.angles(x) - self.hinge_rest
        turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        damped = SpringMesh(
            self.position, self.mass, self.spring, self.spring_rest + share * (self.lengths(x) - self.spring_rest), stiffness,
            self.spring_damping, self.hinge, self.hinge_rest + hinge_share * turn, bending, self.hinge_damping, self.face,
        )  # fmt: skip
        damped.__dict__["pattern"] = self.pattern
        return damped


def sheet(
    position: np.ndarray, face: np.ndarray, mass: float, stiffness: float, bending: float, inner: float, damping: float
) -> SpringMesh:
    """Springs along the edges of a triangle mesh, hinges across them, and struts inside.

    Args:
        position: (n, 3) m, at rest.
        face: (f, 3), every vertex in some face; counter-clockwise seen from outside if inner > 0.
        mass: kg, of all vertices together, shared out by area.
        stiffness: E_s, N/m. bending: B, N m. inner: E_v, Pa; 0 for none.
        damping: tau, s.

    """
    x = np.ascontiguousarray(position, float)
    corners = x[face]
    area_vector = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(area_vector, axis=1)
    vertex_area = np.bincount(face.ravel(), np.repeat(area, 3) / 3.0, len(x))
    edges = unique_edges(face, len(x))
    spring = np.column_stack([face.ravel()[edges.first], np.roll(face, -1, axis=1).ravel()[edges.first]])
    edge_area = np.bincount(edges.triangle_edge.ravel(), np.repeat(area, 3), len(spring))
    length = np.linalg.norm(x[spring[:, 1]] - x[spring[:, 0]], axis=1)
    # k = E_s A / L^2.
    spring_stiffness = stiffness * edge_area / length**2
    # A boundary edge has no second face to bend against.
    two = np.flatnonzero((edges.count == 2) & (bending > 0.0))
    left, right = edges.first[two], edges.last[two]
    opposite = np.roll(face, -2, axis=1).ravel()
    hinge = np.column_stack([spring[two], opposite[left], opposite[right]])
    # kappa = B L^2 / A.
    hinge_stiffness = bending * length[two] ** 2 / edge_area[two]
    if inner > 0.0:
        strut, strut_stiffness = inner_struts(x, face, inner)
        spring, spring_stiffness = np.concatenate([spring, strut]), np.concatenate([spring_stiffness, strut_stiffness])
    spring, hinge = np.ascontiguousarray(spring), np.ascontiguousarray(hinge)
    rest, angle = np.empty(len(spring)), np.empty(len(hinge))
    spring_lengths(x, spring, rest)
    hinge_angles(x, hinge, angle)
    return SpringMesh(
        x, mass * vertex_area / vertex_area.sum(), spring, rest, spring_stiffness, damping * spring_stiffness, hinge, angle,
        hinge_stiffness, damping * hinge_stiffness, np.ascontiguousarray(face),
    )  # fmt: skip


def join(soft_bodies: list[SpringMesh]) -> SpringMesh:
    """Return several soft bodies as one; of none an empty one."""
    first = np.concatenate([[0], np.cumsum([len(soft_body.mass) for soft_body in soft_bodies])]).astype(np.int64)

    def all_of(name: str, *shape: int) -> np.ndarray:
        return np.concatenate([np.zeros((0, *shape)), *(getattr(soft_body, name) for soft_body in soft_bodies)])

    def indices(name: str, width: int) -> np.ndarray:
        parts = [getattr(soft_body, name) + start for soft_body, start in zip(soft_bodies, first, strict=False)]
        return np.concatenate([np.zeros((0, width), np.int64), *parts])

    return SpringMesh(
        all_of("position", 3), all_of("mass"), indices("spring", 2), all_of("spring_rest"), all_of("spring_stiffness"),
        all_of("spring_damping"), indices("hinge", 4), all_of("hinge_rest"), all_of("hinge_stiffness"), all_of("hinge_damping"),
        indices("face", 3),
    )  # fmt: skip
