"""What the command line shows a person: bars, tables, sentences on stderr; results on stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import Any

from vegtool.progress import Progress, silent

BAR_AFTER_SECONDS = 1.0
"""Work that is done sooner shows no bar."""


class Console:
    """Where a command prints: quiet (-q: errors only), normal, or verbose (-v)."""

    def __init__(self, verbosity: int = 0, as_json: bool = False) -> None:
        self.verbosity = verbosity
        self.as_json = as_json

    def say(self, text: str, at: int = 0) -> None:
        """A line for people, on stderr, from verbosity `at` on."""
        if self.verbosity >= at:
            print(text, file=sys.stderr)

    def result(self, value: Any, text: str) -> None:
        """The command's result on stdout: JSON for machines with --json, else text for people."""
        if self.as_json:
            print(json.dumps(value, indent=2))
        elif self.verbosity >= 0 and text:
            print(text)

    @contextmanager
    def bar(self, title: str) -> Iterator[Progress]:
        """A progress callback; a bar appears on a terminal once the work takes over a second."""
        if self.verbosity < 0 or not (sys.stderr and sys.stderr.isatty()):
            yield silent
            return
        from rich.console import Console as RichConsole
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bars
        from rich.table import Column

        what = Column(ratio=1, no_wrap=True, overflow="ellipsis")  # a long name is cut, no figure
        bars = Bars(
            TextColumn("{task.description}", markup=False, table_column=what),
            BarColumn(20),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("left", style="dim"),
            TimeRemainingColumn(),
            console=RichConsole(stderr=True),
            transient=True,
            expand=True,
        )
        task = bars.add_task(title, total=1.0)
        started, shown = monotonic(), False

        def report(stage: str, fraction: float) -> None:
            nonlocal shown
            if not shown and monotonic() - started > BAR_AFTER_SECONDS:
                bars.start()
                shown = True
            bars.update(task, completed=fraction, description=f"{title}  {stage}")

        try:
            yield report
        finally:
            if shown:
                bars.stop()


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Columns aligned with spaces: words to the left, numbers to the right."""
    cells = [[str(c) for c in row] for row in rows]
    widths = [max(len(c) for c in column) for column in zip(head, *cells, strict=True)]
    right = [
        bool(cells) and all(c[:1].isdigit() or c in ("", "-") for c in column)
        for column in zip(*cells, strict=True)
    ] or [False] * len(head)
    lines = []
    for row in [list(head), *cells]:
        parts = zip(row, widths, right, strict=True)
        lines.append("  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in parts).rstrip())
    return "\n".join(lines)


def human_bytes(count: float) -> str:
    """A number of bytes as a person says it: 512 B, 64 kB, 1.2 MB."""
    for unit in ("B", "kB", "MB"):
        if count < 1000 or unit == "MB":
            return f"{count:.0f} {unit}" if count >= 10 or unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    raise AssertionError
