"""Light in glTF: unlit materials, light that passes through, the sky that reaches a vertex."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from made import QUAD_UV, Gltf, png
from PIL import Image
from written import Glb, billboard_level, hybrid_level, leafy_plant, parse, small_chain

from vegtool.formats import read_plant
from vegtool.formats.gltf import (
    chain_glb,
    file_names,
    level_glb,
    plant_glb,
    write_chain,
)
from vegtool.formats.manifest import LevelFile, manifest, read_manifest, schema
from vegtool.formats.ramp import RAMP, written_texels
from vegtool.lod import Level
from vegtool.plant import Plant

UNLIT, TRANSMISSION = "KHR_materials_unlit", "KHR_materials_diffuse_transmission"
TINT = np.array([1.2, 0.9, 0.25])
EXPOSURE = np.array([[0, 0], [1, 1], [1, 0], [0, 1], [0.5, 0.25], [0.1, 0.9], [1 / 3, 0.8], [1, 1]])


def with_leaf(**changes: Any) -> Plant:
    """The plant of two squares, its leaf changed."""
    plant = leafy_plant()
    bark, leaf = plant.materials
    return replace(plant, materials=(bark, replace(leaf, **changes)))


def lit_level(through: int = 90, **changes: Any) -> Level:
    """Billboards with light beside their colours: random sky, `through` of 255 passes."""
    level = billboard_level(2)
    assert level.atlas is not None
    light = np.zeros((*level.atlas.color.shape[:2], 4), np.uint8)
    light[..., :2] = np.random.default_rng(0).integers(0, 256, (*light.shape[:2], 2))
    light[..., 3] = through
    atlas = replace(level.atlas, light=light, transmission_tint=[0.9, 1.0, 0.3])
    return replace(level, atlas=replace(atlas, **changes))


def read_back(data: bytes, folder: Path) -> Plant:
    path = folder / "plant.glb"
    path.write_bytes(data)
    return read_plant(path)


def lists(glb: Glb) -> tuple[list[str], list[str]]:
    """Extensions used, and required."""
    return glb.json.get("extensionsUsed", []), glb.json.get("extensionsRequired", [])


def test_a_plant_without_light_uses_no_extension() -> None:
    glb = parse(plant_glb(leafy_plant()))
    assert lists(glb) == ([], [])
    assert all("occlusionTexture" not in m for m in glb.json["materials"])
    assert "TEXCOORD_1" not in glb.primitive(0, 1)


def test_light_that_passes_through_a_leaf_is_read_back(tmp_path: Path) -> None:
    """In the file it has a colour of its own: the surface's factor times the tint, and texture."""
    plant = with_leaf(base_color=[0.5, 0.8, 0.4, 1], transmission=0.4, transmission_tint=TINT)
    glb = parse(plant_glb(plant))
    assert lists(glb) == ([TRANSMISSION], [])
    bark, leaf = glb.material(0, 0), glb.material(0, 1)
    assert "extensions" not in bark
    through = leaf["extensions"][TRANSMISSION]
    assert through["diffuseTransmissionFactor"] == 0.4
    assert through["diffuseTransmissionColorFactor"] == pytest.approx([0.6, 0.72, 0.1])
    surface = leaf["pbrMetallicRoughness"]
    assert through["diffuseTransmissionColorTexture"] == surface["baseColorTexture"]
    back = read_back(plant_glb(plant), tmp_path)
    assert back.materials[1].transmission == pytest.approx(0.4, abs=1e-6)
    assert np.allclose(back.materials[1].transmission_tint, TINT, rtol=0, atol=1e-6)
    assert back.materials[0].transmission == 0
    assert back.notes == ()


def test_without_textures_it_is_read_back_too(tmp_path: Path) -> None:
    plant = with_leaf(color_texture=None, transmission=0.25, transmission_tint=[0.5, 1, 0.1])
    glb = parse(plant_glb(plant))
    through = glb.material(0, 1)["extensions"][TRANSMISSION]
    assert "diffuseTransmissionColorTexture" not in through
    leaf = read_back(plant_glb(plant), tmp_path).materials[1]
    assert leaf.transmission == 0.25
    assert np.allclose(leaf.transmission_tint, [0.5, 1, 0.1], rtol=0, atol=1e-6)


@pytest.mark.parametrize("color", [[1, 1, 1], [0.9, 0.4, 0.1], [1e-3, 0.5, 0]])
@pytest.mark.parametrize("base", [[1, 0.8, 0.4, 1], [1e-3, 0.5, 0.01, 1], [1.5, 0.9, 0, 1]])
@pytest.mark.parametrize("textured", ["both", "surface", "neither"])
def test_what_is_read_is_what_is_written(
    tmp_path: Path, base: list[float], color: list[float], textured: str
) -> None:
    """Colours that pass through are those that pictures of the plant are drawn with: the surface's
    own times the tint."""
    made = Gltf()
    info = {"index": made.image(png(np.full((2, 2, 3), 90, np.uint8)))}
    surface = {"baseColorFactor": base}
    values = {"diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": color}
    if textured != "neither":
        surface |= {"baseColorTexture": info}
    if textured == "both":
        values |= {"diffuseTransmissionColorTexture": info}
    entry = made.material(pbrMetallicRoughness=surface, extensions={TRANSMISSION: values})
    made.node(mesh=made.mesh(material=entry, TEXCOORD_0=QUAD_UV))
    plant = read_plant(made.write(tmp_path / "leaf.glb"))
    (material,) = plant.materials
    assert 0 <= material.transmission_tint.min() <= material.transmission_tint.max() <= 4
    drawn = material.base_color[:3] * material.transmission_tint
    stored = parse(plant_glb(plant)).material()
    through = stored["extensions"][TRANSMISSION]
    assert np.allclose(through["diffuseTransmissionColorFactor"], drawn, rtol=0, atol=1e-12)
    texture = stored["pbrMetallicRoughness"].get("baseColorTexture")
    assert through.get("diffuseTransmissionColorTexture") == texture
    if textured != "surface" and not [n for n in plant.notes if "would be brighter than" in n]:
        assert np.allclose(drawn, np.where(material.base_color[:3] > 0, color, 0))


def test_light_through_coloured_vertices_has_their_mean_colour() -> None:
    """glTF multiplies the base colour by COLOR_0 and not what passes: it would pass as white."""
    plant = with_leaf(transmission=0.4, color_texture=None, base_color=[1, 1, 1, 1.0])
    colors = np.ones((len(plant.positions), 4))
    colors[:, :3] = [0.1, 0.5, 0.05]
    found = parse(plant_glb(replace(plant, colors=colors))).json["materials"]
    through = [m["extensions"][TRANSMISSION] for m in found if "extensions" in m]
    assert [t["diffuseTransmissionColorFactor"] for t in through] == [
        pytest.approx([0.1, 0.5, 0.05])
    ]


def test_transmitted_light_is_no_brighter_than_all_that_comes() -> None:
    glb = parse(plant_glb(with_leaf(transmission=0.5, transmission_tint=[3.0, 1, 1])))
    through = glb.material(0, 1)["extensions"][TRANSMISSION]
    assert max(through["diffuseTransmissionColorFactor"]) == 1.0


def test_unlit_materials_are_read_back_and_have_no_other_light(tmp_path: Path) -> None:
    plant = replace(with_leaf(unlit=True, transmission=0.4), exposure=EXPOSURE)
    glb = parse(plant_glb(plant))
    assert lists(glb) == ([UNLIT], [])
    leaf = glb.material(0, 1)
    assert leaf["extensions"] == {UNLIT: {}}
    assert "occlusionTexture" not in leaf and "TEXCOORD_1" not in glb.primitive(0, 1)
    assert [m.unlit for m in read_back(plant_glb(plant), tmp_path).materials] == [False, True]


def bilinear(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(n, 4) what a client sees of (h, w, 4) texels, clamped to the edge, at (n, 2) coordinates."""
    height, width = texture.shape[:2]
    place = uv * [width, height] - 0.5
    low = np.floor(place).astype(int)
    (s, t), (x, y) = (place - low).T, low.T

    def texel(dx: int, dy: int) -> np.ndarray:
        row, column = np.clip(y + dy, 0, height - 1), np.clip(x + dx, 0, width - 1)
        return np.asarray(texture[row, column], dtype=np.float64)

    weights = (1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t
    places = (0, 0), (1, 0), (0, 1), (1, 1)
    return np.asarray(sum(w[:, None] * texel(*p) for w, p in zip(weights, places, strict=True)))


def test_the_ramp_shows_what_the_vertices_hold() -> None:
    """Its steps are 17, so that values between them are exact: what is left is 16-bit rounding."""
    plant = leafy_plant(exposure=EXPOSURE)
    glb = parse(plant_glb(plant))
    assert lists(glb) == ([], [])
    for part, exposure in ((0, EXPOSURE[:4]), (1, EXPOSURE[4:])):
        occlusion, stored = glb.material(0, part)["occlusionTexture"], glb.primitive(0, part)
        assert occlusion["texCoord"] == 1
        assert {"TEXCOORD_0", "TEXCOORD_1"} <= set(stored)
        assert stored["TEXCOORD_1"].dtype == np.uint16
        uv = stored["TEXCOORD_1"] / 65535
        assert uv.min() > 0.499 / 16 and uv.max() < 15.501 / 16
        seen = bilinear(glb.pixels(occlusion["index"]), uv) / 255
        assert np.abs(seen[:, 0] - exposure[:, 0]).max() < 1e-4
        assert np.abs(seen[:, 1] - exposure[:, 1]).max() < 1e-4
        assert np.array_equal(seen[:, 1], seen[:, 3])


def test_the_ramp_is_one_small_image_that_does_not_repeat() -> None:
    assert RAMP.shape == (16, 16, 4)
    plain = leafy_plant()
    more = parse(plant_glb(replace(plain, exposure=EXPOSURE)))
    assert len(more.json["images"]) == len(parse(plant_glb(plain)).json["images"]) + 1
    index = more.material()["occlusionTexture"]["index"]
    assert index == more.material(0, 1)["occlusionTexture"]["index"]
    sampler = more.json["samplers"][more.json["textures"][index]["sampler"]]
    assert sampler["wrapS"] == sampler["wrapT"] == 33071


def test_an_exposed_plant_without_texture_has_both_sets_of_coordinates(tmp_path: Path) -> None:
    """glTF asks for TEXCOORD_0 before TEXCOORD_1."""
    plant = leafy_plant(exposure=EXPOSURE, uvs=np.zeros((8, 2)))
    plain = [replace(m, color_texture=None, normal_texture=None) for m in plant.materials]
    plant = replace(plant, materials=tuple(plain))
    stored = parse(plant_glb(plant)).primitive(0, 0)
    assert not stored["TEXCOORD_0"].any() and stored["TEXCOORD_1"].any()
    assert read_back(plant_glb(plant), tmp_path).notes == ()


def test_vertices_split_for_tangents_keep_their_exposure() -> None:
    """The bark is normal-mapped; mirroring one of its triangles splits vertices 0 and 2."""
    plant = leafy_plant(exposure=EXPOSURE)
    uvs = plant.uvs.copy()
    uvs[3] = [1.5, 0.5]
    stored = parse(plant_glb(replace(plant, uvs=uvs))).primitive(0, 0)
    assert len(stored["POSITION"]) == 6
    corners = stored["POSITION"][stored["indices"]].reshape(-1, 3, 3)
    assert np.array_equal(corners, plant.corners[:2])
    seen = (stored["TEXCOORD_1"][stored["indices"]] / 65535 * 16 - 0.5) / 15
    assert np.allclose(seen.reshape(-1, 3, 2), EXPOSURE[plant.faces[:2]], atol=1e-4)


def test_a_level_with_light_has_it_as_occlusion_and_transmission() -> None:
    level = lit_level()
    glb = parse(level_glb(level, "oak_LOD1"))
    assert lists(glb) == ([TRANSMISSION], [])
    material = glb.material()
    light = material["occlusionTexture"]
    assert level.atlas is not None
    assert np.array_equal(glb.pixels(light["index"]), level.atlas.light)
    assert material["extensions"][TRANSMISSION] == {
        "diffuseTransmissionFactor": 1.0,
        "diffuseTransmissionTexture": light,
        "diffuseTransmissionColorTexture": material["pbrMetallicRoughness"]["baseColorTexture"],
        "diffuseTransmissionColorFactor": [0.9, 1.0, 0.3],
    }
    assert [image["name"] for image in glb.json["images"]] == [
        "oak_LOD1_color",
        "oak_LOD1_normal",
        "oak_LOD1_light",
    ]


def test_a_level_that_nothing_passes_through_uses_no_extension() -> None:
    glb = parse(level_glb(lit_level(through=0), "x"))
    assert lists(glb) == ([], [])
    assert "occlusionTexture" in glb.material()


def test_a_level_with_light_is_read_as_its_mean(tmp_path: Path) -> None:
    back = read_back(level_glb(lit_level(through=102), "x"), tmp_path)
    (material,) = back.materials
    assert material.transmission == pytest.approx(0.4)
    assert np.allclose(material.transmission_tint, [0.9, 1.0, 0.3])
    assert [n for n in back.notes if "its mean, 0.4" in n]


@pytest.mark.parametrize("kind", ["billboards", "hybrid"])
def test_an_unlit_level_has_colours_alone(tmp_path: Path, kind: str) -> None:
    level = billboard_level(2) if kind == "billboards" else hybrid_level(2)
    assert level.atlas is not None
    level = replace(level, unlit=True, atlas=replace(level.atlas, normal=None))
    glb = parse(level_glb(level, "x"))
    assert lists(glb) == ([UNLIT], [])
    assert len(glb.json["images"]) == 1
    assert "normalTexture" not in glb.material()
    assert "TANGENT" not in glb.primitive() and "NORMAL" in glb.primitive()
    assert read_back(level_glb(level, "x"), tmp_path).materials[0].unlit


def test_a_chain_of_all_kinds_shares_one_ramp() -> None:
    plant = replace(with_leaf(transmission=0.3), exposure=EXPOSURE)
    coarse = Level("mesh", mesh=replace(plant, name="coarse"), near_distance_m=5.0)
    levels = (Level("mesh", mesh=plant), coarse, replace(lit_level(), near_distance_m=9.0))
    glb = parse(chain_glb(small_chain(levels=levels)))
    used, required = lists(glb)
    assert sorted(used) == [TRANSMISSION, "MSFT_lod"] and required == []
    names = [image["name"] for image in glb.json["images"]]
    assert len(names) == len(set(names)), "each image once"
    assert names.count("exposure_ramp") == 1


def test_the_ramp_counts_as_texels_where_it_is_written() -> None:
    """16 x 16: of the original and of a level that is a mesh; not of unlit ones or of an atlas."""
    plant = replace(with_leaf(transmission=0.3), exposure=EXPOSURE)
    unlit = tuple(replace(m, unlit=True) for m in plant.materials)
    meshes = [plant, replace(plant, exposure=None), replace(plant, materials=unlit)]
    levels = [Level("mesh", mesh=mesh) for mesh in meshes]
    exposed, plain, without = levels
    assert written_texels(exposed) == plain.texels + 256
    assert written_texels(plain) == written_texels(without) == plain.texels
    atlas = lit_level()
    assert written_texels(atlas) == atlas.texels
    for level in levels:
        names = {i["name"] for i in parse(level_glb(level, "x")).json["images"]}
        assert ("exposure_ramp" in names) == (level is exposed)
    chain = small_chain(levels=(exposed, replace(plain, near_distance_m=5.0)))
    rows = manifest(chain, [LevelFile("x.glb", 1)] * 2)["levels"]
    assert [row["texels"] for row in rows] == [plain.texels + 256, plain.texels]


def test_writing_leaves_the_plant_as_it_was() -> None:
    plant = replace(with_leaf(transmission=0.4, transmission_tint=TINT), exposure=EXPOSURE.copy())
    first = plant_glb(plant)
    assert np.array_equal(plant.exposure, EXPOSURE)
    assert np.array_equal(plant.materials[1].transmission_tint, TINT)
    assert plant_glb(plant) == first


def test_a_packed_texture_lies_beside_each_level_with_light(tmp_path: Path) -> None:
    chain = small_chain()
    levels = (chain.levels[0], lit_level(), replace(chain.levels[2], unlit=True))
    paths = write_chain(replace(chain, levels=levels), tmp_path, packed=True)
    names = {path.name for path in paths}
    assert names == set(file_names("tree", 3, packed=True)) - {"tree_LOD2_leaf.png"}
    with Image.open(tmp_path / "tree_LOD1_leaf.png") as image:
        assert np.array_equal(np.asarray(image), levels[1].atlas.light)
    values = read_manifest(tmp_path / "tree.lod.json")
    jsonschema.validate(values, schema())
    assert [level.get("leaf") for level in values["levels"]] == [None, "tree_LOD1_leaf.png", None]
    assert [level.get("unlit") for level in values["levels"]] == [None, None, True]


def test_no_packed_texture_unless_asked_for(tmp_path: Path) -> None:
    chain = small_chain()
    write_chain(replace(chain, levels=(chain.levels[0], lit_level())), tmp_path)
    assert not list(tmp_path.glob("*_leaf.png"))


def test_the_schema_knows_sun_and_shadow(tmp_path: Path) -> None:
    write_chain(small_chain(), tmp_path)
    values = read_manifest(tmp_path / "tree.lod.json")
    sun = {"azimuth_deg": 90.0, "elevation_deg": 45.0, "sun": 3.0, "sky_above": 1, "sky_below": 0.3}
    values |= {"sun": sun, "shadow": {"file": "tree_shadow.glb", "triangles": 40, "bytes": 900}}
    jsonschema.validate(values, schema())
    for broken in ({"shadow": {"file": "x"}}, {"sun": {"azimuth_deg": "east"}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(values | broken, schema())
