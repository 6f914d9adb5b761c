"""Plants of a landscape as files give them: manifests, folders, models, and what is wrong there."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from library_cases import TRIANGLES, edit, model, write
from plants import plant_of
from surfel_sets import ball

from vegtool.errors import InputError
from vegtool.formats import ReadOptions, read_plant
from vegtool.formats.gltf import write_chain
from vegtool.lod import FADE_FRACTION, Display, Level, LodChain
from vegtool.tiles import library
from vegtool.tiles.library import (
    MANIFEST,
    Species,
    Stored,
    read_library,
    read_species,
    stored_species,
)
from vegtool.tiles.species import placed


def test_a_manifest_gives_levels_and_where_they_take_over(tmp_path: Path) -> None:
    (oak,) = read_library(write(tmp_path, "oak"), ReadOptions())
    assert oak.name == "oak"
    assert [len(level.faces) for level in oak.levels] == [8, 7, 6], "the original first"
    assert oak.switch_m.tolist() == [0, 10, 25]
    np.testing.assert_allclose(oak.fade, [0, FADE_FRACTION, FADE_FRACTION], rtol=1e-5)
    assert oak.focal_px == pytest.approx(Display(50.0, 900).pixels_per_metre(1.0))
    assert [file.name for file in oak.files] == ["oak.glb", "oak_LOD1.glb", "oak_LOD2.glb"]
    np.testing.assert_allclose(
        np.sort(oak.levels[0].corners.ravel()), np.sort(TRIANGLES.ravel()), atol=1e-6
    )
    assert oak.height == pytest.approx(TRIANGLES[..., 1].max())
    assert oak.size >= max(np.linalg.norm(TRIANGLES, axis=-1).ravel()) * (1 - 1e-6)


def test_a_folder_gives_all_that_were_converted_into_it(tmp_path: Path) -> None:
    """By name, whatever else is there."""
    for name in ("pine", "ash"):
        write(tmp_path, name)
    (tmp_path / "notes.txt").write_text("planted in spring")
    model(tmp_path, "stone.glb")
    told: list[tuple[str, float]] = []
    found = read_library(tmp_path, ReadOptions(), lambda stage, share: told.append((stage, share)))
    assert [one.name for one in found] == ["ash", "pine"]
    shares = [share for _, share in told]
    assert shares == sorted(shares) and shares[0] == 0 and 0.5 <= shares[-1] < 1
    assert told[0][0] == "ash: ash.glb" and told[-1][0] == "pine: pine_LOD2.glb"


def test_a_model_has_no_level_but_itself(tmp_path: Path) -> None:
    """And is read as the user says."""
    path = model(tmp_path)
    (one,) = read_library(path, ReadOptions())
    assert (one.switch_m.tolist(), one.fade.tolist(), one.files) == ([0], [0], (path,))
    (cm,) = read_library(path, ReadOptions(unit="cm"))
    np.testing.assert_allclose(cm.levels[0].positions, 0.01 * one.levels[0].positions, atol=1e-9)


@pytest.mark.parametrize("name", ["oak.glb", "oak_LOD2.glb"])
def test_a_file_that_is_missing_is_named_with_what_names_it(tmp_path: Path, name: str) -> None:
    manifest = write(tmp_path, "oak")
    (tmp_path / name).unlink()
    with pytest.raises(InputError) as caught:
        read_library(manifest, ReadOptions())
    assert str(manifest) in str(caught.value) and f"the file {name}" in str(caught.value)
    assert "Convert the plant again" in str(caught.value)
    with pytest.raises(InputError, match=name):
        read_library(tmp_path, ReadOptions())


def test_a_file_that_is_deleted_meanwhile_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the manifest and the level."""
    manifest = write(tmp_path, "oak")

    def deleted(path: Path) -> Any:
        path.unlink()
        return read_plant(path)

    monkeypatch.setattr(library, "read_plant", deleted)
    with pytest.raises(InputError, match=r"oak\.glb: expected a model file"):
        read_species(manifest)
    assert not (tmp_path / "oak.glb").exists()


def test_a_level_that_is_broken_is_named(tmp_path: Path) -> None:
    manifest = write(tmp_path, "oak")
    (tmp_path / "oak_LOD1.glb").write_bytes(b"glTF but not really")
    with pytest.raises(InputError, match=r"oak_LOD1\.glb"):
        read_species(manifest)


def test_a_file_outside_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "plants").mkdir()
    manifest = write(tmp_path / "plants", "oak")
    (tmp_path / "plants" / "oak_LOD1.glb").rename(tmp_path / "oak_LOD1.glb")
    edit(manifest, lambda values: values["levels"][1].update(file="../oak_LOD1.glb"))
    with pytest.raises(InputError, match="inside its own folder"):
        read_species(manifest)


def test_nothing_there_is_said_with_what_was_expected(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found no manifest in it"):
        read_library(tmp_path, ReadOptions())
    with pytest.raises(InputError, match="found nothing there"):
        read_library(tmp_path / "oak.glb", ReadOptions())
    with pytest.raises(InputError, match="cannot be read"):
        read_library(tmp_path / f"oak{MANIFEST}", ReadOptions())
    (tmp_path / f"elm{MANIFEST}").write_text("{")
    with pytest.raises(InputError, match=r"elm.*expected a manifest"):
        read_library(tmp_path, ReadOptions())


@pytest.mark.parametrize("distance", [10.0, 3.0, 0.0])
def test_levels_that_do_not_follow_each_other_are_named(tmp_path: Path, distance: float) -> None:
    manifest = write(tmp_path, "oak")
    edit(manifest, lambda values: values["levels"][2].update(switch_distance_m=distance))
    with pytest.raises(InputError, match=rf"oak{MANIFEST}.* ascend, found 0, 10, {distance:g}\."):
        read_species(manifest)


def test_species_are_checked_when_made() -> None:
    plant = plant_of(TRIANGLES)
    for distances in ([1.0, 2.0], [0.0, 0.0], [0.0, 2.0, 1.0], [0.0]):
        with pytest.raises(ValueError, match=r"Species\.switch_m"):
            levels = (plant,) * (3 if len(distances) == 3 else 2)
            Species("s", levels, np.array(distances), np.zeros(len(levels)), 1.0, ())
    with pytest.raises(ValueError, match=r"Species\.fade"):
        Species("s", (plant,), np.zeros(1), np.zeros(2), 1.0, ())


def test_stored_levels_are_read_when_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each time, as they are by `read_species`; what is asked of all of them, once, and a species
    takes that along."""
    manifest = write(tmp_path, "oak")
    read: list[str] = []

    def counted(path: Path) -> Any:
        read.append(path.name)
        return read_plant(path)

    whole = read_species(manifest)
    monkeypatch.setattr(library, "read_plant", counted)
    oak = stored_species(manifest)
    assert not read and len(oak.levels) == 3
    np.testing.assert_array_equal(oak.levels[-1].positions, whole.levels[-1].positions)
    assert read == ["oak_LOD2.glb"] and len(oak.levels[1:]) == 2
    assert (oak.height, oak.size) == (whole.height, whole.size)
    assert sorted(read[1:]) == sorted(file.name for file in oak.files)
    sent = pickle.dumps(oak)
    assert len(sent) < 2000
    again = pickle.loads(sent)
    np.testing.assert_array_equal(again.bounds, [level.bounds for level in whole.levels])
    assert again.triangles.tolist() == whole.triangles.tolist() == [8, 7, 6]
    assert len(read) == 4
    (tmp_path / "oak_LOD1.glb").unlink()
    with pytest.raises(InputError, match=r"oak_LOD1\.glb: expected a model file, found nothing"):
        again.levels[1]


def test_stored_levels_stand_where_they_are_moved(tmp_path: Path) -> None:
    oak = stored_species(write(tmp_path, "oak"))
    there = Stored(oak.files, (1.0, -2.0, 3.0))[1:]
    away = there[0].positions - oak.levels[1].positions
    np.testing.assert_allclose(away, np.broadcast_to([1.0, -2.0, 3.0], away.shape), atol=1e-12)


def test_surfels_follow_the_triangles(tmp_path: Path) -> None:
    """The first level of them is all: the others are its parts. A plant that is moved to its place
    takes them along."""
    surfels = ball(60, 0.5, (3.0, 1.0, 0.0))
    levels = [
        Level("mesh", mesh=plant_of(TRIANGLES + np.array([20.0, 0, 0]))),
        Level("surfels", surfels=surfels, near_distance_m=9.0),
        Level("surfels", surfels=surfels.first(15), near_distance_m=18.0),
    ]
    write_chain(LodChain("oak", tuple(levels), Display(50.0, 900), 0), tmp_path)
    one = read_species(tmp_path / f"oak{MANIFEST}")
    assert len(one.levels) == 1 and one.switch_m.tolist() == [0]
    assert one.surfels is not None and one.surfels.switch_m == 9.0
    assert len(one.surfels.read()) == 60
    moved, away = placed(one)
    assert away > 19 and moved.surfels is not None
    shift = moved.levels[0].bounds - one.levels[0].bounds
    assert np.allclose(moved.surfels.read().position, one.surfels.read().position + shift[0])
