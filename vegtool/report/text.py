"""The report in few words: for the terminal, and as JSON for programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vegtool.console import table
from vegtool.report.rows import Report
from vegtool.report.summary import Point, medians, points
from vegtool.report.write import FILES


def as_summary(report: Report, folder: Path) -> dict[str, Any]:
    """What `--json` prints: the files, and for each plant, and over all, a line per row."""
    found = {plant.name: points(plant) for plant in report.plants}
    return {
        "files": [str(folder / name) for name in FILES] if report.plants else [],
        "plants": {name: [_brief(point) for point in each] for name, each in found.items()},
        "medians": [_brief(point) for point in medians(report.plants)],
        "failed": dict(report.failed),
    }


def _brief(point: Point) -> dict[str, Any]:
    return {
        "row": point.name,
        "family": point.family,
        "budget": point.budget,
        "triangles": point.triangles,
        "texels": point.texels,
        "seconds": round(point.bake_seconds, 4),
        "frame_ms": round(point.frame_ms, 4),
        "switch_distance_m": point.switch_distance_m,
        "flip": {
            f"{size:g}": {"mean": round(error.mean, 5), "sd": round(error.sd, 5)}
            for size, error in zip(point.pixels, point.errors["flip"], strict=True)
        },
    }


def summary_text(report: Report, folder: Path) -> str:
    """The same for a person: of the only plant, or medians over several."""
    if not report.plants:
        return ""
    of = (
        report.plants[0].name
        if len(report.plants) == 1
        else f"{len(report.plants)} plants, medians"
    )
    found = medians(report.plants)
    sizes = found[0].pixels
    head = ("row", "triangles", *(f"{size:g} px" for size in sizes), "seconds", "frame ms")
    rows = [
        (
            point.name,
            f"{point.triangles:,.0f}",
            *(f"{e.mean:.3f} ±{e.sd:.3f}" for e in point.errors["flip"]),
            f"{point.bake_seconds:.2f}",
            f"{point.frame_ms:.1f}",
        )
        for point in found
    ]
    return "\n".join([f"{of}: FLIP", table(head, rows), "", str(folder / FILES[-1])])
