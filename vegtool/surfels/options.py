"""What shapes a hierarchy of surfel billboards, as the user says it."""

from __future__ import annotations

from dataclasses import dataclass

from vegtool.options import option

SUFFIX = ".surfels"
"""Of files that hold a model (store.py)."""
POINTS_SUFFIX = ".ply"
"""Of files of surfels in progressive order (formats/ply_surfels.py)."""
MEGABYTE = 1_000_000
"""Bytes."""


@dataclass(frozen=True)
class SurfelOptions:
    """Names are those of Holst and Schumann (2007), sections 3.2, 3.3 and 4.4."""

    epsilon: float = option(
        1.0,
        "Pixels that billboards, and the triangles below them, may displace what they show.",
        least=0.01,
        most=100.0,
    )
    theta: float = option(
        0.5,
        "Share of all directions from which a billboard keeps to --epsilon where it first may be "
        "used: less is earlier, for fewer directions.",
        least=0.01,
        most=1.0,
    )
    ds_max: float = option(
        1.5,
        "How many times farther away a billboard is to be used than those below it; what is not "
        "goes: more is fewer billboards, and less memory.",
        least=1.0,
        most=100.0,
    )
    max_texture_memory: float = option(
        32.0,
        "Megabytes that the textures of all billboards may take on the GPU, 8 bytes a texel. Where "
        "that is too little, triangles are drawn farther away.",
        least=0.001,
        most=16_384.0,
        metavar="MEGABYTES",
    )
