"""Rows of a benchmark, appended to its file of results."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"


def record(name: str, rows: Sequence[dict[str, Any]]) -> None:
    """Append rows of the same columns to results/NAME.csv, which is begun where it is missing."""
    path = RESULTS / f"{name}.csv"
    begun = path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        if not begun:
            writer.writeheader()
        writer.writerows(rows)
