"""What a bake can be told, with defaults and units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Sides = Literal["auto", "double", "opposite"]


@dataclass(frozen=True)
class BakeOptions:
    """How a level is baked.

    supersample: samples per axis and texel; small atlases take up to 8, where it costs little.
    gutter: texels around each picture; two on each side keep neighbours apart for two mips.
    max_texture: texels, the longest side of an atlas; the density is lowered to fit.
    sides: one picture per billboard for both sides ("double"), one for each ("opposite"), or
    whichever the plant needs ("auto", by measuring how much front and back differ).
    fit_alpha: fit alpha to the alpha test (coverage.py), picture by picture; else it is the mean
    coverage of each texel, for whoever fits it to more (refine/coverage.py).
    """

    supersample: int = 4
    gutter: int = 2
    max_texture: int = 2048
    sides: Sides = "auto"
    fit_alpha: bool = True
