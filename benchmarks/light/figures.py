"""Figures: Colditz et al. 2005, Fig. 3, with our levels, and a pre-lit level beside its plant.

Above from the side, below from the top; left the plant, then billboards without normal textures and
with them. Next to it the plant with its shadows, a pre-lit level, and one with normal textures.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from light.prelit import SUN
from vegtool.arrays import ByteArray, Picture
from vegtool.convert import ConvertOptions, convert
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light, Sun
from vegtool.lod import Level, LodChain
from vegtool.measure.background import bytes_over
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, live, truth
from vegtool.measure.views import Camera, direction, framed
from vegtool.plant import Plant
from vegtool.refine.occlusion import exposed

CELL, GAP, LINE = 300, 10, 24
PAPER, INK = (250, 250, 248), (30, 34, 38)
VIEWS = {"side": direction(0.0, 8.0), "top": direction(0.0, 80.0)}
SHOWN = 0.8
"""Of a picture of the plant's bounding ball: all of a tree."""
FLAT = (128, 128, 255)
QUALITY = 80


def figures(name: str, plant: Plant, chains: Mapping[str, LodChain], folder: Path) -> None:
    """Write FOLDER/lighting_NAME.jpg, of the plain method's first level."""
    level = chains["none"].levels[1]
    assert level.atlas is not None
    flat = np.full_like(level.atlas.color[..., :3], FLAT)
    without = replace(level, atlas=replace(level.atlas, normal=flat))
    off = MeasureOptions(measure="off")
    options = ConvertOptions(refine="none", levels=1, prelit=True, sun=SUN)
    baked = convert(plant, options, off).levels[1]
    sun, whole = Sun.read(SUN), exposed(plant, 1.0)
    columns: dict[str, list[ByteArray]] = {}
    with ExitStack() as stack:
        original = stack.enter_context(PlantBuffers(plant))
        shaded = stack.enter_context(PlantBuffers(whole))
        maps = stack.enter_context(SunMaps([shaded], sun.direction))
        for seen_from in VIEWS.values():
            camera = framed(
                plant.center, plant.radius, seen_from, level.near_distance_m, chains["none"].display
            )
            pictures = {
                "geometry": truth(original, camera, sun.light),
                "without normal textures": _shown(without, camera, sun.light),
                "with normal textures": _shown(level, camera, sun.light),
                "geometry, its shadows": truth(shaded, camera, sun.light, shadows=maps),
                "pre-lit": _shown(baked, camera, sun.light),
            }
            for column, picture in pictures.items():
                columns.setdefault(column, []).append(_cell(picture))
    sheet = _sheet(columns, f"{level.triangles:,} triangles of {len(plant.faces):,}")
    sheet.save(folder / f"lighting_{name}.jpg", quality=QUALITY, optimize=True)


def _shown(level: Level, camera: Camera, light: Light) -> Picture:
    with PlantBuffers(client_plant(level), mipmaps=True) as buffers:
        return live(buffers, camera, light)


def _cell(picture: Picture) -> ByteArray:
    image = Image.fromarray(bytes_over(picture))
    edge = int(image.width * (1 - SHOWN) / 2)
    image = image.crop((edge, edge, image.width - edge, image.height - edge))
    return np.asarray(image.resize((CELL, CELL), Image.Resampling.NEAREST))


def _sheet(columns: Mapping[str, list[ByteArray]], told: str) -> Image.Image:
    rows = len(VIEWS)
    size = (GAP + len(columns) * (CELL + GAP), 2 * LINE + rows * (CELL + GAP) + GAP)
    paper = Image.new("RGB", size, PAPER)
    pen, font = ImageDraw.Draw(paper), ImageFont.load_default(17)
    for i, (column, pictures) in enumerate(columns.items()):
        x = GAP + i * (CELL + GAP)
        pen.text((x, 4), column, fill=INK, font=font)
        for row, picture in enumerate(pictures):
            paper.paste(Image.fromarray(picture), (x, LINE + 4 + row * (CELL + GAP)))
    pen.text((GAP, size[1] - LINE), told, fill=INK, font=font)
    return paper
