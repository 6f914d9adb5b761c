"""Numerical stability: cases, each with its oracle, what it measured, and what it may measure.

`run` runs them, `as_json` and `markdown` say what came of it; docs/stability.md is the latter, made
by `vegtool report --stability`. A topic is one module with a tuple `CASES`, and one line in
`TOPICS`.

Oracles: "exact" knows the answer, in rational numbers or by construction; "equivariance" takes the
same plant moved, scaled or turned and compares objectives, never axes or labels, which ties may
permute; "property" counts violations of what must hold, such as ending, never taking more than
asked, and giving the same result twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING

from vegtool.progress import Progress, silent
from vegtool.stability.case import CaseResult, run_case
from vegtool.stability.table import as_json, markdown

if TYPE_CHECKING:
    from vegtool.stability.case import Case

__all__ = ["CaseResult", "as_json", "cases", "markdown", "run"]

TOPICS = (
    "clustering", "iterations", "boxes", "branches", "baking", "convert", "cameras", "distances",
    "colour", "coverage", "light", "light_shadows", "light_levels", "governor",
    "size_control",
)  # fmt: skip
"""Modules of this room, in the order of the table."""


def cases() -> tuple[Case, ...]:
    """All cases, topic by topic; names are unique."""
    modules = [import_module(f"{__name__}.{topic}") for topic in TOPICS]
    return tuple(case for module in modules for case in module.CASES)


def run(progress: Progress = silent, names: Sequence[str] | None = None) -> list[CaseResult]:
    """Run the cases, or those of `names`.

    Raises CapabilityError where nothing can draw, and KeyError for a name that is no case.
    """
    chosen = cases()
    if names is not None:
        known = {case.name: case for case in chosen}
        chosen = tuple(known[name] for name in names)
    results = []
    for done, case in enumerate(chosen):
        progress(case.name, done / len(chosen))
        results.append(run_case(case))
    progress("stability", 1.0)
    return results
