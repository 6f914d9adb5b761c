"""The scene file: what is read, what is refused and where, and what it changes in `convert`."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from vegtool import scene as rules
from vegtool.cli import run
from vegtool.convert import ConvertOptions
from vegtool.errors import UsageError
from vegtool.formats.gltf import plant_glb
from vegtool.formats.manifest import read_manifest
from vegtool.growth import sample
from vegtool.lighting.light import Sun
from vegtool.scene import (
    SCHEMA,
    Camera,
    PlacementTable,
    SpeciesTable,
    SunLight,
    TerrainTable,
    read_scene,
    unused,
    with_scene,
)

PAGE = Path(__file__).parent.parent / "docs" / "scene.md"
WHOLE = """\
# a valley
[camera]
path = "flight.csv"
polygon = [
    [0, 0],  # the barn
    [100, 0],
    [100, 50.5],
]
height_m = [1.5, 40]
fov_y_deg = 50
image_height_px = 1440
above = true
margin_m = 2.5

[light]
moves = false
sun = [-90, 35]

[terrain]
kind = "heightmap"
heightmap = "valley.tif"
extent_m = [2000, 1500]
crs = "EPSG:25832"
origin = [565_000, 5_930_000]
height_m = [-3, 710]

[[species]]
name = "ash"
model = "ash.glb"
share = 0.5
height_m = [4, 18]
slope_deg = [0, 30]
elevation_m = [0, 600]
density = "ash.png"
aliases = ["Esche", "Fraxinus excelsior"]

[[species]]
name = "pine"
model = "pine.glb"

[placement]
seed = 4
spacing_m = 3
inventory = "trees.csv"
units = { height = "cm" }

[placement.columns]
x = "easting"
y = "northing"

[budget]
bytes = 500_000_000
triangles = 2_000_000
frame_ms = 8.3
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(folder: Path, text: str) -> str:
    """What is said of a scene that is refused, less its folder."""
    with pytest.raises(UsageError) as caught:
        read_scene(written(folder, text))
    return str(caught.value).replace(str(folder / "scene.toml"), "FILE")


def test_a_whole_scene_is_read(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, WHOLE))
    corners = ((0, 0), (100, 0), (100, 50.5))
    assert scene.camera == Camera("flight.csv", corners, (1.5, 40), 50, 1440, True, 2.5)
    assert scene.light == SunLight(False, Sun(270.0, 35.0))
    assert scene.terrain == TerrainTable(
        "heightmap", "valley.tif", (2000, 1500), "EPSG:25832", (565_000, 5_930_000), (-3, 710)
    )
    names = ("Esche", "Fraxinus excelsior")
    ash = SpeciesTable("ash", "ash.glb", 0.5, (4, 18), (0, 30), (0, 600), "ash.png", names)
    assert scene.species == (ash, SpeciesTable("pine", "pine.glb"))
    columns, units = {"x": "easting", "y": "northing"}, {"height": "cm"}
    assert scene.placement == PlacementTable(4, 3, "trees.csv", columns, units)
    assert scene.budget == {"bytes": 500_000_000, "triangles": 2_000_000, "frame_ms": 8.3}


def test_the_whole_scene_names_every_key(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, WHOLE))
    named = {(place[0], place[-1]) for place in scene.lines}
    assert {(table, key) for table, keys in SCHEMA.items() for key in keys} <= named
    for table, kind in (
        ("camera", Camera),
        ("light", SunLight),
        ("terrain", TerrainTable),
        ("species", SpeciesTable),
        ("placement", PlacementTable),
    ):
        assert {item.name for item in fields(kind)} == set(SCHEMA[table])


def test_an_empty_scene_says_nothing(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "# nothing yet\n"))
    assert (scene.camera, scene.light, unused(scene, ConvertOptions())) == (Camera(), None, [])
    assert (scene.terrain, scene.species, scene.placement) == (
        TerrainTable(),
        (),
        PlacementTable(),
    )
    assert with_scene(ConvertOptions(), scene) == ConvertOptions()


def test_places_are_the_lines_that_a_person_sees(tmp_path: Path) -> None:
    """Whatever way TOML has of writing a key; in a list of tables, of the very one."""
    scene = read_scene(written(tmp_path, WHOLE))
    line = dict(enumerate(WHOLE.splitlines(), start=1))
    for place, key in (
        (("camera", "polygon"), "polygon"),
        (("light",), "[light]"),
        (("species", 1, "model"), 'model = "pine.glb"'),
        (("placement", "columns", "y"), "y ="),
        (("budget", "frame_ms"), "frame_ms"),
    ):
        assert line[scene.lines[place]].startswith(key)
    text = (
        'terrain = { kind = "plane", height_m = [0, 1] }\n'
        'budget."bytes" = 5\n'
        'placement.inventory = """\n[light]\nmoves = 3\n"""\n'
        "camera.above = true\r\n"
    )
    scene = read_scene(written(tmp_path, text))
    assert scene.at("terrain", "height_m").endswith("line 1")
    assert scene.at("budget", "bytes").endswith("line 2")
    assert scene.at("placement", "inventory").endswith("line 3")
    assert scene.at("camera", "above").endswith("line 7")
    assert scene.at("light", "moves") == str(scene.path), "not there"


def test_each_statement_is_parsed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However its lines end: the whole file, and each part of it, so that time grows as its length.

    Brackets, quotes and hashes in strings and comments end nothing.
    """
    corners = "".join(f"  [{i}, {i * i}]  # corner ]{i}, 'north\n  , # \"[\n" for i in range(2_500))
    text = (
        f'[camera] # ]\npath = "a ] # \\" b"\npolygon = [\n{corners}]\nabove = true\n'
        "[placement]\ninventory = '''\n]\"\n''''\n"
        'columns.\'x]\' = """\n{\\""\n""""\nseed = 3'
    )
    lengths: list[int] = []
    loads = tomllib.loads

    def counted(text: str) -> dict[str, Any]:
        lengths.append(len(text))
        return loads(text)

    monkeypatch.setattr("vegtool.scene.tomllib.loads", counted)
    scene = read_scene(written(tmp_path, text))
    assert len(lengths) == 1 + 8
    assert sum(lengths) <= 2 * len(text) + 1
    assert len(scene.camera.polygon) == 2_500
    lines = text.split("\n")
    for place in (("camera", "polygon"), ("camera", "above"), ("placement", "seed")):
        number = int(scene.at(*place).split("line ")[1])
        assert lines[number - 1].startswith(place[-1])


def test_a_long_list_is_read_in_no_time(tmp_path: Path) -> None:
    """Its lines are not each tried as the end of it: a minute's work, at this length."""
    corners = "\n".join(f"  [{i}, {i % 7}]," for i in range(20_000))
    scene = read_scene(written(tmp_path, f"[camera]\npolygon = [\n{corners}\n]\nabove = true"))
    assert len(scene.camera.polygon) == 20_000
    assert scene.at("camera", "above").endswith("line 20004")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[weather]\nrain = 1", "FILE, line 1: no table is called 'weather'; known: [camera], "),
        ("\nfov_y_deg = 1", "FILE, line 2: no table is called 'fov_y_deg'"),
        ("[camera]\n\nfov = 50", "FILE, line 3: no key of [camera] is called 'fov'; known: path"),
        (
            '[[species]]\nname = "a"\n[[species]]\nnom = "b"',
            "FILE, line 4: no key of [[species]] is called 'nom'",
        ),
        ("camera = 3", "FILE, line 1: expected a table [camera]"),
        ("[[light]]\nmoves = true", "FILE, line 1: expected a table [light]"),
        ("[species]\nname = 'a'", "FILE, line 1: expected a table [[species]]"),
        ("species = [1]", "FILE, line 1: expected a table [[species]]"),
        ("[light]\nsun = [1, 2]", "FILE, line 1: expected moves in [light], true or false; got no"),
        ("[light]\nmoves = 'no'", "FILE, line 2: moves: expected true or false; got 'no'"),
        (
            "[light]\nmoves = false\nsun = 40",
            "FILE, line 3: sun: expected two numbers, [a, b]; got 40",
        ),
        (
            "[light]\nmoves = false\nsun = [40, 91]",
            "FILE, line 3: sun: expected an azimuth and an elevation from -90 to 90 degrees; got",
        ),
        ("[camera]\nfov_y_deg = true", "line 2: fov_y_deg: expected a number; got true"),
        ("[camera]\nfov_y_deg = nan", "line 2: fov_y_deg: expected a number; got nan"),
        ("[camera]\nfov_y_deg = 171", "line 2: fov_y_deg: expected at most 170; got 171"),
        ("[camera]\nimage_height_px = 9.5", "image_height_px: expected a whole number; got 9.5"),
        ("[camera]\nimage_height_px = 9", "image_height_px: expected at least 16; got 9"),
        ("[camera]\npath = ''", "path: expected text in quotes; got ''"),
        ("[camera]\nheight_m = [3, 2]", "height_m: expected two numbers, [low, high]; got [3, 2]"),
        ("[camera]\npolygon = [[0, 1]]", "polygon: expected three points at least that are not"),
        ("[camera]\npolygon = [[0, 1], [2, 3]]", "line 2: polygon: expected three points at least"),
        ("[camera]\npolygon = []", "line 2: polygon: expected three points at least"),
        (
            "[camera]\npolygon = [[0, 1], [2, 3], [0, 1], [2, 3]]",
            "line 2: polygon: expected three points at least that are not on one line",
        ),
        (
            "[camera]\npolygon = [[0.1, 0.1], [0.2, 0.2], [0.7, 0.7]]",
            "line 2: polygon: expected three points at least that are not on one line",
        ),
        ("[camera]\nabove = {}", "above: expected true or false; got a table"),
        ("[terrain]\nkind = 'hill'", "kind: expected one of none, plane, heightmap; got hill"),
        ("[terrain]\nextent_m = [0, 5]", "line 2: extent_m: expected more than 0; got 0"),
        ("[terrain]\nextent_m = [5, -5]", "line 2: extent_m: expected more than 0; got -5"),
        (
            "[terrain]\nextent_m = [5, 5]\nkind = 'heightmap'",
            'FILE, line 3: kind is "heightmap": expected heightmap in [terrain], text in quotes',
        ),
        ("[[species]]\nheight_m = [-2, -1]", "line 2: height_m: expected at least 0.001; got -2"),
        ("[[species]]\nheight_m = [1, 1e6]", "line 2: height_m: expected at most 1000; got 1e+06"),
        ("[budget]\nframe_ms = 0", "line 2: frame_ms: expected more than 0; got 0"),
        ("[budget]\nbytes = 0", "line 2: bytes: expected at least 1; got 0"),
        ("[budget]\ntriangles = 0", "line 2: triangles: expected at least 1; got 0"),
        ("[[species]]\nslope_deg = [0, 95]", "slope_deg: expected at most 90; got 95"),
        ("[placement]\ncolumns = { x = 3 }", "columns: expected names in quotes, { x ="),
        ("[placement]\nseed = -1", "seed: expected at least 0; got -1"),
        ("[placement]\nspacing_m = 0", "spacing_m: expected more than 0; got 0"),
        (f"[budget]\nbytes = 1{'0' * 400}", "line 2: bytes: expected a whole number; got 1000"),
        ("[camera", "FILE: expected TOML; Expected ']'"),
        ("[light]\nmoves = true\nmoves = true", "FILE: expected TOML; Cannot overwrite a value"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    assert says in refusal(tmp_path, text)


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nowhere.toml: cannot read this scene \(No such file"):
        read_scene(tmp_path / "nowhere.toml")
    (tmp_path / "scene.toml").write_bytes(b"[camera]\npath = '\xff'")
    with pytest.raises(UsageError, match="expected TOML"):
        read_scene(tmp_path / "scene.toml")


def test_the_camera_is_used_where_the_options_say_nothing(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "[camera]\nfov_y_deg = 50\nimage_height_px = 1440"))
    found = with_scene(ConvertOptions(), scene)
    assert (found.fov, found.image_height) == (50, 1440)
    assert with_scene(ConvertOptions(fov=50.0, image_height=1440), scene) == found


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"fov": 40.0}, "line 2: fov_y_deg is 50, and --fov is 40; leave out one of the two"),
        ({"image_height": 720}, "line 3: image_height_px is 1440, and --image-height is 720; leav"),
    ],
)
def test_another_camera_is_refused(tmp_path: Path, options: dict[str, float], says: str) -> None:
    scene = read_scene(written(tmp_path, "[camera]\nfov_y_deg = 50\nimage_height_px = 1440"))
    with pytest.raises(UsageError, match=says):
        with_scene(ConvertOptions(**options), scene)


def test_a_sun_that_moves_cannot_be_baked(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "\n[light]\nmoves = true\nsun = [10, 20]"))
    says = (
        f"{scene.path}, line 3: levels with baked light cannot follow a sun that moves; leave out "
        "--prelit or set moves = false"
    )
    for sun in (None, "10,20"):
        with pytest.raises(UsageError, match=re.escape(says)):
            with_scene(ConvertOptions(prelit=True, sun=sun), scene)
    assert with_scene(ConvertOptions(), scene) == ConvertOptions()


def test_the_sun_of_the_scene_is_baked(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "[light]\nmoves = false\nsun = [-225, 40.5]"))
    found = with_scene(ConvertOptions(prelit=True), scene)
    assert found.baked_sun == Sun(135.0, 40.5)
    same = ConvertOptions(prelit=True, sun="495,40.5")
    assert with_scene(same, scene) == same
    with pytest.raises(UsageError, match=r"line 3: the sun stands at 135,40.5, and --sun is 1,2;"):
        with_scene(ConvertOptions(prelit=True, sun="1,2"), scene)
    assert with_scene(ConvertOptions(), scene).sun is None, "clients light the levels"


def test_a_still_sun_that_nobody_placed_is_left_to_the_options(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "[light]\nmoves = false"))
    options = ConvertOptions(prelit=True, sun="1,2")
    assert with_scene(options, scene) == options


def test_what_is_not_used_is_said(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, WHOLE))
    (sentence,) = unused(scene, ConvertOptions(prelit=True))
    assert sentence.startswith(f"{scene.path}: checked, but of no effect on convert yet: ")
    listed = sentence.split("yet: ")[1].split(", ")
    assert listed == [
        "[terrain]", "[[species]]", "[placement]", "[budget]",
        "[camera] path", "[camera] polygon", "[camera] height_m", "[camera] above",
        "[camera] margin_m",
    ]  # fmt: skip


def test_a_sun_that_is_not_baked_is_said_to_change_nothing(tmp_path: Path) -> None:
    for moves in ("true", "false"):
        scene = read_scene(written(tmp_path, f"[light]\nmoves = {moves}\nsun = [10, 20]"))
        (sentence,) = unused(scene, ConvertOptions())
        assert sentence.startswith(f"{scene.path}, line 3: sun changes nothing without --prelit: ")
    assert unused(scene, ConvertOptions(prelit=True)) == []


def test_the_page_describes_every_key_as_it_is() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for table, keys in SCHEMA.items():
        for key, rule in keys.items():
            expected = rules.KINDS[rule.kind][0]
            row = next((r for r in text.splitlines() if r.startswith(f"| `{key}` |")), None)
            assert row is not None, f"[{table}] {key} is not on the page"
            assert f"| {expected} |" in text
    rows = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    assert rows == [key for keys in SCHEMA.values() for key in keys]


def test_the_example_of_the_page_is_read(tmp_path: Path) -> None:
    text = PAGE.read_text(encoding="utf-8")
    example = "\n".join(line[4:] for line in text.splitlines() if line.startswith("    "))
    scene = read_scene(written(tmp_path, example[example.index("[camera]") :]))
    assert scene.light is not None and scene.species


SMALL = ["--billboards", "24", "--levels", "1", "--refine", "none", "--measure", "off"]


def converted(folder: Path, scene: str, *more: str) -> int:
    plant, out = folder / "bush.glb", folder / "out"
    plant.write_bytes(plant_glb(sample("bush", 600)))
    path = written(folder, scene)
    return run(["convert", str(plant), "-o", str(out), "--scene", str(path), *SMALL, *more])


@pytest.mark.gl
def test_convert_takes_its_sun_and_camera_from_the_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "[camera]\nfov_y_deg = 50\n[light]\nmoves = false\nsun = [90, 30]\n[budget]\nbytes = 9"
    assert converted(tmp_path, text, "--prelit", "--json") == 0
    said = capsys.readouterr()
    assert "of no effect on convert yet: [budget]" in said.err
    (row,) = json.loads(said.out)
    assert row["error"] is None
    assert [n for n in row["notes"] if "of no effect on convert yet: [budget]" in n]
    values = read_manifest(tmp_path / "out" / "bush.lod.json")
    assert values["fov_y_deg"] == 50
    assert (values["sun"]["azimuth_deg"], values["sun"]["elevation_deg"]) == (90, 30)
    assert values["options"]["sun"] == "90,30"
    assert values["levels"][1]["unlit"]


@pytest.mark.parametrize(
    ("text", "more", "says"),
    [
        ("[light]\nmoves = true", ["--prelit"], "line 2: levels with baked light cannot follow"),
        ("[sky]", [], "line 1: no table is called 'sky'"),
        ("[camera]\nfov_y_deg = 9", ["--fov", "8"], "line 2: fov_y_deg is 9, and --fov is 8"),
    ],
)
def test_a_scene_that_is_refused_is_exit_2_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, more: list[str], says: str
) -> None:
    path, out = written(tmp_path, text), tmp_path / "out"
    missing = str(tmp_path / "missing.glb")
    assert run(["convert", missing, "-o", str(out), "--scene", str(path), *more]) == 2
    said = capsys.readouterr().err
    assert f"error: {path}, {says}" in said
    assert not out.exists()
