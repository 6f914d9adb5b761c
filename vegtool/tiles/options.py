"""What the user chooses of tiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from vegtool.options import option

TileFormat = Literal["3dtiles", "glb"]


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
        32_768, "Triangles of a merged tile, at most.", least=2, most=10_000_000
    )
    near_triangles: int = option(
        524_288, "Triangles of a tile of instances, at most.", least=2, most=1_000_000_000
    )
    near_texture: int = option(
        256, "Largest side of a texture of those models, in texels: clients keep a copy of it for "
        "every tile that shows it.", least=16, most=16384,
    )  # fmt: skip
    plain: bool = option(
        False, "Vertices of merged tiles as floats, for clients without KHR_mesh_quantization."
    )
    surfels: bool = option(
        False, "Beyond the levels of instances, squares as points in progressive order "
        "(progressive blue surfels), in place of merged meshes."
    )  # fmt: skip
    attributes: bool = option(
        False, "Write which plant is which, of what species and how high, for clients that ask "
        "(EXT_structural_metadata)."
    )  # fmt: skip
    max_texture: int = option(4096, "Largest side of a texture, in texels.", least=16, most=16384)
    format: str = option(
        "3dtiles",
        "3dtiles: a tileset.json of 3D Tiles 1.1; glb: the same tiles, and an index.json of them "
        "for readers of your own.",
        choices=get_args(TileFormat),
    )


@dataclass(frozen=True)
class RunOptions:
    """How tiles are made: nothing of it changes their bytes.

    jobs: processes; None for one to each core. dask: address of a scheduler, in place of them.
    only: names of tiles."""

    jobs: int | None = None
    dask: str | None = None
    only: tuple[str, ...] = ()
    dry_run: bool = False
    force: bool = False
