"""Bytes spread over species where they gain most: by seen error for each byte, not evenly.

Everett: Generalized Lagrange multiplier method for solving problems of optimum allocation of
resources (1963). Of all that can be kept of a species what lies on the lower convex hull of bytes
and error is looked at first; steps along the hulls, taken in the order of what each gains per byte,
spend any budget as well as can be, but for the last step. What that leaves goes to whatever else
fits and gains most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.errors import UsageError
from vegtool.needs.planar import BoolArray

MOST_LEVELS = 16
"""Of a species: all sets of them are looked at."""


@dataclass(frozen=True, eq=False)
class Choices:
    """What may be kept of a species, dearer and dearer, each with less error than the last.

    kept: (m, n) bool, of its n levels. bytes: (m,) int64, ascending. error: (m,) seen error,
    descending: of all pixels that are seen of the species, their error added up. hull: (h,) int32
    those that lie on the lower convex hull, the first and the last among them.
    """

    kept: BoolArray
    bytes: IntArray
    error: FloatArray
    hull: IntArray

    def __len__(self) -> int:
        return len(self.bytes)


def choices(
    bytes: IntArray, start_m: FloatArray, error: FloatArray, at_m: FloatArray, pixels: FloatArray
) -> Choices:
    """What may be kept of a species.

    bytes: (n,) of each level's file. start_m: (n,) metres from where each may be used, ascending
    from 0. error: (n, k) of each level where it is drawn at distances at_m, (k,) metres. pixels:
    (k,) of the species, that are seen at these. Of levels that are kept, that is drawn at a
    distance which may be used there and begins last, or else the first. Raises ValueError for more
    than MOST_LEVELS.
    """
    size = np.asarray(bytes, np.int64)
    count = len(size)
    if not 0 < count <= MOST_LEVELS:
        raise ValueError(f"choices: expected 1 to {MOST_LEVELS} levels; got {count}")
    start = checked("start_m", start_m, (count,), np.float64)
    at = checked("at_m", at_m, (None,), np.float64)
    wrong = checked("error", error, (count, len(at)), np.float64)
    weight = checked("pixels", pixels, (len(at),), np.float64)
    sets = (np.arange(1, 1 << count)[:, None] >> np.arange(count)) & 1 == 1
    drawn = np.repeat(sets.argmax(axis=1)[:, None], len(at), axis=1)
    for level in range(count):
        drawn = np.where(sets[:, level, None] & (start[level] <= at), level, drawn)
    seen = (wrong[drawn, np.arange(len(at))] * weight).sum(axis=1)
    total = sets @ size
    order = np.lexsort((seen, total))
    better = np.minimum.accumulate(seen[order])
    row = order[np.diff(better, prepend=np.inf) < 0]  # nothing that costs less errs less
    return Choices(sets[row], total[row], seen[row], _hull(total[row], seen[row]))


def _hull(size: IntArray, error: FloatArray) -> IntArray:
    """Rows of the lower convex hull of what costs more and more, and errs less and less."""
    found: list[int] = []
    for row in range(len(size)):
        while len(found) > 1 and _slope(size, error, found[-2], found[-1]) >= _slope(
            size, error, found[-1], row
        ):
            found.pop()
        found.append(row)
    return np.array(found, np.int32)


def _slope(size: IntArray, error: FloatArray, one: int, other: int) -> float:
    return float(error[other] - error[one]) / float(size[other] - size[one])


def spread(some: Sequence[Choices], budget: int) -> IntArray:
    """(s,) int32 which of each species' choices to make, that all fit into so many bytes.

    Steps are taken by what they gain per byte; one that does not fit ends its species' way, and
    others go on. Raises UsageError where the cheapest do not fit.
    """
    left = budget - _least(some, budget)
    steps = [
        (_slope(one.bytes, one.error, before, after), species, before, after)
        for species, one in enumerate(some)
        for before, after in pairwise(one.hull.tolist())
    ]
    made = np.zeros(len(some), np.int32)
    for _, species, before, after in sorted(steps):
        cost = int(some[species].bytes[after] - some[species].bytes[before])
        if made[species] == before and cost <= left:
            made[species], left = after, left - cost
    while True:
        gains = [_fitting(one, int(at), left) for one, at in zip(some, made, strict=True)]
        species = int(np.argmax([gain for gain, _ in gains]))
        if not gains[species][0] > 0:
            return made
        after = gains[species][1]
        left -= int(some[species].bytes[after] - some[species].bytes[made[species]])
        made[species] = after


def _fitting(one: Choices, at: int, left: int) -> tuple[float, int]:
    """What the best choice that so many more bytes pay for gains, and which it is."""
    after = int(np.searchsorted(one.bytes, one.bytes[at] + left, "right")) - 1
    return float(one.error[at] - one.error[after]), after


def _least(some: Sequence[Choices], budget: int) -> int:
    least = sum(int(one.bytes[0]) for one in some)
    if least > budget:
        raise UsageError(
            f"expected a budget of {least:,} bytes at least, which the coarsest levels of all "
            f"{len(some)} species have; got {budget:,}"
        )
    return least


def evenly(some: Sequence[Choices], budget: int) -> IntArray:
    """(s,) int32 the best of each species' choices that fits into an equal part of a budget: what
    `spread` is compared with. The cheapest, where none does."""
    part = budget // max(len(some), 1)
    return np.array(
        [max(int(np.searchsorted(one.bytes, part, "right")) - 1, 0) for one in some], np.int32
    )
