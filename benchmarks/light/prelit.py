"""Pre-lit levels beside normal-textured ones, against the plant with its shadows.

12 views under the sun that is baked; the truth has soft shadows and the sky that its own crown
lets through. Normal-textured levels are drawn as clients draw them: without shadows, as foliage
mostly is far away; with the plant's own sky visibility (--occlusion 1); with that and a client's
shadow map.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

from vegtool.convert import ConvertOptions, convert
from vegtool.formats import png
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Sun
from vegtool.lod import Level, LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import Shadowed, scores, truths
from vegtool.measure.views import views
from vegtool.plant import Plant
from vegtool.refine.occlusion import exposed

SUN = "135,40"
VIEWS = 12


@dataclass(frozen=True)
class Beside:
    """One level, drawn in one way."""

    level: int
    drawn: str
    triangles: int
    texels: int
    bytes: int
    flip: float
    shading: float
    color_bias: float


def beside(plant: Plant, refine: str, chain: LodChain) -> Iterator[Beside]:
    """Every level that both chains have. chain: by that --refine, as it comes."""
    off = MeasureOptions(measure="off")
    options = ConvertOptions(refine=refine)
    chains = {
        "normals": chain,
        "normals, sky": convert(plant, replace(options, occlusion=1.0), off),
        "pre-lit": convert(plant, replace(options, prelit=True, sun=SUN), off),
    }
    sun, whole = Sun.read(SUN), exposed(plant, 1.0)
    with ExitStack() as stack:
        buffers = stack.enter_context(PlantBuffers(whole))
        maps = stack.enter_context(SunMaps([buffers], sun.direction))
        under, display = Shadowed(sun.light, maps), options.display
        for number in range(1, min(len(chain.levels) for chain in chains.values())):
            first = chains["normals"].levels[number]
            pixels = plant.extent * display.pixels_per_metre(first.near_distance_m)
            truth = truths(
                whole, views("all", VIEWS), [pixels], display, buffers=buffers, under=under
            )
            unshadowed = replace(truth, under=replace(under, shadows=None))
            ways = {
                "normals": ("normals", unshadowed),
                "normals, sky": ("normals, sky", unshadowed),
                "normals, sky, shadow map": ("normals, sky", truth),
                "pre-lit": ("pre-lit", truth),
            }
            for drawn, (which, against) in ways.items():
                level = chains[which].levels[number]
                values = scores(against, level).values
                yield Beside(
                    number,
                    drawn,
                    level.triangles,
                    level.texels,
                    texture_bytes(level),
                    float(values["flip"].mean()),
                    float(values["shading_rmse"].mean()),
                    float(values["color_bias"].mean()),
                )


def texture_bytes(level: Level) -> int:
    """Of its pictures as PNG files."""
    if level.atlas is None:
        return 0
    images = level.atlas.color, level.atlas.normal, level.atlas.light
    return sum(len(png.encode(image)) for image in images if image is not None)


def rows(plant: str, method: str, found: Sequence[Beside]) -> list[dict[str, object]]:
    """For results/lighting_prelit.csv."""
    return [
        {
            "plant": plant,
            "method": method,
            "level": b.level,
            "drawn": b.drawn,
            "triangles": b.triangles,
            "texels": b.texels,
            "bytes": b.bytes,
            "flip": f"{b.flip:.4f}",
            "shading_rmse": f"{b.shading:.4f}",
            "color_bias": f"{b.color_bias:+.4f}",
        }
        for b in found
    ]
