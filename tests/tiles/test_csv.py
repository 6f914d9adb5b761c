"""Text with a row per plant: what people and programs make of it, and where it is broken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tile_cases import TWO_SPECIES, scene_of

from vegtool.errors import InputError, UsageError, VegtoolError
from vegtool.tiles.rows import Rows, read_rows

PLACEMENT = TWO_SPECIES + '\n[placement]\ninventory = "trees.csv"\n'


def rows_of(
    folder: Path, data: str | bytes, more: str = "", name: str = "trees.csv", scene: str = PLACEMENT
) -> Rows:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return read_rows(scene_of(folder, scene.replace("trees.csv", name) + more))


def refusal(
    folder: Path, data: str | bytes, more: str = "", kind: type[VegtoolError] = InputError
) -> str:
    with pytest.raises(kind) as caught:
        rows_of(folder, data, more)
    return str(caught.value).replace(f"{folder}/", "")


@pytest.mark.parametrize(
    "data",
    [
        "x,y,species\n1.5,2,ash\n3,4.25,pine\n",
        "x;y;species\n1,5;2;ash\n3;4,25;pine",
        "x\ty\tspecies\r\n1.5\t2\tASH\r\n\r\n3\t4,25\tpine\r\n",
        '\ufeffX, "Y" ,Species\n1.5, 2, " ash"\n3,4.25,Pine,,\n',
        "y,id,species,x\n2,7,ash,1.5\n4.25,8,pine,3\n",
        "species,easting,northing\nash,1.5,2\npine,3,4.25\n",
        "Baumart;Rechtswert;Hochwert\nash;1,5;2\npine;3;4,25\n",
        "kind,utm_e,utm_n\nash,1.5,2\npine,3,4.25\n",
        "art,X_coord,Y_coord\nash,1.5,2\npine,3,4.25\n",
        "species,x_m,y (m)\nash,1.5,2\npine,3,4.25\n",
        "species,x_cm,y [mm]\nash,150,2000\npine,300,4250\n",
        ",,,\nx,y,species,\n1.5,2,ash,\n   \n,,,\n3,4.25,pine,\n,,,\n",
    ],
)
def test_the_same_two_plants(tmp_path: Path, data: str) -> None:
    rows = rows_of(tmp_path, data)
    assert rows.x.tolist() == [1.5, 3]
    assert rows.y.tolist() == [2, 4.25]
    assert rows.species.tolist() == [0, 1]
    assert rows.row.tolist() == [1, 2]
    assert np.isnan(rows.z).all() and np.isnan(rows.height).all() and np.isnan(rows.yaw).all()


def test_all_columns(tmp_path: Path) -> None:
    """Heights in metres, turns in degrees; what nothing is known of is empty, in many words."""
    data = (
        "x,y,z,species,height_m,rotation,crown_m,id\n"
        "0,0,101.5,ash,12.5,90,4,a\n0,0,,ash,,NA,,b\n0,0,nan,pine,-,,,c\n0,0,7,pine,0,360,,d\n"
        "0,0,,ash,1e-300,0,,e\n"
    )
    rows = rows_of(tmp_path, data)
    nan = pytest.approx(np.nan, nan_ok=True)
    assert rows.z.tolist() == [101.5, nan, nan, 7, nan]
    assert rows.height.tolist() == [12.5, nan, nan, nan, nan]
    assert rows.yaw.tolist() == [pytest.approx(np.pi / 2), nan, nan, pytest.approx(2 * np.pi), 0]
    zero, unused = rows.notes
    assert zero.endswith("plants of height 0, taken as not known: 2")
    assert unused.endswith("columns that are not used: crown_m, id")


def test_the_scene_chooses_columns_and_units(tmp_path: Path) -> None:
    """Against all names; what it says of units is more than what a name says."""
    data = "x,y,a,b,h_m,turn,what,species\n9,9,1,2,150,0.5,pine,ash\n"
    more = (
        'columns = { x = "a", y = "b", height = "h_m", yaw = "turn", species = "what" }\n'
        'units = { x = "ft", height = "cm", yaw = "rad" }\n'
    )
    rows = rows_of(tmp_path, data, more)
    assert (rows.x[0], rows.y[0]) == (0.3048, 2)
    assert (rows.height[0], rows.yaw[0], rows.species[0]) == (1.5, 0.5, 1)


def test_latin_1_is_read_and_said(tmp_path: Path) -> None:
    scene = PLACEMENT.replace('name = "ash"', 'name = "Föhre"')
    data = "x,y,Baumart,Höhe\n1,2,Föhre,3\n".encode("latin-1")
    rows = rows_of(tmp_path, data, scene=scene)
    assert (rows.species[0], rows.height[0]) == (0, 3)
    assert rows.notes[0].endswith("trees.csv: is not utf-8; read as Latin-1")
    for encoding in ("utf-8-sig", "utf-16"):
        rows = rows_of(tmp_path, data.decode("latin-1").encode(encoding), scene=scene)
        assert (rows.species[0], rows.height[0], rows.notes) == (0, 3, ())


def test_one_species_needs_no_column(tmp_path: Path) -> None:
    scene = '[[species]]\nmodel = "ash.glb"\n[placement]\ninventory = "trees.tsv"\n'
    rows = rows_of(tmp_path, "x\ty\n1\t2\n", name="trees.tsv", scene=scene)
    assert rows.species.tolist() == [0]


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        ("oak,1,2,3", "column species: expected one of ash, pine, found 'oak'; correct it, or add"),
        (",1,2,3", "column species: expected one of ash, pine, found nothing; correct it, or add"),
        ("ash,1 m,2,3", "column x: expected a number, found '1 m'; correct or remove the row"),
        ("ash,,2,3", "column x: expected a number, found nothing; correct or remove the row"),
        ("ash,1,inf,3", "column y: expected a number, found 'inf'; correct or remove the row"),
        ("ash,1,nan,3", "column y: expected a number, found 'nan'; correct or remove the row"),
        ("ash,1,2,tall", "column height: expected a number, found 'tall'; correct or remove the"),
        ("ash,1,2,-3", "column height: expected 0 to 150 m, found '-3'; say the column's unit"),
        ("ash,1,2,1500", "column height: expected 0 to 150 m, found '1500'; say the column's unit"),
        ("ash,1e30,2,3", "column x: expected -1e+09 to 1e+09 m, found '1e30'; correct or remove"),
        ("ash,1,2", ": expected 4 values, found 3; put quotes around values with separators in"),
        ("ash,1,2,3,4", ": expected 4 values, found 5; put quotes around values with separators"),
    ],
)
def test_a_broken_row_is_named(tmp_path: Path, broken: str, says: str) -> None:
    """Row 70,000 of plants; the header, an empty line and one in quotes make it line 70,003."""
    rows = ["species,x,y,height", "", '"ash\n",1,2,3', *["ash,1,2,3"] * 69_998, broken]
    said = refusal(tmp_path, "\n".join([*rows, "pine,1,2,3"]))
    assert said.startswith("trees.csv, row 70,000 (line 70,003)")
    assert says in said


@pytest.mark.parametrize(
    ("data", "more", "kind", "says"),
    [
        ("", "", InputError, "trees.csv: expected a row of column names, found nothing; add one"),
        ("x,y,species\n", "", InputError, "trees.csv: expected a row for each plant, found none"),
        (
            "x,y,species,name\n1,2,ash,a\n", "", InputError,
            "trees.csv: expected one column with species, found 'species' (column 3) and 'name' "
            '(column 4); choose one with columns = { species = "species" } in [placement]',
        ),
        (
            "x,easting,y,species\n1,2,3,ash\n", "", InputError,
            "expected one column with x, found 'x' (column 1) and 'easting' (column 2)",
        ),
        (
            "x,species\n1,ash\n", "", InputError,
            "expected a column with y, such as y, north, northing, found 'x', 'species'; rename",
        ),
        (
            "565000.1,5930000.2\n1,2\n", "", InputError,
            "expected a column with x, such as x, east, easting, found '565000.1', '5930000.2'",
        ),
        (
            "x,y\n1,2\n", "", InputError,
            "expected a column with species, as the scene has 2, found 'x', 'y'; choose one with",
        ),
        (
            "x,y,species\n1,2,ash\n", 'columns = { height = "tall" }', InputError,
            "expected one column called 'tall', as columns in scene.toml, line 12 says, found none",
        ),
        (
            "x,y,species,a,a\n1,2,ash,3,4\n", 'columns = { height = "a" }', InputError,
            "expected one column called 'a', as columns in scene.toml, line 12 says, found 2 among",
        ),
        (
            "x,y,species\n1,2,ash\n", 'columns = { hight = "x" }', UsageError,
            "scene.toml, line 12: columns: expected one of x, y, z, species, height, yaw, crown; ",
        ),
        (
            "x,y,species\n1,2,ash\n", 'units = { species = "m" }', UsageError,
            "line 12: units: expected one of x, y, z, height, yaw, crown; got 'species'",
        ),
        (
            "x,y,species\n1,2,ash\n", 'units = { x = "miles" }', UsageError,
            "line 12: units: expected one of mm, cm, dm, m, in, ft for x; got 'miles'",
        ),
        (
            "lon,lat,species\n190,2,ash\n", "", InputError,
            "row 1 (line 2), column lon: expected -180 to 180 degrees, found '190'",
        ),
    ],
)  # fmt: skip
def test_files_that_cannot_be_understood(
    tmp_path: Path, data: str, more: str, kind: type[VegtoolError], says: str
) -> None:
    assert says in refusal(tmp_path, data, more, kind)


def test_names_decide_species_whatever_their_case(tmp_path: Path) -> None:
    scene = PLACEMENT.replace('name = "pine"', 'name = "Ash "')
    with pytest.raises(UsageError, match=r"line 7: name: two species are called Ash ; rename one"):
        rows_of(tmp_path, "x,y,species\n1,2,ash\n", scene=scene)
    scene = PLACEMENT.replace('name = "pine"\n', "")
    with pytest.raises(UsageError, match=r"line 6: expected a name, by which .*trees.csv can call"):
        rows_of(tmp_path, "x,y,species\n1,2,ash\n", scene=scene)


def test_files_of_other_kinds(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"expected an inventory \(.csv, .*found .shp; export it as"
    ):
        rows_of(tmp_path, "", name="trees.shp")
    scene = scene_of(tmp_path, PLACEMENT)
    with pytest.raises(
        InputError, match=r"trees.csv: cannot be read \(No such file or directory\)"
    ):
        read_rows(scene)
    said = refusal(tmp_path, 'x,y,species\n1,2,"' + "a" * 200_000)
    assert "trees.csv, line 2: expected values between ','" in said
