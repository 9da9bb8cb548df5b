"""From touches to contacts: planes, aims and friction of everything that soft bodies may touch in a step.

A vertex that touches at the place s of a body, with the normal n there, shall end above the plane through s: u.n >= 0 with the gap g kept
(the distance it starts with, where that is less). The slip is its way in that plane over the step relative to the material point at s.
A sample point of a body that touches a face does the same with the place of the face that it meets first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.geometry import ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.soft_body.contact import (
    BodyShapes,
    MovingFaces,
    MovingSamples,
    PosesOverStep,
    fit_boxes,
    sample_points,
    samples_on_faces,
    vertices_on_bodies,
)
from rigidimpulse.dynamics.soft_body.contact_terms import SoftContacts

CORRECTION = 0.2
"""Share of a missing gap that a vertex is moved by, per step, without any velocity."""
SLIPS = TOLERANCES.soft_body.slips


class RigidMotion(NamedTuple):
    """All n rigid bodies over a step of h s, as they would move without the soft bodies. Principal frames, world axes."""

    position: np.ndarray  # (n, 3) m, at its start
    rotation: np.ndarray  # (n, 3, 3) body to world
    velocity: np.ndarray  # (n, 3) m/s
    angular_velocity: np.ndarray  # (n, 3) rad/s
    end_position: np.ndarray  # (n, 3) m, at its end
    end_rotation: np.ndarray  # (n, 3, 3)
    inv_mass: np.ndarray  # (n,) 1/kg
    inv_inertia: np.ndarray  # (n, 3, 3) 1/(kg m^2), world axes, at its start
    movable: np.ndarray  # (n,) bool, False: static or kinematic


class FoundContacts(NamedTuple):
    """Places found by `Surfaces.find`: what `SoftContacts` needs, without the solver's own numbers."""

    key: np.ndarray  # (m,)
    node: np.ndarray  # (m, 3)
    weight: np.ndarray  # (m, 3)
    body: np.ndarray  # (m,)
    place: np.ndarray  # (m, 3) m, of the surface, in the body's frame
    normal: np.ndarray  # (m, 3) from the body to the soft body, in the body's frame
    target: np.ndarray  # (m,) m, gap to end with
    distance: np.ndarray  # (m,) m, where it touches
    time: np.ndarray  # (m,) share of the step before it touches


def joined(touches: list[FoundContacts]) -> FoundContacts:
    """Return several as one."""
    return FoundContacts(*(np.concatenate(column) for column in zip(*touches, strict=True)))


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What can touch: vertices and faces of soft bodies, surfaces and sample points of bodies.

    Attributes:
        geometry: of the bodies. shape_of_body: (n,). radius: (n,) m about the centre of mass.
        faces: all faces of soft bodies, one mesh; None without any.
        sample, sample_radius, sample_body: (s, 3) m in the body's frame, (s,) m, (s,).
        skip: (v, n) bool, vertices that do not touch a body.
        ball: (n,) bool, bodies that are one sphere about their centre of mass.
        is_slim: (s,) bool, samples that fit through a face between its vertices: through larger ones no ball gets that vertices stop.
        gap: m.

    """

    geometry: Geometry
    shape_of_body: np.ndarray
    radius: np.ndarray
    faces: Geometry | None
    sample: np.ndarray
    sample_radius: np.ndarray
    sample_body: np.ndarray
    skip: np.ndarray
    ball: np.ndarray
    is_slim: np.ndarray
    gap: float

    def find(
        self, start: np.ndarray, end: np.ndarray, rigid: RigidMotion, sides: dict[int, float], gap: float, frame: np.ndarray, every: bool
    ) -> FoundContacts:
        """Find all places that come within a gap (m) while vertices move from start to end (v, 3) m. `sides`: see `_samples`.

        every: whether to find all faces that a sample point meets, where it could slip through one, or its first one only.
        frame: (n, 3, 3), the rotations at the end that normals and places are written for. Planes of vertices lie on the bodies and turn
        with them; those of sample points lie on the faces, and those on balls, on which no rotation can be seen, stay as well.
        """
        seen = rigid._replace(end_rotation=np.where(self.ball[:, None, None], rigid.rotation, rigid.end_rotation))
        vertices = self._vertices(start, end, seen, gap)
        back = np.einsum("nji,njk->nik", frame, seen.end_rotation)
        back[~self.ball] = np.eye(3)
        normal, place = (np.einsum("mij,mj->mi", back[vertices.body], v) for v in (vertices.normal, vertices.place))
        return joined([vertices._replace(normal=normal, place=place), self._samples(start, end, seen, sides, gap, every, frame)])

    def _vertices(self, start: np.ndarray, end: np.ndarray, rigid: RigidMotion, gap: float) -> FoundContacts:
        """FoundContacts of vertices on bodies."""
        capacity = 256
        while True:
            which, real = np.empty((capacity, 2), np.int64), np.empty((capacity, 8))
            count = vertices_on_bodies(
                BodyShapes(self.geometry, self.shape_of_body, self.radius),
                PosesOverStep(rigid.position, rigid.rotation, rigid.end_position, rigid.end_rotation),
                start, end, gap, self.skip, which, real,
            )  # fmt: skip
            if count <= capacity:
                break
            capacity = 2 * count
        vertex, body, real = which[:count, 0], which[:count, 1], real[:count]
        weight = np.zeros((count, 3))
        weight[:, 0] = 1.0
        distance, time = real[:, 6], real[:, 7]
        target = np.where(time == 0.0, np.minimum(distance, gap), gap)
        key = vertex * len(self.radius) + body
        return FoundContacts(key, np.tile(vertex[:, None], 3), weight, body, real[:, 3:6], real[:, :3], target, distance, time)

    def _samples(
        self, start: np.ndarray, end: np.ndarray, rigid: RigidMotion, sides: dict[int, float], gap: float, every: bool, frame: np.ndarray
    ) -> FoundContacts:
        """FoundContacts of sample points on faces; every, frame: see `find`.

        `sides` says, by key, on which side of the faces a sample was when it was last in contact: one that is found on the other side,
        by less than the gap, has not passed but was moved there by round-off, and is sent back.
        """
        body = self.sample_body
        if self.faces is None or len(body) == 0:
            return _nothing_found()
        p0 = rigid.position[body] + np.einsum("sij,sj->si", rigid.rotation[body], self.sample)
        p1 = rigid.end_position[body] + np.einsum("sij,sj->si", rigid.end_rotation[body], self.sample)
        low, high = np.empty_like(self.faces.node_min), np.empty_like(self.faces.node_max)
        fit_boxes(self.faces, start, end, low, high)
        capacity = len(body)
        while True:
            which, real = np.empty((capacity, 2), np.int64), np.empty((capacity, 8))
            count = samples_on_faces(
                MovingFaces(self.faces, low, high, start, end, self.skip),
                MovingSamples(p0, p1, self.sample_radius, body, every & self.is_slim), gap, which, real,
            )  # fmt: skip
            # The kernel says how many there are; the buffer grows until all fit.
            if count <= capacity:
                break
            capacity = 2 * count
        sample, face, real = which[:count, 0], which[:count, 1], real[:count]
        node, weight, normal, distance, time = self.faces.triangle[face], real[:, :3], real[:, 3:6], real[:, 6], real[:, 7]
        key = self.skip.size + sample
        side = np.einsum("ij,ij->i", normal, _face_normals(start[node]))
        # A sample on the other side than before did not pass: round-off put it there, and it is sent back.
        wrong = np.array([sides.get(int(k), s) * s < 0.0 for k, s in zip(key, side, strict=True)], bool) & (time == 0.0)
        normal = np.where(wrong[:, None], -normal, normal)
        distance = np.where(wrong, -distance - 2.0 * self.sample_radius[sample], distance)
        # What is nearer than the gap from the start keeps its distance.
        target = np.where(time == 0.0, np.minimum(distance, gap), gap)
        b = body[sample]
        turned = np.einsum("sji,sj->si", frame[b], normal)
        place = self.sample[sample] + self.sample_radius[sample, None] * turned
        return FoundContacts(key, node, weight, b, place, turned, target, distance, time)


def sides_of(touches: FoundContacts, x: np.ndarray, rotation: np.ndarray, first_key: int) -> dict[int, float]:
    """On which side of the faces, at vertices x (v, 3), samples are: by key, see `Surfaces._samples`."""
    chosen = np.flatnonzero(touches.key >= first_key)
    normal = np.einsum("sij,sj->si", rotation[touches.body[chosen]], touches.normal[chosen])
    side = np.einsum("ij,ij->i", normal, _face_normals(x[touches.node[chosen]]))
    return {int(k): float(s) for k, s in zip(touches.key[chosen], side, strict=True)}


def _face_normals(corners: np.ndarray) -> np.ndarray:
    return cross_arrays(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _nothing_found() -> FoundContacts:
    flat, index = np.zeros((0, 3)), np.zeros(0, np.int64)
    return FoundContacts(index, np.zeros((0, 3), np.int64), flat, index, flat, flat, np.zeros(0), np.zeros(0), np.zeros(0))


def make_surfaces(
    bodies: BodyShapes, ball: np.ndarray, position: np.ndarray, face: np.ndarray, skip: np.ndarray, edge: float, gap: float
) -> Surfaces:
    """Prepare the surfaces of a scene: rigid bodies, vertices (v, 3) m and faces (f, 3) of all soft bodies; see `Surfaces`."""
    geometry, shape_of_body, radius = bodies
    samples, radii, owner = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0, np.int64)]
    for b, shape in enumerate(shape_of_body):
        points, r = sample_points(geometry, int(shape))
        samples.append(points)
        radii.append(r)
        owner.append(np.full(len(points), b))
    is_slim = np.concatenate(radii) < edge / np.sqrt(3.0)
    faces = build_geometry([CompiledShape((Primitive(ROUND, vertices=position, faces=face),))]) if len(face) else None
    return Surfaces(
        geometry, shape_of_body, np.asarray(radius, float), faces, np.concatenate(samples), np.concatenate(radii),
        np.concatenate(owner), skip, np.asarray(ball, bool), is_slim, gap,
    )  # fmt: skip


def make_contacts(
    touches: FoundContacts, start: np.ndarray, velocity: np.ndarray, rigid: RigidMotion, unknown: np.ndarray, friction: np.ndarray,
    slow: float,
) -> SoftContacts:
    """Make contacts of touches.

    Args:
        touches: places. start: (v, 3) m. velocity: (v, 3) m/s. rigid: bodies without the soft bodies.
        unknown: (n,) place of each body among the unknowns, -1 for none.
        friction: (v, n, 2) static and dynamic. slow: m/s, slip below which the static one counts.

    """
    b, m = touches.body, len(touches.body)
    arm = np.einsum("mij,mj->mi", rigid.end_rotation[b], touches.place)
    normal = np.einsum("mij,mj->mi", rigid.end_rotation[b], touches.normal)
    place = rigid.position[b] + np.einsum("mij,mj->mi", rigid.rotation[b], touches.place)
    point = np.einsum("mk,mkj->mj", touches.weight, start[touches.node])
    # Without slip the point stays where it was beside the place, carried by the body.
    before = np.einsum("mij,mkj,mk->mi", rigid.end_rotation[b], rigid.rotation[b], point - place)
    before -= normal * np.einsum("ij,ij->i", before, normal)[:, None]
    aim = rigid.end_position[b] + arm + before + touches.target[:, None] * normal
    slip = np.einsum("mk,mkj->mj", touches.weight, velocity[touches.node]) - rigid.velocity[b]
    slip -= cross_arrays(rigid.angular_velocity[b], place - rigid.position[b])
    slip -= normal * np.einsum("ij,ij->i", slip, normal)[:, None]
    pair = friction[touches.node[:, 0], b]
    # Static friction counts below the speed `slow` of slip, dynamic friction above it.
    grip = np.where(np.linalg.norm(slip, axis=1) > slow, pair[:, 1], pair[:, 0])
    return SoftContacts(
        touches.node, touches.weight, b, unknown[b], arm, normal, aim, grip, np.ones(m), np.zeros((m, 3)), np.zeros(m),
        np.zeros(m, bool), touches.key,
    )  # fmt: skip
