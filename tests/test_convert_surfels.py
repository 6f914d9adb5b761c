"""A chain of surfels: its levels, its files, and what does not go with it."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from plants import plant_of

from vegtool.batch import Job, Task, convert_file
from vegtool.convert import ConvertOptions, convert
from vegtool.errors import UsageError
from vegtool.formats.gltf import plant_glb
from vegtool.formats.gltf_surfels import read_surfel_set
from vegtool.formats.manifest import schema
from vegtool.growth import sample
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.surfels.blue import candidates, level
from vegtool.tiles.library import read_species

pytestmark = pytest.mark.gl
OPTIONS = ConvertOptions(method="surfels", points=2_000, levels=3)
BY_RULE = MeasureOptions(measure="off")


@pytest.fixture(scope="module")
def chain() -> LodChain:
    return convert(sample("bush", 800), OPTIONS, BY_RULE)


def test_levels_are_parts_of_one_order_for_half_the_size_each(chain: LodChain) -> None:
    first, *others = (level.surfels for level in chain.levels[1:])
    assert first is not None and len(first) == 2_000
    radius = sample("bush", 800).radius
    near = [level.near_distance_m - radius for level in chain.levels[1:]]
    for surfels, count, ratio in zip(others, (500, 125), np.array(near[1:]) / near[0], strict=True):
        assert surfels is not None and len(surfels) == count
        assert np.array_equal(surfels.position, first.position[:count])
        assert ratio == pytest.approx((2_000 / count) ** 0.5, rel=0.02)


def test_files_tell_what_a_viewer_needs(tmp_path: Path) -> None:
    """And the same input gives the same bytes."""
    source = tmp_path / "in" / "bush.glb"
    source.parent.mkdir()
    source.write_bytes(plant_glb(sample("bush", 400)))
    task = Task(tmp_path / "out", convert=OPTIONS, measure=BY_RULE)
    outcome = convert_file(Job(source, "bush"), task)
    assert [row["surfels"] for row in outcome.levels] == [0, 2000, 500, 125]
    told = json.loads((tmp_path / "out" / "bush.lod.json").read_bytes())
    jsonschema.validate(told, schema())
    assert [level["kind"] for level in told["levels"]] == ["mesh", *3 * ["surfels"]]
    one = read_species(tmp_path / "out" / "bush.lod.json")
    assert len(one.levels) == 1 and one.surfels is not None
    assert one.surfels.switch_m == told["levels"][1]["switch_distance_m"]
    found = one.surfels.read()
    assert told["levels"][1]["surfels"] == {
        "count": 2000, "p_m": found.spacing.length, "r_m": found.spacing.radius_m,
    }  # fmt: skip
    part = read_surfel_set(tmp_path / "out" / "bush_LOD2.glb")
    assert np.array_equal(part.position, found.position[:500])
    assert (tmp_path / "out" / "bush.ply").read_bytes().startswith(b"ply\n")
    again = Task(tmp_path / "again", convert=OPTIONS, measure=BY_RULE)
    convert_file(Job(source, "bush"), again)
    for path in (tmp_path / "out").iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes(), path.name


@pytest.mark.parametrize(
    ("options", "about"),
    [
        ({"points": 10}, "--points: is of another method"),
        ({"method": "surfels", "billboards": 10}, "--billboards: says nothing of surfels"),
        ({"method": "surfels", "pixels": 10.0}, "--pixels: says nothing of surfels"),
        ({"method": "surfels", "max_texture": 512}, "--max-texture: says nothing of surfels"),
        ({"method": "surfels", "refine": "none"}, "goes with --refine full"),
        ({"method": "surfel-billboards", "quantized": True}, "--quantized: is of another method"),
    ],
)
def test_what_does_not_go_with_it_is_refused(options: dict[str, object], about: str) -> None:
    with pytest.raises(UsageError, match=about):
        ConvertOptions(**options)  # type: ignore[arg-type]


def test_no_more_surfels_than_there_are_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 10^8 asked, as many as pixels have seen; each level has fewer than the one before."""
    monkeypatch.setattr(level, "RESOLUTION", 256)
    monkeypatch.setattr(candidates, "FINEST", 512)
    many = ConvertOptions(method="surfels", points=100_000_000, levels=2)
    plant = plant_of(np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]]))
    chain = convert(plant, many, BY_RULE)
    counts = [len(one.surfels) for one in chain.levels[1:] if one.surfels is not None]
    assert 10_000 < counts[0] < 8 * 512**2 and counts[1] == counts[0] // 4
