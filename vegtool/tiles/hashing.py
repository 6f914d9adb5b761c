"""Random numbers that depend on where a plant is in the world, and on nothing else.

The generator is splitmix64 (G. L. Steele Jr., D. Lea and C. H. Flood, "Fast splittable pseudorandom
number generators", OOPSLA 2014), in whose sequence any number can be computed without those before
it: the i-th after the state s is mix(s + (i + 1) GOLDEN). `numpy.random` has to be seeded for every
tile, or to draw all plants in order; here each plant has a sequence of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray

Hashes = npt.NDArray[np.uint64]

GOLDEN = 0x9E3779B97F4A7C15
MASK = 2**64 - 1


def key(seed: int, *numbers: int) -> int:
    """A state that depends on all of them, in their order; negative ones too."""
    state = _mix(seed + GOLDEN & MASK)
    for number in numbers:
        state = _mix((state ^ number & MASK) + GOLDEN & MASK)
    return state


def hashes(state: int | Hashes, index: npt.NDArray[np.integer[Any]]) -> Hashes:
    """(n,) uint64: of the sequence after `state`, one or (n,), the numbers at `index`, (n,)."""
    steps = (index.astype(np.uint64) + np.uint64(1)) * np.uint64(GOLDEN)
    return _mixed(np.asarray(state, dtype=np.uint64) + steps)


def draws(states: Hashes, count: int) -> FloatArray:
    """(count, n) float64 in [0, 1): of the sequence after each state, the first numbers."""
    steps = np.arange(1, count + 1, dtype=np.uint64)[:, None] * np.uint64(GOLDEN)
    return np.asarray((_mixed(states + steps) >> np.uint64(11)) * 2.0**-53)


def _mix(state: int) -> int:
    state = (state ^ state >> 30) * 0xBF58476D1CE4E5B9 & MASK
    state = (state ^ state >> 27) * 0x94D049BB133111EB & MASK
    return state ^ state >> 31


def _mixed(state: Hashes) -> Hashes:
    """_mix, of arrays: products of uint64 wrap."""
    state = (state ^ state >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ state >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return state ^ state >> np.uint64(31)
