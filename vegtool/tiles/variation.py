"""What tells plants of a kind apart: where they face, how tall and what colour they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vegtool.arrays import FloatArray, IntArray, SingleArray
from vegtool.scene import SpeciesTable

DRAWS = 4
"""Random numbers that a plant's variation takes."""
BRIGHTNESS = 0.1
"""How far a plant may be brighter or darker than its model, as a share of it."""
WARMTH = 0.04
"""How far it may be redder and less blue, or the other way round."""


def yaws(draws: FloatArray) -> SingleArray:
    """(n,) radians, 0 to 2 pi, from draws (DRAWS, n)."""
    return np.asarray(2 * np.pi * draws[0], dtype=np.float32)


def tints(draws: FloatArray) -> SingleArray:
    """(n, 3) linear factors from draws (DRAWS, n): brighter or darker, warmer or colder."""
    brightness = 1 + BRIGHTNESS * (2 * draws[1] - 1)
    warmth = WARMTH * (2 * draws[2] - 1)
    colour = np.stack([1 + warmth, np.ones_like(warmth), 1 - warmth], axis=1)
    return np.asarray(brightness[:, None] * colour, dtype=np.float32)


def heights(draws: FloatArray, species: IntArray, table: Sequence[SpeciesTable]) -> SingleArray:
    """(n,) metres from draws (DRAWS, n), anywhere between a kind's least and greatest; NaN, the
    model's own, where the scene does not say them."""
    ranges = np.array([kind.height_m or (np.nan, np.nan) for kind in table])
    low, high = ranges[species].T
    return np.asarray(low + draws[3] * (high - low), dtype=np.float32)
