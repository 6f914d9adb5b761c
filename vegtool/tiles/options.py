"""What the user chooses of tiles."""

from __future__ import annotations

from dataclasses import dataclass

from vegtool.options import option


@dataclass(frozen=True)
class TileOptions:
    """How a landscape becomes tiles."""

    tile: float = option(
        32.0, "Side of the smallest tiles in metres; each level above has twice that.", least=1.0,
        most=4096.0,
    )  # fmt: skip
    near: int = option(
        2, "Levels of the pyramid, from the smallest tiles on, whose plants are instances of "
        "models that all tiles share; beyond, each tile is one mesh.", least=1, most=16,
    )  # fmt: skip
    triangles: int = option(
        65_536, "Triangles of a merged tile, at most.", least=2, most=10_000_000
    )
    plain: bool = option(
        False, "Vertices of merged tiles as floats, for clients without KHR_mesh_quantization."
    )
    max_texture: int = option(4096, "Largest side of a texture, in texels.", least=16, most=16384)
