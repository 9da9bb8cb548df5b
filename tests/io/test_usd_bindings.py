"""Which physics material a collider of a USD file has: what usd-core itself finds for the purpose "physics"."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import pytest

import rigidimpulse as ri
from rigidimpulse.scene.material import combine

pytest.importorskip("pxr")
from pxr import Sdf, Usd, UsdPhysics, UsdShade
from usd_files import File

DENSITIES = {"light": 250.0, "heavy": 2000.0}
WEAK, STRONG = UsdShade.Tokens.weakerThanDescendants, UsdShade.Tokens.strongerThanDescendants


def scene_of(folder: Path, bindings: list[tuple[str, str, Any, str]], collection: str = "") -> tuple[ri.Scene, str]:
    """A cube "/group/body/shape" under bindings (prim, material, strength, purpose), and the name of its material as usd-core finds it.

    collection: the material that a collection of the group binds to the cube.
    """
    file = File()
    file.prim("/group")
    file.body("/group/body")
    cube = file.collider("/group/body/shape", "Cube", size=1.0)
    materials = {name: UsdShade.Material.Define(file.stage, f"/{name}") for name in (*DENSITIES, "look")}
    for name, density in DENSITIES.items():
        UsdPhysics.MaterialAPI.Apply(materials[name].GetPrim()).CreateDensityAttr(density)
    for path, name, strength, purpose in bindings:
        UsdShade.MaterialBindingAPI.Apply(file.stage.GetPrimAtPath(path)).Bind(materials[name], strength, purpose)
    if collection:
        chosen = Usd.CollectionAPI.Apply(file.stage.GetPrimAtPath("/group"), "chosen")
        chosen.IncludePath("/group/body/shape")
        binding = UsdShade.MaterialBindingAPI.Apply(file.stage.GetPrimAtPath("/group"))
        binding.Bind(chosen, materials[collection], "chosen", STRONG, "physics")
    found = UsdShade.MaterialBindingAPI(cube).ComputeBoundMaterial("physics")[0]
    return file.load(folder), found.GetPrim().GetName()


@pytest.mark.parametrize(("bindings", "collection", "wanted"), [
    ([("/group/body/shape", "light", WEAK, "physics")], "", "light"),
    ([("/group/body", "light", WEAK, "physics")], "", "light"),
    ([("/group", "light", WEAK, "physics")], "", "light"),
    ([("/group", "light", WEAK, "")], "", "light"),
    ([("/group", "light", WEAK, "physics"), ("/group/body/shape", "heavy", WEAK, "physics")], "", "heavy"),
    ([("/group", "light", STRONG, "physics"), ("/group/body/shape", "heavy", WEAK, "physics")], "", "light"),
    ([("/group", "light", WEAK, "physics"), ("/group/body/shape", "look", WEAK, "")], "", "light"),
    ([("/group/body/shape", "look", WEAK, "")], "", "look"),
    ([], "heavy", "heavy"),
    ([("/group/body/shape", "light", WEAK, "physics")], "heavy", "heavy"),
])  # fmt: skip
def test_the_material_is_that_of_usd(tmp_path: Path, bindings: list, collection: str, wanted: str) -> None:
    """Bindings of prims above, and of their collections, were lost: the density was 1,000 kg/m^3."""
    scene, found = scene_of(tmp_path, bindings, collection)
    assert found == wanted
    material = scene["body"].material
    assert material.density == DENSITIES.get(wanted, 1000.0)


@pytest.mark.parametrize("modes", list(product(("average", "min", "multiply", "max"), repeat=2)))
def test_pairs_that_physx_combines_otherwise_are_told(tmp_path: Path, modes: tuple[str, str]) -> None:
    """Of two modes PhysX takes the higher of average < min < multiply < max: restitutions 0.5 and 1 are 0.75, 0.5, 0.5, 1.

    Ours has the precedence of glTF, and nothing said so.
    """
    file = File()
    for name, mode, restitution in zip("ab", modes, (0.5, 1.0), strict=True):
        material = UsdShade.Material.Define(file.stage, f"/m{name}")
        UsdPhysics.MaterialAPI.Apply(material.GetPrim()).CreateRestitutionAttr(restitution)
        material.GetPrim().CreateAttribute("physxMaterial:restitutionCombineMode", Sdf.ValueTypeNames.Token).Set(mode)
        file.body(f"/{name}")
        prim = file.collider(f"/{name}/shape", "Cube", size=1.0)
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(material, WEAK, "physics")
    scene = file.load(tmp_path)
    in_physx = [0.75, 0.5, 0.5, 1.0][max(["average", "min", "multiply", "max"].index(mode) for mode in modes)]
    here = combine(scene["a"].material, scene["b"].material)[0]
    told = f"materials /ma and /mb combine to restitution {here:g}, not {in_physx:g} as in PhysX"
    assert [line for line in scene.report if line.startswith(told)] == list(scene.report)
    assert len(scene.report) == (here != in_physx)
