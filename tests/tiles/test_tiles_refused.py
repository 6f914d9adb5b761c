"""`vegtool tiles` with wrong input: a sentence naming file and row, its exit code, and no files."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_gpkg import LINE, geopackage, point
from test_tiles_run import library
from tile_cases import TWO_SPECIES

from vegtool.cli import run

TABLE = "x,y,species\n"
MANY = [f"{i % 300},{i // 300},ash" for i in range(100_000)]
INVENTORY = TWO_SPECIES + "[placement]\ninventory = 'plants.csv'\n"
DENSITY = TWO_SPECIES.replace('"ash"\n', '"ash"\ndensity = "map.png"\n')
RULES = "[placement]\nspacing_m = 3\n[terrain]\nextent_m = [60, 60]\n"


def broken_row() -> str:
    return TABLE + "\n".join([*MANY[:69_999], "1,one,ash", *MANY[70_000:]])


@pytest.mark.parametrize(
    ("files", "code", "says"),
    [
        (
            {"plants.csv": broken_row()}, 1,
            "plants.csv, row 70,000 (line 70,001), column y: expected a number, found 'one'; corr",
        ),
        (
            {"plants.csv": "x,east,y,species\n1,2,3,ash\n"}, 1,
            "plants.csv: expected one column with x, found 'x' (column 1) and 'east' (column 2)",
        ),
        (
            {"plants.csv": TABLE}, 1,
            "plants.csv: expected a row for each plant, found none; add some",
        ),
        (
            {"plants.csv": f"{TABLE}nan,2,ash\n"}, 1,
            "plants.csv, row 1 (line 2), column x: expected a number, found 'nan'; correct or remo",
        ),
        (
            {"plants.csv": f"{TABLE}99,2,ash\n",
             "scene.toml": f"{INVENTORY}[terrain]\nextent_m = [60, 60]\n"}, 1,
            "plants.csv, row 1 (line 2): expected plants on the ground of 60 x 60 m, found none",
        ),
        (
            {"scene.toml": DENSITY + RULES, "map.png": "grey"}, 1,
            "map.png: expected a PNG picture, found something else; export it as a grey PNG of 16",
        ),
        (
            {"plants.csv": f"{TABLE}1,2,ash\n",
             "scene.toml": f"{INVENTORY}[terrain]\ncrs = 'EPSG:banana'\n"}, 2,
            "scene.toml, line 12: crs: expected a code, such as EPSG:25832; got 'EPSG:banana'",
        ),
        (
            {"plants.csv": f"{TABLE}1,2,ash\n",
             "scene.toml": f"{INVENTORY}[terrain]\ncrs = 'UTM north'\n"}, 2,
            "scene.toml, line 12: crs: expected a code, such as EPSG:25832; got 'UTM north'",
        ),
        (
            {"plants.gpkg": "x,y\n" * 100}, 1,
            "plants.gpkg: expected a GeoPackage; file is not a database; export it again",
        ),
    ],
)  # fmt: skip
def test_it_is_said_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], files: dict[str, str], code: int, says: str
) -> None:
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    source = "scene.toml" if "scene.toml" in files else next(iter(files))
    assert refused(tmp_path, source, capsys, says) == code


@pytest.mark.parametrize(
    ("tables", "geometry", "code", "says"),
    [
        (["a", "b"], point(1, 2), 2, "expected one table of features, found 2: a, b; put that of"),
        (["a"], LINE, 1, "plants.gpkg, feature 1: expected a Point, found LineString; remove it"),
    ],
)
def test_geopackages_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], tables: list[str], geometry: bytes,
    code: int, says: str,
) -> None:  # fmt: skip
    geopackage(tmp_path / "plants.gpkg", "species TEXT", [(geometry, "ash")], tables=tables)
    assert refused(tmp_path, "plants.gpkg", capsys, says) == code


def refused(folder: Path, name: str, capsys: pytest.CaptureFixture[str], says: str) -> int:
    """The exit code."""
    out = folder / "out"
    code = run(
        ["tiles", str(folder / name), "--species", str(library(folder)), "-o", str(out), "-q"]
    )
    said = " ".join(capsys.readouterr().err.split()).replace(f"{folder}/", "")
    assert says in said and "Traceback" not in said
    assert not out.exists()
    return code
