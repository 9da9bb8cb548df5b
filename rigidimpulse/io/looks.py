"""What is seen of links, in colours of their own, beside what collides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.io.pieces import Piece
from rigidimpulse.scene.shape import Shape
from rigidimpulse.scene.visual import Visual
from rigidimpulse.view.display import display_mesh

SEGMENTS = 32
"""Corners of a full turn of round shapes that have a colour."""


class Look(NamedTuple):
    """A shape that is seen in the frame of its link, and its colour (3,) in [0, 1] as on the screen, None: its own."""

    shape: Shape
    position: np.ndarray
    orientation: np.ndarray
    color: np.ndarray | None


def colliders_as_looks(pieces: list[Piece]) -> list[Look]:
    """Return colliders as what is seen."""
    return [Look(piece.shape, piece.position, piece.orientation, None) for piece in pieces]


def visual_of(looks: list[Look], pieces: list[Piece]) -> Visual | None:
    """Return what is seen of a link whose colliders are given, None where that says no more than they do."""
    if not looks:
        return None
    colors = {None if look.color is None else tuple(look.color.tolist()) for look in looks}
    if len(colors) == 1 and _are_seen(looks, pieces):
        color = colors.pop()
        return None if color is None else Visual(color=color)
    solid = [look for look in looks if look.shape.kind != "half_space"]
    parts = [(look.shape if look.color is None else _painted(look), look.position, look.orientation) for look in solid]
    return Visual(shape=Shape.compound(parts)) if parts else None


def _are_seen(looks: list[Look], pieces: list[Piece]) -> bool:
    """Whether what is seen are the very colliders."""
    return len(looks) == len(pieces) and all(
        look.shape.drawn_key == piece.shape.drawn_key
        and np.array_equal(look.position, piece.position)
        and np.array_equal(look.orientation, piece.orientation)
        for look, piece in zip(looks, pieces, strict=True)
    )


def _painted(look: Look) -> Shape:
    """Return the shape of a look as a mesh of its colour."""
    mesh = display_mesh(look.shape, SEGMENTS)
    assert mesh is not None and look.color is not None
    return Shape.mesh(mesh.vertices, mesh.faces, np.tile(look.color, (len(mesh.faces), 1)))
