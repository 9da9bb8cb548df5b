"""Contacts of heaps as the solver reads them: patches, coloured, one to a lane.

A patch is up to four contact points of one pair with one normal. Patches that share no movable body have one colour (greedy, in
the order of the pairs, with a word of bits for each body) and may be solved at once; a batch is W patches of one colour, those of
most points first. The record of a batch is an array of fields times lanes: with O the centre of the patch, n its normal, t_1
and t_2 tangents, t_1 x t_2 = n, a point lies at O + x t_1 + y t_2.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.heap_narrow import GENERAL, in_play
from rigidimpulse.constrain.heap_rows import (
    CORE_A,
    CORE_B,
    DYNAMIC_FRICTION,
    FRICTION,
    IMPULSE,
    INVERSE_MASS,
    ROUND_A,
    ROUND_B,
    SEPARATION,
    SKIN,
    STATIC_FRICTION,
    turned,
)

NORMAL, TANGENT_1, TANGENT_2, ARM_A, ARM_B = 0, 3, 6, 9, 12
"""Fields of three: axes; from the centres of the bodies to O, m."""
SHARE, RADIUS_A, RADIUS_B, MU_STATIC, MU_DYNAMIC, DEPTH = 15, 16, 17, 18, 19, 20
"""How much of a's motion O makes; radii of rounded surfaces, m; coefficients; skin, m."""
STIFF, HARD, SOFT = 21, 22, 23
"""w / a_1 [1/s], a_2 a_3, a_3 of the spring."""
PUSH_1, PUSH_2, TWIST = 24, 25, 26
"""Friction impulse along the tangents, N s, and about n, N m s."""
STEP_T, STEP_N = 27, 28
"""1 / largest eigenvalue of the tangents' part of K, and of that about n."""
TO_NORMAL, TO_TURN_1, TO_TURN_2, TWIST_TO_1, TWIST_TO_2 = 29, 32, 35, 38, 39
"""How impulses (t_1, t_2, about n) change the speeds along n, about t_1 and about t_2 (three each); a twist those along t_1, t_2."""
BETWEEN = 40
"""How points push each other along n: 01, 02, 03, 12, 13, 23."""
POINT, POINT_SIZE = 46, 6
X, Y, GAP, MASS, PRESS, LEVER = 0, 1, 2, 3, 4, 5
"""First field of the points, and fields of each: place, m; gap less the skin, m; effective mass, 0 for none; impulse; distance from O."""
FIELDS = POINT + 4 * POINT_SIZE
POINTS = 4
COLOURS = 62
"""Patches that find no colour among these have a batch each."""
ONE_WALL = 1.0 - 1e-8
"""Cosine of normals that are one."""


class Patches(NamedTuple):
    """m patches of a step."""

    pair: np.ndarray  # (m,)
    row: np.ndarray  # (m, 4) rows of the pool
    size: np.ndarray  # (m,) points
    colour: np.ndarray  # (m,)
    slot: np.ndarray  # (m,) batch times W, and the lane


class Batches(NamedTuple):
    """b batches of W lanes."""

    record: np.ndarray  # (FIELDS b W,)
    first: np.ndarray  # (b W,) body a of each lane
    second: np.ndarray  # (b W,)
    patch: np.ndarray  # (b W,) patch of each lane, -1 for none
    points: np.ndarray  # (b,) most points of a lane


def empty_patches(m: int) -> Patches:
    """Room for m patches."""
    row = np.zeros((m, POINTS), np.int64)
    return Patches(pair=np.zeros(m, np.int64), row=row, size=row[:, 0].copy(), colour=row[:, 0].copy(), slot=row[:, 0].copy())


@jit
def list_patches(bodies, pairs, rows, patches):
    """Write the patches of all pairs in play; returns their number, minus the number needed where there is no room."""
    m = 0
    room, part = patches.pair.shape[0], bodies.part
    taken = np.zeros(64, np.bool_)
    for p in range(pairs.first.shape[0]):
        count = min(pairs.count[p], 64)
        if count == 0 or not in_play(part, pairs.first[p], pairs.second[p]):
            continue
        start = pairs.start[p]
        if pairs.kind[p] != GENERAL:
            if m < room:
                patches.pair[m], patches.size[m] = p, count
                for c in range(count):
                    patches.row[m, c] = start + c
            m += 1
            continue
        taken[:count] = False
        for c in range(count):
            if taken[c]:
                continue
            size = 0
            for d in range(c, count):
                i, j = start + c, start + d
                cosine = rows[i, 0] * rows[j, 0] + rows[i, 1] * rows[j, 1] + rows[i, 2] * rows[j, 2]
                if size < POINTS and not taken[d] and (d == c or cosine > ONE_WALL):
                    taken[d] = True
                    if m < room:
                        patches.row[m, size] = j
                    size += 1
            if m < room:
                patches.pair[m], patches.size[m] = p, size
            m += 1
    return m if m <= room else -m


@jit
def colour_patches(width, bodies, pairs, patches, count, begins):
    """Colour `count` patches and give them slots; begins (c+1,) is set to the first batch of each colour.

    Returns the numbers of batches and of colours, minus the number of colours needed where `begins` is too small.
    """
    used = np.zeros(bodies.part.shape[0], np.int64)
    one, colours, crowded = np.int64(1), np.int64(0), np.int64(0)
    for m in range(count):
        a, b = pairs.first[patches.pair[m]], pairs.second[patches.pair[m]]
        free_a, free_b = bodies.mass[8 * a + INVERSE_MASS] > 0.0, bodies.mass[8 * b + INVERSE_MASS] > 0.0
        taken = (used[a] if free_a else np.int64(0)) | (used[b] if free_b else np.int64(0))
        c = np.int64(0)
        while c < COLOURS and (taken >> c) & one:
            c += 1
        if c == COLOURS:
            c += crowded
            crowded += 1
        else:
            colours = max(colours, c + 1)
            if free_a:
                used[a] |= one << c
            if free_b:
                used[b] |= one << c
        patches.colour[m] = c
    # Colours of crowded patches follow those in use.
    for m in range(count):
        if patches.colour[m] >= COLOURS:
            patches.colour[m] += colours - COLOURS
    colours += crowded
    if colours + 1 > begins.shape[0]:
        return np.int64(0), -colours
    number = np.zeros((colours, POINTS), np.int64)
    for m in range(count):
        number[patches.colour[m], POINTS - patches.size[m]] += 1
    batches = np.int64(0)
    for c in range(colours):
        begins[c] = batches
        place = batches * width
        for k in range(POINTS):
            here = number[c, k]
            number[c, k] = place
            place += here
        batches = (place + width - 1) // width
    begins[colours] = batches
    for m in range(count):
        k = POINTS - patches.size[m]
        patches.slot[m] = number[patches.colour[m], k]
        number[patches.colour[m], k] += 1
    return batches, colours


@jit
def tangents(nx, ny, nz):
    """Two unit vectors with t_1 x t_2 = n."""
    if abs(nx) > 0.57735:
        factor = 1.0 / sqrt(nx * nx + ny * ny)
        ux, uy, uz = ny * factor, -nx * factor, 0.0
    else:
        factor = 1.0 / sqrt(ny * ny + nz * nz)
        ux, uy, uz = 0.0, nz * factor, -ny * factor
    return ux, uy, uz, ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux


@jit
def point_of(position, rotation, rows, r, a, b, nx, ny, nz, share):
    """Where the impulses of row r act, from the centre of a, and the gap less the skin, m."""
    ax, ay, az = turned(rotation, a, rows[r, CORE_A], rows[r, CORE_A + 1], rows[r, CORE_A + 2])
    bx, by, bz = turned(rotation, b, rows[r, CORE_B], rows[r, CORE_B + 1], rows[r, CORE_B + 2])
    bx += position[b, 0] - position[a, 0]
    by += position[b, 1] - position[a, 1]
    bz += position[b, 2] - position[a, 2]
    s, t = rows[r, ROUND_A], rows[r, ROUND_B]
    gap = nx * (bx - ax) + ny * (by - ay) + nz * (bz - az) - (s + t) - rows[r, SKIN]
    rest = 1.0 - share
    x = share * (ax + s * nx) + rest * (bx - t * nx)
    y = share * (ay + s * ny) + rest * (by - t * ny)
    return x, y, share * (az + s * nz) + rest * (bz - t * nz), gap


@jit
def share_of(mass, a, b):
    """Impulses act at one point, so that no torque is left over: mid-way, or on the surface of what can move, so that it rolls."""
    if mass[8 * a + INVERSE_MASS] == 0.0:
        return 0.0
    return 0.5 if mass[8 * b + INVERSE_MASS] > 0.0 else 1.0


@jit
def normal_of(position, rotation, rows, r, a, b, carrier):
    """The world normal of row r of bodies a and b; that of two rounded surfaces runs between their centres."""
    if rows[r, ROUND_A] > 0.0 and rows[r, ROUND_B] > 0.0:
        ax, ay, az = turned(rotation, a, rows[r, CORE_A], rows[r, CORE_A + 1], rows[r, CORE_A + 2])
        bx, by, bz = turned(rotation, b, rows[r, CORE_B], rows[r, CORE_B + 1], rows[r, CORE_B + 2])
        x = position[b, 0] + bx - position[a, 0] - ax
        y = position[b, 1] + by - position[a, 1] - ay
        z = position[b, 2] + bz - position[a, 2] - az
        length = sqrt(x * x + y * y + z * z)
        if length > 0.0:
            return x / length, y / length, z / length
    return turned(rotation, b if carrier else a, rows[r, 0], rows[r, 1], rows[r, 2])


@jit
def fill_patch(position, rotation, a, b, carrier, share, patch_row, m, count, rows, record, o, width):
    """Axes, arms, points and impulses of patch m, of bodies a and b, into the record, from o on; patch_row (m, 4)."""
    r = patch_row[m, 0]
    nx, ny, nz = normal_of(position, rotation, rows, r, a, b, carrier)
    ux, uy, uz, vx, vy, vz = tangents(nx, ny, nz)
    mx, my, mz = 0.0, 0.0, 0.0
    for c in range(count):
        x, y, z, gap = point_of(position, rotation, rows, patch_row[m, c], a, b, nx, ny, nz, share)
        rows[patch_row[m, c], SEPARATION] = gap
        g = o + (POINT + POINT_SIZE * c) * width
        record[g + X * width] = ux * x + uy * y + uz * z
        record[g + Y * width] = vx * x + vy * y + vz * z
        record[g + GAP * width] = gap
        mx, my, mz = mx + x, my + y, mz + z
    mx, my, mz = mx / count, my / count, mz / count
    ox, oy = ux * mx + uy * my + uz * mz, vx * mx + vy * my + vz * mz
    fx, fy, fz, twist = 0.0, 0.0, 0.0, 0.0
    for c in range(POINTS):
        g = o + (POINT + POINT_SIZE * c) * width
        if c >= count:
            for k in range(POINT_SIZE):
                record[g + k * width] = 0.0
            record[g + GAP * width] = 1.0
            continue
        q = patch_row[m, c]
        x, y = record[g + X * width] - ox, record[g + Y * width] - oy
        record[g + X * width], record[g + Y * width] = x, y
        record[g + MASS * width], record[g + PRESS * width] = 1.0, rows[q, IMPULSE]
        record[g + LEVER * width] = sqrt(x * x + y * y)
        px, py, pz = rows[q, FRICTION], rows[q, FRICTION + 1], rows[q, FRICTION + 2]
        fx, fy, fz = fx + px, fy + py, fz + pz
        twist += x * (vx * px + vy * py + vz * pz) - y * (ux * px + uy * py + uz * pz)
    record[o + NORMAL * width], record[o + (NORMAL + 1) * width], record[o + (NORMAL + 2) * width] = nx, ny, nz
    record[o + ARM_A * width], record[o + (ARM_A + 1) * width], record[o + (ARM_A + 2) * width] = mx, my, mz
    record[o + ARM_B * width] = mx - (position[b, 0] - position[a, 0])
    record[o + (ARM_B + 1) * width] = my - (position[b, 1] - position[a, 1])
    record[o + (ARM_B + 2) * width] = mz - (position[b, 2] - position[a, 2])
    record[o + TANGENT_1 * width], record[o + (TANGENT_1 + 1) * width], record[o + (TANGENT_1 + 2) * width] = ux, uy, uz
    record[o + TANGENT_2 * width], record[o + (TANGENT_2 + 1) * width], record[o + (TANGENT_2 + 2) * width] = vx, vy, vz
    record[o + SHARE * width], record[o + RADIUS_A * width], record[o + RADIUS_B * width] = share, rows[r, ROUND_A], rows[r, ROUND_B]
    record[o + MU_STATIC * width], record[o + MU_DYNAMIC * width] = rows[r, STATIC_FRICTION], rows[r, DYNAMIC_FRICTION]
    record[o + DEPTH * width] = rows[r, SKIN]
    record[o + PUSH_1 * width], record[o + PUSH_2 * width] = ux * fx + uy * fy + uz * fz, vx * fx + vy * fy + vz * fz
    record[o + TWIST * width] = twist


@jit
def fill_batches(width, bodies, pairs, patches, count, rows, batches, number):
    """Records of `count` patches in `number` batches, but for what `prepare` adds: lane after lane, as they lie in memory."""
    idle = bodies.part.shape[0] - 1
    batches.patch[: number * width] = -1
    for m in range(count):
        batches.patch[patches.slot[m]] = m
    for s in range(number * width):
        m, k = batches.patch[s], s // width
        o = k * FIELDS * width + s % width
        if s == k * width:
            batches.points[k] = 0
        if m < 0:
            batches.first[s] = batches.second[s] = idle
            for f in range(FIELDS):
                batches.record[o + f * width] = 0.0
            continue
        p = patches.pair[m]
        a, b = pairs.first[p], pairs.second[p]
        batches.first[s], batches.second[s] = a, b
        batches.points[k] = max(batches.points[k], patches.size[m])
        share = share_of(bodies.mass, a, b)
        fill_patch(
            bodies.position, bodies.rotation, a, b, pairs.carrier[p], share, patches.row, m, patches.size[m], rows, batches.record, o, width
        )


@jit
def keep_impulses(width, patches, rows, batches, number):
    """Put the impulses of `number` batches back to their rows: friction as forces at the points with the same sum and twist."""
    record = batches.record
    for s in range(number * width):
        m = batches.patch[s]
        if m < 0:
            continue
        o = (s // width) * FIELDS * width + s % width
        f1, f2, twist, square = record[o + PUSH_1 * width], record[o + PUSH_2 * width], record[o + TWIST * width], 0.0
        for c in range(patches.size[m]):
            square += record[o + (POINT + POINT_SIZE * c + LEVER) * width] ** 2
        turn = twist / square if square > 0.0 else 0.0
        share = 1.0 / patches.size[m]
        for c in range(patches.size[m]):
            r, g = patches.row[m, c], o + (POINT + POINT_SIZE * c) * width
            rows[r, IMPULSE] = record[g + PRESS * width]
            along_1 = share * f1 - turn * record[g + Y * width]
            along_2 = share * f2 + turn * record[g + X * width]
            for k in range(3):
                rows[r, FRICTION + k] = along_1 * record[o + (TANGENT_1 + k) * width] + along_2 * record[o + (TANGENT_2 + k) * width]

