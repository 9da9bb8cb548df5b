"""Meshes of USD files whose bones move: their surface goes where no rigid body goes."""

from __future__ import annotations

from rigidimpulse.io.usd.library import Prim, SdfPath, Stage, Usd, UsdSkel


def moved_by_bones(stage: Stage) -> frozenset[SdfPath]:
    """Return the paths of the meshes that a skeleton with an animation bends."""
    cache, found = UsdSkel.Cache(), set()
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        root = UsdSkel.Root(prim)
        if not root:
            continue
        cache.Populate(root, Usd.TraverseInstanceProxies())
        for binding in cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies()):
            if _is_animated(cache, binding.GetSkeleton()):
                found.update(target.GetPrim().GetPath() for target in binding.GetSkinningTargets())
    return frozenset(found)


def _is_animated(cache: Prim, skeleton: Prim) -> bool:
    """Whether the joints of a skeleton have more than one pose."""
    query = cache.GetSkelQuery(skeleton).GetAnimQuery()
    return bool(query) and query.JointTransformsMightBeTimeVarying()
