"""Whatever goes round in circles: it ends, takes no more than was asked, and leaves little over."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from math import inf

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.baking.bake import fit
from vegtool.baking.coverage import PASS, covered_blocks, passing, thresholds
from vegtool.boxes import BoxOptions, fit_budget
from vegtool.boxes.budget import MAX_CALLS
from vegtool.boxes.fit import TURNS_PER_STEP, box_sides, jitter
from vegtool.boxes.options import Shape
from vegtool.clustering import METHODS, ClusterOptions, cluster
from vegtool.clustering.features import coarse, samples
from vegtool.clustering.lines import lines, merge_collinear, move, split_wide
from vegtool.clustering.partition import error, lloyd, split
from vegtool.seeding import generator
from vegtool.stability.case import Case, Outcome, exact, holds
from vegtool.stability.clustering import duplicates
from vegtool.stability.plants import rotation, soup, tree

CROSSED_ROUNDS = 60
"""Times clusters are split and merged again."""


def lloyd_settles() -> Outcome:
    """k-means from a bad start, one round at a time: the error never grows, and it ends."""
    few = coarse(samples(tree(), 0.0, 60), 60)
    labels = np.arange(len(few.points)) % 60
    errors = [error(few.points, few.weights, labels)]
    while len(errors) < 500:
        moved = lloyd(few.points, few.weights, labels, 1, 60)
        if np.array_equal(moved, labels):
            break
        labels = moved
        errors.append(error(few.points, few.weights, labels))
    grew = sum(b > a * (1 + 1e-12) for a, b in pairwise(errors))
    left = [f"{errors[min(i, len(errors) - 1)] / errors[-1] - 1:.1e} after {i}" for i in (10, 40)]
    return holds(
        grew + (len(errors) == 500),
        "ends, and the error never grows",
        len(errors) - 1,
        "residual " + ", ".join(left),
    )


def more_clusters_than_points(method: str) -> Outcome:
    """Fifty clusters asked of four distinct faces: four, each of one point, so no error is left."""
    plant = soup(duplicates()[:4000])
    labels = cluster(plant, method, 50)
    spread = sum(
        float(np.ptp(plant.face_centroids[labels == k], axis=0).max())
        for k in range(labels.max() + 1)
    )
    return exact(spread + abs(int(labels.max()) + 1 - 4))


def split_and_merge(elongation: float) -> Outcome:
    """ISODATA that splits to twice the count and merges back for ever: thresholds that cross.

    The command's own rounds exchange less and less, so they end; here the exchange stays whole.
    Its error may wander, but not away, and no more clusters are left than were asked for.
    """
    count, gain = 60, 1 - 1 / elongation**2
    few = coarse(samples(tree(), 0.0, count), count)
    points, weights = few.points, few.weights
    labels = split(points, weights, np.zeros(len(points), dtype=np.int64), count)
    errors, wrong = [], 0
    for _ in range(CROSSED_ROUNDS):
        labels = split_wide(points, weights, move(points, weights, labels, gain), gain, 2 * count)
        wrong += int(labels.max()) + 1 > 2 * count
        labels = merge_collinear(points, weights, move(points, weights, labels, gain), gain, count)
        wrong += int(labels.max()) + 1 > count
        errors.append(float(lines(points, weights, labels, gain).error.sum()))
    late = errors[CROSSED_ROUNDS // 2 :]
    wrong += max(late) > 1.1 * errors[0]
    note = f"error wanders by {max(late) / min(late) - 1:.1%}, best {min(errors) / errors[0]:.3f}"
    return holds(wrong, "never more than asked, never 10 % worse", CROSSED_ROUNDS, note)


def extreme_options(elongation: float, weight: float) -> Outcome:
    """ISODATA with the largest options it takes: the count is met, the same one twice."""
    options = ClusterOptions(orientation_weight=weight, elongation=elongation)
    labels = [cluster(tree(), "isodata", 60, options, seed=seed) for seed in (0, 1)]
    wrong = (int(labels[0].max()) + 1 != 60) + (not np.array_equal(labels[0], labels[1]))
    return holds(wrong, "60 clusters, twice the same")


def jitter_at_its_limit() -> Outcome:
    """A box 45 degrees off, turned by steps of a ten thousandth of a degree: the steps run out.

    It has turned by no more steps than are allowed, and every one has made it smaller.
    """
    step = 1e-4
    points = (generator(0, "stability", "jitter").uniform(-1, 1, (1, 200, 3)) * [1, 0.5, 0.2]) / 2
    start = rotation(1)
    turned = start[None].copy()
    sides = box_sides(turned[:, None], points)[:, 0]
    before = float(sides.prod())
    jitter(turned, sides, points, step, np.arange(1))
    cosine = np.clip((np.trace(turned[0] @ start.T) - 1) / 2, -1, 1)
    steps = float(np.degrees(np.arccos(cosine))) / step
    wrong = (steps > 3**0.5 * TURNS_PER_STEP * (1 + 1e-3)) + (float(sides.prod()) > before)
    note = f"volume {float(sides.prod()) / before:.6f} of the start's"
    return holds(
        wrong, f"at most {TURNS_PER_STEP} turns, never larger", round(steps / 3**0.5), note
    )


class Asked:
    """A clustering that is asked how many clusters it gives, and may be stubborn about it."""

    def __init__(self, gives: str) -> None:
        self.gives = gives
        self.calls: list[int] = []
        self.rank = np.argsort(np.argsort(tree().face_centroids[:, 1]))

    def __call__(self, count: int) -> IntArray:
        self.calls.append(count)
        if self.gives == "few":
            count = min(count, 3)
        elif self.gives == "now many, now few":
            count = count if len(self.calls) % 2 else max(1, count // 4)
        elif self.gives == "one":
            count = 1
        return (self.rank * count // len(self.rank)).astype(np.int32)


def budget_search(gives: str, shape: Shape) -> Outcome:
    """The search for the number of clusters that a budget pays for: few calls, no overshoot."""
    wrong, most, shares = 0, 0, []
    for budget in (1, 2, 3, 7, 22, 67, 200):
        asked = Asked(gives)
        labels, billboards = fit_budget(tree(), asked, budget, BoxOptions(shape=shape))
        wrong += len(billboards) > budget
        wrong += len(asked.calls) > MAX_CALLS
        wrong += not np.array_equal(np.unique(billboards.cluster), np.unique(labels))
        most = max(most, len(asked.calls))
        shares.append(len(billboards) / budget)
    note = f"{min(shares):.0%} to {max(shares):.0%} of the budget"
    return holds(wrong, f"never above the budget, at most {MAX_CALLS} calls", most, note)


SIZES: dict[str, tuple[FloatArray, float]] = {
    "one square": (np.array([[1.0, 1.0]]), 1.0),
    "a needle of aspect 1e6": (np.array([[1.0, 1e-6]]), 1.0),
    "1,000 equal squares": (np.full((1000, 2), 0.1), 0.1),
    "one 1e4 times larger than 300 others": (
        np.concatenate([[[1.0, 1.0]], np.full((300, 2), 1e-4)]),
        1.0,
    ),
    "1e-6 times the size": (np.array([[1e-6, 1e-6]]), 1e-6),
    "1e6 times the size": (np.array([[1e6, 1e6]]), 1e6),
}
"""Half sides of pictures in metres, and the largest."""


def density_search(half: FloatArray, largest: float, texels: float) -> Outcome:
    """Pictures asked for at far too many texels: as many as fit, and no fewer than the last step.

    Residual: the density reached, against the bound that the longest side and the area set.
    """
    gutter, most = 2, 1024
    asked = texels / (2 * largest)
    packing, density = fit(half, asked, gutter, most)
    area = most**2 / (4 * half.prod(axis=1).sum())
    bound = min((most - 2 * gutter) / (2 * largest), area**0.5, asked)
    low, high = packing.rect[:, :2], packing.rect[:, :2] + packing.rect[:, 2:]
    inside = packing.width <= most and packing.height <= most and bool((low >= gutter).all())
    inside &= bool((high + gutter <= [packing.width, packing.height]).all())
    note = f"{density / bound:.1%} of what could fit; {texels:.0e} texels a side asked"
    return Outcome(
        max(1 - density / bound, 0.0) if inside and density <= asked else inf,
        0.25,
        "packing wastes less than this, and is never larger than allowed",
        note=note,
    )


BLOCKS: dict[str, FloatArray] = {
    "nothing covered": np.zeros((8, 8)),
    "all covered": np.full((8, 8), 255.0),
    "all alike": np.full((8, 8), 127.0),
    "faint": np.full((8, 8), 1.0),
    "every value once": np.arange(64.0).reshape(8, 8) * 4,
    "noise": generator(0, "stability", "alpha").integers(0, 256, (8, 8)).astype(np.float64),
}
"""Alpha of a picture of 8 x 8 texels."""


def coverage_search(alpha: FloatArray) -> Outcome:
    """The threshold that bisection finds, against all: none comes nearer the coverage."""
    image = alpha.astype(np.uint8)
    blocks = covered_blocks(image, np.zeros(image.shape, dtype=np.int32))
    wanted = float(image.sum()) / 255

    def miss(threshold: int) -> float:
        return abs(float(passing(blocks, np.array([threshold]))[0]) - wanted)

    found = miss(int(thresholds(blocks, 1)[0]))
    best = min(miss(t) for t in range(1, 256))
    note = f"misses {found:.2f} of {wanted:.2f} texels; the test alone {miss(PASS):.2f}"
    return Outcome((found - best) / 64, 1e-9, "the best of 255 thresholds", 8, note)


SEARCHES: tuple[tuple[Shape, str], ...] = (
    ("auto", "what is asked"),
    ("crossed", "what is asked"),
    ("single", "what is asked"),
    ("auto", "few"),
    ("auto", "now many, now few"),
    ("crossed", "one"),
)
"""Shapes asked for, and what the clustering gives."""

CASES = (
    Case("k-means: moving until nothing moves", "iterations", "property", lloyd_settles),
    *(
        Case(f"{method}: 50 clusters of 4 distinct points", "iterations", "exact",
             partial(more_clusters_than_points, method))
        for method in METHODS
    ),
    *(
        Case(f"isodata: split and merge cross, elongation {value:g}", "iterations", "property",
             partial(split_and_merge, value))
        for value in (1.0, 2.0, 1e3)
    ),
    *(
        Case(f"isodata: elongation {long:g}, orientation weight {weight:g}", "iterations",
             "property", partial(extreme_options, long, weight))
        for long, weight in ((1e3, 0.0), (1.0, 1e3), (1e3, 1e3))
    ),
    Case("boxes: turning until the steps run out", "iterations", "property", jitter_at_its_limit),
    *(
        Case(f"budget: {shape}, a clustering that gives {gives}", "iterations", "property",
             partial(budget_search, gives, shape))
        for shape, gives in SEARCHES
    ),
    *(
        Case(f"packing: {name}, {texels:.0e} texels", "iterations", "property",
             partial(density_search, half, largest, texels))
        for name, (half, largest) in SIZES.items()
        for texels in (1e5, 1e12)
    ),
    *(
        Case(f"coverage: {name}", "iterations", "exact", partial(coverage_search, alpha))
        for name, alpha in BLOCKS.items()
    ),
)  # fmt: skip
