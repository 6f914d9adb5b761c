"""Tables of what benchmarks/lighting.py found, for its page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Row = Mapping[str, object]

HEADS = {
    "relighting": (
        "plant",
        "method",
        "level",
        "kind",
        "mapped",
        "flat",
        "ratio",
        "smooth",
        "whole",
        "whole_flat",
    ),
    "turning": (
        "plant",
        "level",
        "kind",
        "triangles",
        "mean",
        "worst",
        "within_3_percent",
        "worst_jump",
        "jumps_within_1_percent",
    ),
    "prelit": (
        "plant",
        "method",
        "level",
        "drawn",
        "texels",
        "bytes",
        "flip",
        "shading_rmse",
        "color_bias",
    ),
    "crown": (
        "plant",
        "level",
        "share",
        "flip",
        "shading_rmse",
        "flip_shadows",
        "shading_rmse_shadows",
    ),
    "shadows": ("plant", "level", "triangles", "dark", "error"),
}
TITLES = {
    "relighting": "### Other suns: RMSE of shading",
    "turning": "### A turning camera: brightness beside the plant's",
    "prelit": "### Pre-lit levels, against the plant with its shadows",
    "crown": "### Crown normals blended in",
    "shadows": "### Shadows on the ground",
}


def tables(found: Mapping[str, Sequence[Row]]) -> str:
    """A table for each part."""
    return "\n\n".join(f"{TITLES[part]}\n\n{table(part, rows)}" for part, rows in found.items())


def table(part: str, rows: Sequence[Row]) -> str:
    columns = HEADS[part]
    lines = [f"| {' | '.join(c.replace('_', ' ') for c in columns)} |", "|---" * len(columns) + "|"]
    lines += [f"| {' | '.join(str(row[c]) for c in columns)} |" for row in rows]
    return "\n".join(lines)
