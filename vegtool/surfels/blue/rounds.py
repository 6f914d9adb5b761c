"""Rounds of the randomised greedy order, compiled.

Points taken stand in a grid of hashed cells, which is made anew with smaller ones whenever there are
twice as many. A candidate is let go as soon as it is known to be no farther than those that are
accepted anyway.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vegtool.surfels.blue.compiled import compiled

CELL = 1.0
"""Side of a cell, in distances of what is accepted when the grid is made."""
MOST = 1 << 20
"""Cells along an axis, at most."""


@compiled
def _slot(x: int, y: int, z: int, mask: int) -> int:
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & mask


@compiled
def rounds(
    points: Any, count: int, random: Any, sample: int, more_every: int, near: float
) -> Any:
    """(count,) int32 of points (n, 3) with coordinates from 0 to 1; 1 <= count <= n."""
    size = len(points)
    pool = np.arange(size).astype(np.int32)
    left = size
    taken = np.empty(count, np.int32)
    x, y, z = np.empty(count), np.empty(count), np.empty(count)
    slots = 1
    while slots < 2 * count:
        slots *= 2
    mask = slots - 1
    head = np.full(slots, -1, np.int32)
    after = np.empty(count, np.int32)
    done, gridded, cells = 0, 0, 1.0

    drawn = np.empty((3, sample))
    best = np.empty(sample)
    row = np.empty(sample, np.int64)
    gone = np.zeros(sample, np.bool_)
    number = 0
    while done < count and left > 0:
        most = min(1 + number // more_every, count - done)
        many = min(sample, left)
        if done == 0:
            many = most = 1
        number += 1
        for i in range(many):  # without replacement: those drawn move to the front
            j = i + int(random.random() * (left - i))
            pool[i], pool[j] = pool[j], pool[i]
        for i in range(many):
            for k in range(3):
                drawn[k, i] = points[pool[i], k]
            gone[i] = False

        accepted, least = 0, -1.0  # best[:accepted] fall; least is what a candidate has to exceed
        for i in range(many):
            px, py, pz = drawn[0, i], drawn[1, i], drawn[2, i]
            nearest = np.inf
            cx, cy, cz = int(px * cells), int(py * cells), int(pz * cells)
            ring = 0
            while done > 0:
                for ix in range(max(cx - ring, 0), min(cx + ring, int(cells)) + 1):
                    for iy in range(max(cy - ring, 0), min(cy + ring, int(cells)) + 1):
                        shell = abs(ix - cx) == ring or abs(iy - cy) == ring
                        step = 1 if shell or ring == 0 else 2 * ring
                        for iz in range(cz - ring, cz + ring + 1, step):
                            j = head[_slot(ix, iy, iz, mask)]
                            while j >= 0:
                                dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
                                nearest = min(nearest, dx * dx + dy * dy + dz * dz)
                                j = after[j]
                        if nearest <= least:
                            break
                    if nearest <= least:
                        break
                if nearest <= least or nearest <= (ring / cells) ** 2 or ring > cells:
                    break
                ring += 1
            if nearest <= least:
                gone[i] = nearest < near * near * least
                continue
            place = accepted if accepted < most else most - 1
            while place > 0 and best[place - 1] < nearest:
                best[place], row[place] = best[place - 1], row[place - 1]
                place -= 1
            best[place], row[place] = nearest, i
            accepted = min(accepted + 1, most)
            if accepted == most:
                least = best[most - 1]

        limit = best[accepted - 1]
        before = done
        for i in range(accepted):
            px, py, pz = drawn[0, row[i]], drawn[1, row[i]], drawn[2, row[i]]
            apart = np.inf
            for j in range(before, done):
                dx, dy, dz = x[j] - px, y[j] - py, z[j] - pz
                apart = min(apart, dx * dx + dy * dy + dz * dz)
            if apart >= limit:
                x[done], y[done], z[done] = px, py, pz
                taken[done] = pool[row[i]]
                done += 1
                gone[row[i]] = True
            else:
                gone[row[i]] = apart < near * near * limit
        for i in range(many - 1, -1, -1):
            if gone[i]:
                left -= 1
                pool[i] = pool[left]

        if done >= 2 * gridded:
            cells = max(1.0, min(np.floor(1 / (CELL * np.sqrt(limit))), float(MOST))) if limit > 0 else float(MOST)
            if before == 0:
                cells = 1.0
            head[:] = -1
            gridded, before = done, 0
        for j in range(before, done):
            slot = _slot(int(x[j] * cells), int(y[j] * cells), int(z[j] * cells), mask)
            after[j] = head[slot]
            head[slot] = j
    return taken[:done]
