"""Rounds of the randomised greedy order (randomised.py), compiled.

Points taken stand in a grid of hashed cells, which is made anew with smaller ones whenever there
are twice as many. A candidate is let go as soon as it is known to be no farther than those that are
accepted anyway.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vegtool.surfels.blue.compiled import compiled

CELL = 1.0
"""Side of a cell, in distances accepted when the grid is made."""
RINGS = 8
"""Of cells that are looked at before all points are."""


@compiled
def rounds(points: Any, count: int, random: Any, sample: int, more_every: int) -> Any:
    """(k,) int32 of points (n, 3), k < count where only copies are left. 1 <= count <= n."""
    left = len(points)
    pool = np.empty(left, np.int32)
    for i in range(left):
        pool[i] = i
    taken, at, done = np.empty(count, np.int32), np.empty((count, 3)), 0
    slots = 1
    while slots < 2 * count:
        slots *= 2
    head, after = np.full(slots, -1, np.int32), np.empty(count, np.int32)
    cells, gridded = 0.0, 0  # cells to a metre
    drawn = np.empty((sample, 3))
    best, row = np.empty(sample), np.empty(sample, np.int64)
    gone = np.zeros(sample, np.bool_)
    number = 0
    while done < count and left > 0:
        many = min(sample, left) if done > 0 else 1
        most = min(1 + number // more_every, count - done)
        number += 1
        for i in range(many):  # without replacement: those drawn move to the front
            j = i + int(random.random() * (left - i))
            pool[i], pool[j] = pool[j], pool[i]
        for i in range(many):
            for k in range(3):
                drawn[i, k] = points[pool[i], k]

        accepted, least = 0, 0.0  # best, the squared distances of those accepted, falls
        for i in range(many):
            squared = _squared_distance(
                drawn[i, 0], drawn[i, 1], drawn[i, 2], at, done, cells, head, after, least
            )
            gone[i] = squared <= 0
            if squared <= least:
                continue
            place = min(accepted, most - 1)
            while place > 0 and best[place - 1] < squared:
                best[place], row[place] = best[place - 1], row[place - 1]
                place -= 1
            best[place], row[place] = squared, i
            accepted = min(accepted + 1, most)
            if accepted == most:
                least = best[most - 1]

        before = done
        for i in range(accepted):
            one, apart = drawn[row[i]], np.inf
            for j in range(before, done):
                apart = min(apart, _squared(one[0], one[1], one[2], at, j))
            least = best[accepted - 1]
            if apart >= least:
                at[done] = one
                taken[done] = pool[row[i]]
                done += 1
            gone[row[i]] = apart >= least or apart <= 0
        for i in range(many - 1, -1, -1):
            if gone[i]:
                left -= 1
                pool[i] = pool[left]

        if done >= 2 * gridded and before > 0 and done > before:
            cells = 1 / (CELL * np.sqrt(least))
            head[:] = -1
            gridded, before = done, 0
        for j in range(before, done):
            slot = _slot(
                int(np.floor(at[j, 0] * cells)),
                int(np.floor(at[j, 1] * cells)),
                int(np.floor(at[j, 2] * cells)),
                slots,
            )
            after[j] = head[slot]
            head[slot] = j
    return taken[:done]


@compiled
def _squared(x: float, y: float, z: float, at: Any, point: int) -> float:
    x, y, z = x - at[point, 0], y - at[point, 1], z - at[point, 2]
    return x * x + y * y + z * z


@compiled
def _slot(x: int, y: int, z: int, slots: int) -> int:
    """Of a hash table: Teschner et al., Optimized spatial hashing (2003)."""
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & (slots - 1)


@compiled
def _squared_distance(
    x: float,
    y: float,
    z: float,
    at: Any,
    done: int,
    cells: float,
    head: Any,
    after: Any,
    least: float,
) -> float:
    """To the nearest of those taken; anything that is no more than `least`, if that is no more."""
    nearest = np.inf
    u, v, w = int(np.floor(x * cells)), int(np.floor(y * cells)), int(np.floor(z * cells))
    for ring in range(RINGS if cells > 0 else 0):
        for i in range(u - ring, u + ring + 1):
            for j in range(v - ring, v + ring + 1):
                inner = ring > 0 and abs(i - u) < ring and abs(j - v) < ring
                for k in range(w - ring, w + ring + 1, 2 * ring if inner else 1):
                    point = head[_slot(i, j, k, len(head))]
                    while point >= 0:
                        squared = _squared(x, y, z, at, point)
                        nearest = squared if squared < nearest else nearest
                        point = after[point]
                    if nearest <= least:
                        return nearest
        if nearest <= (ring / cells) ** 2:
            return nearest
    for point in range(done):
        squared = _squared(x, y, z, at, point)
        nearest = squared if squared < nearest else nearest
    return nearest
