"""A model as 3D Tiles: valid, whole, and drawn as the model says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from surfel_cases import COARSE, ball, both, hills, surface
from surfel_parts import with_some, without

from vegtool.formats import read_plant
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.tileset_check import check_tileset
from vegtool.growth import sample
from vegtool.plant import Plant
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.tileset import surfel_tileset
from vegtool.surfels.tiling import SurfelTile, tiles_of

pytestmark = pytest.mark.gl
ON_A_MAP = np.array([4.4e5, 30.0, 5.2e6])
TRIANGLE = surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def written(model: SurfelModel, folder: Path, root: SurfelTile | None = None) -> dict[str, Any]:
    """The root of the tileset, whose files are in the folder."""
    folder.mkdir(exist_ok=True)
    for name, data in surfel_tileset(model, root or tiles_of(model), "model"):
        (folder / name).write_bytes(data)
    assert check_tileset(folder / "tileset.json") == []
    values = json.loads((folder / "tileset.json").read_bytes())
    assert values["geometricError"] >= 2 * max(model.plant.radius, values["root"]["geometricError"])
    return values["root"]


def soup(count: int = 60) -> Plant:
    """Triangles that have nothing in common."""
    random = np.random.default_rng(0)
    corners = random.uniform(-1, 1, (count, 1, 3)) + random.normal(0, 0.05, (count, 3, 3))
    return surface(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize(
    "plant",
    [
        TRIANGLE,
        surface([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),  # a line
        hills(8, 0.0),
        soup(),
        both(ball(2), TRIANGLE),
        replace(TRIANGLE, positions=TRIANGLE.positions + ON_A_MAP),
    ],
)
def test_small_cases(plant: Plant, tmp_path: Path) -> None:
    model = surfel_model(plant, display=COARSE)
    root = written(model, tmp_path / "all")
    assert root["geometricError"] <= model.hierarchy.error.max()
    assert root["refine"] == "REPLACE" and root["extras"]["seen_px"] == 1.0
    few = np.arange(len(model.hierarchy)) == len(model.hierarchy) - 1
    written(with_some(model, few), tmp_path / "one")
    root = written(without(plant, COARSE), tmp_path / "none")
    assert not list((tmp_path / "none").glob("*.png"))


def test_leaves_draw_the_original_where_it_is(tmp_path: Path) -> None:
    """The root's transform and the vertices together, in double precision."""
    plant = replace(hills(12), positions=hills(12).positions + ON_A_MAP)
    root = written(surfel_model(plant, display=COARSE), tmp_path)
    x, y, z = np.array(root["transform"][12:15])
    found = [read_plant(tmp_path / leaf["content"]["uri"]).corners for leaf in leaves(root)]
    corners = np.concatenate(found).reshape(-1, 3) + np.array([x, z, -y])
    away = np.linalg.norm(corners[:, None] - plant.positions, axis=2).min(axis=1)
    assert away.max() < 1e-6


def leaves(tile: dict[str, Any]) -> list[dict[str, Any]]:
    below = [leaves(child) for child in tile.get("children", [])]
    return [one for some in below for one in some] or [tile]


def test_a_tile_is_one_draw_call_for_billboards_and_one_for_a_material(tmp_path: Path) -> None:
    model = surfel_model(sample("broadleaf", 2000))
    root = tiles_of(model, 400)
    written(model, tmp_path, root)
    mixed = 0
    for number, tile in enumerate(root.all()):
        file = open_gltf(tmp_path / f"model_{number}.glb").json
        (mesh,) = file["meshes"]
        own = np.unique(np.repeat(model.triangles.material, model.triangles.sizes)[tile.triangles])
        assert len(mesh["primitives"]) == len(own) + (len(tile.billboards) > 0)
        mixed += len(own) > 0 and len(tile.billboards) > 0
        assert all("uri" in image for image in file.get("images", [])), "pictures are shared"
    assert mixed


def test_both_sides_are_drawn_where_something_is_behind(tmp_path: Path) -> None:
    """A leaf's front and back; of a closed ball, which looks outward, mostly the front alone."""
    leaf = replace(hills(6), materials=[replace(m, double_sided=True) for m in hills(6).materials])
    for name, plant in (("leaf", leaf), ("ball", ball(3))):
        model = surfel_model(plant, display=COARSE)
        root = tiles_of(model)
        written(model, tmp_path / name, root)
        behind = model.textures.behind
        assert behind.all() == (name == "leaf")
        for number, tile in enumerate(root.all()):
            if not len(tile.billboards):
                continue
            file = open_gltf(tmp_path / name / f"model_{number}.glb")
            primitive = file.json["meshes"][0]["primitives"][-1]
            faces = file.accessor(primitive["indices"]).reshape(-1, 3)
            assert len(faces) == 2 * len(tile.billboards) + 2 * behind[tile.billboards].sum()
            assert not file.json["materials"][-1]["doubleSided"]
            at = file.accessor(primitive["attributes"]["POSITION"])[faces].astype(float)
            normal = file.accessor(primitive["attributes"]["NORMAL"])[faces[:, 0]]
            turn = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
            assert (np.einsum("ni,ni->n", turn, normal) > 0).all(), "counter-clockwise"


def test_what_is_not_lit_is_not_lit_from_afar(tmp_path: Path) -> None:
    ground = hills(8)
    plant = replace(ground, materials=[replace(m, unlit=True) for m in ground.materials])
    model = surfel_model(plant, display=COARSE)
    root = tiles_of(model)
    written(model, tmp_path, root)
    for number, _ in enumerate(root.all()):
        for material in open_gltf(tmp_path / f"model_{number}.glb").json["materials"]:
            assert "KHR_materials_unlit" in material["extensions"]
            assert "normalTexture" not in material
    assert [file.name for file in tmp_path.glob("*.png")] == ["model_color.png"]


def test_the_same_model_the_same_bytes() -> None:
    model = surfel_model(sample("statue", 2000))
    one, other = (dict(surfel_tileset(model, tiles_of(model), "a b")) for _ in range(2))
    assert one == other
    assert all(name.startswith("a_b_") or name == "tileset.json" for name in one)
