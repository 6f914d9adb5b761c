"""What `vegtool plan` does."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from math import degrees, inf, pi
from pathlib import Path
from typing import Any

from vegtool.console import human_bytes, table
from vegtool.formats.atomic import FileSet, check_free
from vegtool.needs.need import Need
from vegtool.plan.plan import TOLD, Plan, as_dict, plan_of
from vegtool.plan.spend import Spent
from vegtool.progress import Progress

Bar = Callable[[str], AbstractContextManager[Progress]]


@dataclass(frozen=True)
class Result:
    """facts: for machines. text: for people. notes: sentences for the user."""

    facts: dict[str, Any]
    text: str
    notes: tuple[str, ...]


def run_plan(scene: Path, library: Path, out: Path | None, force: bool, bar: Bar) -> Result:
    """The plan of a scene, written to a file if one is named.

    Raises the errors of `plan_of`, and OutputError where the file cannot be written.
    """
    if out is not None:
        check_free(out.parent, [out.name], force)
    with bar("plan") as progress:
        plan = plan_of(scene, library, progress)
    facts = as_dict(plan)
    if out is not None:
        data = (json.dumps(facts, indent=2) + "\n").encode()
        with FileSet(out.parent, force) as files:
            files.add(out.name, data)
    return Result(facts, text_of(plan), plan.notes)


def text_of(plan: Plan) -> str:
    """Tables for people."""
    parts = [table(("species", "plants", "from m", "to m", "largest px", "up", "sides", "light"),
                   [_need(need) for need in plan.needs])]  # fmt: skip
    rows = [
        ("kept" if row.kept else "out", row.species, row.level, human_bytes(row.bytes),
         f"{row.triangles:,}", row.why)
        for row in plan.levels
    ]  # fmt: skip
    parts.append(table(("", "species", "level", "file", "triangles", "why"), rows))
    squares = [(f"{row.side_m:g}", f"{row.squares:,}", f"{row.kept:,}") for row in plan.squares]
    parts.append(table(("squares of m", "all", "ever drawn, or gone through"), squares))
    totals = [
        (what, _amount(what, plan.total(what)), _amount(what, plan.total(what, kept=True)))
        for what in TOLD
    ]
    parts.append(table(("all levels", "there are", "needed"), totals))
    if plan.spent is not None:
        parts.append(_budget(plan.spent))
    return "\n\n".join(parts)


def _need(need: Need) -> tuple[str, ...]:
    if not need.plants:
        return need.name, "0", "-", "-", "-", "", "", need.lit
    low, high = (degrees(angle) for angle in need.elevation)
    around = need.azimuth[1] >= 2 * pi - 1e-6
    sides = "all" if around else f"{degrees(need.azimuth[1]):.0f} degrees"
    return (
        need.name, f"{need.plants:,}", f"{need.nearest:.3g}", _metres(need.farthest),
        _metres(need.largest_px), f"{low:.0f} to {high:.0f} degrees", sides, need.lit,
    )  # fmt: skip


def _metres(value: float) -> str:
    return "-" if value == inf else f"{value:,.4g}"


def _amount(what: str, value: int) -> str:
    return human_bytes(value) if what == "bytes" else f"{value:,}"


def _budget(spent: Spent) -> str:
    rows = [
        (one.species, ", ".join(map(str, one.levels)) or "-", human_bytes(one.bytes),
         f"{one.error:.3f}", f"{one.pixels:.1%}")
        for one in spent.kept
    ]  # fmt: skip
    listed = table(("species", "levels in the budget", "files", "error", "of all pixels"), rows)
    return (
        f"{listed}\n\nbudget of {human_bytes(spent.bytes)}: mean error {spent.error:.3f} (FLIP); "
        f"{spent.even:.3f} with an equal part for each species"
    )
