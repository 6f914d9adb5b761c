"""Surfels in files: what is written is read again, in order, and by others."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from surfel_sets import ball
from written import parse

from vegtool.errors import InputError
from vegtool.formats.gltf import level_glb
from vegtool.formats.gltf_surfels import read_surfel_set
from vegtool.formats.ply_surfels import ply_bytes
from vegtool.lod import Level
from vegtool.srgb import srgb_from_linear
from vegtool.surfel_set import SurfelSet


def written(folder: Path, surfels: SurfelSet, quantized: bool = False) -> Path:
    path = folder / "ball.glb"
    level = Level("surfels", surfels=surfels, unlit=surfels.unlit)
    path.write_bytes(level_glb(level, "ball", quantized=quantized))
    return path


@pytest.mark.parametrize(
    ("quantized", "apart", "turned"), [(False, 1e-7, 1e-6), (True, 2 / 65535, 0.01)]
)
def test_what_is_written_is_read_again(
    tmp_path: Path, quantized: bool, apart: float, turned: float
) -> None:
    """Positions to float32, or to 16 bits of the extent; normals to a degree; colours to 16."""
    told = ball(unlit=True)
    told = replace(told, size=np.linspace(0, 1, len(told)), double_sided=False)
    found = read_surfel_set(written(tmp_path, told, quantized))
    assert np.abs(found.position - told.position).max() < apart
    assert np.abs(found.normal - told.normal).max() < turned
    assert np.abs(found.color - told.color).max() <= 0.5 / 65535 + 1e-9
    assert found.spacing == told.spacing
    assert np.abs(found.size - told.size).max() <= 0.5 / 255 + 1e-9
    assert found.unlit and not found.double_sided


@pytest.mark.parametrize("quantized", [False, True])
def test_light_is_read_again(tmp_path: Path, quantized: bool) -> None:
    """To a byte. Where there is none, none is written; nor is there a default in its place."""
    plain = ball(50)
    shares = np.random.default_rng(0).integers(0, 256, (50, 3)) / 255
    told = replace(plain, light=shares, transmission_tint=np.array([1.0, 0.5, 0.25]))
    found = read_surfel_set(written(tmp_path, told, quantized))
    assert found.light is not None
    assert np.allclose(found.exposure, shares[:, :2], atol=1e-7)
    assert np.allclose(found.transmission, shares[:, 2], atol=1e-7)
    assert found.transmission_tint.tolist() == [1.0, 0.5, 0.25]
    path = written(tmp_path, plain, quantized)
    assert b"_LIGHT" not in path.read_bytes() and b"tint" not in path.read_bytes()
    found = read_surfel_set(path)
    assert found.light is None
    assert (found.exposure == 1).all() and (found.transmission == 0).all()


def test_far_from_the_origin_nothing_is_lost(tmp_path: Path) -> None:
    """Map coordinates: float32 alone would round them to half a metre."""
    told = ball(50, 0.5, (5e6, 100.0, -3e6))
    for quantized in (False, True):
        found = read_surfel_set(written(tmp_path, told, quantized))
        assert np.abs(found.position - told.position).max() < 1e-4


def test_a_surfel_is_36_bytes_or_24(tmp_path: Path) -> None:
    """Beside what a file of any length has; 4 more with light."""
    lit = {n: replace(ball(n), light=np.zeros((n, 3))) for n in (100, 300)}
    plain = {n: ball(n) for n in (100, 300)}
    for sets, quantized, bytes_ in (
        (plain, False, 36), (plain, True, 24), (lit, False, 40), (lit, True, 28)
    ):  # fmt: skip
        sizes = [written(tmp_path, sets[n], quantized).stat().st_size for n in (100, 300)]
        assert abs(sizes[1] - sizes[0] - 200 * bytes_) < 50


def test_clients_find_points(tmp_path: Path) -> None:
    document = parse(written(tmp_path, ball(20), True).read_bytes()).json
    (primitive,) = document["meshes"][0]["primitives"]
    assert primitive["mode"] == 0 and "indices" not in primitive
    assert document["extensionsRequired"] == ["KHR_mesh_quantization"]
    position = document["accessors"][primitive["attributes"]["POSITION"]]
    assert (position["count"], position["min"], max(position["max"])) == (20, [0, 0, 0], 65535)
    assert document["meshes"][0]["extras"]["surfels"]["p_m"] == 20
    assert "extensionsRequired" not in parse(written(tmp_path, ball(20)).read_bytes()).json


def mesh_of(document: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = document["meshes"][0]
    return found


@pytest.mark.parametrize(
    "broken",
    [
        lambda d: mesh_of(d).pop("extras"),
        lambda d: mesh_of(d)["extras"]["surfels"].update(p_m=0),
        lambda d: mesh_of(d)["extras"]["surfels"].update(r_m=-1.0),
        lambda d: mesh_of(d)["primitives"][0]["attributes"].pop("_SIZE"),
        lambda d: mesh_of(d)["primitives"][0]["attributes"].pop("NORMAL"),
        lambda d: mesh_of(d)["primitives"][0].update(material=7),
        lambda d: mesh_of(d)["primitives"][0]["attributes"].update(_LIGHT=99),
        lambda d: mesh_of(d)["primitives"][0]["attributes"].update(_LIGHT=0),
        lambda d: d["meshes"].append(mesh_of(d)) or d["nodes"].append({"mesh": 1})
        or d["scenes"][0]["nodes"].append(1),
        lambda d: d["accessors"][1].update(count=3),
    ],
)  # fmt: skip
def test_what_is_broken_is_named(tmp_path: Path, broken: Callable[[dict[str, Any]], Any]) -> None:
    path = written(tmp_path, ball(20))
    found = parse(path.read_bytes())
    broken(found.json)
    found.json["buffers"] = [{"byteLength": len(found.binary), "uri": "ball.bin"}]
    (tmp_path / "ball.bin").write_bytes(found.binary)
    path = tmp_path / "ball.gltf"
    path.write_text(json.dumps(found.json))
    with pytest.raises(InputError, match=r"ball\.gltf"):
        read_surfel_set(path)


def test_a_model_holds_no_surfels(tmp_path: Path) -> None:
    path = tmp_path / "mesh.glb"
    path.write_bytes(trimesh.creation.box().export(file_type="glb"))
    with pytest.raises(InputError, match="extras tell of surfels"):
        read_surfel_set(path)


def test_other_programs_read_the_ply() -> None:
    told = ball(40)
    found: Any = trimesh.load(BytesIO(ply_bytes(told)), file_type="ply")
    assert np.allclose(found.vertices, told.position, atol=1e-6)
    shown = np.round(255 * srgb_from_linear(told.color))
    assert np.abs(np.asarray(found.colors)[:, :3] - shown).max() == 0
    lit: Any = trimesh.load(
        BytesIO(ply_bytes(replace(told, light=np.tile([0.2, 0.4, 1.0], (40, 1))))), file_type="ply"
    )
    assert np.array_equal(lit.vertices, found.vertices)
    rows = lit.metadata["_ply_raw"]["vertex"]["data"]
    names = ("exposure", "exposure_behind", "transmission")
    assert [rows[name].tolist() for name in names] == [[share] * 40 for share in (51, 102, 255)]
