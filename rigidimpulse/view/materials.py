"""Surfaces to the eye: the colours a body has, or one of the palette, and a finish that follows from its physical material."""

from __future__ import annotations

import colorsys
from typing import Any

from rigidimpulse.core.colors import hex_of, seen_of_hex
from rigidimpulse.view.display import DisplayMesh

PALETTE = (
    "#2f7fb8",  # blue
    "#f0b43c",  # amber
    "#3f9d84",  # sea green
    "#8c6bb1",  # violet
    "#d9799a",  # rose
    "#7fb04f",  # leaf
    "#4fb3c8",  # aqua
    "#b07d4f",  # oak
    "#5566b5",  # indigo
    "#c9a7d8",  # lilac
)
"""Colours of moving bodies, in turn. Red and orange are left to the impact arrows."""

STATIC_COLOR = "#a59f96"
METAL_DENSITY = 2500.0
"""Density, kg/m^3, from which a body is drawn as metal."""
LAP_SHADE = 0.16
"""How much each further lap through the palette changes the lightness, up and down in turn."""
NUM_SHADES = 4
ROUND_KINDS = frozenset({"sphere", "capsule", "cylinder"})
"""Kinds of shape on which a plain colour would hide the spin."""


def surface(index: int, body: Any, mesh: DisplayMesh | None) -> dict[str, Any]:
    """Return how the page paints a body.

    Args:
        index: number of the body among the moving ones; chooses the colour of one that has none.
        body: its shape, motion, material and visual are looked at.
        mesh: what is drawn of it, None: nothing but half spaces.

    Returns:
        color (#rrggbb; the mean one of a body that is painted), painted (the mesh has colours of its own, which are shown), open (one sees
        its inside), roughness, metalness and clearcoat in [0, 1], octants (round bodies that the library colours are in two tones).

    """
    chosen = None if body.visual is None else body.visual.hex_color()
    colors = None if mesh is None else mesh.colors
    painted = body.shows_own_colors and colors is not None
    if painted and colors is not None:
        chosen = hex_of(colors.mean(axis=0) / 255.0)
    # A colour that somebody has chosen is left as it is.
    hides_spin = body.visual is None and not painted and getattr(body.shape, "kind", "") in ROUND_KINDS
    moves = body.motion != "static"
    density = getattr(body.material, "density", None) or 1000.0
    friction = getattr(body.material, "dynamic_friction", None)
    friction = 0.5 if friction is None else friction
    metal = moves and density >= METAL_DENSITY
    roughness = 0.22 + 0.14 * min(friction, 1.0) if metal else 0.32 + 0.4 * min(friction, 1.0)
    return {
        "color": chosen or (color(index) if moves else STATIC_COLOR),
        "painted": painted,
        "open": mesh is not None and mesh.open,
        "roughness": round(roughness if moves else 0.85, 3),
        "metalness": 0.75 if metal else 0.0,
        "clearcoat": 0.0 if metal or not moves else round(0.5 * (1.0 - min(friction, 1.0)), 3),
        "octants": moves and hides_spin,
    }


def soft_body_surface(index: int, closed: bool) -> dict[str, Any]:
    """Return how the page paints a flexible body: cloth is dull, what is closed shines like jelly; see `surface`."""
    roughness, clearcoat = (0.3, 0.6) if closed else (0.75, 0.0)
    finish = {"roughness": roughness, "metalness": 0.0, "clearcoat": clearcoat}
    return {"color": color(index), "painted": False, "open": not closed, **finish, "octants": False}


def color(index: int) -> str:
    """Return the colour of the moving body `index`: the palette, then the palette lighter and darker."""
    lap, place = divmod(index, len(PALETTE))
    hue, lightness, saturation = colorsys.rgb_to_hls(*seen_of_hex(PALETTE[place]))
    shade = (lap + 1) // 2 % NUM_SHADES * LAP_SHADE * (1.0 if lap % 2 else -1.0)
    lightness = lightness + shade * (1.0 - lightness if shade > 0.0 else lightness)
    return hex_of(colorsys.hls_to_rgb(hue, lightness, saturation))
