"""What vegtool writes, vegtool reads back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from written import hybrid_level, leafy_plant, small_chain

from vegtool.formats import read_plant
from vegtool.formats.gltf import chain_glb, level_glb, plant_glb
from vegtool.growth import sample
from vegtool.measure.pictures import client_plant
from vegtool.plant import Plant


def written_and_read(plant: Plant, folder: Path) -> Plant:
    path = folder / "plant.glb"
    path.write_bytes(plant_glb(plant))
    return read_plant(path)


def corners_of(plant: Plant, material: str, values: np.ndarray) -> np.ndarray:
    """(f, 3, k): what the corners of a material's faces have, whatever the vertices' numbers."""
    index = [m.name for m in plant.materials].index(material)
    return values[plant.faces[plant.face_material == index]]


@pytest.mark.parametrize("move", [0.0, 1e5])
def test_geometry_and_materials_survive(tmp_path: Path, move):
    shades = np.random.default_rng(0).uniform(0.5, 1.0, (8, 1))  # gentle tints, no wind weights
    plant = leafy_plant(
        positions=leafy_plant().positions + move, colors=shades * [1.0, 0.9, 0.8, 1.0]
    )
    back = written_and_read(plant, tmp_path)
    assert [m.name for m in back.materials] == ["bark", "leaf"]
    for material in ("bark", "leaf"):
        for name, tolerance in (("positions", 1e-6), ("normals", 0), ("uvs", 0), ("colors", 1e-4)):
            mine = corners_of(plant, material, getattr(plant, name))
            theirs = corners_of(back, material, getattr(back, name))
            assert np.allclose(mine, theirs, rtol=0, atol=tolerance), (material, name)
    for mine, theirs in zip(plant.materials, back.materials, strict=True):
        assert np.allclose(mine.base_color, theirs.base_color)
        for name in ("alpha_mode", "double_sided", "metallic", "roughness", "normal_scale"):
            assert getattr(mine, name) == getattr(theirs, name), name
        for name in ("color_texture", "normal_texture"):
            image, copy = getattr(mine, name), getattr(theirs, name)
            assert (image is None) == (copy is None)
            assert image is None or np.array_equal(image.pixels, copy.pixels)
    assert back.materials[1].alpha_cutoff == 0.3


def test_writing_what_was_read_changes_nothing(tmp_path: Path):
    once = written_and_read(leafy_plant(), tmp_path)
    again = written_and_read(once, tmp_path)
    for name in ("positions", "normals", "uvs", "faces", "face_material"):
        assert np.array_equal(getattr(once, name), getattr(again, name)), name


@pytest.mark.parametrize("double_sided", [True, False])
def test_a_hybrid_is_read_back_as_what_is_measured(tmp_path: Path, double_sided):
    """Its dark bark is no weights for wind: those faces show one place of the texture."""
    level = hybrid_level(double_sided=double_sided)
    mine, path = client_plant(level), tmp_path / "tree.glb"
    path.write_bytes(level_glb(level, "tree"))
    theirs = read_plant(path)
    assert theirs.notes == ()
    assert len(theirs.faces) == len(mine.faces) == level.triangles
    for name, tolerance in (("positions", 1e-6), ("normals", 0), ("uvs", 1e-7), ("colors", 1e-5)):
        expected, found = getattr(mine, name)[mine.faces], getattr(theirs, name)[theirs.faces]
        assert np.allclose(expected, found, rtol=0, atol=tolerance), name
    (asked,), (material,) = mine.materials, theirs.materials
    for name in ("alpha_mode", "alpha_cutoff", "double_sided", "metallic", "roughness"):
        assert getattr(material, name) == getattr(asked, name), name
    for name in ("color_texture", "normal_texture"):
        image, copy = getattr(asked, name), getattr(material, name)
        assert np.array_equal(image.pixels, copy.pixels)


def test_a_chain_with_a_hybrid_shows_the_original(tmp_path: Path):
    """Readers that do not know MSFT_lod, ours among them, see the original alone."""
    chain = small_chain()
    path = tmp_path / "tree.glb"
    path.write_bytes(chain_glb(replace(chain, levels=(chain.levels[0], hybrid_level()))))
    assert len(read_plant(path).faces) == chain.levels[0].triangles


def test_the_branches_of_a_sample_survive(tmp_path: Path):
    plant = sample("broadleaf", 4000)
    back = written_and_read(plant, tmp_path)
    assert plant.branches is not None
    assert back.branches is not None
    assert back.branches.source == "attribute"
    assert len(back.faces) == len(plant.faces)
    # Faces keep their order inside each material, and materials theirs.
    order = np.argsort(plant.face_material, kind="stable")
    assert np.allclose(back.face_centroids, plant.face_centroids[order], atol=1e-6)
    mine, theirs = plant.branches, back.branches
    assert np.array_equal(theirs.level[theirs.face_branch], mine.level[mine.face_branch[order]])
    pairs = np.unique(np.stack([mine.face_branch[order], theirs.face_branch], 1), axis=0)
    assert len(pairs) == len(np.unique(pairs[:, 0])) == len(np.unique(pairs[:, 1]))  # one to one


def test_branches_that_are_all_trunks_survive(tmp_path: Path) -> None:
    """A clump of grass: no blade hangs on another, and the file says so."""
    grass = sample("grass-clump", 400)
    path = tmp_path / "grass.glb"
    path.write_bytes(plant_glb(grass))
    again = read_plant(path).branches
    assert grass.branches is not None
    assert again is not None
    assert len(again) == len(grass.branches)
    np.testing.assert_array_equal(again.face_branch, grass.branches.face_branch)
