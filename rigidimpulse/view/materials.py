"""Surfaces to the eye: one colour per body, and a finish that follows from its physical material."""

from __future__ import annotations

import colorsys
from typing import Any

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


def surface(index: int, body: Any) -> dict[str, Any]:
    """Return how the page paints a body.

    Args:
        index: number of the body among the moving ones; chooses the colour.
        body: its shape, motion and material are looked at.

    Returns:
        color (#rrggbb), roughness, metalness and clearcoat in [0, 1], octants (paint round bodies in two tones).

    """
    moves = body.motion != "static"
    density = getattr(body.material, "density", None) or 1000.0
    friction = getattr(body.material, "dynamic_friction", None)
    friction = 0.5 if friction is None else friction
    metal = moves and density >= METAL_DENSITY
    roughness = 0.22 + 0.14 * min(friction, 1.0) if metal else 0.32 + 0.4 * min(friction, 1.0)
    return {
        "color": color(index) if moves else STATIC_COLOR,
        "roughness": round(roughness if moves else 0.85, 3),
        "metalness": 0.75 if metal else 0.0,
        "clearcoat": 0.0 if metal or not moves else round(0.5 * (1.0 - min(friction, 1.0)), 3),
        "octants": moves and getattr(body.shape, "kind", "") in ROUND_KINDS,
    }


def soft_body_surface(index: int, closed: bool) -> dict[str, Any]:
    """Return how the page paints a flexible body: cloth is dull, what is closed shines like jelly; see `surface`."""
    roughness, clearcoat = (0.3, 0.6) if closed else (0.75, 0.0)
    return {"color": color(index), "roughness": roughness, "metalness": 0.0, "clearcoat": clearcoat, "octants": False}


def color(index: int) -> str:
    """Return the colour of the moving body `index`: the palette, then the palette lighter and darker."""
    lap, place = divmod(index, len(PALETTE))
    red, green, blue = (int(PALETTE[place][k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    shade = (lap + 1) // 2 % NUM_SHADES * LAP_SHADE * (1.0 if lap % 2 else -1.0)
    lightness = lightness + shade * (1.0 - lightness if shade > 0.0 else lightness)
    return "#" + "".join(f"{round(255.0 * part):02x}" for part in colorsys.hls_to_rgb(hue, lightness, saturation))
