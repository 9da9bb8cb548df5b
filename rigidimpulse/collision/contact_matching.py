"""New rows of contacts, their impulses from the ones they replace, and the gap at which the contacts of a pair are held.

That gap is the skin, which soft contact may sink into. Pairs that are closer when they first have contacts, flush or inside each
other, are held where they are, but no closer than LEAST_HELD skins: driven out of the skin, a block that slides would hop, and a flush
wall would rise. Bodies that come to a heap closer than that are moved apart at once, without speed (`heap_parting`).
"""

from __future__ import annotations

from rigidimpulse.collision.contact_records import (
    CARRIER,
    DYNAMIC_FRICTION,
    FRICTION,
    HELD,
    IMPULSE,
    ROUND_A,
    ROUND_B,
    ROW_SIZE,
    SEPARATION,
    SKELETON_A,
    SKELETON_B,
    SKIN,
    STATIC_FRICTION,
)
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.vector import turned_back_by

NEAR = 0.2
"""Inner radii within which an old contact hands its impulse to a new one of other features."""
LEAST_HELD = 0.2
"""Skins that pairs are held apart, however close they were: as far as a column presses them in."""


@inlined
def write_row(
    position, rotation, material, skin, held, a, b, carrier, real, c, round_a, round_b, factor_a, factor_b, coefficients, rows, r
):
    """A new row r, without impulse, of the contact real[c] (10,) of bodies a and b, with places relative to a; carrier: whether it is b.

    held: gap at which it is held, m; factor_a, factor_b: lengths of the bodies as the contact was found, parts of their true ones.
    Returns the separation.
    """
    nx, ny, nz = real[c, 6], real[c, 7], real[c, 8]
    dx, dy, dz = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1], position[b, 2] - position[a, 2]
    ax, ay, az = real[c, 0] / factor_a - round_a * nx, real[c, 1] / factor_a - round_a * ny, real[c, 2] / factor_a - round_a * nz
    bx, by, bz = (real[c, 3] - dx) / factor_b, (real[c, 4] - dy) / factor_b, (real[c, 5] - dz) / factor_b
    bx, by, bz = bx + round_b * nx, by + round_b * ny, bz + round_b * nz
    m, t = material[a], material[b]
    for k in range(IMPULSE, ROW_SIZE):
        rows[r, k] = 0.0
    rows[r, 0], rows[r, 1], rows[r, 2] = turned_back_by(rotation, b if carrier else a, nx, ny, nz)
    rows[r, SKELETON_A], rows[r, SKELETON_A + 1], rows[r, SKELETON_A + 2] = turned_back_by(rotation, a, ax, ay, az)
    rows[r, SKELETON_B], rows[r, SKELETON_B + 1], rows[r, SKELETON_B + 2] = turned_back_by(rotation, b, bx, by, bz)
    rows[r, ROUND_A], rows[r, ROUND_B], rows[r, CARRIER] = round_a, round_b, 1.0 if carrier else 0.0
    rows[r, STATIC_FRICTION], rows[r, DYNAMIC_FRICTION] = coefficients[m, t, 1], coefficients[m, t, 2]
    rows[r, SKIN], rows[r, HELD] = min(skin[a], skin[b]), held
    apart = nx * (dx + (bx - ax)) + ny * (dy + (by - ay)) + nz * (dz + (bz - az))
    rows[r, SEPARATION] = apart - (round_a + round_b) - held
    return rows[r, SEPARATION]


@jit
def take_up(held, p, rows, begin, end):
    """Hold pair p, whose first contacts are those from `begin` to `end`, where it is, if that is between LEAST_HELD and the skin."""
    closer = 0.0
    for r in range(begin, end):
        closer = max(closer, min(-rows[r, SEPARATION], held[p] - LEAST_HELD * rows[r, SKIN]))
    if closer > 0.0:
        held[p] -= closer
        for r in range(begin, end):
            rows[r, HELD] -= closer
            rows[r, SEPARATION] += closer


@inlined
def hand_over(old_rows, old_ids, old, old_end, rows, ids, new, new_end, near):
    """Give new rows the impulses of the old ones of the same features, else of one nearby with much the same normal.

    An old one that has given its impulse has none.
    """
    for nearby in range(2):
        for c in range(new, new_end):
            if rows[c, IMPULSE] > 0.0:
                continue
            for o in range(old, old_end):
                if old_rows[o, IMPULSE] == 0.0:
                    continue
                cosine = rows[c, 0] * old_rows[o, 0] + rows[c, 1] * old_rows[o, 1] + rows[c, 2] * old_rows[o, 2]
                same = ids[c, 0] == old_ids[o, 0] and ids[c, 1] == old_ids[o, 1] and ids[c, 2] == old_ids[o, 2]
                if nearby == 1:
                    x, y = rows[c, SKELETON_A] - old_rows[o, SKELETON_A], rows[c, SKELETON_A + 1] - old_rows[o, SKELETON_A + 1]
                    z = rows[c, SKELETON_A + 2] - old_rows[o, SKELETON_A + 2]
                    same = x * x + y * y + z * z < near * near
                if not same or cosine < 0.9:
                    continue
                rows[c, IMPULSE], old_rows[o, IMPULSE] = old_rows[o, IMPULSE], 0.0
                for k in range(FRICTION, FRICTION + 3):
                    rows[c, k] = old_rows[o, k]
                break
