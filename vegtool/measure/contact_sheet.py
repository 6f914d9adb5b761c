"""One picture of a chain: the original above, the levels below, where they are meant to be used.

A column per level. Both pictures of a column are taken from the level's switch distance, or that of
the nearest eye where the scene has none as near, and shown magnified (nearest texel) to the same
size, so that a person can compare pixel by pixel.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from io import BytesIO

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vegtool.arrays import ByteArray, Picture
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light, Sun
from vegtool.lod import Level, LodChain
from vegtool.measure.background import bytes_over
from vegtool.measure.pictures import live, truth, uploaded
from vegtool.measure.views import direction, framed

CELL = 360
"""Pixels of a picture's side on the sheet; small pictures are magnified to fill it."""
MARGIN, LINE = 12, 18
PAPER, INK, FAINT = (250, 250, 248), (30, 34, 38), (110, 116, 122)
VIEW = direction(25.0, 8.0)


def contact_sheet(chain: LodChain) -> bytes:
    """The sheet as PNG bytes."""
    plant, levels = chain.original, chain.coarser
    if 0 in levels and chain.limits is not None:  # the original is not among them
        near_m = chain.limits.span(chain.display).nearest_m
        levels[0] = replace(levels[0], near_distance_m=near_m)
    with ExitStack() as stack:
        original = stack.enter_context(PlantBuffers(plant))
        light, shadows = Light(), None
        if chain.baked:
            sun = Sun(chain.baked["azimuth_deg"], chain.baked["elevation_deg"])
            light, shadows = sun.light, stack.enter_context(SunMaps([original], sun.direction))
        cells = []
        for level in levels.values():
            camera = framed(plant.center, plant.radius, VIEW, level.near_distance_m, chain.display)
            with uploaded(level) as buffers:
                above = truth(original, camera, light, 4, shadows)
                cells.append(_cropped(above, live(buffers, camera, light)))
    width = MARGIN + len(levels) * (CELL + MARGIN)
    width = max(width, CELL)
    captions = [_caption(level, number) for number, level in levels.items()]
    height = 2 * (CELL + MARGIN) + MARGIN + LINE * max(map(len, captions), default=0) + 38
    sheet = Image.new("RGB", (width, height), PAPER)
    pen = ImageDraw.Draw(sheet)
    title, small = ImageFont.load_default(18), ImageFont.load_default(13)
    heading = f"{chain.name}   {len(plant.faces):,} triangles"
    pen.text((MARGIN, MARGIN), heading, fill=INK, font=title)
    for column, (caption, pictures) in enumerate(zip(captions, cells, strict=True)):
        x, y = MARGIN + column * (CELL + MARGIN), MARGIN + 34
        for picture in pictures:
            sheet.paste(Image.fromarray(_magnified(bytes_over(picture))), (x, y))
            y += CELL + MARGIN
        for row, (text, colour) in enumerate(caption):
            pen.text((x, y + LINE * row), text, fill=colour, font=small)
    stream = BytesIO()
    sheet.save(stream, "PNG", compress_level=4)
    return stream.getvalue()


def _cropped(*pictures: Picture) -> tuple[Picture, ...]:
    """The pictures cut to the same square around all that any of them covers, a little more."""
    covered = np.logical_or.reduce([p[..., 3] > 0 for p in pictures])
    rows, columns = np.flatnonzero(covered.any(axis=1)), np.flatnonzero(covered.any(axis=0))
    if not len(rows):
        return pictures
    size = max(int(line[-1] - line[0]) + 1 for line in (rows, columns))
    side = size + max(2, size // 16)
    low = [(int(line[0] + line[-1]) + 1 - side) // 2 for line in (rows, columns)]
    pad = [(max(0, -x), max(0, x + side - n)) for x, n in zip(low, covered.shape, strict=True)]
    (top, left), ((up, _), (over_left, _)) = low, pad
    return tuple(
        np.pad(p, (*pad, (0, 0)))[top + up :, left + over_left :][:side, :side] for p in pictures
    )


def _magnified(picture: ByteArray) -> ByteArray:
    """A square picture brought to CELL: averaged where larger, its pixels as squares else."""
    image = Image.fromarray(picture)
    if image.width < CELL:
        image = image.resize((8 * image.width, 8 * image.width), Image.Resampling.NEAREST)
    return np.asarray(image.resize((CELL, CELL), Image.Resampling.BOX))


def _caption(level: Level, number: int) -> list[tuple[str, tuple[int, int, int]]]:
    shown, atlas = f"{level.triangles:,} triangles", "no textures"
    mesh = level.mesh
    if mesh is not None and mesh.exposure is not None and not all(m.unlit for m in mesh.materials):
        atlas = "no textures, but a ramp for exposure"
    if level.billboards is not None and level.atlas is not None:
        height, width = level.atlas.color.shape[:2]
        shown = f"{len(level.billboards):,} billboards, {shown}"
        if level.mesh_triangles:
            shown += f" ({level.mesh_triangles:,} of a mesh)"
        atlas = f"atlas {width} x {height}"
    if level.surfels is not None:
        shown = f"{len(level.surfels):,} surfels"
    lines = [
        (f"LOD{number}, from {level.near_distance_m:g} m", INK),
        (shown, FAINT),
        (atlas, FAINT),
    ]
    if level.measured is not None:
        error, live = level.measured.errors["flip"].mean, level.measured.live["flip"].mean
        lines.append((f"error {error:.3f}, of the original live {live:.3f} (FLIP)", FAINT))
    return lines
