"""Plants, levels and chains as .glb files, read back by the tests' own parser."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from written import billboard_level, hybrid_level, leafy_plant, parse, small_chain

import vegtool
from vegtool.errors import OutputError
from vegtool.formats.gltf import (
    chain_glb,
    file_names,
    level_glb,
    plant_glb,
    screen_coverage,
    write_chain,
)
from vegtool.lod import Level, billboard_quads, level_triangles
from vegtool.plant import Branches, Texture


def test_a_plant_is_one_node_with_one_primitive_for_each_material_in_use():
    plant = leafy_plant()
    unused = replace(plant, materials=(*plant.materials, replace(plant.materials[0], name="no")))
    glb = parse(plant_glb(unused))
    assert glb.json["asset"] == {"version": "2.0", "generator": f"vegtool {vegtool.__version__}"}
    assert [node["name"] for node in glb.json["nodes"]] == ["two squares"]
    assert "translation" not in glb.json["nodes"][0]
    assert glb.json["scenes"] == [{"nodes": [0]}]
    assert [m["name"] for m in glb.json["materials"]] == ["bark", "leaf"]
    bark, leaf = glb.primitive(0, 0), glb.primitive(0, 1)
    assert np.array_equal(bark["POSITION"], plant.positions[:4].astype(np.float32))
    assert np.array_equal(leaf["POSITION"], plant.positions[4:].astype(np.float32))
    assert np.array_equal(leaf["TEXCOORD_0"], plant.uvs[4:])
    assert np.array_equal(leaf["NORMAL"], plant.normals[4:])
    assert leaf["indices"].tolist() == [0, 1, 2, 0, 2, 3]
    assert leaf["indices"].dtype == np.uint16


def test_position_bounds_are_exact_in_float32():
    plant = leafy_plant(positions=leafy_plant().positions * 0.1 + 1 / 3)
    glb = parse(plant_glb(plant))
    for primitive in glb.json["meshes"][0]["primitives"]:
        accessor = glb.json["accessors"][primitive["attributes"]["POSITION"]]
        stored = glb.accessor(primitive["attributes"]["POSITION"])
        assert accessor["min"] == stored.min(axis=0).astype(float).tolist()
        assert accessor["max"] == stored.max(axis=0).astype(float).tolist()


def test_material_values_reach_the_file():
    glb = parse(plant_glb(leafy_plant()))
    bark, leaf = glb.material(0, 0), glb.material(0, 1)
    surface = bark["pbrMetallicRoughness"]
    assert surface["baseColorFactor"] == [0.5, 0.4, 0.3, 1.0]
    assert (surface["metallicFactor"], surface["roughnessFactor"]) == (0.1, 0.7)
    assert bark["normalTexture"]["scale"] == 0.5
    assert "alphaMode" not in bark
    assert "alphaCutoff" not in bark  # ignored, and warned of, outside MASK
    assert not bark["doubleSided"]
    assert (leaf["alphaMode"], leaf["alphaCutoff"], leaf["doubleSided"]) == ("MASK", 0.3, True)
    picture = glb.pixels(leaf["pbrMetallicRoughness"]["baseColorTexture"]["index"])
    assert np.array_equal(picture, leafy_plant().materials[1].color_texture.pixels)


def test_only_normal_mapped_parts_carry_tangents():
    glb = parse(plant_glb(leafy_plant()))
    # Upright square facing +z: the picture's right is +x, its top +y = cross(+z, +x).
    assert glb.primitive(0, 0)["TANGENT"].tolist() == [[1, 0, 0, 1]] * 4
    assert "TANGENT" not in glb.primitive(0, 1)


def test_a_shared_texture_is_written_once():
    plant = leafy_plant()
    shared = replace(plant.materials[0], color_texture=plant.materials[1].color_texture)
    glb = parse(plant_glb(replace(plant, materials=(shared, plant.materials[1]))))
    assert len(glb.json["images"]) == len(glb.json["textures"]) == 2


@pytest.mark.parametrize(("mime_type", "form"), [("image/png", "PNG"), ("image/jpeg", "JPEG")])
def test_encoded_textures_are_passed_through(mime_type, form):
    buffer = BytesIO()
    pixels = np.random.default_rng(0).integers(0, 256, (4, 4, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(buffer, form)
    texture = Texture("t", np.zeros((4, 4, 4), np.uint8), buffer.getvalue(), mime_type)
    plant = leafy_plant()
    leaf = replace(plant.materials[1], color_texture=texture)
    glb = parse(plant_glb(replace(plant, materials=(plant.materials[0], leaf))))
    index = glb.material(0, 1)["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    assert glb.image_bytes(index) == buffer.getvalue()
    assert glb.json["images"][glb.json["textures"][index]["source"]]["mimeType"] == mime_type


def test_webp_becomes_png_because_core_gltf_has_no_webp():
    texture = Texture("t", np.full((4, 4, 4), 255, np.uint8), b"RIFF....WEBP", "image/webp")
    plant = leafy_plant()
    leaf = replace(plant.materials[1], color_texture=texture)
    glb = parse(plant_glb(replace(plant, materials=(plant.materials[0], leaf))))
    index = glb.material(0, 1)["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    assert np.array_equal(glb.pixels(index), texture.pixels[..., :3])  # opaque: no alpha stored


def test_vertex_colours_are_normalised_shorts():
    colors = np.tile([0.0, 0.25, 1.0, 1.0], (8, 1))
    glb = parse(plant_glb(leafy_plant(colors=colors)))
    stored = glb.primitive(0, 1)["COLOR_0"]
    assert stored.dtype == np.uint16
    assert np.allclose(stored / 65535, colors[4:], atol=0.5 / 65535)
    assert "COLOR_0" not in parse(plant_glb(leafy_plant())).primitive()


def test_texture_coordinates_are_stored_where_there_are_any_or_a_texture_asks_for_them():
    """A texture without coordinates would be an invalid file: all zero, as they were read, then."""
    plant = leafy_plant(uvs=np.zeros((8, 2)))
    assert not parse(plant_glb(plant)).primitive(0, 1)["TEXCOORD_0"].any()
    plain = tuple(replace(m, color_texture=None, normal_texture=None) for m in plant.materials)
    assert "TEXCOORD_0" not in parse(plant_glb(replace(plant, materials=plain))).primitive(0, 1)
    mapped = replace(leafy_plant(), materials=plain)
    assert "TEXCOORD_0" in parse(plant_glb(mapped)).primitive(0, 1)


def test_branches_are_written_for_each_vertex_and_split_where_they_meet():
    # The bark square's two triangles lie on different branches and share an edge (vertices 0, 2).
    branches = Branches(
        np.array([0, 1, 1, 2]), np.array([-1, 0, 1]), np.array([0, 1, 2]), "generator"
    )
    plant = leafy_plant(branches=branches)
    glb = parse(plant_glb(plant))
    for part in (0, 1):
        stored = glb.primitive(0, part)
        corner_branch = stored["_BRANCH"][stored["indices"]].reshape(-1, 3)
        expected = branches.face_branch[2 * part : 2 * part + 2]
        assert np.array_equal(corner_branch, np.repeat(expected[:, None], 3, axis=1))
        corner_parent = stored["_BRANCH_PARENT"][stored["indices"]].reshape(-1, 3)
        assert np.array_equal(corner_parent[:, 0], branches.parent[expected])
        corners = stored["POSITION"][stored["indices"]].reshape(-1, 3, 3)
        assert np.array_equal(corners, plant.corners[2 * part : 2 * part + 2])


def test_the_original_in_a_chain_carries_no_branches():
    branches = Branches(np.zeros(4, int), np.array([-1]), np.array([0]), "generator")
    chain = small_chain(levels=(Level("mesh", mesh=leafy_plant(branches=branches)),))
    assert "_BRANCH" not in parse(chain_glb(chain)).primitive()


def test_zero_normals_become_unit_vectors():
    normals = leafy_plant().normals.copy()
    normals[0] = 0
    stored = parse(plant_glb(leafy_plant(normals=normals))).primitive()["NORMAL"]
    assert np.allclose(np.linalg.norm(stored, axis=1), 1)


@pytest.mark.parametrize(("vertices", "dtype"), [(65535, np.uint16), (65536, np.uint32)])
def test_index_size_grows_with_the_vertices(vertices, dtype):
    positions = np.random.default_rng(0).random((vertices, 3))
    faces = np.arange(vertices - vertices % 3).reshape(-1, 3)
    faces = np.concatenate([faces, [[vertices - 3, vertices - 2, vertices - 1]]])
    plant = leafy_plant(
        positions=positions,
        normals=np.tile([0.0, 1.0, 0.0], (vertices, 1)),
        uvs=np.zeros((vertices, 2)),
        faces=faces,
        face_material=np.ones(len(faces), np.int32),
    )
    stored = parse(plant_glb(plant)).primitive()
    assert stored["indices"].dtype == dtype
    assert np.array_equal(stored["indices"].reshape(-1, 3), faces)


def test_vertices_that_no_face_uses_are_left_out():
    plant = leafy_plant(faces=leafy_plant().faces[[0, 2]], face_material=np.array([0, 1], np.int32))
    stored = parse(plant_glb(plant)).primitive(0, 1)
    assert np.array_equal(stored["POSITION"], plant.positions[4:7])
    assert stored["indices"].tolist() == [0, 1, 2]


def test_a_plant_at_map_coordinates_keeps_its_shape():
    far = np.array([691_234.567, 250.25, 5_334_890.125])  # UTM-like metres; float32 steps 0.5 m
    positions = leafy_plant().positions + far
    glb = parse(plant_glb(leafy_plant(positions=positions)))
    offset = np.array(glb.json["nodes"][0]["translation"])
    assert np.array_equal(offset, offset.astype(np.float32))
    for part, mine in ((0, positions[:4]), (1, positions[4:])):
        world = glb.primitive(0, part)["POSITION"].astype(float) + offset
        assert np.abs(world - mine).max() < 1e-6  # metres


def test_a_level_is_one_mesh_with_its_atlas():
    level = billboard_level(5)
    glb, quads = parse(level_glb(level, "oak_LOD2")), billboard_quads(level)
    assert [node["name"] for node in glb.json["nodes"]] == ["oak_LOD2"]
    assert len(glb.json["meshes"]) == len(glb.json["meshes"][0]["primitives"]) == 1
    stored = glb.primitive()
    for name, mine in (
        ("POSITION", quads.positions),
        ("NORMAL", quads.normals),
        ("TANGENT", quads.tangents),
        ("TEXCOORD_0", quads.uvs),
    ):
        assert np.array_equal(stored[name], mine.astype(np.float32)), name
    assert np.array_equal(stored["indices"], quads.indices)
    material = glb.material()
    assert (material["alphaMode"], material["alphaCutoff"]) == ("MASK", 0.5)
    assert material["doubleSided"]
    color = material["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    assert np.array_equal(glb.pixels(color), level.atlas.color)
    normal = glb.pixels(material["normalTexture"]["index"])
    assert np.array_equal(normal, level.atlas.normal)  # three channels: no alpha


def test_two_sided_levels_are_pairs_of_single_sided_quads():
    glb = parse(level_glb(billboard_level(2, double_sided=False), "x"))
    assert not glb.material()["doubleSided"]
    assert len(glb.primitive()["indices"]) == 2 * 12


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_hybrid_is_one_primitive_with_one_material(double_sided):
    level = hybrid_level(2, double_sided=double_sided)
    glb, drawn = parse(level_glb(level, "oak_LOD1")), level_triangles(level)
    assert len(glb.json["meshes"][0]["primitives"]) == len(glb.json["materials"]) == 1
    assert glb.material()["alphaMode"] == "MASK"
    assert glb.material()["doubleSided"] == double_sided
    stored = glb.primitive()
    assert set(stored) == {"POSITION", "NORMAL", "TANGENT", "TEXCOORD_0", "COLOR_0", "indices"}
    assert len(stored["indices"]) == 3 * level.triangles
    for name, values in (
        ("POSITION", drawn.positions),
        ("NORMAL", drawn.normals),
        ("TANGENT", drawn.tangents),
        ("TEXCOORD_0", drawn.uvs),
    ):
        assert np.array_equal(stored[name], values.astype(np.float32)), name
    assert stored["COLOR_0"].dtype == np.uint16
    assert np.allclose(stored["COLOR_0"] / 65535, drawn.colors, atol=0.5 / 65535)


def test_billboards_alone_have_no_vertex_colours():
    assert "COLOR_0" not in parse(level_glb(billboard_level(2), "x")).primitive()


def test_a_hybrids_bounds_are_those_of_both_parts():
    level = hybrid_level(1)
    level = replace(level, mesh=replace(level.mesh, positions=level.mesh.positions + 1e4))
    glb = parse(level_glb(level, "x"))
    places = np.concatenate([billboard_quads(level).positions, level.mesh.positions])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    assert "translation" not in glb.json["nodes"][0], "its origin lies between its parts"
    far = replace(level.billboards, center=level.billboards.center + 2e5)
    moved = replace(level.mesh, positions=level.mesh.positions + 2e5)
    glb = parse(level_glb(replace(level, billboards=far, mesh=moved), "x"))
    assert glb.json["nodes"][0]["translation"] == pytest.approx((middle + 2e5).tolist(), abs=0.1)


def test_a_mesh_level_is_written_as_a_plant():
    glb = parse(level_glb(Level("mesh", mesh=leafy_plant()), "reduced"))
    assert glb.json["nodes"][0]["name"] == "reduced"
    assert len(glb.json["meshes"][0]["primitives"]) == 2


def test_a_chain_shows_the_original_and_lists_the_rest_by_msft_lod():
    glb = parse(chain_glb(small_chain()))
    assert [n["name"] for n in glb.json["nodes"]] == ["tree_LOD0", "tree_LOD1", "tree_LOD2"]
    assert glb.json["scenes"][glb.json["scene"]] == {"nodes": [0]}
    assert glb.json["extensionsUsed"] == ["MSFT_lod"]
    assert "extensionsRequired" not in glb.json
    node = glb.json["nodes"][0]
    assert node["extensions"] == {"MSFT_lod": {"ids": [1, 2]}}
    assert len(node["extras"]["MSFT_screencoverage"]) == 3


def test_a_chain_of_the_original_alone_needs_no_extension():
    chain = small_chain()
    glb = parse(chain_glb(replace(chain, levels=chain.levels[:1])))
    assert "extensionsUsed" not in glb.json


def test_screen_coverage_is_the_height_at_which_the_next_level_takes_over():
    # 60 degrees: at 10 m the image is 2 * 10 * tan(30) = 11.547 m high, and the plant 1 m.
    coverage = screen_coverage(small_chain())
    assert coverage == pytest.approx([1 / 11.547, 1 / 23.094, 1 / 1080], rel=1e-4)


@pytest.mark.parametrize("distances", [(0.1, 0.2), (10.0, 10.0), (1e6, 2e6)])
def test_screen_coverage_decreases_strictly_from_at_most_one(distances):
    chain = small_chain()
    levels = (chain.levels[0], *(billboard_level(1, near=d) for d in distances))
    coverage = screen_coverage(replace(chain, levels=levels))
    assert coverage[0] <= 1
    assert all(a > b > 0 for a, b in pairwise(coverage))


def test_levels_of_a_far_chain_share_one_origin():
    move = 1e5
    plant = leafy_plant(positions=leafy_plant().positions + move)
    chain = small_chain(levels=(Level("mesh", mesh=plant), billboard_level(3, move=move)))
    nodes = parse(chain_glb(chain)).json["nodes"]
    assert nodes[0]["translation"] == nodes[1]["translation"]
    assert nodes[0]["translation"][0] == pytest.approx(move, abs=1)


def test_write_chain_writes_every_file_named(tmp_path: Path):
    paths = write_chain(small_chain(), tmp_path / "out", depth=True, extra={"tree.png": b"x"})
    names = [path.name for path in paths]
    assert sorted(names) == sorted([*file_names("tree", 3, depth=True), "tree.png"])
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(names)
    assert (tmp_path / "out/tree_LOD1.glb").read_bytes() == level_glb(
        small_chain().levels[1], "tree_LOD1"
    )
    assert (tmp_path / "out/tree.glb").read_bytes() == chain_glb(small_chain())
    with Image.open(tmp_path / "out/tree_LOD1_depth.png") as image:
        assert np.array_equal(np.asarray(image), small_chain().levels[1].atlas.depth)


def test_the_same_chain_gives_the_same_bytes(tmp_path: Path):
    first = {p.name: p.read_bytes() for p in write_chain(small_chain(), tmp_path / "a")}
    second = {p.name: p.read_bytes() for p in write_chain(small_chain(), tmp_path / "b")}
    assert first == second


def test_write_chain_never_writes_over_its_input(tmp_path: Path):
    own = tmp_path / "tree.glb"
    own.write_bytes(b"mine")
    with pytest.raises(OutputError, match="is the input"):
        write_chain(small_chain(), tmp_path, force=True, inputs=[own])
    assert [p.name for p in tmp_path.iterdir()] == ["tree.glb"]
    assert own.read_bytes() == b"mine"
