"""A scene from a glTF file: bodies from nodes with motion, the colliders below them and triggers, joints, animated nodes.

    motion                a body; the colliders of its descendants, up to the next motion, are its shape
    collider, no motion   a static body; keyframed if its node, or one above it, is animated
    trigger               a `Trigger`, which moves with the body above it
    mass 0                infinite: with no finite inertia the body keeps its velocities (kinematic), else a joint holds its
                          centre of mass; an inertia of 0 is infinite about that axis: a joint locks the turn

Colliders of one body with filters that differ are bodies of their own, welded by joints.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.engine.triggers import Trigger
from rigidimpulse.io.gltf import schema
from rigidimpulse.io.gltf.animation import Animations
from rigidimpulse.io.gltf.bodies import BodyMaker, Piece
from rigidimpulse.io.gltf.container import read_file
from rigidimpulse.io.gltf.geometry import Meshes
from rigidimpulse.io.gltf.implicit import Shapes, placed_in_body
from rigidimpulse.io.gltf.instancing import with_instances
from rigidimpulse.io.gltf.joints import read_joints
from rigidimpulse.io.gltf.nodes import Hierarchy
from rigidimpulse.io.gltf.origin import Origin
from rigidimpulse.io.gltf.own_materials import NOTE, STATIC, own_figures
from rigidimpulse.io.gltf.plain import bones_move, plain_pieces
from rigidimpulse.io.scene_file import GLTF_GRAVITY
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.material import Material
from rigidimpulse.scene.scene import Scene
from rigidimpulse.scene.shape import Shape

KNOWN = {schema.RIGID_BODIES, schema.IMPLICIT_SHAPES, schema.INSTANCING} | {
    "KHR_mesh_quantization",
    "KHR_lights_punctual",
    "KHR_texture_transform",
}
"""Extensions that are read, or that have no say in how bodies move; materials and textures are among those, too."""
LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "EXT_lights_")

MOST_NAMES = 8
"""Names of nodes at most in a line of the report."""


def load_gltf(path: Path, gravity: ArrayLike | None, allow_outside: bool) -> Scene:
    """Read a .glb or .gltf file; see `rigidimpulse.load_scene`."""
    # Numbers are bounded, so what overflows here is no number that a message could miss.
    with np.errstate(all="ignore"):
        try:
            return _Loader(Hierarchy(with_instances(read_file(path, allow_outside)))).scene(gravity)
        except SceneError as error:
            raise error if path.name in str(error) else error.within(repr(path.name)) from None
        except (MemoryError, RecursionError) as error:
            raise SceneError(f"it asks for too much ({type(error).__name__})", "export it again", repr(path.name)) from None


class _Loader:
    """One file on its way to a scene."""

    def __init__(self, hierarchy: Hierarchy) -> None:
        self.hierarchy, self.file = hierarchy, hierarchy.file
        self.physics = self.file.document.extensions.physics
        self.animations = Animations(hierarchy)
        self.meshes = Meshes(hierarchy)
        self.shapes = Shapes(self.file, self.meshes)
        self.notes: list[str] = []
        self.materials = [self._material(entry, k) for k, entry in enumerate(self.physics.physics_materials)]
        self.filters = [
            CollisionFilter(entry.collision_systems, entry.collide_with_systems, entry.not_collide_with_systems or ())
            for entry in self.physics.collision_filters
        ]
        self.owner = self._owners()

    def scene(self, gravity: ArrayLike | None) -> Scene:
        """Make the scene."""
        scene = Scene(self._gravity() if gravity is None else gravity)
        has_physics = any(self.hierarchy.nodes[node].extensions.physics is not None for node in self.hierarchy.order)
        maker = BodyMaker(self.hierarchy, self.animations, self.notes)
        if has_physics:
            for node, pieces in self._pieces().items():
                maker.add(node, self.hierarchy.nodes[node].physics.motion, pieces)
        else:
            self.notes.append("the file has no physics: every node with a mesh is a body")
            for node, motion, pieces in plain_pieces(self.hierarchy, self.meshes, self.animations, self.notes):
                self.owner[node] = node
                maker.add(node, motion, pieces)
        self.carrier = self._carriers()
        for thing in (*maker.bodies, *maker.joints):
            scene.add(thing)
        bodies = {body.name: body for body in maker.bodies}
        joints, lines = read_joints(self.hierarchy, lambda node: maker.name_of.get(self.carrier[node]), bodies)
        for thing in (*joints, *self._triggers(maker.name_of)):
            scene.add(thing)
        self._report_rest(has_physics)
        notes = [*self._unknown(), *self.file.notes, *self.animations.notes, *self.meshes.notes, *self.shapes.notes, *self.notes, *lines]
        report = tuple(dict.fromkeys(notes))
        node_of = {name: node for node, name in maker.name_of.items()}
        scene.origin = Origin(report, self.animations, node_of, frozenset(maker.parts))
        return scene

    def _report_rest(self, has_physics: bool) -> None:
        """Report the nodes that are neither in the scene nor drawn with a body, and colliders whose surface moves in itself."""
        nodes, names = self.hierarchy.nodes, self.hierarchy.names
        shapes = [part.geometry for node in nodes for part in (node.physics.collider, node.physics.trigger) if part is not None]
        lent = {geometry.node for geometry in shapes if geometry is not None}
        told = lent.union(self.hierarchy.order)
        lost = [names[k] for k, node in enumerate(nodes) if k not in told and (node.mesh is not None or node.extensions.physics)]
        if lost:
            self.notes.append(f"not in the scene that the file shows: {_listed(lost)} are left out")
        if not has_physics:
            return
        free = [k for k in self.hierarchy.order if nodes[k].mesh is not None and self.carrier[k] < 0]
        drawn = [names[k] for k in free if nodes[k].physics.trigger is None]
        if drawn:
            self.notes.append(f"{_listed(drawn)}: a mesh and no collider: drawn where the file has it, and collides with nothing")
        for node in self.hierarchy.order:
            collider = nodes[node].physics.collider
            source = None if collider is None else collider.geometry.node
            skin = None if source is None or source >= len(nodes) else nodes[source].skin
            if skin is not None and bones_move(self.hierarchy, self.animations, skin):
                what = "it collides as it is at rest, its animation is not collided with"
                self.notes.append(f"bones of collider {names[node]!r} move: {what}")

    def _gravity(self) -> ArrayLike:
        """What a file that we wrote says of gravity, else that of glTF."""
        document = self.file.document
        extras = document.scenes[document.scene or 0].extras if document.scenes else None
        said = extras.get(NOTE) if isinstance(extras, dict) else None
        given = said.get("gravity") if isinstance(said, dict) else None
        if not isinstance(given, list) or len(given) != 3:
            return GLTF_GRAVITY
        fine = all(isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= schema.LARGEST for x in given)
        return tuple(map(float, given)) if fine else GLTF_GRAVITY

    def _owners(self) -> list[int]:
        """Nearest node with motion, itself or above, of each node; -1 without."""
        owner = [-1] * len(self.hierarchy.nodes)
        for node in self.hierarchy.order:
            parent = self.hierarchy.parent[node]
            moves = self.hierarchy.nodes[node].physics.motion is not None or _is_group(self.hierarchy.nodes[node])
            owner[node] = node if moves else (owner[parent] if parent >= 0 else -1)
        return owner

    def _carriers(self) -> list[int]:
        """Node of the body that each node belongs to, itself or above; -1 for none."""
        carrier = list(self.owner)
        for node in self.hierarchy.down:
            if carrier[node] >= 0:
                continue
            if self.hierarchy.nodes[node].physics.collider is not None:
                carrier[node] = node
            elif self.hierarchy.parent[node] >= 0:
                carrier[node] = carrier[self.hierarchy.parent[node]]
        return carrier

    def _pieces(self) -> dict[int, list[Piece]]:
        """Colliders by the node of their body, which may have none."""
        pieces: dict[int, list[Piece]] = {}
        for node in self.hierarchy.order:
            entry = self.hierarchy.nodes[node].physics
            if self.owner[node] == node:
                pieces.setdefault(node, [])
            if entry.collider is None:
                continue
            body = self.owner[node] if self.owner[node] >= 0 else node
            material = filter_ = None
            if entry.collider.physics_material is not None:
                material = self.file.entry(self.materials, entry.collider.physics_material, "physics material")
            if entry.collider.collision_filter is not None:
                filter_ = self.file.entry(self.filters, entry.collider.collision_filter, "collision filter")
            shape = self._placed(entry.collider.geometry, node, body)
            pieces.setdefault(body, []).append(Piece(*shape, material or self._default_material, filter_))
            if self.animations.moves_against(node, body):
                self.notes.append(f"collider {self.hierarchy.names[node]!r} is animated against its body: it stays as it is at rest")
        return pieces

    _default_material = Material(restitution=0.0, static_friction=0.6, dynamic_friction=0.6)

    def _placed(self, geometry: schema.Geometry, node: int, body: int) -> tuple[Shape, np.ndarray, np.ndarray]:
        """Shape of a node in the rigid frame of a body's node."""
        position, rotation, scale = self.hierarchy.scale_seen_from(node, body)
        return placed_in_body(self.shapes.of(geometry, scale, f"node {self.hierarchy.names[node]!r}"), position, rotation)

    def _triggers(self, name_of: dict[int, str]) -> list[Trigger]:
        """Triggers; those that belong to a compound one are in it."""
        nodes = self.hierarchy.nodes
        inside = {k for node in self.hierarchy.order for k in ((nodes[node].physics.trigger or schema.Trigger()).nodes or ())}
        triggers = []
        for node in sorted(self.hierarchy.order):
            entry = nodes[node].physics.trigger
            if entry is None or node in inside:
                continue
            name = self.hierarchy.names[node]
            parts, first = [], entry
            for k in entry.nodes or [node]:
                part = self.file.entry(nodes, k, "node").physics.trigger
                if part is None or part.geometry is None:
                    self.notes.append(f"trigger {name!r}: node {k} has no geometry for it: left out")
                    continue
                first = part if first.geometry is None else first
                parts.append(self._placed(part.geometry, k, node))
            if not parts:
                self.notes.append(f"trigger {name!r} has no geometry: left out")
                continue
            filter_ = None if first.collision_filter is None else self.file.entry(self.filters, first.collision_filter, "collision filter")
            body = name_of.get(self.carrier[node])
            position, turn = self.hierarchy.position(node), self.hierarchy.turn[node]
            if body is not None:
                position, turn, _ = self.hierarchy.scale_seen_from(node, self.carrier[node])
            elif self.animations.moves(node):
                self.notes.append(f"trigger {name!r} is animated: it stays where it is at rest")
            triggers.append(Trigger(name, _one_shape(parts), body=body, position=position, orientation=turn, collision_filter=filter_))
        return triggers

    def _material(self, entry: schema.PhysicsMaterial, index: int) -> Material:
        static = entry.static_friction
        if entry.dynamic_friction > static:
            self.notes.append(f"physics material {index}: dynamic friction is above static friction, which is raised to it")
            static = entry.dynamic_friction
        if entry.restitution > 1.0:
            self.notes.append(f"physics material {index}: restitution {entry.restitution:g} feeds energy in")
        fields = {"restitution": entry.restitution, "static_friction": static, "dynamic_friction": entry.dynamic_friction}
        fields |= own_figures(entry.extras, entry.restitution, static, entry.dynamic_friction)
        combine = {"restitution_combine": entry.restitution_combine, "friction_combine": entry.friction_combine}
        return Material(**fields, **combine, any_restitution=entry.restitution > 1.0)  # pyright: ignore[reportArgumentType]

    def _unknown(self) -> list[str]:
        """Extensions that are not read, and what of the file another writer of ours could not say."""
        document = self.file.document
        used = [name for name in dict.fromkeys([*document.extensions_used, *document.extensions_required])]
        lines = [f"extension {name[:60]} is not read" for name in used if name not in KNOWN and not name.startswith(LOOKS)]
        asset = self.file.raw.get("asset")
        extras = asset.get("extras") if isinstance(asset, dict) else None
        said = extras.get(NOTE) if isinstance(extras, dict) else None
        left = said.get("notWritten") if isinstance(said, dict) else None
        return lines + [f"not in the file: {str(line)[:200]}" for line in (left if isinstance(left, list) else [])]


def _is_group(node: schema.Node) -> bool:
    """Whether a node without motion is a static body of the colliders below it, in a file that we wrote."""
    said = node.extras.get(NOTE) if isinstance(node.extras, dict) else None
    return isinstance(said, dict) and said.get(STATIC) is True


def _listed(names: list[str]) -> str:
    """The first of some names of nodes, and how many more there are."""
    more = len(names) - MOST_NAMES
    return "nodes " + ", ".join(map(repr, names[:MOST_NAMES])) + (f" and {more} more" if more > 0 else "")


def _one_shape(parts: list[tuple[Shape, np.ndarray, np.ndarray]]) -> Shape:
    """A shape that is one of its own, or a compound."""
    shape, position, orientation = parts[0]
    if len(parts) == 1 and not np.any(position) and np.array_equal(orientation, [1.0, 0.0, 0.0, 0.0]):
        return shape
    return Shape.compound(parts)
