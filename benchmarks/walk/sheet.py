"""A contact sheet: the truth, what is drawn at the rate that is asked for, crossed billboards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw, ImageFont

from vegtool.arrays import Picture
from vegtool.measure.background import bytes_over
from vegtool.preview.eye import Eye
from walk.speed import SIZE
from walk.truth import Sitting

STATIONS = 3
CELL = (SIZE[0] // 2, SIZE[1] // 2)
GAP, LINE = 6, 20
PAPER, INK = (250, 250, 248), (30, 34, 38)


@dataclass(frozen=True, eq=False)
class Strip:
    """One station: pictures by what they are called."""

    told: str
    pictures: dict[str, Image.Image]


def strips(sitting: Sitting, eyes: Sequence[tuple[int, Eye]], detail: float) -> list[Strip]:
    """Stations (number and eye) of one landscape; detail: of the levels."""
    return [
        Strip(
            f"{sitting.name}, view {station}",
            {
                "truth": _cell(sitting.truth(eye)),
                f"levels, detail {detail:.3f}": _cell(sitting.shown(eye, detail)),
                "crossed": _cell(sitting.flat(eye)),
            },
        )
        for station, eye in eyes
    ]


def sheet(rows: Sequence[Strip]) -> Image.Image:
    """All of them, one below the other."""
    width = GAP + max(len(row.pictures) for row in rows) * (CELL[0] + GAP)
    step = LINE + CELL[1] + GAP
    paper = Image.new("RGB", (width, GAP + len(rows) * step), PAPER)
    pen, font = ImageDraw.Draw(paper), ImageFont.load_default(14)
    for row, strip in enumerate(rows):
        top = GAP + row * step
        for column, (name, picture) in enumerate(strip.pictures.items()):
            left = GAP + column * (CELL[0] + GAP)
            pen.text((left, top), f"{strip.told}: {name}", fill=INK, font=font)
            paper.paste(picture, (left, top + LINE))
    return paper


def _cell(picture: Picture) -> Image.Image:
    return Image.fromarray(bytes_over(picture)).resize(CELL, Image.Resampling.BOX)
