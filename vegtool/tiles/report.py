"""What making tiles came to: for machines, and for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vegtool.console import human_bytes, table
from vegtool.tiles.estimate import HIDDEN, TOO_FAR, TOO_NEAR
from vegtool.tiles.jobs import Failed, Made, World
from vegtool.tiles.quadtree import Node


def facts_of(
    world: World, made: Sequence[Made], failed: Mapping[str, Failed], out: Path,
    files: Sequence[str], seconds: float, scene: Mapping[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """What `--json` prints. files: with which clients begin, if they were written. scene: what of a
    scene the tileset is for, if of any."""
    tiles = [one for one in made if one.entry.facts.get("plants")]
    rows = [
        {
            "tile": one.entry.name,
            "height": world.pyramid.tree.height(_node(one).level),
            **{
                key: one.entry.facts[key]
                for key in ("kind", "plants", "triangles", "draws", "error_m")
            },
            "surfels": one.entry.facts.get("surfels", 0),
            "bytes": sum(one.entry.files.values()),
            "again": one.again,
            "seconds": {key: round(value, 4) for key, value in one.seconds.items()},
        }
        for one in tiles
    ]
    heights = sorted({row["height"] for row in rows})
    size = sum(sum(one.entry.files.values()) for one in made)
    size += sum((out / file).stat().st_size for file in files)
    plants = max((row["plants"] for row in rows), default=0)
    facts = {
        "tileset": str(out / files[0]) if files else None,
        "plants": plants if scene is None else scene["plants"],
        "made": sum(one.again for one in tiles),
        "bytes": size,
        "shared_bytes": sum(sum(one.entry.files.values()) for one in made if not one.entry.facts),
        "seconds": round(seconds, 2),
        "levels": [_level(world, [row for row in rows if row["height"] == h]) for h in heights],
        "tiles": rows,
        "failed": {name: one.message for name, one in failed.items()},
        "notes": list(world.pyramid.notes),
    }
    return facts if scene is None else {**facts, "scene": dict(scene)}


def text_of(facts: Mapping[str, Any]) -> str:
    """The same, in few words."""
    head = ["tiles of", "tiles", "drawn as", "from", "of", "error", "bytes", "seconds"]
    rows = [
        [
            f"{level['side_m']:,.4g} m",
            f"{level['tiles']:,}",
            ", ".join(level["kinds"]),
            f"{level['from_m']:,.4g} m",
            _drawn(level),
            f"{level['error_m']:.2g} m",
            human_bytes(level["bytes"]),
            f"{level['seconds']:,.1f}",
        ]
        for level in facts["levels"]
    ]
    made = len(facts["tiles"])
    kept = f" ({made - facts['made']:,} were there)" if facts["made"] < made else ""
    where = facts["tileset"] or "tiles"
    title = (
        f"{where}: {facts['plants']:,} plants, {made:,} tiles{kept}, "
        f"{human_bytes(facts['bytes'])}, {facts['seconds']:,.1f} s"
    )
    parts = [title, table(head, rows)] if rows else [title]
    if facts.get("scene", {}).get("left_out"):
        parts.append(left_out(facts["scene"]))
    return "\n\n".join(parts)


def left_out(scene: Mapping[str, Any]) -> str:
    """What of a landscape no viewer of a scene is shown."""
    head = ["left out of", "squares", TOO_NEAR, HIDDEN, TOO_FAR, "with plants", "bytes, about"]
    rows = [
        [
            f"{row['side_m']:,.4g} m",
            f"{row['squares'] - row['kept']:,} of {row['squares']:,}",
            f"{row['too_near']:,}",
            f"{row['hidden']:,}",
            f"{row['too_far']:,}",
            f"{row['plants']:,}",
            human_bytes(row["bytes"]),
        ]
        for row in scene["left_out"]
    ]
    models = scene["models"]
    count = models["all"] - models["kept"]
    return f"{table(head, rows)}\n\n{count:,} of {models['all']:,} models are left out as well"


def _node(one: Made) -> Node:
    return Node(*map(int, one.entry.name.split("/")))


def _drawn(level: Mapping[str, Any]) -> str:
    """Of how much its tiles are, at most."""
    if level["most_surfels"]:
        return f"{level['most_surfels']:,} surfels"
    return f"{level['most_triangles']:,} triangles"


def _level(world: World, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What squares of one height come to."""
    height = rows[0]["height"]
    return {
        "height": height,
        "side_m": world.pyramid.tree.side_m * 2.0**height,
        "from_m": world.pyramid.from_m(height),
        "tiles": len(rows),
        "kinds": sorted({row["kind"] for row in rows}),
        "plants": sum(row["plants"] for row in rows),
        "triangles": sum(row["triangles"] for row in rows),
        "most_surfels": max(row["surfels"] for row in rows),
        "most_triangles": max(row["triangles"] for row in rows),
        "error_m": world.pyramid.error_m(height),
        "measured_error_m": max((row["error_m"] or 0.0) for row in rows),
        "bytes": sum(row["bytes"] for row in rows),
        "seconds": round(sum(sum(row["seconds"].values()) for row in rows), 3),
    }
