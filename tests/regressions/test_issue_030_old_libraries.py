"""A library that is too old is what the message names, not the file that it cannot read."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest

import rigidimpulse as ri
from rigidimpulse.gallery import asset_path


def test_an_old_trimesh_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Version 4.5 reads meshes by functions of other names."""
    old = ModuleType("trimesh")
    vars(old)["__version__"] = "4.5.0"
    monkeypatch.setitem(sys.modules, "trimesh", old)
    with pytest.raises(ri.SceneError, match=r"trimesh 4\.5\.0 is too old .* pip install --upgrade trimesh \(4\.6 or newer\)"):
        ri.Shape.from_file(asset_path("spot.obj"))
