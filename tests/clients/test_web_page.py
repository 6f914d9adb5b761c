"""The page of vegtool preview --html, from its file in headless Chromium.

It is drawn by three.js r140, with mips, 4x anisotropy and 4x multisampling as our own live
pictures are; a canvas resolves its samples in sRGB, ours in linear light.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import radians, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hybrids import hybrid_of
from PIL import Image
from programs import MARKS, node

from vegtool.arrays import Picture
from vegtool.convert import ConvertOptions, convert
from vegtool.formats.gltf import write_chain
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Sun
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, live
from vegtool.measure.views import Camera, direction
from vegtool.preview.web import web_page
from vegtool.srgb import linear_from_srgb

pytestmark = MARKS

SIZE = (1000, 700)  # CSS pixels of the window
VIEW = {"azimuth": 200, "elevation": 15}
SUN = Sun(250, 40)
COVERS = 0.01  # of our own picture's coverage
BRIGHT = 0.015  # of its mean linear light
OVERLAPS = 0.98  # intersection over union of both coverages, summed over the pixels


@dataclass(frozen=True, eq=False)
class Page:
    """A page, and the chain that it shows."""

    file: Path
    chain: LodChain

    @cached_property
    def height(self) -> int:
        """Pixels of the page's picture."""
        return int(self.look({})[0][0]["height"])

    def look(self, *changes: dict[str, Any]) -> list[tuple[dict[str, Any], Picture]]:
        """State and picture after each change of settings, or step of look_at_page.mjs; a page that
        complains fails."""
        outs = [self.file.parent / f"{i}.png" for i in range(len(changes))]
        steps = [
            {**(change if "set" in change else {"set": change}), "out": str(out)}
            for change, out in zip(changes, outs, strict=True)
        ]
        width, height = SIZE
        job = {"page": str(self.file), "width": width, "height": height, "steps": steps}
        *states, end = node("look_at_page.mjs", job)
        assert end == {"complaints": [], "asked": []}
        return [(state, picture(out)) for state, out in zip(states, outs, strict=True)]


def picture(path: Path) -> Picture:
    pixels = np.asarray(Image.open(path).convert("RGBA"), dtype=np.float32) / 255
    color, cover = linear_from_srgb(pixels[..., :3]), pixels[..., 3:]
    return np.concatenate([color * cover, cover], axis=2)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """A tree with a level of each kind, for a display of its own; the last one is unlit."""
    folder = tmp_path_factory.mktemp("web")
    plant = sample("broadleaf", 2000)
    options = ConvertOptions(refine="none", billboards=128, levels=2, fov=40, image_height=720)
    chain = convert(plant, options, MeasureOptions("off"))
    last = chain.levels[-1]
    far = last.near_distance_m
    hybrid = replace(hybrid_of(plant, 128, 200 / plant.extent), near_distance_m=2 * far)
    assert last.atlas is not None
    unlit = replace(
        last, atlas=replace(last.atlas, normal=None), unlit=True, near_distance_m=4 * far
    )
    chain = replace(chain, levels=(*chain.levels, hybrid, unlit))
    write_chain(chain, folder / "out")
    file = folder / "page.html"
    file.write_bytes(web_page(folder / "out"))
    return Page(file, chain)


def ours(chain: LodChain, level: int, state: dict[str, Any]) -> Picture:
    """The same picture by our own renderer."""
    plant = chain.levels[0].mesh
    assert plant is not None
    low, high = plant.bounds
    width, height = state["width"], state["height"]
    focal = height / 2 / tan(radians(chain.display.fov_y_deg) / 2)
    camera = Camera(
        (low + high) / 2,
        direction(state["azimuth"], state["elevation"]),
        state["distance"],
        focal,
        width,
        height,
        (width / 2, height / 2),
        1.5 * float(np.linalg.norm(high - low) / 2),
    )
    with PlantBuffers(client_plant(chain.levels[level]), mipmaps=True) as buffers:
        return live(buffers, camera, SUN.light)


def test_the_page_draws_what_our_own_renderer_draws(page: Page) -> None:
    sun = {"sunAzimuth": SUN.azimuth_deg, "sunElevation": SUN.elevation_deg}
    distance = 2.2 * page.chain.levels[0].mesh.extent  # type: ignore[union-attr]
    settings = {**VIEW, **sun, "distance": distance}
    levels = range(len(page.chain.levels))
    for level, (state, shown) in zip(
        levels, page.look(*({**settings, "level": n} for n in levels)), strict=True
    ):
        assert state["used"] == level
        found, cover = ours(page.chain, level, state), shown[..., 3]
        assert cover.sum() == pytest.approx(found[..., 3].sum(), rel=COVERS), level
        assert shown[..., :3].sum() == pytest.approx(found[..., :3].sum(), rel=BRIGHT), level
        both = np.minimum(cover, found[..., 3]).sum() / np.maximum(cover, found[..., 3]).sum()
        assert both > OVERLAPS, level


def thresholds(page: Page) -> list[tuple[float, float]]:
    """Of each level but the first, metres in the page's picture: where it goes, and comes."""
    scale = page.height / page.chain.display.image_height_px
    near = [scale * level.near_distance_m for level in page.chain.levels[1:]]
    return [(d, 1.15 * d) for d in near]


def test_levels_switch_at_the_distances_of_the_manifest(page: Page) -> None:
    """Each comes 15 % beyond its distance, going away, and goes at it, coming back."""
    changes, expected = [], []
    for finer, (_, comes) in enumerate(thresholds(page)):
        changes += [0.99 * comes, 1.01 * comes]
        expected += [finer, finer + 1]
    for finer, (goes, _) in reversed([*enumerate(thresholds(page))]):
        changes += [1.01 * goes, 0.99 * goes]
        expected += [finer + 1, finer]
    found = page.look(*({"distance": d} for d in changes))
    assert [state["distance"] for state, _ in found] == pytest.approx(changes), "none is clamped"
    assert [state["used"] for state, _ in found] == expected
    assert [state["row"] for state, _ in found] == expected, "the one that the table marks"
    assert found[1][0]["shown"] == "LOD1"


def test_the_level_that_is_named_is_the_one_that_is_drawn(page: Page) -> None:
    """By pixels, each in a colour of its own: as that level held, and as no other."""
    levels = range(len(page.chain.levels))
    changes = []
    for _, comes in thresholds(page):
        changes.append({**VIEW, "distance": 1.01 * comes, "colored": True, "level": "auto"})
        changes += [{"level": n} for n in levels]
    found = page.look(*changes)
    pictures = [shown for _, shown in found]
    for level in levels[1:]:
        chosen, *held = pictures[(level - 1) * (len(levels) + 1) :][: len(levels) + 1]
        assert [np.array_equal(chosen, other) for other in held] == [n == level for n in levels]
    assert list(np.argsort(pictures[0][..., :3].sum(axis=(0, 1)))) == [0, 1, 2], "LOD1 is blue"


def test_levels_are_held_from_anywhere_and_shown_as_wires(page: Page) -> None:
    far = 2 * thresholds(page)[-1][1]
    (before, lines), (after, _) = page.look(
        {**VIEW, "level": 3, "wireframe": True, "distance": 10}, {"distance": far}
    )
    assert before["used"] == after["used"] == 3
    assert before["shown"] == "LOD3, held"
    assert 0 < lines[..., 3].mean() < 0.5


def test_hands_move_the_eye_and_the_sun(page: Page) -> None:
    start = {"azimuth": 0, "elevation": 0, "distance": 30}
    found = page.look(
        start,
        {"keys": ["ArrowRight", "ArrowRight", "ArrowUp", "-"], "set": {}},
        {"drag": [50, 20], "set": start},
        {"drag": [50, 20], "set": {}},
        {"slide": ["sun-elevation", 12], "set": {}},
        {"slide": ["distance", 1000], "set": {}},
        {"keys": ["Home"], "set": {}},
    )
    states = [state for state, _ in found]
    first, keys, _, dragged, lit, far, home = states
    assert (keys["azimuth"], keys["elevation"]) == (10, 5)
    assert keys["distance"] == pytest.approx(33)
    assert 180 < dragged["azimuth"] < 360, "the plant follows the hand to the right"
    assert dragged["elevation"] > 0, "the eye goes up"
    assert lit["sunElevation"] == 12
    assert not np.array_equal(found[3][1], found[4][1])
    assert far["used"] == len(page.chain.levels) - 1
    assert home["distance"] < first["distance"]
    assert home["used"] == 0
