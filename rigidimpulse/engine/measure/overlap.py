r"""Overlap at recorded frames, found by other means than those of the engine.

Frames are chosen evenly. In each, pairs of bodies are candidates whose boxes along the axes of the world overlap. Left out are pairs of
which neither body is dynamic then, those that a joint or a collision filter keeps apart, and those that stand as they did in the frame that
was chosen before. The depth of a candidate is a lower bound, see `depth`. A pair is in order if

    depth <= EXACT s        exact contacts
    depth <= SUB_STEPPED s  in a run with sub-stepped islands
    depth <= CHEAPEST s     the same with contact_solver="cheapest"
    s: size of the smaller body

Contacts of sub-stepped islands are soft: what is pressed hard is too deep for a few frames only. So more frames of such runs are looked
at, all of them where bodies are few.

Pairs that are deeper at the start are not looked at until they are in order for the first time: such an overlap is reported where the run
starts. Nothing is looked at where bodies are inside each other by the caller's choice: with `response="penalty"`, and with an `impact_time`
that is late.

The cost follows the numbers of parts of bodies and of frames that are looked at, never the clock: a run gives the same result on every
machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.engine.measure.depth import Posed, Probe, Solid, box_of, depth_in, probe_of, solid_of, surely_apart, whole_solid
from rigidimpulse.engine.measure.record import Fault, RunRecord
from rigidimpulse.model.world import World

KIND = "bodies inside each other"
EXACT: float = 1e-4
"""Depth, of the size of the smaller body, from which a run is not ok; contacts are held at gaps of some 1e-6."""
SUB_STEPPED: float = 1e-2
"""The same of runs with sub-stepped islands, whose contacts are soft."""
CHEAPEST: float = 2e-2
"""The same where sub-steps are as long as the cheapest regime makes them: a disc that is set spinning on a floor tilts by 1.2 % in one."""
FEWEST_FRAMES: int = 6
MOST_FRAMES, POSES = 24, 1200
"""Frames that are looked at: POSES over the number of all parts of bodies, within these bounds."""
MOST_SUB_STEPPED_FRAMES, SUB_STEPPED_POSES = 240, 1500
"""The same of runs with sub-stepped islands."""
LATE = ("linear", "after")
"""Settings of `Accuracy.impact_time` by which impacts are found too late, or missed."""
FEW: int = 24
"""Bodies up to which all pairs are compared at once."""
AT_ONCE: int = 2_000_000
"""Numbers that are computed at once."""
STEP: int = 8
"""Lengths of arrays that are used together are multiples of this."""
OF_EDGE: int = 8
"""Numbers for each end of an edge."""
REMEDY = "use a smaller step, or contact_solver='newton' where islands are sub-stepped"
"""Tried on letters that fall on a floor and are forced to be sub-stepped (`falling_letters` of the newcomers): 6.6 % inside at a step of
1/60 s, nothing at 1/240 s nor with "newton"."""


@dataclass(frozen=True, eq=False)
class Depths:
    """Depths of c candidates, those of a pair in order of time."""

    frame: np.ndarray  # (c,)
    a: np.ndarray  # (c,)
    b: np.ndarray  # (c,)
    depth: np.ndarray  # (c,) m
    size: np.ndarray  # (c,) m, of the smaller body


def overlap_faults(record: RunRecord) -> list[Fault]:
    """A fault for each pair that was too deep inside each other, with the frame at which it was deepest."""
    found, names = overlap_depths(record), record.world.names
    bound = _bound(record)
    deep = found.depth > bound * found.size
    if not deep.any():
        return []
    faults = []
    for pair in np.unique(np.column_stack([found.a, found.b])[deep], axis=0).tolist():
        mine = np.flatnonzero((found.a == pair[0]) & (found.b == pair[1]))
        if deep[mine[0]] and found.frame[mine[0]] == 0:
            # Deep where the run starts: from the first frame on in which it is in order.
            mine = mine[np.logical_or.accumulate(~deep[mine])]
        if not np.any(deep[mine]):
            continue
        worst = mine[int(np.argmax(found.depth[mine]))]
        depth, time = float(found.depth[worst]), float(record.frames.times[found.frame[worst]])
        share = depth / float(found.size[worst])
        text = f"the bodies are inside each other by {depth:.3g} m, {share:.2g} of the size of the smaller"
        faults.append(Fault(time, KIND, (names[pair[0]], names[pair[1]]), depth, f"{text}; {REMEDY}"))
    return faults


def _bound(record: RunRecord) -> float:
    """Depth, of the size of the smaller body, from which the run is not ok."""
    if not record.may_be_sub_stepped:
        return EXACT
    return CHEAPEST if record.world.accuracy.contact_solver == "cheapest" else SUB_STEPPED


def overlap_depths(record: RunRecord) -> Depths:
    """Depths of all candidates, see the head of the module."""
    world, found = record.world, _candidates(record)
    a, b = found.a, found.b
    size, depth = np.minimum(world.size[a], world.size[b]), np.zeros(len(a))
    if not len(a):
        return Depths(found.frame, a, b, depth, size)
    shapes, of, near = MeasuredShapes(world), world.shape_of_body, np.arange(len(a))
    both = [(of[a], of[b], found.a_in_b), (of[b], of[a], _other_way(found.a_in_b))]
    for mine, other, posed in both:
        near = near[~shapes.surely_apart(mine[near], other[near], posed.part(near))]
    for mine, other, posed in both:
        for probe, solid, those in shapes.kinds(mine, other, near):
            length = max(AT_ONCE // max(_work(probe, solid), 1), 1)
            for first in range(0, len(those), length):
                here = those[first : first + length]
                depth[here] = np.maximum(depth[here], depth_in(solid, probe, posed.part(here)))
    return Depths(found.frame, a, b, depth, size)


class MeasuredShapes:
    """Probes and solids of the shapes of a world, by their numbers."""

    def __init__(self, world: World) -> None:
        """Nothing is made before it is asked for."""
        self._world = world
        self._whole: dict[int, Solid] = {}

    def probe(self, shape: int) -> Probe:
        return probe_of(self._world.shapes[shape])

    def solid(self, shape: int) -> Solid:
        return solid_of(self._world.shapes[shape])

    def whole(self, shape: int) -> Solid:
        if shape not in self._whole:
            self._whole[shape] = whole_solid(self.solid(shape), self._world.shapes[shape], self._world.geometry, shape)
        return self._whole[shape]

    def kinds(self, mine: np.ndarray, other: np.ndarray, which: np.ndarray) -> Iterator[tuple[Probe, Solid, np.ndarray]]:
        """Probe and solid of each kind of the candidates `which`, and those of that kind; mine, other: (c,) shapes of all."""
        for probe, solid, those in _kinds(mine[which], other[which]):
            yield self.probe(probe), self.whole(solid), which[those]

    def surely_apart(self, mine: np.ndarray, other: np.ndarray, posed: Posed, allowed: np.ndarray | None = None) -> np.ndarray:
        """Which candidates (c,) are apart, see `depth.surely_apart`; mine, other: (c,) shapes. allowed: (c,) m, None for nothing.

        Those of alike numbers of corners and planes are asked about together: scenes of many shapes have few of each kind.
        """
        out = np.zeros(len(mine), bool)
        if not len(out):
            return out
        corners = _Padded({shape: self.probe(shape).corners for shape in _distinct(mine)})
        bounds = _Padded({shape: self.solid(shape).bounds for shape in _distinct(other)})
        for most_corners, most_bounds, those in _kinds(corners.size[mine], bounds.size[other]):
            length = max(AT_ONCE // max(most_corners * most_bounds, 1), 1)
            for first in range(0, len(those), length):
                here = those[first : first + length]
                depth = 0.0 if allowed is None else allowed[here]
                out[here] = surely_apart(corners.of(mine[here]), bounds.of(other[here]), posed.part(here), depth)
        return out


def _distinct(numbers: np.ndarray) -> list[int]:
    """The numbers >= 0 that there are, in order."""
    return np.flatnonzero(np.bincount(numbers)).tolist()


def _kinds(first: np.ndarray, second: np.ndarray) -> Iterator[tuple[int, int, np.ndarray]]:
    """Each pair of numbers of `first` and `second` (c,), in order, and the places at which it stands."""
    many = int(second.max(initial=0)) + 1
    pairs, number = np.unique(first * many + second, return_inverse=True)
    places, ends = np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))
    for k, pair in enumerate(pairs.tolist()):
        yield pair // many, pair % many, places[ends[k - 1] if k else 0 : ends[k]]


class _Padded:
    """Rows of arrays of several lengths, by their numbers: each is filled up to a multiple of STEP rows with its last one.

    Attributes:
        size: lengths, by number; 0 of what is not known.

    """

    def __init__(self, arrays: dict[int, np.ndarray]) -> None:
        self.size = np.zeros(max(arrays) + 1, np.int64)
        self._rows: dict[int, np.ndarray] = {}
        self._place = np.zeros(len(self.size), np.int64)
        for number, array in arrays.items():
            self.size[number] = STEP * -(-len(array) // STEP)
        for size in {int(self.size[number]) for number in arrays}:
            mine = [number for number in arrays if self.size[number] == size]
            self._place[mine] = np.arange(len(mine))
            self._rows[size] = np.stack([arrays[number][np.minimum(np.arange(size), len(arrays[number]) - 1)] for number in mine])

    def of(self, numbers: np.ndarray) -> np.ndarray:
        """The filled up arrays (k, size, ...) of numbers (k,) of one size."""
        return self._rows[int(self.size[numbers[0]])][self._place[numbers]]


def _work(probe: Probe, solid: Solid) -> int:
    """Numbers that a candidate takes: products of balls and faces of one part, and some for each end of an edge."""
    return len(probe.radii) * max([1, *map(len, solid.convex)]) + 2 * len(probe.edges) * OF_EDGE


def _other_way(posed: Posed) -> Posed:
    """Poses of the other shape's frame in that of the first."""
    return Posed(posed.rotation.swapaxes(1, 2), -np.einsum("cji,cj->ci", posed.rotation, posed.translation))


def frames_looked_at(record: RunRecord) -> np.ndarray:
    """Which frames are looked at, the first and the last included."""
    poses, most = (SUB_STEPPED_POSES, MOST_SUB_STEPPED_FRAMES) if record.may_be_sub_stepped else (POSES, MOST_FRAMES)
    world, number = record.world, len(record.frames.times)
    parts = int(np.diff(world.geometry.shape_first)[world.shape_of_body].sum())
    count = min(max(poses // parts, FEWEST_FRAMES), most, number)
    return np.unique(np.linspace(0, number - 1, count).astype(int))


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Pairs of bodies a < b that may be inside each other, c of them, frame by frame."""

    frame: np.ndarray  # (c,)
    a: np.ndarray  # (c,)
    b: np.ndarray  # (c,)
    a_in_b: Posed  # frames of bodies a in those of bodies b


def _candidates(record: RunRecord) -> _Candidates:
    """The candidates of a run."""
    frames, world = record.frames, record.world
    if not world.can_collide or world.accuracy.impact_time in LATE:
        none = np.zeros(0, np.int64)
        return _Candidates(none, none, none, Posed(np.zeros((0, 3, 3)), np.zeros((0, 3))))
    chosen = frames_looked_at(record)
    position, orientation = frames.position[chosen], frames.orientation[chosen]
    still = np.zeros(position.shape[:2], bool)
    still[1:] = np.all(position[1:] == position[:-1], axis=2) & np.all(orientation[1:] == orientation[:-1], axis=2)
    dynamic = np.logical_and(world.dynamic, frames.times[chosen, None] >= record.release)
    centre, half, endless = _boxes_of_bodies(world)
    rotation = to_matrix(orientation)
    middle = position + np.einsum("fnij,nj->fni", rotation, centre)
    reach = np.einsum("fnij,nj->fni", np.abs(rotation), half)
    reach[:, endless] = np.inf
    k, a, b = box_pairs(middle - reach, middle + reach)
    kept = (dynamic[k, a] | dynamic[k, b]) & ~(still[k, a] & still[k, b]) & ~world.is_apart(a, b)
    k, a, b = k[kept], a[kept], b[kept]
    into, apart = rotation[k, b], position[k, a] - position[k, b]
    in_b = Posed(np.einsum("cji,cjk->cik", into, rotation[k, a]), np.einsum("cji,cj->ci", into, apart))
    return _Candidates(chosen[k], a, b, in_b)


def _boxes_of_bodies(world: World) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles and half lengths (n, 3) m of boxes of bodies along their own axes, and which bodies (n,) have none."""
    low, high = (np.array(side).reshape(-1, 3) for side in zip(*map(box_of, world.shapes), strict=True))
    endless = np.any(np.isinf(high), axis=1)
    low[endless] = high[endless] = 0.0
    of = world.shape_of_body
    return 0.5 * (low + high)[of], 0.5 * (high - low)[of], endless[of]


def box_pairs(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frames, and pairs a < b, (k,) each, of boxes (f, n, 3) that overlap; frame by frame, in order of a and b."""
    count = low.shape[1]
    if count <= FEW:
        a, b = np.triu_indices(count, 1)
        frame, pair = np.nonzero(np.all((low[:, a] <= high[:, b]) & (low[:, b] <= high[:, a]), axis=2))
        return frame, a[pair], b[pair]
    found = [_pairs_along_axis(*boxes) for boxes in zip(low, high, strict=True)]
    frame = np.repeat(np.arange(len(found)), [len(pairs) for pairs in found])
    return frame, *np.concatenate(found).T


def _pairs_along_axis(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Pairs a < b (k, 2) of boxes (n, 3) that overlap, found along the axis on which the lower ends are spread most."""
    axis = int(np.argmax(np.ptp(low[np.isfinite(low[:, 0])], axis=0)))
    order = np.argsort(low[:, axis], kind="stable")
    last = np.searchsorted(low[order, axis], high[order, axis], side="right")
    count = np.maximum(last - np.arange(len(order)) - 1, 0)
    first = np.repeat(np.arange(len(order)), count)
    second = first + 1 + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    i, j = order[first], order[second]
    meets = np.all((low[i] <= high[j]) & (low[j] <= high[i]), axis=1)
    a, b = np.minimum(i, j)[meets], np.maximum(i, j)[meets]
    return np.column_stack([a, b])[np.lexsort((b, a))]
