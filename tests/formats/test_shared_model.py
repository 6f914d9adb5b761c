"""Models whose vertices and pictures are files that many tiles refer to."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from cards import arrays_of, cards, texture, together
from shared_models import shared_model

from vegtool.formats import read_plant
from vegtool.formats.glb import Document
from vegtool.formats.gltf import plant_glb
from vegtool.formats.shared_model import SharedModel
from vegtool.plant import Material, Plant
from vegtool.seeding import generator


def picture(seed: int) -> Any:
    return texture(generator(seed, "picture").integers(0, 256, (6, 5, 4)), f"picture {seed}")


LEAF = Material(
    "leaf", color_texture=picture(1), normal_texture=picture(2), alpha_mode="mask",
    double_sided=True, role="leaf", transmission=0.3,
)  # fmt: skip
BARK = Material("bark", [0.2, 0.12, 0.07, 1], double_sided=True)
ANOTHER = Material("flower", color_texture=picture(3), alpha_mode="mask", double_sided=True,
                   role="leaf")  # fmt: skip


def tree() -> Plant:
    return together(cards([[0, 1, 0], [1, 1.5, 0]], 0.3, LEAF), cards([0, 0.5, 0], 0.4, BARK))


def herb() -> Plant:
    return cards([[0, 0.2, 0], [0.1, 0.3, 0.1]], 0.1, ANOTHER, [1.0, 0, 1])


def put(folder: Path, *shared: SharedModel) -> None:
    (folder / "shared").mkdir(parents=True, exist_ok=True)
    for one in shared:
        for name, data in one.files.items():
            (folder / "shared" / name).write_bytes(data)


def tile(*shared: SharedModel, before: int = 0) -> Document:
    """A file that draws models side by side, after some objects of its own."""
    document = Document()
    for number in range(before):
        document.add_accessor(np.zeros((3, 3), np.float32))
        document.add("materials", name=f"own {number}")
        image = document.add("images", uri="shared/own.png")
        document.add("textures", source=image, sampler=document.add("samplers"))
    nodes = [
        document.add("nodes", mesh=one.add_to(document), translation=[float(3 * k), 0.0, 0.0])
        for k, one in enumerate(shared)
    ]
    document.show(*nodes)
    return document


def read(folder: Path, document: Document) -> Plant:
    (folder / "tile.glb").write_bytes(document.glb())
    return read_plant(folder / "tile.glb")


def assert_same(found: Plant, wanted: Plant) -> None:
    """Of two plants as files give them."""
    for name in ("positions", "normals", "uvs", "faces", "face_material"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    for one, other in zip(found.materials, wanted.materials, strict=True):
        np.testing.assert_array_equal(one.base_color, other.base_color)
        assert (one.name, one.alpha_mode, one.transmission) == (
            other.name, other.alpha_mode, other.transmission,
        )  # fmt: skip
        assert [t.pixels.tobytes() for t in one.textures] == [
            t.pixels.tobytes() for t in other.textures
        ]


@pytest.fixture
def plain(tmp_path: Path) -> Plant:
    """The tree as a .glb file of its own gives it."""
    (tmp_path / "plain.glb").write_bytes(plant_glb(tree()))
    return read_plant(tmp_path / "plain.glb")


def test_a_model_by_itself_is_the_plant(tmp_path: Path, plain: Plant) -> None:
    put(tmp_path, shared_model(tree(), "tree", "shared/"))
    assert_same(read_plant(tmp_path / "shared" / "tree.gltf"), plain)


@pytest.mark.parametrize("before", [0, 3])
def test_a_tile_that_refers_to_it_draws_the_plant(
    tmp_path: Path, plain: Plant, before: int
) -> None:
    """Whatever else is in the tile."""
    model = shared_model(tree(), "tree", "shared/")
    put(tmp_path, model)
    assert_same(read(tmp_path, tile(model, before=before)), plain)


def test_two_models_in_a_tile_keep_their_own_pictures(tmp_path: Path, plain: Plant) -> None:
    shared = [shared_model(tree(), "tree", "shared/"), shared_model(herb(), "herb", "shared/")]
    put(tmp_path, *shared)
    found = read(tmp_path, tile(*shared, before=1))
    assert [m.name for m in found.materials] == ["leaf", "bark", "flower"]
    leaf, bark, flower = (tuple(t.pixels.tobytes() for t in m.textures) for m in found.materials)
    assert leaf == tuple(picture(k).pixels.tobytes() for k in (1, 2))
    assert (bark, flower) == ((), (picture(3).pixels.tobytes(),))
    first = len(plain.positions)
    np.testing.assert_array_equal(found.positions[:first], plain.positions)
    np.testing.assert_allclose(
        found.positions[first:], herb().positions + np.array([3.0, 0, 0]), atol=1e-6
    )


def test_a_tile_is_small_and_says_what_it_needs() -> None:
    """None of the model's bytes, and a second buffer as long as its file."""
    model = shared_model(tree(), "tree", "shared/")
    data = tile(model).glb()
    (length,) = struct.unpack_from("<I", data, 12)
    values = json.loads(data[20 : 20 + length])
    assert values["buffers"][1] == {"uri": "shared/tree.bin", "byteLength": model.length}
    assert model.length == len(model.files["tree.bin"])
    assert len(data) == 20 + length + 8
    assert "KHR_materials_diffuse_transmission" in values["extensionsUsed"]
    for view in values["bufferViews"]:
        assert view["buffer"] == 1 and view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= model.length


def test_pictures_are_files_and_not_in_the_buffer() -> None:
    model = shared_model(tree(), "tree", "shared/")
    assert sorted(model.files) == ["tree.bin", "tree.gltf", "tree_0.png", "tree_1.png"]
    assert [image["uri"] for image in model.objects["images"]] == [
        "shared/tree_0.png", "shared/tree_1.png",
    ]  # fmt: skip
    assert model.files["tree_0.png"] not in model.files["tree.bin"]
    alone = json.loads(model.files["tree.gltf"])
    assert [image["uri"] for image in alone["images"]] == ["tree_0.png", "tree_1.png"]
    used = {accessor["bufferView"] for accessor in alone["accessors"]}
    assert used == set(range(len(alone["bufferViews"])))


def test_a_jpeg_stays_one() -> None:
    """A texture's own bytes go on, under the ending that they have."""
    from io import BytesIO

    from PIL import Image

    from vegtool.formats.images import decode

    buffer = BytesIO()
    Image.fromarray(np.full((8, 8, 3), 90, np.uint8)).save(buffer, "JPEG")
    photo = decode(buffer.getvalue(), "photo", "photo")
    model = shared_model(cards([0, 1, 0], 0.5, replace(ANOTHER, color_texture=photo)), "m", "")
    assert sorted(model.files) == ["m.bin", "m.gltf", "m_0.jpg"]
    assert model.files["m_0.jpg"] == buffer.getvalue()


def test_adding_a_model_leaves_it_as_it_is() -> None:
    """The second tile is as the first; changing one is no change of another."""
    model = shared_model(tree(), "tree", "shared/")
    before = json.dumps(model.objects)
    one, two = tile(model, before=2), tile(model, before=2)
    assert one.glb() == two.glb()
    one.change("meshes", 0, name="other")
    one.objects["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 99
    assert json.dumps(model.objects) == before and two.glb() == tile(model, before=2).glb()


def test_the_same_plant_gives_the_same_files_and_stays_as_it_is() -> None:
    plant = tree()
    before = arrays_of(plant)
    one, two = (shared_model(plant, "tree", "shared/") for _ in range(2))
    assert (one.files, one.objects) == (two.files, two.objects)
    assert arrays_of(plant) == before


def test_a_model_far_from_its_foot_is_no_model() -> None:
    """Its node would move it, and instances have no such node."""
    far = replace(tree(), positions=tree().positions + np.array([1000.0, 0, 0]))
    with pytest.raises(ValueError, match="model_files tree: a model far from its origin"):
        shared_model(far, "tree", "shared/")


@pytest.mark.parametrize("name", ["oak #1", "oak? yes", "100%41 oak"])
def test_names_are_written_as_uris(tmp_path: Path, name: str) -> None:
    model = shared_model(herb(), name, "shared/")
    put(tmp_path, model)
    uris = [model.uri, *(image["uri"] for image in model.objects["images"])]
    for uri in uris:
        assert not set(uri) & set("#? "), uri
        assert (tmp_path / unquote(uri)).is_file(), uri
    read(tmp_path, tile(model))


@pytest.mark.parametrize("name", ["../../oak", "a/b", "/tmp/oak"])
def test_files_stay_in_their_folder(name: str) -> None:
    assert all(Path(file).name == file for file in shared_model(herb(), name, "shared/").files)
