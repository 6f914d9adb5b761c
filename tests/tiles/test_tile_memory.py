"""What clients keep of tiles: no textures that nobody sees, and no boxes larger than plants."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import texture
from test_tiles_run import PLACED, library, pyramid, rows
from tile_cases import TWO_SPECIES, scene_of

from vegtool.plant import Material, Plant
from vegtool.tiles.levels import COARSEST, fitting
from vegtool.tiles.make import chosen
from vegtool.tiles.options import TileOptions
from vegtool.tiles.pyramid import Pyramid, pyramid_of, used_levels
from vegtool.tiles.quadtree import quadtree_of
from vegtool.tiles.shared import Shared
from vegtool.tiles.textures import limited

# ------------------------------------------------------------------------------------------ sheets


def dense(folder: Path, triangles: int, near: int = 1) -> Pyramid:
    """16 tiles of 16 m, whose ashes have their last level from 100 m on."""
    made = pyramid(folder, tile=16.0, near=near, triangles=triangles)
    slow = [replace(one, switch_m=4.0 * one.switch_m) for one in made.species]
    return replace(made, species=tuple(slow))


def test_a_sheet_has_no_level_that_is_too_fine_for_most_squares(tmp_path: Path) -> None:
    """Of four squares of 32 m with 10 plants, each may have 24 triangles: ashes of 4 are too many
    for most, those of 2 are not."""
    made = dense(tmp_path, 24)
    shared = Shared(made, tmp_path)
    assert shared.crowded(1) > 1
    assert set(shared.levels(1)) < set(used_levels(made, 1))
    assert shared.sheet(1).part[tuple(np.array(shared.levels(1)).T)].min() == 0
    for node in made.tree.nodes(1):
        stand = made.stand(node)
        level = chosen(made, shared, node, stand).level
        drawn = set(zip(stand.species.tolist(), level.tolist(), strict=True))
        assert drawn <= set(shared.levels(1))


def test_where_there_is_room_for_all_a_sheet_has_all(tmp_path: Path) -> None:
    made = dense(tmp_path, 10_000)
    shared = Shared(made, tmp_path)
    assert shared.crowded(1) == 1
    assert shared.levels(1) == used_levels(made, 1)


def test_a_sheet_does_not_depend_on_what_was_asked_for_before(tmp_path: Path) -> None:
    """As each process has one of its own, and makes other tiles first."""
    made = dense(tmp_path, 24)
    first, second = Shared(made, tmp_path), Shared(made, tmp_path)
    for node in made.tree.nodes(0):
        chosen(made, second, node, made.stand(node))
    assert first.sheet_files(1) == second.sheet_files(1)
    assert first.levels(2) == second.levels(2)


@pytest.mark.parametrize("triangles", [24, 100, 10_000])
def test_whether_too_little_is_left_of_plants_is_said_of_a_square_itself(
    tmp_path: Path, triangles: int
) -> None:
    """Whatever the sheet begins with; and where it is, nobody makes a sheet."""
    made = dense(tmp_path, triangles)
    shared, root = Shared(made, tmp_path), made.tree.nodes(0)[0]
    stand = made.stand(root)
    _, times = fitting(
        stand, made.switch_m, made.of_level, made.made_for_m(2), made.budget(root), 1
    )
    found = chosen(made, shared, root, stand)
    assert found.too_coarse == (times > COARSEST)
    assert found.too_coarse == (2 not in shared._sheets)
    assert shared.crowded(2) == min(times, COARSEST), "the root is its own middle"


# ---------------------------------------------------------------------------------------- textures


def pictured(side: int) -> Plant:
    """A triangle with columns of black and white."""
    stripes = np.tile(np.array([[0], [255]], np.uint8), (side // 2, side)).reshape(side, side).T
    pixels = np.repeat(stripes[..., None], 4, axis=2)
    material = Material(
        "m", color_texture=texture(pixels, "c"), normal_texture=texture(pixels, "n")
    )
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    facing = np.tile([0.0, 0, 1], (3, 1))
    faces = np.array([[0, 1, 2]], np.int32)
    return Plant("p", corners, facing, corners[:, :2], faces, np.zeros(1, np.int32), (material,))


def test_textures_are_halved_until_they_are_small_enough() -> None:
    """Half of the light is 188 in sRGB; alpha and normals are averaged as they are. Normals have
    half as many texels along a side as colours."""
    (material,) = limited(pictured(32), 16).materials
    assert material.color_texture is not None and material.normal_texture is not None
    assert material.color_texture.pixels.shape == (16, 16, 4)
    assert np.unique(material.color_texture.pixels[..., :3]).tolist() == [188]
    assert np.unique(material.color_texture.pixels[..., 3]).tolist() == [128]
    assert material.normal_texture.pixels.shape == (8, 8, 4)
    assert np.unique(material.normal_texture.pixels).tolist() == [128]


def test_textures_that_are_small_stay_as_they_are() -> None:
    plant = pictured(32)
    (material,), (own,) = limited(plant, 64).materials, plant.materials
    assert material.color_texture is own.color_texture
    assert material.normal_texture is own.normal_texture


# ------------------------------------------------------------------------------------------- boxes


def low_wood(folder: Path, heights: tuple[str, str]) -> Pyramid:
    """Ashes and pines, which are some 3 m high, of these heights; of no height where it is ""."""
    lines = ["x,y,species,height"]
    for index, (x, y, name) in enumerate(rows()):
        height = heights[index % 2] if name == "ash" else "0.5"
        lines.append(f"{x},{y},{name},{height}")
    (folder / "plants.csv").write_text("\n".join(lines))
    made = pyramid_of(
        scene_of(folder, TWO_SPECIES + PLACED), library(folder), TileOptions(tile=32.0)
    )
    return replace(made, tree=quadtree_of(made.placement.tiles, made.placement.tile_m))


def test_a_box_is_no_larger_than_plants_that_are_smaller_than_their_models(tmp_path: Path) -> None:
    """Heights of all are known: half a metre is a fifth of either model's, at most."""
    made = low_wood(tmp_path, ("0.25", "0.5"))
    assert (made.largest < 0.25).all()
    root = made.tree.nodes(0)[0]
    assert made.bounds(root)[1, 1] == pytest.approx(0.5, abs=1e-6)
    assert made.stand(root).scale.max() == pytest.approx(made.largest.max(), rel=1e-6)


@pytest.mark.parametrize(("heights", "least"), [(("0.5", ""), 1.0), (("6", ""), 1.5)])
def test_one_plant_without_a_height_is_as_large_as_its_model(
    tmp_path: Path, heights: tuple[str, str], least: float
) -> None:
    """Beside others of its species whose heights are known, which may be larger."""
    made = low_wood(tmp_path, heights)
    assert made.largest[0] == 1.0 if least == 1.0 else made.largest[0] > least
    assert made.largest[1] < 0.25
    assert made.stand(made.tree.nodes(0)[0]).scale.max() == pytest.approx(made.largest[0])
