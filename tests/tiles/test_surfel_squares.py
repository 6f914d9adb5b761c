"""Squares of a landscape as surfels: of the plants that stand there, then of squares below."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cards import cards
from plants import plant_of
from tile_cases import scene_of

from vegtool.arrays import FloatArray
from vegtool.cli import run as command
from vegtool.formats.gltf import write_chain
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.gltf_surfels import read_surfel_set
from vegtool.formats.tileset_check import check_tileset
from vegtool.lod import Display, Level, LodChain
from vegtool.plant import Plant
from vegtool.scene import read_scene
from vegtool.tiles import pyramid as pyramids
from vegtool.tiles import samples
from vegtool.tiles.jobs import TILES, Failed, FarJob, Made, World, do, file_of
from vegtool.tiles.journal import Entry
from vegtool.tiles.library import StoredSurfels
from vegtool.tiles.options import TileOptions
from vegtool.tiles.pyramid import Pyramid, pyramid_of
from vegtool.tiles.quadtree import Node
from vegtool.tiles.run import Run
from vegtool.tiles.samples import samples_of
from vegtool.tiles.shared import Shared
from vegtool.tiles.surfel_squares import plants_tile, standing

pytestmark = pytest.mark.gl
LEAVES = np.array([[0.0, 2.5, 0], [0.7, 1, 0.3], [-0.5, 1.5, -0.6], [0.2, 0.6, 0.5]])
BUSH = cards(LEAVES, 0.5, normals=LEAVES)
WALL = cards(np.array([[x, 2.5, 0] for x in np.arange(-17.5, 20, 5)]), 2.5)
"""40 m long, 5 m high."""
SLIVER = plant_of(np.array([[[0.0, 0, 0], [0, 1, 0], [1e-6, 0, 0]]]))
FEET = [(4, 4), (12, 4), (20, 20), (28, 28), (60, 60)]
"""Metres east and north. Tiles of 16 m: two squares of 32 m that are surfels, and the whole."""


def few(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(samples, "COUNT", 400)
    patch.setattr(pyramids, "FEWEST", 100)
    patch.setattr(pyramids, "MOST", 200)


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    few(monkeypatch)


def library(folder: Path, **plants: Plant) -> Path:
    for name, plant in plants.items():
        levels = (Level("mesh", mesh=plant), Level("mesh", mesh=plant, near_distance_m=10.0))
        write_chain(LodChain(name, levels, Display(), 0), folder / "library")
    return folder / "library"


def scene(folder: Path, rows: list[tuple[float, float, str]]) -> Path:
    yaws = {"wall": "0"}
    lines = ["x,y,species,yaw", *(f"{x},{y},{name},{yaws.get(name, '')}" for x, y, name in rows)]
    (folder / "plants.csv").write_text("\n".join(lines))
    names = sorted({name for _, _, name in rows})
    tables = "".join(f"[[species]]\nname = '{name}'\n" for name in names)
    return scene_of(folder, tables + "[placement]\ninventory = 'plants.csv'\n").path


def world(folder: Path, rows: list[tuple[float, float, str]], **plants: Plant) -> World:
    folder.mkdir(exist_ok=True)
    kept = library(folder, **plants)
    options = TileOptions(tile=16.0, near=1, surfels=True, plain=True)
    made = pyramid_of(read_scene(scene(folder, rows)), kept, options)
    return World(made, Shared(made, folder / "out" / TILES), folder / "out")


def bushes() -> list[tuple[float, float, str]]:
    return [(float(x), float(y), "bush") for x, y in FEET]


def written(at: World) -> dict[str, Entry]:
    run = Run(at)
    for _ in run.tiles():
        pass
    assert not run.failed
    run.finish()
    return run.found


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[World, dict[str, Entry]]:
    with pytest.MonkeyPatch.context() as patch:
        few(patch)
        at = world(tmp_path_factory.mktemp("made"), bushes(), bush=BUSH)
        return at, written(at)


def of_kind(pyramid: Pyramid, found: dict[str, Entry], height: int) -> list[Node]:
    return [n for n in pyramid.tree.nodes(pyramid.tree.depth - height) if str(n) in found]


def test_squares_that_are_not_instances_are_surfels(made: tuple[World, dict[str, Entry]]) -> None:
    """And clients can use them: errors and boxes are in order, and each takes over at its side."""
    at, found = made
    tree = at.pyramid.tree
    for height in range(tree.depth + 1):
        for node in of_kind(at.pyramid, found, height):
            facts = found[str(node)].facts
            assert facts["kind"] == ("surfels" if height else "instances")
            if height:
                surfels = read_surfel_set(at.out / file_of(node))
                assert len(surfels) == facts["surfels"] <= 100, "half as many as triangles, or 100"
                bounds = surfels.bounds
                assert np.allclose(bounds, facts["bounds"], atol=1e-5)
    assert check_tileset(at.out / "tileset.json") == []
    root = json.loads((at.out / "tileset.json").read_bytes())["root"]
    assert root["extras"]["surfels"] > 0
    assert root["geometricError"] >= at.pyramid.error_m(tree.depth)


def test_surfels_are_on_their_plants(made: tuple[World, dict[str, Entry]]) -> None:
    """Turned, scaled, moved and tinted one by one: each is one of the species', so placed."""
    at, found = made
    pyramid = at.pyramid
    sample = pyramid.samples[0].read()
    for node in of_kind(pyramid, found, 1):
        stand = pyramid.stand(node)
        every = []
        for foot, yaw, scale in zip(stand.foot, stand.yaw, stand.scale, strict=True):
            c, s = np.cos(yaw), np.sin(yaw)
            turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
            every.append(scale * sample.position @ turn.T + foot - pyramid.origin(node))
        surfels = read_surfel_set(at.out / file_of(node))
        away = np.linalg.norm(surfels.position[:, None] - np.concatenate(every), axis=2)
        assert away.min(axis=1).max() < 1e-4
        assert len(set(away.argmin(axis=1))) == len(surfels)
        plants = set((away.argmin(axis=1) // len(sample)).tolist())
        assert plants == set(range(len(stand))), "of every plant"


def test_a_square_is_made_of_the_files_of_its_quarters(
    made: tuple[World, dict[str, Entry]],
) -> None:
    """Nothing else is read, so it is the same where species have no surfels any more; and every
    surfel is one of theirs."""
    at, found = made
    pyramid = at.pyramid
    for height in range(2, pyramid.tree.depth + 1):
        for node in of_kind(pyramid, found, height):
            below = [
                read_surfel_set(at.out / file_of(one)).position
                + pyramid.origin(one) - pyramid.origin(node)
                for one in pyramid.tree.quarters(node)
            ]  # fmt: skip
            own = read_surfel_set(at.out / file_of(node))
            away = np.linalg.norm(own.position[:, None] - np.concatenate(below), axis=2)
            assert away.min(axis=1).max() < 1e-4
            full = sum(found[str(one)].facts["full"] for one in pyramid.tree.quarters(node))
            assert found[str(node)].facts["full"] == full
            alone = replace(at, pyramid=replace(pyramid, samples=()))
            before = (at.out / file_of(node)).read_bytes()
            known = tuple((one, found[str(one)]) for one in pyramid.tree.quarters(node))
            (outcome,) = do(alone, FarJob(node=node, quarters=known))
            assert isinstance(outcome, Made) and outcome.again
            assert (at.out / file_of(node)).read_bytes() == before


def test_how_many_stand_for_how_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half as many as triangles, in limits; above a single quarter, seen at half the size, a
    quarter of its own."""
    monkeypatch.undo()
    count = partial(Pyramid.surfels_for, None)
    assert [count(full) for full in (0, 2, 1e4, 1e5, 1e9)] == [1000, 1000, 5000, 50_000, 200_000]
    assert [count(1e9, alone) for alone in (200_000, 5000, 3)] == [50_000, 1250, 1000]


def test_the_same_again_and_only_what_has_changed(
    made: tuple[World, dict[str, Entry]], tmp_path: Path
) -> None:
    at, _ = made
    again = Run(at)
    assert not any(one.again for one in again.tiles())  # type: ignore[union-attr]
    other = world(tmp_path / "other", bushes(), bush=BUSH)
    for name, entry in written(other).items():
        for file in entry.files:
            assert (other.out / file).read_bytes() == (at.out / file).read_bytes(), name
    shutil.copytree(at.out, tmp_path / "moved" / "out")
    rows = [*bushes()[:-1], (61.0, 60.0, "bush")]
    moved = Run(world(tmp_path / "moved", rows, bush=BUSH))
    remade = {one.entry.name for one in moved.tiles() if one.again}  # type: ignore[union-attr]
    tree = at.pyramid.tree
    corner = next(n for n in tree.nodes(tree.depth) if n.column == 3 and n.row == 0)
    expected = set()
    while corner.level:
        expected.add(str(corner))
        corner = corner.parent
    assert remade - {"model 0/0", "model 0/1"} == expected | {"0/0/0"}


def made_alone(at: World, node: Node, folder: Path) -> FloatArray:
    """(n, 3) metres in the scene's frame: the surfels of a square."""
    own = at.pyramid.stand(node)
    every, _ = standing(at.pyramid, node, own)
    path = folder / "one.glb"
    path.write_bytes(plants_tile(at.pyramid, at.shared, node, every, len(own)).data)
    return np.asarray(read_surfel_set(path).position + at.pyramid.origin(node))


def test_long_things_are_split_and_crowns_over_a_border_are_not(tmp_path: Path) -> None:
    """A wall of 40 m on the border of squares of 32 m: each of its surfels is on the square that it
    lies on, where anything stands there. A bush stays whole: it would be cut off where one square
    is instances, and the other is not."""
    rows = [(31.0, 8.0, "wall"), (31.5, 24.0, "bush"), (50.0, 24.0, "bush"), (1.0, 24.0, "bush")]
    at = world(tmp_path, rows, bush=BUSH, wall=WALL)
    tree = at.pyramid.tree
    west, east = tree.nodes(tree.depth - 1)
    border = (tree.middle(west)[0] + tree.middle(east)[0]) / 2
    parts = [made_alone(at, node, tmp_path) for node in (west, east)]
    wall = [part[part[:, 2] > tree.middle(west)[1]][:, 0] for part in parts]
    bushes = [part[part[:, 2] < tree.middle(west)[1]][:, 0] for part in parts]
    assert wall[0].max() <= border <= wall[1].min()
    assert np.ptp(np.concatenate(wall)) > 39, "all of it"
    assert border < bushes[0].max() < border + 2 and bushes[1].min() > border + 10


def test_what_lies_where_nothing_stands_stays_with_its_foot(tmp_path: Path) -> None:
    """A wall alone, across two squares: of the one that has its foot, all is; the other is none."""
    at = world(tmp_path, [(31.0, 8.0, "wall"), (30.0, 9.0, "wall")], wall=WALL)
    tree = at.pyramid.tree
    (node,) = tree.nodes(tree.depth - 1)
    assert np.ptp(made_alone(at, node, tmp_path)[:, 0]) > 39
    assert not len(standing(at.pyramid, node, at.pyramid.stand(node))[1])
    rows = [(31.0, 8.0, "wall"), (30.0, 9.0, "wall"), (60.0, 8.0, "bush")]
    beside = world(tmp_path / "beside", rows, wall=WALL, bush=BUSH)
    tree = beside.pyramid.tree
    west, _ = tree.nodes(tree.depth - 1)
    border = tree.middle(west)[0] + 16.0
    assert made_alone(at, node, tmp_path)[:, 0].max() > border
    assert made_alone(beside, west, tmp_path)[:, 0].max() <= border
    cells = standing(beside.pyramid, west, beside.pyramid.stand(west))[1]
    assert cells.tolist() == [[1, 0]], "which is told to the journal, as nothing on it has changed"


def test_one_triangle_that_is_hardly_seen_has_a_surfel(tmp_path: Path) -> None:
    """A sliver of a micrometre, and two copies of a plant at one place: squares are not empty."""
    rows = [(5.0, 5.0, "sliver"), (5.0, 5.0, "sliver"), (40.0, 40.0, "sliver")]
    at = world(tmp_path, rows, sliver=SLIVER)
    found = written(at)
    counts = [entry.facts["surfels"] for entry in found.values() if "surfels" in entry.facts]
    assert counts and min(counts) >= 1
    assert check_tileset(at.out / "tileset.json") == []


def test_a_square_without_plants_is_none(made: tuple[World, dict[str, Entry]]) -> None:
    """Where rules left none on any of its tiles; above, it is as if it were not there."""
    at, _ = made
    tree = at.pyramid.tree
    above = Node(tree.depth - 2, 0, 0)
    empty = Entry("none", "none", {}, {"plants": 0})
    job = FarJob(node=above, quarters=tuple((one, empty) for one in tree.quarters(above)))
    (outcome,) = do(at, job)
    assert isinstance(outcome, Made) and outcome.entry.facts == {"plants": 0}


def test_own_surfels_of_a_species_are_taken(made: tuple[World, dict[str, Entry]]) -> None:
    """What --method surfels wrote, moved as its levels are; another file, another digest."""
    at, _ = made
    one = at.pyramid.species[0]
    file = at.pyramid.samples[0].file
    own = replace(one, surfels=StoredSurfels(file, 99.0, 0.1, (1.0, 0.0, 0.0)))
    (sample,) = samples_of([own], file.parent.parent.parent)
    assert not sample.made and sample.digest != at.pyramid.samples[0].digest
    moved = sample.read().position - at.pyramid.samples[0].read().position
    assert np.allclose(moved, [1.0, 0.0, 0.0])


def test_squares_keep_the_light_of_their_plants(tmp_path: Path) -> None:
    """Half of all passes through its leaves, with a tint: so it is on every square, as files tell
    it. How much of the sky's light reaches them, files of plants do not."""
    tint = np.array([1.0, 0.8, 0.4])
    leaves = tuple(replace(m, transmission=0.5, transmission_tint=tint) for m in BUSH.materials)
    at = world(tmp_path, bushes(), bush=replace(BUSH, materials=leaves))
    found = written(at)
    for height in (1, 2):
        nodes = of_kind(at.pyramid, found, height)
        assert nodes
        for node in nodes:
            square = read_surfel_set(at.out / file_of(node))
            assert square.light is not None
            assert np.abs(square.light - [1.0, 1.0, 0.5]).max() < 0.01
            assert np.allclose(square.transmission_tint, tint, atol=0.01)


def test_light_is_sampled_and_averaged_as_colours_are(
    made: tuple[World, dict[str, Entry]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Where a species' own surfels have their colours as light too, so has the square."""
    at, _ = made
    node = of_kind(at.pyramid, made[1], 1)[0]
    sample = at.pyramid.samples[0].read()
    colors = np.random.default_rng(0).random(sample.color.shape)
    monkeypatch.setattr(Shared, "sample", lambda *_: replace(sample, color=colors, light=colors))
    stand = at.pyramid.stand(node)
    path = tmp_path / "one.glb"
    path.write_bytes(plants_tile(at.pyramid, at.shared, node, stand, len(stand)).data)
    square = read_surfel_set(path)
    assert len(stand) == 1 and square.color.std() > 0.1
    own = square.color / stand.tint[0]
    assert square.light is not None and np.abs(square.light - own).max() < 0.6 / 255


def test_by_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What it would be, then all, then one square alone; quantised as merged ones are."""
    kept, out = library(tmp_path, bush=BUSH), str(tmp_path / "tiles")
    arguments = ["tiles", str(scene(tmp_path, bushes())), "--species", str(kept), "-o", out]
    arguments += ["--surfels", "--tile", "16", "--near", "1", "-j", "1"]
    assert command([*arguments, "--dry-run", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert command([*arguments, "--format", "glb", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert told["tiles"] == len(facts["tiles"])
    assert {one["kind"] for one in facts["tiles"]} == {"instances", "surfels"}
    name = next(one["tile"] for one in facts["tiles"] if one["surfels"])
    file = tmp_path / "tiles" / file_of(Node(*map(int, name.split("/"))))
    before = file.read_bytes()
    assert open_gltf(file).json["extensionsRequired"] == ["KHR_mesh_quantization"]
    file.unlink()
    assert command([*arguments, "--only", name, "-q"]) == 0
    assert file.read_bytes() == before
    assert command([*arguments]) == 0
    assert "100 surfels" in capsys.readouterr().out


def test_a_square_that_is_broken_is_said(
    made: tuple[World, dict[str, Entry]], tmp_path: Path
) -> None:
    at, found = made
    shutil.copytree(at.out, tmp_path / "out")
    broken = replace(at, out=tmp_path / "out")
    tree = at.pyramid.tree
    node = tree.nodes(tree.depth - 2)[0]
    quarters = tuple((one, found[str(one)]) for one in tree.quarters(node))
    (tmp_path / "out" / file_of(quarters[0][0])).write_bytes(b"glTF")
    (outcome,) = do(broken, FarJob(node=node, quarters=quarters))
    assert isinstance(outcome, Failed) and file_of(quarters[0][0]) in outcome.message
