"""What tiles tell of their plants, as the specifications have it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plant_tables import columns
from shared_models import shared_model
from test_gltf_tile import models

from vegtool.formats import read_plant
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.gltf_tile import GroupPlants, Instances, SheetFiles, instanced_glb, merged_glb
from vegtool.formats.plant_table import PlantTable, vertex_ids
from vegtool.lod import Triangles

NAMES = ("ash", "Quercus robur")
TABLE = PlantTable(
    np.array([7, 2**61, 9]), np.array([1, 0, 1], np.int32), np.array([3.5, 2, 8], np.float32), NAMES
)


def test_an_instance_is_the_plant_of_its_own_row(tmp_path: Path) -> None:
    """The i-th of a node is the i-th row of its table, which no attribute needs to say."""
    shared = [shared_model(one, f"m{k}", "shared/") for k, one in enumerate(models()[:2])]
    which = [np.array([2]), np.array([0, 1])]
    drawn = [
        Instances(model, np.zeros((len(own), 3)), np.zeros(len(own)), np.ones(len(own)),
                  np.ones((len(own), 3), np.float32), TABLE.only(own))
        for model, own in zip(shared, which, strict=True)
    ]  # fmt: skip
    path = tmp_path / "tile.glb"
    path.write_bytes(instanced_glb(drawn, "tile"))
    file = open_gltf(path)
    nodes = [node for node in file.json["nodes"] if "mesh" in node]
    for node, own in zip(nodes, which, strict=True):
        (ids,) = node["extensions"]["EXT_instance_features"]["featureIds"]
        assert "attribute" not in ids and ids["featureCount"] == len(own)
        found = columns(file, ids["propertyTable"])
        assert found["id"].tolist() == TABLE.id[own].tolist()
        assert found["species"].tolist() == [NAMES[k] for k in TABLE.species[own]]
        assert found["height"].tolist() == TABLE.height[own].tolist()
    used = set(file.json["extensionsUsed"])
    assert {"EXT_structural_metadata", "EXT_instance_features"} <= used
    assert "EXT_structural_metadata" not in file.json["extensionsRequired"]


@pytest.mark.parametrize("plain", [False, True])
def test_a_vertex_says_of_which_plant_it_is(tmp_path: Path, plain: bool) -> None:
    """And the group is drawn as without."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (9, 3))
    flat = np.tile([0.0, 0, 1], (9, 1))
    group = Triangles(points, flat, np.zeros((9, 4)), rng.uniform(0, 1, (9, 2)), np.arange(9))
    of = np.repeat(np.array([2, 0, 1]), 3)
    sheet = SheetFiles("sheet.png", None, True)
    from vegtool.formats import png

    (tmp_path / "sheet.png").write_bytes(png.encode(np.full((4, 4, 4), 255, np.uint8)))
    read: list[Any] = []
    for name, plants in (("with", GroupPlants(TABLE, of)), ("without", None)):
        path = tmp_path / f"{name}.glb"
        path.write_bytes(merged_glb(group, sheet, "tile", plain, plants))
        read.append(read_plant(path))
    np.testing.assert_array_equal(read[0].corners, read[1].corners)
    file = open_gltf(tmp_path / "with.glb")
    (primitive,) = file.json["meshes"][0]["primitives"]
    (ids,) = primitive["extensions"]["EXT_mesh_features"]["featureIds"]
    assert (ids["attribute"], ids["featureCount"]) == (0, 3)
    found = file.accessor(primitive["attributes"]["_FEATURE_ID_0"])
    assert found.ravel().tolist() == of.tolist()
    assert columns(file, ids["propertyTable"])["id"].tolist() == TABLE.id.tolist()


def test_ids_are_exact_however_many_plants_there_are() -> None:
    few, many = np.array([0, 65535]), np.array([0, 65536, 2**24])
    assert vertex_ids(few).dtype == np.uint16 and vertex_ids(many).dtype == np.float32
    for ids in (few, many):
        assert vertex_ids(ids).astype(np.int64).tolist() == ids.tolist()
