"""What is walked through: which plants, where they stand, and from where they are first seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vegtool.errors import InputError, UsageError
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample
from vegtool.plant import Plant
from vegtool.preview.eye import Eye
from vegtool.preview.world import FILLED, World, _row, read_world
from vegtool.scene import read_scene
from vegtool.tiles.library import Species
from vegtool.tiles.placement import placement_of
from vegtool.tiles.terrain import terrain_of

READ = ReadOptions()


def moved(plant: Plant, *by: float) -> Plant:
    return replace(plant, positions=plant.positions + np.array(by))


def alone(plant: Plant, name: str = "herb") -> Species:
    return Species(name, (plant,), np.zeros(1), np.zeros(1), 900.0, (Path(f"{name}.glb"),))


def bounds_of(world: World) -> np.ndarray:
    """(n, 2, 3) metres, of each plant where it stands."""
    plants = world.placement.plants(0)
    feet = plants.origin + plants.offset
    return np.stack(
        [
            world.species[k].levels[0].bounds + foot
            for k, foot in zip(plants.species, feet, strict=True)
        ]
    )


@pytest.fixture(scope="module")
def herb() -> Plant:
    return sample("herb", 120)


def test_plants_of_a_row_stand_beside_each_other_wherever_their_files_have_them(
    herb: Plant,
) -> None:
    """One in map coordinates, one about its origin, one as it should be."""
    height = float(herb.bounds[1, 1])
    places = (herb, moved(herb, 5e5, 300.0, -8e4), moved(herb, 0.0, -height / 2, 0.0))
    found = bounds_of(_row([alone(plant) for plant in places]))
    assert np.abs(found[:, 0, 1]).max() < 0.002, "all on the ground"
    assert (found[1:, 0, 0] > found[:-1, 1, 0]).all(), "and none within another"
    assert np.abs(found).max() < 5


def test_a_row_fills_the_picture(herb: Plant) -> None:
    world = _row([alone(herb), alone(herb), alone(herb)])
    corners = bounds_of(world).reshape(-1, 3)
    clip = np.c_[corners, np.ones(len(corners))] - [*world.start.position, 0]
    clip = clip @ world.start.shot(1024, 768).view_projection.T
    seen = np.abs(clip[:, :2] / clip[:, 3:]).max()
    assert 0.6 * FILLED < seen < 1, "most of it, and none is cut off"


def scene(folder: Path, species: str, placement: str = "spacing_m = 6", more: str = "") -> Path:
    path = folder / "scene.toml"
    path.write_text(
        f'[terrain]\nkind = "plane"\nextent_m = [200, 200]\n{more}\n'
        f"[[species]]\nshare = 1\n{species}\n[placement]\n{placement}\n"
    )
    return path


def test_the_eye_begins_where_no_crown_is(tmp_path: Path) -> None:
    """Nor is there one just ahead, among trees of 8 m width or so every 9 m at least."""
    tree = sample("broadleaf", 400)
    (tmp_path / "tree.glb").write_bytes(plant_glb(tree))
    path = scene(tmp_path, 'model = "tree.glb"\nheight_m = [8, 12]', "spacing_m = 9")
    world = read_world(path, None, READ)
    placement = placement_of(read_scene(path), terrain_of(read_scene(path)))
    eye = world.start.position
    for ahead in (0.0, 3.0, 6.0):
        place = eye[[0, 2]] + np.array([0.0, -ahead])
        for tile in range(len(placement.tiles)):
            plants = placement.plants(tile)
            feet = (plants.origin + plants.offset)[:, [0, 2]]
            wide = plants.height / tree.bounds[1, 1] * np.ptp(tree.bounds, axis=0)[[0, 2]].max() / 2
            assert (np.linalg.norm(feet - place, axis=1) > wide).all()
    assert eye[1] == pytest.approx(1.7)


def test_a_stand_is_first_seen_from_outside(tmp_path: Path) -> None:
    (tmp_path / "herb.glb").write_bytes(plant_glb(sample("herb", 120)))
    (tmp_path / "trees.csv").write_text("x,y,height\n0,0,2\n3,1,4\n-3,2,3\n")
    path = scene(tmp_path, 'model = "herb.glb"', 'inventory = "trees.csv"')
    start = read_world(path, None, READ).start
    assert start.yaw_deg == 0 and start.position[2] > 4, "to the south, looking north"
    for top in ([0, 2, 0], [3, 4, -1], [-3, 3, -2]):
        assert in_view(start, np.array(top, float)) and in_view(start, np.array(top) * [1.0, 0, 1])


def in_view(eye: Eye, point: np.ndarray) -> bool:
    planes = eye.planes(4, 3)
    return bool((planes[:, :3] @ (point - eye.position) + planes[:, 3] >= 0).all())


def test_what_was_converted_is_shown_in_place_of_the_model(herb: Plant, tmp_path: Path) -> None:
    """By the species' name, or else by its model's; a manifest or a folder named is what it is."""
    from vegtool.cli import run

    source, out = tmp_path / "herb.glb", tmp_path / "out"
    source.write_bytes(plant_glb(herb))
    small = ["--billboards", "12", "--levels", "1", "--refine", "none", "--measure", "off"]
    assert run(["convert", str(source), "-o", str(out), "-q", *small]) == 0
    levels = {}
    for name, species in {
        "by_model": 'name = "weed"\nmodel = "herb.glb"',
        "by_name": 'name = "herb"\nmodel = "other.glb"',
        "manifest": 'model = "out/herb.lod.json"',
        "folder": 'model = "out"',
    }.items():
        world = read_world(out, scene(tmp_path, species), READ)
        levels[name] = len(world.species[0].levels)
        assert not world.notes
    assert set(levels.values()) == {2}
    alone = read_world(scene(tmp_path, 'name = "weed"\nmodel = "herb.glb"'), None, READ)
    assert len(alone.species[0].levels) == 1, "none is beside the scene"
    assert "has no levels of detail" in alone.notes[0]


def test_a_folder_of_several_plants_that_a_species_names_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    for name in ("ash", "oak"):
        (tmp_path / "out" / f"{name}.lod.json").touch()
    path = scene(tmp_path, 'model = "out"')
    with pytest.raises(UsageError, match=r"line 7: expected one plant in .*found ash.*, oak"):
        read_world(path, None, READ)


@pytest.mark.parametrize("by", [(40.0, 0.0, 0.0), (0.0, -40.0, 0.0), (5e6, 300.0, 6e5)])
def test_a_plant_that_is_elsewhere_in_its_file_stands_where_it_is_placed(
    by: tuple[float, ...], herb: Plant, tmp_path: Path
) -> None:
    """All of its levels alike; and a note says so."""
    (tmp_path / "herb.glb").write_bytes(plant_glb(moved(herb, *by)))
    path = scene(tmp_path, 'model = "herb.glb"\nheight_m = [1, 2]', "spacing_m = 20")
    world = read_world(path, None, READ)
    (note,) = (note for note in world.notes if "away from the origin" in note)
    away = float(note.split(" is ")[1].split(" m ")[0].replace(",", ""))
    assert away == pytest.approx(float(np.linalg.norm(by)), abs=0.5)
    low, high = world.species[0].levels[0].bounds
    assert abs(low[1]) < 0.01 and (np.abs(low + high)[[0, 2]] < high[1]).all()


def test_a_plant_about_its_origin_is_as_it_was(herb: Plant, tmp_path: Path) -> None:
    """A crown may lean to one side, and roots go into the ground."""
    for by in ((0.2, 0.0, 0.1), (0.0, -0.03, 0.0)):
        (tmp_path / "herb.glb").write_bytes(plant_glb(moved(herb, *by)))
        path = scene(tmp_path, 'model = "herb.glb"', "spacing_m = 20")
        found = read_world(path, None, READ).species[0].levels[0].bounds
        assert np.allclose(found, moved(herb, *by).bounds, atol=1e-5)


def test_a_plant_without_a_height_is_refused(herb: Plant, tmp_path: Path) -> None:
    """It lies on its side, or is a leaf on the ground: no height can be made of it."""
    flat = replace(herb, positions=herb.positions * [1.0, 0.0, 1.0])
    (tmp_path / "herb.glb").write_bytes(plant_glb(flat))
    with pytest.raises(InputError, match=r"has a height, y up, .* flat: 0 m high"):
        read_world(scene(tmp_path, 'model = "herb.glb"', "spacing_m = 20"), None, READ)


def test_flat_ground_goes_on_beyond_all_plants(herb: Plant, tmp_path: Path) -> None:
    """So that an eye beside them stands on it; a heightmap ends where it does."""
    (tmp_path / "herb.glb").write_bytes(plant_glb(herb))
    (tmp_path / "trees.csv").write_text("x,y\n10,0\n-30,20\n")
    path = scene(tmp_path, 'model = "herb.glb"', 'inventory = "trees.csv"')
    world = read_world(path, None, READ)
    assert world.ground is not None
    assert np.abs(world.ground.positions).max(axis=0).tolist() == [1100, 0, 1100]
    path.write_text(path.read_text().replace("extent_m = [200, 200]", ""))
    world = read_world(path, None, READ)
    assert world.ground is not None
    assert np.abs(world.ground.positions).max(axis=0).tolist() == [1030, 0, 1020]
    path.write_text(path.read_text().replace('"plane"', '"none"'))
    assert read_world(path, None, READ).ground is None
    hills = np.arange(64, dtype=np.uint16).reshape(8, 8) * 1000
    Image.fromarray(hills).save(tmp_path / "hills.png")
    hilly = '"heightmap"\nheightmap = "hills.png"\nextent_m = [90, 70]\nheight_m = [0, 4]'
    path.write_text(path.read_text().replace('"none"', hilly))
    world = read_world(path, None, READ)
    assert world.ground is not None
    assert np.abs(world.ground.positions[:, [0, 2]]).max(axis=0).tolist() == [45, 35]
    x, y, z = world.start.position
    assert abs(z) <= 35 and y == pytest.approx(world.height_at(x, z) + 1.7)
