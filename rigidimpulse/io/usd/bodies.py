"""Bodies of UsdPhysics: rigid bodies with the colliders below them, and colliders of no body, which are static.

    position, orientation    of the prim, its scale goes to its colliders
    velocity                 in the space that the prim's own transform is in: that of its parent
    mass                     that of the body, else of its colliders, else from densities: of the collider, of the body, of the
                             material, else 1,000 kg/m^3
    centre of mass, inertia  those of the body, else the sum over its colliders: what each says itself, else of its shape
    not enabled              static; kinematic along its time samples if it has any
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import from_matrix
from rigidimpulse.engine.triggers import Trigger
from rigidimpulse.io.inertia import with_possible_inertia
from rigidimpulse.io.looks import visual_of
from rigidimpulse.io.pieces import DENSITY, GHOST, Piece, Weight, fill_mass, joined, moved_unit, summed, weight_of
from rigidimpulse.io.usd.frames import Frames
from rigidimpulse.io.usd.library import Prim, SdfPath, UsdGeom, UsdPhysics
from rigidimpulse.io.usd.looks import looks_of
from rigidimpulse.io.usd.materials import (
    Filters,
    Units,
    bound_materials,
    combined_otherwise,
    given_mass,
    positive,
    read_material,
    weight_given,
)
from rigidimpulse.io.usd.shapes import Shapes, placed_in
from rigidimpulse.scene.body import Body
from rigidimpulse.scene.keyframes import Keyframes
from rigidimpulse.scene.material import Material

BETWEEN = 1.0 / 60.0
"""s, longest time from key to key of keyframed bodies."""
TRIGGER = "PhysxTriggerAPI"


class BodyReader:
    """Makes bodies of what the parser of UsdPhysics found.

    Attributes:
        name_of: body of each prim that is one, by path. bodies: by name. triggers: what was made of them.
        colliders: path and description of each, in the order of the file.
        notes: lines of the report.

    """

    def __init__(self, frames: Frames, parsed: dict[str, list[tuple[SdfPath, Any]]], hulls: frozenset[SdfPath] = frozenset()) -> None:
        """parsed: descriptions by kind. hulls: meshes that collide as their convex hull, whatever they say."""
        self.frames, self.stage, self.notes = frames, frames.stage, []
        self.units = Units(self.stage, frames.meters_per_unit)
        self.shapes = Shapes(frames.start, hulls)
        self._drawn = Shapes(frames.start, as_drawn=True)
        self.bodies: dict[str, Body] = {}
        self.name_of: dict[SdfPath, str] = {}
        self.triggers: list[Trigger] = []
        self._materials: dict[SdfPath, tuple[Material, float]] = {}
        self._bound: dict[SdfPath, SdfPath] = {}
        self._rigid = dict(parsed.get("RigidBody", []))
        self.colliders = [entry for kind, entries in parsed.items() if kind.endswith("Shape") for entry in entries]
        # In the order of the file, whatever their kind.
        place = {prim.GetPath(): k for k, prim in enumerate(frames.prims())}
        self.colliders.sort(key=lambda entry: place.get(entry[0], 0))
        self._bound = bound_materials([self.stage.GetPrimAtPath(path) for path, _ in self.colliders])
        self._names = _Names()
        self._make(place)

    def _make(self, place: dict[SdfPath, int]) -> None:
        """Make all bodies and triggers."""
        owned: dict[SdfPath, list[tuple[SdfPath, Any]]] = {path: [] for path in self._rigid}
        apart: dict[SdfPath, list[SdfPath]] = {}
        groups: dict[SdfPath, list[SdfPath]] = {}
        later = []
        for path, desc in self.colliders:
            prim = self.stage.GetPrimAtPath(path)
            if TRIGGER in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
                later.append((path, desc))
                continue
            if not desc.collisionEnabled:
                self.notes.append(f"collider {path} is not enabled: left out")
                continue
            owner = desc.rigidBody if desc.rigidBody in self._rigid else path
            owned.setdefault(owner, []).append((path, desc))
            groups.setdefault(owner, []).extend(desc.collisionGroups)
            apart.setdefault(owner, []).extend(desc.filteredCollisions)
        for path in sorted(owned, key=lambda path: place.get(path, 0)):
            self.name_of[path] = self._names.of(self.stage.GetPrimAtPath(path))
            apart.setdefault(path, []).extend(self._rigid[path].filteredCollisions if path in self._rigid else [])
        filters = Filters(self.stage).of(
            {name: groups.get(path, []) for path, name in self.name_of.items()},
            {self.name_of[path]: set().union(*map(self._below, others)) for path, others in apart.items() if others},
        )
        for path, name in self.name_of.items():
            try:
                self.bodies[name] = self._body(path, name, owned[path], filters[name])
            except SceneError as error:
                raise error if "prim " in error.where else error.within(f"prim {path}") from None
        for path, desc in later:
            self._add_trigger(path, desc)
        self.notes += combined_otherwise({path: material for path, (material, _) in self._materials.items()})

    def _below(self, path: SdfPath) -> set[str]:
        """Names of the bodies that a path is, or that are below it, or above it."""
        inside = {name for body, name in self.name_of.items() if body.HasPrefix(path)}
        return inside or {name for body, name in self.name_of.items() if path.HasPrefix(body)}

    def _body(self, path: SdfPath, name: str, owned: list[tuple[SdfPath, Any]], filter_: Any) -> Body:
        """Return the body of a prim."""
        prim, desc = self.stage.GetPrimAtPath(path), self._rigid.get(path)
        pieces, given = self._pieces(prim, owned)
        if not pieces:
            self.notes.append(f"body {name!r} has no collider that is read: it touches nothing")
            pieces, given, filter_ = [GHOST], [_Given({}, DENSITY, np.zeros(3), np.eye(3))], GHOST.collision_filter
        if any(piece.material != pieces[0].material for piece in pieces):
            self.notes.append(f"body {name!r} has colliders of several materials: that of the first counts")
        position, rotation = self.frames.rigid(prim)
        values: dict[str, Any] = {"position": position, "orientation": from_matrix(rotation), "motion": "static"}
        enabled = desc is not None and desc.rigidBodyEnabled
        if desc is not None and not enabled:
            self.notes.append(f"body {name!r} is not enabled: it is static")
        if self.frames.moves(prim) and (desc is None or not enabled or desc.kinematicBody):
            times, places, turns = self.frames.keys(prim, BETWEEN)
            values |= {"motion": "kinematic", "position": places[0], "orientation": turns[0]}
            values["keyframes"] = Keyframes(times, places, turns)
        elif desc is not None and enabled:
            values |= {"motion": "kinematic" if desc.kinematicBody else "dynamic", **self._velocities(prim)}
            if not desc.kinematicBody:
                values |= self._weight(prim, name, pieces, given)
                if self.frames.moves(prim):
                    self.notes.append(f"body {name!r} is animated and moved by physics: its animation is not read")
            if desc.startsAsleep:
                self.notes.append(f"body {name!r} starts asleep: it falls as any other")
        material = pieces[0].material
        if values.get("density") is not None:
            material = replace(material, density=values.pop("density"))
        visual = visual_of(looks_of(prim, set(self.name_of), self.frames, self._drawn), pieces)
        body = Body(name, joined(pieces), material=material, collision_filter=filter_, visual=visual, **values)
        return with_possible_inertia(body, self.notes)

    def _pieces(self, prim: Prim, owned: list[tuple[SdfPath, Any]]) -> tuple[list[Piece], list[_Given]]:
        """Return colliders in the rigid frame of a body's prim, and what the file says of the mass of each."""
        pieces: list[Piece] = []
        masses: list[_Given] = []
        own = given_mass(prim, self.units, np.eye(3), self.notes).get("density")
        origin, frame = self.frames.rigid(prim)
        for path, desc in owned:
            collider = self.stage.GetPrimAtPath(path)
            placed = self._placed(collider, prim)
            if placed is None:
                continue
            if any(self.frames.is_animated(above) for above in _between(collider, prim)):
                self.notes.append(f"collider {path} is animated against its body: it stays as it is at rest")
            material, density = self._material(path, desc.materials)
            given = given_mass(collider, self.units, self.frames.stretch(collider), self.notes) if collider != prim else {}
            place, turn = self.frames.rigid(collider)
            pieces.append(Piece(*placed, material, None))
            masses.append(_Given(given, given.get("density") or own or density or DENSITY, frame.T @ (place - origin), frame.T @ turn))
        return pieces, masses

    def _placed(self, collider: Prim, prim: Prim) -> tuple[Any, np.ndarray, np.ndarray] | None:
        """Return shape, position and orientation of a collider in the rigid frame of a prim."""
        made = self.shapes.of(collider, self.frames.stretch(collider) * self.units.length)
        if made is None:
            return None
        return placed_in(made, self.frames.rigid(collider), self.frames.rigid(prim))

    def _material(self, collider: SdfPath, parsed: Any) -> tuple[Material, float]:
        """Return the material of a collider, and its density in kg/m^3, 0 if it says none; parsed: those that the parser found."""
        path = self._bound.get(collider) or next((path for path in parsed if path), None)
        if path is None:
            return Material(), 0.0
        if path not in self._materials:
            prim = self.stage.GetPrimAtPath(path)
            density = self.units.density(positive(UsdPhysics.MaterialAPI(prim).GetDensityAttr()))
            self._materials[path] = read_material(prim, self.notes), density
        return self._materials[path]

    def _velocities(self, prim: Prim) -> dict[str, np.ndarray]:
        """Return both velocities of a body in the world."""
        api = UsdPhysics.RigidBodyAPI(prim)
        velocity, spin = (np.array(a.Get() or (0, 0, 0), float) for a in (api.GetVelocityAttr(), api.GetAngularVelocityAttr()))
        parent = self.frames.matrix(prim.GetParent())[:3, :3]
        if UsdGeom.Xformable(prim).GetResetXformStack():
            parent = np.eye(3)
        _, frame = self.frames.rigid(prim.GetParent())
        if np.array_equal(parent, np.eye(3)):
            frame = parent
        return {"velocity": parent @ velocity * self.units.length, "angular_velocity": frame @ np.radians(spin)}

    def _weight(self, prim: Prim, name: str, pieces: list[Piece], given: list[_Given]) -> dict[str, Any]:
        """Return mass properties of a dynamic body: those that the shape and one density do not say already."""
        values = given_mass(prim, self.units, self.frames.stretch(prim), self.notes)
        values.pop("density", None)
        if len({entry.density for entry in given}) == 1 and not any(entry.values.keys() - {"density"} for entry in given):
            values["density"] = given[0].density
            fill_mass(name, joined(pieces), values, self.notes, given[0].density)
            return values
        found = summed([entry.weight(piece) for entry, piece in zip(given, pieces, strict=True)])
        mass = values.setdefault("mass", found.mass)
        way = values.setdefault("center_of_mass", found.center_of_mass) - found.center_of_mass
        values.setdefault("inertia", mass / found.mass * found.inertia + mass * moved_unit(way))
        return values

    def _add_trigger(self, path: SdfPath, desc: Any) -> None:
        """Make a trigger of a collider that reports overlap only."""
        collider = self.stage.GetPrimAtPath(path)
        body = self.name_of.get(desc.rigidBody)
        frame = self.stage.GetPrimAtPath(desc.rigidBody) if body is not None else self.stage.GetPseudoRoot()
        placed = self._placed(collider, frame)
        if placed is not None:
            shape, position, orientation = placed
            name = self._names.of(collider)
            self.triggers.append(Trigger(name, shape, body=body, position=position, orientation=orientation))

    def owner(self, prim: Prim) -> str | None:
        """Return the name of the body that a prim is, or is below; None for none."""
        while prim and not prim.IsPseudoRoot():
            if prim.GetPath() in self.name_of:
                return self.name_of[prim.GetPath()]
            prim = prim.GetParent()
        return None


class _Given(NamedTuple):
    """What the file says of the mass of a collider: values of its MassAPI, density kg/m^3, its own frame in that of its body."""

    values: dict[str, Any]
    density: float
    position: np.ndarray
    rotation: np.ndarray

    def weight(self, piece: Piece) -> Weight:
        """Mass properties of the collider."""
        return weight_given(weight_of(piece, self.values.get("mass"), self.density), self.values, self.position, self.rotation)


class _Names:
    """Names of prims, unlike one another: the path of a prim whose name is taken."""

    def __init__(self) -> None:
        self._used: set[str] = set()

    def of(self, prim: Prim) -> str:
        name = prim.GetName() if prim.GetName() not in self._used else str(prim.GetPath())
        self._used.add(name)
        return name


def _between(collider: Prim, body: Prim) -> list[Prim]:
    """Return a collider and what is above it, up to its body."""
    chain = []
    while collider and collider != body and not collider.IsPseudoRoot():
        chain.append(collider)
        collider = collider.GetParent()
    return chain
