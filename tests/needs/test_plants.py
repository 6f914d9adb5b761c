"""Which eyes the plants of a batch are converted for."""

from __future__ import annotations

import json
from math import atan2, degrees, hypot
from pathlib import Path

import pytest
from plants import plant_of

from vegtool.cli import run
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.formats.manifest import read_manifest
from vegtool.growth import sample
from vegtool.lod import Display
from vegtool.needs.plants import limits_of
from vegtool.scene import read_scene
from vegtool.tiles.library import read_species
from vegtool.tiles.limits import digest_of, lacking, without_original

CAMERA = "polygon = [[0, 0], [1, 0], [1, 1], [0, 1]]\nheight_m = [1, 2]\nimage_height_px = 540"
SPECIES = '[[species]]\nname = "oak"\n'
PLACE = '[placement]\ninventory = "trees.csv"\n'
TREE = [[[-2, 0, -2], [2, 0, 2], [0, 10, 0]], [[2, 0, -2], [-2, 0, 2], [0, 10, 0]]]
"""Corners: 10 m high, its middle at 5 m."""
SMALL = ["--billboards", "24", "--levels", "2", "--refine", "none", "--measure", "off"]


def scene_of(folder: Path, camera: str = CAMERA, rest: str = PLACE + SPECIES) -> Path:
    (folder / "trees.csv").write_text("x,y,species,height\n0.5,-100,oak,10\n0.5,-200,oak,20\n")
    text = f'[camera]\n{camera}\n[terrain]\nkind = "plane"\nextent_m = [600, 600]\n{rest}'
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


def oak(folder: Path, name: str = "oak.glb") -> Path:
    (folder / name).write_bytes(plant_glb(plant_of(TREE)))
    return folder / name


def test_the_eyes_of_a_species(tmp_path: Path) -> None:
    """By hand: one stands 99 to 100 m away, one of twice the size 199 to 200 m, which is as one of
    99.5 to 100 m; eyes are 3 to 4 m below the middle of the first, 8 to 9 m below the other's."""
    path = oak(tmp_path)
    scene = read_scene(scene_of(tmp_path))
    found = limits_of(scene, [path], ReadOptions())
    limits = found.limits[path]
    assert limits.nearest_m == pytest.approx(hypot(99, 3), rel=0.01)
    assert limits.farthest_m == pytest.approx(hypot(100, 4.5), rel=0.01)
    assert limits.display == Display(60.0, 540) and limits.middle_m == (0, 5, 0)
    assert limits.elevation_deg[1] == pytest.approx(degrees(atan2(-3, 100)), abs=0.1)
    assert 0 < limits.azimuth_deg[1] < 360, "from where both are seen, as they are turned"
    (said,) = found.notes
    assert said.startswith(f"{path}: is made for the eyes that see its 2 plants from 99")
    assert limits_of(scene, [path], ReadOptions()) == found, "the same again"


@pytest.mark.parametrize(
    "text",
    ["height_m = [1, 2]", CAMERA + "\n[placement]\nseed = 1", CAMERA],
)
def test_a_scene_that_does_not_say_from_where(tmp_path: Path, text: str) -> None:
    rest = SPECIES if "placement" in text or text == CAMERA else PLACE + SPECIES
    scene = read_scene(scene_of(tmp_path, text, rest))
    assert limits_of(scene, [oak(tmp_path)], ReadOptions()).limits == {}


def test_which_file_a_species_is(tmp_path: Path) -> None:
    """By its file or its name; of others, nothing is known."""
    tree, other = oak(tmp_path, "tree.glb"), oak(tmp_path, "ash.glb")
    by_file = PLACE + SPECIES + 'model = "tree.glb"\n'
    found = limits_of(read_scene(scene_of(tmp_path, rest=by_file)), [tree, other], ReadOptions())
    assert list(found.limits) == [tree]
    assert f"{other}: is no species of {tmp_path / 'scene.toml'}: it is converted whole" in (
        found.notes
    )
    by_name = PLACE + SPECIES + 'aliases = ["Ash"]\n'
    found = limits_of(read_scene(scene_of(tmp_path, rest=by_name)), [other], ReadOptions())
    assert list(found.limits) == [other]


def test_a_species_that_is_not_there(tmp_path: Path) -> None:
    """How it stands may matter to the others: then nothing is left out."""
    rest = PLACE + SPECIES + '[[species]]\nname = "elm"\n'
    found = limits_of(read_scene(scene_of(tmp_path, rest=rest)), [oak(tmp_path)], ReadOptions())
    (note,) = found.notes
    assert not found.limits and "'elm'" in note and note.endswith("plants are converted whole")


def test_a_species_that_stands_nowhere(tmp_path: Path) -> None:
    rest = PLACE + SPECIES + '[[species]]\nname = "ash"\n'
    paths = [oak(tmp_path), oak(tmp_path, "ash.glb")]
    found = limits_of(read_scene(scene_of(tmp_path, rest=rest)), paths, ReadOptions())
    assert list(found.limits) == paths[:1]
    assert any("ash.glb: no plant of it stands in" in note for note in found.notes)


def test_a_digest_is_of_what_matters(tmp_path: Path) -> None:
    scene = read_scene(scene_of(tmp_path))
    digest = digest_of(scene)
    with (tmp_path / "scene.toml").open("a") as file:
        file.write("[budget]\nbytes = 5\n# and more\n")
    assert digest_of(read_scene(scene.path)) == digest
    (tmp_path / "trees.csv").write_text("x,y,species,height\n0.5,-100,oak,11\n")
    assert digest_of(read_scene(scene.path)) != digest


def test_a_contradiction_is_said_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = scene_of(tmp_path, CAMERA + "\nabove = true\n")
    model = oak(tmp_path)
    arguments = ["convert", str(model), "--scene", str(scene), "-o", str(tmp_path / "out")]
    scene.write_text(scene.read_text().replace("height_m = [1, 2]", "height_m = [0, 0]"))
    assert run(arguments) == 2
    assert "scene.toml, line 5: above is true, and no eye is higher" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.gl
def test_what_others_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bush for the eyes of a scene, shown in that scene, in another, and in tiles."""
    monkeypatch.chdir(tmp_path)
    scene_of(tmp_path)
    Path("trees.csv").write_text("x,y,species,height\n0.5,-100,bush,2\n3,-104,bush,2\n")
    scene = Path("scene.toml")
    scene.write_text(scene.read_text().replace("oak", "bush"))
    Path("bush.glb").write_bytes(plant_glb(sample("bush", 300)))
    convert = ["convert", "bush.glb", "--scene", "scene.toml", *SMALL]
    assert run([*convert, "-o", "out", "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    assert any("left out for the scene: the original" in note for note in told["notes"])
    assert any("is made for the eyes" in note for note in told["notes"])
    manifest = read_manifest(Path("out/bush.lod.json"))
    assert not manifest["scene"]["original"]
    for jobs in ("1", "2"):
        assert run([*convert, "-o", f"again{jobs}", "-q", "-j", jobs]) == 0
        for file in Path("out").iterdir():
            assert file.read_bytes() == (Path(f"again{jobs}") / file.name).read_bytes()
    capsys.readouterr()

    one = read_species(Path("out/bush.lod.json"))
    bush = sample("bush", 300)
    assert one.height == pytest.approx(bush.bounds[1, 1]) and not one.whole
    assert one.extent == pytest.approx(bush.extent)
    own_px = Display(60.0, 540).pixels_per_metre(1.0)
    assert one.limits is not None
    near, far = one.limits.nearest_m, one.limits.farthest_m
    assert lacking(one, own_px, near, far) == []
    assert [len(lacking(one, px, m, far)) for px in (own_px, 2 * own_px) for m in (near, 1)] == [
        0, 1, 1, 2,
    ]  # fmt: skip
    (note,) = without_original(one)
    assert note.startswith("lacks the original") and "vegtool convert MODEL" in note

    picture = ["--screenshot", "a.png", "--size", "60x540", "-f"]
    assert run(["preview", "out", "--scene", "scene.toml", *picture]) == 0
    assert capsys.readouterr().err == ""
    assert run(["preview", "out", *picture]) == 0
    (said,) = capsys.readouterr().err.splitlines()
    assert "out/bush.lod.json: was made for eyes from" in said and "the original" in said
    near_by = scene.read_text().replace(
        "[[0, 0], [1, 0], [1, 1], [0, 1]]", "[[0, 90], [1, 90], [1, 91]]"
    )
    Path("near.toml").write_text(near_by)
    assert run(["preview", "out", "--scene", "near.toml", *picture]) == 0
    (said,) = capsys.readouterr().err.splitlines()
    assert "may be seen from nearer here (from 1" in said
    big = ["--screenshot", "a.png", "--size", "60x1080", "-f"]
    assert run(["preview", "out", "--scene", "scene.toml", *big]) == 0
    (said,) = capsys.readouterr().err.splitlines()
    assert "pictures of 60 degrees and 540 pixels" in said and "2 times" in said

    tiles = ["tiles", "trees.csv", "--species", "out", "-o", "tiles", "--near", "1"]
    assert run(tiles) == 0
    said = capsys.readouterr().err
    assert "was made for eyes from" in said and "pictures of 60 degrees" in said
    assert Path("tiles/tileset.json").exists()
