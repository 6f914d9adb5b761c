"""Rows and reports made by hand, small enough to check."""

from __future__ import annotations

import numpy as np

from vegtool.measure.cost import Cost, FrameTime
from vegtool.measure.metrics import METRICS
from vegtool.report.rows import LIVE, PlantReport, Report, Row

PIXELS = (200.0, 50.0)


def row(
    name: str,
    family: str,
    budget: int | None = None,
    flip: tuple[float, float] = (0.1, 0.1),
    triangles: int = 10,
    frame_ms: float = 2.0,
    seconds: float = 1.0,
    plant: str = "oak",
) -> Row:
    """A row measured from two views, whose FLIP errors lie 0.01 to either side of `flip`."""
    values: dict[str, tuple[tuple[float, float], ...]]
    values = dict.fromkeys(METRICS, ((0.4, 0.6), (0.4, 0.6)))
    values["flip"] = tuple((f - 0.01, f + 0.01) for f in flip)
    frame = FrameTime(frame_ms, (frame_ms - 0.5, frame_ms + 0.5), 30, "llvmpipe")
    making = {"clustering": seconds / 2, "draw": seconds / 2} if seconds else {}
    cost = Cost(triangles, triangles // 2, 1000, 5000, 1, 1.5, frame, making, 300.0)
    bounds = (2.5, 0.6) if budget else ()
    return Row(
        plant,
        name,
        family,
        budget,
        cost,
        80.0 if budget else None,
        PIXELS,
        (10.0, 40.0),
        values,
        projection_px=bounds,
        bound_px=bounds,
        texel_px=bounds,
    )


def plant_report(name: str = "oak", worse: float = 0.0) -> PlantReport:
    """Live, one method with two budgets, and two baselines; `worse` is added to every error."""
    pixel = np.full((2, 2, 3), 90, np.uint8).tobytes()
    rows = (
        row(LIVE, LIVE, None, (0.06 + worse, 0.17 + worse), 10_000, 20.0, 0.0, name),
        row("kmeans 64", "kmeans", 64, (0.10 + worse, 0.08 + worse), 128, 4.0, 0.5, name),
        row("kmeans 16", "kmeans", 16, (0.15 + worse, 0.11 + worse), 32, 2.0, 0.25, name),
        row("crossed", "crossed", None, (0.19 + worse, 0.12 + worse), 4, 2.0, 0.4, name),
        row("octahedral", "octahedral", None, (0.05 + worse, 0.07 + worse), 2, 1.0, 9.0, name),
    )
    pictures = {"truth": {200: (pixel,)}, "kmeans 64": {200: (pixel, pixel)}}
    return PlantReport(name, f"{name}.glb", 10_000, 12.0, ("a note <of> it",), rows, pictures)


def report(*plants: PlantReport) -> Report:
    return Report(plants, {"view_count": 2, "views": "all"}, "0.0", "llvmpipe & co")
