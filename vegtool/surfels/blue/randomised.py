"""The randomised greedy order of the paper, which ours is compared with.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.2. Those accepted in a round are compared with one
another too: one that is nearer to another than the least distance accepted goes back. The paper
lets samples near to what is taken be dropped for good. Here only copies are: more makes distances
no better by any measurable amount, and ends orders of most of the candidates early.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.seeding import generator
from vegtool.surfels.blue.places import asked, places

SAMPLE = 200
"""Candidates looked at in a round."""
MORE_EVERY = 500
"""Rounds after which one more is accepted in each: k."""


def randomised_order(positions: FloatArray, count: int, *, seed: int = 0) -> IntArray:
    """(k,) int32 candidates, k <= count: fewer where only copies of them are left.

    positions: (n, 3) metres. Raises UsageError for a negative number, ValueError for an array of
    another shape.
    """
    at = places(positions)
    count = asked(count, len(at))
    if count == 0:
        return np.zeros(0, np.int32)
    from vegtool.surfels.blue.rounds import rounds

    random = generator(seed, "randomised greedy order")
    return np.asarray(rounds(at, count, random, SAMPLE, MORE_EVERY))
