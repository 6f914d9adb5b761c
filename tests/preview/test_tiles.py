"""A folder of tiles to walk through: what is drawn of it, and what may be wrong with it."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xvfb

from vegtool.cli import run
from vegtool.errors import InputError
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.formats.gltf_data import open_gltf
from vegtool.growth import sample
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.show import Show
from vegtool.preview.tile_forest import CLIENT_PX, TileForest
from vegtool.preview.tile_world import read_tile_world
from vegtool.preview.tileset import read_model, read_tile, read_tileset
from vegtool.preview.world import read_world

pytestmark = pytest.mark.gl
SMALL = ["--billboards", "24", "--levels", "2", "--refine", "none", "--measure", "off"]
SCENE = """
[terrain]
kind = "plane"
extent_m = [40, 40]
height_m = [7, 7]

[[species]]
name = "bush"

[placement]
spacing_m = 3
"""
SIZE = 160, 120


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`out/`, a bush converted; a scene of 40 x 40 m; and `tiles/`, made of it."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "bush.glb").write_bytes(plant_glb(sample("bush", 300)))
    out, scene, tiles = (str(folder / name) for name in ("out", "scene.toml", "tiles"))
    assert run(["convert", str(folder / "bush.glb"), "-o", out, "-q", *SMALL]) == 0
    (folder / "scene.toml").write_text(SCENE)
    arguments = ["--tile", "10", "--near", "2", "-q"]
    assert run(["tiles", scene, "--species", out, "-o", tiles, *arguments]) == 0
    return folder


@pytest.fixture
def here(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy, that may be broken."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def loaded(folder: Path) -> TileForest:
    forest = read_tile_world(folder / "tiles" / "tileset.json").scenery("alpha-test")
    for _ in forest.load():
        pass
    return forest


def test_tiles_stand_where_the_scene_has_its_plants(made: Path) -> None:
    """One frame for both, whatever the root's own origin: seen from one eye they are alike, to what
    levels change, and from two eyes 2 m apart they are not."""
    world = read_world(made / "out", made / "scene.toml", ReadOptions())
    forest = world.scenery("none")
    for _ in forest.load():
        pass
    eye = replace(world.start, position=np.array([0.0, 12.0, 30.0]), pitch_deg=-17.0)
    aside = replace(eye, position=eye.position + np.array([2.0, 0, 0]))
    with forest, loaded(made) as tiles:
        shown = tiles.picture(eye, SIZE)
        apart = [
            float(np.abs(shown - forest.picture(place, SIZE, Look(level=1))).mean())
            for place in (eye, aside)
        ]
    assert 0 < apart[0] < 0.5 * apart[1]


def test_the_eye_begins_beside_the_landscape_on_its_ground(made: Path) -> None:
    world = read_tile_world(made / "tiles" / "tileset.json")
    assert world.start.position[1] == pytest.approx(7 + 1.7, abs=1e-6)
    assert world.start.position[2] > world.tileset.high[0, 2]
    assert world.height_at(3.0, -5.0) == pytest.approx(7, abs=1e-6)
    assert world.ground is not None and not world.orbited


def test_tiles_are_refined_until_their_error_is_not_seen(made: Path) -> None:
    """What is drawn covers the landscape once: of every tile with its way to the root, one."""
    world = read_tile_world(made / "tiles" / "tileset.json")
    tiles = world.tileset
    leaves = int((tiles.depth == tiles.depth.max()).sum())
    with world.scenery("none") as forest:
        for y, z, finest in ((9.0, 0.0, True), (15.0, 40.0, False), (15.0, 5000.0, False)):
            eye = replace(
                world.start, position=np.array([0.0, y, z]), fov_y_deg=120.0, pitch_deg=-57.0
            )
            drawn = forest.choose(eye, (400, 400), Look())
            for tile in drawn:
                near = np.linalg.norm(
                    np.maximum(0, np.maximum(tiles.low[tile] - eye.position,
                                             eye.position - tiles.high[tile]))
                )  # fmt: skip
                pixels = tiles.error_m[tile] * eye.focal_px(400) / max(near, 0.1)
                assert pixels <= CLIENT_PX or not tiles.children[tile]
            assert len(set(drawn)) == len(drawn)
            if z == 5000.0:
                assert drawn in ([], [0])
            depths = tiles.depth[drawn]
            assert (len(depths) and depths.max() == tiles.depth.max()) or not finest
        full = forest.choose(
            replace(world.start, position=np.array([0.0, 200.0, 0.1]), pitch_deg=-86.0), (400, 400),
            Look(detail=IN_FULL),
        )  # fmt: skip
    assert len(full) == leaves, "in full, all that there is"


def test_a_held_level_counts_from_the_finest(made: Path) -> None:
    world = read_tile_world(made / "tiles" / "tileset.json")
    deepest = int(world.tileset.depth.max())
    eye = replace(world.start, position=np.array([0.0, 200.0, 0.1]), pitch_deg=-86.0)
    with world.scenery("none") as forest:
        for level in (0, 1, 9):
            drawn = forest.choose(eye, (400, 400), Look(level=level))
            assert (world.tileset.depth[drawn] == max(deepest - level, 0)).all() and drawn
    told = world.details(eye.focal_px(400))
    assert told[0].startswith(f"level {deepest}: 1 ") and told[-1].startswith("level 0: ")


def test_what_is_released_can_be_loaded_again(made: Path) -> None:
    forest = loaded(made)
    eye = read_tile_world(made / "tiles" / "tileset.json").start
    before = forest.picture(eye, SIZE)
    assert forest.texture_bytes > 0
    forest.release()
    assert forest.texture_bytes == 0
    for _ in forest.load():
        pass
    np.testing.assert_array_equal(forest.picture(eye, SIZE), before)
    forest.release()


@pytest.mark.parametrize("color", ["as it is", "by level", "by species", "by overdraw"])
def test_every_colour_counts_what_is_drawn(made: Path, color: Any) -> None:
    from vegtool.gl.context import framebuffer_kept
    from vegtool.gl.draw import begin
    from vegtool.gl.targets import drawing_target

    world = read_tile_world(made / "tiles" / "tileset.json")
    with loaded(made) as forest, framebuffer_kept(forest._loaded("draw").ctx):
        ctx = forest._loaded("draw").ctx
        target = drawing_target(ctx, SIZE, 4)
        begin(target, SIZE)
        stats = forest.draw(world.start, SIZE, Look(color=color))
    assert 0 < stats.plants <= stats.total == world.tileset.plants[0]
    assert stats.tiles > 0 and stats.triangles > 100 and stats.draws > 1 and stats.fragments > 100


# ------------------------------------------------------------------------- what may be wrong


def edit(file: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    values = json.loads(file.read_bytes())
    change(values)
    file.write_text(json.dumps(values))


def box(values: dict[str, Any], at: int, number: Any) -> None:
    values["root"]["boundingVolume"]["box"][at] = number


BROKEN: dict[str, Callable[[dict[str, Any]], Any]] = {
    "no root": lambda v: v.pop("root"),
    "a list for a root": lambda v: v.update(root=[]),
    "a region": lambda v: v["root"].update(boundingVolume={"region": [0.0] * 6}),
    "a short box": lambda v: v["root"]["boundingVolume"]["box"].pop(),
    "a box of NaN": lambda v: box(v, 0, float("nan")),
    "an infinite box": lambda v: box(v, 3, float("inf")),
    "no content": lambda v: v["root"].pop("content"),
    "a NUL in a name": lambda v: v["root"]["content"].update(uri="a\0b"),
    "no extras": lambda v: v["root"].pop("extras"),
    "plants beyond count": lambda v: v["root"]["extras"].update(plants=10**30),
    "an error in words": lambda v: v["root"].update(geometricError="much"),
    "a child without a place": lambda v: v["root"]["children"][0].pop("transform"),
    "children that are none": lambda v: v["root"].update(children=7),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_tileset_is_a_sentence(here: Path, name: str) -> None:
    file = here / "tiles" / "tileset.json"
    edit(file, BROKEN[name])
    with pytest.raises(InputError, match=r"expected (a|the) t"):
        read_tileset(file)


@pytest.mark.parametrize("text", ["", "{", "[]", "7", "[" * 100_000])
def test_what_is_no_tileset_is_a_sentence(here: Path, text: str) -> None:
    file = here / "tiles" / "tileset.json"
    file.write_text(text)
    with pytest.raises(InputError, match="expected a tileset as vegtool tiles writes it"):
        read_tileset(file)


def nodes(values: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = next(n for n in values["nodes"] if "extensions" in n)
    return found


def attributes(values: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = nodes(values)["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
    return found


BROKEN_TILES: dict[str, Callable[[dict[str, Any]], Any]] = {
    "no turns": lambda v: attributes(v).pop("ROTATION"),
    "an accessor in words": lambda v: attributes(v).update(SCALE="x"),
    "an accessor that is not there": lambda v: attributes(v).update(SCALE=999),
    "no attributes": lambda v: nodes(v)["extensions"]["EXT_mesh_gpu_instancing"].clear(),
    "no mesh": lambda v: nodes(v).pop("mesh"),
    "no primitives": lambda v: v["meshes"][0].update(primitives=[]),
    "nodes that are none": lambda v: v.update(nodes=[1]),
}


@pytest.mark.parametrize("name", BROKEN_TILES)
def test_a_broken_tile_is_a_sentence(here: Path, name: str) -> None:
    files = (here / "tiles" / "tiles").glob("*.glb")
    path = max(files, key=lambda file: int(file.name.split("_")[0]))  # of instances
    values = open_gltf(path)
    BROKEN_TILES[name](values.json)
    text = json.dumps(values.json).encode()
    text += b" " * (-len(text) % 4)
    binary = values.binary or b""
    parts = [
        struct.pack("<I4s", len(text), b"JSON"),
        text,
        struct.pack("<I4s", len(binary), b"BIN\0"),
    ]
    body = b"".join([*parts, binary])
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    with pytest.raises(InputError, match=path.name):
        read_tile(path, read_model)


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    code = run(["preview", *arguments])
    return code, capsys.readouterr().err


def test_a_missing_tile_is_told_before_anything_is_loaded(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Show, "load", lambda *_: pytest.fail("worked"))
    (here / "tiles" / "tiles" / "0_0_0.glb").unlink()
    code, said = told(capsys, "tiles", "--screenshot", "a.png")
    assert code == 1 and "expected the tile tiles/tiles/0_0_0.glb, found none" in said
    assert not Path("a.png").exists()


@pytest.mark.parametrize("pattern", ["*.png", "*.bin", "*.gltf"])
def test_what_tiles_share_is_missed(
    here: Path, capsys: pytest.CaptureFixture[str], pattern: str
) -> None:
    """And not drawn white, as a model without its pictures is."""
    for file in (here / "tiles" / "tiles" / "shared").glob(pattern):
        file.unlink()
    way = "[[station]]\nposition = [0, 9, 0]\nlook_at = [0, 7, -5]\n"  # among the smallest tiles
    Path("way.toml").write_text(way + way.replace("9, 0]", "9, 1]"))
    arguments = ["--path", "way.toml", "--screenshot", "a.png", "--size", "80x60"]
    code, said = told(capsys, "tiles", *arguments)
    assert code == 1 and said.startswith("error: tiles/tiles/")
    assert ("shared" in said) and ("found no" in said or "cannot be read" in said)
    assert not Path("a.png").exists()


def test_nothing_among_the_tiles_is_overwritten(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = next((here / "tiles" / "tiles" / "shared").glob("*.png"))
    before = picture.read_bytes()
    code, said = told(capsys, "tiles", "--screenshot", str(picture), "-f")
    assert code == 1 and "never overwritten" in said and picture.read_bytes() == before
    tileset = here / "tiles" / "tileset.json"
    before = tileset.read_bytes()
    code, _ = told(capsys, "tiles", "--frames", "1", "--stats", str(tileset), "-f")
    assert code == 1 and tileset.read_bytes() == before


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--scene", "scene.toml"], "is a tileset, whose plants stand where they do"),
        (["--up", "z"], "is a tileset, whose plants stand where they do"),
        (["--fade", "none"], "--fade: tiles follow each other at once"),
        (["--html", "page.html"], "--html: writes a page of converted plants"),
    ],
)
def test_what_tiles_do_not_have_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str], more: list[str], sentence: str
) -> None:
    code, said = told(capsys, "tiles", "--screenshot", "a.png", *more)
    assert code == 2 and sentence in said


def test_the_same_command_gives_the_same_picture(here: Path) -> None:
    for name, path in (("a.png", "tiles"), ("b.png", "tiles/tileset.json")):
        assert run(["preview", path, "--screenshot", name, "--size", "80x60", "-q"]) == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    with xvfb.display() as name:
        yield name


def look_around(folder: str) -> None:
    """Keys over a tileset, and out."""
    import os

    os.chdir(folder)
    keys = [*"0", "1", "9", "l", "v", "v", "v", "v", "x", "x", "m", "m", "c", "c", "Escape"]
    plan = {3 * i + 3: key for i, key in enumerate(keys)}
    asked, wants_close = 0, Show.wants_close
    seen = set()

    def asking(show: Show) -> bool:
        nonlocal asked
        if show.stats is not None:
            seen.add((show.state.level, show.state.color, show.state.compare))
            if asked in plan:
                xvfb.strike(plan[asked])
            if asked - 1 in plan:
                xvfb.strike(plan[asked - 1], press=False)
            asked += 1
        return wants_close(show)

    Show.wants_close = asking  # type: ignore[method-assign]
    assert run(["preview", "tiles", "--size", "120x80"]) == 0
    assert {level for level, _, _ in seen} == {None, 0, 1, 9}
    assert len({color for _, color, _ in seen}) == 4 and any(compare for _, _, compare in seen)


def test_a_window_shows_tiles(here: Path, display: str) -> None:
    xvfb.alone(look_around, str(here), environment={"DISPLAY": display})
