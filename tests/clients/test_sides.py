"""Light on the two sides of billboards, in three.js: bright is the side before which the sun is.

What turns a plane round is easily done once too often: a quad's normals, its tangents and their
signs, the mirrored picture of a back, and the client's own turn of the normals of back faces. The
back of a plane is then lit by a sun that stands behind it. So every billboard of a level is drawn
alone and white, from along its normal and from along the opposite direction, by three's own loader
with its own material, under a sun behind the eye and one behind the plane.

A texel sends sun * max(N.L, 0) + sky. Between the two suns that differs by sun * N.V, whichever way
its normal leans, so the difference of the means over a picture, divided by the sun's strength, is
the mean of N.V: how much the normals face the viewer, or, where it is negative, face away. Single
texels may face away, because a card's normals are those of its source; hence means. The sky is the
same all round, or sides would differ by which of them looks up.

Suns between the eye and the right, and between the eye and above, tell left from right and up from
down. Such pictures are compared with our own renderer's, which takes its tangents from texture
coordinates instead of the file. Three's stock material is a little darker than Lambert's law, by
what it reflects without scattering it; with a Lambert material it agrees with ours closely.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, fields, replace
from functools import cache
from math import atan, degrees, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from programs import MARKS, node

from vegtool.arrays import FloatArray, Picture
from vegtool.convert import ConvertOptions, convert
from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, live
from vegtool.measure.views import Camera

pytestmark = MARKS

FACING = 0.2  # least mean of N.V; measured 0.32 and more, so a side lit wrongly has -0.32 and less
AWAY = 0.02  # of the albedo: what texels that face away may add under a sun behind the plane
ALIKE = 0.005  # of the albedo: the two sides of one picture; measured 0.0007
LAMBERT = 0.008  # of the albedo: three's Lambert and our pictures; measured 0.004
STOCK = 0.035  # of the albedo: three's stock material and our pictures; measured -0.019 to -0.004
AREA = (2.0, 0.02)  # pixels, and share of the area: three's and ours; measured 3, or 1 of 32
LEAST_AREA = 4.0  # pixels that a side covers, to be judged
SIZE = 64  # pixels of a picture, which a billboard's diagonal fills
FOCAL_PX = 2.0 * SIZE
LIGHT = Light(sun=0.7, sky_above=0.2, sky_below=0.2)
FRONT, BACK = SIDES = ("front", "back")
EYE, PLANE, RIGHT, ABOVE = "behind the eye", "behind the plane", "to the right", "above"
SUNS = {"stock": (EYE, PLANE), "lambert": (EYE, PLANE, RIGHT, ABOVE)}
LEVELS = {
    f"{refine} {sides}": (refine, sides)
    for refine in ("none", "full")
    for sides in ("double", "opposite")
}
FAULTS: dict[str, tuple[str, list[int]]] = {
    "normals": ("NORMAL", [-1, -1, -1]),
    "tangents": ("TANGENT", [-1, -1, -1, 1]),
    "signs": ("TANGENT", [1, 1, 1, -1]),
}
"""Attributes of a file, and by what they are multiplied: what must not go unseen."""
FAULTY, FAULTY_COUNT = "none opposite", 8
"""The level that has them, and of how many of its billboards."""


@dataclass(frozen=True)
class Seen:
    """One side as a renderer shows it. area: pixels covered. light: by sun, its mean over them, as
    a factor of the albedo."""

    area: float
    light: dict[str, float]

    @property
    def facing(self) -> float:
        """The mean of N.V."""
        return (self.light[EYE] - self.light[PLANE]) / LIGHT.sun


Shown = dict[tuple[int, str], Seen]
"""By billboard and side."""


@cache
def level_of(name: str) -> Level:
    refine, sides = LEVELS[name]
    plant = sample("broadleaf", 2000)
    if sides == "opposite":  # what leaves of one side alone get
        materials = tuple(replace(m, double_sided=False) for m in plant.materials)
        plant = replace(plant, materials=materials)
    options = ConvertOptions(refine=refine, billboards=32, levels=1)
    level = convert(plant, options, MeasureOptions(measure="off")).levels[1]
    assert level.kind == {"none": "billboards", "full": "hybrid"}[refine]
    assert level.double_sided == (sides == "double")
    return level


@cache
def alone(name: str) -> list[Level]:
    """Each billboard of a level by itself, white, without what is baked of light beside normals."""
    level = level_of(name)
    b, atlas = level.billboards, level.atlas
    assert b is not None and atlas is not None
    white = np.dstack([np.full_like(atlas.color[..., :3], 255), atlas.color[..., 3]])
    atlas = replace(atlas, color=white, light=None)
    levels = []
    for p in range(len(b)):
        one = {f.name: getattr(b, f.name)[p : p + 1] for f in fields(b)}
        picture = replace(atlas, front=atlas.front[p : p + 1], back=atlas.back[p : p + 1])
        made = replace(
            level, kind="billboards", mesh=None, billboards=replace(b, **one), atlas=picture
        )
        levels.append(made)
    return levels


def camera_of(level: Level, side: str) -> Camera:
    b = level.billboards
    assert b is not None
    direction = b.normal[0] if side == FRONT else -b.normal[0]
    radius = float(np.linalg.norm(b.half_size[0]))
    distance = radius / sin(atan(SIZE / 2 / FOCAL_PX))
    middle = (SIZE / 2, SIZE / 2)
    return Camera(b.center[0], direction, distance, FOCAL_PX, SIZE, SIZE, middle, 1.5 * radius)


def sun_of(camera: Camera, sun: str) -> FloatArray:
    right, up, back = camera.axes
    return {EYE: back, PLANE: -back, RIGHT: back + right, ABOVE: back + up}[sun]


def as_three(camera: Camera, sun: str, out: Path) -> dict[str, Any]:
    """The view in three's own terms."""
    return {
        "eye": camera.eye.tolist(), "target": camera.target.tolist(), "up": camera.axes[1].tolist(),
        "fov": degrees(2 * atan(SIZE / 2 / FOCAL_PX)), "full": [SIZE, SIZE],
        "crop": [0, 0, SIZE, SIZE], "near": camera.distance_m - camera.depth_m,
        "far": camera.distance_m + camera.depth_m, "sun": sun_of(camera, sun).tolist(),
        "out": str(out),
    }  # fmt: skip


def faulty(glb: bytes, attribute: str, factors: list[int]) -> bytes:
    """The same file with an attribute of its mesh multiplied."""
    (length,) = struct.unpack_from("<I", glb, 12)
    gltf = json.loads(glb[20 : 20 + length])
    ((primitive,),) = (mesh["primitives"] for mesh in gltf["meshes"])
    accessor = gltf["accessors"][primitive["attributes"][attribute]]
    view = gltf["bufferViews"][accessor["bufferView"]]
    first = 28 + length + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    changed = bytearray(glb)
    shape = accessor["count"], len(factors)
    assert "byteStride" not in view and accessor["componentType"] == 5126
    values = np.frombuffer(changed, "<f4", shape[0] * shape[1], first).reshape(shape)
    values *= factors
    return bytes(changed)


@pytest.fixture(scope="session")
def three(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Shown]:
    """All levels, and those with faults, drawn by one browser; by name and material."""
    folder = tmp_path_factory.mktemp("sides")
    cases = [
        *((name, material, "") for name in LEVELS for material in SUNS),
        *((FAULTY, material, fault) for fault in FAULTS for material in SUNS),
    ]
    jobs = []
    outs: dict[tuple[str, str], dict[tuple[int, str], dict[str, Path]]] = {}
    for name, material, fault in cases:
        for p, level in enumerate(alone(name)[: FAULTY_COUNT if fault else None]):
            glb = level_glb(level, "level")
            file = folder / f"{len(jobs)}.glb"
            file.write_bytes(faulty(glb, *FAULTS[fault]) if fault else glb)
            views = []
            for side in SIDES:
                made = {sun: folder / f"{len(jobs)} {side} {sun}" for sun in SUNS[material]}
                outs.setdefault((fault or name, material), {})[p, side] = made
                camera = camera_of(level, side)
                views += [as_three(camera, sun, out) for sun, out in made.items()]
            jobs.append({"file": str(file), "stock": material == "stock", "views": views})
    light = {"sun": LIGHT.sun, "above": LIGHT.sky_above, "below": LIGHT.sky_below}
    for answer in node("draw_in_three.mjs", {"light": light, "jobs": jobs}):
        assert answer["complaints"] == []
    return {
        key: {
            side: seen({sun: picture_in(out) for sun, out in made.items()})
            for side, made in each.items()
        }
        for key, each in outs.items()
    }


@cache
def ours(name: str) -> Shown:
    """What our own renderer shows."""
    shown = {}
    for p, level in enumerate(alone(name)):
        with PlantBuffers(client_plant(level), mipmaps=True) as buffers:
            for side in SIDES:
                camera = camera_of(level, side)
                lights = {
                    sun: replace(LIGHT, direction=sun_of(camera, sun)) for sun in SUNS["lambert"]
                }
                shown[p, side] = seen({s: live(buffers, camera, at) for s, at in lights.items()})
    return shown


def picture_in(file: Path) -> Picture:
    half = np.frombuffer(file.read_bytes(), np.float16)
    return half.reshape(SIZE, SIZE, 4).astype(np.float32)


def seen(pictures: dict[str, Picture]) -> Seen:
    areas = [float(picture[..., 3].sum()) for picture in pictures.values()]
    assert max(areas) == min(areas)  # suns hide nothing
    pixels = 3 * max(areas[0], 1e-9)
    return Seen(areas[0], {s: float(p[..., :3].sum()) / pixels for s, p in pictures.items()})


def judged(shown: Shown) -> Shown:
    return {side: each for side, each in shown.items() if each.area >= LEAST_AREA}


def apart(shown: Shown, others: Shown, suns: tuple[str, ...]) -> dict[tuple[int, str], float]:
    """By billboard and side, how far the light is from another renderer's, at the most of suns."""
    return {
        side: max(abs(each.light[sun] - others[side].light[sun]) for sun in suns)
        for side, each in judged(shown).items()
    }


@pytest.mark.parametrize("name", LEVELS)
def test_a_side_is_bright_where_the_sun_is_before_it(
    name: str, three: dict[tuple[str, str], Shown]
) -> None:
    sides = judged(three[name, "stock"])
    fronts, backs = ([p for p, side in sides if side == which] for which in SIDES)
    assert fronts == list(range(len(alone(name))))  # the front is the side that shows more
    assert len(backs) >= (1.0 if name.endswith("double") else 0.8) * len(fronts)
    wrong = {side: each.facing for side, each in sides.items() if each.facing < FACING}
    assert not wrong
    sunlit = {
        p: s.light[PLANE] for p, s in sides.items() if s.light[PLANE] > LIGHT.sky_above + AWAY
    }
    assert not sunlit


@pytest.mark.parametrize("name", [name for name in LEVELS if name.endswith("double")])
def test_one_picture_serves_both_sides_alike(
    name: str, three: dict[tuple[str, str], Shown]
) -> None:
    sides = three[name, "stock"]
    for p in range(len(alone(name))):
        front, back = sides[p, FRONT], sides[p, BACK]
        assert abs(front.area - back.area) <= AREA[0] + AREA[1] * front.area, p
        assert max(abs(front.light[sun] - back.light[sun]) for sun in (EYE, PLANE)) <= ALIKE, p


@pytest.mark.parametrize("name", LEVELS)
def test_three_lights_sides_as_we_do(name: str, three: dict[tuple[str, str], Shown]) -> None:
    for material, limit in (("stock", STOCK), ("lambert", LAMBERT)):
        shown = three[name, material]
        for side, each in ours(name).items():
            assert abs(shown[side].area - each.area) <= AREA[0] + AREA[1] * each.area, side
        found = apart(shown, ours(name), SUNS[material])
        assert max(found.values()) <= limit, found


def test_reversed_normals_are_found(three: dict[tuple[str, str], Shown]) -> None:
    sides = judged(three["normals", "stock"])
    assert len(sides) == 2 * FAULTY_COUNT
    assert max(each.facing for each in sides.values()) <= -FACING


@pytest.mark.parametrize("fault", ["tangents", "signs"])
def test_tangents_that_lean_the_wrong_way_are_found(
    fault: str, three: dict[tuple[str, str], Shown]
) -> None:
    """On every side: a sun along the normal does not show them, but those beside it do."""
    found = apart(three[fault, "lambert"], ours(FAULTY), SUNS["lambert"])
    assert min(found.values()) > LAMBERT, found
