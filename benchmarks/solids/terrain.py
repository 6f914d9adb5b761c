"""A hilly height field."""

from __future__ import annotations

from vegtool.growth import sample
from vegtool.plant import Plant


def height_field(cells: int = 512) -> Plant:
    """Of 2 cells^2 triangles, 200 m each way: the sample of that name."""
    return sample("height-field", 2 * cells**2)
