"""Rows of results and tables of the page, of what was measured of progressive blue surfels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from blue.orders import SIZES, Order, Orders
from blue.plate import Sides
from blue.prefixes import MODELS, PREFIXES, Scores
from vegtool.arrays import FloatArray

Rows = list[dict[str, Any]]
RENDER_MS, SET_UP_MS = 12, 82
"""The paper's, table 2: of the eight pictures, and of 1.75 million candidates of them."""
SAMPLING_MS = {10_000: 105, 50_000: 311, 100_000: 592}
"""The paper's, of so many points."""
STRAWMAN = 3.0
"""Times the paper's, that our own making of its order takes at most."""
ASKED = {10_000: (0.7, 1.1, 1.0), 50_000: (0.7, 1.1, 1.0), 100_000: (1.1, 1.0, 1.0)}
"""Of ours beside the paper's order: time at most, least and median distance at least."""


def order_rows(found: Orders) -> Rows:
    """A row for each method and size; milliseconds of processor time."""
    seen = found.pictured
    return [
        {
            "points": one.points,
            "order": one.method,
            "candidates": len(seen.found),
            "resolution": seen.resolution,
            **_spent("render", seen.render_ms),
            **_spent("set_up", seen.set_up_ms),
            **_spent("sampling", one.cpu_ms),
            "sampling_wall_ms": round(float(np.median(one.wall_ms)), 1),
            "theirs_ms": SAMPLING_MS[one.points],
        }
        for one in found.all
    ]


def _spent(what: str, ms: FloatArray) -> dict[str, float]:
    return {
        f"{what}_ms": round(float(np.median(ms)), 1),
        f"{what}_least": round(float(ms.min()), 1),
        f"{what}_most": round(float(ms.max()), 1),
    }


def order_table(found: Orders) -> Rows:
    """The paper's table 2 and ours, size by size."""
    seen, rows = found.pictured, []
    before = float(np.median(seen.render_ms) + np.median(seen.set_up_ms))
    for points in SIZES:
        theirs = SAMPLING_MS[points]
        rows.append(
            {
                "points": points,
                "order": "the paper's, as printed",
                "render": RENDER_MS,
                "set up": SET_UP_MS,
                "sampling": theirs,
                "of the paper's order": "",
                "in all": RENDER_MS + SET_UP_MS + theirs,
            }
        )
        for name, one in found.of(points).items():
            part = np.median(one.cpu_ms) / np.median(found.of(points)["randomised"].cpu_ms)
            rows.append(
                {
                    "points": points,
                    "order": name,
                    "render": spread(seen.render_ms),
                    "set up": spread(seen.set_up_ms),
                    "sampling": spread(one.cpu_ms),
                    "of the paper's order": f"{part:.2f}",
                    "in all": f"{before + np.median(one.cpu_ms):.0f}",
                }
            )
    return rows


def spread(ms: FloatArray) -> str:
    """Median, least and most."""
    return f"{np.median(ms):.0f} ({ms.min():.0f} to {ms.max():.0f})"


def distance_rows(found: Orders) -> Rows:
    return [
        {
            "points": one.points,
            "prefix": prefix,
            "order": one.method,
            "least": round(float(one.least[i]), 4),
            "median": round(float(one.median[i]), 4),
        }
        for one in found.all
        for i, prefix in enumerate(one.prefixes)
    ]


def distance_table(found: Orders) -> Rows:
    """A row for each prefix: least and median of every method."""
    rows = []
    for points in SIZES:
        some = found.of(points)
        for i, prefix in enumerate(next(iter(some.values())).prefixes):
            row: dict[str, Any] = {"points": points, "prefix": prefix}
            for what in ("least", "median"):
                for name, one in some.items():
                    row[f"{what}: {name}"] = f"{getattr(one, what)[i]:.3f}"
            rows.append(row)
    return rows


def picture_rows(found: Sequence[Scores]) -> Rows:
    return [
        {
            "model": one.model,
            "order": one.order,
            "points": one.points,
            "disc_px": round(one.disc_px, 2),
            **{key: round(value, 4) for key, value in one.means.items()},
        }
        for one in found
    ]


def picture_table(found: Sequence[Scores]) -> Rows:
    """A row for each model and prefix: errors of every order."""
    at = {(one.model, one.points, one.order): one for one in found}
    names = list(dict.fromkeys(one.order for one in found))
    rows = []
    for model in MODELS:
        for points in PREFIXES:
            some = [at[model, points, name] for name in names]
            row: dict[str, Any] = {"model": model, "points": points}
            row["disc, px"] = f"{some[0].disc_px:.1f}"
            for key in ("flip", "ssim"):
                for name, one in zip(names, some, strict=True):
                    row[f"{key}: {name}"] = f"{one.means[key]:.3f}"
            rows.append(row)
    return rows


def plate_rows(found: Sequence[Sides]) -> Rows:
    return [
        {
            "points": one.points,
            "normal_weight_m": one.normal_weight_m,
            **_spent("sampling", one.cpu_ms),
            "hole_m": round(float(np.median(one.hole_m)), 5),
        }
        for one in found
    ]


def plate_table(found: Sequence[Sides]) -> Rows:
    return [
        {
            "points": one.points,
            "weight of normals, m": f"{one.normal_weight_m:g}",
            "sampling, ms": spread(one.cpu_ms),
            "largest hole, mm": f"{1e3 * np.median(one.hole_m):.1f}",
        }
        for one in found
    ]


def missed(found: Orders) -> list[str]:
    """What was asked and not reached, a sentence each."""
    said = []
    for points in SIZES:
        some, theirs = found.of(points), SAMPLING_MS[points]
        asked, least, median = ASKED[points]
        ours, paper = some["ours"], some["randomised"]
        part = np.median(ours.cpu_ms) / np.median(paper.cpu_ms)
        if part > asked:
            said.append(f"{points:,}: time is {part:.2f} times, not {asked}")
        if np.median(paper.cpu_ms) > STRAWMAN * theirs:
            said.append(
                f"{points:,}: the paper's order takes over {STRAWMAN} times its {theirs} ms"
            )
        said += _uneven(ours, paper, "least", least) + _uneven(ours, paper, "median", median)
    return said


def _uneven(ours: Order, paper: Order, what: str, asked: float) -> list[str]:
    ratios = getattr(ours, what) / getattr(paper, what)
    return [
        f"{ours.points:,}: {what} distance at {prefix:,} is {ratio:.3f} times, not {asked}"
        for prefix, ratio in zip(ours.prefixes, ratios, strict=True)
        if ratio < asked
    ]
