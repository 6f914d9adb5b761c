"""The manifest and its schema."""

from __future__ import annotations

import json
from dataclasses import replace
from math import radians, tan
from pathlib import Path

import jsonschema
import pytest
from written import billboard_level, hybrid_level, parse, small_chain

from vegtool.errors import InputError
from vegtool.formats.gltf import file_names, screen_coverage, write_chain
from vegtool.formats.manifest import LevelFile, manifest, read_manifest, schema
from vegtool.lod import FADE_FRACTION, LodChain, Measured, ShadowProxy, Spread

FILES = [LevelFile("tree.glb", 300), LevelFile("tree_LOD1.glb", 200), LevelFile("tree_LOD2.glb", 9)]


def test_a_manifest_follows_its_schema():
    jsonschema.Draft202012Validator.check_schema(schema())
    jsonschema.validate(manifest(small_chain(), FILES), schema())


def test_a_hybrid_level_counts_both_parts():
    """Three billboards of two triangles, and two of wood; texels are the atlas's."""
    chain = small_chain()
    values = manifest(replace(chain, levels=(chain.levels[0], hybrid_level())), FILES[:2])
    jsonschema.validate(values, schema())
    level = values["levels"][1]
    assert (level["kind"], level["billboards"], level["triangles"]) == ("hybrid", 3, 8)
    assert level["texels"] == 2 * 24 * 32


def test_levels_say_what_is_drawn_and_from_where():
    chain = small_chain()
    chain = replace(
        chain,
        levels=(
            chain.levels[0],
            *(replace(level, geometric_error_m=(0.5, 0.25)) for level in chain.levels[1:]),
        ),
    )
    original, first, second = manifest(chain, FILES)["levels"]
    assert (original["file"], original["kind"], original["switch_distance_m"]) == (
        "tree.glb",
        "mesh",
        0.0,
    )
    assert original["screen_height_fraction"] is None
    assert original["geometric_error_m"] is None
    assert (first["triangles"], first["billboards"], first["bytes"]) == (6, 3, 200)
    assert second["triangles"] == 4  # one billboard, front and back
    assert first["texels"] == 2 * 16 * 32
    assert (first["switch_distance_m"], second["switch_distance_m"]) == (10.0, 20.0)
    assert first["fade_start_m"] == 10.0, "never shown nearer"
    assert first["fade_end_m"] == pytest.approx((1 + FADE_FRACTION) * 10.0)
    assert first["hysteresis_m"] == pytest.approx(FADE_FRACTION * 10.0)
    # The plant is 1 m high; the image shows 2 * 10 m * tan(30 degrees) at the switch distance.
    assert first["screen_height_fraction"] == pytest.approx(1 / (20 * tan(radians(30))))
    assert first["geometric_error_m"] == {"max": 0.5, "p95": 0.25}
    assert first["measured"] is None


def measured_chain(held_out: Spread | None = None) -> LodChain:
    """The small chain, its levels measured."""
    errors = {
        "flip": Spread(0.123456, 0.01, 0.1, 0.15),
        "ssim": Spread(0.7, 0.01, 0.6, 0.8),
        "psnr": Spread(30.0, 1.0, 29.0, 31.0),
        "coverage_bias": Spread(-1e-9, 0.01, -0.02, 0.02),
        "color_bias": Spread(0.01, 0.01, -0.02, 0.02),
    }
    found = Measured(123.456, "ground", 6, errors, errors, held_out)
    chain = small_chain()
    levels = [replace(level, measured=found) for level in chain.levels[1:]]
    return replace(chain, levels=(chain.levels[0], *levels))


def test_what_was_measured_is_stated_with_its_spread_and_rounded():
    values = manifest(measured_chain(), FILES)
    jsonschema.validate(values, schema())
    measured = values["levels"][1]["measured"]
    assert measured["flip"] == {"mean": 0.1235, "sd": 0.01, "low": 0.1, "high": 0.15}
    assert measured["live"]["flip"] == measured["flip"]
    assert str(measured["coverage_bias"]["mean"]) == "0.0"
    assert (measured["pixels"], measured["views"]) == (123.5, {"kind": "ground", "count": 6})
    assert "psnr" not in measured
    assert "held_out" not in measured


def test_views_that_were_held_out_are_stated_where_there_were_some():
    values = manifest(measured_chain(Spread(0.13, 0.01, 0.1, 0.16)), FILES)
    jsonschema.validate(values, schema())
    assert values["levels"][1]["measured"]["held_out"]["flip"]["mean"] == 0.13


def test_clients_of_msft_lod_switch_at_the_same_distances():
    values = manifest(small_chain(), FILES)
    shares = [level["screen_height_fraction"] for level in values["levels"][1:]]
    assert screen_coverage(small_chain())[:-1] == pytest.approx(shares)


def test_a_manifest_needs_one_file_per_level():
    with pytest.raises(ValueError, match="3 levels"):
        manifest(small_chain(), FILES[:2])


def test_what_was_written_reads_back(tmp_path: Path):
    write_chain(small_chain(), tmp_path, depth=True)
    values = read_manifest(tmp_path / "tree.lod.json")
    jsonschema.validate(values, schema())
    assert values["options"] == small_chain().options
    assert [level.get("depth") for level in values["levels"]] == [
        None,
        "tree_LOD1_depth.png",
        "tree_LOD2_depth.png",
    ]
    for entry in (values["combined"], *values["levels"]):
        assert (tmp_path / entry["file"]).stat().st_size == entry["bytes"]


def test_the_light_in_colours_is_stated_where_there_is_some() -> None:
    sun = {"azimuth_deg": 90.0, "elevation_deg": 30.0, "sun": 0.7, "sky_above": 0.4}
    sun["sky_below"] = 0.2
    values = manifest(small_chain(baked=sun), FILES)
    jsonschema.validate(values, schema())
    assert values["sun"] == sun
    assert "sun" not in manifest(small_chain(), FILES)


def with_shadow() -> LodChain:
    """The small chain, and a caster of three billboards of 16 x 32 texels."""
    level = billboard_level(3)
    assert level.atlas is not None
    level = replace(level, unlit=True, atlas=replace(level.atlas, normal=None))
    bias, outline = Spread(-0.0123456, 0.02, -0.05, 0.03), Spread(0.2, 0.01, 0.19, 0.21)
    errors = {"coverage_bias": bias, "silhouette": outline, "flip": Spread(0.9, 0, 0.9, 0.9)}
    return small_chain(shadow=ShadowProxy(level, 100.0, 12, errors, errors))


def test_what_throws_the_shadow_is_a_file_of_its_own(tmp_path: Path) -> None:
    paths = write_chain(with_shadow(), tmp_path)
    assert {path.name for path in paths} == set(file_names("tree", 3, shadow=True))
    values = read_manifest(tmp_path / "tree.lod.json")
    jsonschema.validate(values, schema())
    data = (tmp_path / "tree_shadow.glb").read_bytes()
    spreads = {
        "coverage_bias": {"mean": -0.0123, "sd": 0.02, "low": -0.05, "high": 0.03},
        "silhouette": {"mean": 0.2, "sd": 0.01, "low": 0.19, "high": 0.21},
    }
    assert values["shadow"] == {
        "file": "tree_shadow.glb",
        "triangles": 6,
        "texels": 16 * 32,
        "bytes": len(data),
        "pixels": 100.0,
        "suns": 12,
        **spreads,
        "live": spreads,
    }
    glb = parse(data)
    assert [node["name"] for node in glb.json["nodes"]] == ["tree_shadow"]
    assert "normalTexture" not in glb.material() and "KHR_materials_unlit" in str(glb.material())
    assert "tree_shadow" not in parse((tmp_path / "tree.glb").read_bytes()).json["nodes"][0]["name"]


def test_without_a_shadow_there_is_neither_file_nor_key(tmp_path: Path) -> None:
    write_chain(small_chain(), tmp_path)
    assert "shadow" not in read_manifest(tmp_path / "tree.lod.json")
    assert not (tmp_path / "tree_shadow.glb").exists()
    with pytest.raises(ValueError, match="needs its file"):
        manifest(with_shadow(), FILES)


def broken(change) -> bytes:
    values = manifest(small_chain(), FILES)
    change(values)
    return json.dumps(values).encode()


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (None, "cannot be read"),
        (b"glTF\0\xff", "found no JSON"),
        (b"[]", "version 1, found none"),
        (b"{}", "version 1, found none"),
        (b'{"version": 99}', "version 1, found version 99"),
        (broken(lambda v: v.pop("levels")), "lacks the key 'levels'"),
        (broken(lambda v: v["levels"].clear()), "levels: expected at least 1, found 0"),
        (broken(lambda v: v["levels"][1].pop("file")), "levels.1: lacks the key 'file'"),
        (
            broken(lambda v: v["levels"][1].update(switch_distance_m="near")),
            "levels.1.switch_distance_m: expected number, found 'near'",
        ),
    ],
)
def test_a_broken_manifest_is_refused_by_name(tmp_path: Path, data, says):
    path = tmp_path / "oak.lod.json"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_manifest(path)
    assert str(path) in str(caught.value)
    assert says in str(caught.value)
