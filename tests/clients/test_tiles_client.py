"""A landscape of tiles in a client of others: 3d-tiles-renderer, with three.js, over HTTP.

It flies in, from far above to between the plants, with the error that clients have unless told
otherwise. Which tiles it draws is compared with our own choice (preview/tile_forest.py), and its
pictures with our own renderer's, of the same tiles under the same light.

Chromium's rasteriser puts vertices on a grid of 1/16 pixel (see test_agreement.py), and samples
pixels elsewhere than Mesa's does. What is a few pixels large is then covered otherwise: of one and
the same tile, from above, 13 % less where its trees are about ten pixels wide, 7 % less in a
picture of twice the size, and 1 % in one of four times.
"""

from __future__ import annotations

import posixpath
import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cards import cards
from programs import MARKS, node
from scipy.optimize import linprog
from shared_models import shared_model

from vegtool.arrays import FloatArray, Picture
from vegtool.cli import run
from vegtool.convert import ConvertOptions, convert
from vegtool.formats.gltf import write_chain
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.gltf_tile import INSTANCING, Instances, instanced_glb
from vegtool.formats.tileset import CLIENT_PX, TILESET, TileEntry, tileset_files
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.metrics import reference, score
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Material
from vegtool.preview.eye import Eye, towards
from vegtool.preview.scenery import Look
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tileset import Tileset, read_tileset
from vegtool.seeding import generator

pytestmark = MARKS

SIDE, COUNT = 128.0, 40
"""Metres of ground, and how many plants stand on it."""
SPECIES = {"conifer": (1000, 12.0, 16.0), "bush": (400, 3.0, 6.0)}
"""Faces, and the least and the greatest height, metres."""
PIXELS = 128.0
"""Of a plant, for which its first level is made. With more, tiles would need more memory for their
textures than the client allows itself: it keeps those of every tile for itself."""
MADE = ["--tile", "16", "--near", "1", "--triangles", "1000"]
"""Four levels of tiles: instances, two of merged ones, and one of too many plants for that, as are
those above the landscape."""
LANDSCAPE = 2
"""Level, from the root on, of the square that the landscape fills."""
MOST = 32e6
"""Bytes that a client may allow itself on a telephone. Seen from near, the landscape needs 90 MB
of one that keeps pictures for every tile, and 12 MB of one whose tiles share them."""
WIDTH, HEIGHT = 960, 540
DETAIL = Display().image_height_px / HEIGHT
"""A picture of half the height has to have the tiles of the whole."""
LIGHT = Light()
AGREES, NEARER = 0.02, 0.65
"""FLIP: as of test_agreement.py; and of that of a picture one pixel away, which tells something of
pictures that are mostly empty, too. Measured 0.0036 to 0.0114, and 0.41 to 0.49."""
COVERS, BRIGHT = 0.06, 0.03
"""Of the client's coverage, measured -0.042 to 0.032; of its light, measured 0.005 to 0.018."""
KNOWN = "TilesRenderer: tiles versions at 1.1 or higher have limited support."
"""What the client says of every tileset of 3D Tiles 1.1."""
STATIONS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "far above": ((2.0, 240.0, 2.0), (0.0, 0.0, 0.0)),
    "far": ((20.0, 30.0, 150.0), (0.0, 5.0, 0.0)),
    "middle": ((-25.0, 16.0, 100.0), (0.0, 5.0, 0.0)),
    "near": ((30.0, 6.0, 72.0), (12.0, 4.0, 0.0)),
    "inside": ((-20.0, 1.7, -10.0), (40.0, 4.0, 20.0)),
}
"""Where the eye is and what it looks at: metres from the middle of the ground, y up."""
INFOS = {"UNSUPPORTED_EXTENSION", "UNUSED_OBJECT", "URI_GLB", "IMAGE_NPOT_DIMENSIONS"}
"""What the validator has to say: that it does not know EXT_mesh_gpu_instancing, and so takes what
only that refers to for unused; that files are beside a .glb; and of sheets' sides."""
TINTS = np.array([[1.0, 0.2, 0.1], [0.1, 1.0, 0.3], [0.2, 0.1, 1.0]], np.float32)


@dataclass(frozen=True, eq=False)
class Visit:
    """What the client made of a folder. answer: of fly_over_tiles.mjs. eyes, pictures: by
    station."""

    folder: Path
    eyes: dict[str, Eye]
    answer: dict[str, Any]
    pictures: dict[str, Picture]

    @property
    def stations(self) -> dict[str, dict[str, Any]]:
        return dict(zip(self.eyes, self.answer["stations"], strict=True))


@pytest.fixture(scope="session")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A landscape of two species, made by the command line."""
    folder = tmp_path_factory.mktemp("landscape")
    options = ConvertOptions(refine="none", billboards=24, levels=3, pixels=PIXELS)
    for name, (faces, _, _) in SPECIES.items():
        chain = convert(sample(name, faces), options, MeasureOptions("off"))
        write_chain(chain, folder / "library")
    rng = generator(0, "landscape")
    rows = ["x,y,species,height"]
    for index in range(COUNT):  # as many on each quarter of the ground
        x, y = SIDE / 2 * (np.array(divmod(index % 4, 2)) + rng.uniform(0, 1, 2))
        name = sorted(SPECIES)[index // 4 % len(SPECIES)]
        rows.append(f"{x:.2f},{y:.2f},{name},{rng.uniform(*SPECIES[name][1:]):.2f}")
    (folder / "plants.csv").write_text("\n".join(rows))
    made = str(folder / "tiles")
    arguments = ["--species", str(folder / "library"), "-o", made, "-q", *MADE]
    assert run(["tiles", str(folder / "plants.csv"), *arguments]) == 0
    return folder / "tiles"


@pytest.fixture(scope="session")
def visits(tiles: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Visit]:
    """The landscape, without one of its tiles, with little memory, and with little memory and
    shared textures; and tinted cards: in one browser."""
    folder = tmp_path_factory.mktemp("visits")
    shutil.copytree(tiles, folder / "broken")
    tinted(folder / "tinted")
    eyes = {name: eye(tiles, *places) for name, places in STATIONS.items()}
    missing(folder / "broken", eyes["inside"]).unlink()
    fewer = {name: eyes[name] for name in ("near", "far above", "inside")}
    wanted = {
        "landscape": (tiles, eyes, {}),
        "broken": (folder / "broken", {"inside": eyes["inside"]}, {}),
        "narrow": (tiles, fewer, {"most": MOST}),
        "shared": (tiles, fewer, {"most": MOST, "shares": True}),
        "tinted": (folder / "tinted", {"before": Eye(np.array([0.0, 0.0, 3.0]))}, {}),
    }
    jobs, outs = [], {}
    for name, (path, seen, client) in wanted.items():
        outs[name] = {station: folder / f"{name} {station}" for station in seen}
        stations = [as_three(one, outs[name][station]) for station, one in seen.items()]
        jobs.append({"folder": str(path), "stations": stations, **client})
    job = {
        "width": WIDTH, "height": HEIGHT, "error": CLIENT_PX / DETAIL, "visits": jobs,
        "light": {"sun": LIGHT.sun, "above": LIGHT.sky_above, "below": LIGHT.sky_below},
    }  # fmt: skip
    found = {}
    for (name, (path, seen, _)), answer in zip(
        wanted.items(), node("fly_over_tiles.mjs", job), strict=True
    ):
        pictures = {station: picture_in(out) for station, out in outs[name].items()}
        found[name] = Visit(path, seen, answer, pictures)
    return found


@pytest.fixture(scope="session")
def landscape(visits: dict[str, Visit]) -> Visit:
    return visits["landscape"]


@pytest.fixture(scope="session")
def forest(tiles: Path) -> Iterator[TileForest]:
    """The landscape on our own GPU."""
    with TileForest(read_tileset(tiles / "tileset.json")) as made:
        for _ in made.load():
            pass
        yield made


def eye(folder: Path, at: tuple[float, ...], target: tuple[float, ...]) -> Eye:
    middle = np.array([SIDE / 2, 0.0, -SIDE / 2])
    yaw, pitch = towards(np.subtract(target, at))
    return Eye(middle + at, yaw, pitch)


def as_three(eye: Eye, out: Path) -> dict[str, Any]:
    return {
        "eye": eye.position.tolist(), "target": (eye.position + eye.forward).tolist(),
        "fov": eye.fov_y_deg, "near": eye.near_m, "far": eye.far_m,
        "sun": LIGHT.direction.tolist(), "out": str(out),
    }  # fmt: skip


def picture_in(out: Path) -> Picture:
    half = np.frombuffer(out.read_bytes(), np.float16).reshape(HEIGHT, WIDTH, 4)
    return np.ascontiguousarray(half[::-1], np.float32)


def chosen(tileset: Tileset, eye: Eye) -> list[int]:
    """The tiles that we draw."""
    return TileForest(tileset).choose(eye, (WIDTH, HEIGHT), Look(detail=DETAIL))


def missing(folder: Path, eye: Eye) -> Path:
    """The last one of the tiles that are drawn: a small one, far away."""
    tileset = read_tileset(folder / "tileset.json")
    return files_of(tileset)[chosen(tileset, eye)[-1]]


def files_of(tileset: Tileset) -> list[Path]:
    """Of its tiles, all of which have content."""
    return [Path(file or "") for file in tileset.file]


def tinted(folder: Path) -> None:
    """Instances of a white card beside each other, in a tileset that another one refers to."""
    material = Material("white", [1, 1, 1, 1], double_sided=True, role="leaf")
    card = cards(np.zeros((1, 3)), 0.4, material, np.array([[0.0, 0.0, 1.0]]))
    model = shared_model(card, "card", "shared/")
    (folder / "inner" / "shared").mkdir(parents=True)
    for name, data in model.files.items():
        (folder / "inner" / "shared" / name).write_bytes(data)
    places = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    instances = Instances(model, places, np.zeros(3), np.ones(3), TINTS)
    (folder / "inner" / "cards.glb").write_bytes(instanced_glb([instances], "cards"))
    bounds = np.array([[-2.0, -1, -1], [2, 1, 1]])
    for file, content, error in (
        (folder / "inner" / "inner.json", "cards.glb", 0.0),
        (folder / TILESET, "inner/inner.json", 1.0),
    ):
        root = TileEntry(content, np.zeros(3), bounds, error)
        file.write_bytes(tileset_files(root, None)[TILESET])


def draws(file: Path) -> int:
    """Calls that a tile takes: a primitive each, however many instances it has."""
    values = open_gltf(file).json
    meshes = [values["meshes"][node["mesh"]] for node in values["nodes"] if "mesh" in node]
    return sum(len(mesh["primitives"]) for mesh in meshes)


def kind(file: Path) -> str:
    """How a tile was made, by what is in it."""
    values = open_gltf(file).json
    if INSTANCING in values.get("extensionsUsed", []):
        return "instances"
    return "merged" if any("uri" in one for one in values.get("images", [])) else "reclustered"


def shared_by(file: Path) -> set[str]:
    """The files beside it that a tile refers to."""
    values = open_gltf(file).json
    parts = [*values.get("buffers", []), *values.get("images", [])]
    return {one["uri"] for one in parts if "uri" in one}


def sees(eye: Eye, low: FloatArray, high: FloatArray) -> bool:
    """Whether any point of a box is in the picture."""
    planes = eye.planes(WIDTH, HEIGHT)
    bounds = np.stack([low - eye.position, high - eye.position], axis=1)
    found = linprog(np.zeros(3), -planes[:, :3], planes[:, 3], bounds=bounds)
    return bool(found.status == 0)


# ------------------------------------------------------------------------------------- the client


def test_nothing_fails_on_the_way(landscape: Visit) -> None:
    answer = landscape.answer
    assert answer["failed"] == []
    assert [line for line in answer["complaints"] if not line.startswith(KNOWN)] == []
    assert [station["refused"] for station in answer["stations"]] == [0] * len(STATIONS)


@pytest.mark.parametrize("station", STATIONS)
def test_the_client_draws_the_tiles_that_we_do(landscape: Visit, station: str) -> None:
    """Both go by the distance to a tile's box, and to an eye within it every error is too large.

    Of tiles outside of the picture we keep those that no single side of the view has on its outer
    side. The client then tries the sides of the box too, so some near a corner of the view may be
    there for us and not for it: not a pixel of those is in the picture, and either is right.
    """
    tileset, eye = read_tileset(landscape.folder / "tileset.json"), landscape.eyes[station]
    numbers = {file: number for number, file in enumerate(files_of(tileset))}
    drawn = {numbers[landscape.folder / name] for name in landscape.stations[station]["drawn"]}
    ours = set(chosen(tileset, eye))
    assert drawn and not drawn - ours
    assert not [tile for tile in ours - drawn if sees(eye, tileset.low[tile], tileset.high[tile])]


def test_all_kinds_of_tiles_are_seen_on_the_way(landscape: Visit) -> None:
    """One alone from afar, the smallest between the plants. Those above the landscape are for eyes
    that are farther away."""
    tileset = read_tileset(landscape.folder / "tileset.json")
    seen = {
        name: {landscape.folder / file for file in station["drawn"]}
        for name, station in landscape.stations.items()
    }
    assert seen["far above"] == {files_of(tileset)[LANDSCAPE]}
    kinds = {name: {kind(file) for file in files} for name, files in seen.items()}
    assert kinds["far above"] == {"reclustered"}
    assert "merged" in kinds["far"]
    assert kinds["near"] == {"instances", "merged"}
    depths = [int(depth) for file, depth in zip(files_of(tileset), tileset.depth, strict=True)
              if file in set.union(*seen.values())]  # fmt: skip
    assert set(depths) == {LANDSCAPE + level for level in range(4)}


@pytest.mark.parametrize("station", STATIONS)
def test_the_pictures_are_ours(landscape: Visit, forest: TileForest, station: str) -> None:
    """To much less than a pixel: one pixel lower, ours would be much farther from the client's."""
    theirs = landscape.pictures[station]
    look = Look(light=LIGHT, detail=DETAIL)
    ours = forest.picture(landscape.eyes[station], (WIDTH, HEIGHT), look)
    truth = reference(theirs)
    found, moved = score(truth, ours), score(truth, np.roll(ours, 1, axis=0))
    assert found["flip"] <= min(AGREES, NEARER * moved["flip"]), (found, moved)
    assert abs(found["coverage_bias"]) <= COVERS, found
    assert abs(found["color_bias"]) <= BRIGHT, found


def test_a_merged_tile_is_one_draw_call(landscape: Visit) -> None:
    for name, station in landscape.stations.items():
        calls = {landscape.folder / file: draws(landscape.folder / file)
                 for file in station["drawn"]}  # fmt: skip
        assert station["calls"] == sum(calls.values()), name
        assert not [file for file, n in calls.items() if n != 1 and kind(file) != "instances"]


def test_what_tiles_share_is_loaded_once(landscape: Visit) -> None:
    asked = landscape.answer["asked"]
    assert set(asked.values()) == {1}
    tiles = [file for file in asked if file.endswith(".glb")]
    uses = Counter(
        posixpath.normpath(posixpath.join(posixpath.dirname(file), uri))
        for file in tiles
        for uri in shared_by(landscape.folder / file)
    )
    assert set(asked) == {"tileset.json", *tiles, *uses}
    assert max(uses.values()) > 1 and uses.total() > 2 * len(uses)


def test_a_client_with_little_memory_stays_coarse(visits: dict[str, Visit]) -> None:
    """Without a word: tiles are refused, of which it draws those that they are on."""
    narrow, landscape = visits["narrow"], visits["landscape"]
    assert narrow.answer["failed"] == []
    for name in ("near", "inside"):
        assert narrow.stations[name]["refused"] > 0
        assert len(narrow.stations[name]["drawn"]) < len(landscape.stations[name]["drawn"])


def test_with_shared_textures_it_does_not(visits: dict[str, Visit]) -> None:
    """The plugin of docs/clients: pictures are the same, to the bit, after tiles have gone whose
    textures others had, and have come again."""
    shared, landscape = visits["shared"], visits["landscape"]
    assert shared.answer["failed"] == []
    assert [line for line in shared.answer["complaints"] if not line.startswith(KNOWN)] == []
    for name, station in shared.stations.items():
        assert station["refused"] == 0 and station["bytes"] < MOST
        assert station["drawn"] == landscape.stations[name]["drawn"]
        np.testing.assert_array_equal(shared.pictures[name], landscape.pictures[name])


def test_shared_textures_go_with_the_last_tile_that_draws_them(visits: dict[str, Visit]) -> None:
    """Of each file there is one at most on the GPU. From far above, one tile is left, and that has
    its own."""
    shared = visits["shared"]
    tiles = [shared.folder / file for file in shared.answer["asked"] if file.endswith(".glb")]
    pictures = {uri for tile in tiles for uri in shared_by(tile) if uri.endswith(".png")}
    own = sum(len(open_gltf(tile).json["images"]) for tile in tiles if kind(tile) == "reclustered")
    near, above, inside = (shared.stations[name] for name in ("near", "far above", "inside"))
    assert near["textures"] <= len(pictures) + own
    assert above["textures"] < min(near["textures"], inside["textures"])
    assert above["bytes"] < min(near["bytes"], inside["bytes"])


def test_instances_have_colours_of_their_own(visits: dict[str, Visit]) -> None:
    """_COLOR_0 of EXT_mesh_gpu_instancing: cards under one light are as bright as their tints."""
    visit = visits["tinted"]
    assert visit.answer["failed"] == []
    assert visit.stations["before"]["drawn"] == ["inner/cards.glb"]
    picture = visit.pictures["before"]
    metre = visit.eyes["before"].focal_px(HEIGHT) / 3
    columns = [round(WIDTH / 2 + x * metre) for x in (-1, 0, 1)]
    light = picture[HEIGHT // 2, columns, :3] / TINTS
    assert light.min() > 0.1
    assert np.ptp(light) < 0.01 * light.mean()


def test_a_tile_that_is_missing_is_noticed(visits: dict[str, Visit], tiles: Path) -> None:
    """And leaves a gap, which nothing else fills."""
    visit = visits["broken"]
    whole_tileset = read_tileset(tiles / "tileset.json")
    files = [file.relative_to(tiles) for file in files_of(whole_tileset)]
    (gone,) = (file.as_posix() for file in files if not (visit.folder / file).exists())
    ((file, message),) = visit.answer["failed"]
    assert file == gone and "404" in message
    assert any(gone in line for line in visit.answer["complaints"])
    whole = set(visits["landscape"].stations["inside"]["drawn"])
    assert set(visit.stations["inside"]["drawn"]) == whole - {gone}


# ---------------------------------------------------------------------------------- the validator


def test_the_validator_finds_no_error_and_no_warning_in_tiles(tiles: Path) -> None:
    """What they share is found beside them."""
    files = sorted(path for path in tiles.rglob("*") if path.suffix in (".glb", ".gltf"))
    answers = node("validate.mjs", {"files": [str(file) for file in files], "alone": False})
    assert len(answers) == len(files) and {file.suffix for file in files} == {".glb", ".gltf"}
    for answer in answers:
        bad = [m for m in answer["messages"] if m["severity"] < 2]  # 0 error, 1 warning
        assert not bad, (answer["file"], bad[:5])
        assert answer["errors"] == answer["warnings"] == 0
    assert {m["code"] for answer in answers for m in answer["messages"]} <= INFOS
