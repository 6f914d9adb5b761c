"""What several plants say together, and what none of the others beats."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.lod import Spread
from vegtool.measure.scores import spread
from vegtool.report.rows import LIVE, PlantReport, Row


@dataclass(frozen=True)
class Point:
    """One row of one plant, or the medians of that row over plants, as numbers to plot.

    plants: how many of them. errors: by metric, one per size (`pixels`): of one plant the mean and
    its spread over views, of several the median of the means in place of the mean, and their spread
    over plants. switch_distance_m: of one plant, as in Row.
    """

    name: str
    family: str
    budget: int | None
    plants: int
    triangles: float
    billboards: float
    draw_calls: float
    texels: float
    texture_bytes: float
    bytes: float | None
    fragments_per_pixel: float | None
    bake_seconds: float
    frame_ms: float
    frame_quartiles_ms: tuple[float, float]
    frame_ratio: float
    peak_mb: float | None
    switch_distance_m: float | None
    why_not: str
    pixels: tuple[float, ...]
    errors: dict[str, tuple[Spread, ...]]


TEXEL_BYTES = 4
"""Of a texel as a client holds it, uncompressed."""

COSTS: dict[str, Callable[[Row], float | None]] = {
    "triangles": lambda row: row.cost.triangles,
    "billboards": lambda row: row.cost.billboards,
    "draw_calls": lambda row: row.cost.draw_calls,
    "texels": lambda row: row.cost.texels,
    "texture_bytes": lambda row: TEXEL_BYTES * row.cost.texels,
    "bytes": lambda row: row.cost.bytes,
    "fragments_per_pixel": lambda row: row.cost.fragments_per_pixel,
    "bake_seconds": lambda row: row.bake_seconds,
    "frame_ms": lambda row: row.cost.frame.median_ms,
    "peak_mb": lambda row: row.cost.peak_mb,
}
"""Numbers of a row whose medians are taken; of several, over those that have one."""


def points(plant: PlantReport) -> list[Point]:
    """The rows of one plant."""
    return medians([plant])


def medians(plants: Sequence[PlantReport]) -> list[Point]:
    """For each row that any plant has, medians over the plants that have it, in order.

    Only of the sizes that all were measured at.
    """
    found: dict[str, list[tuple[Row, float]]] = {}
    for plant in plants:
        live = next(row for row in plant.rows if row.name == LIVE)
        for row in plant.rows:
            ratio = row.cost.frame.median_ms / live.cost.frame.median_ms
            found.setdefault(row.name, []).append((row, ratio))
    sizes = [set(row.pixels) for rows in found.values() for row, _ in rows]
    shared = sorted(set.intersection(*sizes), reverse=True) if sizes else []
    return [
        _point([row for row, _ in rows], [ratio for _, ratio in rows], tuple(shared))
        for rows in found.values()
    ]


def _point(rows: list[Row], ratios: list[float], pixels: tuple[float, ...]) -> Point:
    first = rows[0]
    middle: dict[str, Any] = {name: _median(map(of, rows)) for name, of in COSTS.items()}
    low, high = np.median([row.cost.frame.quartiles_ms for row in rows], axis=0)
    return Point(
        first.name,
        first.family,
        first.budget,
        len(rows),
        frame_quartiles_ms=(float(low), float(high)),
        frame_ratio=float(np.median(ratios)),
        switch_distance_m=first.switch_distance_m if len(rows) == 1 else None,
        why_not=first.why_not,
        pixels=pixels,
        errors={
            metric: tuple(_over(rows, metric, size) for size in pixels) for metric in first.values
        },
        **middle,
    )


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _over(rows: list[Row], metric: str, size: float) -> Spread:
    if len(rows) == 1:
        return rows[0].spread(metric, rows[0].pixels.index(size))
    means = np.array([row.mean(metric)[row.pixels.index(size)] for row in rows])
    found = spread(means)
    return Spread(float(np.median(means)), found.sd, found.low, found.high)


def pareto(points: npt.ArrayLike) -> list[int]:
    """Indices of the points (n, 2), costs and errors, that none beats in both, cheapest first.

    A point is beaten by one that is no dearer and no worse, and better in one of them; of equal
    points the first stays.
    """
    costs, errors = np.asarray(points, np.float64).reshape(-1, 2).T
    front: list[int] = []
    for i in np.lexsort((np.arange(len(costs)), errors, costs)):
        if not front or errors[i] < errors[front[-1]]:
            front.append(int(i))
    return front


def families(points: Iterable[Point]) -> list[str]:
    """Their families, in the order in which they come."""
    return list(dict.fromkeys(point.family for point in points))
