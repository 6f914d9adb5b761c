"""The native file: what is read is what was written; what is broken is told."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vegtool.errors import InputError
from vegtool.formats.archive import archived
from vegtool.growth import sample
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.store import read_surfels, surfels_bytes

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def model() -> SurfelModel:
    return surfel_model(sample("statue", 2000))


@pytest.fixture(scope="module")
def data(model: SurfelModel) -> bytes:
    return surfels_bytes(model)


def test_what_is_read_is_what_was_written(model: SurfelModel, data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "statue.surfels"
    path.write_bytes(data)
    found = read_surfels(path)
    for one, other in (
        (found.triangles, model.triangles),
        (found.hierarchy, model.hierarchy),
        (found.hierarchy.boxes, model.hierarchy.boxes),
        (found.textures.atlas, model.textures.atlas),
    ):
        for item in fields(other):
            value = getattr(other, item.name)
            if isinstance(value, np.ndarray):
                assert np.array_equal(getattr(one, item.name), value), item.name
    assert found.options == model.options and found.display == model.display
    assert surfels_bytes(found) == data, "and the same bytes again"


def test_textures_of_a_plant_are_kept(tmp_path: Path) -> None:
    plant = sample("broadleaf", 3000)
    path = tmp_path / "tree.surfels"
    path.write_bytes(surfels_bytes(surfel_model(plant)))
    found = read_surfels(path).plant
    assert found.materials[0].name == plant.materials[0].name
    for one, other in zip(found.materials, plant.materials, strict=True):
        assert one.role == other.role and one.alpha_mode == other.alpha_mode
        for some, before in zip(one.textures, other.textures, strict=True):
            assert np.array_equal(some.pixels, before.pixels)


def changed(data: bytes, tmp_path: Path, **arrays: np.ndarray | None) -> Path:
    whole = dict(np.load(_file(data, tmp_path / "before.npz")))
    path = tmp_path / "some.surfels"
    merged = {**whole, **arrays}
    path.write_bytes(archived({k: v for k, v in merged.items() if v is not None}))
    return path


def _file(data: bytes, path: Path) -> Path:
    path.write_bytes(data)
    return path


def test_what_is_broken_is_told(data: bytes, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.surfels: cannot be read"):
        read_surfels(tmp_path / "gone.surfels")
    for name, content in (("text", b"hello"), ("cut", data[: len(data) // 2]), ("empty", b"")):
        with pytest.raises(
            InputError, match=r"expected surfel billboards.*Convert the plant again"
        ):
            read_surfels(_file(content, tmp_path / f"{name}.surfels"))
    for arrays in (
        {"front": None},
        {"about": np.frombuffer(b"[]", np.uint8)},
        {"about": np.frombuffer(b"{}", np.uint8)},
        {"triangles_faces": np.zeros((3, 2), np.int32)},
        {"billboards_father": np.full(5, 10**6, np.int32)},
        {"atlas_color": np.frombuffer(b"no picture", np.uint8)},
        {"plant_positions": np.full((4, 3), np.nan)},
    ):
        with pytest.raises(InputError, match="the file is broken"):
            read_surfels(changed(data, tmp_path, **arrays))
    about = json.loads(np.load(_file(data, tmp_path / "one.npz"))["about"].tobytes())
    later = np.frombuffer(json.dumps({**about, "version": 99}).encode(), np.uint8)
    with pytest.raises(InputError, match=r"expected version 1 .* found 99"):
        read_surfels(changed(data, tmp_path, about=later))


def test_indices_that_lead_nowhere_are_told(
    model: SurfelModel, data: bytes, tmp_path: Path
) -> None:
    """Else they would be seen by whoever draws, as errors of arrays."""
    above, front = model.hierarchy.above.copy(), model.textures.atlas.front.copy()
    above[-1], front[0, 0] = len(model.hierarchy), model.textures.atlas.color.shape[1]
    for arrays, what in (
        ({"billboards_above": above}, "above"),
        ({"billboards_father": np.full(len(model.hierarchy), -2, np.int32)}, "father"),
        ({"front": front}, "rectangles"),
        ({"behind": model.textures.behind[:-1]}, "behind"),
        ({"plant_faces": np.zeros_like(model.plant.faces)}, "extent"),
    ):
        with pytest.raises(InputError, match=f"the file is broken.*{what}"):
            read_surfels(changed(data, tmp_path, **arrays))


@pytest.mark.parametrize(
    "told",
    [
        {"theta": 0}, {"theta": None}, {"least": -1.0},
        {"options": {"epsilon": 0}}, {"options": {"epsilon": None}}, {"options": {"sigma": 1.0}},
        {"display": {"fov_y_deg": 0, "image_height_px": 1080}},
        {"display": {"fov_y_deg": 60.0, "image_height_px": "many"}},
        {"display": {"fov_y_deg": float("nan"), "image_height_px": 1080}},
    ],
    ids=str,
)  # fmt: skip
def test_numbers_of_no_sense_are_told(told: dict[str, Any], data: bytes, tmp_path: Path) -> None:
    about = json.loads(np.load(_file(data, tmp_path / "one.npz"))["about"].tobytes())
    other = np.frombuffer(json.dumps({**about, **told}).encode(), np.uint8)
    with pytest.raises(InputError, match="the file is broken"):
        read_surfels(changed(data, tmp_path, about=other))


def test_an_array_that_claims_more_than_memory_is_told(data: bytes, tmp_path: Path) -> None:
    header = io.BytesIO()
    told = {"descr": "<f8", "fortran_order": False, "shape": (2**50,)}
    np.lib.format.write_array_header_1_0(header, told)
    path = changed(data, tmp_path, boxes_half=None)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("boxes_half.npy", header.getvalue())
    with pytest.raises(InputError, match="the file is broken"):
        read_surfels(path)


def test_no_bytes_are_too_odd(data: bytes, tmp_path: Path) -> None:
    """Whatever zipfile, zlib, numpy, json and Pillow say of them is a sentence: here and there,
    and all over the table of contents at the end."""
    rng = np.random.default_rng(0)
    anywhere = rng.integers(0, len(data), 40).tolist()
    for place in anywhere + list(range(len(data) - 2400, len(data), 30)):
        odd = bytearray(data)
        odd[place] ^= int(rng.integers(1, 256))
        try:
            read_surfels(_file(bytes(odd), tmp_path / "odd.surfels"))
        except InputError:
            continue
