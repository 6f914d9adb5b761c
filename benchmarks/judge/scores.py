"""How far photographs are from the truth's."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log

import flip_evaluator
import numpy as np

from judge.photographs import Pictures
from vegtool.arrays import FloatArray
from vegtool.measure.metrics import LUMINANCE

BACKGROUND = np.array([0.47, 0.55, 0.63], np.float32)
"""sRGB; mixed as encoded, as a browser lays a canvas over its page."""
MARGIN = 4
"""Pixels kept around what truth and picture cover."""


@dataclass(frozen=True)
class Score:
    """Means over the views.

    flip: FLIP (Andersson et al. 2020) on the crop around the plant, 0 to 1. coverage: more (or,
    negative, less) is covered than in the truth, as a share of that. color: the same of the mean
    linear luminance of what is covered. silhouette: mean difference of coverage, pixel by pixel,
    as a share of the truth's.
    """

    flip: float
    coverage: float
    color: float
    silhouette: float


def score(truth: Pictures, test: Pictures) -> Score:
    """The means over all views."""
    return Score(*map(float, each(truth, test).mean(axis=0)))


def each(truth: Pictures, test: Pictures) -> FloatArray:
    """(v, 4) the figures of `Score`, view by view."""
    return np.array([_view(truth, test, i) for i in range(len(truth.coverage))])


def over_background(pictures: Pictures, view: int) -> np.ndarray:
    """(SIZE, SIZE, 3) float32: what is seen from one view, as encoded."""
    gap = 1 - pictures.coverage[view, ..., None]
    return np.asarray(pictures.color[view] + BACKGROUND * gap)


def _view(truth: Pictures, test: Pictures, i: int) -> tuple[float, float, float, float]:
    true, shown = truth.coverage[i].astype(float), test.coverage[i].astype(float)
    y, x = np.nonzero((true > 0) | (shown > 0))
    crop = np.s_[
        max(y.min() - MARGIN, 0) : y.max() + MARGIN + 1,
        max(x.min() - MARGIN, 0) : x.max() + MARGIN + 1,
    ]
    pair = (over_background(p, i)[crop] for p in (truth, test))
    flip = flip_evaluator.evaluate(*map(np.ascontiguousarray, pair), "LDR", applyMagma=False)[1]
    luminance = [
        float(p.light[i].astype(float).sum(axis=(0, 1)) @ LUMINANCE) / max(cover.sum(), 1e-9)
        for p, cover in ((truth, true), (test, shown))
    ]
    return (
        float(flip),
        shown.sum() / true.sum() - 1,
        luminance[1] / luminance[0] - 1,
        np.abs(true - shown).sum() / true.sum(),
    )


def geometric_mean(values: list[float]) -> float:
    """Of positive numbers; 0 of none."""
    return exp(sum(map(log, values)) / len(values)) if values else 0.0
