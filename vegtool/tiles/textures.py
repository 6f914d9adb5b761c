"""Models with smaller textures.

Clients keep the textures of a model that tiles share once for every tile. What smaller ones save,
and what pictures lose by them, is in docs/tile_clients.md.
"""

from __future__ import annotations

from dataclasses import replace

from vegtool.gl.mipmaps import mip_levels
from vegtool.plant import Plant, Texture


def limited(plant: Plant, most: int) -> Plant:
    """A plant whose colour textures have no side above `most` texels, and whose normal textures
    none above half of that: those that have are halved until they have none, by plain averages, of
    colours in linear light, as a client makes its mips.

    Averages that keep as much above the alpha cutoff gave worse pictures: levels are baked such
    that what clients make of them by plain ones is right.
    """

    def of(texture: Texture | None, side: int, srgb: bool) -> Texture | None:
        if texture is None or max(texture.pixels.shape[:2]) <= side:
            return texture
        small = (p for p in mip_levels(texture.pixels, srgb) if max(p.shape[:2]) <= side)
        return Texture(texture.name, next(small))

    materials = tuple(
        replace(
            one,
            color_texture=of(one.color_texture, most, True),
            normal_texture=of(one.normal_texture, most // 2, False),
        )
        for one in plant.materials
    )
    return replace(plant, materials=materials)
