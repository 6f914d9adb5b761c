"""Branches numbered depth-first, as the triangles of a plant are stored.

C. Colditz, "Multi resolution representations of large scale vegetation" (2005), section 2, has the
triangles of a branch and its sub-branches in one piece: a branch comes before its children, and
the children one after the other with all that grows on them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vegtool.arrays import IntArray


def number_branches(
    parents: Sequence[IntArray], drawn: Sequence[np.ndarray]
) -> tuple[list[IntArray], IntArray, IntArray]:
    """Numbers for the drawn stems, depth-first.

    parents: per level (n,) index into the level above. drawn: per level (n,) bool; whose parent is
    not drawn is not either. Returns per level (n,) int32 the branch of each stem, that of its
    nearest drawn ancestor where it is not drawn itself; then parent (b,) and level (b,) int32.
    """
    sizes = [mask.astype(np.int64) for mask in drawn]  # drawn stems in the subtree
    for level in range(len(parents) - 1, 0, -1):
        below = np.bincount(parents[level], sizes[level], len(sizes[level - 1]))
        sizes[level - 1] = sizes[level - 1] + below.astype(np.int64)
    numbers: list[IntArray] = []
    parent_of = np.full(int(sizes[0].sum()), -1, np.int32)
    level_of = np.zeros(len(parent_of), np.int32)
    for level, (parent, mask, size) in enumerate(zip(parents, drawn, sizes, strict=True)):
        before = np.cumsum(size) - size
        if level == 0:
            number = before
        else:
            first = np.searchsorted(parent, parent)  # each stem's eldest sibling
            above = numbers[level - 1][parent]
            number = np.where(mask, above + 1 + before - before[first], above)
            parent_of[number[mask]] = above[mask]
            level_of[number[mask]] = level
        numbers.append(number.astype(np.int32))
    return numbers, parent_of, level_of
