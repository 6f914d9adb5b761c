"""What conversions came to, in few words: for the terminal, and as JSON for programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vegtool.batch import Outcome
from vegtool.console import human_bytes, table


def as_summary(outcomes: Sequence[Outcome], notes: Sequence[str] = ()) -> list[dict[str, Any]]:
    """What `--json` prints. notes: sentences that hold for each of them, beside their own."""
    return [
        {
            "source": str(outcome.job.source),
            "files": outcome.files,
            "levels": list(outcome.levels),
            "shadow": outcome.shadow,
            "notes": [*notes, *outcome.notes],
            "misses": list(outcome.misses),
            "seconds": round(outcome.seconds, 3),
            "error": outcome.error,
        }
        for outcome in outcomes
    ]


def summary_text(outcomes: Sequence[Outcome], dry_run: bool) -> str:
    """The same for a person: a table of levels and the files of each plant that was converted."""
    return "\n\n".join(_block(outcome, dry_run) for outcome in outcomes if not outcome.error)


def _block(outcome: Outcome, dry_run: bool) -> str:
    hidden = (
        {"seconds"} if any(row["surfels"] for row in outcome.levels) else {"seconds", "surfels"}
    )
    shown = [{k: v for k, v in row.items() if k not in hidden} for row in outcome.levels]
    rows = [[_cell(v) for v in row.values()] for row in shown]
    head = [name.replace("_", " ") for name in shown[0]]
    total = human_bytes(sum(outcome.files.values()))
    title = f"{outcome.job.name}: {outcome.seconds:.1f} s, {total}"
    title += " would be written" if dry_run else ""
    files = [f"  {path}  {human_bytes(size)}" for path, size in outcome.files.items()]
    return "\n".join([title, table(head, rows), *_shadow_line(outcome.shadow), *files])


def _shadow_line(row: dict[str, Any] | None) -> list[str]:
    """What is said of that which throws the shadow, where there is something."""
    if row is None:
        return []
    return [
        f"shadow: {row['triangles']:,} triangles; seen from {row['suns']} suns, {row['pixels']:g} "
        f"pixels large, coverage bias {row['coverage_bias']:+.1%} "
        f"({row['worst_coverage_bias']:+.1%} at worst), silhouette error {row['silhouette']} "
        f"(live {row['live_silhouette']})"
    ]


def _cell(value: Any) -> str:
    """A figure as a person reads it; what there is none of is empty."""
    if value is None:
        return ""
    return f"{value:,}" if isinstance(value, int) else str(value)
