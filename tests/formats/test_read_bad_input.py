"""Broken and hostile files: a sentence that names file and remedy, never a traceback or a guess."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import QUAD, QUAD_FACES, QUAD_UV, Gltf, glb, leaf_pixels, png, png_header, quad_file

from vegtool.errors import CapabilityError, InputError, UsageError, VegtoolError
from vegtool.formats import ReadOptions, read_plant

OBJ = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl leaf\nf 1 2 3\n"


def refused(path: Path, *words: str, error: type[Exception] = InputError) -> None:
    """Reading fails with that error, whose one line names the file and holds the words."""
    with pytest.raises(error) as caught:
        read_plant(path)
    message = str(caught.value)
    assert str(path) in message
    for word in words:
        assert word in message


def changed(tmp_path: Path, change: Any, **mesh: Any) -> Path:
    """A quad whose JSON went through `change`."""
    made = Gltf()
    made.node(mesh=made.mesh(**mesh))
    change(made.json)
    return made.write(tmp_path / "changed.glb")


def test_missing_file_folder_and_unknown_kind(tmp_path: Path) -> None:
    refused(tmp_path / "none.glb", "found nothing")
    (tmp_path / "folder.obj").mkdir()
    refused(tmp_path / "folder.obj", "found a folder")
    (tmp_path / "tree.txt").write_text("hello")
    refused(tmp_path / "tree.txt", ".glb", ".txt")
    (tmp_path / "bare").write_text("hello")
    refused(tmp_path / "bare", "no file name extension")


def test_fbx_names_converters(tmp_path: Path) -> None:
    (tmp_path / "tree.FBX").write_bytes(b"Kaydara FBX Binary")
    refused(tmp_path / "tree.FBX", "Blender", "FBX2glTF", "assimp", error=CapabilityError)


@pytest.mark.parametrize("keep", [3, 10, 19, 60, 200, -1])
def test_truncated_glb(tmp_path: Path, keep: int) -> None:
    data = quad_file(tmp_path / "whole.glb").read_bytes()
    (tmp_path / "cut.glb").write_bytes(data[:keep])
    refused(tmp_path / "cut.glb")


def test_text_named_glb_and_empty(tmp_path: Path) -> None:
    (tmp_path / "text.glb").write_text("this is no model at all")
    refused(tmp_path / "text.glb", "glTF", "this is no")
    (tmp_path / "empty.glb").write_bytes(b"")
    refused(tmp_path / "empty.glb", "empty file")
    (tmp_path / "text.gltf").write_text("this is no model at all")
    refused(tmp_path / "text.gltf", "JSON")


@pytest.mark.parametrize(
    "text", ["[" * 100_000, "[]", "5", '{"asset": {"version": "1.0"}}', '{"asset": 3}', "{}"]
)
def test_json_that_is_no_gltf(tmp_path: Path, text: str) -> None:
    (tmp_path / "odd.gltf").write_text(text)
    refused(tmp_path / "odd.gltf")


def test_no_triangles(tmp_path: Path) -> None:
    refused(quad_file(tmp_path / "none.glb", indices=np.zeros(0, np.uint16)), "triangles")
    refused(quad_file(tmp_path / "points.glb", mode=0), "triangles")
    (tmp_path / "none.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    refused(tmp_path / "none.obj", "faces")
    (tmp_path / "none2.obj").write_text("# nothing\n")
    refused(tmp_path / "none2.obj", "vertices")


def test_flat_triangles_alone_are_refused(tmp_path: Path) -> None:
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.float32)
    path = quad_file(tmp_path / "flat.glb", positions=line, indices=np.array([0, 1, 2], np.uint16))
    refused(path, "1 without area")


def test_nan_everywhere_is_refused_and_a_few_are_dropped(tmp_path: Path) -> None:
    all_nan = np.full_like(QUAD, np.nan)
    refused(quad_file(tmp_path / "nan.glb", positions=all_nan), "NaN")
    some = QUAD.copy()
    some[3] = [np.inf, np.nan, 0]  # used by the second triangle only
    plant = read_plant(quad_file(tmp_path / "some.glb", positions=some))
    assert len(plant.faces) == 1 and len(plant.positions) == 3
    assert any("1 of 2 faces with NaN" in note for note in plant.notes)


def test_index_out_of_range(tmp_path: Path) -> None:
    path = quad_file(tmp_path / "wild.glb", indices=np.array([0, 1, 99], np.uint16))
    refused(path, "accessors[1]", "99", "below 4")
    (tmp_path / "wild.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    refused(tmp_path / "wild.obj", "vertices 1 to 3", "f 1 2 9")
    (tmp_path / "back.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -9\n")
    refused(tmp_path / "back.obj", "f -1 -2 -9")
    (tmp_path / "zero.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n")
    refused(tmp_path / "zero.obj", "f 0 1 2")
    (tmp_path / "word.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf a b c\n")
    refused(tmp_path / "word.obj", "f a b c")


def test_sixteen_bit_indices_that_overflowed(tmp_path: Path) -> None:
    many = np.random.default_rng(0).random((70_000, 3), dtype=np.float32)
    indices = (np.arange(69_999) % 65_536).astype(np.uint16)
    refused(quad_file(tmp_path / "over.glb", positions=many, indices=indices), "16-bit")


@pytest.mark.parametrize(
    "change",
    [
        lambda j: j["accessors"][0].update(count=10**12),
        lambda j: j["accessors"][0].update(count=-1),
        lambda j: j["accessors"][0].update(count=1.5),
        lambda j: j["accessors"][0].update(componentType=9),
        lambda j: j["accessors"][0].update(byteOffset=10**9),
        lambda j: j["accessors"][0].update(bufferView=77),
        lambda j: j["accessors"][0].update(type="VEC9"),
        lambda j: (j["accessors"][0].pop("bufferView"), j["accessors"][0].update(count=10**11)),
        lambda j: j["bufferViews"][0].update(byteLength=10**9),
        lambda j: j["bufferViews"][0].update(byteOffset=-4),
        lambda j: j["bufferViews"][0].update(byteStride=1),
        lambda j: j["bufferViews"][0].update(buffer=3),
        lambda j: j["meshes"][0]["primitives"][0].update(indices=55),
        lambda j: j["meshes"][0]["primitives"][0].update(material=55),
        lambda j: j["meshes"][0]["primitives"][0].pop("attributes"),
        lambda j: j["meshes"][0]["primitives"][0]["attributes"].pop("POSITION"),
        lambda j: j["meshes"][0].update(primitives=7),
        lambda j: j["nodes"][0].update(mesh="first"),
        lambda j: j["nodes"][0].update(matrix=[1, 2, 3]),
        lambda j: j["nodes"][0].update(translation=[0, float("nan"), 0]),
        lambda j: j.update(nodes="none"),
        lambda j: j.update(scene=4),
        lambda j: j.update(materials=[3]),
        lambda j: j.update(materials=[{"pbrMetallicRoughness": {"baseColorFactor": "red"}}]),
        lambda j: j.update(materials=[{"pbrMetallicRoughness": {"baseColorFactor": [1]}}]),
    ],
)
def test_lies_in_the_json(tmp_path: Path, change: Any) -> None:
    refused(changed(tmp_path, change))


def test_buffer_that_lies_about_its_length_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    def lie(tree: dict[str, Any]) -> None:
        tree["buffers"] = [{"byteLength": 10**12}]

    assert len(read_plant(changed(tmp_path, lie)).faces) == 2


def test_node_cycles_and_shared_children(tmp_path: Path) -> None:
    refused(changed(tmp_path, lambda j: j["nodes"][0].update(children=[0])), "one parent")

    def bomb(tree: dict[str, Any]) -> None:
        tree["nodes"] = [{"children": [k + 1, k + 1]} for k in range(60)] + [{"mesh": 0}]

    refused(changed(tmp_path, bomb), "one parent")


def test_too_many_instances_are_refused_before_they_are_made(tmp_path: Path) -> None:
    """1,000 instances of a mesh of 40,000 triangles that names one triangle again and again."""
    made = Gltf()
    mesh = made.mesh(indices=np.tile(np.array([0, 1, 2], np.uint16), 40_000))
    move = made.array(np.zeros((1000, 3), np.float32))
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": move}}}
    made.node(mesh=mesh, extensions=instancing)
    refused(made.write(tmp_path / "forest.glb"), "40000000", "landscape")


def test_deep_node_chain_is_no_problem(tmp_path: Path) -> None:
    def chain(tree: dict[str, Any]) -> None:
        tree["nodes"] = [{"children": [k + 1]} for k in range(5000)] + [{"mesh": 0}]

    assert len(read_plant(changed(tmp_path, chain)).faces) == 2


@pytest.mark.parametrize(
    ("extension", "word"),
    [
        ("EXT_meshopt_compression", "gltfpack"),
        ("KHR_meshopt_compression", "gltf-transform"),
        ("ACME_secret_sauce", "ACME_secret_sauce"),
    ],
)
def test_required_extensions_that_cannot_be_decoded(
    tmp_path: Path, extension: str, word: str
) -> None:
    path = changed(tmp_path, lambda j: j.update(extensionsRequired=[extension]))
    refused(path, word, error=CapabilityError)


def test_draco_without_its_decoder_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def compress(tree: dict[str, Any]) -> None:
        tree["extensionsRequired"] = ["KHR_draco_mesh_compression"]
        extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
        tree["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": extension}

    path = changed(tmp_path, compress)
    with monkeypatch.context() as patch:
        patch.setitem(__import__("sys").modules, "DracoPy", None)
        refused(path, "pip install vegtool[draco]", error=CapabilityError)


def textured(tmp_path: Path, **image: Any) -> Path:
    made = Gltf()
    made.json["images"] = [image]
    made.json["textures"] = [{"source": 0}]
    leaf = made.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    made.node(mesh=made.mesh(material=leaf, TEXCOORD_0=QUAD_UV))
    return made.write(tmp_path / "textured.glb")


def test_image_bomb(tmp_path: Path) -> None:
    (tmp_path / "bomb.png").write_bytes(png_header(100_000, 100_000))
    refused(textured(tmp_path, uri="bomb.png"), "16384", "scale the image down")
    (tmp_path / "bomb.png").write_bytes(png_header(12_000, 12_000))
    refused(textured(tmp_path, uri="bomb.png"), "12000 x 12000")
    (tmp_path / "m.mtl").write_text("newmtl leaf\nmap_Kd bomb.png\n")
    (tmp_path / "tree.obj").write_text(OBJ)
    refused(tmp_path / "tree.obj", "bomb.png")


def test_broken_image(tmp_path: Path) -> None:
    (tmp_path / "cut.png").write_bytes(png(leaf_pixels(64))[:70])
    refused(textured(tmp_path, uri="cut.png"), "cut.png", "broken")
    (tmp_path / "text.png").write_text("no image")
    refused(textured(tmp_path, uri="text.png"), "text.png")
    refused(textured(tmp_path, uri="data:image/png;base64,!!!"), "base64")


def test_ktx2_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "bark.ktx2").write_bytes(b"\xabKTX 20\xbb\r\n\x1a\n" + b"\0" * 80)
    refused(textured(tmp_path, uri="bark.ktx2"), "KTX2", error=CapabilityError)
    made = Gltf()
    made.json["images"] = [{"uri": "bark.ktx2"}]
    made.json["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    leaf = made.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    made.node(mesh=made.mesh(material=leaf))
    made.json["extensionsRequired"] = ["KHR_texture_basisu"]
    refused(made.write(tmp_path / "basis.glb"), "KHR_texture_basisu", error=CapabilityError)


CLIMBING = [
    "../secret.png",
    "a/../../secret.png",
    "..\\secret.png",
    "/etc/passwd",
    "../../etc/passwd",
    "file:///etc/passwd",
    "https://example.org/a.png",
    "C:/art/../../secret.png",
    "link.png",
]


@pytest.mark.parametrize("reference", [*CLIMBING, "%2e%2e/secret.png", "%2Fetc%2Fpasswd"])
def test_gltf_paths_that_leave_the_folder(tmp_path: Path, reference: str) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.png").write_bytes(png(leaf_pixels()))
    (inside / "link.png").symlink_to(tmp_path / "secret.png")
    refused(textured(inside, uri=reference), repr(reference), "copy that file")
    tree = {"asset": {"version": "2.0"}, "buffers": [{"uri": reference, "byteLength": 12}]}
    tree["bufferViews"] = [{"buffer": 0, "byteLength": 12}]  # type: ignore[list-item]
    tree["accessors"] = [  # type: ignore[list-item]
        {"bufferView": 0, "componentType": 5126, "count": 1, "type": "VEC3"}
    ]
    tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}]}]  # type: ignore[list-item]
    tree["nodes"] = [{"mesh": 0}]  # type: ignore[list-item]
    (inside / "buffer.gltf").write_text(json.dumps(tree))
    refused(inside / "buffer.gltf", repr(reference))


@pytest.mark.parametrize("reference", CLIMBING)
def test_obj_paths_that_leave_the_folder(tmp_path: Path, reference: str) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.png").write_bytes(png(leaf_pixels()))
    (inside / "link.png").symlink_to(tmp_path / "secret.png")
    (inside / "m.mtl").write_text(f"newmtl leaf\nmap_Kd {reference}\n")
    (inside / "tree.obj").write_text(OBJ)
    refused(inside / "tree.obj", repr(reference))
    (inside / "lib.obj").write_text(OBJ.replace("m.mtl", reference))
    refused(inside / "lib.obj", repr(reference))


def test_missing_buffer_is_an_error_and_a_missing_texture_a_note(tmp_path: Path) -> None:
    plant = read_plant(textured(tmp_path, uri="gone.png"))
    assert plant.materials[0].color_texture is None
    assert any("gone.png" in note for note in plant.notes)
    data = quad_file(tmp_path / "whole.glb").read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    tree = json.loads(data[20 : 20 + size])
    tree["buffers"] = [{"uri": "gone.bin", "byteLength": 100}]
    (tmp_path / "parted.gltf").write_text(json.dumps(tree))
    refused(tmp_path / "parted.gltf", "gone.bin")
    (tmp_path / "empty.glb").write_bytes(glb(b"{}", b""))
    refused(tmp_path / "empty.glb")


@pytest.mark.parametrize("kind", ["ply", "stl", "obj"])
@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"solid \nnothing here",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1\n",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\n"
        b"property float x\nproperty float y\nproperty float z\nend_header\n",
        bytes(range(256)) * 8,
        b"\0" * 84,
        b"\0" * 80 + b"\xff\xff\xff\x7f" + b"\0" * 100,
    ],
)
def test_garbage(tmp_path: Path, kind: str, data: bytes) -> None:
    path = tmp_path / f"garbage.{kind}"
    path.write_bytes(data)
    refused(path)


def test_ply_index_out_of_range(tmp_path: Path) -> None:
    path = tmp_path / "wild.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"
    )
    refused(path)


@pytest.mark.parametrize("seed", range(4))
def test_random_damage_is_read_or_refused(tmp_path: Path, seed: int) -> None:
    """Bytes of a small tree's JSON or buffer are overwritten at random: whatever it becomes, it is
    read or refused with a message, nothing else is raised."""
    rng = np.random.default_rng(seed)
    made = Gltf()
    leaf = made.material(name="leaf", alphaMode="MASK")
    top = made.node(name="bark", scale=[1, -1, 2], mesh=made.mesh(material=leaf))
    made.node(top, mesh=made.mesh(TEXCOORD_0=QUAD_UV, _BRANCH=np.zeros(4, np.float32)))
    whole = made.bytes()
    readable = 0
    for _ in range(60):
        data = bytearray(whole)
        for at in rng.integers(12, len(data), 3):
            data[at] = rng.integers(32, 127) if rng.random() < 0.8 else rng.integers(0, 256)
        (tmp_path / "damaged.glb").write_bytes(data)
        try:
            readable += len(read_plant(tmp_path / "damaged.glb").faces) > 0
        except VegtoolError as error:
            assert "damaged.glb" in str(error)
    assert readable < 60


def test_options_that_make_no_sense(tmp_path: Path) -> None:
    for unit in ("parsec", "0", "-1", "nan", "inf"):
        with pytest.raises(UsageError, match="--unit"):
            ReadOptions(unit=unit)
    with pytest.raises(UsageError, match="--up"):
        ReadOptions(up="w")
    path = quad_file(tmp_path / "quad.glb")
    with pytest.raises(UsageError, match="leaf-material"):
        read_plant(path, ReadOptions(leaf_materials=("needles",)))


def test_input_is_not_changed(tmp_path: Path) -> None:
    path = quad_file(tmp_path / "quad.glb", indices=QUAD_FACES)
    before = path.read_bytes()
    read_plant(path)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
