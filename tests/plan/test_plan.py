"""`vegtool plan`: what is kept and why, totals, and sentences for what cannot be."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from library_cases import write

from vegtool.cli import run

CAMERA = """
[camera]
polygon = [[-10, -10], [10, -10], [10, 10], [-10, 10]]
height_m = [1.6, 1.8]
"""
PLANTS = """
[[species]]
name = "oak"
[placement]
inventory = "trees.csv"
"""


def scene(folder: Path, camera: str = CAMERA, far: float = 40.0, more: str = "") -> Path:
    """An oak that stands so far along x."""
    write(folder, "oak")
    (folder / "trees.csv").write_text(f"x,y,species\n{far},0,oak\n", "utf-8")
    path = folder / "scene.toml"
    path.write_text(camera + PLANTS + more, "utf-8")
    return path


def planned(folder: Path, path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    assert run(["plan", str(path), "--species", str(folder), "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_levels_that_no_eye_is_near_enough_for_are_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Levels from 10 and from 25 m on, the tree 30 m from the area at least: the last alone."""
    found = planned(tmp_path, scene(tmp_path), capsys)
    rows = found["levels"]
    assert isinstance(rows, list) and [row["kept"] for row in rows] == [False, False, True]
    assert "no eye is within" in rows[0]["why"]
    after, before = found["after"], found["before"]
    assert isinstance(after, dict) and isinstance(before, dict)
    assert after["bytes"] == rows[2]["bytes"] < before["bytes"]
    (one,) = found["species"]  # type: ignore[misc]
    assert 29 < one["nearest_m"] <= 30.1 and one["plants"] == 1


def test_who_walks_among_them_needs_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = planned(tmp_path, scene(tmp_path, far=5.0), capsys)
    assert found["before"] == found["after"] or all(
        row["kept"] or "no eye is beyond" in row["why"]
        for row in found["levels"]  # type: ignore[attr-defined]
    )


def test_a_file_is_written_whole_and_tables_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = scene(tmp_path), tmp_path / "plan.json"
    words = ["plan", str(path), "--species", str(tmp_path), "-o", str(out)]
    assert run(words) == 0
    told = capsys.readouterr().out
    assert "no eye is within" in told and "squares of m" in told
    assert json.loads(out.read_text("utf-8"))["scene"] == str(path)
    assert run(words) == 1
    assert "exists already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("camera", "more", "message"),
    [
        ("", "", "expected where viewers are"),
        (CAMERA.replace("1.6, 1.8", "1.8, 1.6"), "", "line 4"),
        (CAMERA + "sees = 1\n", "", "line 5"),
        (CAMERA, "[budget]\nbytes = 0\n", "expected at least 1"),
    ],
)
def test_what_cannot_be_is_a_sentence_with_its_line(
    tmp_path: Path, camera: str, more: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = scene(tmp_path, camera, more=more)
    assert run(["plan", str(path), "--species", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.gl
def test_a_budget_is_spent_or_refused_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All that is needed fits into a megabyte; nothing does into a byte."""
    path = scene(tmp_path, more="[budget]\nbytes = 1000000\n")
    spent = planned(tmp_path, path, capsys)["budget"]
    assert isinstance(spent, dict) and spent["kept"][0]["levels"] == [2]
    path.write_text(path.read_text("utf-8").replace("1000000", "1"), "utf-8")
    assert run(["plan", str(path), "--species", str(tmp_path)]) == 2
    assert "scene.toml, line 11" in capsys.readouterr().err
