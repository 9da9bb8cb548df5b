"""Physics materials, masses and collision groups of UsdPhysics, in SI units: L metres and W kilograms a unit of the file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.io.pieces import Weight, moved_unit
from rigidimpulse.io.usd.library import Prim, SdfPath, Stage, UsdPhysics, UsdShade
from rigidimpulse.scene.collision_filter import CollisionFilter
from rigidimpulse.scene.material import Material, combine

COMBINE = {"average": "average", "min": "minimum", "multiply": "multiply", "max": "maximum"}
"""Combine modes of PhysxMaterialAPI; of two that differ PhysX takes the later one, `Material` has a precedence of its own."""
COEFFICIENTS = ("restitution", "static friction", "dynamic friction")


class Units:
    """L and W of a stage."""

    def __init__(self, stage: Stage, meters_per_unit: float) -> None:
        """meters_per_unit: m."""
        self.length = meters_per_unit
        self.mass = float(UsdPhysics.GetStageKilogramsPerUnit(stage))

    def density(self, value: float) -> float:
        """Return a density of the file in kg/m^3."""
        return value * self.mass / self.length**3


def positive(attribute: Any) -> float:
    """Return the value of an attribute, 0 if it is not a number above 0: UsdPhysics means "not given" by that."""
    value = attribute.Get() if attribute else None
    return float(value) if value is not None and np.isfinite(value) and value > 0.0 else 0.0


def bound_materials(prims: list[Prim]) -> dict[SdfPath, SdfPath]:
    """Return the physics material of each prim that has one, by paths: bound to it or to a prim above, by itself or by a collection."""
    materials = UsdShade.MaterialBindingAPI.ComputeBoundMaterials(prims, "physics")[0]
    found = {prim.GetPath(): material.GetPrim() for prim, material in zip(prims, materials, strict=True) if material}
    return {path: material.GetPath() for path, material in found.items() if material.HasAPI(UsdPhysics.MaterialAPI)}


def read_material(prim: Prim, notes: list[str]) -> Material:
    """Return the contact coefficients of a material prim; its density is asked for by itself."""
    api = UsdPhysics.MaterialAPI(prim)
    static, dynamic, restitution = (
        positive(a) for a in (api.GetStaticFrictionAttr(), api.GetDynamicFrictionAttr(), api.GetRestitutionAttr())
    )
    if dynamic > static:
        notes.append(f"material {prim.GetPath()}: dynamic friction is above static friction, which is raised to it")
        static = dynamic
    modes = {}
    for name in ("friction", "restitution"):
        attribute = prim.GetAttribute(f"physxMaterial:{name}CombineMode")
        mode = attribute.Get() if attribute else None
        if mode in COMBINE:
            modes[f"{name}_combine"] = COMBINE[mode]
    if restitution > 1.0:
        notes.append(f"material {prim.GetPath()}: restitution {restitution:g} feeds energy in")
    return Material(
        restitution=restitution, static_friction=static, dynamic_friction=dynamic, any_restitution=restitution > 1.0, **modes
    )  # fmt: skip


def combined_otherwise(materials: Mapping[SdfPath, Material]) -> list[str]:
    """Return lines about pairs of materials that PhysX combines to other values, for the sake of its precedence of combine modes."""
    ranks, lines = list(COMBINE.values()), []
    for (path_a, a), (path_b, b) in combinations(sorted(materials.items(), key=lambda entry: str(entry[0])), 2):
        modes = {name: max(getattr(a, name), getattr(b, name), key=ranks.index) for name in ("restitution_combine", "friction_combine")}
        here, there = combine(a, b), combine(replace(a, **modes), replace(b, **modes))
        told = [f"{what} {mine:g}, not {other:g}" for what, mine, other in zip(COEFFICIENTS, here, there, strict=False) if mine != other]
        if told:
            lines.append(f"materials {path_a} and {path_b} combine to {', '.join(told)} as in PhysX: combine modes have another precedence")
    return lines


def given_mass(prim: Prim, units: Units, stretch: np.ndarray, notes: list[str]) -> dict[str, Any]:
    """Return what the MassAPI of a prim says: mass, density, center_of_mass (3,), inertia (3, 3), in SI; only what is given.

    Args:
        prim: it. units: of its stage. stretch: K (3, 3) of the prim, which its centre of mass is under.
        notes: where the line of the report goes, for figures that make no sense.

    """
    if not prim.HasAPI(UsdPhysics.MassAPI):
        return {}
    api, values = UsdPhysics.MassAPI(prim), {}
    for what, attribute in (("mass", api.GetMassAttr()), ("density", api.GetDensityAttr())):
        if not attribute.Get() >= 0.0 or not np.isfinite(attribute.Get()):
            notes.append(f"prim {prim.GetPath()}: its {what} is {attribute.Get():g}, which is taken as not given")
    if mass := positive(api.GetMassAttr()):
        values["mass"] = mass * units.mass
    if density := positive(api.GetDensityAttr()):
        values["density"] = units.density(density)
    centre = np.array(api.GetCenterOfMassAttr().Get(), float)
    if api.GetCenterOfMassAttr().HasAuthoredValue() and np.all(np.isfinite(centre)):
        values["center_of_mass"] = stretch @ centre * units.length
    moments = np.array(api.GetDiagonalInertiaAttr().Get(), float)
    if np.all(np.isfinite(moments)) and np.all(moments > 0.0):
        given = api.GetPrincipalAxesAttr().Get()
        turn = np.array([given.GetReal(), *given.GetImaginary()], float)
        axes = to_matrix(turn / np.linalg.norm(turn)) if np.linalg.norm(turn) > 1e-6 else np.eye(3)
        values["inertia"] = axes @ np.diag(moments) @ axes.T * units.mass * units.length**2
    elif np.any(moments != 0.0):
        told = ", ".join(f"{moment:g}" for moment in moments)
        notes.append(f"prim {prim.GetPath()}: its moments of inertia are {told}, which is taken as not given")
    return values


def weight_given(part: Weight, given: dict[str, Any], position: np.ndarray, rotation: np.ndarray) -> Weight:
    """Return the mass properties of a collider with what its own MassAPI says of centre of mass and inertia.

    Args:
        part: what its shape and mass say, in the frame of its body. given: of `given_mass`.
        position, rotation: (3,) m and (3, 3), of the collider in the frame of its body.

    """
    centre = position + rotation @ given["center_of_mass"] if "center_of_mass" in given else part.center_of_mass
    if "inertia" in given:
        return Weight(part.mass, centre, rotation @ given["inertia"] @ rotation.T)
    return Weight(part.mass, centre, part.inertia + part.mass * moved_unit(centre - part.center_of_mass))


class Filters:
    """Collision filters of bodies, from collision groups and filtered pairs."""

    def __init__(self, stage: Stage) -> None:
        """Read the groups of a stage."""
        self._table = UsdPhysics.CollisionGroup.ComputeCollisionGroupTable(stage)
        self._groups = list(self._table.GetGroups())

    def of(self, groups: Mapping[str, Iterable[SdfPath]], apart: Mapping[str, set[str]]) -> dict[str, CollisionFilter | None]:
        """Return the filter of each body.

        Args:
            groups: of the colliders of bodies, by name. apart: names of bodies that each does not collide with.

        """
        alone = set().union(*apart.values()) if apart else set()
        made: dict[str, CollisionFilter | None] = {}
        for name, mine in groups.items():
            member = [group for group in self._groups if group in set(mine)]
            shut = [other for other in self._groups if any(not self._table.IsCollisionEnabled(group, other) for group in member)]
            systems = [str(group) for group in member] + ([f"body {name}"] if name in alone else [])
            barred = [str(other) for other in shut] + [f"body {other}" for other in sorted(apart.get(name, ()))]
            made[name] = CollisionFilter(systems, not_collide_with=barred) if systems or barred else None
        return made
