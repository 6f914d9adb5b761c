"""What throws the shadow: its silhouette is the plant's, and there is nothing else to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hybrids import hybrid_of
from plants import plant_of

from vegtool.baking.options import BakeOptions
from vegtool.convert import ConvertOptions, convert, level_maker
from vegtool.formats import read_plant
from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lod import Atlas, Billboards, Display, Level, ShadowProxy
from vegtool.measure.distances import rounded_up
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import TruthsAt
from vegtool.measure.views import distance_of
from vegtool.plant import Plant
from vegtool.progress import silent
from vegtool.refine.shadow_proxy import PIXELS, SUNS, as_caster, shadow_proxy

pytestmark = pytest.mark.gl
OFF = MeasureOptions(measure="off")


def shadow_of(plant: Plant, triangles: int, **options: object) -> ShadowProxy:
    told = ConvertOptions(billboards=4, levels=1, pixels=PIXELS, shadow_proxy=triangles, **options)
    shadow = convert(plant, told, OFF).shadow
    assert shadow is not None
    return shadow


def worst_bias(shadow: ShadowProxy) -> float:
    bias = shadow.errors["coverage_bias"]
    return max(bias.high, -bias.low)


@pytest.fixture(scope="module")
def broadleaf() -> dict[int, ShadowProxy]:
    """Of a tree, by triangles."""
    plant, options = sample("broadleaf", 2000), ConvertOptions()
    near_m = rounded_up(distance_of(plant, options.display, 2 * PIXELS))
    return {
        count: shadow_proxy(
            plant,
            options.display,
            lambda buffers, seen, metres, count=count: level_maker(
                buffers, seen, options, casts=True
            )(count // 2, metres, silent),
            near_m,
        )
        for count in (48, 400)
    }


def test_there_is_none_unless_asked_for() -> None:
    options = ConvertOptions(billboards=4, levels=1, refine="none")
    assert convert(sample("bush", 300), options, OFF).shadow is None


def test_its_silhouettes_are_the_plants_from_all_suns(broadleaf: dict[int, ShadowProxy]) -> None:
    """Coverage right from each of 12 suns, and silhouettes nearer with more triangles."""
    few, many = broadleaf[48], broadleaf[400]
    for most, shadow in broadleaf.items():
        assert 2 <= shadow.level.triangles <= most
        assert (shadow.pixels, shadow.suns) == (PIXELS, SUNS)
        assert set(shadow.errors) == set(shadow.live) == {"coverage_bias", "silhouette"}
        assert worst_bias(shadow) < 0.15
        assert abs(shadow.errors["coverage_bias"].mean) < 0.06
    assert many.errors["silhouette"].mean < few.errors["silhouette"].mean < 0.7
    assert many.live == few.live, "that is of the plant"


LIT = {"prelit": True, "sun": "90,40"}


@pytest.mark.parametrize(
    ("refine", "options"),
    [("full", LIT), ("full", {"occlusion": 1.0}), ("none", LIT), ("none", {"translucency": 0.4})],
)
def test_it_is_white_whatever_light_the_levels_have(
    refine: str, options: dict[str, object]
) -> None:
    level = shadow_of(sample("bush", 300), 40, refine=refine, **options).level
    assert level.unlit and level.double_sided
    if level.mesh is not None:
        assert level.mesh.exposure is None
        assert level.mesh.colors is None or (level.mesh.colors == 1).all()
    if level.atlas is not None:
        assert (level.atlas.color[..., :3] == 255).all()
        assert level.atlas.normal is None and level.atlas.light is None


def test_a_hybrid_keeps_its_alpha_and_its_shape() -> None:
    level = hybrid_of(sample("bush", 600), 8, 100.0)
    caster = as_caster(level)
    assert level.atlas is not None and caster.atlas is not None
    assert level.mesh is not None and caster.mesh is not None
    assert np.array_equal(caster.atlas.color[..., 3], level.atlas.color[..., 3])
    assert np.array_equal(caster.mesh.positions, level.mesh.positions)
    assert (caster.triangles, caster.kind) == (level.triangles, "hybrid")
    assert not (level.mesh.colors == 1).all() and level.atlas.normal is not None, "as it was"
    assert caster.texels == level.texels / 2, "no normals"


def test_a_mesh_keeps_its_faces_alone() -> None:
    plant = sample("bush", 300)
    caster = as_caster(Level("mesh", mesh=plant))
    assert caster.mesh is not None
    assert np.array_equal(caster.mesh.faces, plant.faces)
    (material,) = caster.mesh.materials
    assert material.unlit and material.double_sided and material.textures == ()
    assert caster.mesh.colors is None and caster.texels == 0


def test_the_file_is_read_back_white_cut_out_and_without_normals(
    broadleaf: dict[int, ShadowProxy], tmp_path: Path
) -> None:
    level = broadleaf[48].level
    assert level.atlas is not None
    path = tmp_path / "oak_shadow.glb"
    path.write_bytes(level_glb(level, "oak_shadow"))
    assert path.read_bytes().count(b"\x89PNG") == 1
    plant = read_plant(path)
    (material,) = plant.materials
    assert material.unlit and material.double_sided and material.alpha_mode == "mask"
    assert material.normal_texture is None and material.light_texture is None
    assert material.color_texture is not None
    assert (material.color_texture.pixels[..., :3] == 255).all()
    assert np.array_equal(material.color_texture.pixels[..., 3], level.atlas.color[..., 3])
    assert plant.colors is None or (plant.colors == 1).all()
    assert len(plant.faces) == level.triangles


def two_sided(alpha: np.ndarray, front: list[int], back: list[int]) -> Level:
    """One billboard with a picture on each side, rectangles of an atlas of that alpha."""
    color = np.zeros((*alpha.shape, 4), np.uint8)
    color[..., 3] = alpha
    normal = np.full((*alpha.shape, 3), 128, np.uint8)
    rects = np.array([front]), np.array([back])
    atlas = Atlas(color, normal, np.zeros(alpha.shape, np.uint16), *rects)
    x, y = np.eye(3)[:1], np.eye(3)[1:2]
    plane = Billboards(np.zeros((1, 3)), x, y, np.ones((1, 2)), np.zeros(1), np.zeros(1))
    return Level("billboards", billboards=plane, atlas=atlas, double_sided=False)


def test_of_two_pictures_one_is_left_that_covers_what_either_does() -> None:
    gutter = BakeOptions().gutter
    first, second = (slice(gutter, gutter + 6), slice(gutter + 20, gutter + 26))
    alpha = np.zeros((6 + 2 * gutter, 40), np.uint8)
    rng = np.random.default_rng(0)
    alpha[first, first], alpha[first, second] = rng.integers(0, 256, (2, 6, 6))
    level = two_sided(alpha, [gutter, gutter, 6, 6], [gutter + 20, gutter, 6, 6])
    caster = as_caster(level)
    assert caster.atlas is not None
    found = caster.atlas.color[..., 3]
    either = np.maximum(alpha[first, first], alpha[first, second])
    assert np.array_equal(found[first, first], either)
    assert not found[first, second].any(), "nothing shows it"
    assert (caster.triangles, level.triangles) == (2, 4)
    assert np.array_equal(caster.atlas.front, caster.atlas.back)


def test_an_empty_back_of_one_texel_adds_nothing() -> None:
    gutter = BakeOptions().gutter
    alpha = np.zeros((6 + 2 * gutter, 40), np.uint8)
    alpha[gutter : gutter + 6, gutter : gutter + 6] = 200
    caster = as_caster(two_sided(alpha, [gutter, gutter, 6, 6], [gutter + 20, gutter, 1, 1]))
    assert caster.atlas is not None
    assert np.array_equal(caster.atlas.color[..., 3], alpha)


@pytest.mark.parametrize("refine", ["full", "none"])
def test_leaves_that_show_one_side_throw_shadows_from_both(refine: str) -> None:
    """Two sheets side by side, single-sided, facing opposite ways: a sun sees both, and half of
    them would be a bias of a half."""
    left = np.array([[[-2.0, 0, 0], [0, 0, 0], [0, 2, 0]], [[-2, 0, 0], [0, 2, 0], [-2, 2, 0]]])
    right = left + np.array([2.0, 0, 0])
    sheets = np.concatenate([left, right[:, ::-1]])
    parts = np.linspace(0, 1, 5)[:-1]
    corners = [
        sheets * [0.25, 0.25, 1] + [4 * a - 1.5, 2 * b, 0.0] for a in parts for b in parts
    ]  # many small ones, so that there is something to save
    plant = plant_of(np.concatenate(corners), double_sided=False)
    shadow = shadow_of(plant, 8, refine=refine)
    assert shadow.level.triangles <= 8
    assert worst_bias(shadow) < 0.2
    assert abs(shadow.live["coverage_bias"].mean) < 0.05


@pytest.mark.parametrize(("refine", "triangles"), [("full", 2), ("none", 2), ("none", 3)])
def test_the_fewest_triangles_do(refine: str, triangles: int) -> None:
    assert shadow_of(sample("bush", 300), triangles, refine=refine).level.triangles == 2


def test_no_more_triangles_than_save_something() -> None:
    plant = sample("bush", 300)
    assert shadow_of(plant, 10_000).level.triangles <= 0.75 * len(plant.faces)


def test_it_is_made_for_where_it_is_measured_or_nearer() -> None:
    plant, asked = sample("bush", 300), []
    level = hybrid_of(plant, 4, 20.0)
    far = rounded_up(distance_of(plant, Display(), PIXELS))

    def make(buffers: PlantBuffers, seen: TruthsAt, near_m: float) -> Level:
        asked.append(near_m)
        return level

    for near_m in (0.5 * far, 2 * far):
        shadow_proxy(plant, Display(), make, near_m)
    assert asked == [0.5 * far, far]


def test_same_plant_same_bytes() -> None:
    one, two = (shadow_of(sample("bush", 300), 30, refine="none") for _ in range(2))
    assert level_glb(one.level, "x") == level_glb(two.level, "x")
    assert one.errors == two.errors


def test_making_one_leaves_the_levels_as_they_are() -> None:
    plant, options = sample("bush", 300), ConvertOptions(billboards=20, levels=1)
    with_one = convert(plant, replace(options, shadow_proxy=20), OFF)
    without = convert(plant, options, OFF)
    for a, b in zip(with_one.levels[1:], without.levels[1:], strict=True):
        assert level_glb(a, "x") == level_glb(b, "x")
