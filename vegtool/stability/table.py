"""The table of the cases as Markdown, for a file and for a terminal alike."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from vegtool.stability.case import CaseResult

HEADING = """# Numerical stability

Made by `vegtool report --stability`. Every case holds an operation against an oracle: *exact*, an
answer that is known; *equivariance*, the objective (inertia, volume, error, coverage) of the same
plant moved, scaled or turned; *property*, the number of violations of what must hold. Errors are
relative. Far from the origin a tolerance grows with machine epsilon times offset over size, for no
more is known of a coordinate there.
"""
COLUMNS = ("case", "oracle", "error", "at most", "because", "rounds", "seconds", "")


def markdown(results: Sequence[CaseResult]) -> str:
    """A page: how many cases hold, then a table for each topic."""
    passed = sum(result.passed for result in results)
    seconds = sum(result.seconds for result in results)
    lines = [HEADING, f"{passed} of {len(results)} cases hold; {seconds:.0f} s in all."]
    for topic, group in groupby(results, key=lambda result: result.topic):
        lines += ["", f"## {topic.capitalize()}", _row(COLUMNS), _row(["---"] * len(COLUMNS))]
        for result in group:
            lines.append(_row(_cells(result)))
    return "\n".join(lines) + "\n"


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
