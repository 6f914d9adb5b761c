"""A folder of tiles to walk through: what is drawn of it, and what may be wrong with it."""

from __future__ import annotations

import json
import shutil
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xvfb
from stereo_cases import check_two_eyes

from vegtool.cli import run
from vegtool.errors import InputError
from vegtool.formats import ReadOptions, tileset
from vegtool.formats.gltf import plant_glb
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.tileset import CLIENT_PX
from vegtool.formats.tileset_check import check_tileset
from vegtool.growth import sample
from vegtool.preview import tile_store
from vegtool.preview.eye import Eye
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.show import Show
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tile_store import TileStore
from vegtool.preview.tile_world import read_tile_world
from vegtool.preview.tileset import read_model, read_tile, read_tileset
from vegtool.preview.world import read_world
from vegtool.seeding import generator

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
    arguments = ["--tile", "10", "--near", "2", "--jobs", "1", "-q"]
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
                assert pixels <= CLIENT_PX or not len(tiles.below(np.array([tile])))
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


def views(forest: TileForest, seed: str, count: int) -> Iterator[Eye]:
    """Eyes above, beside and among the tiles, that look anywhere."""
    random = generator(1, seed)
    tiles = forest.tileset
    size = tiles.high[0] - tiles.low[0]
    for _ in range(count):
        away = random.uniform(-1.5, 1.5) * size * [1, 0, 1] + [0, random.uniform(1, 30), 0]
        position = (tiles.low[0] + tiles.high[0]) / 2 + away
        yield Eye(position, random.uniform(-180, 180), random.uniform(-80, 10), 60.0)


def chosen_one_by_one(forest: TileForest, eye: Eye, look: Look) -> set[int]:
    """As clients do it, tile after tile from the root on: what `choose` is to give."""
    tiles, planes, found = forest.tileset, eye.planes(*SIZE), set()
    waiting = [0]
    while waiting:
        tile = waiting.pop()
        low, high = tiles.low[tile] - eye.position, tiles.high[tile] - eye.position
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1])
                            for z in (low[2], high[2])])  # fmt: skip
        if not all((corners @ plane[:3] + plane[3]).max() >= 0 for plane in planes):
            continue
        away = max(float(np.linalg.norm(np.clip(0, low, high))), 0.1)
        seen = look.detail * tiles.error_m[tile] * eye.focal_px(SIZE[1]) / away > CLIENT_PX
        if look.level is not None:
            seen = bool(tiles.depth[tile] < tiles.depth.max() - look.level)
        below = range(*tiles.children[tile])
        if tiles.file[tile] is None or (seen and below):
            waiting += below
        else:
            found.add(tile)
    return found


@pytest.mark.parametrize("holes", [False, True])
def test_tiles_are_chosen_as_one_by_one(here: Path, holes: bool) -> None:
    """Also where tiles have no content, the root and one of its quarters, and no children."""
    if holes:
        edit(here / "tiles" / "tileset.json", punched)
    forest = read_tile_world(here / "tiles" / "tileset.json").scenery("none")
    counts = set()
    for eye in views(forest, "choice", 60):
        for look in (Look(), Look(detail=0.2), Look(level=1)):
            chosen = forest.choose(eye, SIZE, look)
            assert set(chosen) == chosen_one_by_one(forest, eye, look)
            assert len(set(chosen)) == len(chosen)
            counts.add(len(chosen))
    assert len(counts) > 4


def punched(values: dict[str, Any]) -> dict[str, Any]:
    """The first of several quarters has no content, as all above; the second has no quarters."""
    tile = values["root"]
    while len(tile["children"]) == 1:
        del tile["content"]
        tile = tile["children"][0]
    del tile["content"], tile["children"][0]["content"], tile["children"][1]["children"]
    return tile


def test_a_tile_without_content_is_never_drawn_nor_missed(here: Path) -> None:
    """Its quarters are, from however far; one whose quarters are missing is, from however near."""
    edit(here / "tiles" / "tileset.json", punched)
    world = read_tile_world(here / "tiles" / "tileset.json")
    tiles = world.tileset
    split = int(np.flatnonzero(np.diff(tiles.children)[:, 0] > 1)[0])
    quarters = tiles.below(np.array([split]))
    far = replace(world.start, position=world.start.position + np.array([0, 900.0, 900.0]))
    far = replace(far, pitch_deg=-45.0, far_m=5000.0)
    with loaded(here) as forest:
        expected = {*tiles.below(quarters[:1]), *quarters[1:]}
        assert set(forest.choose(far, SIZE, Look())) == expected
        near = replace(world.start, position=tiles.origin[quarters[1]] + [0, 1.0, 0])
        assert quarters[1] in forest.choose(near, SIZE, Look(detail=IN_FULL))
        assert forest.picture(near, SIZE)[..., 3].any()
    told = world.details(700.0)
    assert told[0].startswith(f"level {tiles.deepest - tiles.depth[quarters[0]]}: 3 tiles")


def test_the_ground_is_as_high_as_the_feet_on_the_smallest_tile_there(here: Path) -> None:
    """All tiles looked at: of the nearest, the deepest."""

    def up(tile: dict[str, Any], at: float) -> None:
        tile["extras"]["feet_m"] = [at, at]
        for index, child in enumerate(tile.get("children", [])):
            up(child, 5 * at + index)

    edit(here / "tiles" / "tileset.json", lambda values: up(values["root"], 1.0))
    world = read_tile_world(here / "tiles" / "tileset.json")
    tiles, found = world.tileset, set()
    for x, z in generator(1, "places").uniform(-35, 35, (200, 2)):
        beyond = np.maximum(tiles.low - [x, 0, z], [x, 0, z] - tiles.high)[:, [0, 2]]
        away = np.round(np.linalg.norm(np.maximum(0, beyond), axis=1), 3)
        deepest = np.where(away == away.min(), tiles.depth, -1)
        possible = tiles.feet_m[deepest == deepest.max(), 0]
        assert world.height_at(x, z) in possible
        found.add(world.height_at(x, z))
    assert len(found) > 8


# ------------------------------------------------------------------------- several files


@pytest.fixture(scope="module")
def several(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same tiles, in a tileset of several files."""
    folder = tmp_path_factory.mktemp("several")
    shutil.copytree(made / "tiles", folder / "tiles")
    scene, out, tiles = str(made / "scene.toml"), str(made / "out"), str(folder / "tiles")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tileset, "MOST", 1)
        patch.setattr(tileset, "APART", 2)
        arguments = ["--tile", "10", "--near", "2", "--jobs", "1", "-q"]
        assert run(["tiles", scene, "--species", out, "-o", tiles, *arguments]) == 0
    assert len(list((folder / "tiles" / "tiles").glob("*.json"))) == 5
    return folder


@pytest.fixture
def apart(several: Path, tmp_path: Path) -> Path:
    """A copy, that may be broken."""
    shutil.copytree(several, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_a_tileset_of_several_files_is_drawn_as_one(made: Path, several: Path) -> None:
    assert check_tileset(several / "tiles" / "tileset.json") == []
    worlds = [read_tile_world(folder / "tiles" / "tileset.json") for folder in (made, several)]
    start = worlds[0].start
    np.testing.assert_array_equal(start.position, worlds[1].start.position)
    with loaded(made) as one, loaded(several) as more:
        names = [[Path(str(f)).name for f in forest.tileset.file] for forest in (one, more)]
        assert sorted(names[0]) == sorted(names[1]) and names[0] != names[1]
        for eye in views(one, "files", 20):
            drawn = [forest.choose(eye, SIZE, Look()) for forest in (one, more)]
            assert [names[0][tile] for tile in drawn[0]] == [names[1][tile] for tile in drawn[1]]
        for eye in (start, replace(start, position=np.array([3.0, 10.0, 5.0]))):
            shown = one.picture(eye, SIZE)
            np.testing.assert_array_equal(more.picture(eye, SIZE), shown)
            assert shown[..., 3].any()


def test_a_tileset_on_the_earth_is_seen_in_the_frame_of_its_scene(apart: Path) -> None:
    """A turn and 6,371 km change nothing."""
    file = apart / "tiles" / "tileset.json"
    flat = read_tileset(file)
    columns = [0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 6371e3, 20.0, 30.0, 1]
    edit(file, lambda v: v["root"].update(transform=columns))
    placed = read_tileset(file)
    for name in ("origin", "low", "high", "feet_m"):
        np.testing.assert_array_equal(getattr(placed, name), getattr(flat, name))


def referring(values: dict[str, Any]) -> dict[str, Any]:
    """The first tile that refers to another file."""
    tile: dict[str, Any] = values["root"]
    while not tile["content"]["uri"].endswith(".json"):
        tile = tile["children"][0]
    return tile


def refer(to: str) -> Callable[[dict[str, Any]], Any]:
    return lambda values: referring(values)["content"].update(uri=to)


def twice(values: dict[str, Any]) -> None:
    above = values["root"]["children"][0]
    above["children"].append(above["children"][0])


OUTSIDE: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "one that is not there": (refer("tiles/x.json"), "expected the tileset .*x.json, found none"),
    "a folder": (refer("tiles/folder.json"), "folder.json: cannot be read"),
    "a NUL in a name": (refer("tiles/a\0b.json"), "expected a tileset as vegtool tiles writes it"),
    "itself": (refer("tileset.json"), "expected a tileset that no other refers to, and not it"),
    "itself, by another name": (refer("tiles/../tileset.json"), "no other refers to, and not its"),
    "one twice": (twice, "expected a tileset that no other refers to, and not itself, found .*2_0"),
    "one, with children": (
        lambda v: referring(v).update(children=[{}]),
        "refers to a tileset, and has children",
    ),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_file_that_is_referred_to_wrongly_is_a_sentence(apart: Path, name: str) -> None:
    change, said = OUTSIDE[name]
    (apart / "tiles" / "tiles" / "folder.json").mkdir()
    edit(apart / "tiles" / "tileset.json", change)
    with pytest.raises(InputError, match=said):
        read_tileset(apart / "tiles" / "tileset.json")


@pytest.mark.parametrize("text", ["", "[]", '{"root": {}}', '{"root": {"children": []}}'])
def test_a_broken_file_of_several_is_named(apart: Path, text: str) -> None:
    file = apart / "tiles" / "tiles" / "4_0_0.json"
    file.write_text(text)
    with pytest.raises(InputError, match=r"4_0_0\.json: expected a tileset as vegtool"):
        read_tileset(apart / "tiles" / "tileset.json")


def test_a_cycle_further_down_is_told(apart: Path) -> None:
    edit(apart / "tiles" / "tiles" / "2_0_0.json", refer("../tileset.json"))
    with pytest.raises(InputError, match=r"2_0_0\.json: expected a tileset that no other refers"):
        read_tileset(apart / "tiles" / "tileset.json")


# ------------------------------------------------------------------------- what is kept


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each tile and model was read, by name."""
    found: Counter[str] = Counter()

    def counted(read: Callable[..., Any]) -> Callable[..., Any]:
        def reading(path: Path, *more: Any) -> Any:
            found[path.name] += 1
            return read(path, *more)

        return reading

    monkeypatch.setattr(tile_store, "read_tile", counted(tile_store.read_tile))
    monkeypatch.setattr(tile_store, "read_model", counted(tile_store.read_model))
    return found


def walk(forest: TileForest) -> list[Eye]:
    """Low across the landscape, looking down: a few tiles are seen at a time."""
    low, high = forest.tileset.low[0], forest.tileset.high[0]
    places = np.linspace(high[2], low[2], 8)
    return [Eye(np.array([3.0, high[1] + 2, z]), 0.0, -70.0, 40.0) for z in places]


def held_bytes(store: TileStore) -> int:
    """What it counts, counted anew."""
    rows = sum(rows.nbytes for held in store._held.values() for rows in held.rows)
    models = sum(model.bytes for model in store._models.values())
    assert {key for model in store._models.values() for key in model.textures} == {*store._textures}
    assert len(store._models) == len(store.landscape.plants)
    images = [4 * t.width * t.height for t in store._textures.values()]
    return rows + models + sum(image + image * 4 // 3 for image in images)  # and mips


def walked(folder: Path, most: int, monkeypatch: pytest.MonkeyPatch) -> tuple[list[Any], list[int]]:
    """Pictures there and back, and the bytes that were held after each."""
    monkeypatch.setattr(tile_store, "MOST_BYTES", most)
    with loaded(folder) as forest:
        eyes, store = walk(forest), forest._store
        assert store is not None
        pictures, held = [], []
        for eye in (*eyes, *eyes[::-1]):
            pictures.append(forest.picture(eye, SIZE))
            held.append(store.bytes)
            assert held[-1] == held_bytes(store)
        assert forest._loaded("draw").ctx.error == "GL_NO_ERROR"
    return pictures, held


def test_a_walk_over_more_tiles_than_fit_keeps_within_bounds(
    made: Path, reads: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With no room at all, what is held is what the last two frames drew. With as much as the most
    of these, no frame holds more; tiles are read again on the way back; and pictures are the same
    as where everything is kept."""
    pictures, everything = walked(made, 1 << 40, monkeypatch)
    assert everything == sorted(everything) and max(reads.values()) == 1
    bare, needed = walked(made, 0, monkeypatch)
    bound = max(needed)
    assert bound < everything[-1]
    reads.clear()
    bounded, held = walked(made, bound, monkeypatch)
    assert max(held) <= bound and max(reads.values()) > 1
    assert len({picture.tobytes() for picture in pictures}) == len(pictures) // 2
    for one, two, three in zip(pictures, bare, bounded, strict=True):
        np.testing.assert_array_equal(one, two)
        np.testing.assert_array_equal(one, three)


def test_what_is_longest_unseen_is_forgotten_and_comes_back(
    made: Path, reads: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tile_store, "MOST_BYTES", 0)
    with loaded(made) as forest:
        landscape, store = forest._loaded("draw"), forest._store
        assert store is not None
        finest = np.flatnonzero(forest.tileset.depth == forest.tileset.deepest)[:4]
        a, b, c, d = (int(tile) for tile in finest)
        for tiles in ([a, b], [b, c], [c, d]):
            store.held(tiles)
        assert set(store._held) == {b, c, d}
        assert reads["bush_0.gltf"] == 1, "what others draw with stays"
        (again,) = store.held([a])
        assert set(store._held) == {c, d, a} and again.models == store._held[d].models
        top = store.held([0])[0]
        assert not set(top.models) & set(again.models)
        before = forest.texture_bytes
        store.held([0])
        assert set(store._held) == {0} and len(top.models) == len(landscape.plants) == 1
        assert forest.texture_bytes < before
        assert reads["bush_0.gltf"] == 1
        store.held([a])
        assert reads["bush_0.gltf"] == 2


def test_a_frame_of_two_views_reads_nothing_again(
    made: Path, reads: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it is and in full, one after the other, with no room to spare."""
    monkeypatch.setattr(tile_store, "MOST_BYTES", 0)
    eye = read_tile_world(made / "tiles" / "tileset.json").start
    with loaded(made) as forest:
        for _ in range(3):
            for look in (Look(level=2), Look(detail=IN_FULL, level=0)):
                forest.picture(eye, SIZE, look)
    assert max(reads.values()) == 1 and len(reads) > 4


def test_each_half_of_a_stereo_picture_is_what_its_eye_sees(made: Path) -> None:
    check_two_eyes(read_tile_world(made / "tiles" / "tileset.json"))


def test_species_have_colours_and_merged_tiles_are_white(made: Path) -> None:
    with loaded(made) as forest:
        store = forest._store
        assert store is not None
        leaf, root = store.held([len(forest.tileset.file) - 1, 0])
    assert leaf.kinds and 0 not in leaf.kinds and root.kinds == (0,)


def test_a_tileset_says_as_what_its_errors_are_to_be_seen(here: Path) -> None:
    """As one pixel in place of 16, they are 16 times as important."""
    file = here / "tiles" / "tileset.json"
    before = read_tile_world(file)
    assert before.tileset.seen_px == CLIENT_PX
    edit(file, lambda v: v["root"]["extras"].update(seen_px=1.0))
    after = read_tile_world(file)
    for away in (30.0, 300.0):
        eye = replace(before.start, position=before.start.position + np.array([0.0, 0.0, away]))
        drawn = TileForest(after.tileset).choose(eye, SIZE, Look())
        expected = TileForest(before.tileset).choose(eye, SIZE, Look(detail=CLIENT_PX))
        assert drawn == expected


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
    "nothing": lambda v: v.update(root={**v["root"], "content": None, "children": []}),
    "no uri": lambda v: v["root"].update(content={}),
    "a NUL in a name": lambda v: v["root"]["content"].update(uri="a\0b"),
    "no extras": lambda v: v["root"].pop("extras"),
    "plants beyond count": lambda v: v["root"]["extras"].update(plants=10**30),
    "errors to be seen as nothing": lambda v: v["root"]["extras"].update(seen_px=0.0),
    "an error in words": lambda v: v["root"].update(geometricError="much"),
    "a child without a place": lambda v: v["root"]["children"][0].pop("transform"),
    "a child that is turned": lambda v: v["root"]["children"][0]["transform"].__setitem__(0, -1.0),
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
        (["--fade", "none"], "--fade: tiles follow each other in their own way"),
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
