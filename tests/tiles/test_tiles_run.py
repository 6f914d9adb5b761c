"""A small landscape as tiles: every plant once on every level, all files whole, the same again."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cards import cards, texture, turned
from instanced import AMBIENT, WHITE, facing, frame_of, instance
from tile_cases import TWO_SPECIES, feet, scene_of
from tile_cases import picture as picture_of

from vegtool.elements import ordered, unordered
from vegtool.errors import InputError, UsageError
from vegtool.formats import read_plant
from vegtool.formats.gltf import write_chain
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.shared_model import plain_name
from vegtool.formats.tileset_check import check_tileset
from vegtool.gl.instances import WHOLE
from vegtool.gl.landscape import Batch, Frame, Landscape, picture
from vegtool.gl.upload import Textures
from vegtool.lod import Display, Level, LodChain
from vegtool.plant import Material, Plant
from vegtool.progress import Progress, silent
from vegtool.seeding import generator
from vegtool.tiles.command import run_tiles
from vegtool.tiles.jobs import TILES, Made, World, file_of
from vegtool.tiles.journal import Entry
from vegtool.tiles.make import chosen, merged_tile
from vegtool.tiles.options import RunOptions, TileOptions
from vegtool.tiles.placement import Placement, Plants
from vegtool.tiles.pyramid import Pyramid, pyramid_of, used_levels
from vegtool.tiles.quadtree import Node, quadtree_of
from vegtool.tiles.run import Run
from vegtool.tiles.shared import Shared, file_names
from vegtool.tiles.source import scene_at

SIDE, COUNT = 64.0, 40
"""Metres of ground, and how many plants stand on it."""
LEAF = Material(
    "leaf", color_texture=texture(np.full((8, 8, 4), (70, 130, 45, 255)), "leaf"),
    alpha_mode="mask", double_sided=True, role="leaf",
)  # fmt: skip
GRASS = Material("grass", [0.2, 0.4, 0.1, 1], double_sided=True, role="leaf")
LEVELS = {"ash": ((4, 2, 1), (0.0, 10.0, 25.0)), "pine": ((3, 1), (0.0, 8.0))}
"""How many cards each level has, of two triangles each, and from where on it may be used."""
PLACED = "[placement]\ninventory = 'plants.csv'\n"


def levels_of(name: str, double_sided: bool = True) -> list[Plant]:
    """About 3 m high; leaves of one have a picture, of the other a colour."""
    rng = generator(0, name)
    material = replace(LEAF if name == "ash" else GRASS, double_sided=double_sided)
    middles, facing_to = rng.uniform((-1, 0.5, -1), (1, 2.5, 1), (4, 3)), rng.normal(size=(4, 3))
    middles[0, 1] = 2.5
    return [cards(middles[:n], 0.5, material, facing_to[:n]) for n in LEVELS[name][0]]


def library(folder: Path, single: Sequence[str] = ()) -> Path:
    """Both plants, converted. single: those whose leaves have one side."""
    for name, (_, distances) in LEVELS.items():
        levels = [
            Level("mesh", mesh=mesh, near_distance_m=distance)
            for mesh, distance in zip(levels_of(name, name not in single), distances, strict=True)
        ]
        write_chain(LodChain(name, tuple(levels), Display(), 0), folder / "library")
    return folder / "library"


def rows(count: int = COUNT, away: float = 0.0, seed: int = 0) -> list[tuple[float, float, str]]:
    """Easting, northing and species, in quarters of a metre. The first four stand in the corners of
    the ground, so that any tiles of it are all there."""
    rng = generator(seed, "rows")
    corners = [(0.25, 0.25), (SIDE - 0.25, 0.25), (0.25, SIDE - 0.25), (SIDE - 0.25, SIDE - 0.25)]
    places = [*corners, *(rng.integers(1, 4 * SIDE, (count - 4, 2)) / 4).tolist()]
    return [
        (away + x, y, name)
        for (x, y), name in zip(places, rng.choice(sorted(LEVELS), count), strict=True)
    ]


def inventory(folder: Path, heights: Sequence[str] = ("", "2.5", "", "4"), away: float = 0) -> Path:
    lines = ["x,y,species,height"]
    for index, (x, y, name) in enumerate(rows(away=away)):
        lines.append(f"{x},{y},{name},{heights[index % len(heights)]}")
    path = folder / "plants.csv"
    path.write_text("\n".join(lines))
    return path


HIGH = ("2.5", "4", "3.25")
"""What all plants have heights of."""


def pyramid(
    folder: Path, heights: Sequence[str] = HIGH, away: float = 0, single: Sequence[str] = (),
    **options: float,
) -> Pyramid:  # fmt: skip
    """Four tiles, of which the root is merged, unless options say otherwise."""
    folder.mkdir(parents=True, exist_ok=True)
    inventory(folder, heights, away)
    values = {"tile": 32.0, "near": 1, "near_triangles": 10**9} | options
    scene = scene_of(folder, TWO_SPECIES + PLACED)
    made = pyramid_of(scene, library(folder, single), TileOptions(**values))  # type: ignore[arg-type]
    # without the squares above, of which there would be two or three
    return replace(made, tree=quadtree_of(made.placement.tiles, made.placement.tile_m))


@dataclass(frozen=True)
class Tile:
    """A tile that is written: which, what is told of it, its bytes, and what took how long."""

    node: Node
    entry: Entry
    data: bytes
    seconds: dict[str, float]

    def __getattr__(self, name: str) -> Any:
        return self.entry.facts[name]


def world(made: Pyramid, out: Path) -> World:
    return World(made, Shared(made, out / TILES), out)


def write_tiles(made: Pyramid, out: Path) -> list[Tile]:
    """All tiles with plants on them, the smallest first."""
    run = Run(world(made, out))
    outcomes = list(run.tiles())
    assert not run.failed
    run.finish()
    tiles = [
        Tile(
            node := Node(*map(int, one.entry.name.split("/"))), one.entry,
            (out / file_of(node)).read_bytes(), one.seconds,
        )
        for one in outcomes
        if isinstance(one, Made) and one.entry.facts.get("plants")
    ]  # fmt: skip
    return sorted(tiles, key=lambda tile: -tile.node.level)


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> tuple[Pyramid, Path, list[Tile]]:
    """Four tiles and their root, written."""
    folder = tmp_path_factory.mktemp("four")
    made = pyramid(folder)
    return made, folder / "out", write_tiles(made, folder / "out")


@pytest.fixture(scope="module")
def sixteen(tmp_path_factory: pytest.TempPathFactory) -> tuple[Pyramid, Path, list[Tile]]:
    """Tiles of 16 m, at most, and two levels of merged ones."""
    folder = tmp_path_factory.mktemp("sixteen")
    made = pyramid(folder, tile=16.0, plain=True)
    return made, folder / "out", write_tiles(made, folder / "out")


@pytest.fixture(params=["four", "sixteen"])
def written(request: pytest.FixtureRequest) -> tuple[Pyramid, Path, list[Tile]]:
    found: tuple[Pyramid, Path, list[Tile]] = request.getfixturevalue(request.param)
    return found


Written = tuple[Pyramid, Path, list[Tile]]


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*")) if path.is_file()
    }  # fmt: skip


def standing(made: Pyramid, node: Node) -> list[Plant]:
    """The plants on a square one by one, in metres from its origin, each as the last level whose
    switch distance, times its scale, is no farther than what the square is made for."""
    height = made.tree.height(node.level)
    away, found = made.made_for_m(height), []
    for number in made.tree.tiles_of(node):
        on = made.placement.plants(int(number))
        for k, foot in enumerate(feet(on)):
            one = made.species[on.species[k]]
            scale = 1.0 if np.isnan(on.height[k]) else float(on.height[k]) / one.height
            level = sum(bool(at * scale <= away) for at in one.switch_m) - 1
            level = min(max(level, made.finest(height)), len(one.levels) - 1)
            place = foot - made.origin(node)
            found.append(turned(one.levels[level], float(on.yaw[k]), scale, place))
    return found


def corners(plants: Sequence[Plant]) -> np.ndarray:
    """(f, 9) metres."""
    return np.concatenate([one.corners.reshape(-1, 9) for one in plants])


# ----------------------------------------------------------------------------------- as it should


def test_a_tileset_is_written_that_clients_can_use(written: Written) -> None:
    made, folder, tiles = written
    assert check_tileset(folder / "tileset.json") == []
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    assert not [name for name in names if name.endswith(".part")]
    assert {file_of(tile.node) for tile in tiles} == {n for n in names if n.endswith(".glb")}
    for tile in tiles:
        assert (folder / file_of(tile.node)).read_bytes() == tile.data
    heights = [made.tree.height(tile.node.level) for tile in tiles]
    assert heights == sorted(heights), "the smallest first"


def test_every_plant_is_once_on_every_level(written: Written) -> None:
    made, folder, tiles = written
    for level in range(made.tree.depth + 1):
        at = [tile for tile in tiles if tile.node.level == level]
        assert sum(tile.plants for tile in at) == COUNT
        seen = np.concatenate([made.stand(tile.node).row for tile in at])
        assert sorted(seen.tolist()) == list(range(1, COUNT + 1))
    for tile in tiles:
        quarters = made.tree.quarters(tile.node)
        if quarters:
            own = [set(made.stand(one).row.tolist()) for one in quarters]
            assert sum(map(len, own)) == len(set.union(*own)) == tile.plants
    root = json.loads((folder / "tileset.json").read_bytes())["root"]
    assert root["extras"]["plants"] == COUNT
    assert sum(child["extras"]["plants"] for child in root["children"]) == COUNT


def test_a_tile_draws_its_plants_each_turned_by_itself(written: Written) -> None:
    """Half a step of 16 bits is half a millimetre here, and of nothing else is there more."""
    made, folder, tiles = written
    for tile in tiles:
        found = read_plant(folder / file_of(tile.node)).corners.reshape(-1, 9)
        wanted = corners(standing(made, tile.node))
        assert len(found) == len(wanted) == tile.triangles, str(tile.node)
        for one in found:
            assert np.abs(wanted - one).max(axis=1).min() < 6e-4
        for one in wanted:
            assert np.abs(found - one).max(axis=1).min() < 6e-4


def test_instances_stand_where_plants_do(four: Written) -> None:
    """All of them, in the scene's frame."""
    made, folder, tiles = four
    found = []
    for tile in tiles:
        if tile.kind == "instances":
            file = open_gltf(folder / file_of(tile.node))
            for node in file.json["nodes"]:
                for extension in node.get("extensions", {}).values():
                    places = file.accessor(extension["attributes"]["TRANSLATION"])
                    found.append(places + made.origin(tile.node))
    wanted = np.array([[x, 0.0, -y] for x, y, _ in rows()])
    got = np.concatenate(found)
    assert len(got) == COUNT
    for foot in wanted:
        assert np.abs(got - foot).max(axis=1).min() < 1e-4


def test_tiles_say_how_they_were_made_and_what_they_cost(four: Written) -> None:
    _, folder, tiles = four
    assert [tile.kind for tile in tiles] == ["instances"] * 4 + ["merged"]
    for tile in tiles:
        values = open_gltf(folder / file_of(tile.node)).json
        drawn = [node for node in values["nodes"] if "mesh" in node]
        draws = sum(len(values["meshes"][node["mesh"]]["primitives"]) for node in drawn)
        assert tile.draws == draws and (tile.kind != "merged" or draws == 1)


def test_nothing_is_outside_of_its_box(written: Written) -> None:
    made, folder, tiles = written
    for tile in tiles:
        low, high = read_plant(folder / file_of(tile.node)).bounds + made.origin(tile.node)
        box = made.bounds(tile.node)
        assert (low >= box[0] - 1e-3).all() and (high <= box[1] + 1e-3).all(), str(tile.node)


def test_errors_grow_with_squares_and_are_seen_where_these_take_over(written: Written) -> None:
    """16 pixels of a picture of 1080 of 60 degrees at that distance; none of the smallest."""
    made, _, _ = written
    errors = [made.error_m(height) for height in range(made.tree.depth + 1)]
    assert errors[0] == 0 and (np.diff(errors) > 0).all()
    for height in range(1, made.tree.depth + 1):
        away = made.tree.side_m * 2**height
        pixels = errors[height] * Display().pixels_per_metre(away)
        assert pixels == pytest.approx(16.0)


def test_a_square_shows_no_level_that_is_not_at_hand(written: Written) -> None:
    made, folder, _ = written
    shared = Shared(made, folder / TILES)
    for height in range(made.tree.depth + 1):
        near = made.instanced(height)
        pairs = used_levels(made, height) if near else shared.levels(height)
        for kind, level in pairs:
            if near:
                name = shared.model_name(kind, level)
                assert shared.model(kind, level).uri == f"shared/{name}.bin"
            else:
                assert shared.sheet(height).part[kind, level] == pairs.index((kind, level))


@pytest.mark.parametrize("plain", [False, True])
def test_a_second_run_gives_the_same_bytes(tmp_path: Path, plain: bool) -> None:
    """In another folder, from a scene in another folder."""
    found = []
    for name in ("one", "two"):
        made = pyramid(tmp_path / name, plain=plain)
        (write_tiles(made, tmp_path / f"{name} out"))
        found.append(files(tmp_path / f"{name} out"))
    assert found[0] == found[1] and len(found[0]) > 10


def test_written_over_is_as_written_anew(tmp_path: Path, four: Written) -> None:
    """And a run changes nothing of what it makes tiles of."""
    made, folder, _ = four
    shutil.copytree(folder, tmp_path / "again")
    held = [plants.offset.tobytes() for plants in map(made.placement.plants, range(4))]
    (write_tiles(made, tmp_path / "again"))
    assert files(tmp_path / "again") == files(folder)
    assert held == [plants.offset.tobytes() for plants in map(made.placement.plants, range(4))]


def test_a_moved_landscape_has_the_same_tiles_at_another_place(
    tmp_path: Path, four: Written
) -> None:
    """By whole tiles: quarters of metres are exact that far away, too; boxes to a micrometre."""
    away = 1024 * 32.0
    (write_tiles(pyramid(tmp_path, away=away), tmp_path / "out"))
    here, there = files(four[1]), files(tmp_path / "out")
    logs = [one.pop("journal.jsonl").splitlines() for one in (here, there)]
    assert logs[0][:-1] == logs[1][:-1], "keys are of what is on a tile, not of where it is"
    old, new = (
        json.loads(one.pop("tileset.json"), parse_float=lambda text: round(float(text), 6))["root"]
        for one in (here, there)
    )
    assert here == there
    places = [np.array(one["extras"].pop("origin_m")) for one in (old, new)]
    assert (places[1] - places[0]).tolist() == [away, 0.0, 0.0]
    moved = np.array(new.pop("transform")) - old.pop("transform")
    assert moved.tolist() == [0.0] * 12 + [away, 0.0, 0.0, 0.0]
    assert old == new


def test_all_near_tiles_share_their_models(tmp_path: Path) -> None:
    """With instances to the top, there is no sheet, and each model's vertices are there once."""
    made = pyramid(tmp_path, near=16)
    tiles = write_tiles(made, tmp_path / "out")
    assert {tile.kind for tile in tiles} == {"instances"}
    names = sorted(path.name for path in (tmp_path / "out" / "tiles" / "shared").iterdir())
    assert not [name for name in names if name.startswith("sheet")]
    assert [n for n in names if n.endswith(".bin")] == [
        "ash_0.bin", "ash_1.bin", "ash_2.bin", "pine_1.bin",
    ]  # fmt: skip
    assert check_tileset(tmp_path / "out" / "tileset.json") == []


def test_one_tile_is_a_tileset(tmp_path: Path) -> None:
    made = pyramid(tmp_path, tile=128.0)
    (tile,) = write_tiles(made, tmp_path / "out")
    assert (str(tile.node), tile.kind, tile.plants) == ("0/0/0", "instances", COUNT)
    assert check_tileset(tmp_path / "out" / "tileset.json") == []


def test_a_merged_tile_has_no_more_triangles_than_it_may(tmp_path: Path) -> None:
    """Plants are coarser then: 100 of 2 or 4 triangles each are too many at 16 m."""
    made = pyramid(tmp_path, heights=("30",), tile=32.0)
    free = (write_tiles(made, tmp_path / "free"))[-1]
    assert free.triangles == len(corners(standing(made, free.node))) > 2 * COUNT
    capped = replace(made, options=replace(made.options, triangles=2 * COUNT))
    tight = (write_tiles(capped, tmp_path / "tight"))[-1]
    assert (tight.kind, tight.triangles) == ("merged", 2 * COUNT)


def test_a_run_is_told_in_numbers(tmp_path: Path) -> None:
    """From an inventory and a library alone, whose species are those of the library."""
    told: list[str] = []

    @contextmanager
    def bar(title: str) -> Iterator[Progress]:
        told.append(title)
        yield silent

    path, plants = inventory(tmp_path, HIGH), library(tmp_path)
    result = run_tiles(
        path, plants, tmp_path / "out", TileOptions(tile=32.0, near=1), RunOptions(1), bar,
        told.append,
    )  # fmt: skip
    facts = result.facts
    assert (facts["plants"], len(facts["tiles"]), facts["made"]) == (COUNT, 7, 7)
    assert {row["plants"] for row in facts["levels"]} == {COUNT}
    written = files(tmp_path / "out")
    assert facts["bytes"] == sum(map(len, written.values())) - len(written["journal.jsonl"])
    begin = f"{tmp_path / 'out' / 'tileset.json'}: {COUNT} plants, 7 tiles, "
    assert result.text.startswith(begin)
    json.dumps(facts)


def test_a_scene_is_a_file_or_an_inventory(tmp_path: Path) -> None:
    path, plants = inventory(tmp_path), library(tmp_path)
    assert [table.name for table in scene_at(path, plants).species] == ["ash", "pine"]
    with pytest.raises(UsageError, match=r"plants\.xml: expected a scene \(\.toml\) or"):
        scene_at(tmp_path / "plants.xml", plants)
    with pytest.raises(InputError, match=r"none\.csv: expected an inventory, found nothing there"):
        scene_at(tmp_path / "none.csv", plants)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="found none in it"):
        scene_at(path, tmp_path / "empty")


# -------------------------------------------------------------------------------------- as drawn


@pytest.mark.gl
def test_a_merged_tile_looks_as_its_plants_do(four: Written) -> None:
    """Seen from above, in light from everywhere: as much is covered, in the same colours. Plants
    are drawn as instances, the group with all its faces by `unordered`, their textures shared. A
    card is some 7 pixels large, as many as its picture has texels."""
    made, folder, tiles = four
    node = tiles[-1].node
    group, shot = read_plant(folder / file_of(node)), facing(480, 70.0, 0, 60, 200.0)
    shared: Textures = {}
    with Landscape([WHITE]) as landscape:
        landscape.add(group, unordered(group), shared=shared)
        merged = picture(landscape, frame_of(instance()), shot, AMBIENT, samples=4)
        assert shared and landscape.plants[0].buffers.texture_bytes > 0
    for image in shared.values():  # who gives them releases them
        image.release()
    stand, drawn, batches = made.stand(node), [], []
    with Landscape([WHITE]) as landscape:
        for kind, one in enumerate(made.species):
            landscape.add(one.levels[-1], ordered(one.levels[-1]))
            which = np.flatnonzero(stand.species == kind)
            batches.append(Batch(kind, len(drawn), len(which), WHOLE))
            drawn += [
                instance(
                    stand.foot[k] - made.origin(node), yaw=float(stand.yaw[k]),
                    scale=float(stand.scale[k]), tint=np.rint(127.5 * stand.tint[k]),
                )
                for k in which
            ]  # fmt: skip
        rows = Frame(np.concatenate(drawn), tuple(batches))
        seen = picture(landscape, rows, shot, AMBIENT, samples=4)
    assert seen[..., 3].sum() > 1000
    np.testing.assert_allclose(merged.sum(axis=(0, 1)), seen.sum(axis=(0, 1)), rtol=0.02)
    assert np.abs(merged - seen).sum() < 0.05 * seen.sum()


@pytest.fixture(scope="module")
def clustered(tmp_path_factory: pytest.TempPathFactory) -> Written:
    """A root that has room for fewer triangles than plants, whatever their level."""
    folder = tmp_path_factory.mktemp("clustered")
    made = pyramid(folder, tile=16.0, triangles=48)
    return made, folder / "out", write_tiles(made, folder / "out")


@pytest.mark.gl
def test_a_root_with_too_many_plants_is_clustered_anew(clustered: Written) -> None:
    _, folder, tiles = clustered
    root = tiles[-1]
    assert (root.kind, root.plants, root.draws) == ("reclustered", COUNT, 1)
    assert 0 < root.triangles <= 48
    assert len(read_plant(folder / file_of(root.node)).faces) == root.triangles
    assert check_tileset(folder / "tileset.json") == []
    assert {"quarters"} < set(root.seconds)
    for tile in tiles[:-1]:
        assert tile.kind in ("instances", "merged")


@pytest.mark.gl
def test_what_is_clustered_anew_is_in_its_box(clustered: Written) -> None:
    """A box is what clients leave out what is not seen by."""
    made, folder, tiles = clustered
    node = tiles[-1].node
    x, y, z = read_plant(folder / file_of(node)).positions.T
    root = json.loads((folder / "tileset.json").read_bytes())["root"]
    box = np.array(root["boundingVolume"]["box"])
    away = np.stack([x, -z, y], axis=1) - box[:3]  # of tiles, z is up
    assert (np.abs(away) <= box[[3, 7, 11]] + 1e-3).all()
    assert not (np.abs(y) <= (made.bounds(node) - made.origin(node))[1, 1]).all(), "it reaches out"


# --------------------------------------------------------------------------------- what is wrong


class Emptied:
    """A placement of which some tiles turn out to have no plants, as procedural ones may."""

    def __init__(self, whole: Placement, empty: Sequence[int]) -> None:
        self.whole, self.empty = whole, set(empty)
        self.tile_m, self.origin, self.crs = whole.tile_m, whole.origin, whole.crs
        self.tiles, self.notes = whole.tiles, whole.notes

    def tallest(self, count: int) -> np.ndarray:
        return self.whole.tallest(count)

    def measured(self, count: int) -> np.ndarray:
        return self.whole.measured(count)

    def plants(self, tile: int, most: int | None = None) -> Plants:
        return self.whole.plants(tile, 0 if tile in self.empty else most)


def test_a_square_without_plants_is_no_error(tmp_path: Path) -> None:
    made = pyramid(tmp_path, tile=16.0)
    (first, *_) = made.tree.nodes(1)
    empty = made.tree.tiles_of(first).tolist()
    gone = sum(len(made.placement.plants(tile)) for tile in empty)
    there = replace(made, placement=Emptied(made.placement, empty))
    tiles = write_tiles(there, tmp_path / "out")
    assert check_tileset(tmp_path / "out" / "tileset.json") == []
    assert tiles[-1].plants == COUNT - gone


LOW = ("0.5", "")
"""Every other plant is half a metre high, the others are as their models, of some 3 m."""


def test_plants_without_a_height_are_in_their_box(tmp_path: Path) -> None:
    made = pyramid(tmp_path, heights=LOW)
    root = made.tree.nodes(0)[0]
    points = corners(standing(made, root)).reshape(-1, 3)
    box = made.bounds(root) - made.origin(root)
    assert (points >= box[0]).all() and (points <= box[1]).all()


def test_plants_without_a_height_have_their_levels(tmp_path: Path) -> None:
    """At 16 m, where an ash of 3 m is a level finer than one of half a metre."""
    made = pyramid(tmp_path, heights=LOW)
    tiles = write_tiles(made, tmp_path / "out")
    assert sum(tile.plants for tile in tiles) == 2 * COUNT


def test_a_merged_plant_without_a_height_is_no_other_plant(tmp_path: Path) -> None:
    """No error tells of it: part -1 is the last one. Pines of 3 m have their second level from
    48 m on, here, those of half a metre from 8 m on."""
    made = pyramid(tmp_path, heights=LOW)
    slow = [replace(one, switch_m=6.0 * one.switch_m) for one in made.species]
    made = replace(made, species=tuple(slow))
    root = made.tree.nodes(0)[0]
    shared, stand = Shared(made, tmp_path), made.stand(root)
    tile = merged_tile(made, shared, root, stand, chosen(made, shared, root, stand).level)
    assert tile.triangles == len(corners(standing(made, root)))


def test_plants_of_one_name_keep_their_files() -> None:
    """Also where a file system takes capitals for small letters, or a name is none for files."""
    names = file_names(["oak", "Oak", "o k", "o_k", "pine"])
    assert len({plain_name(name).lower() for name in names}) == 5
    assert names[-1] == "pine", "those that differ anyway keep their names"
    names = file_names(["oak", "Oak", "oak_0"])
    assert len({plain_name(name).lower() for name in names}) == 3


def test_sides_count(tmp_path: Path) -> None:
    """Pines have one side here, so that an ash's card is four triangles. There is room for one card
    of each plant; counted without their second sides, ashes could have two."""
    names = [name for *_, name in rows()]
    room = 4 * names.count("ash") + 2 * names.count("pine")
    made = pyramid(tmp_path, heights=("30",), single=["pine"], triangles=room)
    root = (write_tiles(made, tmp_path / "out"))[-1]
    assert root.kind == "merged" and root.triangles <= room


def test_plants_that_rules_leave_out_are_not_told_of(tmp_path: Path) -> None:
    """A slope of rising density: tiles have room for as many as their densest point."""
    picture_of(tmp_path / "density.png", np.tile(np.linspace(0, 65535, 9), (9, 1)))
    tables = TWO_SPECIES.replace('name = "ash"', 'name = "ash"\ndensity = "density.png"')
    text = f"{tables}[placement]\nspacing_m = 3\n[terrain]\nextent_m = [60, 60]\n"
    scene_of(tmp_path, text)

    @contextmanager
    def bar(title: str) -> Iterator[Progress]:
        yield silent

    result = run_tiles(
        tmp_path / "scene.toml", library(tmp_path), tmp_path / "out",
        TileOptions(tile=32.0, near=1), RunOptions(1), bar, lambda text: None,
    )  # fmt: skip
    drawn = result.facts["tiles"][-1]["plants"]
    assert 0 < drawn == result.facts["plants"]
