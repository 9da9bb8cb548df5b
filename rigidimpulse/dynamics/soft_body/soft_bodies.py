"""All flexible bodies of a scene, stepped together and together with the rigid bodies they touch.

A step takes the rigid bodies as they would move alone, solves soft bodies, contacts and the reaction of every body in contact at once
(see `minimise`), and returns the impulses that the bodies got. Over the step of h s an impulse J moves its body by h J / m, as implicit
Euler does, but that part of it which bears a steady load L, as in the step before and no more than gravity's, by half of that:

    d = h J / m - h^2 L / 2 m    exactly by the force    F(s) = 4 J / h - 3 L + (6 L - 6 J / h) s / h

It is constant where J = h L: a body at rest stays there. A constant force J / h would move the body by h J / 2 m and leave it inside
the soft body by up to h^2 F / 2 m, or let it go on through it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.portable import dot, length, matmul
from rigidimpulse.core.quaternion import quaternion_from_rotation_vector, to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.union_find import roots
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces import KINDS
from rigidimpulse.dynamics.soft_body.balance import lever_place, set_momenta, take_energy
from rigidimpulse.dynamics.soft_body.contact import BodyShapes
from rigidimpulse.dynamics.soft_body.contact_planes import (
    CORRECTION,
    SLIPS,
    FoundContacts,
    RigidMotion,
    joined,
    make_contacts,
    make_surfaces,
    sides_of,
)
from rigidimpulse.dynamics.soft_body.contact_terms import SoftContacts
from rigidimpulse.dynamics.soft_body.implicit_step import Problem, Solution, minimise, set_penalties, value_of
from rigidimpulse.dynamics.soft_body.mass_spring import join
from rigidimpulse.model.world import World
from rigidimpulse.scene.material import combine

GAP = 0.01
"""Gap at which soft bodies are kept from bodies, and rest on them, relative to the mean length of their edges and struts."""
ROUNDS = 10
"""Most times that contacts are looked for again on the way that was solved for."""
MIDPOINT_EXCESS = TOLERANCES.soft_body.midpoint_excess
MIDPOINT_MADE = TOLERANCES.soft_body.midpoint_energy
ALIKE = 0.95
"""Cosine of the angle between two normals above which one plane keeps both places apart."""
AT_ONCE = 0.05
"""Share of the step in which faces that a sample point meets count as met at once: what it meets later depends on what these do to it."""
SCHEMES = ("euler", "midpoint")


class FlexibleStep(NamedTuple):
    """What a step of soft bodies did to n rigid bodies, and how it went."""

    impulse: np.ndarray  # (n, 6) N s, N m s about the centre of mass: what the soft bodies gave each body over the step
    ramp: np.ndarray  # (2, n, 6) N, N m: force and torque at the start, and their rates per s (see the module)
    energy_taken: float  # J, motion taken off against energy out of nothing
    energy_made: float  # J, of it what no motion was left to be taken from
    energy_turned: float  # J, what the step dealt with: the largest of its energies, and what gravity would give in it
    num_contacts: int
    converged: bool  # False: solved without friction, or not at all
    unresolved: int  # contacts still found after the last round


class Solved(NamedTuple):
    """A step that has been solved for a set of contacts."""

    solution: Solution
    contacts: SoftContacts
    problem: Problem
    slots: np.ndarray  # movable bodies among the unknowns
    midpoint: bool  # whether the midpoint rule was used, or implicit Euler


class Flexibles:
    """The soft bodies of a scene and their state.

    Attributes:
        bodies: the flexible bodies, in the order they were added. first: (k + 1,) vertices of each.
        soft_body: all of them as one `SpringMesh`.
        position: (v, 3) m. velocity: (v, 3) m/s.
        energy_taken: J so far.

    """

    def __init__(self, world: World, scheme: str = "euler", tolerance: float = 1e-6) -> None:
        """Compile the flexible bodies of a scene.

        Args:
            world: the compiled scene; its gravity counts for the soft bodies.
            scheme: "euler" (first order, damps what steps do not resolve) or "midpoint" (second order; steps in which anything
                is touched are Euler's).
            tolerance: error of the solver's velocities, relative to the speeds in a step.

        Raises:
            SceneError: naming the body, the value and the remedy.

        """
        if scheme not in SCHEMES:
            raise SceneError(f"scheme is {scheme!r}", f"give one of {', '.join(map(repr, SCHEMES))}", "flexible bodies")
        self.bodies = [effect for effect in world.scene.effects if effect.kind == KINDS["FlexibleBody"]]
        names = [*world.names, *(body.name for body in self.bodies)]
        for name in {name for name in names if names.count(name) > 1}:
            raise SceneError("the scene has a body of this name already", "give it another", f"flexible body {name!r}")
        soft_bodies = [body.build() for body in self.bodies]
        self.first = np.concatenate([[0], np.cumsum([len(soft_body.mass) for soft_body in soft_bodies])]).astype(np.int64)
        self.soft_body = join(soft_bodies)
        self.scheme, self.tolerance = scheme, tolerance
        self.position = self.soft_body.position.copy()
        velocities = [body.start_velocity(soft_body.position) for body, soft_body in zip(self.bodies, soft_bodies, strict=True)]
        self.velocity = np.concatenate([np.zeros((0, 3)), *velocities])
        factors = np.array([body.gravity_factor for body in self.bodies], float)
        owner = np.repeat(np.arange(len(soft_bodies)), np.diff(self.first))
        self._gravity = factors[owner, None] * np.asarray(world.scene.gravity, float)
        self._fasten(world)
        self._pieces = self._find_pieces(~np.isin(np.arange(len(owner)), self._held[0]))
        self._prepare_contact(world, owner)
        self._force_of: dict[int, np.ndarray] = {}
        self._sides: dict[int, float] = {}
        self._load = np.zeros((world.num_bodies, 3))
        self.energy_taken = 0.0

    def carry_on(self, earlier: Flexibles) -> None:
        """Put bodies that are the same in an earlier run where they are there, with their velocities; the same: name and vertices."""
        place = {body.name: k for k, body in enumerate(earlier.bodies)}
        for mine, body in enumerate(self.bodies):
            k = place.get(body.name, -1)
            if k >= 0 and earlier.first[k + 1] - earlier.first[k] == self.first[mine + 1] - self.first[mine]:
                here, there = slice(self.first[mine], self.first[mine + 1]), slice(earlier.first[k], earlier.first[k + 1])
                self.position[here], self.velocity[here] = earlier.position[there], earlier.velocity[there]

    def _fasten(self, world: World) -> None:
        """Sort fastened vertices: held ones follow what is immovable, the others are in contact with a dynamic body for good."""
        vertex, body = [], []
        for flexible, first in zip(self.bodies, self.first, strict=False):
            for v, b in flexible.fastenings(world.names).items():
                vertex.append(int(first) + v)
                body.append(b)
        vertices, owners = np.array(vertex, np.int64), np.array(body, np.int64)
        start = [to_matrix(q) for q in world.orientation]
        place = [self.position[v] if b < 0 else dot(start[b].T, self.position[v] - world.position[b]) for v, b in zip(vertices, owners)]
        places = np.array(place, float).reshape(-1, 3)
        follows = np.array([b < 0 or not world.dynamic[b] for b in owners], bool)
        self._held = (vertices[follows], owners[follows], places[follows])
        self._joined = (vertices[~follows], owners[~follows], places[~follows])

    def _find_pieces(self, free: np.ndarray) -> list[np.ndarray]:
        """Vertices of each connected piece without held vertices."""
        n, ends = len(free), np.concatenate([self.soft_body.spring, self.soft_body.hinge[:, [0, 2]], self.soft_body.hinge[:, [0, 3]]])
        root = roots(n, ends[:, 0].copy(), ends[:, 1].copy())
        pieces = [np.flatnonzero(root == k) for k in np.unique(root)]
        self._free = free
        return [piece for piece in pieces if free[piece].all()]

    def _prepare_contact(self, world: World, owner: np.ndarray) -> None:
        edges = self.soft_body.lengths(self.position) if len(self.soft_body.spring) else np.ones(1)
        skip = np.zeros((len(owner), world.num_bodies), bool)
        for vertices, bodies, _ in (self._held, self._joined):
            skip[vertices[bodies >= 0], bodies[bodies >= 0]] = True
        skip[np.ix_(~self._free, ~world.dynamic)] = True
        pairs = [[combine(soft_body.material, body.material)[1:3] for body in world.scene.bodies] for soft_body in self.bodies]
        self._friction = np.array(pairs, float).reshape(len(self.bodies), world.num_bodies, 2)[owner]
        self._edge = float(edges.mean())
        gap = GAP * self._edge
        self._surfaces = make_surfaces(
            BodyShapes(world.geometry, world.shape_of_body, world.bound_radius), world.ball, self.position, self.soft_body.face, skip,
            self._edge, gap,
        )

    @property
    def weight(self) -> np.ndarray:
        """Weight (v, 3) N of every vertex."""
        return self.soft_body.mass[:, None] * self._gravity

    def energy(self) -> float:
        """Kinetic and elastic energy in J."""
        return 0.5 * float(dot(self.soft_body.mass, dot(self.velocity, self.velocity))) + self.soft_body.energy(self.position)

    def vertices(self, name: str) -> np.ndarray:
        """Vertices (v, 3) m of a flexible body now."""
        k = [body.name for body in self.bodies].index(name)
        return self.position[self.first[k] : self.first[k + 1]]

    def step_limit(self, rigid: RigidMotion, within: float) -> float:
        """Longest step (s) in which what may touch moves by no more than an edge of the soft bodies relative to them.

        Longer steps let nothing pass either, but after a harder blow it does not follow well: its faces turn far within
        the step, and friction on them is that of the place where they were.

        Args:
            rigid: the bodies now. within: s, only bodies that may reach a soft body by then count.

        """
        low, high = self.position.min(axis=0), self.position.max(axis=0)
        limit = np.inf
        for b, radius in enumerate(self._surfaces.radius):
            spin = float(length(rigid.angular_velocity[b])) * radius if np.isfinite(radius) else 0.0
            speeds = np.linalg.norm(self.velocity - rigid.velocity[b], axis=1) + spin
            speed = float(speeds.max(initial=0.0))
            apart = np.maximum(0.0, np.maximum(low - rigid.position[b], rigid.position[b] - high))
            # Bodies that are too far away to come near `within` s set no limit.
            if speed > 0.0 and float(length(apart)) - radius <= within * speed:
                limit = min(limit, self._edge / speed)
        return limit

    def step(self, time: float, h: float, rigid: RigidMotion) -> FlexibleStep:
        """Step all soft bodies from `time` to time + h s, together with the rigid bodies that they touch.

        Args:
            time: s; nothing depends on it.
            h: s. rigid: the rigid bodies over the step, as they would move without the soft bodies.

        """
        del time
        start = self.position
        flight = start + h * self.velocity + h * h * self._gravity
        # The part of the impulse that bears the steady load moves a body by half of h J / m: see the head of the file.
        rigid = rigid._replace(end_position=rigid.end_position - 0.5 * h * h * rigid.inv_mass[:, None] * self._load)
        target = start.copy()
        self._place_held(rigid, target)
        way = np.where(self._free[:, None], flight, target)
        touches = self._surfaces.find(start, way, rigid, self._sides, self._surfaces.gap, rigid.end_rotation, False)
        correction = self._move_out(touches, rigid, start)
        # Steps in which anything is touched are Euler's: see `scheme`.
        midpoint = self.scheme == "midpoint" and len(touches.key) == 0 and len(self._joined[0]) == 0
        rounds, unresolved = 0, 0
        while True:
            solved = self._solve(touches, rigid, h, flight + correction, target, start + correction, midpoint)
            solution, n = solved.solution, len(start)
            end = solution.z[:n] if not midpoint else 2.0 * solution.z[:n] - start
            # Contacts on the way solved for may be new; then the step is solved again with them.
            new = self._missing(touches, end, start + correction, rigid, self._moved(rigid, solution, solved.slots))
            rounds += 1
            unresolved = len(new.key)
            if unresolved == 0 or rounds == ROUNDS:
                break
            touches, midpoint = joined([touches, new]), False
        done = self._finish(start + correction, end, solved, rigid, touches, unresolved, h)
        if done is None:  # the midpoint rule would make energy here
            solved = self._solve(touches, rigid, h, flight, target, start, False)
            end = solved.solution.z[: len(start)]
            done = self._finish(start, end, solved, rigid, touches, unresolved, h)
            assert done is not None
        return done

    def _place_held(self, rigid: RigidMotion, target: np.ndarray) -> None:
        """Write where held vertices are at the end of the step."""
        vertices, bodies, places = self._held
        target[vertices] = places
        on = bodies >= 0
        b = bodies[on]
        target[vertices[on]] = rigid.end_position[b] + np.einsum("kij,kj->ki", rigid.end_rotation[b], places[on])

    def _move_out(self, touches: FoundContacts, rigid: RigidMotion, start: np.ndarray) -> np.ndarray:
        """Ways (v, 3) m by which vertices that have less than their gap are moved, position only; their targets follow."""
        correction = np.zeros_like(start)
        lacks = (touches.key < self._surfaces.skip.size) & (touches.time == 0.0) & (touches.distance < 0.999 * self._surfaces.gap)
        lacks &= self._free[touches.node[:, 0]]
        for c in np.flatnonzero(lacks):
            way = CORRECTION * (self._surfaces.gap - touches.distance[c])
            correction[touches.node[c, 0]] += way * dot(rigid.rotation[touches.body[c]], touches.normal[c])
            touches.target[c] = min(self._surfaces.gap, touches.distance[c] + way)
        return correction

    def _solve(
        self, touches: FoundContacts, rigid: RigidMotion, h: float, flight: np.ndarray, target: np.ndarray, start: np.ndarray,
        midpoint: bool,
    ) -> Solved:
        """Solve the step for a set of contacts."""
        span = 0.5 * h if midpoint else h
        goal = start + span * self.velocity + span * span * self._gravity if midpoint else flight
        unknown = np.full(len(rigid.inv_mass), -1)
        touched = np.unique(np.concatenate([touches.body, self._joined[1]]))
        slots = touched[rigid.movable[touched]]
        unknown[slots] = np.arange(len(slots))
        slow = SLIPS * h * float(np.linalg.norm(self._gravity, axis=1).max(initial=0.0))
        contacts = make_contacts(touches, start, self.velocity, rigid, unknown, self._friction, slow)
        contacts = _with_fastened(contacts, *self._joined, rigid, unknown)
        self._recall(contacts)
        M = np.zeros((len(slots), 6, 6))
        M[:, :3, :3] = np.eye(3) / rigid.inv_mass[slots, None, None]
        M[:, 3:, 3:] = np.linalg.inv(rigid.inv_inertia[slots])
        held = np.flatnonzero(~self._free)
        z = np.concatenate([start, np.zeros((2 * len(slots), 3))])
        z[held] = 0.5 * (start[held] + target[held]) if midpoint else target[held]
        mass = self.soft_body.mass
        speeds = np.einsum("ij,ij->i", self.velocity, self.velocity) + np.einsum("ij,ij->i", goal - start, goal - start) / span**2
        speeds[held] = np.einsum("ij,ij->i", z[held] - start[held], z[held] - start[held]) / span**2
        speed = float(np.sqrt(dot(mass, speeds) / mass.sum()))
        problem = Problem(self.soft_body.damped(start, span), span, goal, self._free, M / span**2, speed)
        set_penalties(problem, contacts, z[: len(start)])
        # The better of two starts: where vertices are, and where their velocities take them.
        onward = z.copy()
        onward[: len(start)][self._free] += span * self.velocity[self._free]
        if value_of(problem, contacts, onward) < value_of(problem, contacts, z):
            z = onward
        solution = minimise(problem, contacts, z, self.tolerance)
        if not solution.converged and np.any(contacts.friction):  # jammed: without friction the problem of a round is the whole one
            contacts.friction[:], contacts.radius[:] = 0.0, 0.0
            contacts.force[~contacts.fastened] = 0.0
            set_penalties(problem, contacts, z[: len(start)])
            solution = minimise(problem, contacts, z, self.tolerance)._replace(converged=False)
        self._force_of = dict(zip(contacts.key.tolist(), solution.force, strict=True))
        return Solved(solution, contacts, problem, slots, midpoint)

    def _recall(self, contacts: SoftContacts) -> None:
        """Start from the forces of the last step."""
        for c, key in enumerate(contacts.key.tolist()):
            known = self._force_of.get(key)
            if known is not None:
                contacts.force[c] = known
                contacts.radius[c] = contacts.friction[c] * max(0.0, float(dot(known, contacts.normal[c])))

    def _moved(self, rigid: RigidMotion, solution: Solution, slots: np.ndarray) -> RigidMotion:
        """The rigid bodies with what the soft bodies add to their way."""
        position, rotation = rigid.end_position.copy(), rigid.end_rotation.copy()
        for b, (way, turn) in zip(slots, solution.z[len(self.position) :].reshape(-1, 2, 3), strict=True):
            position[b] += way
            rotation[b] = matmul(to_matrix(quaternion_from_rotation_vector(turn)), rotation[b])
        return rigid._replace(end_position=position, end_rotation=rotation)

    def _missing(self, known: FoundContacts, end: np.ndarray, start: np.ndarray, rigid: RigidMotion, moved: RigidMotion) -> FoundContacts:
        """Contacts on the way solved for, on which bodies are `moved`, that no plane covers yet; of a sample point the earliest ones.

        They are looked for at half the gap. Planes let nothing come that near, except what was nearer from the start.
        """
        found = self._surfaces.find(start, end, moved, self._sides, 0.5 * self._surfaces.gap, rigid.end_rotation, True)
        covered: dict[tuple[int, ...], list[np.ndarray]] = {}
        for key, nodes, normal in zip(known.key.tolist(), known.node.tolist(), known.normal, strict=True):
            covered.setdefault((key, *nodes), []).append(normal)
        fresh, first = [], {}
        keys, nodes_of = found.key.tolist(), found.node.tolist()
        for c in np.argsort(found.time, kind="stable").tolist():
            if all(float(dot(found.normal[c], normal)) < ALIKE for normal in covered.get((keys[c], *nodes_of[c]), [])):
                if found.time[c] <= first.setdefault(keys[c], float(found.time[c])) + AT_ONCE:
                    fresh.append(c)
        return FoundContacts(*(column[np.array(sorted(fresh), np.int64)] for column in found))

    def _finish(
        self, start: np.ndarray, end: np.ndarray, solved: Solved, rigid: RigidMotion, touches: FoundContacts, unresolved: int, h: float
    ) -> FlexibleStep | None:
        """Take over the new state; see `balance` for what is set right. None if the midpoint rule shall not be taken."""
        solution, contacts, problem, _, midpoint = solved
        n, soft_body, free = len(start), self.soft_body, self._free
        before, x0 = self.velocity.copy(), self.position
        way = end - start
        # The midpoint rule knows the mean of both velocities.
        velocity = 2.0 * way / h - before if midpoint else way / h
        velocity[~free] = way[~free] / h
        impulse = h * solution.force
        self._keep_momenta(start, end, velocity, before, solved, rigid, h)
        elastic = problem.soft_body.gradient(solution.z[:n])
        acting = np.zeros_like(elastic)
        np.add.at(acting, contacts.node.ravel(), (contacts.weight[:, :, None] * solution.force[:, None, :]).reshape(-1, 3))
        acting += soft_body.mass[:, None] * self._gravity
        # The force that keeps held vertices where they are; its work counts, too.
        hold = np.where(free[:, None], 0.0, soft_body.mass[:, None] * (velocity - before) / h + elastic - acting)
        work = float(np.sum((acting + hold) * way))
        kinetic = 0.5 * float(dot(soft_body.mass, dot(velocity, velocity) - dot(before, before)))
        excess = kinetic + soft_body.energy(end) - soft_body.energy(x0) - work
        # At rest all of these are round-off; what gravity would give in a step is what the solver's errors are of.
        falling = 0.5 * h * h * float(dot(soft_body.mass[free], dot(self._gravity[free], self._gravity[free])))
        through = float(np.sum(np.abs((acting + hold) * way)))
        turned = max(0.5 * float(dot(soft_body.mass, dot(before, before))) + soft_body.energy(x0), through, falling)
        if np.any(start != x0):  # the energy of the position correction is no motion's to give
            excess -= soft_body.energy(start) - soft_body.energy(x0)
        if midpoint and excess > MIDPOINT_EXCESS * float(dot(soft_body.mass, dot(velocity, velocity))):
            return None
        taken, made = 0.0, 0.0
        if excess > 0.0:
            made = take_energy(soft_body.mass, end, velocity, self._pieces or [np.flatnonzero(free)], excess)
            if midpoint and made > MIDPOINT_MADE * float(dot(soft_body.mass, dot(velocity, velocity))):
                return None
            taken = excess - made
        self.energy_taken += taken
        self.position, self.velocity = end, velocity
        self._sides = sides_of(touches, end, rigid.end_rotation, self._surfaces.skip.size)
        given = self._given(contacts, impulse, rigid, hold * h, end)
        load = np.concatenate([self._load, np.zeros_like(self._load)], axis=1)
        # F(s) = 4 J / h - 3 L + (6 L - 6 J / h) s / h: see the head of the file.
        ramp = np.stack([4.0 * given / h - 3.0 * load, 6.0 * load / h - 6.0 * given / h**2])
        self._bear(given[:, :3] / h, rigid, h)
        return FlexibleStep(given, ramp, taken, made, turned, len(contacts.key), solution.converged, unresolved)

    def _keep_momenta(
        self, start: np.ndarray, end: np.ndarray, velocity: np.ndarray, before: np.ndarray, solved: Solved, rigid: RigidMotion, h: float
    ) -> None:
        """Set momentum, angular momentum and the way of the centre of free pieces to what acted on them."""
        if not self._pieces:
            return
        mass, contacts, impulse, midpoint = self.soft_body.mass, solved.contacts, h * solved.solution.force, solved.midpoint
        place = np.einsum("mk,mkj->mj", contacts.weight, start[contacts.node])
        on = contacts.unknown >= 0
        shift = 0.5 * h * h * rigid.inv_mass[:, None] * self._load
        lever = lever_place(rigid.position, rigid.velocity, rigid.end_position + shift, h) - shift
        place[on] = lever[contacts.body[on]] + contacts.arm[on]
        for piece in self._pieces:
            m, x0 = mass[piece], start[piece]
            origin = dot(x0.T, m) / m.sum()
            mine = np.isin(contacts.node[:, 0], piece)
            fall = h * (m[:, None] * self._gravity[piece]).sum(0)
            momentum = dot(before[piece].T, m) + fall + impulse[mine].sum(0)
            angular = (m[:, None] * cross_arrays(self.position[piece] - origin, before[piece])).sum(0)
            angular += cross_arrays(place[mine] - origin, impulse[mine]).sum(0)
            if midpoint:  # its centre follows the parabola: gravity acts at the mean of its places, not at the first
                angular += 0.5 * h * cross_arrays(dot(before[piece].T, m), fall) / m.sum()
            went = 0.5 * h * (momentum + dot(before[piece].T, m)) if midpoint else h * momentum
            end[piece] += origin + went / m.sum() - dot(end[piece].T, m) / m.sum()
            v = velocity[piece]
            set_momenta(m, end[piece] - origin, v, momentum, angular)
            velocity[piece] = v

    def _bear(self, force: np.ndarray, rigid: RigidMotion, h: float) -> None:
        """Keep what the soft bodies bear of each body, (n, 3) N: their force, as far as it is no more than what the body flies with."""
        end = rigid.end_position + 0.5 * h * h * rigid.inv_mass[:, None] * self._load
        weight = 2.0 / h**2 * (end - rigid.position - h * rigid.velocity)
        size = np.linalg.norm(weight, axis=1) / np.where(rigid.movable, rigid.inv_mass, np.inf)
        strength = np.linalg.norm(force, axis=1)
        self._load = force * np.divide(np.minimum(size, strength), strength, out=np.zeros_like(size), where=strength > 0.0)[:, None]

    def _given(
        self, contacts: SoftContacts, impulse: np.ndarray, rigid: RigidMotion, hold: np.ndarray, end: np.ndarray
    ) -> np.ndarray:
        """Impulses (n, 6) that the soft bodies gave the bodies."""
        given = np.zeros((len(rigid.inv_mass), 6))
        np.subtract.at(given, contacts.body, np.concatenate([impulse, cross_arrays(contacts.arm, impulse)], axis=1))
        vertices, bodies, _ = self._held
        on = bodies >= 0
        arm = end[vertices[on]] - rigid.end_position[bodies[on]]
        np.subtract.at(given, bodies[on], np.concatenate([hold[vertices[on]], cross_arrays(arm, hold[vertices[on]])], axis=1))
        return given


def _with_fastened(
    contacts: SoftContacts, vertices: np.ndarray, bodies: np.ndarray, places: np.ndarray, rigid: RigidMotion, unknown: np.ndarray
) -> SoftContacts:
    """Add the vertices that are fastened to dynamic bodies."""
    k = len(vertices)
    if k == 0:
        return contacts
    arm = np.einsum("kij,kj->ki", rigid.end_rotation[bodies], places)
    weight, flat = np.zeros((k, 3)), np.zeros((k, 3))
    weight[:, 0] = 1.0
    added = SoftContacts(
        np.tile(vertices[:, None], 3), weight, bodies, unknown[bodies], arm, flat, rigid.end_position[bodies] + arm, np.zeros(k),
        np.ones(k), flat.copy(), np.zeros(k), np.ones(k, bool), -1 - vertices,
    )  # fmt: skip
    return SoftContacts(*(np.concatenate(column) for column in zip(contacts, added, strict=True)))
