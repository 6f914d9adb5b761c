"""Rows of results and tables of pages, of what was measured of tiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from landscape.making import Made, Merged, Single
from landscape.rebaked import Compared
from landscape.scenes import PLANTS
from landscape.stations import Seen

Rows = list[dict[str, Any]]


def made_rows(found: Sequence[Made]) -> Rows:
    """A row for each landscape."""
    return [
        {
            "plants": one.plants,
            "processes": one.processes,
            "seconds": round(one.seconds, 1),
            "peak_mb": one.peak_mb,
            "mb": round(one.facts["bytes"] / 1e6, 1),
            "shared_mb": round(one.facts["shared_bytes"] / 1e6, 1),
            "tiles": len(one.facts["tiles"]),
            "draws_of_merged": max(
                (t["draws"] for t in one.facts["tiles"] if t["kind"] != "instances"), default=0
            ),
            "quads_per_plant": round(quads(one), 2),
        }
        for one in found
    ]


def quads(one: Made) -> float:
    """Of all tiles that hold billboards, for each plant."""
    levels = one.facts["levels"]
    triangles = sum(lv["triangles"] for lv in levels if lv["kinds"] != ["instances"])
    return float(triangles / 2 / one.plants)


def level_rows(one: Made) -> Rows:
    """A row for each height of a landscape."""
    return [
        {
            "plants": one.plants,
            "side_m": round(level["side_m"], 1),
            "from_m": round(level["from_m"], 1),
            "tiles": level["tiles"],
            "kinds": " and ".join(level["kinds"]),
            "quads_per_plant": round(level["triangles"] / 2 / one.plants, 3),
            "most_triangles": level["most_triangles"],
            "error_m": round(level["error_m"], 2),
            "measured_error_m": round(level["measured_error_m"], 2),
            "mb": round(level["bytes"] / 1e6, 2),
            "seconds": round(level["seconds"], 1),
        }
        for level in one.facts["levels"]
    ]


def merged_rows(one: Merged) -> Rows:
    return [
        {
            "plants": one.plants,
            "tiles": one.tiles,
            "triangles": one.triangles,
            "mb": round(one.bytes / 1e6, 1),
            "seconds": round(one.seconds, 2),
            "peak_mb": one.peak_mb,
        }
    ]


def single_rows(one: Single) -> Rows:
    return [
        {
            "plants": one.plants,
            "tiles": one.tiles,
            "open_s": round(one.opened_s, 3),
            "tile_s": round(one.tile_s, 4),
            "command_s": round(one.command_s, 2),
        }
    ]


def seen_rows(found: Sequence[Seen]) -> Rows:
    return [
        {
            "station": one.station,
            "asked": "" if one.asked is None else one.asked,
            "flip": round(one.flip, 4),
            "tiles": one.tiles,
            "kinds": one.kinds,
            "triangles": one.triangles,
            "draws": one.draws,
            "frame_s": round(one.frame_s, 3),
        }
        for one in found
    ]


def compared_rows(found: Sequence[Compared]) -> Rows:
    return [
        {
            "side_m": round(one.side_m, 1),
            "quarters_triangles": one.quarters,
            "triangles": one.triangles,
            "rebaked_flip": round(one.rebaked, 4),
            "subsample_flip": round(one.subsample, 4),
            "less": f"{one.better:.0%}",
        }
        for one in found
    ]


def table(rows: Rows, leave_out: Sequence[str] = ()) -> str:
    """As Markdown."""
    names = [name for name in rows[0] if name not in leave_out]
    lines = [
        "| " + " | ".join(name.replace("_", " ") for name in names) + " |",
        "|" + "---|" * len(names),
    ]
    lines += ["| " + " | ".join(_cell(row[name]) for name in names) + " |" for row in rows]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    return f"{value:,}" if isinstance(value, int) else str(value)


def missed(
    whole: Made | None, merging: Merged | None, scale: Sequence[Made], one: Single | None,
    stations: Sequence[Seen], rebaked: Sequence[Compared],
) -> list[str]:  # fmt: skip
    """What was asked and not reached, a sentence each."""
    found = []

    def check(ok: bool, sentence: str) -> None:
        if not ok:
            found.append(sentence)

    if whole is not None:
        check(not whole.wrong, f"the tileset is wrong: {whole.wrong[:3]}")
        check(abs(whole.plants - PLANTS) < 0.01 * PLANTS, f"{whole.plants:,} plants")
        check(whole.seconds <= 180, f"{whole.seconds:.0f} s of 180")
        check(whole.peak_mb <= 2000, f"{whole.peak_mb} MB of 2,000")
        check(whole.facts["bytes"] <= 600e6, f"{whole.facts['bytes'] / 1e6:.0f} MB of 600")
    if merging is not None:
        check(merging.seconds <= 10, f"merging takes {merging.seconds:.1f} s of 10")
        check(merging.peak_mb <= 400, f"merging takes {merging.peak_mb} MB of 400")
    if len(scale) > 1:
        each = [made.seconds / made.plants for made in scale]
        check(each[-1] <= 1.2 * each[-2], f"seconds for a plant: {each}")
        held = [made.peak_mb for made in scale]
        check(held[-1] <= 1.25 * held[-2], f"megabytes: {held}")
    if one is not None:
        check(one.opened_s + one.tile_s <= 1, f"a single tile: {one.opened_s + one.tile_s:.2f} s")
    for seen in stations:
        if seen.asked is not None:
            check(seen.flip <= seen.asked, f"FLIP {seen.station}: {seen.flip:.3f} of {seen.asked}")
    for pair in rebaked:
        check(pair.better >= 0.25, f"{pair.side_m:g} m: {pair.better:.0%} less than a subsample")
    return found
