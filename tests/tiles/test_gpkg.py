"""Points in an SQLite database: their headers, attributes and maps, and files that are broken."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_csv import rows_of
from tile_cases import TWO_SPECIES, placed

from vegtool.errors import InputError, UsageError, VegtoolError
from vegtool.scene import read_scene
from vegtool.tiles.rows import Rows, read_rows

SCENE = TWO_SPECIES + '\n[placement]\ninventory = "trees.gpkg"\n'
UTM = (
    'PROJCS["ETRS89 / UTM zone 32N",GEOGCS["ETRS89",UNIT["degree",0.0174532925199433],'
    'AUTHORITY["EPSG","4258"]],PROJECTION["Transverse_Mercator"],UNIT["metre",1,'
    'AUTHORITY["EPSG","9001"]],AXIS["Easting",EAST],AUTHORITY["EPSG","25832"]]'
)
FEET = UTM.replace('"metre",1', '"US survey foot",0.304800609601219').replace("25832", "2225")
MAPS = [
    (-1, "NONE", -1, "undefined"),
    (0, "NONE", 0, "undefined"),
    (4326, "EPSG", 4326, 'GEOGCS["WGS 84",UNIT["degree",0.0174],AUTHORITY["EPSG","4326"]]'),
    (4314, "EPSG", 4314, 'GEOGCS["DHDN",UNIT["degree",0.0174],AUTHORITY["EPSG","4314"]]'),
    (25832, "epsg", 25832, UTM),
    (2225, "EPSG", 2225, FEET),
    (9, "NONE", 9, UTM),
    (10, "NONE", 10, UTM.replace(',AUTHORITY["EPSG","25832"]]', "]")),
]
"""Identifier, organization, its own code, description."""


def point(*coordinates: float, envelope: int = 0, big: bool = False, more: int = 0) -> bytes:
    """A geometry; more: thousands of its type. The box in its header is not looked at."""
    order = ">" if big else "<"
    box = b"\0" * (0, 32, 48, 48, 64)[envelope]
    head = b"GP\0" + bytes([1 | envelope << 1]) + struct.pack("<i", 25832) + box
    kind = 1 + (more or 1000 * (len(coordinates) == 3))
    return head + struct.pack(f"{order}BI{len(coordinates)}d", 0 if big else 1, kind, *coordinates)


Row = tuple[Any, ...]


def geopackage(
    path: Path, columns: str, rows: Sequence[Row], srs: int = 25832, z: int = 0,
    tables: Sequence[str] = ("trees",),
) -> None:  # fmt: skip
    """Each row: a geometry, then values of these columns, of which a type may be said."""
    path.unlink(missing_ok=True)
    with closing(sqlite3.connect(path)) as file:
        file.executescript(
            "CREATE TABLE gpkg_spatial_ref_sys (srs_id INTEGER PRIMARY KEY, organization TEXT,"
            " organization_coordsys_id INTEGER, definition TEXT);"
            "CREATE TABLE gpkg_contents (table_name TEXT, data_type TEXT);"
            "CREATE TABLE gpkg_geometry_columns (table_name TEXT, column_name TEXT,"
            " geometry_type_name TEXT, srs_id INTEGER, z INTEGER, m INTEGER);"
            "INSERT INTO gpkg_contents VALUES ('notes', 'attributes');"
        )
        file.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?)", MAPS)
        for name in tables:
            file.execute(f'CREATE TABLE "{name}" (fid INTEGER PRIMARY KEY, geom BLOB, {columns})')
            file.execute("INSERT INTO gpkg_contents VALUES (?, 'features')", (name,))
            entry = (name, "geom", "POINT", srs, z, 0)
            file.execute("INSERT INTO gpkg_geometry_columns VALUES (?, ?, ?, ?, ?, ?)", entry)
            values = ", ".join("?" * (columns.count(",") + 2))
            file.executemany(f'INSERT INTO "{name}" VALUES (NULL, {values})', rows)
        file.commit()


def read(folder: Path, more: str = "") -> Rows:
    return rows_of(folder, (folder / "trees.gpkg").read_bytes(), more, "trees.gpkg", SCENE)


def refusal(folder: Path, kind: type[VegtoolError] = InputError, more: str = "") -> str:
    with pytest.raises(kind) as caught:
        read(folder, more)
    return str(caught.value).replace(f"{folder}/", "")


def test_points_on_a_map(tmp_path: Path) -> None:
    """Whatever the order of their bytes and the box before them."""
    geopackage(
        tmp_path / "trees.gpkg",
        '"Baumart" TEXT, "Hoehe_cm" REAL, "rotation" INTEGER, "id" INTEGER',
        [
            (point(565_000.25, 5_930_000.5), "ash", 250.0, 180, 7),
            (point(565_001.0, 5_930_002.0, envelope=1, big=True), "Pine", None, None, 8),
            (point(565_002.0, 5_930_003.0, envelope=4), "pine", 1200, 0, None),
        ],
    )
    rows = read(tmp_path)
    assert rows.x.tolist() == [565_000.25, 565_001, 565_002]
    assert rows.y.tolist() == [5_930_000.5, 5_930_002, 5_930_003]
    assert rows.species.tolist() == [0, 1, 1] and np.isnan(rows.z).all()
    assert rows.height.tolist() == [2.5, pytest.approx(np.nan, nan_ok=True), 12]
    assert rows.yaw[0] == pytest.approx(np.pi) and rows.row.tolist() == [1, 2, 3]
    assert not rows.columns.geographic and rows.columns.crs == "EPSG:25832"
    assert rows.notes == (f"{tmp_path}/trees.gpkg: columns that are not used: fid, id",)


def test_many_points(tmp_path: Path) -> None:
    """In several parts; rows are told apart in the last one too."""
    places = np.random.default_rng(0).uniform(0, 1000, (20_000, 2))
    rows = [(point(*xy), "ash") for xy in places.tolist()]
    geopackage(tmp_path / "trees.gpkg", "species TEXT", rows)
    found = read(tmp_path)
    assert np.array_equal(np.stack([found.x, found.y], axis=1), places)
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [*rows, (point(1, 2), "oak")])
    assert "feature 20,001, column species: expected one of ash, pine" in refusal(tmp_path)


def test_points_with_heights(tmp_path: Path) -> None:
    """Of the ground. A measure is none."""
    rows = [
        (point(1.0, 2.0, 30.5), "ash"),
        (point(1.0, 2.0), "ash"),
        (point(3.0, 4.0, 99.0, more=2000), "ash"),
        (point(3.0, 4.0, 31.5, 99.0, more=3000), "ash"),
    ]
    geopackage(tmp_path / "trees.gpkg", "species TEXT", rows, z=2)
    nan = pytest.approx(np.nan, nan_ok=True)
    assert read(tmp_path).z.tolist() == [30.5, nan, nan, 31.5]
    geopackage(tmp_path / "trees.gpkg", "species TEXT, ground REAL", [(rows[0][0], "ash", 7)], z=1)
    assert read(tmp_path, 'columns = { z = "ground" }').z.tolist() == [7]


def test_tree_tops_of_lidr(tmp_path: Path) -> None:
    """What locate_trees writes: z is how high a tree is, and stands in an attribute too. It is not
    where its foot is."""
    rows = [
        (point(481_294.7, 3_813_011.0, 16.0), 1, 16.0),
        (point(481_281.9, 3_813_003.0, 27), 2, 27),
    ]
    geopackage(tmp_path / "trees.gpkg", "treeID INTEGER, Z REAL", rows, z=1)
    scene = '[[species]]\nmodel = "a.glb"\n[placement]\ninventory = "trees.gpkg"\n'
    data = (tmp_path / "trees.gpkg").read_bytes()
    found = rows_of(tmp_path, data, "", "trees.gpkg", scene)
    assert found.height.tolist() == [16, 27] and np.isnan(found.z).all()
    assert "treeID and Z are those of tree tops that lidR finds, so Z is the" in found.notes[0]
    found = rows_of(tmp_path, data, 'columns = { z = "Z" }', "trees.gpkg", scene)
    assert found.z.tolist() == [16, 27] and np.isnan(found.height).all()


@pytest.mark.parametrize(
    ("srs", "crs", "geographic"),
    [
        (4326, "EPSG:4326", True),
        (25832, "EPSG:25832", False),
        (9, "EPSG:25832", False),
        (10, None, False),
        (-1, None, False),
        (0, None, True),
        (77, None, False),
    ],
)
def test_maps(tmp_path: Path, srs: int, crs: str | None, geographic: bool) -> None:
    """One without a code is known by its description; what is not described is in metres."""
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [(point(10.0, 53.5), "ash")], srs)
    found = read(tmp_path).columns
    assert found.geographic == geographic
    if srs == 10:
        assert found.crs is not None and found.crs.startswith('PROJCS["ETRS89 / UTM zone 32N"')
    else:
        assert found.crs == crs


def test_the_map_of_a_file_is_the_scenes(tmp_path: Path) -> None:
    """Unless the scene has another; two names of one zone are no other."""
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [(point(565_000, 5_930_000), "ash")])
    assert placed(tmp_path, SCENE).crs == "EPSG:25832"
    terrain = '[terrain]\ncrs = "EPSG:326{}"\norigin = [565000, 5930000]\n'
    assert placed(tmp_path, terrain.format(32) + SCENE).crs == "EPSG:32632"
    with pytest.raises(InputError, match=r"expected EPSG:32633, as the ground, found EPSG:25832"):
        placed(tmp_path, terrain.format(33) + SCENE)
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [(point(10.0, 53.5), "ash")], 4314)
    with pytest.raises(InputError, match=r"expected longitude and latitude on WGS 84, .*EPSG:4314"):
        placed(tmp_path, SCENE)


def test_it_is_left_as_it_is(tmp_path: Path) -> None:
    """No file is made beside it, also where a program was not done with it."""
    path = tmp_path / "here" / "trees #1?.gpkg"
    path.parent.mkdir()
    geopackage(path, "species TEXT", [(point(1, 2), "ash")])
    with closing(sqlite3.connect(path)) as file:
        file.execute("PRAGMA journal_mode = WAL")
    data = path.read_bytes()
    scene = SCENE.replace("trees.gpkg", "here/trees #1?.gpkg")
    (tmp_path / "scene.toml").write_text(scene)
    assert len(read_rows(read_scene(tmp_path / "scene.toml")).x) == 1
    assert path.read_bytes() == data and list(path.parent.iterdir()) == [path]


LINE = b"GP\0\1" + struct.pack("<iBII4d", 25832, 1, 2, 2, 0, 0, 1, 1)


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ([(point(1, 2), "ash"), (LINE, "ash")], "feature 2: expected a Point, found LineString; "),
        ([(None, "ash")], "feature 1: expected a Point, found no geometry; remove it, or export"),
        ([("POINT (1 2)", "ash")], "feature 1: expected a Point, found no binary one; remove it"),
        ([(b"GP\0\1" + b"\xff" * 40, "ash")], "feature 1: expected a Point, found "),
        ([(point(1, 2)[:20], "ash")], "feature 1: expected a Point, found a broken one; remove it"),
        ([(b"GP", "ash")], "feature 1: expected a Point, found a broken one; remove it, or export"),
        ([(point(1, 2)[8:], "ash")], "feature 1: expected a Point, found something else; remove"),
        ([(b"GP\0\x11" + point(1, 2)[4:], "ash")], "expected a Point, found an empty one; remove"),
        ([(point(np.nan, 2), "ash")], "feature 1, column geom x: expected a number, found nan; "),
        ([(point(1, np.inf), "ash")], "feature 1, column geom y: expected a number, found inf; "),
        ([(point(1, 2), None)], "feature 1, column species: expected one of ash, pine, found "),
        ([], "trees.gpkg: expected a row for each plant, found none; add some"),
    ],
)  # fmt: skip
def test_features_that_are_no_plants(tmp_path: Path, rows: list[Row], says: str) -> None:
    geopackage(tmp_path / "trees.gpkg", "species TEXT", rows)
    assert says in refusal(tmp_path)


def test_several_tables_are_listed(tmp_path: Path) -> None:
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [(point(1, 2), "ash")], tables=["b", "a"])
    said = refusal(tmp_path, UsageError)
    assert "trees.gpkg: expected one table of features, found 2: a, b; put that of the" in said
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [], tables=[])
    assert "trees.gpkg: expected a table of features, found none; export the points" in refusal(
        tmp_path
    )


def test_maps_in_feet(tmp_path: Path) -> None:
    geopackage(tmp_path / "trees.gpkg", "species TEXT", [(point(1, 2), "ash")], 2225)
    said = refusal(tmp_path)
    assert (
        "expected coordinates in metres or degrees, found those of EPSG:2225 in US survey" in said
    )


def test_files_that_are_no_geopackage(tmp_path: Path) -> None:
    path = tmp_path / "trees.gpkg"
    rows = [(point(1, 2), f"ash{'h' * 50}") for _ in range(200)]
    geopackage(path, "species TEXT", rows)
    whole = path.read_bytes()
    for data in (b"x,y\n1,2\n" * 100, b"", whole[: len(whole) // 2], whole[:50]):
        path.write_bytes(data)
        said = refusal(tmp_path)
        assert said.startswith("trees.gpkg: expected a GeoPackage; "), data[:20]
        assert said.endswith("; export it again")
    with closing(sqlite3.connect(tmp_path / "other.db")) as file:
        file.execute("CREATE TABLE trees (x, y)")
    path.write_bytes((tmp_path / "other.db").read_bytes())
    assert "trees.gpkg: expected a GeoPackage; no such table: gpkg" in refusal(tmp_path)
    path.unlink()
    with pytest.raises(InputError, match=r"trees.gpkg: cannot be read \(No such file or directory"):
        placed(tmp_path, SCENE)
