"""Layers below a USD file, and the files that they name: looked at before a stage reads them."""

from __future__ import annotations

from pathlib import Path

from rigidimpulse.core.errors import SceneError
from rigidimpulse.io.named_files import named_file
from rigidimpulse.io.usd.library import Ar, Layer, Sdf, Tf, UsdUtils

EXPRESSION = "`"
"""Asset paths that are computed from variables begin so."""
TEXT = "usda"
"""The format of layers that are parsed, and are whole where they are read at all."""


def checked_layers(path: Path) -> dict[str, Layer]:
    """Return all layers below a file, as they are on the disk, by identifier; those of variants that are not chosen are among them.

    What is open in the process and was edited there is left as it is.

    Raises:
        SceneError: one of them names a layer, a texture or a clip outside the folder of the file, or by an absolute path, or is not whole.
        Tf.ErrorException: the file is broken. Layers below it that are missing or broken are left to the stage, which tells them.

    """
    folder = path.absolute().parent
    root = Sdf.Layer.FindOrOpen(str(path))
    layers: dict[str, Layer] = {}
    waiting = [root]
    while waiting:
        layer = waiting.pop()
        if layer.identifier in layers:
            continue
        layers[layer.identifier] = layer
        if not layer.dirty:
            layer.Reload(True)
        where = repr(path.name) if layer == root else f"{path.name!r}, layer {_shown(layer, folder)!r}"
        if layer.GetFileFormat().formatId != TEXT and not _is_whole(layer):
            raise SceneError("prims that it counts are not in it", "export it again", where)
        composed = list(layer.GetCompositionAssetDependencies())
        for name in composed:
            if name.startswith(EXPRESSION):
                raise SceneError(f"it computes the path of a file: {name!r}", "write the path itself, or give allow_outside=True", where)
        read = (name for group in UsdUtils.ExtractExternalReferences(layer.identifier) for name in group)
        for name in dict.fromkeys([*composed, *read]):
            named_file(folder, name, False, where, _place(layer, name, folder))
        waiting += [below for name in composed if (below := _below(layer, name)) is not None]
    return layers


def _place(layer: Layer, name: str, folder: Path) -> Path:
    """Where a layer finds a file: beside itself, or where the paths of the process are searched."""
    anchored = str(layer.ComputeAbsolutePath(name))
    found = str(Ar.GetResolver().Resolve(anchored)) or anchored
    if Ar.IsPackageRelativePath(found):
        found = Ar.SplitPackageRelativePathOuter(found)[0]
    return folder / found


def _is_whole(layer: Layer) -> bool:
    """Whether all prims of a layer are there that others have for children: usd-core ends the process that asks for one that is not."""
    waiting = list(layer.rootPrims)
    while waiting:
        prim = waiting.pop()
        if prim is None:
            return False
        waiting += prim.nameChildren
        for variants in prim.variantSets.values():
            waiting += [variant.primSpec if variant else None for variant in variants.variants.values()]
    return True


def _below(layer: Layer, name: str) -> Layer | None:
    """A layer that another one names; None where it is missing or broken."""
    try:
        return Sdf.Layer.FindOrOpenRelativeToLayer(layer, name)
    except Tf.ErrorException:
        return None


def _shown(layer: Layer, folder: Path) -> str:
    """The path of a layer in the folder."""
    place = Path(layer.identifier)
    return place.relative_to(folder).as_posix() if place.is_relative_to(folder) else layer.identifier
