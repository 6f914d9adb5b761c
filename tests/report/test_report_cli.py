"""`vegtool report` as a user meets it: what it writes, how it goes on, how it fails."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from vegtool.cli import run
from vegtool.formats.gltf import plant_glb
from vegtool.gl.context import context
from vegtool.growth import sample
from vegtool.report import plots
from vegtool.report import run as running
from vegtool.report.journal import NAME as JOURNAL
from vegtool.stability.case import CaseResult

pytestmark = pytest.mark.gl
SMALL = ["--methods", "kmeans", "--budgets", "4,12", "--view-count", "1"]
FILES = {"report.json", "report.csv", "report.html"}
ROWS = [
    "live", "kmeans 12", "kmeans 4", "quadric 12", "quadric 4", "gltfpack 12", "gltfpack 4",
    "crossed", "octahedral",
]  # fmt: skip


@pytest.fixture(autouse=True)
def no_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plots are test_plots.py's; here one report that has some suffices."""
    monkeypatch.setattr("vegtool.report.page._plots", lambda found, of: "")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small bush in a folder of its own."""
    path = tmp_path_factory.mktemp("models") / "bush.glb"
    path.write_bytes(plant_glb(sample("bush", 400)))
    return path


@pytest.fixture(scope="module")
def made(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished report of it."""
    out = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vegtool.report.page.COST_AXES", plots.COST_AXES[:1])
        assert run(["report", str(model), "-o", str(out), "-q", *SMALL]) == 0
    return out


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def errors_of(folder: Path) -> dict[str, Any]:
    """All that does not depend on the clock: by row, the error from every view."""
    (plant,) = json.loads((folder / "report.json").read_text())["plants"]
    return {row["name"]: row["values"] for row in plant["rows"]}


def test_it_writes_a_page_and_two_tables(made: Path) -> None:
    assert names(made) == FILES
    found = list(errors_of(made))
    without_gltfpack = [name for name in ROWS if not name.startswith("gltfpack")]
    assert found in (ROWS, without_gltfpack)
    assert "<svg" in (made / "report.html").read_text()
    values = json.loads((made / "report.json").read_text())
    row = values["plants"][0]["rows"][1]
    assert 0 < row["cost"]["billboards"] <= 12
    assert row["cost"]["frame"]["frames"] >= 30
    assert len(row["values"]["flip"]) == 5
    assert values["options"]["view_count"] == 1


def test_an_interrupted_report_goes_on_where_it_stopped(
    model: Path,
    made: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The second run makes the rows that were missing and no others, and the result is the same."""
    done: list[str] = []
    measured = running.measured

    def until_tired(*arguments: Any) -> Any:
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(arguments[1].name)
        return measured(*arguments)

    arguments = ["report", str(model), "-o", str(tmp_path), *SMALL]
    with monkeypatch.context() as patch:
        patch.setattr(running, "measured", until_tired)
        assert run(arguments) == 130
    assert names(tmp_path) == {JOURNAL}
    assert "the same command goes on from there" in capsys.readouterr().err
    assert done == ROWS[:3]

    def the_rest(*arguments: Any) -> Any:
        done.append(arguments[1].name)
        return measured(*arguments)

    monkeypatch.setattr(running, "measured", the_rest)
    assert run(arguments) == 0
    assert done == ROWS
    assert names(tmp_path) == FILES
    assert errors_of(tmp_path) == errors_of(made)


def test_nothing_is_promised_where_nothing_was_finished(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def tired(*arguments: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "read_plant", tired)
    assert run(["report", str(model), "-o", str(tmp_path / "out"), *SMALL]) == 130
    assert "goes on from there" not in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_with_another_report_is_refused_unless_forced(
    model: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path.name: path.read_bytes() for path in made.iterdir()}
    assert run(["report", str(model), "-o", str(made), *SMALL]) == 1
    assert "a report of bush stands here. Overwrite it with -f" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in made.iterdir()} == before


def test_forced_and_with_a_limit_and_without_gltfpack(
    model: Path,
    made: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Nothing errs by more than 1: with this limit all may be used from where their texels are
    small enough, which are 256 along the longest side of two crossed billboards."""
    for path in made.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr("vegtool.baselines.gltfpack.shutil.which", lambda name: None)
    arguments = ["report", str(model), "-o", str(tmp_path), "-f", *SMALL, "--max-error", "1"]
    assert run(arguments) == 0
    assert names(tmp_path) == FILES
    assert capsys.readouterr().err.count("gltfpack was not found on the PATH") == 1
    (plant,) = json.loads((tmp_path / "report.json").read_text())["plants"]
    rows = {row["name"]: row for row in plant["rows"]}
    assert "gltfpack 4" not in rows
    at_400_pixels = rows["crossed"]["distance_m"][0]
    assert rows["crossed"]["switch_distance_m"] == pytest.approx(
        at_400_pixels * 400 / 256, rel=0.01
    )


def test_a_folder_with_another_unfinished_report_is_refused(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / JOURNAL).write_text('{"report": "another"}\n')
    assert run(["report", str(model), "-o", str(tmp_path), *SMALL]) == 1
    assert "an unfinished report with other options stands here" in capsys.readouterr().err
    assert names(tmp_path) == {JOURNAL}


def test_a_broken_plant_does_not_stop_the_others(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.glb").write_text("this is no glTF")
    out = tmp_path / "out"
    arguments = [str(tmp_path / "bad.glb"), str(model), "-o", str(out), "--json", *SMALL[:2]]
    assert run(["report", *arguments, "--budgets", "4", "--view-count", "1"]) == 3
    printed = capsys.readouterr()
    assert "1 of 2 plants failed" in printed.err
    summary = json.loads(printed.out)
    assert all(Path(file).is_file() for file in summary["files"])
    assert summary["plants"]["bush"][0]["row"] == "live"
    assert 0 < summary["plants"]["bush"][0]["flip"]["100"]["mean"] < 1
    values = json.loads((out / "report.json").read_text())
    assert [plant["name"] for plant in values["plants"]] == ["bush"]
    assert "bad.glb" in values["failed"]["bad"]


def test_an_only_plant_that_is_broken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.glb").write_text("this is no glTF")
    out = tmp_path / "out"
    assert run(["report", str(tmp_path / "bad.glb"), "-o", str(out)]) == 1
    assert "bad.glb" in capsys.readouterr().err
    assert run(["report", str(tmp_path / "bad.glb"), str(tmp_path / "no.glb"), "-o", str(out)]) == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--view-count", "0"], "--view-count: expected 1 to"),
        (["--views", "mars"], "'mars' is not one of"),
        (["--budgets", "16,-4"], "--budgets: expected whole numbers from 1 to"),
        (["--budgets=-4"], "got -4"),
        (["--budgets", "0"], "got 0"),
        (["--budgets", "many"], "got many"),
        (["--budgets", "9" * 5000], "got 999"),
        (["--budgets", ""], "got none"),
        (
            ["--methods", "kmeans,voronoi"],
            "expected some of refined, hybrid, surfel-billboards, surfels, branches, isodata, "
            "kmeans, planes; got voronoi",
        ),
        (["--methods", ","], "got none"),
        (["--max-error", "2"], "--max-error: expected 0 to 1"),
        (["--fov", "179"], "--fov: expected 1 to 170"),
        (["--stability"], "no plants"),
    ],
)
def test_options_that_make_no_sense(
    arguments: list[str],
    sentence: str,
    model: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    assert run(["report", str(model), "-o", str(out), *arguments]) == 2
    assert sentence in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "expected a plant to report on; got none"),
        (["-o", "out"], "expected a plant to report on; got none"),
        (["oak.glb"], "expected a folder for the report (-o out/); got none"),
    ],
)
def test_no_plant_or_no_folder(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["report", *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_a_gl_that_cannot_multisample(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is said before anything is read, of several plants too."""
    monkeypatch.setattr(type(context()), "max_samples", property(lambda ctx: 1))
    monkeypatch.setattr(running, "read_plant", None)
    for models in ([str(model)], [str(model), str(tmp_path / "no.glb")]):
        assert run(["report", *models, "-o", str(tmp_path / "out"), *SMALL]) == 5
        assert "multisampling" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("passed", "code"), [(True, 0), (False, 4)])
def test_stability_is_told_and_written(
    passed: bool,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The cases themselves are those of tests/stability."""
    error = 0.0 if passed else float("inf")
    case = CaseResult("needles", "boxes", "exact", error, 1e-9, "by hand", None, 0.1, passed, "")
    monkeypatch.setattr("vegtool.stability.run", lambda progress: [case])
    assert run(["report", "--stability", "-o", str(tmp_path)]) == code
    printed = capsys.readouterr()
    assert "needles" in printed.out
    assert (tmp_path / "stability.md").read_text().strip() == printed.out.strip()
    assert ("1 of 1 cases failed: needles" in printed.err) == (not passed)
    assert run(["report", "--stability", "--json"]) == code
    assert json.loads(capsys.readouterr().out)[0]["passed"] == passed
    assert run(["report", "--stability", "-o", str(tmp_path)]) == 1, "it stands there already"


def test_nothing_is_said_but_the_error_where_matplotlib_cannot_keep_its_cache(
    tmp_path: Path,
) -> None:
    home = {**os.environ, "MPLCONFIGDIR": str(Path(__file__) / "no_folder")}
    command = [sys.executable, "-m", "vegtool", "report", "no.glb", "-q", "-o", str(tmp_path / "o")]
    done = subprocess.run(command, capture_output=True, text=True, env=home)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1


def test_without_matplotlib_it_ends_at_once(model: Path, tmp_path: Path) -> None:
    code = f"""
import sys
sys.modules["matplotlib"] = None
from vegtool.cli import run
sys.exit(run(["report", {str(model)!r}, "-o", {str(tmp_path / "out")!r}]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 5
    assert "pip install 'vegtool[report]'" in done.stderr
    assert not (tmp_path / "out").exists()
