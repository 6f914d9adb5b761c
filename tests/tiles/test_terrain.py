"""The ground: heights, slopes and meshes, and what is said of files that are none."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tile_cases import picture, scene_of

from vegtool.errors import CapabilityError, InputError, UsageError, VegtoolError
from vegtool.tiles.geotiff import read_geotiff
from vegtool.tiles.grid import Grid
from vegtool.tiles.terrain import Terrain, terrain_of

HILL = """
[terrain]
kind = "heightmap"
heightmap = "hill.png"
extent_m = [40, 20]
height_m = [100, 165.535]
"""
"""Heights in centimetres: of 16 bits, v is 100 m and v mm."""


def refusal(folder: Path, text: str, kind: type[VegtoolError]) -> str:
    """What is said of ground that is refused, less its folder."""
    with pytest.raises(kind) as caught:
        terrain_of(scene_of(folder, text))
    return str(caught.value).replace(f"{folder}/", "")


def test_nothing_and_a_plane(tmp_path: Path) -> None:
    points = np.array([[0.0, 0.0], [5.0, -900.0]])
    nothing = terrain_of(scene_of(tmp_path, ""))
    assert (nothing.kind, nothing.extent, nothing.height(points).tolist()) == ("none", None, [0, 0])
    assert all(len(part) == 0 for part in nothing.mesh(10))
    plane = terrain_of(scene_of(tmp_path, "[terrain]\nextent_m = [40, 20]\nheight_m = [3, 3]"))
    assert plane.kind == "plane" and plane.height(points).tolist() == [3, 3]
    assert plane.slope(points).tolist() == [0, 0]
    assert plane.inside(points).tolist() == [True, False]
    low, high = plane.heights_within(np.zeros((3, 2)), np.zeros((2, 2)))
    assert low.shape == high.shape == (2, 3) and (low == 3).all() and (high == 3).all()


def test_heights_of_sixteen_bits_to_the_millimetre(tmp_path: Path) -> None:
    """First row north, at -z; first column west, at -x; the outermost pixels on the border."""
    picture(tmp_path / "hill.png", [[0, 10_000, 20_000], [1, 10_001, 65_535]])
    ground = terrain_of(scene_of(tmp_path, HILL))
    assert ground.kind == "heightmap" and ground.notes == ()
    points = np.array([[-20, -10], [0, -10], [-20, 10], [20, 10], [0, 0]], np.float64)
    expected = [100, 110, 100.001, 165.535, 110.0005]
    assert ground.height(points) == pytest.approx(expected, abs=1e-4)


def test_eight_bits_and_long_pixels_are_said(tmp_path: Path) -> None:
    picture(tmp_path / "hill.png", [[0, 255], [51, 0], [7, 7]], bits=8)
    ground = terrain_of(scene_of(tmp_path, HILL))
    assert ground.height(np.array([[20.0, -10.0], [-20.0, 0.0]])) == pytest.approx(
        [165.535, 100 + 65.535 / 5], abs=1e-4
    )
    eight, long = ground.notes
    assert "hill.png: has 8 bits, so heights come in steps of 0.257 m" in eight
    assert "2 x 3 pixels over 40 x 20 m are not square: 40 x 10 m" in long


def test_greys_saved_as_colours_are_greys(tmp_path: Path) -> None:
    grey = np.array([[0, 255], [51, 0]], np.uint8)
    Image.fromarray(np.dstack([grey] * 3)).save(tmp_path / "hill.png")
    assert terrain_of(scene_of(tmp_path, HILL)).height(np.array([[20.0, -10.0]])) == pytest.approx(
        [165.535], abs=1e-4
    )
    Image.fromarray(np.dstack([grey, grey, 255 - grey])).save(tmp_path / "hill.png")
    assert "hill.png: expected shades of grey, found colours" in refusal(tmp_path, HILL, InputError)


def test_a_slope_is_its_angle() -> None:
    """One up for one along x: 45 degrees, wherever."""
    grid = Grid(np.array([[0, 40], [0, 40]], np.float32), np.array([40.0, 20.0]))
    ground = Terrain("heightmap", grid.extent, grid)
    points = np.random.default_rng(0).uniform(-9, 9, (5, 2))
    assert np.degrees(ground.slope(points)) == pytest.approx([45] * 5, abs=1e-9)


def test_a_mesh_is_the_ground_seen_from_above() -> None:
    grid = Grid(np.random.default_rng(0).uniform(0, 9, (5, 9)), np.array([40.0, 20.0]))
    ground = Terrain("heightmap", grid.extent, grid)
    positions, normals, faces = ground.mesh(8)
    assert len(positions) == 9 * 5 and len(faces) == 2 * 8 * 4 and faces.dtype == np.int32
    assert positions[:, 1] == pytest.approx(ground.height(positions[:, [0, 2]]))
    assert positions[:, [0, 2]].min(axis=0).tolist() == [-20, -10]
    a, b, c = positions[faces].transpose(1, 0, 2)
    up = np.cross(b - a, c - a)
    assert (up[:, 1] > 0).all(), "counter-clockwise from above"
    assert up[:, 1].sum() / 2 == pytest.approx(800), "all of the extent, once"
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(45))


def test_the_normals_of_a_plane_are_its_own() -> None:
    grid = Grid(np.array([[0, 40], [0, 40]], np.float32), np.array([40.0, 20.0]))
    _, normals, _ = Terrain("heightmap", grid.extent, grid).mesh(4)
    assert normals == pytest.approx(np.tile([-1, 1, 0] / np.sqrt(2), (len(normals), 1)))


def test_a_plane_without_an_extent_is_drawn_on_one_that_is_given() -> None:
    plane = Terrain("plane", None, None, 2.0)
    positions, _, _ = plane.mesh(3, np.array([30.0, 10.0]))
    assert len(positions) == 4 * 2 and (positions[:, 1] == 2).all()
    with pytest.raises(UsageError, match=r"without extent_m in \[terrain\]"):
        plane.mesh(3)


@pytest.mark.parametrize(
    ("text", "kind", "says"),
    [
        (
            HILL.replace("extent_m = [40, 20]\n", ""),
            UsageError,
            "scene.toml, line 4: expected extent_m in [terrain] for heights in a picture",
        ),
        (
            HILL.replace("height_m = [100, 165.535]\n", ""),
            UsageError,
            "scene.toml, line 4: expected height_m in [terrain] for heights in a picture",
        ),
        (
            '[terrain]\nkind = "plane"\nheight_m = [1, 2]',
            UsageError,
            "scene.toml, line 3: height_m: expected twice the same height for ground that is plane",
        ),
        (
            HILL,
            InputError,
            "hill.png: cannot be read (No such file or directory); check scene.toml, line 4: heig",
        ),
    ],
)
def test_what_is_missing_is_named(
    tmp_path: Path, text: str, kind: type[VegtoolError], says: str
) -> None:
    assert says in refusal(tmp_path, text, kind)


def test_files_that_are_no_heights(tmp_path: Path) -> None:
    path = tmp_path / "hill.png"
    picture(path, [[5]])
    said = refusal(tmp_path, HILL, InputError)
    assert said.startswith("hill.png: expected 2 to 16384 pixels on each side, found 1 x 1; scale")
    path.write_bytes(b"heights")
    assert "hill.png: expected a PNG picture, found something" in refusal(
        tmp_path, HILL, InputError
    )
    picture(path, np.random.default_rng(0).integers(0, 2**16, (40, 40)))
    path.write_bytes(path.read_bytes()[:-500])
    assert "hill.png: the picture is broken (" in refusal(tmp_path, HILL, InputError)


# GeoTIFF: rasterio is an extra, and what it says of a file is all that is ours to understand.


def dataset(heights: Any, transform: tuple[float, ...], crs: Any, missing: Any = False) -> Any:
    """What rasterio.open gives."""
    values = np.ma.masked_array(heights, missing)
    return SimpleNamespace(
        shape=values.shape,
        height=values.shape[0],
        width=values.shape[1],
        transform=(*transform, 0, 0, 1),
        crs=crs,
        read=lambda band, masked: values,
    )


def crs(name: str = "EPSG:25832", projected: bool = True, metres: float = 1.0) -> Any:
    return SimpleNamespace(
        is_projected=projected,
        linear_units_factor=("unit", metres),
        to_string=lambda: name,
    )


HEIGHTS = np.arange(12, dtype=np.float32).reshape(3, 4)
PLACE = (10.0, 0.0, 565_000.0, 0.0, -20.0, 5_930_000.0)
"""Pixels of 10 x 20 m from the north-western corner."""
TIF = '[terrain]\nkind = "heightmap"\nheightmap = "valley.tif"\n'


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Sets what a stand-in for rasterio opens."""
    (tmp_path / "valley.tif").write_bytes(b"II*\0")

    class RasterioError(Exception):
        pass

    def use(found: Any) -> None:
        @contextmanager
        def open(path: Path) -> Any:
            if isinstance(found, str):
                raise RasterioError(found)
            yield found

        errors = SimpleNamespace(RasterioError=RasterioError)
        monkeypatch.setitem(sys.modules, "rasterio", SimpleNamespace(open=open, errors=errors))  # type: ignore[arg-type]

    return use


def test_a_geotiff_knows_its_size_and_place(tmp_path: Path, opened: Any) -> None:
    """Its middle is the scene's origin; heights are at the pixels' centres."""
    opened(dataset(HEIGHTS, PLACE, crs()))
    ground = terrain_of(scene_of(tmp_path, TIF))
    assert ground.extent is not None and ground.origin is not None
    assert ground.extent.tolist() == [30, 40]
    assert ground.origin.tolist() == [565_020, 5_929_970, 0]
    assert ground.crs == "EPSG:25832"
    assert ground.height(np.array([[-15.0, -20.0], [15.0, 20.0]])).tolist() == [0, 11]


def test_rows_from_south_to_north_are_turned(tmp_path: Path, opened: Any) -> None:
    opened(dataset(HEIGHTS[::-1], (10, 0, 565_000, 0, 20, 5_929_940), crs()))
    ground = terrain_of(scene_of(tmp_path, TIF))
    assert ground.grid is not None and ground.origin is not None
    assert np.array_equal(ground.grid.values, HEIGHTS)
    assert ground.origin.tolist() == [565_020, 5_929_970, 0]


@pytest.mark.parametrize(
    ("found", "more", "says"),
    [
        ("not recognized", "", "valley.tif: expected a GeoTIFF; not recognized; export it again"),
        (dataset(HEIGHTS[:1], PLACE, crs()), "", "found 4 x 1; scale it"),
        (
            dataset(HEIGHTS, (1, 0, 0, 0, 1, 0), None),
            "",
            "expected where it lies on the map, found",
        ),
        (dataset(HEIGHTS, (10, 3, 0, 3, -10, 0), crs()), "", "found a map that is turned"),
        (
            dataset(HEIGHTS, PLACE, crs("EPSG:4326", False)),
            "",
            "in metres, found EPSG:4326; reproj",
        ),
        (dataset(HEIGHTS, PLACE, crs("EPSG:2225", True, 0.3)), "", "in metres, found EPSG:2225"),
        (dataset(HEIGHTS, PLACE, crs(), HEIGHTS == 5), "", "a height in every pixel, found 1 with"),
        (
            dataset(HEIGHTS, PLACE, crs()),
            "extent_m = [90, 40]",
            "valley.tif: expected 90 x 40 m, as extent_m in scene.toml, line 4, found 30 x 40 m",
        ),
        (
            dataset(HEIGHTS, PLACE, crs()),
            "height_m = [0, 5]",
            "valley.tif: expected heights of 0 to 5 m, as height_m in scene.toml, line 4, found 0",
        ),
        (
            dataset(HEIGHTS, PLACE, crs()),
            'crs = "EPSG:25833"',
            "valley.tif: expected EPSG:25833, as crs in scene.toml, line 4, found EPSG:25832",
        ),
        (
            dataset(HEIGHTS, PLACE, crs()),
            "origin = [1, 2]",
            "valley.tif: expected its middle at 1, 2, as origin in scene.toml, line 4, found",
        ),
    ],
)
def test_geotiffs_that_do_not_fit(
    tmp_path: Path, opened: Any, found: Any, more: str, says: str
) -> None:
    opened(found)
    assert says in refusal(tmp_path, TIF + more, InputError)


def test_a_geotiff_may_say_what_the_scene_says(tmp_path: Path, opened: Any) -> None:
    """Whether the extent is that of the pixels or of their centres."""
    opened(dataset(HEIGHTS, PLACE, crs()))
    more = 'height_m = [-5, 20]\ncrs = "epsg:25832"\norigin = [565020, 5929970]\nextent_m = '
    for extent in ("[40, 60]", "[30, 40]"):
        ground = terrain_of(scene_of(tmp_path, TIF + more + extent))
        assert ground.extent is not None and ground.extent.tolist() == [30, 40]


def test_without_rasterio_the_command_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rasterio", None)
    said = refusal(tmp_path, TIF, CapabilityError)
    assert "run pip install 'vegtool[geo]', or convert it to a PNG of 16 bits (scene.toml," in said


def test_a_geotiff_that_is_not_there(tmp_path: Path, opened: Any) -> None:
    opened("nothing")
    (tmp_path / "valley.tif").unlink()
    said = refusal(tmp_path, TIF, InputError)
    assert "valley.tif: expected a GeoTIFF, found no file there; check scene.toml, line 3" in said


def test_rasterio_itself_reads_the_same(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio", reason="the extra [geo] is not installed")
    from rasterio.transform import Affine

    path = tmp_path / "valley.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=4, height=3, count=1, dtype="float32",
        crs="EPSG:25832", transform=Affine(*PLACE),
    ) as file:  # fmt: skip
        file.write(HEIGHTS, 1)
    raster = read_geotiff(path, "here")
    assert np.array_equal(raster.heights, HEIGHTS)
    assert (raster.extent.tolist(), raster.crs) == ([30, 40], "EPSG:25832")
