"""The command line as a user meets it: what it prints, what it writes, how it fails."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from vegtool.cli import run
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample

pytestmark = pytest.mark.gl
SMALL = ["--billboards", "24", "--levels", "2"]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small bush in a folder of its own."""
    path = tmp_path_factory.mktemp("models") / "bush.glb"
    path.write_bytes(plant_glb(sample("bush", 600)))
    return path


def contents(folder: Path) -> dict[str, str]:
    return {p.name: sha256(p.read_bytes()).hexdigest() for p in sorted(folder.iterdir())}


def test_convert_writes_levels_combined_manifest_and_sheet(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run(["convert", str(model), "-o", str(out), *SMALL]) == 0
    assert set(contents(out)) == {
        "bush_LOD1.glb", "bush_LOD2.glb", "bush.glb", "bush.lod.json", "bush.png",
    }  # fmt: skip


def test_json_names_the_files(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["convert", str(model), "-o", str(tmp_path / "o"), "--json", *SMALL]) == 0
    (outcome,) = json.loads(capsys.readouterr().out)
    assert all(Path(f).is_file() for f in outcome["files"])
    assert [row["kind"] for row in outcome["levels"]] == ["mesh", "billboards", "billboards"]


def test_same_input_same_bytes_whatever_the_number_of_jobs(model: Path, tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a", "b"):
        (folder / f"{name}.glb").write_bytes(model.read_bytes())
    one, two = tmp_path / "one", tmp_path / "two"
    assert run(["convert", str(folder), "-o", str(one), "-j", "1", *SMALL]) == 0
    assert run(["convert", str(folder), "-o", str(two), "-j", "2", *SMALL]) == 0
    assert contents(one) == contents(two)


def test_nothing_is_overwritten_unless_forced(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["convert", str(model), "-o", str(tmp_path), *SMALL]) == 0
    before = contents(tmp_path)
    assert run(["convert", str(model), "-o", str(tmp_path), *SMALL, "--seed", "1"]) == 1
    assert "-f" in capsys.readouterr().err
    assert contents(tmp_path) == before
    assert run(["convert", str(model), "-o", str(tmp_path), *SMALL, "-f"]) == 0


def test_the_input_itself_is_never_overwritten(model: Path) -> None:
    before = contents(model.parent)
    assert run(["convert", str(model), "-o", str(model.parent), *SMALL, "-f"]) == 1
    assert contents(model.parent) == before


def test_dry_run_says_what_would_be_made_and_writes_nothing(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["convert", str(model), "-o", str(out), "--dry-run", "--json", *SMALL]) == 0
    (outcome,) = json.loads(capsys.readouterr().out)
    assert not out.exists()
    assert run(["convert", str(model), "-o", str(out), "--json", *SMALL]) == 0
    (made,) = json.loads(capsys.readouterr().out)
    for planned, level in zip(outcome["levels"], made["levels"], strict=True):
        assert planned["billboards"] == level["billboards"]
        assert planned["triangles"] == level["triangles"]


def test_one_bad_file_does_not_stop_the_others(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    (folder / "bad.glb").write_text("this is no glTF")
    (folder / "good.glb").write_bytes(model.read_bytes())
    assert run(["convert", str(folder), "-o", str(out), *SMALL]) == 3
    said = capsys.readouterr().err
    assert "bad.glb" in said
    assert "Traceback" not in said
    assert {p.name for p in out.glob("good*")} >= {"good.glb", "good.lod.json"}
    assert not list(out.glob("bad*"))


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["convert", "nowhere.glb", "-o", "out"], 1, "nowhere.glb"),
        (["convert", "plant.fbx", "-o", "out"], 5, "Blender"),
        (["convert", "bush.glb"], 2, "out"),
        (["convert", "bush.glb", "-o", "out", "--billboards", "0"], 2, "--billboards"),
        (["convert", "bush.glb", "-o", "out", "--billboards", "-3"], 2, "--billboards"),
        (["convert", "bush.glb", "-o", "out", "--billboards", "10000000"], 2, "--billboards"),
        (["convert", "bush.glb", "-o", "out", "--method", "magic"], 2, "magic"),
        (["convert", "bush.glb", "-o", "out", "--unit", "parsec"], 2, "parsec"),
        (["convert", "bush.glb", "-o", "out", "--config", "none.toml"], 2, "none.toml"),
        (["sample", "triffid", "-o", "x.glb"], 2, "broadleaf"),
        (["sample", "bush", "--triangles", "-3", "-o", "x.glb"], 2, "-3"),
        (["nonsense"], 2, "nonsense"),
    ],
)
def test_a_mistake_is_a_sentence_and_the_right_exit_code(
    arguments: list[str], code: int, sentence: str, model: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bush.glb").write_bytes(model.read_bytes())
    (tmp_path / "plant.fbx").write_bytes(b"Kaydara FBX Binary  \x00")
    before = contents(tmp_path)
    assert run(arguments) == code
    said = capsys.readouterr().err
    assert sentence in said
    assert "Traceback" not in said
    assert contents(tmp_path) == before, "a failed command leaves nothing behind"


def test_inspect_tells_what_was_read(model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", str(model), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["triangles"] == len(sample("bush", 600).faces)
    assert {m["role"] for m in found["materials"]} == {"wood", "leaf"}
    assert sum(found["branches"]["per_level"]) == found["branches"]["count"]
    assert run(["inspect", str(model)]) == 0
    assert "triangles" in capsys.readouterr().out


def test_inspect_writes_branches(model: Path, tmp_path: Path) -> None:
    import numpy as np

    path = tmp_path / "branches.npz"
    assert run(["inspect", str(model), "--branches", str(path), "-q"]) == 0
    with np.load(path) as table:
        assert set(table) == {"face_branch", "parent", "level"}
        assert table["face_branch"].max() < len(table["parent"]) == len(table["level"])


def test_doctor_passes_where_the_tests_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["doctor"]) == 0
    assert "renderer" in capsys.readouterr().out


def test_sample_lists_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sample", "--list", "--json"]) == 0
    names = json.loads(capsys.readouterr().out)
    assert {"broadleaf", "conifer", "bush", "palm", "dead-tree", "herb", "grass-clump"} <= set(
        names
    )
    path = tmp_path / "herb.glb"
    assert run(["sample", "herb", "-o", str(path), "--triangles", "400"]) == 0
    assert path.read_bytes()[:4] == b"glTF"
    assert run(["sample", "herb", "-o", str(path)]) == 1, "refused without -f"


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT to a process of one's own on Windows")
def test_interrupted_in_the_middle_nothing_is_half_written(model: Path, tmp_path: Path) -> None:
    """Ctrl-C comes while the second file of the set is being written."""
    code = """
import os, signal
from vegtool.cli import main
from vegtool.formats.atomic import FileSet
add, count = FileSet.add, 0
def interrupted(self, name, data):
    global count
    count += 1
    if count == 2:
        os.kill(os.getpid(), signal.SIGINT)
    add(self, name, data)
FileSet.add = interrupted
main()
"""
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("the user's own")
    arguments = [sys.executable, "-c", code, "convert", str(model), "-o", str(out), *SMALL]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=120)
    assert done.returncode == 130
    assert "interrupted" in done.stderr
    assert "Traceback" not in done.stderr
    assert [p.name for p in out.iterdir()] == ["mine.txt"]
