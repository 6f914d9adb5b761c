"""The files of a report: report.json for programs, report.csv for tables, report.html to read."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from typing import Any

from vegtool.errors import OutputError
from vegtool.formats.atomic import FileSet, check_free
from vegtool.report.page import page
from vegtool.report.rows import Report, Row, as_json
from vegtool.report.summary import medians

FILES = ("report.json", "report.csv", "report.html")
VERSION = 1
"""Of report.json: one more when a reader of the last one would misread it."""


def check_folder(folder: Path, force: bool, inputs: Iterable[Path]) -> None:
    """Raise OutputError where the report may not be written: asked before the work."""
    there = folder / FILES[0]
    if there.is_file() and not force:
        of = _plants_of(there)
        raise OutputError(
            f"{folder}: a report{of} stands here. Overwrite it with -f, or choose another folder "
            "with -o."
        )
    check_free(folder, FILES, force, inputs)


def write(report: Report, folder: Path, force: bool, inputs: Iterable[Path]) -> list[Path]:
    """Write the three files, all or none. Raises OutputError as FileSet does."""
    contents = (json.dumps(encoded(report)), csv_text(report), page(report))
    with FileSet(folder, force, inputs) as files:
        for name, text in zip(FILES, contents, strict=True):
            files.add(name, text.encode(errors="backslashreplace"))  # names that are no Unicode
        return files.paths


def encoded(report: Report) -> dict[str, Any]:
    """All of a report but its pictures, as plain values."""
    plants = [
        {
            "name": plant.name,
            "source": plant.source,
            "triangles": plant.triangles,
            "extent_m": plant.extent_m,
            "notes": list(plant.notes),
            "rows": [_row(row) for row in plant.rows],
        }
        for plant in report.plants
    ]
    several = len(report.plants) > 1
    return {
        "version": VERSION,
        "tool_version": report.version,
        "renderer": report.renderer,
        "options": dict(report.options),
        "plants": plants,
        "medians": [asdict(p) for p in medians(report.plants)] if several else [],
        "failed": dict(report.failed),
    }


def _row(row: Row) -> dict[str, Any]:
    """A row with its errors' spread over views beside the values of every view."""
    spreads = {
        metric: [asdict(row.spread(metric, i)) for i in range(len(row.pixels))]
        for metric in row.values
    }
    return {**as_json(row), "errors": spreads}


def csv_text(report: Report) -> str:
    """A line per plant, row and size: what it costs, then every metric with its spread."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    lines = [
        _line(row, i)
        for plant in report.plants
        for row in plant.rows
        for i in range(len(row.pixels))
    ]
    writer.writerow(lines[0])
    writer.writerows(line.values() for line in lines)
    return stream.getvalue()


def _line(row: Row, index: int) -> dict[str, Any]:
    errors = {
        f"{metric}_{name}": f"{value:.6g}"
        for metric in row.values
        for name, value in asdict(row.spread(metric, index)).items()
    }
    cost = row.cost
    return {
        "plant": row.plant,
        "row": row.name,
        "family": row.family,
        "budget": row.budget,
        "pixels": f"{row.pixels[index]:g}",
        "distance_m": f"{row.distance_m[index]:.6g}",
        "switch_distance_m": row.switch_distance_m,
        "triangles": cost.triangles,
        "billboards": cost.billboards,
        "texels": cost.texels,
        "bytes": cost.bytes,
        "draw_calls": cost.draw_calls,
        "fragments_per_pixel": cost.fragments_per_pixel,
        "seconds": f"{row.bake_seconds:.6g}",
        "frame_ms": f"{cost.frame.median_ms:.6g}",
        "frame_q1_ms": f"{cost.frame.quartiles_ms[0]:.6g}",
        "frame_q3_ms": f"{cost.frame.quartiles_ms[1]:.6g}",
        "peak_mb": cost.peak_mb,
        **errors,
    }


def _plants_of(path: Path) -> str:
    """ " of oak, pine", or nothing where the file says nothing of the kind."""
    try:
        names = [plant["name"] for plant in json.loads(path.read_text(encoding="utf-8"))["plants"]]
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return f" of {', '.join(names[:5])}{', ...' if len(names) > 5 else ''}" if names else ""
