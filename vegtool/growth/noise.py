"""Gradient noise at scattered points. K. Perlin, "Improving noise", SIGGRAPH 2002."""

from __future__ import annotations

from itertools import product

import numpy as np

from vegtool.arrays import FloatArray, unit

TABLE = 4096  # lattice points with a gradient of their own


def gradient_noise(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(n,) values of about -1 to 1 at points (n, d); features are one unit of length wide."""
    dimension = points.shape[1]
    gradients = unit(rng.normal(size=(TABLE, dimension)))
    shuffled = rng.permutation(TABLE)
    cell = np.floor(points).astype(np.int64)
    place = points - cell
    fade = place**3 * (place * (place * 6 - 15) + 10)
    total = np.zeros(len(points))
    for corner in product((0, 1), repeat=dimension):
        number = np.zeros(len(points), np.int64)
        weight = np.ones(len(points))
        for axis, step in enumerate(corner):
            number = shuffled[(number + cell[:, axis] + step) % TABLE]
            weight *= fade[:, axis] if step else 1 - fade[:, axis]
        total += weight * np.einsum("ij,ij->i", gradients[number], place - np.array(corner))
    return np.asarray(total * (2 / np.sqrt(dimension)))


def octaves(points: FloatArray, count: int, gain: float, rng: np.random.Generator) -> FloatArray:
    """(n,) sum of `count` noises, each twice as fine and `gain` times as strong as the last."""
    total = np.zeros(len(points))
    for octave in range(count):
        # Away from the lattice of the octave before, where all noises are zero together.
        shifted = points * 2.0**octave + rng.uniform(0, 100, points.shape[1])
        total += gain**octave * gradient_noise(shifted, rng)
    return total
