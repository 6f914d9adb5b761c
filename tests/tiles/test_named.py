"""What is found in a library under which name, and what is said where that is not clear."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from library_cases import model, write
from tile_cases import scene_of

from vegtool.errors import InputError, UsageError, VegtoolError
from vegtool.formats import ReadOptions
from vegtool.scene import KINDS
from vegtool.tiles.library import MANIFEST
from vegtool.tiles.named import KEYS, TABLES, Library, Source, library_at
from vegtool.tiles.source import scene_at
from vegtool.tiles.species import source_of, species_of


def tables(folder: Path, text: str) -> Library:
    (folder / TABLES).write_text(text, encoding="utf-8")
    return library_at(folder)


def found(library: Library, name: str) -> Path | None:
    source = library.find(name)
    return None if source is None else source.path.relative_to(library.folder)


def test_a_name_is_looked_up_in_one_order(tmp_path: Path) -> None:
    """A table, a manifest, a model, a folder: each where there is none of those before."""
    model(tmp_path, "elm.glb")
    write(tmp_path, "oak")  # oak.glb is a file of it
    (tmp_path / "Oak").mkdir()
    model(tmp_path / "Oak", "any.glb")
    library = tables(tmp_path, '[oak]\nmodel = "elm.glb"\n')
    assert found(library, "oak") == Path("elm.glb")
    (tmp_path / TABLES).unlink()
    assert found(library_at(tmp_path), "oak") == Path(f"oak{MANIFEST}")
    for path in tmp_path.glob("oak*.*"):
        path.unlink()
    model(tmp_path, "oak.GLB")
    assert found(library_at(tmp_path), "OAK ") == Path("oak.GLB")
    (tmp_path / "oak.GLB").unlink()
    assert found(library_at(tmp_path), "oak") == Path("Oak/any.glb")
    shutil.rmtree(tmp_path / "Oak")
    assert found(library_at(tmp_path), "oak") is None


def test_a_table_may_have_other_names_and_say_how_to_read(tmp_path: Path) -> None:
    model(tmp_path, "q_robur_v2.glb")
    library = tables(
        tmp_path,
        '["English oak"]\nmodel = "q_robur_v2.glb"\naliases = ["Quercus robur", "oak", "OAK"]\n'
        'unit = "cm"\nup = "z"\nleaf_material = ["leaf*"]\nheight_m = [3, 30]\n',
    )
    read = ReadOptions("cm", "z", ("leaf*",))
    for name in ("english oak", "quercus ROBUR", "Oak"):
        assert library.find(name) == Source(tmp_path / "q_robur_v2.glb", read)
    (one,) = library.species()
    assert (one.name, one.height_m) == ("English oak", (3, 30))
    assert one.aliases == ("Quercus robur", "OAK"), "and its file is no species beside"


def test_a_table_without_a_model_is_of_the_plant_of_its_name(tmp_path: Path) -> None:
    write(tmp_path, "oak")
    library = tables(tmp_path, '[Oak]\naliases = ["Eiche"]\n')
    assert found(library, "eiche") == Path(f"oak{MANIFEST}")
    assert [one.name for one in library.species()] == ["Oak"]


def test_all_that_plants_of_an_inventory_may_be(tmp_path: Path) -> None:
    """Files of converted plants, and folders of other things, are no species."""
    write(tmp_path, "pine")
    model(tmp_path, "elm.obj")
    for name in ("oak", "notes", ".vegtool"):
        (tmp_path / name).mkdir()
    model(tmp_path / "oak", "any.glb")
    model(tmp_path / ".vegtool", "hidden.glb")
    assert [one.name for one in library_at(tmp_path).species()] == ["elm", "oak", "pine"]
    (tmp_path / "trees.csv").write_text("x,y,species\n1,2,elm\n")
    scene = scene_at(tmp_path / "trees.csv", tmp_path)
    assert [one.name for one in scene.species] == ["elm", "oak", "pine"]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (
            ["oak.glb", "Oak.obj"],
            r"expected one plant called 'oak', found Oak\.obj, oak\.glb\. Say",
        ),
        (
            ["oak/a.glb", "oak/b.obj"],
            r"expected one plant in .*oak, or .* found a\.glb, b\.obj\. N",
        ),
        (["oak/notes.txt"], r"expected one plant in .*oak, or .* found no plant\. Name"),
        (
            [f"oak{MANIFEST}", f"OAK{MANIFEST}"],
            r"expected one plant called 'oak', found OAK.*, oak",
        ),
    ],
)
def test_two_plants_of_a_name_are_said_when_it_is_asked_for(
    tmp_path: Path, make: list[str], says: str
) -> None:
    """And nothing is, as long as nobody asks."""
    for name in make:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    model(tmp_path, "elm.glb")
    library = library_at(tmp_path)
    assert found(library, "elm") == Path("elm.glb")
    assert {"elm"} <= {one.name for one in library.species()}
    with pytest.raises(UsageError, match=says):
        library.find("oak")


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("[oak", None, "expected TOML"),
        ('oak = "oak.glb"', 1, r"expected a table \[NAME\] for each species; got oak"),
        ('[oak]\n\nmodell = "oak.glb"', 3, "no key of a species is called 'modell'; known: model,"),
        ("[oak]\nmodel = 7", 2, "model: expected text in quotes; got 7"),
        ('[oak]\naliases = "Eiche"', 2, "aliases: expected names in quotes, .*; got 'Eiche'"),
        ('[oak]\naliases = ["Eiche", 7]', 2, "aliases: expected names in quotes"),
        ("[oak]\nheight_m = [9, 3]", 2, "height_m: expected two numbers"),
        ("[oak]\nheight_m = [0, 3]", 2, "height_m: expected at least 0.001; got 0"),
        ('[oak]\nup = "north"', 2, "up: expected one of auto, x, y"),
        ('[oak]\nunit = "furlong"', 1, "unit: expected mm, cm"),
        (
            '[oak]\naliases = ["tree"]\n[elm]\naliases = ["Tree"]', 4,
            r"two species are called Tree: \[oak\] and \[elm\]; leave out one",
        ),
        ('[oak]\n[elm]\naliases = ["Oak"]', 3, "two species are called Oak"),
    ],
)  # fmt: skip
def test_a_table_that_makes_no_sense_is_named_with_its_line(
    tmp_path: Path, text: str, line: int | None, says: str
) -> None:
    place = rf"species\.toml{'' if line is None else f', line {line}'}: {says}"
    with pytest.raises(UsageError, match=place):
        tables(tmp_path, text)


def test_a_table_without_its_plant_is_named_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"species\.toml, line 2: expected a file or a folder, .*"):
        tables(tmp_path, '[oak]\nmodel = "oak.glb"')
    library = tables(tmp_path, '[oak]\naliases = ["Eiche"]')
    with pytest.raises(InputError, match=r"line 1: expected a plant called 'oak' in .*found none"):
        library.find("Eiche")


def test_a_converted_plant_is_not_read_otherwise(tmp_path: Path) -> None:
    write(tmp_path, "oak")
    library = tables(tmp_path, '\n[oak]\nunit = "cm"')
    with pytest.raises(UsageError, match=r"line 2: unit, up and leaf_material say .* Leave them"):
        library.find("oak")


def test_an_alias_that_another_plant_has_as_its_name_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "oak")
    model(tmp_path, "elm.glb")
    library = tables(tmp_path, '[oak]\naliases = ["Elm"]')
    with pytest.raises(UsageError, match=r"line 1: aliases: .*elm\.glb is called elm too"):
        library.species()


@pytest.mark.parametrize("place", [f"oak{MANIFEST}", "oak/any.glb"])
def test_an_alias_may_be_what_the_plant_is_called_by_itself(tmp_path: Path, place: str) -> None:
    """A converted plant has a model of its name beside it, and a plant may have a folder."""
    if place.endswith(MANIFEST):
        write(tmp_path, "oak")
    else:
        (tmp_path / "oak").mkdir()
        model(tmp_path / "oak", "any.glb")
    library = tables(tmp_path, f'["Quercus robur"]\nmodel = "{place}"\naliases = ["oak"]')
    assert [one.name for one in library.species()] == ["Quercus robur"]
    assert found(library, "Oak") == Path(place)


def test_a_folder_of_plants_has_to_be_one(tmp_path: Path) -> None:
    cases: list[tuple[str, type[VegtoolError], str]] = [
        ("none", InputError, "expected a folder of plants, found nothing there"),
        ("oak.glb", UsageError, "expected a folder of plants, one for each species; got a file"),
    ]
    model(tmp_path)
    for name, kind, says in cases:
        with pytest.raises(kind, match=says):
            library_at(tmp_path / name)
        (tmp_path / "trees.csv").write_text("x,y\n1,2\n")
        with pytest.raises(kind, match=says):
            scene_at(tmp_path / "trees.csv", tmp_path / name)


def test_a_scene_finds_its_species_in_the_library(tmp_path: Path) -> None:
    """By any name, and before the model that it names itself; models, where it names none."""
    plants = tmp_path / "library"
    plants.mkdir()
    write(plants, "oak")
    model(plants, "elm.glb")
    model(tmp_path, "ash.glb")
    (plants / TABLES).write_text('[oak]\naliases = ["Eiche"]\n')
    library = library_at(plants)
    text = "[[species]]\n{}\n[placement]\nspacing_m = 9\n"
    for table, path in {
        'name = "Eiche"': plants / f"oak{MANIFEST}",
        'name = "tree"\nmodel = "oak.glb"': plants / f"oak{MANIFEST}",
        'name = "elm"': plants / "elm.glb",
        'name = "elm"\nmodel = "ash.glb"': tmp_path / "ash.glb",
        'model = "ash.glb"': tmp_path / "ash.glb",
        'model = "library/elm.glb"': plants / "elm.glb",
    }.items():
        assert source_of(library, scene_of(tmp_path, text.format(table)), 0).path == path, table
    with pytest.raises(InputError, match=r"line 1: expected a model, or a plant called 'fir' in "):
        source_of(library, scene_of(tmp_path, text.format('name = "fir"')), 0)
    with pytest.raises(InputError, match=r"line 2: expected the model .*fir\.glb, or .* neither"):
        source_of(library, scene_of(tmp_path, text.format('model = "fir.glb"')), 0)


def test_models_are_shown_as_the_library_says_they_are_read(tmp_path: Path) -> None:
    """By what does not convert; and it says so."""
    model(tmp_path, "oak.glb")
    scene = scene_of(tmp_path, '[[species]]\nname = "oak"\n[placement]\nspacing_m = 9\n')
    metres = species_of(scene, tmp_path, ReadOptions())
    assert "oak.glb: has no levels of detail" in metres.notes[0]
    (tmp_path / TABLES).write_text('[oak]\nunit = "cm"\n')
    centimetres = species_of(scene, tmp_path, ReadOptions())
    assert centimetres.species[0].size == pytest.approx(metres.species[0].size / 100)
    assert not (tmp_path / ".vegtool").exists()


def test_the_page_describes_every_key_as_it_is() -> None:
    page = Path(__file__).parents[2] / "docs" / "species.md"
    rows = re.findall(r"^\| `(\w+)` \| (.+?) \|", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert rows == [(key, KINDS[rule.kind][0]) for key, rule in KEYS.items()]
