"""Pictures of what was measured of tiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont

GAP, LINE, WIDTH = 6, 20, 1280
PAPER, INK = (250, 250, 248), (30, 34, 38)
Rows = Sequence[Mapping[str, Any]]


def figures(folder: Path, found: Mapping[str, Rows], pictures: Path) -> None:
    """tiles_scale.png, tiles_levels.png and tiles_stations.jpg, of what there is."""
    folder.mkdir(parents=True, exist_ok=True)
    if "scale" in found:
        _scale(folder / "tiles_scale.png", found["scale"])
    if "levels" in found and "error" in found:
        _levels(folder / "tiles_levels.png", found["levels"])
    if "error" in found:
        _stations(folder / "tiles_stations.jpg", found["error"], pictures)


def _scale(file: Path, rows: Rows) -> None:
    """Time in proportion to plants, memory beside it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    time, memory = figure.subplots(1, 2)
    plants = [row["plants"] for row in rows]
    time.loglog(plants, [row["seconds"] for row in rows], "o-", color="#3b7d4f")
    last = rows[-1]["seconds"] / plants[-1]
    time.loglog(plants, [last * n for n in plants], ":", color="#888888", label="in proportion")
    time.set(xlabel="plants", ylabel="seconds, two processes")
    time.legend(frameon=False)
    memory.semilogx(plants, [row["peak_mb"] for row in rows], "o-", color="#8a5a2b")
    memory.set(xlabel="plants", ylabel="MB, all processes together", ylim=(0, None))
    for axes in (time, memory):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=110)


def _levels(file: Path, rows: Rows) -> None:
    """What each level of the pyramid took, and how far off it is, beside what is stated."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    time, error = figure.subplots(1, 2)
    side = [row["side_m"] for row in rows]
    time.loglog(side, [max(row["seconds"], 0.01) for row in rows], "o-", color="#3b7d4f")
    time.set(xlabel="side of a tile, m", ylabel="seconds of one core, all tiles of that side")
    error.loglog(side[1:], [row["error_m"] for row in rows][1:], "s--", color="#888888",
                 label="16 pixels where it takes over")  # fmt: skip
    measured = [row["measured_error_m"] for row in rows]
    error.loglog(side, measured, "o-", color="#8a5a2b", label="measured, 95 % of what is drawn")
    error.set(xlabel="side of a tile, m", ylabel="error, m")
    error.legend(frameon=False)
    for axes in (time, error):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(file, dpi=110)


def _stations(file: Path, rows: Rows, pictures: Path) -> None:
    """The truth on the left, tiles on the right."""
    shown = [Image.open(pictures / f"{row['station']}.png") for row in rows]
    height = shown[0].height * WIDTH // shown[0].width
    paper = Image.new("RGB", (WIDTH, len(rows) * (LINE + height + GAP)), PAPER)
    pen, font = ImageDraw.Draw(paper), ImageFont.load_default(14)
    for index, (row, picture) in enumerate(zip(rows, shown, strict=True)):
        top = index * (LINE + height + GAP)
        told = (
            f"{row['station']}: every plant in full; {row['tiles']} tiles, "
            f"{row['triangles']:,} triangles, FLIP {row['flip']:.3f}"
        )
        pen.text((GAP, top + 2), told, fill=INK, font=font)
        paper.paste(
            picture.convert("RGB").resize((WIDTH, height), Image.Resampling.BOX), (0, top + LINE)
        )
    paper.save(file, quality=88)
