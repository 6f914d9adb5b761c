"""What came of the cases: as Markdown, for a file and a terminal alike, and as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby
from math import isfinite
from typing import Any

from vegtool.stability.case import CaseResult

HEADING = """# Numerical stability

Made by `vegtool report --stability`. Every case holds an operation against an oracle: *exact*, an
answer that is known; *equivariance*, the objective (inertia, volume, error, coverage) of the same
plant moved, scaled or turned; *property*, the number of violations of what must hold. Errors are
relative. Far from the origin a tolerance grows with machine epsilon times offset over size, for no
more is known of a coordinate there.

## Limits

- Clusters, boxes and errors are those of the plant wherever it stands. 5,000 km from the origin,
  where positions are known to 1e-9 metres, clusters of plants full of exact ties (lattices, perfect
  rings) may differ by some per cent in their inertia.
- The search for boxes stops within 2 % of the shortest side. Boxes of flat clusters, and of those
  that spread alike along two axes, are turned further, onto exact rectangles.
- Texels and distances go by the longest extent along an axis, so a turned plant is sampled more or
  less finely, and its coverage differs by what sampling differs.
- The GPU holds positions in single precision about the plant's middle, in units of its radius.
  Moved and scaled plants are drawn alike to the bit. A turned one rounds elsewhere, so a sample on
  an edge may fall to its other side; and what is 1e4 times smaller than the plant is drawn to about
  a thousandth of its own size.
- A camera's near plane is at least a thousandth as far as its far plane; what is nearer is cut off.
- A leaf does not shadow itself where the sun stands 0.3 degrees above it or more. Lower, it hides
  part of the sun's own disc, whose half is 0.265 degrees. A soft shadow is the mean of eight sharp
  ones, and within 0.21 of the share of the disc that is seen.
- The size of surfels that holds a rate goes on moving where times leave 0.9 to 1.1 targets by
  themselves, or jump across them at some size: by a quarter of what they are off.
- Normals of a file that are of no length or no number are replaced and counted as it is read;
  `tests/formats/test_read_normals.py` has those cases, for nothing here opens files.
"""
COLUMNS = ("case", "oracle", "error", "at most", "because", "rounds", "seconds", "note")


def markdown(results: Sequence[CaseResult]) -> str:
    """A page: how many cases hold, then a table for each topic."""
    passed = sum(result.passed for result in results)
    seconds = sum(result.seconds for result in results)
    lines = [HEADING, "## Cases", "", f"{passed} of {len(results)} hold; {seconds:.0f} s in all."]
    for topic, group in groupby(results, key=lambda result: result.topic):
        lines += ["", f"## {topic.capitalize()}", "", _row(COLUMNS), _row(["---"] * len(COLUMNS))]
        for result in group:
            lines.append(_row(_cells(result)))
    return "\n".join(lines) + "\n"


def as_json(results: Sequence[CaseResult]) -> list[dict[str, Any]]:
    """The rows as plain values; the error of a case that raised is None."""
    return [
        {**asdict(result), "error": result.error if isfinite(result.error) else None}
        for result in results
    ]


def _cells(result: CaseResult) -> list[str]:
    return [
        result.name if result.passed else f"**{result.name}: fails**",
        result.oracle,
        f"{result.error:.1e}" if result.error else "0",
        f"{result.tolerance:.1e}" if result.tolerance else "0",
        result.reason,
        "" if result.iterations is None else str(result.iterations),
        f"{result.seconds:.2f}",
        result.note,
    ]


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |"
