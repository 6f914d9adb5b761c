"""glTF's geometry, node tree and materials, each by the smallest file that shows the case."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import (
    QUAD,
    QUAD_FACES,
    QUAD_UV,
    Gltf,
    leaf_pixels,
    png,
    quad_file,
    tube,
    tube_faces,
)

from vegtool.formats import ReadOptions, read_plant
from vegtool.plant import Plant

TRIANGLE = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]], np.float32)
UP_NORMALS = np.tile(np.array([0, 0, 1], np.float32), (4, 1))


def quad(tmp_path: Path, **mesh: Any) -> Plant:
    return read_plant(quad_file(tmp_path / "quad.glb", **mesh))


def placed(tmp_path: Path, **node: Any) -> Plant:
    """A quad with normals along z, under one node."""
    made = Gltf()
    made.node(mesh=made.mesh(NORMAL=UP_NORMALS), **node)
    return read_plant(made.write(tmp_path / "placed.glb"))


def signed_area(plant: Plant) -> np.ndarray:
    return plant.face_area_vectors.sum(axis=0)


def test_a_quad_as_it_stands(tmp_path: Path) -> None:
    plant = quad(tmp_path, TEXCOORD_0=QUAD_UV, NORMAL=UP_NORMALS)
    assert np.array_equal(plant.positions, QUAD)
    assert np.array_equal(plant.uvs, QUAD_UV)
    assert np.array_equal(plant.faces.ravel(), QUAD_FACES)
    assert plant.materials[0].alpha_mode == "opaque" and plant.notes == ()


def test_vertices_that_no_face_uses_are_dropped(tmp_path: Path) -> None:
    more = np.concatenate([QUAD, [[9, 9, 9]]]).astype(np.float32)
    plant = quad(tmp_path, positions=more)
    assert len(plant.positions) == 4


def test_missing_normals_are_those_of_the_card(tmp_path: Path) -> None:
    plant = quad(tmp_path)
    assert np.array_equal(plant.normals, UP_NORMALS)
    assert any("normals of 4 of 4" in note for note in plant.notes)


def test_missing_normals_are_weighted_by_area(tmp_path: Path) -> None:
    """Two faces at a shared edge, areas 1 (facing z) and 3 (facing x): their sum is (3, 0, 1)."""
    positions = np.array([[0, 0, 0], [0, 2, 0], [-1, 1, 0], [0, 1, 3]], np.float32)
    faces = np.array([0, 1, 2, 1, 0, 3], np.uint16)
    plant = quad(tmp_path, positions=positions, indices=faces)
    assert np.allclose(signed_area(plant), [-3, 0, 1])
    assert np.allclose(plant.normals[0], np.array([-3, 0, 1]) / np.sqrt(10))
    assert np.allclose(plant.normals[3], [-1, 0, 0])


def test_zero_and_broken_normals_are_repaired_others_kept(tmp_path: Path) -> None:
    normals = np.array([[0, 0, 0], [np.nan, 0, 0], [0, 0, -5], [0, 3, 4]], np.float32)
    plant = quad(tmp_path, NORMAL=normals)
    assert np.allclose(plant.normals, [[0, 0, 1], [0, 0, 1], [0, 0, -1], [0, 0.6, 0.8]])
    assert any("normals of 2 of 4" in note for note in plant.notes)


def test_two_sided_card_on_shared_points_keeps_both_faces_and_unit_normals(tmp_path: Path) -> None:
    faces = np.array([0, 1, 2, 0, 2, 1], np.uint16)
    plant = quad(tmp_path, indices=faces)
    assert len(plant.faces) == 2
    assert np.allclose(np.linalg.norm(plant.normals, axis=1), 1)


def test_repeated_and_flat_faces_are_dropped_and_counted(tmp_path: Path) -> None:
    """The repeat starts at another corner; the back side of a card is no repeat."""
    faces = np.array([0, 1, 2, 1, 2, 0, 0, 2, 1, 0, 0, 1, 0, 2, 3], np.uint16)
    plant = quad(tmp_path, indices=faces, NORMAL=UP_NORMALS)
    assert plant.faces.tolist() == [[0, 1, 2], [0, 2, 1], [0, 2, 3]]
    assert plant.notes == ("dropped 1 of 5 faces without area", "dropped 1 of 5 faces repeated")


def test_repeats_are_found_across_vertices(tmp_path: Path) -> None:
    """A mesh exported twice over has the same faces on other vertices."""
    twice = np.concatenate([QUAD, QUAD])
    faces = np.concatenate([QUAD_FACES, QUAD_FACES + 4]).astype(np.uint16)
    assert len(quad(tmp_path, positions=twice, indices=faces).faces) == 2


def test_repeated_faces_against_a_plain_search() -> None:
    """The oracle compares every pair of faces corner by corner."""
    from vegtool.formats.clean import repeated_faces

    rng = np.random.default_rng(3)
    positions = rng.integers(0, 2, (30, 3)).astype(float)
    uvs = rng.integers(0, 2, (30, 2)).astype(float)
    faces = rng.integers(0, 30, (300, 3))
    group = rng.integers(0, 2, 300)
    rows = np.concatenate([positions, uvs], axis=1)

    def canonical(face: np.ndarray, kind: int) -> tuple[Any, ...]:
        corners = [tuple(rows[k]) for k in face]
        return (kind, *min(corners[k:] + corners[:k] for k in range(3)))

    seen: set[tuple[Any, ...]] = set()
    expected = []
    for face, kind in zip(faces, group, strict=True):
        key = canonical(face, int(kind))
        expected.append(key in seen)
        seen.add(key)
    found = repeated_faces(positions, uvs, faces, group)
    # corners that coincide let the hash start at either of two places: only real triangles count
    real = np.array([len({tuple(rows[k]) for k in face}) == 3 for face in faces])
    assert expected and np.array_equal(found[real], np.array(expected)[real])


def test_strips_and_fans(tmp_path: Path) -> None:
    strip = quad(tmp_path, indices=np.array([0, 1, 3, 2], np.uint16), mode=5)
    fan = quad(tmp_path, indices=np.array([0, 1, 2, 3], np.uint16), mode=6)
    plain = quad(tmp_path)
    for plant in (strip, fan):
        assert np.allclose(signed_area(plant), signed_area(plain)) and len(plant.faces) == 2
    assert len(quad(tmp_path, indices=None, positions=TRIANGLE).faces) == 1


def test_points_and_lines_are_left_out_with_a_note(tmp_path: Path) -> None:
    made = Gltf()
    made.node(mesh=made.mesh())
    made.node(mesh=made.mesh(mode=1))
    plant = read_plant(made.write(tmp_path / "lines.glb"))
    assert len(plant.faces) == 2 and "points and lines are left out" in plant.notes


def test_a_mirror_turns_faces_and_normals_stay_outside(tmp_path: Path) -> None:
    plant = placed(tmp_path, scale=[-1, 1, 1])
    assert np.allclose(signed_area(plant), [0, 0, 1]) and np.allclose(plant.normals, [0, 0, 1])
    flipped = placed(tmp_path, scale=[1, 1, -1])
    assert np.allclose(signed_area(flipped), [0, 0, -1])
    assert np.allclose(flipped.normals, [0, 0, -1])


def test_normals_under_uneven_scale_stay_perpendicular(tmp_path: Path) -> None:
    made = Gltf()
    slope = np.array([[0, 0, 0], [1, 0, 1], [0, 1, 0]], np.float32)
    normals = np.tile(np.array([-np.sqrt(0.5), 0, np.sqrt(0.5)], np.float32), (3, 1))
    made.node(
        mesh=made.mesh(slope, np.array([0, 1, 2], np.uint16), NORMAL=normals), scale=[3, 1, 1]
    )
    plant = read_plant(made.write(tmp_path / "slope.glb"))
    expected = np.array([-1, 0, 3]) / np.sqrt(10)
    assert np.allclose(plant.normals, expected, atol=1e-7)


def test_nested_transforms_and_matrices(tmp_path: Path) -> None:
    """A quarter turn about y takes x to -z; the parent then moves by 10 along x."""
    half = np.sqrt(0.5)
    made = Gltf()
    top = made.node(translation=[10, 0, 0])
    made.node(parent=top, mesh=made.mesh(), rotation=[0, half, 0, half])
    plant = read_plant(made.write(tmp_path / "nested.glb"))
    assert np.allclose(plant.positions[1], [10, 0, -1])
    matrix = [0, 0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 10, 0, 0, 1]  # the same, by columns
    assert np.allclose(placed(tmp_path, matrix=matrix).positions, plant.positions)


def test_one_mesh_in_several_nodes_and_instances(tmp_path: Path) -> None:
    made = Gltf()
    mesh = made.mesh()
    made.node(mesh=mesh)
    made.node(mesh=mesh, translation=[0, 0, 5])
    move = made.array(np.array([[0, 0, 1], [0, 0, 2], [0, 0, 3]], np.float32))
    size = made.array(np.array([[1, 1, 1], [2, 2, 2], [-1, 1, 1]], np.float32))
    made.node(
        mesh=mesh,
        extensions={
            "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": move, "SCALE": size}}
        },
    )
    plant = read_plant(made.write(tmp_path / "many.glb"))
    assert len(plant.faces) == 10
    assert sorted(set(plant.positions[:, 2])) == [0, 1, 2, 3, 5]
    assert plant.positions[:, 0].min() == -1 and plant.positions[:, 0].max() == 2
    assert (plant.face_area_vectors[:, 2] > 0).all()  # the mirrored instance faces z as well


def test_only_the_default_scene_is_read(tmp_path: Path) -> None:
    made = Gltf()
    made.node(mesh=made.mesh())
    made.json["nodes"].append({"mesh": 0, "translation": [0, 0, 9]})
    made.json["scenes"].append({"nodes": [1]})
    made.json["scene"] = 1
    plant = read_plant(made.write(tmp_path / "scenes.glb"))
    assert (plant.positions[:, 2] == 9).all() and any("scene 1 of 2" in n for n in plant.notes)
    del made.json["scene"], made.json["scenes"]
    assert len(read_plant(made.write(tmp_path / "bare.glb")).faces) == 4


def test_lower_levels_of_detail_are_left_out(tmp_path: Path) -> None:
    made = Gltf()
    mesh = made.mesh()
    made.node(mesh=mesh, name="Oak_LOD0")
    made.node(mesh=mesh, name="Oak_LOD1", translation=[0, 0, 1])
    plant = read_plant(made.write(tmp_path / "lods.glb"))
    assert len(plant.faces) == 2 and any("LOD1" in note for note in plant.notes)


def test_quantised_attributes(tmp_path: Path) -> None:
    made = Gltf()
    positions = np.array([[0, 0, 0, 0], [32767, 0, 0, 0], [0, 32767, 0, 0]], np.int16)
    normals = np.array([[0, 0, 127, 0]] * 3, np.int8)
    uvs = np.array([[0, 65535], [65535, 65535], [0, 0]], np.uint16)
    primitive: dict[str, Any] = {"attributes": {}}
    for name, values, kind in (("POSITION", positions, "VEC3"), ("NORMAL", normals, "VEC3")):
        index = made.array(values, normalized=True)
        made.json["accessors"][index]["type"] = kind  # the fourth component is padding
        view = made.json["accessors"][index]["bufferView"]
        made.json["bufferViews"][view]["byteStride"] = values.itemsize * 4
        primitive["attributes"][name] = index
    primitive["attributes"]["TEXCOORD_0"] = made.array(uvs, normalized=True)
    made.json["meshes"].append({"primitives": [primitive]})
    made.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    made.node(mesh=0, scale=[2, 2, 2])
    plant = read_plant(made.write(tmp_path / "small.glb"))
    assert np.allclose(plant.positions, [[0, 0, 0], [2, 0, 0], [0, 2, 0]])
    assert np.allclose(plant.normals, [0, 0, 1])
    assert np.allclose(plant.uvs, [[0, 1], [1, 1], [0, 0]])


def test_sparse_accessors_and_wrong_bounds(tmp_path: Path) -> None:
    made = Gltf()
    mesh = made.mesh()
    rows = made.view(np.array([2], np.uint16).tobytes())
    values = made.view(np.array([[1, 1, 7]], np.float32).tobytes())
    made.json["accessors"][0].update(
        min=[-99, -99, -99],
        max=[99, 99, 99],
        sparse={
            "count": 1,
            "indices": {"bufferView": rows, "componentType": 5123},
            "values": {"bufferView": values},
        },
    )
    made.node(mesh=mesh)
    plant = read_plant(made.write(tmp_path / "sparse.glb"))
    assert plant.positions[2].tolist() == [1, 1, 7] and plant.bounds[0].tolist() == [0, 0, 0]
    del made.json["accessors"][0]["bufferView"]  # all zero but the one
    made.json["accessors"][0]["sparse"]["values"]["bufferView"] = made.view(
        np.array([[1, 1, 7]], np.float32).tobytes()
    )
    with pytest.raises(Exception, match="without area"):
        read_plant(made.write(tmp_path / "zeros.glb"))


def test_interleaved_attributes(tmp_path: Path) -> None:
    made = Gltf()
    both = np.concatenate([QUAD, QUAD_UV], axis=1).astype(np.float32)
    view = made.view(both.tobytes(), byteStride=20)
    entry = {"bufferView": view, "componentType": 5126, "count": 4}
    made.json["accessors"] += [
        {**entry, "type": "VEC3"},
        {**entry, "type": "VEC2", "byteOffset": 12},
    ]
    indices = made.array(QUAD_FACES)
    made.json["meshes"].append(
        {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": indices}]}
    )
    made.node(mesh=0)
    plant = read_plant(made.write(tmp_path / "interleaved.glb"))
    assert np.array_equal(plant.positions, QUAD) and np.array_equal(plant.uvs, QUAD_UV)


def test_far_from_the_origin_nothing_is_lost(tmp_path: Path) -> None:
    """5,000 km away by its node, millimetres survive and the offset is kept."""
    small = (QUAD * 1e-3).astype(np.float32)
    made = Gltf()
    made.node(mesh=made.mesh(small), translation=[5e6, 12.0, -5e6])
    plant = read_plant(made.write(tmp_path / "far.glb"))
    assert not any("rounds them" in note for note in plant.notes)
    assert np.allclose(plant.positions - [5e6, 12, -5e6], small, atol=2e-9)
    assert np.allclose(plant.normals, [0, 0, 1])
    coarse = quad(tmp_path, positions=(QUAD * 10 + [5e6, 0, 0]).astype(np.float32))
    assert any("rounds them" in note for note in coarse.notes)


def test_texture_transform(tmp_path: Path) -> None:
    """Scale, then a quarter turn counter-clockwise as seen (v points down), then the offset."""
    made = Gltf()
    texture = made.image(png(leaf_pixels()))
    transform = {"offset": [0.25, 0.5], "scale": [2, 3], "rotation": np.pi / 2}
    leaf = made.material(
        pbrMetallicRoughness={
            "baseColorTexture": {
                "index": texture,
                "extensions": {"KHR_texture_transform": transform},
            }
        }
    )
    made.node(mesh=made.mesh(material=leaf, TEXCOORD_0=QUAD_UV))
    plant = read_plant(made.write(tmp_path / "turned.glb"))
    u, v = QUAD_UV.T
    assert np.allclose(plant.uvs, np.stack([3 * v + 0.25, -2 * u + 0.5], axis=1))


def test_second_texture_coordinates(tmp_path: Path) -> None:
    made = Gltf()
    info = {"index": made.image(png(leaf_pixels())), "texCoord": 1}
    leaf = made.material(pbrMetallicRoughness={"baseColorTexture": info})
    other = (QUAD_UV * 0.5).astype(np.float32)
    made.node(mesh=made.mesh(material=leaf, TEXCOORD_0=QUAD_UV, TEXCOORD_1=other))
    plant = read_plant(made.write(tmp_path / "second.glb"))
    assert np.array_equal(plant.uvs, other)


@pytest.mark.parametrize(
    ("wrap", "size", "noted"), [(33071, 2, True), (33071, 1, False), (10497, 2, False)]
)
def test_textures_that_do_not_repeat_are_noted_where_it_shows(
    tmp_path: Path, wrap: int, size: float, noted: bool
) -> None:
    made = Gltf()
    info = {"index": made.image(png(leaf_pixels()))}
    made.json["samplers"] = [{"wrapS": wrap}]
    made.json["textures"][0]["sampler"] = 0
    leaf = made.material(pbrMetallicRoughness={"baseColorTexture": info})
    made.node(mesh=made.mesh(material=leaf, TEXCOORD_0=(size * QUAD_UV).astype(np.float32)))
    plant = read_plant(made.write(tmp_path / "wrapped.glb"))
    assert any("clamped or mirrored" in note for note in plant.notes) == noted


def test_a_texture_without_coordinates_is_left_out_and_noted(tmp_path: Path) -> None:
    """Every face would show its first texel, here a transparent one: nothing at all."""
    made = Gltf()
    info = {"index": made.image(png(leaf_pixels()))}
    leaf = made.material(pbrMetallicRoughness={"baseColorTexture": info}, alphaMode="MASK")
    made.node(mesh=made.mesh(material=leaf))
    plant = read_plant(made.write(tmp_path / "bare.glb"))
    assert plant.materials[0].color_texture is None
    assert plant.materials[0].alpha_mode == "opaque"
    assert any("no texture coordinates" in note for note in plant.notes)


def leaf_card(tmp_path: Path, image: bytes, factor: Any = (1, 1, 1, 1), **entry: Any) -> Plant:
    made = Gltf()
    surface = {
        "baseColorTexture": {"index": made.image(image)},
        "baseColorFactor": list(factor),
    }
    leaf = made.material(pbrMetallicRoughness=surface, **entry)
    made.node(mesh=made.mesh(material=leaf, TEXCOORD_0=QUAD_UV, NORMAL=UP_NORMALS))
    return read_plant(made.write(tmp_path / "card.glb"))


SOLID = np.full((4, 4, 4), 255, np.uint8)


def test_alpha_modes(tmp_path: Path) -> None:
    cut = png(leaf_pixels())
    mask = leaf_card(tmp_path, cut, alphaMode="MASK").materials[0]
    assert (mask.alpha_mode, mask.alpha_cutoff, mask.role) == ("mask", 0.5, "leaf")
    low = leaf_card(tmp_path, cut, alphaMode="MASK", alphaCutoff=0.2).materials[0]
    assert low.alpha_cutoff == 0.2
    blend = leaf_card(tmp_path, cut, alphaMode="BLEND")
    assert blend.materials[0].alpha_mode == "mask" and "blended" in blend.notes[0]
    assert leaf_card(tmp_path, cut).materials[0].alpha_mode == "opaque"
    for mode in ("MASK", "BLEND"):  # alpha that hides nothing
        solid = leaf_card(tmp_path, png(SOLID), alphaMode=mode, name="bark")
        assert solid.materials[0].alpha_mode == "opaque" and solid.materials[0].role == "wood"
    faint = leaf_card(tmp_path, cut, factor=(1, 1, 1, 0.4), alphaMode="BLEND").materials[0]
    assert faint.alpha_cutoff == pytest.approx(0.2)  # half of its strongest alpha: not invisible
    glass = leaf_card(tmp_path, png(SOLID), factor=(1, 1, 1, 0.3), alphaMode="BLEND")
    assert glass.materials[0].base_color[3] == 1 and any("opaque" in n for n in glass.notes)
    gone = leaf_card(tmp_path, cut, alphaMode="MASK", alphaCutoff=1.5)
    assert any("nothing of it is visible" in note for note in gone.notes)


def test_palette_png_with_transparency_is_passed_on(tmp_path: Path) -> None:
    data = png(leaf_pixels(), palette=True)
    texture = leaf_card(tmp_path, data, alphaMode="MASK").materials[0].color_texture
    assert texture is not None and texture.encoded == data and texture.mime_type == "image/png"
    assert (texture.pixels[:, :4, 3] == 0).all() and (texture.pixels[:, 4:, 3] == 255).all()
    assert texture.pixels[0, 7].tolist() == [40, 160, 30, 255]


def test_sixteen_bit_grey_is_scaled_not_clipped(tmp_path: Path) -> None:
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(np.array([[0, 32896, 65535]], np.uint16)).save(stream, "PNG")
    texture = leaf_card(tmp_path, stream.getvalue()).materials[0].color_texture
    assert texture is not None and texture.pixels[0, :, 0].tolist() == [0, 128, 255]
    assert texture.encoded is None


def test_images_by_data_uri_file_webp_and_case(tmp_path: Path) -> None:
    import base64
    import io

    from PIL import Image

    data = png(leaf_pixels())
    (tmp_path / "Blatt grün.PNG").write_bytes(data)
    stream = io.BytesIO()
    Image.fromarray(leaf_pixels()).save(stream, "WEBP", lossless=True)
    (tmp_path / "leaf.webp").write_bytes(stream.getvalue())
    uris = (
        "data:image/png;base64," + base64.b64encode(data).decode(),
        "Blatt%20gr%C3%BCn.PNG",
        "blatt grün.png",
        "C:/art/Blatt grün.PNG",
        "textures/leaf.webp",
    )
    for uri in uris:
        made = Gltf()
        made.json["images"] = [{"uri": uri}]
        made.json["textures"] = [{"source": 0}]
        if uri.endswith("webp"):
            made.json["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
        leaf = made.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
        made.node(mesh=made.mesh(material=leaf, TEXCOORD_0=QUAD_UV))
        texture = read_plant(made.write(tmp_path / "a.glb")).materials[0].color_texture
        assert texture is not None, uri
        assert np.array_equal(texture.pixels[:, 4:], leaf_pixels()[:, 4:])


def test_loose_images_beside_a_file_without_textures_are_named(tmp_path: Path) -> None:
    (tmp_path / "leaf_color.png").write_bytes(png(leaf_pixels()))
    plant = quad(tmp_path, TEXCOORD_0=QUAD_UV)
    assert any("leaf_color.png" in note for note in plant.notes)
    assert not any("leaf_color.png" in note for note in quad(tmp_path).notes)


def test_material_factors(tmp_path: Path) -> None:
    material = leaf_card(tmp_path, png(SOLID), factor=(0.2, 0.4, 0.1, 1), doubleSided=True)
    assert material.materials[0].base_color.tolist() == [0.2, 0.4, 0.1, 1]
    assert material.materials[0].double_sided
    assert material.materials[0].metallic == 1.0  # glTF's default
    glossy = {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0.5, 0.6, 0.7, 1]}}
    made = Gltf()
    made.node(mesh=made.mesh(material=made.material(extensions=glossy)))
    old = read_plant(made.write(tmp_path / "old.glb")).materials[0]
    assert old.base_color.tolist() == [0.5, 0.6, 0.7, 1] and old.metallic == 0


def colored(tmp_path: Path, colors: np.ndarray, texture: bool, uv: np.ndarray = QUAD_UV) -> Plant:
    made = Gltf()
    surface = {"baseColorTexture": {"index": made.image(png(SOLID))}} if texture else {}
    leaf = made.material(pbrMetallicRoughness=surface)
    mesh = made.mesh(material=leaf, TEXCOORD_0=uv, NORMAL=UP_NORMALS, COLOR_0=colors)
    attribute = made.json["meshes"][mesh]["primitives"][0]["attributes"]["COLOR_0"]
    made.json["accessors"][attribute]["normalized"] = colors.dtype.kind == "u"
    made.node(mesh=mesh)
    return read_plant(made.write(tmp_path / "colored.glb"))


def test_vertex_colors_are_linear_factors(tmp_path: Path) -> None:
    grey = (np.array([[0.2] * 3, [0.4] * 3, [0.6] * 3, [1.0] * 3]) * 65535).astype(np.uint16)
    plant = colored(tmp_path, grey, texture=True)
    assert plant.colors is not None
    assert np.allclose(plant.colors[:, 0], [0.2, 0.4, 0.6, 1.0], atol=1e-4)
    assert colored(tmp_path, np.full((4, 4), 255, np.uint8), texture=True).colors is None


def test_wind_weights_are_no_colors(tmp_path: Path) -> None:
    weights = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 1], [0, 0, 1]], np.float32)
    plant = colored(tmp_path, weights, texture=True)
    assert plant.colors is None and any("wind" in note for note in plant.notes)
    assert colored(tmp_path, weights, texture=False).colors is not None  # painted by its vertices
    still = np.full_like(QUAD_UV, 0.5)  # one texel for the whole face
    assert colored(tmp_path, weights, texture=True, uv=still).colors is not None
    black = colored(tmp_path, np.zeros((4, 3), np.float32), texture=False)
    assert black.colors is None and any("black" in note for note in black.notes)


def test_units_and_axes(tmp_path: Path) -> None:
    path = quad_file(tmp_path / "quad.glb", NORMAL=UP_NORMALS)
    metres = read_plant(path)
    for unit, length in (("cm", 0.01), ("in", 0.0254), ("ft", 0.3048), ("2.5", 2.5)):
        scaled = read_plant(path, ReadOptions(unit=unit))
        assert np.allclose(scaled.positions, metres.positions * length)
        assert np.array_equal(scaled.normals, metres.normals)
    upward = {"x": 0, "y": 1, "z": 2}
    for up in ("x", "y", "z", "-x", "-y", "-z"):
        turned = read_plant(path, ReadOptions(up=up))
        sign = -1 if up.startswith("-") else 1
        assert np.allclose(turned.positions[:, 1], sign * metres.positions[:, upward[up[-1]]])
        corners = turned.positions[turned.faces[0]]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        assert np.allclose(normal, turned.normals[0])  # turned, never mirrored


def test_user_names_the_leaves(tmp_path: Path) -> None:
    made = Gltf()
    for k, name in enumerate(("bark", "Blatt_1", "Blatt_2")):
        made.node(mesh=made.mesh(material=made.material(name=name)), translation=[0, 0, k])
    path = made.write(tmp_path / "named.glb")
    plant = read_plant(path, ReadOptions(leaf_materials=("blatt*",)))
    assert [m.role for m in plant.materials] == ["wood", "leaf", "leaf"]


def test_skin_is_drawn_in_the_pose_of_its_joints(tmp_path: Path) -> None:
    """Bound at the origin, the second joint now stands 2 up: what hangs on it moves along, and the
    mesh's own node (moved away, as exporters like to) counts for nothing."""
    made = Gltf()
    joints = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]], np.uint8)
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (4, 1))
    mesh = made.mesh(JOINTS_0=joints, WEIGHTS_0=weights)
    root = made.node(name="root")
    tip = made.node(parent=root, translation=[0, 2, 0])
    bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1)).reshape(2, 16)
    made.json["skins"] = [{"joints": [root, tip], "inverseBindMatrices": made.array(bind)}]
    made.node(mesh=mesh, skin=0, translation=[100, 0, 0])
    plant = read_plant(made.write(tmp_path / "skin.glb"))
    assert np.allclose(
        plant.positions, QUAD + np.array([[0, 0, 0], [0, 0, 0], [0, 2, 0], [0, 2, 0]])
    )


def test_draco(tmp_path: Path) -> None:
    draco = pytest.importorskip("DracoPy")
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], np.float64)
    data = draco.encode(points, QUAD_FACES.reshape(-1, 3).astype(np.uint32))
    made = Gltf()
    made.json["accessors"] = [
        {"componentType": 5126, "count": 4, "type": "VEC3"},
        {"componentType": 5123, "count": 6, "type": "SCALAR"},
    ]
    view = made.view(data)
    identity = draco.decode(data).attributes[0]["unique_id"]
    extension = {"bufferView": view, "attributes": {"POSITION": identity}}
    made.json["meshes"] = [
        {
            "primitives": [
                {
                    "attributes": {"POSITION": 0},
                    "indices": 1,
                    "extensions": {"KHR_draco_mesh_compression": extension},
                }
            ]
        }
    ]
    made.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    made.node(mesh=0)
    plant = read_plant(made.write(tmp_path / "draco.glb"))
    order = np.lexsort(plant.positions.T)
    assert np.allclose(plant.positions[order], points[np.lexsort(points.T)], atol=1e-3)
    made.json["bufferViews"][view]["byteLength"] = 20
    with pytest.raises(Exception, match="Draco"):
        read_plant(made.write(tmp_path / "cut.glb"))


def tree_of_nodes(made: Gltf, nested: bool = True) -> None:
    """A trunk, two branches on it, a twig on the second, and a leaf node on the twig."""
    bark, leaf = made.material(name="bark"), made.material(name="leaf")

    def wood(start: Any, end: Any, radius: float) -> int:
        return made.mesh(
            tube(np.array(start, float), np.array(end, float), radius), tube_faces(), bark
        )

    trunk = made.node(mesh=wood([0, 0, 0], [0, 9, 0], 0.5), name="trunk")
    made.node(trunk if nested else None, mesh=wood([0, 4, 0], [4, 6, 0], 0.2))
    second = made.node(trunk if nested else None, mesh=wood([0, 6, 0], [-4, 8, 0], 0.2))
    twig = made.node(second if nested else None, mesh=wood([-2, 7, 0], [-2, 9, 1], 0.1))
    made.node(twig if nested else None, mesh=made.mesh(material=leaf), name="leaves")


def test_nested_nodes_are_branches(tmp_path: Path) -> None:
    made = Gltf()
    tree_of_nodes(made)
    plant = read_plant(made.write(tmp_path / "tree.glb"))
    assert plant.branches is not None and plant.branches.source == "nodes"
    assert plant.branches.parent.tolist() == [-1, 0, 0, 2]
    assert plant.branches.level.tolist() == [0, 1, 1, 2]
    assert np.unique(plant.branches.face_branch[plant.face_is_leaf]).tolist() == [3]
    assert np.bincount(plant.branches.face_branch).tolist() == [12, 12, 12, 12 + 2]


def test_flat_nodes_are_no_branches(tmp_path: Path) -> None:
    made = Gltf()
    tree_of_nodes(made, nested=False)
    assert read_plant(made.write(tmp_path / "flat.glb")).branches is None


def test_one_node_per_level_is_no_branch(tmp_path: Path) -> None:
    made = Gltf()
    above: int | None = None
    for level in range(4):
        mesh = made.mesh(tube(np.array([0.0, level, 0]), np.array([0, level + 1.0, 0]), 0.1),
                         tube_faces())  # fmt: skip
        above = made.node(above, mesh=mesh, name=f"stems_L{level}")
    assert read_plant(made.write(tmp_path / "levels.glb")).branches is None


def joined_tubes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(points, indices, branch of each point) of the tree of `tree_of_nodes`, as one mesh."""
    spans = [([0, 0, 0], [0, 9, 0], 0.5), ([0, 4, 0], [4, 6, 0], 0.2)]
    spans += [([0, 6, 0], [-4, 8, 0], 0.2), ([-2, 7, 0], [-2, 9, 1], 0.1)]
    tubes = [tube(np.array(a, float), np.array(b, float), r) for a, b, r in spans]
    faces = [tube_faces() + 12 * k for k in range(4)]
    return np.concatenate(tubes), np.concatenate(faces).astype(np.uint16), np.arange(48) // 12


def test_skeleton_gives_branches(tmp_path: Path) -> None:
    points, faces, branch = joined_tubes()
    made = Gltf()
    joints = np.zeros((48, 4), np.uint8)
    joints[:, 0] = branch + 1  # joint 0 is the armature's root and pulls at nothing
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (48, 1))
    mesh = made.mesh(points, faces, JOINTS_0=joints, WEIGHTS_0=weights)
    nodes: list[int] = []
    for above in (None, 0, 1, 1, 3):
        nodes.append(made.node(None if above is None else nodes[above]))
    made.json["skins"] = [{"joints": nodes}]
    made.node(mesh=mesh, skin=0)
    branches = read_plant(made.write(tmp_path / "bones.glb")).branches
    assert branches is not None and branches.source == "skeleton"
    assert branches.parent.tolist() == [-1, 0, 0, 2]
    assert np.bincount(branches.face_branch).tolist() == [12] * 4


@pytest.mark.parametrize("with_parents", [True, False])
def test_attribute_gives_branches(tmp_path: Path, with_parents: bool) -> None:
    points, faces, branch = joined_tubes()
    parent, level = np.array([-1, 0, 0, 2]), np.array([0, 1, 1, 2])
    more = {"_BRANCH_PARENT": parent[branch]} if with_parents else {"_BRANCH_LEVEL": level[branch]}
    attributes = {"_BRANCH_ID": branch, **more}
    made = Gltf()
    made.node(
        mesh=made.mesh(points, faces, **{k: v.astype(np.float32) for k, v in attributes.items()})
    )
    plant = read_plant(made.write(tmp_path / "tagged.glb"))
    assert plant.branches is not None and plant.branches.source == "attribute"
    assert plant.branches.parent.tolist() == [-1, 0, 0, 2]
    assert any("parents were found" in n for n in plant.notes) is not with_parents


def test_branches_without_wood_are_ignored(tmp_path: Path) -> None:
    points, faces, branch = joined_tubes()
    made = Gltf()
    tags = {"_BRANCH": branch, "_BRANCH_PARENT": np.array([-1, 0, 0, 2])[branch]}
    tags = {name: values.astype(np.float32) for name, values in tags.items()}
    leaf, bark = made.material(name="leaf"), made.material(name="bark")
    made.node(mesh=made.mesh(points, faces, leaf, **tags))
    made.node(mesh=made.mesh(points, faces, bark))
    plant = read_plant(made.write(tmp_path / "leaves.glb"))
    assert plant.branches is None and any("without wood" in note for note in plant.notes)


def test_branch_attribute_in_a_circle_is_ignored(tmp_path: Path) -> None:
    points, faces, branch = joined_tubes()
    circle = np.array([1, 0, 0, 2])[branch].astype(np.float32)
    made = Gltf()
    tags = {"_BRANCH": branch.astype(np.float32), "_BRANCH_PARENT": circle}
    made.node(mesh=made.mesh(points, faces, **tags))
    plant = read_plant(made.write(tmp_path / "circle.glb"))
    assert plant.branches is None and any("circle" in note for note in plant.notes)


def test_external_buffer_and_json_named_glb_extension(tmp_path: Path) -> None:
    made = Gltf()
    made.node(mesh=made.mesh())
    (tmp_path / "data.bin").write_bytes(made.binary)
    tree = {**made.json, "buffers": [{"uri": "data.bin", "byteLength": len(made.binary)}]}
    (tmp_path / "parted.gltf").write_text(json.dumps(tree))
    (tmp_path / "whole.gltf").write_bytes(made.bytes())  # binary under the other name
    for name in ("parted.gltf", "whole.gltf"):
        assert np.array_equal(read_plant(tmp_path / name).positions, QUAD)


def test_same_file_same_plant(tmp_path: Path) -> None:
    made = Gltf()
    tree_of_nodes(made)
    path = made.write(tmp_path / "tree.glb")
    one, two = read_plant(path), read_plant(path)
    for name in ("positions", "normals", "uvs", "faces", "face_material"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
