"""The pipeline for one plant: options, what makes levels by them, and the chain of these."""

from typing import TYPE_CHECKING

from vegtool.convert.options import (
    LEVEL_RATIO,
    MOST_BILLBOARDS,
    MOST_OF_PREVIOUS,
    NEAR_LIMITS,
    SURFELS,
    TRIANGLES_PER_BILLBOARD,
    ConvertOptions,
)
from vegtool.later import later

if TYPE_CHECKING:
    from vegtool.convert.chain import as_lit, budget_notes, convert, endings
    from vegtool.convert.makers import billboard_counts, level_maker, near_distances, near_pixels
else:
    __getattr__ = later(
        __name__,
        {
            "chain": ("as_lit", "budget_notes", "convert", "endings"),
            "makers": ("billboard_counts", "level_maker", "near_distances", "near_pixels"),
        },
    )

__all__ = [
    "LEVEL_RATIO",
    "MOST_BILLBOARDS",
    "MOST_OF_PREVIOUS",
    "NEAR_LIMITS",
    "SURFELS",
    "TRIANGLES_PER_BILLBOARD",
    "ConvertOptions",
    "as_lit",
    "billboard_counts",
    "budget_notes",
    "convert",
    "endings",
    "level_maker",
    "near_distances",
    "near_pixels",
]
