"""A file of surfel billboards, looked at: what is drawn, what is said, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from stereo_cases import check_two_eyes

from vegtool.cli import run
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.gl.screen import Screen
from vegtool.growth import sample
from vegtool.lod import Display
from vegtool.preview.drawn import show_of
from vegtool.preview.eye import FOV_Y_DEG
from vegtool.preview.options import PreviewOptions
from vegtool.preview.run import frames, loaded
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.surfel_forest import SurfelForest
from vegtool.preview.surfel_world import read_surfel_world, surfel_world
from vegtool.preview.world import read_world
from vegtool.surfels.make import surfel_model
from vegtool.surfels.store import read_surfels, surfels_bytes

pytestmark = pytest.mark.gl
HEIGHT = 240
"""Pixels of the pictures that it is made for."""
SIZE = 300, HEIGHT


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("surfels")
    model = surfel_model(sample("statue", 3000), display=Display(image_height_px=HEIGHT))
    (folder / "statue.surfels").write_bytes(surfels_bytes(model))
    return folder / "statue.surfels"


@pytest.fixture(scope="module")
def forest(file: Path) -> Iterator[SurfelForest]:
    with read_surfel_world(file, HEIGHT).scenery("none") as made:
        for _ in made.load():
            pass
        yield made


def test_it_stands_where_the_model_would(file: Path, tmp_path: Path) -> None:
    (tmp_path / "statue.glb").write_bytes(plant_glb(sample("statue", 3000)))
    model = read_world(tmp_path / "statue.glb", None, ReadOptions())
    world = read_surfel_world(file, HEIGHT)
    assert world.orbited and world.height_at(3.0, -2.0) < 0
    np.testing.assert_allclose(world.start.position, model.start.position, rtol=1e-4)
    with world.scenery("none") as surfels, model.scenery("none") as forest:
        for one in (surfels, forest):
            for _ in one.load():
                pass
        for look in (Look(), Look(detail=IN_FULL, level=0)):
            mine = surfels.picture(world.start, SIZE, look)
            theirs = forest.picture(world.start, SIZE, Look(detail=IN_FULL, level=0))
            limit = 0.01 if look.level is None else 1e-3
            assert np.abs(mine - theirs).mean() < limit


def test_less_detail_is_fewer_billboards(forest: SurfelForest, file: Path) -> None:
    """Epsilon is divided by it; from afar, all is billboards, then one. Out of view is nothing."""
    world = read_surfel_world(file, HEIGHT)
    away = world.start.position - world.target
    eye = replace(world.start, position=world.target + 3 * away)
    with Screen() as screen:
        screen.begin(SIZE, (0.0, 0.0, 0.0))
        counts = [
            forest.counts(forest.choose(eye, SIZE, Look(detail=detail)))
            for detail in (IN_FULL, 2.0, 1.0, 0.5, 1e-4)
        ]
        stats = forest.draw(eye, SIZE)
        held = [forest.draw(eye, SIZE, Look(level=level)) for level in (0, 1, 5)]
        back = replace(eye, yaw_deg=eye.yaw_deg + 180)
        beside = forest.draw(back, SIZE)
    triangles = len(world.data[0].plant.faces)
    assert counts[0] == (0, triangles) and counts[-1] == (1, 0)
    shown = [2 * billboards + t for billboards, t in counts]
    assert shown == sorted(shown, reverse=True)
    billboards, t = counts[2]
    assert stats.triangles == 2 * billboards + t and stats.plants == stats.total == 1
    assert stats.said == (f"{billboards:,} billboards, {t:,} triangles below them",)
    assert [one.triangles for one in held] == [t, 2 * billboards, 2 * billboards]
    assert beside.plants == 0 and beside.triangles == 0 and beside.said[0].startswith("0 bill")


def test_colours_and_figures(file: Path) -> None:
    """Each way to look at it is another picture, and the figures say what is drawn."""
    world = read_surfel_world(file, HEIGHT)
    show = show_of(world, PreviewOptions())
    away = world.target + 2.5 * (world.start.position - world.target)
    eyes = [replace(world.start, position=away)]
    seen = []
    with loaded(show) as screen:
        for change in (
            {}, {"color": "by level"}, {"color": "by species"}, {"color": "by overdraw"},
            {"wireframe": True}, {"level": 0}, {"level": 1}, {"compare": True},
        ):  # fmt: skip
            plain = show.state
            show.state = replace(show.state, **change)
            seen.append(next(iter(frames(show, screen, SIZE, eyes, 30.0))))
            told = show.figures()
            show.state = plain
    for number, one in enumerate(seen):
        assert not any(np.array_equal(one, other) for other in seen[:number])
    assert " billboards, " in told and "MB of textures" in told
    colored = np.unique(seen[1].reshape(-1, 3), axis=0).astype(int)
    reddest = (colored[:, 0] - colored[:, 2]).max()
    assert reddest > 80, "the finest billboards are red, as the level after the original"


def test_each_half_of_a_stereo_picture_is_what_its_eye_sees(file: Path) -> None:
    check_two_eyes(read_surfel_world(file, 80))


def test_what_it_was_made_for_is_said(file: Path) -> None:
    assert read_surfel_world(file, HEIGHT).notes == ()
    (note,) = read_surfel_world(file, 2 * HEIGHT).notes
    assert "made for pictures of 240 pixels and 60 degrees; in these, of 480 pixels" in note
    assert "billboards begin 2 times as far away" in note
    world = read_surfel_world(file, HEIGHT)
    (told,) = world.details(Display(FOV_Y_DEG, HEIGHT).pixels_per_metre(1.0))
    model = world.models[0]
    assert told.startswith(f"statue: {len(model.hierarchy):,} billboards from ")
    assert f"; {len(model.plant.faces):,} triangles; " in told and "240 pixels" in told


def test_several_stand_in_a_row(file: Path) -> None:
    model = read_surfels(file)
    world = surfel_world([model, model], HEIGHT)
    wide = np.ptp(model.plant.bounds, axis=0)[0]
    assert world.foot[1, 0] - world.foot[0, 0] >= wide and (world.foot[:, 1] >= -1e-9).all()
    with world.scenery("none") as forest:
        assert [round(done, 3) for done in forest.load()] == [0.5, 1.0]
        seen = forest.picture(world.start, SIZE)
        one, two = forest.choose(world.start, SIZE, Look())
        assert len(one.rows) == len(two.rows) == 1
        assert len(np.unique(seen.reshape(-1, 4), axis=0)) > 100


def test_what_hangs_in_the_air_stands_on_the_ground() -> None:
    plant = sample("statue", 500)
    plant = replace(plant, positions=plant.positions + np.array([0.0, 3.0, 0.0]))
    world = surfel_world([surfel_model(plant)], HEIGHT)
    assert world.foot[0, 1] == pytest.approx(-plant.bounds[0, 1])
    assert 0 > world.height_at(0.0, 0.0) > -0.1 * plant.extent


def test_the_command_writes_pictures_and_figures(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, stats = tmp_path / "s.png", tmp_path / "s.json"
    arguments = ["--screenshot", str(picture), "--frames", "2", "--stats", str(stats)]
    assert run(["preview", str(file), *arguments, "--size", "160x120", "-v"]) == 0
    said = capsys.readouterr().err.replace("\n", " ")
    assert "made for pictures of 240 pixels" in said and "billboards from" in said
    with Image.open(picture) as image:
        assert image.size == (160, 120)
    figures = json.loads(stats.read_text())
    assert figures["plants_total"] == 1 and figures["median_triangles"] > 0
    assert figures["texture_bytes"] > 0


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["--scene", "s.toml"], 2, "is surfel billboards, which stand where they do; leave out"),
        (["--up", "z"], 2, "leave out --scene, --unit, --up and --leaf-material"),
        (["--fade", "dither"], 2, "--fade: surfel billboards follow each other in their own way"),
        (["--html", "p.html"], 2, "--html: writes a page of converted plants, whose levels are"),
    ],
)
def test_what_says_nothing_of_them_is_refused(
    file: Path, arguments: list[str], code: int, sentence: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text("")
    wanted = [] if "--html" in arguments else ["--screenshot", "p.png"]
    assert run(["preview", str(file), *arguments, *wanted]) == code
    said = capsys.readouterr().err.replace("\n", " ")
    assert sentence in said and said.startswith("error: ")
    assert [path.name for path in tmp_path.iterdir()] == ["s.toml"]


@pytest.mark.parametrize("content", [None, b"", b"no archive", "half"])
def test_a_broken_file_is_a_sentence(
    content: bytes | str | None, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.surfels"
    if content is not None:
        data = file.read_bytes()
        path.write_bytes(content if isinstance(content, bytes) else data[: len(data) // 2])
    assert run(["preview", str(path), "--screenshot", str(tmp_path / "p.png")]) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ") and "x.surfels" in said and "Traceback" not in said
    assert not (tmp_path / "p.png").exists()
