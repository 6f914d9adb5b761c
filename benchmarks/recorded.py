"""What a benchmark found: rows in its file of results, text on its page."""

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


def written(page: Path, mark: str, text: str) -> None:
    """Put a text between the two marks of a page."""
    before, _, after = page.read_text(encoding="utf-8").split(mark)
    page.write_text(f"{before}{mark}\n\n{text}\n\n{mark}{after}", encoding="utf-8")


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Rows of the same columns as a table."""
    keys = list(rows[0])
    lines = [" | ".join(key.replace("_", " ") for key in keys), "|".join("---" for _ in keys)]
    lines += [" | ".join(_words(row[key]) for key in keys) for row in rows]
    return "\n".join(f"| {line} |" if "---" not in line else f"|{line}|" for line in lines)


def _words(value: Any) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)
