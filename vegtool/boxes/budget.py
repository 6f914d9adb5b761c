"""As many clusters as a budget of billboards pays for.

Crossed shapes take two or three billboards per cluster, so the number of clusters that a budget
covers is known only once their boxes are. Clustering is the expensive part: it is asked a few
times at most, and a small excess is met by showing the flattest clusters on one plane.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes.billboards import (
    cluster_boxes,
    cut_planes,
    planes_per_box,
    ratio,
    shown_shares,
)
from vegtool.boxes.box import Boxes
from vegtool.boxes.options import BoxOptions, PlaneFit, Shape
from vegtool.errors import UsageError
from vegtool.lod import Billboards
from vegtool.plant import Plant

MAX_CALLS = 3
"""Clusterings tried at most."""
SLACK = 0.1
"""Fraction of the budget that may be missed, or trimmed, without another clustering."""
USUAL_PLANES: dict[tuple[Shape, PlaneFit], float] = {
    ("single", "volume"): 1.0,
    ("single", "orientation"): 1.0,
    ("auto", "volume"): 3.0,
    ("auto", "orientation"): 1.02,
    ("crossed", "volume"): 3.0,
    ("crossed", "orientation"): 3.0,
}
"""Planes per cluster of real trees: where the search for the number of clusters starts."""

Attempt = tuple[IntArray, Boxes, FloatArray, IntArray]
"""Labels, boxes, shown shares, planes per box."""


def fit_budget(
    plant: Plant,
    cluster_fn: Callable[[int], IntArray],
    budget: int,
    options: BoxOptions | None = None,
) -> tuple[IntArray, Billboards]:
    """Labels (f,) and their billboards, never more than `budget` of them.

    cluster_fn: given a number of clusters, returns the label of each face, 0 to at most that
    number less one. It may return fewer clusters, so the budget may be missed; else nine tenths of
    it are used, or what the best of MAX_CALLS clusterings takes. Raises UsageError for a budget
    below one billboard.
    """
    options = options or BoxOptions()
    if budget < 1:
        raise UsageError(f"expected a budget of at least 1 billboard, got {budget}")
    tried: dict[int, Attempt] = {}
    asked = max(round(budget / USUAL_PLANES[options.shape, options.plane]), 1)
    while asked not in tried and len(tried) < MAX_CALLS:
        labels = cluster_fn(asked)
        boxes = cluster_boxes(plant, labels, int(labels.max()) + 1, options)
        shown = shown_shares(plant, labels, boxes)
        planes = planes_per_box(boxes, shown, options)
        tried[asked] = labels, boxes, shown, planes
        total = int(planes.sum())
        if affordable(planes, budget, options) and total >= (1 - SLACK) * budget:
            break
        asked = min(max(int(asked * budget / total), 1), budget)

    def preference(attempt: Attempt) -> tuple[bool, int]:
        planes = attempt[-1]
        return affordable(planes, budget, options), -abs(budget - int(planes.sum()))

    labels, boxes, shown, planes = max(tried.values(), key=preference)
    planes = trimmed(boxes, planes, budget, options)
    return labels, cut_planes(plant, labels, boxes, planes, shown, options)


def affordable(planes: IntArray, budget: int, options: BoxOptions) -> bool:
    """Whether a little trimming, which leaves crossed shapes crossed, meets the budget."""
    least = np.minimum(planes, 2 if options.shape == "crossed" else 1).sum()
    return bool(planes.sum() <= (1 + SLACK) * budget and least <= budget)


def trimmed(boxes: Boxes, planes: IntArray, budget: int, options: BoxOptions) -> IntArray:
    """`planes` (k,) with as few taken away as brings their sum down to the budget.

    Where every cluster is to be crossed, the thinnest boxes give up their third plane first;
    then the flattest are shown on one.
    """
    longest, middle, least = boxes.half.T
    if options.shape == "crossed":
        planes = lowered(planes, 2, ratio(middle, longest), budget)
    planes = lowered(planes, 1, ratio(least, middle), budget)
    if planes.sum() > budget:
        raise ValueError(f"cluster_fn: expected at most {budget} clusters, got {len(boxes)}")
    return planes


def lowered(planes: IntArray, to: int, form: FloatArray, budget: int) -> IntArray:
    """`planes` with those of the least `form` lowered to `to`, until the budget is met."""
    order = np.argsort(form, kind="stable")
    saved = np.maximum(planes[order] - to, 0)
    spent = np.cumsum(saved) - saved
    chosen = order[spent < planes.sum() - budget]
    result = planes.copy()
    result[chosen] = np.minimum(planes[chosen], to)
    return result
