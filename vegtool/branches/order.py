"""The file's order as a hint: leaves that follow each other hang on one branch more often than not.

Generators write a branch's leaves one after another, whether they walk the tree depth-first (as in
Colditz et al. 2005, section 2) or level by level; so no order of branches has to be guessed. Where
the anchors alone say the same, a leaf that stands out among its neighbours in the file goes with
them, if that costs it little. (Iterated conditional modes: Besag 1986, "On the statistical analysis
of dirty pictures".) Leaves that touch their branch stay, and a shuffled file gives no hints.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.axes import Axes

NEIGHBOURS = 6  # leaves before and after that have a say
SAY = 15.0  # what they can outweigh, if all agree, in median costs of a leaf
KEPT = 0.3  # of all pairs in sequence hang on one tube, or else the order means nothing
ROUNDS = 8


def follow_order(anchors: FloatArray, tube: np.ndarray, cost: FloatArray, axes: Axes) -> np.ndarray:
    """The tubes (n,) of leaves in the file's order, those that stand out corrected.

    anchors: (n, 3). cost: (n,) of hanging each leaf on its tube, as Axes.cost.
    """
    n = len(tube)
    if n <= 2 * NEIGHBOURS or (tube[1:] == tube[:-1]).mean() < KEPT:
        return tube
    tube, cost = tube.copy(), cost.copy()
    window = np.delete(np.arange(2 * NEIGHBOURS + 1), NEIGHBOURS)
    say = SAY * float(np.median(cost)) / len(window)
    for _ in range(ROUNDS):
        padded = np.pad(tube, NEIGHBOURS, mode="reflect")
        agree = np.zeros(n, dtype=np.int64)
        for shift in window:
            agree += padded[shift : shift + n] == tube
        rows = np.flatnonzero(2 * agree < len(window))
        other, votes = _most_frequent(padded[rows[:, None] + window])
        gain = cost[rows] + say * (votes - agree[rows])
        rows, other = rows[gain > 0], other[gain > 0]
        price = axes.cost_to_tube(anchors[rows], other)
        better = (price < gain[gain > 0]) & (other != tube[rows])
        rows = rows[better]
        if not len(rows):
            break
        tube[rows], cost[rows] = other[better], price[better]
    return tube


def _most_frequent(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) the most frequent label in each row of (n, k), the least of several, and its count."""
    count = (labels[:, :, None] == labels[:, None, :]).sum(axis=2)
    best = np.lexsort((labels, -count), axis=1)[:, 0]
    row = np.arange(len(labels))
    return labels[row, best], count[row, best]
