"""tileset.json: what is written passes the checker, and what is broken does not."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vegtool.formats.glb import Document
from vegtool.formats.tileset import TileEntry, tileset_files
from vegtool.formats.tileset_check import check_tileset


def entry(name: str, x: float, z: float, size: float, error: float, *below: TileEntry) -> TileEntry:
    low = np.array([x, 0.0, z])
    bounds = np.stack([low, low + np.array([size, 10.0, size])])
    return TileEntry(f"tiles/{name}.glb", bounds.mean(axis=0), bounds, error, 7, (0, 1), below)


def tileset(folder: Path) -> Path:
    """A square of two quarters, far from the origin."""
    quarters = entry("a", 5e6, 5e6, 32.0, 0.0), entry("b", 5e6 + 32, 5e6 + 32, 32.0, 0.5)
    root = entry("root", 5e6, 5e6, 64.0, 1.5, *quarters)
    (folder / "tiles").mkdir(parents=True)
    for name in ("a", "b", "root"):
        document = Document()
        document.show(document.add("nodes", name=name))
        (folder / "tiles" / f"{name}.glb").write_bytes(document.glb())
    path = folder / "tileset.json"
    path.write_bytes(tileset_files(root, None)["tileset.json"])
    return path


def test_what_is_written_is_well(tmp_path: Path) -> None:
    assert check_tileset(tileset(tmp_path)) == []


def test_tiles_are_z_up_relative_to_their_parents(tmp_path: Path) -> None:
    """Scene: x east, y up, z south. Tile: x east, y north, z up; columns come one by one."""
    values = json.loads(tileset(tmp_path).read_bytes())
    root, (_, b) = values["root"], values["root"]["children"]
    assert root["transform"][12:] == [5e6 + 32, -(5e6 + 32), 5, 1]
    assert b["transform"][12:] == [16, -16, 0, 1]
    assert b["boundingVolume"]["box"] == [0, 0, 0, 16, 0, 0, 0, 16, 0, 0, 0, 5]
    assert [root["geometricError"], values["geometricError"]] == [1.5, 3.0]
    assert root["refine"] == "REPLACE" and "refine" not in b


def test_what_errors_mean_is_told_where_it_is_not_what_clients_think(tmp_path: Path) -> None:
    """As one pixel; and that of showing nothing, where that is not about twice the root's."""
    values = json.loads(tileset(tmp_path).read_bytes())
    assert "seen_px" not in values["root"]["extras"]
    root = entry("root", 0.0, 0.0, 64.0, 1.5)
    values = json.loads(tileset_files(root, None, 1.0, 64.0)["tileset.json"])
    assert values["root"]["extras"]["seen_px"] == 1.0
    assert [values["root"]["geometricError"], values["geometricError"]] == [1.5, 64.0]


def drop(values: dict[str, Any], *keys: str) -> None:
    for key in keys:
        del values[key]


BROKEN: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "version": (lambda v: v["asset"].update(version="1.0"), "asset.version: expected 1.1"),
    "error": (lambda v: drop(v, "geometricError"), "geometricError: expected a number"),
    "refine": (lambda v: drop(v["root"], "refine"), "refine: expected REPLACE or ADD"),
    "box": (lambda v: drop(v["root"], "boundingVolume"), "root: boundingVolume: expected a box"),
    "short box": (
        lambda v: v["root"]["boundingVolume"]["box"].pop(), "boundingVolume: expected a box",
    ),
    "outside": (
        lambda v: v["root"]["children"][1]["transform"].__setitem__(12, 116),
        "root.1: its box is 100.000 m outside of its parent's",
    ),
    "too high": (
        lambda v: v["root"]["children"][0]["boundingVolume"]["box"].__setitem__(11, 6),
        "root.0: its box is 1.000 m outside",
    ),
    "not monotone": (
        lambda v: v["root"]["children"][1].update(geometricError=2.0),
        "root.1: geometricError 2 is more than its parent's, 1.5",
    ),
    "negative": (
        lambda v: v["root"]["children"][0].update(geometricError=-1.0), "root.0: geometricError",
    ),
    "no file": (
        lambda v: v["root"]["children"][0]["content"].update(uri="tiles/c.glb"),
        "root.0: content: expected the file",
    ),
    "no uri": (lambda v: drop(v["root"]["content"], "uri"), "root: content: expected a uri"),
    "nothing": (
        lambda v: drop(v["root"]["children"][0], "content"), "has neither content nor children",
    ),
    "empty children": (
        lambda v: v["root"]["children"][0].update(children=[]), "found an empty list",
    ),
    "no children": (
        lambda v: v["root"].update(children="a"), "children: expected a list of tiles; found 'a'",
    ),
    "no child": (
        lambda v: v["root"].update(children=[7]), "children: expected tiles; found 7",
    ),
    "no content": (
        lambda v: v["root"].update(content=[]), "root: content: expected a uri; found none",
    ),
    "no asset": (lambda v: v.update(asset="1.1"), "asset.version: expected 1.1; found None"),
    "words in a transform": (
        lambda v: v["root"].update(transform=["a"] * 15 + [1]), "root: transform: expected 16",
    ),
    "transform": (lambda v: v["root"].update(transform=[1.0] * 4), "root: transform: expected 16"),
    "twice": (
        lambda v: v["root"]["children"][1]["content"].update(uri="tiles/a.glb"),
        "a.glb is that of root.0 too",
    ),
    "cycle": (
        lambda v: v["root"]["children"][0]["content"].update(uri="tileset.json"),
        "refers to itself",
    ),
}  # fmt: skip


def test_boxes_of_siblings_may_overlap(tmp_path: Path) -> None:
    """Crowns do, over a border; nothing in 3D Tiles 1.1 is against it."""
    path = tileset(tmp_path)
    values = json.loads(path.read_bytes())
    for child in values["root"]["children"]:
        child["boundingVolume"] = values["root"]["boundingVolume"]
        child.pop("transform")
    path.write_text(json.dumps(values))
    assert check_tileset(path) == []


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_told(tmp_path: Path, name: str) -> None:
    path = tileset(tmp_path)
    change, sentence = BROKEN[name]
    values = json.loads(path.read_bytes())
    change(values)
    path.write_text(json.dumps(values))
    (told,) = check_tileset(path)
    assert sentence in told and str(path) in told


def test_a_file_cut_short_is_told(tmp_path: Path) -> None:
    path = tileset(tmp_path)
    tile = tmp_path / "tiles" / "b.glb"
    tile.write_bytes(tile.read_bytes()[:-4])
    assert check_tileset(path) == [f"{path}: root.1: content: {tile} is no whole .glb file"]


@pytest.mark.parametrize("text", ["", "{", "[]", "{}"])
def test_no_tileset_at_all(tmp_path: Path, text: str) -> None:
    path = tmp_path / "tileset.json"
    path.write_text(text)
    (told,) = check_tileset(path)
    assert "expected" in told
    assert "expected JSON" in check_tileset(tmp_path / "none.json")[0]


def test_a_tileset_may_refer_to_others(tmp_path: Path) -> None:
    path = tileset(tmp_path)
    values = json.loads(path.read_bytes())
    inner = {**values, "root": {**values["root"]["children"][0], "refine": "REPLACE"}}
    inner["root"] |= {"transform": list(np.eye(4).ravel())}
    inner["root"]["content"] = {"uri": "tiles/b.glb"}
    (tmp_path / "inner.json").write_text(json.dumps(inner))
    values["root"]["children"][0]["content"] = {"uri": "inner.json"}
    path.write_text(json.dumps(values))
    (told,) = check_tileset(path)
    assert "root.1: content" in told and told.endswith("inner.json: root too")
    del values["root"]["children"][1]
    path.write_text(json.dumps(values))
    assert check_tileset(path) == []
    inner["root"]["content"] = {"uri": "tileset.json"}
    (tmp_path / "inner.json").write_text(json.dumps(inner))
    assert "refers to itself" in check_tileset(path)[0]
