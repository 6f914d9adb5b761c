"""Points of LAS and LAZ as plants: extra bytes as columns, maps, and files that are broken."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_csv import rows_of
from test_gpkg import FEET, UTM
from tile_cases import placed

from vegtool.errors import CapabilityError, InputError, VegtoolError
from vegtool.tiles.rows import Rows

laspy = pytest.importorskip("laspy", reason="the extra [geo] is not installed")
pytest.importorskip("lazrs", reason="the extra [geo] is not installed")

SCENE = '[[species]]\nname = "3"\nmodel = "a.glb"\n[placement]\ninventory = "trees.las"\n'
PLACES = np.array([[565_000.25, 5_930_000.5, 30.0], [565_001.0, 5_930_002.125, 31.5]])


def las(path: Path, extra: Mapping[str, Any], record: Any = None, places: Any = PLACES) -> None:
    """A file with these extra bytes, by laspy."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, 1 / 1024)
    header.offsets = np.floor(places[0]) if len(places) else np.zeros(3)
    for name, values in extra.items():
        array = np.asarray(values)
        kind = f"{array.shape[1] if array.ndim > 1 else ''}{array.dtype.str[1:]}"
        header.add_extra_dim(laspy.ExtraBytesParams(name, kind))
    if record is not None:
        header.vlrs.append(record)
    data = laspy.LasData(header)
    data.x, data.y, data.z = np.asarray(places).T
    for name, values in extra.items():
        setattr(data, name, values)
    data.write(path)


def read(folder: Path, name: str = "trees.las", more: str = "") -> Rows:
    scene = SCENE.replace("trees.las", name)
    return rows_of(folder, (folder / name).read_bytes(), more, name, scene)


def refusal(folder: Path, name: str, kind: type[VegtoolError] = InputError) -> str:
    with pytest.raises(kind) as caught:
        read(folder, name)
    return str(caught.value).replace(f"{folder}/", "")


def keys(**values: int) -> Any:
    """GeoTIFF's keys, by their numbers."""
    found = laspy.vlrs.known.GeoKeyDirectoryVlr()
    body = np.array([[1, 1, 0, len(values)], *([int(k[1:]), 0, 1, v] for k, v in values.items())])
    found.parse_record_data(body.astype("<u2").tobytes())
    return found


def text(words: str) -> Any:
    return laspy.vlrs.known.WktCoordinateSystemVlr(words)


@pytest.mark.parametrize("name", ["trees.las", "trees.laz"])
def test_each_point_is_a_plant(tmp_path: Path, name: str) -> None:
    """z is where its foot is; lists are no columns."""
    extra = {
        "height": np.array([12.5, np.nan], np.float32),
        "species": np.array([3, 3], np.uint8),
        "rgb": np.ones((2, 3), np.float32),
        "intensities": np.array([1, 2], np.uint16),
    }
    las(tmp_path / name, extra)
    rows = read(tmp_path, name)
    np.testing.assert_array_equal(np.stack([rows.x, rows.y, rows.z], axis=1), PLACES)
    assert rows.height[0] == 12.5 and np.isnan(rows.height[1])
    assert rows.species.tolist() == [0, 0] and rows.row.tolist() == [1, 2]
    assert rows.notes == (f"{tmp_path / name}: columns that are not used: intensities",)


def test_many_points(tmp_path: Path) -> None:
    """In several parts."""
    places = PLACES[0] + np.random.default_rng(0).integers(0, 2**16, (20_000, 3)) / 1024
    las(tmp_path / "trees.las", {"h": np.linspace(1, 2, 20_000)}, places=places)
    rows = read(tmp_path)
    np.testing.assert_array_equal(np.stack([rows.x, rows.y, rows.z], axis=1), places)
    np.testing.assert_array_equal(rows.height, np.linspace(1, 2, 20_000))
    las(tmp_path / "trees.las", {"h": np.linspace(-1, 2, 20_000)[::-1]}, places=places)
    assert "point 13,334, column h: expected 0 to 150 m, found -" in refusal(tmp_path, "trees.las")


@pytest.mark.parametrize(
    ("record", "crs"),
    [
        (None, None),
        (text(UTM), "EPSG:25832"),
        (text(f'COMPD_CS["with heights",{UTM},VERT_CS["DHHN",UNIT["foot",0.3]]]'), "EPSG:25832"),
        (keys(k1024=1, k3072=25832, k3076=9001), "EPSG:25832"),
        (keys(k1024=1, k3072=32767), None),
        (text("nothing"), None),
    ],
)
def test_maps(tmp_path: Path, record: Any, crs: str | None) -> None:
    las(tmp_path / "trees.las", {}, record)
    assert read(tmp_path).columns.crs == crs
    assert placed(tmp_path, SCENE).crs == crs


@pytest.mark.parametrize("record", [keys(k2048=4326), text('GEOGCRS["W",ID["EPSG",4326]]')])
def test_degrees(tmp_path: Path, record: Any) -> None:
    las(tmp_path / "trees.las", {}, record, PLACES / [1e5, 1e5, 1])
    found = read(tmp_path).columns
    assert found.geographic and found.crs == "EPSG:4326"


@pytest.mark.parametrize("record", [text(FEET), keys(k3072=2225, k3076=9003)])
def test_maps_in_feet(tmp_path: Path, record: Any) -> None:
    las(tmp_path / "trees.las", {}, record)
    said = refusal(tmp_path, "trees.las")
    assert "expected coordinates in metres or degrees, found those of EPSG:2225 in " in said


def test_files_that_are_broken(tmp_path: Path) -> None:
    """Cut short, or of something else, or with more records than it has bytes."""
    las(tmp_path / "whole.las", {}, text(UTM))
    whole = (tmp_path / "whole.las").read_bytes()
    las(tmp_path / "whole.laz", {}, text(UTM), np.repeat(PLACES, 500, axis=0))
    packed = (tmp_path / "whole.laz").read_bytes()
    for name, data, says in (
        ("a.las", b"", "expected LAS or LAZ; "),
        ("b.las", b"x,y\n1,2\n" * 100, "expected LAS or LAZ; "),
        ("c.las", whole[:200], "expected LAS or LAZ; "),
        ("d.las", whole[:-20], f"points, {len(whole):,} bytes, found {len(whole) - 20:,}"),
        ("e.las", whole[:100] + b"\xff" * 4 + whole[104:], "found 4,294,967,295 records in a file"),
        ("f.laz", packed[:-200], "expected LAS or LAZ; "),
    ):  # fmt: skip
        (tmp_path / name).write_bytes(data)
        said = refusal(tmp_path, name)
        assert said.startswith(f"{name}: expected ") and says in said
        assert said.endswith("export it again")
    las(tmp_path / "none.las", {}, places=np.empty((0, 3)))
    assert "none.las: expected a row for each plant, found none" in refusal(tmp_path, "none.las")
    with pytest.raises(InputError, match=r"trees.las: cannot be read \(No such file or directory"):
        placed(tmp_path, SCENE)


def test_a_panic_is_a_broken_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of Rust's, which is no Exception."""
    las(tmp_path / "trees.laz", {})

    class PanicException(BaseException):
        pass

    def panic(self: Any, points: int) -> Any:
        raise PanicException("capacity overflow")

    monkeypatch.setattr(laspy.LasReader, "read_points", panic)
    said = refusal(tmp_path, "trees.laz")
    assert said == "trees.laz: expected LAS or LAZ; capacity overflow; export it again"


@pytest.mark.parametrize(("name", "missing"), [("trees.las", "laspy"), ("trees.laz", "lazrs")])
def test_what_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, missing: str
) -> None:
    las(tmp_path / name, {})
    monkeypatch.setitem(sys.modules, missing, None)
    said = refusal(tmp_path, name, CapabilityError)
    assert f"{missing} is not installed; run pip install 'vegtool[geo]', or export the" in said
