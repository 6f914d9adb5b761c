"""Species made ready for tiles: what is converted, when, and how their levels go on."""

from __future__ import annotations

import json
import pickle
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from library_cases import TRIANGLES, edit, model, write
from plants import plant_of
from surfel_sets import ball
from tile_cases import all_of, scene_of

from vegtool.convert import ConvertOptions
from vegtool.errors import (
    CapabilityError,
    InputError,
    OutputError,
    QualityError,
    UsageError,
    VegtoolError,
)
from vegtool.formats import read_plant, read_with_files
from vegtool.formats.gltf import plant_glb, write_chain
from vegtool.growth import sample
from vegtool.lod import FADE_FRACTION, Display, Level, LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.seeding import generator
from vegtool.tiles import chains
from vegtool.tiles.cache import CACHE
from vegtool.tiles.chains import FEW, LEVELS
from vegtool.tiles.library import MANIFEST, Stored
from vegtool.tiles.named import TABLES
from vegtool.tiles.placement import Placement, placement_of
from vegtool.tiles.prepare import Prepared, prepare, renumbered
from vegtool.tiles.source import scene_at
from vegtool.tiles.terrain import terrain_of

MANY = generator(0, "many").random((100, 3, 3))
"""Corners of triangles: more than FEW."""


def landscape(
    folder: Path, species: Sequence[str], library: Path | None = None, workers: int = 1
) -> Prepared:
    """An inventory of these species, a plant of each, and the library beside it, prepared."""
    rows = [f"{9 * index},{index},{name}" for index, name in enumerate(species)]
    (folder / "trees.csv").write_text("\n".join(["x,y,species", *rows]))
    library = library or folder / "library"
    scene = scene_at(folder / "trees.csv", library)
    return prepare(scene, placement_of(scene, terrain_of(scene), 32.0), library, workers)


class Converter:
    """A stand-in that takes no time: levels of these triangles, from 10, 20, ... metres on."""

    def __init__(self, triangles: Sequence[int] = (40, 8), unlit: bool = False) -> None:
        self.triangles, self.unlit = triangles, unlit
        self.asked: list[tuple[Plant, ConvertOptions, MeasureOptions]] = []

    def __call__(
        self, plant: Plant, options: ConvertOptions, measure: MeasureOptions,
        progress: Progress = silent,
    ) -> LodChain:  # fmt: skip
        self.asked.append((plant, options, measure))
        progress("levels", 0.5)
        levels = [Level("mesh", mesh=plant)]
        for index, count in enumerate(self.triangles, start=1):
            mesh = plant_of(MANY[:count])
            levels.append(Level("mesh", mesh=mesh, near_distance_m=10.0 * index, unlit=self.unlit))
        return LodChain(plant.name, tuple(levels), options.display, 0, {"levels": options.levels})


@pytest.fixture
def converter(monkeypatch: pytest.MonkeyPatch) -> Converter:
    found = Converter()
    monkeypatch.setattr(chains, "convert", found)
    return found


@pytest.fixture
def plants(tmp_path: Path) -> Path:
    (tmp_path / "library").mkdir()
    return tmp_path / "library"


def converted(folder: Path, name: str = "oak", counts: Sequence[int] = (100, 60, 40)) -> Path:
    """A chain that ends early: these triangles, from 0, 10, 20, ... metres on."""
    levels = [
        Level("mesh", mesh=plant_of(MANY[:count]), near_distance_m=10.0 * index)
        for index, count in enumerate(counts)
    ]
    options = {"levels": 2, "seed": 7, "measure": "off", "views": "ground", "unit": "cm"}
    write_chain(LodChain(name, tuple(levels), Display(50.0, 900), 7, options), folder)
    return folder / f"{name}{MANIFEST}"


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*") if path.is_file()
    }  # fmt: skip


# ---------------------------------------------------------------------------------------- models


def test_a_model_is_converted_once(tmp_path: Path, plants: Path, converter: Converter) -> None:
    """With as many levels as tiles need; the second time it is read."""
    path = model(plants)
    made = landscape(tmp_path, ["oak"])
    (oak,) = made.species
    assert (oak.name, oak.triangles.tolist()) == ("oak", [8, 40, 8])
    assert oak.switch_m.tolist() == [0, 10, 20]
    (place,) = (plants / CACHE).iterdir()
    assert made.notes[0] == f"{path}: made its levels, of 40, 8 triangles; kept in {place}"
    assert [asked[1:] for asked in converter.asked] == [
        (ConvertOptions(levels=LEVELS), MeasureOptions())
    ]
    before = contents(plants)
    again = landscape(tmp_path, ["oak"])
    assert again.notes == made.notes[1:] and len(converter.asked) == 1
    assert again.species[0].files == oak.files and contents(plants) == before
    plants.rename(tmp_path / "elsewhere")
    landscape(tmp_path, ["oak"], tmp_path / "elsewhere")
    assert len(converter.asked) == 1


def test_a_model_is_converted_again_when_anything_of_it_changes(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    """Its own file, what that refers to, however deep, and how it is read; not its neighbours."""
    (plants / "oak.obj").write_text(
        "mtllib oak.mtl\nusemtl leaf\nv 0 0 0\nv 1 0 0\nv 0 2 0\nvt 0 0\nf 1/1 2/1 3/1\n"
    )
    (plants / "oak.mtl").write_text("newmtl leaf\nmap_Kd leaf.ppm\n")
    from PIL import Image

    def leaf(green: int) -> None:
        Image.new("RGB", (4, 4), (0, green, 0)).save(plants / "leaf.png")

    leaf(200)
    (plants / "oak.mtl").write_text("newmtl leaf\nmap_Kd leaf.png\n")
    _, files = read_with_files(plants / "oak.obj")
    assert [file.name for file in files] == ["oak.obj", "oak.mtl", "leaf.png"]
    changes: list[Callable[[], object]] = [
        lambda: None,
        lambda: leaf(100),
        lambda: (plants / "oak.mtl").write_text("newmtl leaf\nmap_Kd leaf.png\nKd 1 0 0\n"),
        lambda: (plants / TABLES).write_text('[oak]\nunit = "cm"'),
        lambda: (plants / "leaf.png").unlink(),
    ]
    for count, change in enumerate(changes, start=1):
        change()
        for _ in range(2):
            landscape(tmp_path, ["oak"])
        assert len(converter.asked) == count
    (plants / "elm.obj").write_text("v 0 0 0\n")
    landscape(tmp_path, ["oak"])
    assert len(converter.asked) == len(changes)
    leaf(200)
    (plants / TABLES).unlink()
    landscape(tmp_path, ["oak"])
    assert len(list((plants / CACHE).iterdir())) == len(changes) + 1
    assert max(asked[0].height for asked in converter.asked) == pytest.approx(2)


def test_what_no_plant_is_of_is_left_alone(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    """However broken; plants are of the species that their rows name."""
    (plants / "ash.glb").write_bytes(b"glTF, but not really")
    (plants / f"elm{MANIFEST}").write_text("{")
    for name in ("oak.glb", "pine.glb", "yew.glb", "yew.obj"):
        model(plants, name)
    (plants / TABLES).write_text('[oak]\naliases = ["Quercus"]\nheight_m = [3, 4]\n')
    made = landscape(tmp_path, ["Quercus", "pine", "OAK"])
    assert [one.name for one in made.species] == ["oak", "pine"]
    assert len(converter.asked) == 2
    rows = {
        int(row): (int(kind), float(height))
        for part in all_of(made.placement)
        for row, kind, height in zip(part.row, part.species, part.height, strict=True)
    }
    assert [rows[row][0] for row in (1, 2, 3)] == [0, 1, 0]
    assert 3 <= rows[1][1] <= 4 and np.isnan(rows[2][1])
    assert made.placement.tallest(2)[0] == max(rows[1][1], rows[3][1])


def test_placements_by_rules_are_of_all_species(tmp_path: Path) -> None:
    text = '[terrain]\nkind = "plane"\nextent_m = [9, 9]\n[[species]]\nname = "a"\n'
    scene = scene_of(tmp_path, text + "[placement]\nspacing_m = 3\n")
    placement: Placement = placement_of(scene, terrain_of(scene), 32.0)
    same, used = renumbered(placement, 3)
    assert same is placement and used.tolist() == [0, 1, 2]


def test_a_species_that_is_not_there_is_named_with_its_row(tmp_path: Path, plants: Path) -> None:
    write(plants, "oak")
    model(plants, "elm.glb")
    says = (
        r"trees\.csv, row 2 \(line 3\), column species: expected one of elm, oak, found 'fir'; "
        r"correct it, or put a plant of that name, .*into the library"
    )
    with pytest.raises(InputError, match=says):
        landscape(tmp_path, ["oak", "fir"])


# ---------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("error", "kind", "says"),
    [
        (QualityError("an error of 0.3"), QualityError, r"oak\.glb: an error of 0\.3"),
        (CapabilityError("no OpenGL"), CapabilityError, r"oak\.glb: no OpenGL"),
        (MemoryError(), VegtoolError, r"oak\.glb: not enough memory"),
        (ZeroDivisionError("float"), VegtoolError, r"oak\.glb: .*this is a bug"),
        (KeyboardInterrupt(), KeyboardInterrupt, "^$"),
    ],
)
def test_a_plant_that_cannot_be_converted_is_named_and_nothing_of_it_kept(
    tmp_path: Path, plants: Path, monkeypatch: pytest.MonkeyPatch,
    error: BaseException, kind: type[BaseException], says: str,
) -> None:  # fmt: skip
    """What was converted before it stays."""
    for name in ("elm", "oak"):
        model(plants, f"{name}.glb")
    works = Converter()

    def fails(plant: Plant, *others: object) -> LodChain:
        if plant.name == "oak":
            raise error
        return works(plant, *others)  # type: ignore[arg-type]

    monkeypatch.setattr(chains, "convert", fails)
    with pytest.raises(kind, match=says) as caught:
        landscape(tmp_path, ["elm", "oak"])
    assert caught.type is kind
    (place,) = (plants / CACHE).iterdir()
    assert (place / "elm.lod.json").exists()


def test_models_that_are_no_plants_are_named(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    """Before anything is converted."""
    model(plants, "elm.glb")
    (plants / "oak.glb").write_bytes(b"glTF, but not really")
    with pytest.raises(InputError, match=r"oak\.glb"):
        landscape(tmp_path, ["elm", "oak"])
    (plants / "oak.glb").write_bytes(plant_glb(plant_of(TRIANGLES * [1, 0, 1])))
    with pytest.raises(InputError, match=r"oak\.glb: expected a plant that has a height"):
        landscape(tmp_path, ["elm", "oak"])
    assert not converter.asked


def test_converted_plants_that_are_broken_are_named(tmp_path: Path, plants: Path) -> None:
    manifest = converted(plants)
    level = plants / "oak_LOD2.glb"
    data = level.read_bytes()
    level.unlink()
    with pytest.raises(InputError, match=r"oak\.lod\.json: expected the file oak_LOD2\.glb"):
        landscape(tmp_path, ["oak"])
    level.write_bytes(data)
    for values, says in [
        ({"seed": "x"}, "str"), ({"refine": "half"}, "--refine"), ({"leaf_materials": 3}, "int"),
        ({"prelit": True, "sun": "noon"}, "--sun"), ({"measure": "x"}, "--measure"),
    ]:  # fmt: skip
        edit(manifest, lambda told, values=values: told["options"].update(values))
        with pytest.raises(InputError, match=rf"oak\.lod\.json: options: expected .*{says}"):
            landscape(tmp_path, ["oak"])
        edit(manifest, lambda told, values=values: [told["options"].pop(key) for key in values])
    manifest.write_text("{")
    with pytest.raises(InputError, match=r"oak\.lod\.json: expected a manifest"):
        landscape(tmp_path, ["oak"])


def test_a_library_that_cannot_be_written_is_said_before_the_work(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    (plants / CACHE).write_text("in the way")
    model(plants)
    says = r"convert it by hand, vegtool convert .*oak\.glb --levels 9 -o FOLDER"
    with pytest.raises(OutputError, match=says):
        landscape(tmp_path, ["oak"])
    (plants / "oak.glb").unlink()
    converted(plants)
    with pytest.raises(OutputError, match="vegtool convert the model of oak --levels 9"):
        landscape(tmp_path, ["oak"])
    assert not converter.asked


# --------------------------------------------------------------------------------- coarser levels


def test_levels_go_on_where_they_end(tmp_path: Path, plants: Path, converter: Converter) -> None:
    """From the original and with its options: half as many planes for half the size. Those that
    save nothing are left out; none is used before the one before it is there in full."""
    converter.triangles = (39, 20, 6)
    manifest = converted(plants)
    before = contents(plants)
    made = landscape(tmp_path, ["oak"])
    (oak,) = made.species
    assert oak.triangles.tolist() == [100, 60, 40, 20, 6]
    assert oak.switch_m.tolist() == [0, 10, 20, 23, 30]
    assert oak.switch_m[3] >= 20 * (1 + FADE_FRACTION)
    np.testing.assert_allclose(oak.fade[1:], FADE_FRACTION, rtol=1e-3)
    assert [file.parent for file in oak.files[:3]] == [plants.resolve()] * 3
    assert oak.focal_px == Display(50.0, 900).pixels_per_metre(1.0)
    ((plant, how, measure),) = converter.asked
    assert len(plant.faces) == 100 and plant.extent == pytest.approx(np.ptp(MANY, (0, 1)).max())
    size = plant.extent * Display(50.0, 900).pixels_per_metre(20.0) / 2
    assert how == ConvertOptions(
        levels=3, billboards=10, pixels=pytest.approx(size), seed=7, fov=50.0, image_height=900
    )
    assert measure == MeasureOptions("off", views="ground")
    (place,) = (plants / CACHE).iterdir()
    says = f"{manifest}: made coarser levels, of 20, 6 triangles; kept in {place}"
    assert made.notes == (says,)
    assert landscape(tmp_path, ["oak"]).species[0].files == oak.files
    assert len(converter.asked) == 1
    after = {k: v for k, v in contents(plants).items() if not k.startswith(CACHE)}
    assert after == before


def test_surfels_follow_the_levels_that_are_made(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    """Of an original and surfels from 12 m on: levels of triangles reach farther."""
    converter.triangles = (39, 20, 6)
    surfels = Level("surfels", surfels=ball(50), near_distance_m=12.0)
    original = Level("mesh", mesh=plant_of(MANY[:100]))
    options = {"levels": 2, "seed": 7, "measure": "off", "views": "ground", "unit": "cm"}
    write_chain(LodChain("oak", (original, surfels), Display(50.0, 900), 7, options), plants)
    (oak,) = landscape(tmp_path, ["oak"]).species
    assert oak.triangles.tolist() == [100, 39, 20, 6]
    assert oak.surfels is not None and oak.surfels.switch_m > oak.switch_m[-1]
    assert len(oak.surfels.read()) == 50


@pytest.mark.parametrize("counts", [(100, FEW), (FEW,), (100, 60, 3)])
def test_levels_that_end_with_few_triangles_are_all(
    tmp_path: Path, plants: Path, converter: Converter, counts: tuple[int, ...]
) -> None:
    converted(plants, counts=counts)
    assert landscape(tmp_path, ["oak"]).species[0].triangles.tolist() == list(counts)
    assert not converter.asked and not (plants / CACHE).exists()


def test_an_original_alone_gets_all_levels(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    converted(plants, counts=(100,))
    (oak,) = landscape(tmp_path, ["oak"]).species
    assert oak.triangles.tolist() == [100, 40, 8]
    ((_, how, _),) = converter.asked
    assert (how.levels, how.billboards) == (LEVELS, ConvertOptions().billboards)


def test_levels_do_not_go_on_in_another_light(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    """Where the manifest does not tell that light was baked, say."""
    converter.unlit = True
    converted(plants)
    made = landscape(tmp_path, ["oak"])
    assert made.species[0].triangles.tolist() == [100, 60, 40]
    assert "made coarser levels, of no triangles" in made.notes[0]
    landscape(tmp_path, ["oak"])
    assert len(converter.asked) == 1, "that there are none is kept too"


def test_levels_end_where_none_is_good_enough(
    tmp_path: Path, plants: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> LodChain:
        raise QualityError("expected a level with an error of at most 0.1, found 0.2")

    monkeypatch.setattr(chains, "convert", fails)
    converted(plants)
    made = landscape(tmp_path, ["oak"])
    assert made.species[0].triangles.tolist() == [100, 60, 40]
    assert "found 0.2" in made.notes[1]


# -------------------------------------------------------------------------------------- prepared


def test_what_is_prepared_goes_to_other_processes(
    tmp_path: Path, plants: Path, converter: Converter, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In little room, and they read what they draw alone."""
    model(plants, "elm.glb")
    converted(plants)
    (tmp_path / "far").mkdir()
    away = np.array([0.0, -40.0, 0.0])
    (plants / "fir.glb").write_bytes(plant_glb(plant_of(TRIANGLES + away)))
    made = landscape(tmp_path, ["elm", "oak", "fir"])
    assert any("is 3" in note and "away from the origin" in note for note in made.notes)
    sent = pickle.dumps(made.species)
    assert len(sent) < 6000
    elm, fir, oak = pickle.loads(sent)
    for one in (elm, fir, oak):
        assert isinstance(one.levels, Stored)
        np.testing.assert_array_equal(one.bounds, [level.bounds for level in one.levels])
        assert one.triangles.tolist() == [len(level.faces) for level in one.levels]
    assert fir.bounds[0, 0, 1] == pytest.approx(0, abs=1e-6)
    read: list[str] = []
    monkeypatch.setattr(
        "vegtool.tiles.library.read_plant", lambda path: read.append(path.name) or read_plant(path)
    )
    _ = (oak.bounds, oak.triangles, oak.height, oak.size)
    assert not read
    _ = oak.levels[2]
    assert read == ["oak_LOD2.glb"]


def test_progress_goes_from_nothing_to_all(
    tmp_path: Path, plants: Path, converter: Converter
) -> None:
    for name in ("elm.glb", "oak.glb"):
        model(plants, name)
    (tmp_path / "trees.csv").write_text("x,y,species\n0,0,elm\n9,0,oak\n")
    scene = scene_at(tmp_path / "trees.csv", plants)
    told: list[tuple[str, float]] = []
    placement = placement_of(scene, terrain_of(scene), 32.0)
    prepare(scene, placement, plants, 1, lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares) and shares[0] == 0 and shares[-1] <= 1
    assert [stage for stage, _ in told if "converting" in stage] == [
        "converting elm: levels", "converting oak: levels"
    ]  # fmt: skip


def prelit(folder: Path, name: str, **options: object) -> Path:
    """A herb with a level under a baked sun; as it is left is not what it was converted to."""
    herb = replace(sample("herb", 100), branches=None)
    level = Level("mesh", mesh=herb, near_distance_m=2.0, unlit=True)
    told = {"refine": "none", "measure": "off", "prelit": True, **options}
    chain = LodChain(name, (Level("mesh", mesh=herb), level), Display(), 0, told)
    write_chain(chain, folder)
    return folder / f"{name}{MANIFEST}"


@pytest.mark.gl
def test_levels_go_on_under_the_sun_that_is_baked(tmp_path: Path, plants: Path) -> None:
    """Really converted: coarser and coarser, farther and farther; twice the same."""
    manifest = prelit(plants, "oak", sun="90,40")
    (oak,) = landscape(tmp_path, ["oak"]).species
    assert (np.diff(oak.triangles[1:]) < 0).all() and oak.triangles[-1] <= FEW
    assert all(material.unlit for level in oak.levels[2:] for material in level.materials)
    first = contents(plants)
    (told,) = (data for name, data in first.items() if name.endswith(f"/oak{MANIFEST}"))
    assert json.loads(told)["sun"]["azimuth_deg"] == 90
    shutil.rmtree(plants / CACHE)
    landscape(tmp_path, ["oak"])
    assert contents(plants) == first and manifest.exists()


def test_two_at_a_time_end_with_the_error_of_the_first(tmp_path: Path, plants: Path) -> None:
    """In processes of their own, and before anything is drawn: the sun is not said."""
    for name in ("elm", "oak"):
        prelit(plants, name)
    with pytest.raises(
        UsageError, match=r"elm\.lod\.json: --prelit: expected where the sun stands"
    ):
        landscape(tmp_path, ["oak", "elm"], workers=2)
    assert not list((plants / CACHE).iterdir())
