"""`vegtool preview` as a user meets it: what it writes, what it says, how it fails."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import xvfb
from PIL import Image

from vegtool.camera_path.file import read_path
from vegtool.cli import run
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample
from vegtool.preview import command, drawn
from vegtool.preview.show import Show
from vegtool.preview.state import help_text

pytestmark = pytest.mark.gl
SMALL = ["--billboards", "24", "--levels", "2", "--refine", "none", "--measure", "off"]
SIZE = ["--size", "120x80"]
SCENE = """
[camera]
height_m = [1.0, 1.4]

[light]
moves = false
sun = [90, 30]

[terrain]
kind = "plane"
extent_m = [40, 40]

[[species]]
name = "bush"
share = 1

[placement]
spacing_m = 6
"""
WAY = """
fps = 10
[[station]]
position = [0, 15]
[[station]]
position = [0, 14]
speed_m_s = 2.5
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a bush, converted, in `out/`; the model; a scene and a way through it."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "bush.glb").write_bytes(plant_glb(sample("bush", 300)))
    assert run(["convert", str(folder / "bush.glb"), "-o", str(folder / "out"), "-q", *SMALL]) == 0
    (folder / "scene.toml").write_text(SCENE)
    (folder / "way.toml").write_text(WAY)
    return folder


@pytest.fixture
def here(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it to work in, without a display."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    return tmp_path


def contents(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def no_display() -> None:
    from vegtool.errors import CapabilityError

    raise CapabilityError("a window needs a display, and none was found; use --screenshot")


# -- what is written ------------------------------------------------------------------------------


def test_a_picture_of_plants_in_a_row(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["preview", "out", "--screenshot", "a.png", *SIZE]) == 0
    assert capsys.readouterr().out == "a.png: 120 x 80 pixels\n"
    picture = np.asarray(Image.open("a.png").convert("RGB")).astype(int)
    assert picture.shape == (80, 120, 3)
    middle, corner = picture[40, 60], picture[0, 0]
    assert middle[1] > middle[2], "leaves in the middle are green"
    assert corner[2] > corner[1] > corner[0], "the sky is blue"


def test_a_picture_a_film_and_figures_for_two_eyes(here: Path) -> None:
    """Every frame of either has two halves that are nearly the same: of plants some metres away."""
    written = ["--screenshot", "a.png", "--frames", "1", "--stats", "s.json", "-o", "walk.png"]
    scene = ["--scene", "scene.toml", "--path", "way.toml", *written, "-q", *SIZE]
    assert run(["preview", "out", "--stereo", *scene]) == 0
    for name in ("a.png", "walk_0001.png", "walk_0005.png"):
        picture = np.asarray(Image.open(name).convert("RGB")).astype(int)
        left, right = picture[:, :60], picture[:, 60:]
        assert 0 < np.abs(left - right).mean() < 0.5 * np.abs(left - right[:, ::-1]).mean()
    assert len(json.loads(Path("s.json").read_text())["rows"]) == 1


def test_the_same_picture_again_the_same_bytes(here: Path) -> None:
    for name in ("a.png", "b.png"):
        assert run(["preview", "out", "--scene", "scene.toml", "--screenshot", name, *SIZE]) == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


@pytest.mark.parametrize("what", ["bush.glb", "out/bush.lod.json", "out"])
def test_a_model_a_manifest_and_a_folder_are_shown(what: str, here: Path) -> None:
    assert run(["preview", what, "--screenshot", "a.png", "-q", *SIZE]) == 0


def test_all_at_once_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was read, too, is among the notes of the result."""
    (here / "out" / "scene.toml").write_text(SCENE.replace('"bush"', '"b"\nmodel = "../bush.glb"'))
    written = ["--screenshot", "a.png", "--frames", "2", "--stats", "s.json", "-o", "film.gif"]
    assert run(["preview", "out/scene.toml", "--path", "way.toml", "--json", *written, *SIZE]) == 0
    said = capsys.readouterr()
    facts = json.loads(said.out)
    assert facts["screenshot"] == "a.png" and facts["stats_file"] == "s.json"
    assert facts["film"] == {"files": ["film.gif"], "frames": 5, "fps": 10.0}
    assert facts["stats"]["frames"] == 2 and facts["stats"]["plants_total"] > 0
    assert facts["notes"] == [], "the model's levels are there, under the model's name"
    assert len(json.loads(Path("s.json").read_text())["rows"]) == 2
    with Image.open("film.gif") as film:
        assert getattr(film, "n_frames", 1) == 5


def test_figures_are_of_each_frame(here: Path) -> None:
    arguments = ["preview", "out", "--frames", "3", "--stats", "s.json", "-q", *SIZE]
    assert run(arguments) == 0
    stats = json.loads(Path("s.json").read_text())
    assert [row["plants"] for row in stats["rows"]] == [1, 1, 1]
    assert stats["median_triangles"] == stats["rows"][0]["triangles"] > 0
    assert stats["worst_ms"] == max(row["ms"] for row in stats["rows"])


def test_a_page_as_json(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["preview", "out", "--html", "page.html", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts == {"page": "page.html", "bytes": Path("page.html").stat().st_size}


def test_a_scene_names_its_way_and_its_sun(here: Path) -> None:
    """The way and the sun that the scene names are those of the command line."""
    scene = SCENE.replace("[camera]", '[camera]\npath = "way.toml"')
    Path("with_way.toml").write_text(scene)
    pictures = {}
    for name, more in {
        "named": ["with_way.toml"],
        "given": ["scene.toml", "--path", "way.toml", "--sun", "90,30"],
        "other": ["scene.toml", "--path", "way.toml", "--sun", "270,30"],
    }.items():
        picture = f"{name}.png"
        assert run(["preview", "out", "--scene", *more, "--screenshot", picture, "-q", *SIZE]) == 0
        pictures[name] = Path(picture).read_bytes()
    assert pictures["named"] == pictures["given"] != pictures["other"]


def test_a_way_without_a_field_of_view_has_the_scenes(here: Path) -> None:
    Path("narrow.toml").write_text(SCENE.replace("[camera]", "[camera]\nfov_y_deg = 20"))
    from vegtool.formats import ReadOptions
    from vegtool.preview.world import read_world

    world = read_world(Path("out"), Path("narrow.toml"), ReadOptions())
    assert {eye.fov_y_deg for eye in drawn.eyes_of(world, read_path(Path("way.toml")))} == {20.0}
    Path("wide.toml").write_text("fov_y_deg = 80\n" + WAY)
    assert {eye.fov_y_deg for eye in drawn.eyes_of(world, read_path(Path("wide.toml")))} == {80.0}


def test_verbose_says_what_levels_there_are_and_quiet_nothing(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shown = ["preview", "out", "--screenshot", "a.png", "-f", *SIZE]
    assert run([*shown, "-v"]) == 0
    said = capsys.readouterr()
    assert "bush: " in said.err and said.err.count("triangles from") == 2
    assert run(shown) == 0
    assert capsys.readouterr().err == ""
    assert run([*shown, "-q"]) == 0
    said = capsys.readouterr()
    assert said.out == said.err == ""


def test_a_plant_without_levels_is_noted(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("model.toml").write_text(SCENE.replace('"bush"', '"b"\nmodel = "bush.glb"'))
    assert run(["preview", "model.toml", "--screenshot", "a.png", *SIZE]) == 0
    assert "bush.glb: has no levels of detail; vegtool convert" in capsys.readouterr().err


def test_a_rate_is_held_from_the_first_picture(here: Path) -> None:
    """Detail is found first: a picture at the least detail, where finding starts, shows nothing."""
    shown = ["preview", "out", "--fps", "1", "--frames", "1", "--stats", "s.json", "-q", *SIZE]
    assert run(shown) == 0
    (row,) = json.loads(Path("s.json").read_text())["rows"]
    assert row["detail"] > 0.9


# -- how it fails ---------------------------------------------------------------------------------

MISTAKES = [
    # what contradicts itself
    (["out", "--out", "a.mp4"], 2, "--out: writes a walk; add the way, --path"),
    (["out", "--stats", "s.json"], 2, "--stats: writes what frames took; add how many, --frames"),
    (["out", "--html", "p.html", "--frames", "2"], 2, "--html: writes a page"),
    (["out", "--html", "p.html", "--scene", "scene.toml"], 2, "--html: writes a page"),
    (["out", "--html", "p.html", "--sun", "1,2"], 2, "--html: writes a page"),
    (["out", "--html", "p.html", "--stereo"], 2, "--html: writes a page"),
    (["scene.toml", "--scene", "scene.toml"], 2, "got two scenes"),
    (["bush.glb", "--scene", "scene.toml"], 2, "bush.glb: expected a folder of converted plants"),
    (["out", "--unit", "cm", "--screenshot", "a.png"], 2, "out is converted already"),
    (["out", "--scene", "scene.toml", "--up", "z", "--frames", "1"], 2, "is converted already"),
    # what has a wrong value
    (["out", "--screenshot", "a.jpg"], 2, "a.jpg: expected a name that ends in .png"),
    (["out", "--frames", "1", "--stats", "s.txt"], 2, "s.txt: expected a name that ends in .json"),
    (["out", "--html", "p.htm"], 2, "p.htm: expected a name that ends in .html"),
    (["out", "--path", "way.toml", "-o", "a.avi"], 2, "a.avi: expected a folder, or a name that"),
    (["out", "--size", "10", "--screenshot", "a.png"], 2, "--size: expected pixels from 1x1 to"),
    (["out", "--size", "0x10", "--screenshot", "a.png"], 2, "--size: expected pixels"),
    (["out", "--size", "9x99999", "--screenshot", "a.png"], 2, "got 9x99999"),
    (["out", "--sun", "90", "--screenshot", "a.png"], 2, "--sun: expected azimuth and elevation"),
    (["out", "--sun", "90,95", "--screenshot", "a.png"], 2, "--sun: expected an azimuth"),
    (["out", "--fade", "slowly", "--screenshot", "a.png"], 2, "slowly"),
    (["out", "--fps", "-1", "--screenshot", "a.png"], 2, "--fps: expected 0 to 1,000"),
    (["out", "--fps", "nan", "--screenshot", "a.png"], 2, "--fps"),
    (["out", "--frames", "0"], 2, "--frames"),
    # what is not there
    (["nowhere", "--screenshot", "a.png"], 1, "nowhere: expected a folder of converted plants"),
    (["no.glb", "--screenshot", "a.png"], 1, "no.glb: expected a folder of converted plants"),
    (["no.toml", "--screenshot", "a.png"], 2, "no.toml: cannot read this scene"),
    (["nowhere", "--scene", "scene.toml"], 1, "nowhere: expected a folder of converted plants"),
    (["empty", "--screenshot", "a.png"], 1, "empty: expected a folder that vegtool convert wrote"),
    (["empty", "--html", "p.html"], 1, "empty: expected manifests"),
    (["out", "--path", "no.toml", "--frames", "1"], 2, "no.toml: cannot read this path"),
    (["lacking", "--frames", "1"], 1, "expected the file bush_LOD2.glb that it names beside it"),
    (["broken.glb", "--frames", "1"], 1, "broken.glb"),
    # what may not be written
    (["out", "--screenshot", "there.png"], 1, "there.png: exists already. Overwrite it with -f"),
    (["out", "--frames", "1", "--stats", "s/t.json"], 1, "s/t.json: exists already"),
    (["out", "--html", "there.html"], 1, "there.html: exists already"),
    (["out", "--path", "way.toml", "-o", "there.gif"], 1, "there.gif: exists already"),
    (["out", "--path", "way.toml", "-o", "there.png"], 1, "there_0001.png: exists already"),
    (["out", "--screenshot", "way.toml/a.png"], 1, "a file stands where its folder should be"),
    (
        ["out", "--frames", "1", "--stats", "out/bush.lod.json", "-f"],
        1,
        "bush.lod.json: is read by this command, and never overwritten",
    ),
    # what the scene and the way say
    (["bad_scene.toml", "--frames", "1"], 2, "bad_scene.toml, line 3: kind: expected one of"),
    (["out", "--path", "bad_way.toml", "--frames", "1"], 2, "bad_way.toml, line 4: no key of"),
    (["out", "--scene", "oak.toml", "--frames", "1"], 1, "oak.toml, line 13: expected a model"),
    (["out", "--scene", "no_model.toml", "--frames", "1"], 1, "line 15: expected the model no.glb"),
    (["out", "--scene", "none.toml", "--frames", "1"], 2, "none.toml: expected a [[species]]"),
    (["out", "--scene", "bare.toml", "--frames", "1"], 2, "bare.toml, line 15: expected a species"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "code", "sentence"), MISTAKES)
def test_a_mistake_is_a_sentence_and_the_right_exit_code(
    arguments: list[str], code: int, sentence: str, here: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """All of it is said before any work: nothing is brought onto the GPU."""
    monkeypatch.setattr(Show, "load", lambda *_: pytest.fail("worked"))
    prepare(here)
    before = contents(here)
    assert run(["preview", *arguments]) == code
    said = capsys.readouterr()
    assert sentence in said.err and said.err.startswith("error: ") and said.out == ""
    assert "Traceback" not in said.err and "bug" not in said.err
    assert contents(here) == before, "a failed command leaves nothing behind"


def prepare(folder: Path) -> None:
    """Files with mistakes in them, and files in the way."""
    (folder / "empty").mkdir()
    shutil.copytree(folder / "out", folder / "lacking")
    (folder / "lacking" / "bush_LOD2.glb").unlink()
    (folder / "broken.glb").write_text("this is no glTF")
    (folder / "s").mkdir()
    for name in ("there.png", "there.html", "there.gif", "there_0001.png", "s/t.json"):
        (folder / name).write_text("the user's own")
    (folder / "bad_scene.toml").write_text('\n[terrain]\nkind = "sphere"\n')
    (folder / "bad_way.toml").write_text("[[station]]\nposition = [0, 1]\n\nheigth_m = 3\n")
    (folder / "oak.toml").write_text(SCENE.replace('"bush"', '"oak"'))
    scene = SCENE.replace('"bush"', '"oak"\nmodel = "no.glb"')
    (folder / "no_model.toml").write_text(scene)
    start, end = SCENE.index("[[species]]"), SCENE.index("[placement]")
    (folder / "none.toml").write_text(SCENE[:start] + SCENE[end:])
    (folder / "bare.toml").write_text(SCENE.replace("share = 1", "share = 0"))


def test_without_a_display_the_way_without_a_window_is_named_before_anything_is_read(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vegtool.gl.window.check_display", no_display)
    monkeypatch.setattr("vegtool.preview.world.read_library", lambda *_: pytest.fail("read"))
    assert run(["preview", "out"]) == 5
    assert "use --screenshot" in capsys.readouterr().err


def in_a_process(
    arguments: list[str], **environment: str | None
) -> subprocess.CompletedProcess[str]:
    kept = {k: v for k, v in os.environ.items() if k not in environment}
    given = {k: v for k, v in environment.items() if v is not None}
    return subprocess.run(
        [sys.executable, "-m", "vegtool", "preview", *arguments],
        env={**kept, **given}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="displays of X11")
def test_no_display_is_exit_5(here: Path) -> None:
    done = in_a_process(["out"], DISPLAY=":4711")
    assert done.returncode == 5 and done.stdout == ""
    assert "a window needs a display" in done.stderr and "--screenshot" in done.stderr
    assert "DISPLAY is :4711" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="Mesa's way to draw as an old driver does")
def test_no_gl_33_is_exit_5_and_nothing_is_written(here: Path) -> None:
    done = in_a_process(
        ["out", "--screenshot", "a.png"], MESA_GL_VERSION_OVERRIDE="2.1", DISPLAY=None
    )
    assert done.returncode == 5
    assert "OpenGL 3.3" in done.stderr and "Traceback" not in done.stderr
    assert not Path("a.png").exists()


def test_a_picture_too_large_for_the_gpu_is_a_sentence(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import moderngl

    def refuse(*_: object) -> None:
        raise moderngl.Error("the framebuffer is not complete")

    # what plants are measured with is there before
    assert run(["preview", "bush.glb", "--screenshot", "small.png", "--size", "64x64"]) == 0
    monkeypatch.setattr("moderngl.Context.framebuffer", refuse)
    assert run(["preview", "bush.glb", "--screenshot", "a.png", "--size", "9000x9000"]) == 5
    said = capsys.readouterr().err
    assert "a frame of 9000 x 9000 pixels" in said and "make it smaller" in said
    assert not Path("a.png").exists()


def test_a_folder_that_may_not_be_written_is_said_before_the_work(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # to root, all may be written
    for more in (["--screenshot", "a.png"], ["--path", "way.toml", "-o", "a.gif"]):
        assert run(["preview", "out", *more]) == 1
        assert "cannot be written (Permission denied)" in capsys.readouterr().err


@pytest.mark.parametrize("more", [["--screenshot", "a.png"], ["--path", "way.toml", "-o", "f"]])
def test_a_full_disk_leaves_nothing(
    more: list[str], here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(here)

    def full(path: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert run(["preview", "out", *more, *SIZE]) == 1
    assert "there is no room for it" in capsys.readouterr().err
    assert contents(here) == before


@pytest.mark.parametrize(
    ("package", "more", "extra"),
    [("av", ["--path", "way.toml", "-o", "a.mp4"], "video"), ("pyrender", [], "pyrender")],
)
def test_a_missing_package_is_named_before_the_work(
    package: str, more: list[str], extra: str, here: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.delitem(sys.modules, "vegtool.gl.window_viewer", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setattr("vegtool.preview.world.read_world", lambda *_: pytest.fail("worked"))
    assert run(["preview", "out", *more]) == 5
    assert extra in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT to a process of one's own on Windows")
def test_interrupted_in_the_middle_of_a_film_nothing_is_left(here: Path) -> None:
    code = """
import os, signal
from vegtool.cli import main
from vegtool.preview.show import Show
frame, count = Show.frame, 0
def interrupted(self, *rest):
    global count
    count += 1
    if count == 3:
        os.kill(os.getpid(), signal.SIGINT)
    frame(self, *rest)
Show.frame = interrupted
main()
"""
    before = contents(here)
    arguments = [sys.executable, "-c", code, "preview", "out", "--path", "way.toml"]
    arguments += ["-o", "films/walk.png", *SIZE]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert "interrupted" in done.stderr and "Traceback" not in done.stderr
    assert contents(here) == before and not Path("films").exists()


def test_an_import_takes_nothing_heavy() -> None:
    assert "vegtool.preview.drawn" not in vars(command), "the command line reads it for its help"


# -- the window -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    with xvfb.display() as name:
        yield name


def walk(plan: dict[int, list[str]], arguments: list[str], folder: str) -> tuple[int, str, str]:
    """Run a window, strike keys as planned, by how often it was asked whether to close since its
    first frame; what it came to, and what it printed. A key ends with - where it is let go."""
    from contextlib import redirect_stderr, redirect_stdout
    from io import StringIO

    os.chdir(folder)
    asked = 0
    wants_close = Show.wants_close

    def told(show: Show) -> bool:
        nonlocal asked
        if show.stats is not None:
            for key in plan.get(asked, []):
                xvfb.strike(key.removesuffix("-"), press=not key.endswith("-"))
            asked += 1
        return wants_close(show)

    Show.wants_close = told  # type: ignore[method-assign]
    out, error = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(error):
        code = run(["preview", *arguments])
    return code, out.getvalue(), error.getvalue()


def keep(folder: str) -> None:
    plan = {2: ["p"], 4: ["p-"], 6: ["p"], 8: ["p-", "r"], 12: ["w"], 30: ["w-", "r-"], 32: ["r"]}
    plan |= {34: ["r-"], 36: ["r"], 50: ["Escape"]}
    code, out, said = walk(plan, ["out", "--scene", "scene.toml", "--json", *SIZE], folder)
    assert code == 0, said
    facts = json.loads(out)
    assert facts["pictures"] == ["vegtool_0001.png", "vegtool_0003.png"], "2 is the user's own"
    assert facts["ways"] == ["way_0001.toml", "way_0002.toml"], "closing ends what is recorded"
    assert "vegtool_0001.png: saved" in said and "--path way_0001.toml walks it again" in said


def test_pictures_and_ways_are_kept(here: Path, display: str) -> None:
    Path("vegtool_0002.png").write_text("the user's own")
    xvfb.alone(keep, str(here), environment={"DISPLAY": display})
    with Image.open("vegtool_0001.png") as picture:
        assert picture.size == (120, 80)
    assert Path("vegtool_0002.png").read_text() == "the user's own"
    path = read_path(Path("way_0001.toml"))
    first, last = path.stations[0], path.stations[-1]
    assert last.position[2] < first.position[2], "w goes where the eye looks, along -z"
    assert last.time_s is not None and last.time_s > 0
    arguments = ["preview", "out", "--scene", "scene.toml", "--path", "way_0001.toml"]
    assert run([*arguments, "--screenshot", "again.png", *SIZE]) == 0, "the way can be walked"
    once, again = (np.asarray(Image.open(f)) for f in ("vegtool_0001.png", "again.png"))
    assert np.array_equal(once, again), "its first station is where the picture was taken"


def fail_to_keep(folder: str) -> None:
    """The folder cannot be written; the walk goes on, and ends as it does."""
    refuse_to_write()
    plan = {2: ["p"], 4: ["p-", "r"], 8: ["r-"], 10: ["r"], 20: ["Escape"]}
    code, out, said = walk(plan, ["out", "--json", *SIZE], folder)
    assert code == 0, said
    facts = json.loads(out)
    assert facts["pictures"] == facts["ways"] == []
    assert "the picture was not saved: " in said and "the way was not saved: " in said
    assert said.count("there is no room for it") == 2


def refuse_to_write() -> None:
    def full(path: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    Path.write_bytes = full  # type: ignore[method-assign, assignment]


def test_where_nothing_can_be_kept_the_walk_goes_on(here: Path, display: str) -> None:
    before = contents(here)
    xvfb.alone(fail_to_keep, str(here), environment={"DISPLAY": display})
    assert contents(here) == before


def play(folder: str) -> None:
    seen: list[float] = []
    look_from = Show.look_from

    def watched(show: Show, eye: object) -> None:
        look_from(show, eye)  # type: ignore[arg-type]
        seen.append(show.state.eye.position[2])
        if len(seen) == 3:
            shutil.rmtree(Path(folder) / "out")  # the plants' files, while they are shown

    Show.look_from = watched  # type: ignore[method-assign, assignment]
    arguments = ["out", "--scene", "scene.toml", "--path", "way.toml", *SIZE]
    code, _, said = walk({60: ["Escape"]}, arguments, folder)
    assert (code, said) == (0, "")
    assert min(seen) < max(seen) <= 15.0 and min(seen) >= 14.0


def test_a_way_is_played_and_files_that_go_are_not_missed(here: Path, display: str) -> None:
    """Levels are read before the first frame: what is deleted later is shown on."""
    xvfb.alone(play, str(here), environment={"DISPLAY": display})
    assert not Path("out").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="Xvfb is X11's")
def test_interrupting_a_window_is_exit_130_and_nothing_half_written(
    here: Path, display: str
) -> None:
    before = contents(here)
    started = subprocess.Popen(
        [sys.executable, "-m", "vegtool", "preview", "out", "-v", *SIZE],
        env={**os.environ, "DISPLAY": display}, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert started.stderr is not None
    assert "bush" in started.stderr.readline(), "it has read the plants, and opens the window"
    time.sleep(0.5)
    started.send_signal(signal.SIGINT)
    _, said = started.communicate(timeout=60)
    assert started.returncode == 130
    assert "interrupted" in said and "Traceback" not in said
    assert contents(here) == before


def test_the_page_has_the_keys_that_there_are() -> None:
    page = (Path(__file__).parents[2] / "docs" / "commands" / "preview.md").read_text("utf-8")
    table = page.split("### Keys")[1].split("\n\n")[1]
    rows = [
        tuple(cell.strip() for cell in row.strip("|").split(" | ")) for row in table.split("\n")
    ]
    shown = [tuple(re.split(r" {2,}", line, maxsplit=1)) for line in help_text().split("\n")]
    assert rows[2:] == shown
