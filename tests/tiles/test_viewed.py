"""Tiles for the viewers of a scene: every client draws what it would of all tiles, of fewer."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cards import cards
from test_tiles_run import LEVELS, PLACED, files, library, world, write_tiles
from tile_cases import TWO_SPECIES, scene_of

from vegtool.cli import run as main
from vegtool.errors import UsageError
from vegtool.formats.gltf import plant_glb
from vegtool.formats.tileset import CLIENT_PX, TileEntry, tileset_files
from vegtool.formats.tileset_check import check_tileset
from vegtool.lod import Display
from vegtool.needs.inside import inside
from vegtool.needs.view import SceneView, farthest_from_boxes, view_of
from vegtool.plant import Material, Texture
from vegtool.preview.eye import Eye
from vegtool.preview.scenery import Look
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tile_world import read_tile_world
from vegtool.preview.tileset import read_tileset
from vegtool.seeding import generator
from vegtool.tiles.jobs import Made, file_of
from vegtool.tiles.needed import contents_of, hidden_by_ground, passed_over, pruned, reached_by
from vegtool.tiles.options import TileOptions
from vegtool.tiles.pyramid import Pyramid, pyramid_of
from vegtool.tiles.quadtree import quadtree_of
from vegtool.tiles.textures import resolved, texels_per_metre
from vegtool.tiles.viewed import ViewedRun

SIDE = 128.0
"""Metres of ground: 16 x 16 tiles of 8 m."""
CAMERAS = {
    "a road": (
        'path = "path.toml"\nmargin_m = 1\n',
        "height_m = 1.6\n[[station]]\nposition = [-60, 3]\n[[station]]\nposition = [50, -9]\n",
    ),
    "a lawn": ("polygon = [[-30, 10], [-10, 10], [-10, 30]]\nheight_m = [1.5, 2]\n", None),
    "a drone": (
        "polygon = [[-40, -40], [40, -40], [40, 40], [-40, 40]]\nheight_m = [30, 40]\n"
        "fov_y_deg = 40\nimage_height_px = 1440\n",
        None,
    ),
    "afar": ("polygon = [[500, 0], [520, 0], [520, 20]]\nheight_m = [1.5, 2]\n", None),
}
"""[camera], and the path that it names."""


def grown(folder: Path, heights: tuple[str, ...] = ("2.5", "4", ""), **options: float) -> Pyramid:
    """300 plants anywhere on the ground, and one in each corner of it."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = generator(3, "rows")
    places = rng.uniform(-SIDE / 2, SIDE / 2, (300, 2)).round(2).tolist()
    edge = SIDE / 2 - 0.5
    places += [[x, z] for x in (-edge, edge) for z in (-edge, edge)]
    names = rng.choice(sorted(LEVELS), len(places))
    lines = ["x,y,species,height"] + [
        f"{x},{y},{name},{heights[index % len(heights)]}"
        for index, ((x, y), name) in enumerate(zip(places, names, strict=True))
    ]
    (folder / "plants.csv").write_text("\n".join(lines))
    values = {"tile": 8.0, "near": 2} | options
    scene = scene_of(folder, TWO_SPECIES + PLACED)
    made = pyramid_of(scene, library(folder), TileOptions(**values))  # type: ignore[arg-type]
    tree = quadtree_of(made.placement.tiles, made.placement.tile_m, 2)
    return replace(made, tree=tree)


def view(folder: Path, made: Pyramid, camera: str, path: str | None = None) -> SceneView:
    if path is not None:
        (folder / "path.toml").write_text(path)
    file = folder / "view.toml"
    file.write_text(f"[camera]\n{camera}\n[terrain]\nextent_m = [200, 200]\n")
    return view_of(file, made.placement)


def viewed(made: Pyramid, seen: SceneView, out: Path) -> tuple[ViewedRun, list[Made]]:
    """A tileset for some viewers, and what was made for it."""
    run = ViewedRun(world(made, out), seen)
    outcomes = list(run.tiles())
    assert not run.failed
    run.finish()
    assert check_tileset(out / "tileset.json") == []
    return run, [one for one in outcomes if isinstance(one, Made)]


def tiles(folder: Path) -> dict[str, bytes]:
    return {name: data for name, data in files(folder).items() if name.endswith(".glb")}


def root_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "tileset.json").read_bytes())["root"]
    return found


@dataclass(frozen=True, eq=False)
class Client:
    """What is drawn of a tileset: names of files, and shares of surfels."""

    folder: Path

    def __post_init__(self) -> None:
        object.__setattr__(self, "forest", TileForest(read_tileset(self.folder / "tileset.json")))

    def draws(self, eye: Eye, size: tuple[int, int]) -> list[tuple[str, float]]:
        forest: TileForest = getattr(self, "forest")  # noqa: B009
        shown = forest.chosen(eye, size, Look())
        names = [str(forest.tileset.file[tile]) for tile in shown.tile]
        return sorted(zip((Path(name).name for name in names), shown.share.tolist(), strict=True))


def same_everywhere(seen: SceneView, full: Path, fewer: Path, count: int = 150) -> None:
    """For random eyes of the description."""
    clients, display = (Client(full), Client(fewer)), seen.display
    size = display.image_height_px * 4 // 3, display.image_height_px
    eyes = inside(seen.viewers, count, 7)
    for place, yaw, pitch in zip(eyes.position, eyes.yaw_deg, eyes.pitch_deg, strict=True):
        eye = Eye(place, float(yaw), float(pitch) / 3, display.fov_y_deg)  # mostly ahead
        wanted, got = (client.draws(eye, size) for client in clients)
        assert wanted == got


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> tuple[Pyramid, Path]:
    """All tiles: two heights of instances, five of merged ones."""
    folder = tmp_path_factory.mktemp("full")
    made = grown(folder)
    assert {tile.kind for tile in write_tiles(made, folder / "out")} == {"instances", "merged"}
    return made, folder / "out"


Full = tuple[Pyramid, Path]


@pytest.mark.parametrize("name", CAMERAS)
def test_a_client_draws_the_same_tiles_as_of_all(name: str, full: Full, tmp_path: Path) -> None:
    made, out = full
    seen = view(tmp_path, made, *CAMERAS[name])
    viewed(made, seen, tmp_path / "out")
    same_everywhere(seen, out, tmp_path / "out")
    every, fewer = tiles(out), tiles(tmp_path / "out")
    assert fewer.items() < every.items(), "each as it would be, and not all"


def test_a_client_draws_the_same_where_measured_errors_are_greater(tmp_path: Path) -> None:
    """Than what squares are said to be wrong by: those above are known when they are made, those of
    instances from their plants. From afar the smallest squares are needed, then."""
    made = grown(tmp_path)
    wrong = [replace(one, error_m=np.full(len(one.levels), 12.0)) for one in made.species]
    made = replace(made, species=tuple(wrong))
    write_tiles(made, tmp_path / "full")
    seen = view(tmp_path, made, *CAMERAS["afar"])
    run, _ = viewed(made, seen, tmp_path / "out")
    same_everywhere(seen, tmp_path / "full", tmp_path / "out", 60)
    least = {file_of(node) for nodes in reached_by(made, seen) for node in nodes}
    assert not run.kept <= least, "more than by the errors that squares have at least"


def test_by_hand(full: Full, tmp_path: Path) -> None:
    """A square takes over from its quarters where it is as far away as it is wide, in pictures of
    1080 of 60 degrees. Eyes 436 to 456 m away are beyond 256 m: all that they are shown is the
    square of that size, on which all plants are. That of 512 m takes over beyond."""
    made, _ = full
    seen = view(tmp_path, made, *CAMERAS["afar"])
    run, _ = viewed(made, seen, tmp_path / "out")
    root = root_of(tmp_path / "out")
    sides = {row["side_m"]: row for row in run.left_out()}
    tree = made.tree
    away = 500 - SIDE / 2
    assert away - 10 > 256 and away + 20 < 512
    assert root["content"]["uri"] == file_of(tree.nodes(tree.depth - 5)[0])
    assert "children" not in root and root["geometricError"] == made.error_m(5)
    assert sides[512.0]["too_near"] == 1 and sides[512.0]["too_far"] == 0
    for side in (8.0, 16.0, 32.0, 64.0, 128.0):
        assert sides[side]["too_near"] == sides[side]["kept"] == 0
        assert sides[side]["plants"] == 304 and sides[side]["bytes"] > 0
    assert set(tiles(tmp_path / "out")) == {root["content"]["uri"]}
    names = sorted(path.name for path in (tmp_path / "out" / "tiles" / "shared").iterdir())
    assert names == ["sheet_5_color.png"], "neither models nor other sheets"


def test_viewers_that_may_be_anywhere_get_all_tiles(full: Full, tmp_path: Path) -> None:
    """On 10 km of ground, and as high as one likes: the tileset alone says so."""
    made, out = full
    corners = "[[-5e3, -5e3], [5e3, -5e3], [5e3, 5e3], [-5e3, 5e3]]"
    seen = view(tmp_path, made, f"polygon = {corners}")
    assert any("height_m" in note for note in seen.notes)
    run, _ = viewed(made, seen, tmp_path / "out")
    assert run.left_out() == []
    for name, data in files(out).items():
        if name.endswith((".glb", ".gltf", ".bin", ".png")):
            used = (tmp_path / "out" / name).exists()
            assert not used or (tmp_path / "out" / name).read_bytes() == data
            assert used or "shared" in name, "a level that no square shows"
    root, every = root_of(tmp_path / "out"), root_of(out)
    assert root["extras"].pop("scene")["plants"] == 304
    assert root == every


@pytest.mark.gl
def test_a_client_sees_the_same_picture(full: Full, tmp_path: Path) -> None:
    """To the bit, at eyes of the description."""
    made, out = full
    camera = "polygon = [[-30, 10], [-10, 10], [-10, 30]]\nheight_m = [1.5, 2]\n"
    seen = view(tmp_path, made, f"{camera}image_height_px = 96\n")
    viewed(made, seen, tmp_path / "out")
    assert tiles(tmp_path / "out").items() < tiles(out).items()
    eyes = inside(seen.viewers, 4, 2)
    pictures = []
    for folder in (out, tmp_path / "out"):
        forest = read_tile_world(folder / "tileset.json").scenery("alpha-test")
        for _ in forest.load():
            pass
        pictures.append(
            [
                forest.picture(Eye(place, float(yaw)), (128, 96))
                for place, yaw in zip(eyes.position, eyes.yaw_deg, strict=True)
            ]
        )
        forest.release()
    for whole, fewer in zip(*pictures, strict=True):
        assert whole[..., :3].std() > 0.01
        np.testing.assert_array_equal(whole, fewer)


@dataclass(frozen=True, eq=False)
class Behind:
    """A view of whose squares those are hidden that lie beyond an x, metres."""

    seen: SceneView
    beyond: float
    hills = True

    def __getattr__(self, name: str) -> Any:
        return getattr(self.seen, name)

    def hidden(self, boxes: np.ndarray) -> np.ndarray:
        return np.asarray(boxes[:, 0, 0] > self.beyond)


def test_what_is_hidden_is_left_out(full: Full, tmp_path: Path) -> None:
    """Of what a client draws, the squares behind are missing, and nothing else; those that are in
    part before the ground are there."""
    made, out = full
    seen = view(tmp_path, made, *CAMERAS["a lawn"])
    behind = Behind(seen, 20.0)
    run, _ = viewed(made, behind, tmp_path / "out")  # type: ignore[arg-type]
    gone = {file_of(node) for node in hidden_by_ground(made, behind)}  # type: ignore[arg-type]
    assert gone and all(
        (made.bounds(node)[0, 0] > 20) == (file_of(node) in gone)
        for level in (made.tree.depth, made.tree.depth - 1)
        for node in made.tree.nodes(level)
    )
    assert sum(row["hidden"] for row in run.left_out()) == len(gone)
    assert run.told()["plants"] == 304
    eyes = inside(seen.viewers, 60, 7)
    clients = Client(out), Client(tmp_path / "out")
    names = {Path(name).name for name in gone}
    assert run.skipped and not run.skipped & run.passed
    assert not [name for name in run.found if name in set(map(str, run.skipped))]
    missed = 0
    for place, yaw in zip(eyes.position, eyes.yaw_deg, strict=True):
        wanted, got = (client.draws(Eye(place, float(yaw)), (1440, 1080)) for client in clients)
        left = [one for one in wanted if one[0] not in names]
        missed += len(wanted) - len(left)
        assert left == got
    assert missed


def test_where_all_is_hidden_something_is_shown(full: Full, tmp_path: Path) -> None:
    seen = view(tmp_path, full[0], *CAMERAS["afar"])
    run, _ = viewed(full[0], Behind(seen, -1e9), tmp_path / "out")  # type: ignore[arg-type]
    assert run.kept


# ------------------------------------------------------------------------------------ once more


def test_the_same_again_makes_nothing_and_is_the_same(full: Full, tmp_path: Path) -> None:
    made, _ = full
    seen = view(tmp_path, made, *CAMERAS["a road"])
    viewed(made, seen, tmp_path / "out")
    before = files(tmp_path / "out")
    _, outcomes = viewed(made, seen, tmp_path / "out")
    assert not [one.entry.name for one in outcomes if one.again]
    assert files(tmp_path / "out") == before
    viewed(made, seen, tmp_path / "other")
    assert files(tmp_path / "other") == before


def test_another_camera_makes_what_it_needs_and_removes_the_rest(
    full: Full, tmp_path: Path
) -> None:
    """And all tiles without one: the bytes are those of a folder that is new."""
    made, out = full
    lawn, road = (view(tmp_path, made, *CAMERAS[name]) for name in ("a lawn", "a road"))
    first, _ = viewed(made, lawn, tmp_path / "out")
    second, outcomes = viewed(made, road, tmp_path / "out")
    again = {file for one in outcomes if one.again for file in one.entry.files}
    shown = second.kept - first.kept
    assert shown <= again and not again & first.kept & second.kept
    viewed(made, road, tmp_path / "new")
    assert tiles(tmp_path / "out") == tiles(tmp_path / "new")
    assert files(tmp_path / "out" / "tiles") == files(tmp_path / "new" / "tiles")
    write_tiles(made, tmp_path / "out")
    assert files(tmp_path / "out") == files(out)


def test_a_file_that_is_gone_is_made_again(full: Full, tmp_path: Path) -> None:
    made, _ = full
    seen = view(tmp_path, made, *CAMERAS["a road"])
    viewed(made, seen, tmp_path / "out")
    before = files(tmp_path / "out")
    for name in tiles(tmp_path / "out"):
        (tmp_path / "out" / name).unlink()
    viewed(made, seen, tmp_path / "out")
    assert files(tmp_path / "out") == before


@pytest.mark.gl
def test_squares_that_others_are_made_of_are_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A square that is clustered anew is as it would be of all; its quarters are made for it, and
    gone. When they are asked for later, or it is to be made anew, so are they."""
    made = grown(tmp_path, tile=32.0, near=1, triangles=200)
    kinds = {tile.node: tile.kind for tile in write_tiles(made, tmp_path / "full")}
    tree = made.tree
    (root,) = tree.nodes(1)
    assert kinds[root] == "reclustered", "256 m, of one of 128 m, of four of 64 m"
    seen = view(tmp_path, made, *CAMERAS["afar"])
    run, _ = viewed(made, seen, tmp_path / "out")
    every = tiles(tmp_path / "full")
    assert tiles(tmp_path / "out") == {file_of(root): every[file_of(root)]}
    assert {row["height"]: row["kept"] for row in run.left_out()}[1] == 0
    before = files(tmp_path / "out")
    _, outcomes = viewed(made, seen, tmp_path / "out")
    again = [one.entry.name for one in outcomes if one.again]
    assert not [name for name in again if "/" in name], "its quarters are not made anew"
    assert files(tmp_path / "out") == before
    (tmp_path / "out" / file_of(root)).unlink()
    viewed(made, seen, tmp_path / "out")
    assert files(tmp_path / "out") == before
    near = view(tmp_path, made, *CAMERAS["a drone"])
    viewed(made, near, tmp_path / "out")
    found = tiles(tmp_path / "out")
    assert found.items() < every.items() and len(found) > 4
    same_everywhere(near, tmp_path / "full", tmp_path / "out", 100)
    viewed(made, seen, tmp_path / "out")
    (tmp_path / "out" / file_of(root)).unlink()
    monkeypatch.setattr("vegtool.tiles.jobs.merged_tile", lambda *given: 1 / 0)
    run = ViewedRun(world(made, tmp_path / "out"), seen)
    list(run.tiles())
    assert {str(root), "3/0/0"} <= run.failed.keys(), "it, and what it is to be made of"


def landscape_of(folder: Path, rng: np.random.Generator, surfels: bool, error: float) -> TileEntry:
    """A quadtree of 64 squares of 16 m, the smallest, whose errors are anything from a tenth to all
    of `error` times their side; some are missing. The files are there, and of no other use."""
    (folder / "tiles").mkdir(parents=True)

    def of(level: int, column: int, row: int) -> TileEntry:
        side = 128.0 / 2**level
        low = np.array([column * side - 64, 0.0, row * side - 64])
        below = [
            of(level + 1, 2 * column + x, 2 * row + z)
            for x in (0, 1) for z in (0, 1) if level < 3 and rng.random() < 0.9
        ]  # fmt: skip
        bounds = np.stack([low, low + np.array([side, 5.0, side])])
        origin = bounds.mean(axis=0)
        if below:
            corners = np.stack([bounds, *(child.bounds for child in below)])
            bounds = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
        uri = f"tiles/{level}_{column}_{row}.glb"
        (folder / uri).write_bytes(plant_glb(cards(np.zeros((1, 3)), 1.0)))
        own = error * side * rng.uniform(0.1, 1)
        wrong = max([own, *(1.001 * child.error_m for child in below)])
        many = 100 if surfels and level < 3 else 0
        return TileEntry(uri, origin, bounds, wrong, 1, (0.0, 0.0), tuple(below), many)

    return of(0, 0, 0)


@pytest.mark.parametrize("surfels", [False, True])
@pytest.mark.parametrize("name, error", [("a lawn", 0.02), ("afar", 0.3)])
def test_whatever_the_errors_are(
    name: str, error: float, surfels: bool, full: Full, tmp_path: Path
) -> None:
    """Clients show surfels and their quarters together, a fifth of the way before they have to."""
    seen = view(tmp_path, full[0], *CAMERAS[name])
    rng = generator(5, f"{name} {surfels}")
    root = landscape_of(tmp_path, rng, surfels, error)
    for part in ("", "fewer/"):
        (tmp_path / part).mkdir(exist_ok=True)
        shown = pruned(root, seen) if part else root
        for file, data in tileset_files(shown, None).items():
            (tmp_path / part / file).write_bytes(data)
    (tmp_path / "fewer" / "tiles").symlink_to(tmp_path / "tiles")
    same_everywhere(seen, tmp_path, tmp_path / "fewer", 200)
    assert contents_of(pruned(root, seen)) < contents_of(root)


# ---------------------------------------------------------------------------------------- bounds


@pytest.mark.parametrize("name", CAMERAS)
def test_no_eye_is_farther_from_a_box(name: str, full: Full, tmp_path: Path) -> None:
    """And of the best of many eyes not by much: on flat ground, by what an area's corners are."""
    seen = view(tmp_path, full[0], *CAMERAS[name])
    rng = generator(1, "boxes")
    low = rng.uniform(-200, 200, (40, 3)) * [1, 0.1, 1]
    boxes = np.stack([low, low + rng.uniform(0, 100, (40, 3))], axis=1)
    bound = farthest_from_boxes(seen.viewers, boxes)
    eyes = inside(seen.viewers, 4000, 1).position[:, None]
    away = np.linalg.norm(np.maximum(np.maximum(low - eyes, eyes - boxes[:, 1]), 0.0), axis=2)
    assert (away.max(axis=0) <= bound + 1e-9).all()
    assert (bound <= 1.05 * away.max(axis=0) + 3.0).all()


def test_squares_that_are_passed_over_hold_no_others(full: Full, tmp_path: Path) -> None:
    """Whoever is so near to a square is so to those that it lies on."""
    made, _ = full
    passed = passed_over(made, view(tmp_path, made, *CAMERAS["a lawn"]))
    assert passed and all(one.level == 0 or one.parent in passed for one in passed)
    focal = Display().pixels_per_metre(1.0)
    for node in passed:
        error = made.error_m(made.tree.height(node.level))
        assert error * focal / np.hypot(SIDE, SIDE) > 0 and error * focal > CLIENT_PX


# ---------------------------------------------------------------------------------------- texels


def textured(size: int, texels: int) -> Any:
    """A card of that many metres with a picture."""
    pixels = generator(0, "pixels").integers(0, 255, (texels, texels, 4), dtype=np.uint8)
    material = Material("leaf", color_texture=Texture("leaf", pixels))
    return cards(np.zeros((1, 3)), size / 2, material)


def test_texels_are_as_large_as_pixels_at_most() -> None:
    """64 texels on a metre: 16 are seen of 16 pixels, also where it is a few pixels more; as many
    as there are of 64; and no fewer than 4."""
    plant = textured(1, 64)
    assert texels_per_metre(plant, plant.faces, 64, 64) == pytest.approx(64)
    for pixels, left in ((16.0, 16), (17.0, 32), (31.0, 32), (64.0, 64), (1e3, 64), (0.0, 4)):
        image = resolved(plant, pixels).materials[0].color_texture
        assert image is not None and image.pixels.shape[:2] == (left, left), pixels
    assert resolved(plant, float("inf")) is plant


def test_texels_count_where_they_are_stretched_most() -> None:
    """A card of a metre by four: 64 texels along the longer side are 16 to a metre."""
    plant = textured(1, 64)
    wide = replace(plant, positions=plant.positions * np.array([4.0, 1.0, 1.0]))
    extent = np.ptp(wide.positions, axis=0)
    assert extent[0] == pytest.approx(4)
    assert texels_per_metre(wide, wide.faces, 64, 64) == pytest.approx(16)
    image = resolved(wide, 16.0).materials[0].color_texture
    assert image is not None and image.pixels.shape == (64, 64, 4)


# --------------------------------------------------------------------------------- what is wrong


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    def said(scene: str, *more: str) -> str:
        grown(tmp_path)
        (tmp_path / "view.toml").write_text(scene)
        arguments = [str(tmp_path / "scene.toml"), "--species", str(tmp_path / "library")]
        out = ["-o", str(tmp_path / "out"), "--scene", str(tmp_path / "view.toml"), "--jobs", "1"]
        assert main(["tiles", *arguments, *out, *more]) == 2
        assert not (tmp_path / "out").exists()
        return capsys.readouterr().err.replace("\n", " ")

    return said


def test_a_scene_elsewhere_is_refused(refused: Callable[..., str]) -> None:
    text = refused("[terrain]\norigin = [5e5, 5e6]\ncrs = 'EPSG:25832'\nextent_m = [9, 9]\n")
    assert "view.toml, line 2" in text and "the scene itself" in text


def test_one_tile_alone_is_refused(refused: Callable[..., str]) -> None:
    text = refused("[camera]\npolygon = [[0, 0], [9, 0], [9, 9]]\n", "--only", "0/0/0")
    assert "--scene" in text


def test_what_is_left_out_is_said(
    full: Full, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To people, and to machines; also before anything is made."""
    grown(tmp_path)
    (tmp_path / "view.toml").write_text(f"[camera]\n{CAMERAS['a lawn'][0]}")
    sources = [str(tmp_path / "scene.toml"), "--species", str(tmp_path / "library")]
    options = ["--tile", "8", "--near", "2", "--jobs", "1"]
    out = ["-o", str(tmp_path / "out"), "--scene", str(tmp_path / "view.toml")]
    assert main(["tiles", *sources, *out, *options, "--json", "--dry-run"]) == 0
    planned = json.loads(capsys.readouterr().out)
    assert main(["tiles", *sources, *out, *options, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["scene"] == root_of(tmp_path / "out")["extras"]["scene"]
    assert facts["plants"] == 304
    for row in facts["scene"]["left_out"]:
        (level,) = (one for one in planned["levels"] if one["height"] == row["height"])
        assert (level["tiles"], level["too_near"]) == (row["kept"], row["too_near"])
        assert row["squares"] == sum(row[k] for k in ("kept", "too_near", "hidden", "too_far"))
    assert main(["tiles", *sources, *out, *options]) == 0
    assert "eyes too far" in capsys.readouterr().out


def test_a_plant_has_no_viewers(tmp_path: Path) -> None:
    from vegtool.tiles.command import run_tiles
    from vegtool.tiles.options import RunOptions

    with pytest.raises(UsageError, match="one plant"):
        run_tiles(
            tmp_path / "oak.surfels", None, tmp_path, TileOptions(), RunOptions(),
            lambda title: None, lambda text: None, lambda placement: None,
        )  # type: ignore[arg-type,return-value]  # fmt: skip
