"""The modules of usd-core, which is optional, and has no types: importing this raises a `SceneError` where it is not installed."""

from __future__ import annotations

from typing import Any, TypeAlias

from rigidimpulse.core.errors import SceneError

try:
    from pxr import Ar as _Ar
    from pxr import Gf as _Gf
    from pxr import Sdf as _Sdf
    from pxr import Tf as _Tf
    from pxr import Usd as _Usd
    from pxr import UsdGeom as _UsdGeom
    from pxr import UsdPhysics as _UsdPhysics
    from pxr import UsdShade as _UsdShade
    from pxr import UsdSkel as _UsdSkel
    from pxr import UsdUtils as _UsdUtils
    from pxr import Vt as _Vt
except ImportError as error:
    raise SceneError(f"USD files need the package usd-core ({error})", "pip install 'rigidimpulse[usd]'") from None

Ar: Any = _Ar
Gf: Any = _Gf
Sdf: Any = _Sdf
Tf: Any = _Tf
Usd: Any = _Usd
UsdGeom: Any = _UsdGeom
UsdPhysics: Any = _UsdPhysics
UsdShade: Any = _UsdShade
UsdSkel: Any = _UsdSkel
UsdUtils: Any = _UsdUtils
Vt: Any = _Vt

Layer: TypeAlias = Any
"""Sdf.Layer"""
PrimSpec: TypeAlias = Any
"""Sdf.PrimSpec"""
SdfPath: TypeAlias = Any
"""Sdf.Path"""
Stage: TypeAlias = Any
"""Usd.Stage"""
Prim: TypeAlias = Any
"""Usd.Prim"""


def cause_of(error: Exception) -> str:
    """The cause of an error in one line; of several errors of usd-core the first, which has the line of the file."""
    try:
        text = getattr(error.args[0], "commentary", "") if error.args else ""
    except UnicodeDecodeError:  # it quotes the file
        text = "there are bytes in it that are no text in UTF-8"
    return ((text or str(error)).strip() or type(error).__name__).splitlines()[-1][:200]
