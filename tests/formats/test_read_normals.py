"""Normals that no shading can use: what is counted, and that none of it reaches a picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made import QUAD, quad_file

from vegtool.formats import read_plant
from vegtool.plant import Plant

NAN, INF = np.nan, np.inf
ACROSS = np.array([0, 0.6, 0.8])
BROKEN = np.array([[NAN, 0, 1], [0, INF, 1], [0, 0, 0], 5 * ACROSS], np.float32)
"""Two that are no number, though one component is; one of length zero; one that says something."""
SIGNALLING = np.frombuffer(np.uint32(0x7FA00000).tobytes(), np.float32)[0]
"""A NaN that traps; what uninitialised memory may hold."""


def glb(folder: Path, normals: np.ndarray | None) -> Path:
    return quad_file(folder / "quad.glb", **({} if normals is None else {"NORMAL": normals}))


def obj(folder: Path, normals: np.ndarray | None) -> Path:
    rows = [f"v {x} {y} {z}" for x, y, z in QUAD]
    rows += [] if normals is None else [f"vn {x} {y} {z}" for x, y, z in normals]
    rows.append("f 1 2 3 4" if normals is None else "f 1//1 2//2 3//3 4//4")
    path = folder / "quad.obj"
    path.write_text("\n".join(rows) + "\n")
    return path


def ply(folder: Path, normals: np.ndarray | None) -> Path:
    columns, rows = ["x", "y", "z"], QUAD
    if normals is not None:
        columns, rows = [*columns, "nx", "ny", "nz"], np.hstack([QUAD, normals])
    lines = ["ply", "format ascii 1.0", "element vertex 4"]
    lines += [f"property float {name}" for name in columns]
    lines += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, row.tolist())) for row in rows]
    path = folder / "quad.ply"
    path.write_text("\n".join([*lines, "4 0 1 2 3"]) + "\n")
    return path


Writer = Callable[[Path, "np.ndarray | None"], Path]
FORMATS = pytest.mark.parametrize("write", [glb, obj, ply])


def note(plant: Plant) -> list[str]:
    """What the notes say of normals."""
    return [text for text in plant.notes if "normals" in text]


@FORMATS
def test_each_kind_is_counted_and_the_others_are_kept(tmp_path: Path, write: Writer) -> None:
    plant = read_plant(write(tmp_path, BROKEN))
    assert note(plant) == [
        "computed the normals of 3 of 4 vertices: 1 of length zero, 2 not a number"
    ]
    assert sorted(plant.normals.round(6).tolist()) == [*[[0, 0, 1]] * 3, ACROSS.tolist()]


@FORMATS
def test_a_file_without_normals(tmp_path: Path, write: Writer) -> None:
    plant = read_plant(write(tmp_path, None))
    assert note(plant) == ["computed the normals of 4 of 4 vertices: 4 without any in the file"]
    assert np.allclose(plant.normals, [0, 0, 1])


@FORMATS
def test_normals_that_say_something_are_not_counted(tmp_path: Path, write: Writer) -> None:
    plant = read_plant(write(tmp_path, np.tile(np.float32(ACROSS), (4, 1))))
    assert note(plant) == []
    assert np.allclose(plant.normals, ACROSS)


def test_corners_without_a_normal_beside_others(tmp_path: Path) -> None:
    """OBJ gives normals to corners: one of this one's has none, and another names one of zero."""
    path = obj(tmp_path, BROKEN)
    path.write_text(path.read_text().replace("f 1//1 2//2 3//3 4//4", "f 1 2//4 3//3 4//4"))
    assert note(read_plant(path)) == [
        "computed the normals of 2 of 4 vertices: 1 without any in the file, 1 of length zero"
    ]


def test_signalling_nans_warn_of_nothing(tmp_path: Path) -> None:
    plant = read_plant(glb(tmp_path, np.full((4, 3), SIGNALLING, np.float32)))
    assert note(plant) == ["computed the normals of 4 of 4 vertices: 4 not a number"]


@pytest.mark.gl
@FORMATS
@pytest.mark.parametrize("normals", [BROKEN, BROKEN[:1].repeat(4, 0), 0 * QUAD, None])
def test_the_picture_has_no_nan(tmp_path: Path, write: Writer, normals: np.ndarray | None) -> None:
    from vegtool.gl.upload import PlantBuffers
    from vegtool.lod import Display
    from vegtool.measure.pictures import truth
    from vegtool.measure.views import around, direction

    plant = read_plant(write(tmp_path, normals))
    display = Display()
    camera = around(plant.positions, direction(0.0, 0.0), display.distance_m(40.0), display)
    with PlantBuffers(plant) as buffers:
        picture = truth(buffers, camera)
    assert np.isfinite(picture).all() and picture.any()
