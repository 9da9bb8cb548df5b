"""Contacts of sub-stepped islands as the solver reads them: patches, coloured, one to a SIMD lane.

A patch is up to four contact points of one pair with one normal. Patches that share no movable body have one colour (greedy, in
the order of the pairs, with a word of bits for each body) and may be solved at once; a batch is W patches of one colour, those of
most points first. The record of a batch is an array of fields times lanes: with O the centre of the patch, n its normal, t_1
and t_2 tangents, t_1 x t_2 = n, a point lies at O + x t_1 + y t_2. Records are in single precision (the passes compute in double
precision): what that takes from an impulse it takes from its effect on both bodies. The arms, which keep the angular momentum, are not.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import CONTACT_MARGIN, ROUND_A, ROUND_B, SKELETON_A, SKELETON_B, in_play
from rigidimpulse.collision.manifold.dispatch import GENERAL, SEVERAL
from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.memory import reserve
from rigidimpulse.core.simd import ROW, aligned
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import turned_by
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import INVERSE_MASS

ARM_A, ARM_B, ARM_FIELDS = 0, 3, 6
"""Fields of three of the arms: from the centres of the bodies to O, m."""
NORMAL, TANGENT_1, TANGENT_2 = 0, 3, 6
"""Fields of three of the record: axes."""
SHARE, RADIUS_A, RADIUS_B, MU_STATIC, MU_DYNAMIC, DEPTH = 9, 10, 11, 12, 13, 14
"""How much of a's motion O makes; radii of rounded surfaces, m; coefficients; skin, m."""
STIFF, HARD, SOFT = 15, 16, 17
"""w / a_1 [1/s], a_2 a_3, a_3 of the spring."""
PUSH_1, PUSH_2, TWIST = 18, 19, 20
"""Friction impulse along the tangents, N s, and about n, N m s."""
STEP_T, STEP_N = 21, 22
"""1 / largest eigenvalue of the tangents' part of K, and of that about n."""
TO_NORMAL, TO_TURN_1, TO_TURN_2, TWIST_TO_1, TWIST_TO_2 = 23, 26, 29, 32, 33
"""How impulses (t_1, t_2, about n) change the speeds along n, about t_1 and about t_2 (three each); a twist those along t_1, t_2."""
BETWEEN = 34
"""How points push each other along n: 01, 02, 03, 12, 13, 23."""
POINT, POINT_SIZE = 40, 6
X, Y, GAP, MASS, PRESS, LEVER = 0, 1, 2, 3, 4, 5
"""First field of the points, and their fields: place, m; gap less contact margin, m; effective mass, 0: none; impulse; distance from O."""
FIELDS = POINT + 4 * POINT_SIZE
POINTS, LINES = 4, 3
"""Points of a patch at most; lines of 8 of a row of the pool."""
REGIONS = 2
"""Parts of the island, by the ranks of bodies: each processor works in one of them as long as it can."""
PATCHES_OF_A_BODY = 8
"""Patches of a body for which memory is reserved at first: it takes no real memory before it is written."""
COLOURS = 62
"""Patches that find no colour among these have a batch each."""
ONE_PATCH = 1.0 - TOLERANCES.sub_stepping.one_patch


class Patches(NamedTuple):
    """m patches of a step."""

    pair: np.ndarray  # (m,)
    row: np.ndarray  # (m, 4) rows of the pool
    size: np.ndarray  # (m,) points
    colour: np.ndarray  # (m,)
    slot: np.ndarray  # (m,) batch times W, and the lane


class Batches(NamedTuple):
    """b batches of W lanes."""

    record: np.ndarray  # (FIELDS b W,) single precision
    arm: np.ndarray  # (ARM_FIELDS b W,)
    first: np.ndarray  # (b W,) body a of each lane
    second: np.ndarray  # (b W,)
    row: np.ndarray  # (4 b W,) first line in the pool of the points of each lane, point by point; 0 for none
    points: np.ndarray  # (b,) most points of a lane


def empty_patches(m: int) -> Patches:
    """Arrays for m patches."""

    def numbers(*shape: int) -> np.ndarray:
        return reserve(shape, np.int32)

    return Patches(pair=numbers(m), row=numbers(m, POINTS), size=numbers(m), colour=numbers(m), slot=numbers(m))


def more_patches(patches: Patches, m: int) -> Patches:
    """A copy with a capacity of m patches."""
    out = empty_patches(m)
    for new, old in zip(out, patches, strict=True):
        new[: len(old)] = old
    return out


def more_batches(batches: Batches, b: int, width: int) -> Batches:
    """A copy with a capacity of b batches."""
    slots = b * width
    record, arm = aligned(-(-FIELDS * slots // (2 * ROW))).view(np.float32), aligned(-(-ARM_FIELDS * slots // ROW))
    first, second, row = reserve((slots,), np.int32), reserve((slots,), np.int32), reserve((POINTS * slots,), np.int32)
    out = Batches(record, arm, first, second, row, np.zeros(b, np.int32))
    for new, old in zip(out, batches, strict=True):
        new[: len(old)] = old
    return out


@jit_making_arrays
def list_patches(bodies, pairs, rows, patches, begin):
    """Write the patches of pairs in play of quick bodies from place `begin` on; returns their end, negative if above the capacity."""
    m = begin
    capacity, part, quick = patches.pair.shape[0], bodies.part, bodies.quick
    taken = np.zeros(64, np.bool_)
    for p in range(pairs.first.shape[0]):
        count = pairs.count[p]
        a, b = pairs.first[p], pairs.second[p]
        if count == 0 or not (quick[a] or quick[b]) or not in_play(part, a, b):
            continue
        start = pairs.start[p]
        if pairs.kind[p] != GENERAL and pairs.kind[p] != SEVERAL:
            if m < capacity:
                patches.pair[m], patches.size[m] = p, count
                for c in range(count):
                    patches.row[m, c] = start + c
            m += 1
            continue
        # Meshes and parts give points with several normals: a patch has one.
        if count > taken.shape[0]:
            taken = np.zeros(2 * count, np.bool_)
        taken[:count] = False
        for c in range(count):
            if taken[c]:
                continue
            size = 0
            for d in range(c, count):
                i, j = start + c, start + d
                cosine = rows[i, 0] * rows[j, 0] + rows[i, 1] * rows[j, 1] + rows[i, 2] * rows[j, 2]
                if size < POINTS and not taken[d] and (d == c or cosine > ONE_PATCH):
                    taken[d] = True
                    if m < capacity:
                        patches.row[m, size] = j
                    size += 1
            if m < capacity:
                patches.pair[m], patches.size[m] = p, size
            m += 1
    return m if m <= capacity else -m


@jit
def leave_out_quick(width, bodies, pairs, patches, count, batches):
    """Leave lanes of the first `count` patches idle where one of the bodies is quick."""
    idle, record = bodies.part.shape[0] - 1, batches.record
    for m in range(count):
        if not (bodies.quick[pairs.first[patches.pair[m]]] or bodies.quick[pairs.second[patches.pair[m]]]):
            continue
        s = patches.slot[m]
        k, lane = s // width, s % width
        o = k * FIELDS * width + lane
        batches.first[s] = batches.second[s] = idle
        for field in (PUSH_1, PUSH_2, TWIST, STEP_T, STEP_N):
            record[o + field * width] = 0.0
        for c in range(POINTS):
            batches.row[(POINTS * k + c) * width + lane] = 0
            g = o + (POINT + POINT_SIZE * c) * width
            record[g + MASS * width] = record[g + PRESS * width] = 0.0


@inlined
def _class_of(bodies, pairs, patches, m):
    """Place of patch m in its colour: by region, then by the number of its points."""
    a, b = pairs.first[patches.pair[m]], pairs.second[patches.pair[m]]
    i = a if bodies.mass[8 * a + INVERSE_MASS] > 0.0 else b
    return i * REGIONS // bodies.part.shape[0] * POINTS + POINTS - patches.size[m]


@jit_making_arrays
def colour_patches(width, bodies, pairs, patches, begin, count, batches, begins):
    """Colour the patches from `begin` to `count` and give them slots, after `batches` batches; begins (c+1,): where colours begin.

    Returns where their batches end, and the number of colours, minus that where `begins` is too small.
    """
    used = np.zeros(bodies.part.shape[0], np.int64)
    one, colours, crowded = np.int64(1), np.int64(0), np.int64(0)
    for m in range(begin, count):
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
    for m in range(begin, count):
        if patches.colour[m] >= COLOURS:
            patches.colour[m] += colours - COLOURS
    colours += crowded
    if colours + 1 > begins.shape[0]:
        return np.int64(0), -colours
    number = np.zeros((colours, REGIONS * POINTS), np.int64)
    for m in range(begin, count):
        number[patches.colour[m], _class_of(bodies, pairs, patches, m)] += 1
    for c in range(colours):
        begins[c] = batches
        place = batches * width
        for k in range(REGIONS * POINTS):
            here = number[c, k]
            number[c, k] = place
            place += here
        batches = (place + width - 1) // width
    begins[colours] = batches
    for m in range(begin, count):
        k = _class_of(bodies, pairs, patches, m)
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
def point_of(position, rotation, rows, r, ends, n, share):
    """Where the impulses of row r act, from the centre of a, and the gap less the contact margin, m; ends: bodies a and b."""
    (a, b), (nx, ny, nz) = ends, n
    ax, ay, az = turned_by(rotation, a, rows[r, SKELETON_A], rows[r, SKELETON_A + 1], rows[r, SKELETON_A + 2])
    bx, by, bz = turned_by(rotation, b, rows[r, SKELETON_B], rows[r, SKELETON_B + 1], rows[r, SKELETON_B + 2])
    bx += position[b, 0] - position[a, 0]
    by += position[b, 1] - position[a, 1]
    bz += position[b, 2] - position[a, 2]
    s, t = rows[r, ROUND_A], rows[r, ROUND_B]
    gap = nx * (bx - ax) + ny * (by - ay) + nz * (bz - az) - (s + t) - rows[r, CONTACT_MARGIN]
    rest = 1.0 - share
    x = share * (ax + s * nx) + rest * (bx - t * nx)
    y = share * (ay + s * ny) + rest * (by - t * ny)
    return x, y, share * (az + s * nz) + rest * (bz - t * nz), gap


@jit
def normal_of(position, rotation, rows, r, a, b, carrier):
    """The world normal of row r of bodies a and b; that of two rounded surfaces runs between their centres."""
    if rows[r, ROUND_A] > 0.0 and rows[r, ROUND_B] > 0.0:
        ax, ay, az = turned_by(rotation, a, rows[r, SKELETON_A], rows[r, SKELETON_A + 1], rows[r, SKELETON_A + 2])
        bx, by, bz = turned_by(rotation, b, rows[r, SKELETON_B], rows[r, SKELETON_B + 1], rows[r, SKELETON_B + 2])
        x = position[b, 0] + bx - position[a, 0] - ax
        y = position[b, 1] + by - position[a, 1] - ay
        z = position[b, 2] + bz - position[a, 2] - az
        length = sqrt(x * x + y * y + z * z)
        if length > 0.0:
            return x / length, y / length, z / length
    return turned_by(rotation, b if carrier else a, rows[r, 0], rows[r, 1], rows[r, 2])


@jit_making_arrays
def place_patches(width, bodies, pairs, patches, of_patches, batches, of_batches):
    """Put patches into their slots of batches; of_patches, of_batches: first and last + 1 of either."""
    (begin, count), (first, number) = of_patches, of_batches
    idle = bodies.part.shape[0] - 1
    batches.first[first * width : number * width] = batches.second[first * width : number * width] = idle
    batches.row[POINTS * first * width : POINTS * number * width] = 0
    batches.points[first:number] = 0
    for m in range(begin, count):
        p, s = patches.pair[m], patches.slot[m]
        k, lane = s // width, s % width
        batches.first[s], batches.second[s] = pairs.first[p], pairs.second[p]
        batches.points[k] = max(batches.points[k], patches.size[m])
        for c in range(patches.size[m]):
            batches.row[(POINTS * k + c) * width + lane] = LINES * patches.row[m, c]
