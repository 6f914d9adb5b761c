"""The command line as a user meets it: what it prints, what it writes, how it fails."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from vegtool.batch import find_jobs
from vegtool.cli import run
from vegtool.convert import ConvertOptions
from vegtool.errors import UsageError
from vegtool.formats.gltf import plant_glb
from vegtool.formats.manifest import read_manifest
from vegtool.growth import sample

pytestmark = pytest.mark.gl
SMALL = ["--billboards", "24", "--levels", "2", "--refine", "none", "--measure", "off"]
MEASURED = [*SMALL[:-1], "quick"]
REFINED = ["--billboards", "24", "--levels", "2"]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small bush in a folder of its own."""
    path = tmp_path_factory.mktemp("models") / "bush.glb"
    path.write_bytes(plant_glb(sample("bush", 600)))
    return path


def contents(folder: Path) -> dict[str, str]:
    return {p.name: sha256(p.read_bytes()).hexdigest() for p in sorted(folder.iterdir())}


@pytest.mark.parametrize("how", [SMALL, REFINED], ids=["plain", "refined"])
def test_convert_writes_levels_combined_manifest_and_sheet(
    how: list[str], model: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert run(["convert", str(model), "-o", str(out), *how, "--measure", "off"]) == 0
    assert set(contents(out)) == {
        "bush_LOD1.glb", "bush_LOD2.glb", "bush.glb", "bush.lod.json", "bush.png",
    }  # fmt: skip


def test_the_manifest_holds_all_options_that_shaped_the_levels(model: Path, tmp_path: Path) -> None:
    """How the file was understood, too: without it the same levels could not be made again."""
    out = tmp_path / "out"
    reading = ["--unit", "dm", "--leaf-material", "*twig*"]
    assert run(["convert", str(model), "-o", str(out), *SMALL, *reading]) == 0
    options = json.loads((out / "bush.lod.json").read_text())["options"]
    assert (options["billboards"], options["levels"]) == (24, 2)
    assert (options["unit"], options["up"]) == ("dm", "auto")
    assert options["leaf_materials"] == ["*twig*"]


def test_json_names_the_files(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["convert", str(model), "-o", str(tmp_path / "o"), "--json", *SMALL]) == 0
    (outcome,) = json.loads(capsys.readouterr().out)
    assert all(Path(f).is_file() for f in outcome["files"])
    assert [row["kind"] for row in outcome["levels"]] == ["mesh", "billboards", "billboards"]


def test_the_result_states_distances_and_errors(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["convert", str(model), "-o", str(out), "--json", *MEASURED]) == 0
    (outcome,) = json.loads(capsys.readouterr().out)
    levels = read_manifest(out / "bush.lod.json")["levels"]
    assert len(levels) == len(outcome["levels"]) > 1
    for row, level in zip(outcome["levels"], levels, strict=True):
        assert row["switch_distance_m"] == level["switch_distance_m"]
    for row, level in zip(outcome["levels"][1:], levels[1:], strict=True):
        assert row["flip"] == level["measured"]["flip"]["mean"]
        assert row["live_flip"] == level["measured"]["live"]["flip"]["mean"]
    assert run(["convert", str(model), "-o", str(out), "-f", *MEASURED]) == 0
    assert str(outcome["levels"][1]["flip"]) in capsys.readouterr().out


def test_a_limit_that_is_missed_is_exit_4_and_the_files_are_there(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from vegtool.measure import chain

    monkeypatch.setattr(chain, "HELD_OUT_MARGIN", -1.0)
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b"):
        (folder / f"{name}.glb").write_bytes(model.read_bytes())
    limited = ["--max-error", "0.3", *MEASURED]
    assert run(["convert", str(folder / "a.glb"), "-o", str(out), *limited]) == 4
    assert "LOD1 from" in capsys.readouterr().err
    assert (out / "a.lod.json").exists()
    assert run(["convert", str(folder), "-o", str(out), "-f", *limited]) == 4
    assert (out / "b.lod.json").exists()
    (folder / "c.glb").write_text("this is no glTF")
    assert run(["convert", str(folder), "-o", str(out), "-f", *limited]) == 3, "a part failed"
    assert "b: LOD1 from" in capsys.readouterr().err, "what was missed is told all the same"


def test_a_limit_that_no_level_keeps_to_is_exit_4_and_nothing_is_written(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["convert", str(model), "-o", str(out), *MEASURED, "--max-error", "0"]) == 4
    assert "--max-error" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("measure", ["quick", "off"])
def test_a_gl_that_cannot_multisample_is_exit_5(
    measure: str, model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr("moderngl.Context.max_samples", 1)
    arguments = ["convert", str(model), "-o", str(tmp_path / "o"), *SMALL[:-1], measure]
    assert run(arguments) == 5
    assert "multisampling" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("how", [MEASURED, REFINED], ids=["plain", "refined"])
def test_same_input_same_bytes_whatever_the_number_of_jobs(
    how: list[str], model: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a", "b"):
        (folder / f"{name}.glb").write_bytes(model.read_bytes())
    one, two = tmp_path / "one", tmp_path / "two"
    assert run(["convert", str(folder), "-o", str(one), "-j", "1", *how]) == 0
    assert run(["convert", str(folder), "-o", str(two), "-j", "2", *how]) == 0
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


def test_what_throws_the_shadow_is_written_beside_the_levels_and_told(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["convert", str(model), "-o", str(out), *SMALL, "--shadow-proxy", "40"]
    assert run([*arguments, "--dry-run", "--json"]) == 0
    (planned,) = json.loads(capsys.readouterr().out)
    assert run([*arguments, "--json"]) == 0
    (made,) = json.loads(capsys.readouterr().out)
    assert planned["files"] == made["files"] and planned["shadow"] == made["shadow"]
    shadow = read_manifest(out / "bush.lod.json")["shadow"]
    assert made["files"][str(out / "bush_shadow.glb")] == shadow["bytes"]
    assert made["shadow"]["triangles"] == shadow["triangles"] <= 40
    assert made["shadow"]["coverage_bias"] == shadow["coverage_bias"]["mean"]
    spread = shadow["coverage_bias"]
    assert made["shadow"]["worst_coverage_bias"] in (spread["low"], spread["high"])
    assert made["shadow"]["silhouette"] == shadow["silhouette"]["mean"]
    assert run([*arguments, "-f"]) == 0
    said = capsys.readouterr().out
    assert f"shadow: {shadow['triangles']} triangles; seen from 12 suns, 100 pixels large" in said
    assert f"silhouette error {shadow['silhouette']['mean']}" in said
    assert run(["convert", str(model), "-o", str(out), "-f", "--json", *SMALL]) == 0
    assert json.loads(capsys.readouterr().out)[0]["shadow"] is None


def test_packed_light_is_written_beside_the_levels(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["convert", str(model), "-o", str(out), *SMALL, "--packed"]
    lit = [*arguments, "--translucency", "0.4"]
    assert run([*lit, "--dry-run", "--json"]) == 0
    (planned,) = json.loads(capsys.readouterr().out)
    assert run([*lit, "--json"]) == 0
    (made,) = json.loads(capsys.readouterr().out)
    assert planned["files"] == made["files"]
    assert {"bush_LOD1_leaf.png", "bush_LOD2_leaf.png"} <= set(contents(out))
    levels = read_manifest(out / "bush.lod.json")["levels"]
    assert [level.get("leaf") for level in levels[1:]] == [
        "bush_LOD1_leaf.png",
        "bush_LOD2_leaf.png",
    ]
    assert run([*arguments, "-o", str(tmp_path / "plain")]) == 0
    assert "--packed: no level has light beside its colours" in capsys.readouterr().err
    assert not list((tmp_path / "plain").glob("*_leaf.png"))


@pytest.mark.parametrize(
    ("name", "option"),
    [("bush_shadow.glb", ["--shadow-proxy", "8"]), ("bush_LOD1_leaf.png", ["--packed"])],
)
def test_files_in_the_way_are_refused_before_the_work(
    name: str, option: list[str], model: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (tmp_path / name).write_text("the user's own")
    monkeypatch.setattr("vegtool.convert.chain.convert", lambda *_: pytest.fail("worked"))
    assert run(["convert", str(model), "-o", str(tmp_path), *SMALL, *option]) == 1
    assert f"{name}: exists already" in capsys.readouterr().err
    assert contents(tmp_path).keys() == {name}


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
        (["convert", "bush.glb", "-o", "out", "--method", "kmeans"], 2, "add --refine none"),
        (["convert", "bush.glb", "-o", "out", "--refine", "some"], 2, "some"),
        (["convert", "bush.glb", "-o", "out", "--pixels", "7"], 2, "--pixels: expected 8 to"),
        (["convert", "bush.glb", "-o", "out", "--unit", "parsec"], 2, "parsec"),
        (["convert", "bush.glb", "-o", "out", "--config", "none.toml"], 2, "none.toml"),
        (["convert", "bush.glb", "-o", "out", "--max-error", "-0.1"], 2, "--max-error"),
        (["convert", "bush.glb", "-o", "out", "--max-error", "nan"], 2, "--max-error"),
        (["convert", "bush.glb", "-o", "out", "--max-pixels", "0"], 2, "--max-pixels"),
        (["convert", "bush.glb", "-o", "out", "--views", "below"], 2, "below"),
        (["convert", "bush.glb", "-o", "out", "--shadow-proxy", "1"], 2, "--shadow-proxy: expec"),
        (["convert", "bush.glb", "-o", "out", "--scene", "none.toml"], 2, "none.toml: cannot"),
        (["convert", "bush.glb", "-o", "out", "--scene", ""], 2, "empty"),
        (["convert", "bush.glb", "-o", "out", "--scene", "plant.fbx"], 2, "expected TOML"),
        (
            ["convert", "bush.glb", "-o", "out", "--measure", "off", "--max-error", "0.1"],
            2,
            "--measure off",
        ),
        (
            ["convert", "bush.glb", "-o", "out", "--fov", "170", "--image-height", "64"],
            2,
            "narrower",
        ),
        (["sample", "triffid", "-o", "x.glb"], 2, "broadleaf"),
        (["sample", "bush", "--triangles", "-3", "-o", "x.glb"], 2, "-3"),
        (["sample", "bush", "-o", "bush.obj"], 2, ".glb"),
        (["inspect", "bush.glb", "--branches", "bush.glb", "-f"], 2, ".npz"),
        (["preview", "modles", "--screenshot", "a.png"], 1, "modles: expected a folder of"),
        (["preview", "bush.glb", "--out", "way.mp4"], 2, "--out: writes a walk; add the way"),
        (["preview", "bush.glb", "--frames", "1", "--fade", "slowly"], 2, "slowly"),
        (["preview", "bush.glb", "--frames", "1", "--config", "none.toml"], 2, "none.toml"),
        (["nonsense"], 2, "nonsense"),
        (["convert", "", "-o", "out"], 2, "empty"),
        (["convert", "bush.glb", "-o", ""], 2, "empty"),
        (["convert", "modles", "-o", "out"], 1, "nothing there"),
        (["convert", "bush.glb", "-o", "out", "--unit", "1e-300"], 2, "--unit"),
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


def test_inspect_tells_what_light_does_to_a_material(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plant = sample("bush", 600)
    first, *others = plant.materials
    lit = (replace(first, unlit=True), *(replace(m, transmission=0.4) for m in others))
    path = tmp_path / "bush.glb"
    path.write_bytes(plant_glb(replace(plant, materials=lit)))
    assert run(["inspect", str(path), "--json"]) == 0
    materials = json.loads(capsys.readouterr().out)["materials"]
    assert [(m["unlit"], m["transmission"]) for m in materials] == [(True, 0), (False, 0.4)]
    assert run(["inspect", str(path)]) == 0
    said = capsys.readouterr().out
    rows = {m["name"]: next(r for r in said.splitlines() if m["name"] in r) for m in materials}
    assert [row.split("  ")[-1].strip() for row in rows.values()] == ["unlit", "passes 0.40"]


def test_help_shows_what_stands_in_brackets(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rich takes [words] for styles and drops them; what is meant as one is still one."""
    monkeypatch.setenv("COLUMNS", "500")
    assert run(["convert", "--help"]) == 0
    said = capsys.readouterr().out
    helps = {f.metadata["help"] for f in fields(ConvertOptions)}
    bracketed = [words for text in helps for words in re.findall(r"\[[^]]*\]", text)]
    assert bracketed, "or this shows nothing"
    for words in bracketed:
        assert words in said
    assert "\\[" not in said and "[bold]" not in said and "Examples" in said
    assert not any("{" in text for text in helps), "names of constants are filled in"


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


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT to a process of one's own on Windows")
@pytest.mark.parametrize(
    ("number", "after"), [("SIGINT", 0.5), ("SIGTERM", 0.5), ("SIGTERM", 0.001)]
)
def test_an_interrupted_batch_ends_its_workers(
    model: Path, tmp_path: Path, number: str, after: float
) -> None:
    """The signal comes to the first process alone, while workers are started or at work."""
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for name in "abcd":
        (folder / f"{name}.glb").write_bytes(model.read_bytes())
    code = f"""
import os, signal
from concurrent.futures import ProcessPoolExecutor as Pool
submit, count = Pool.submit, 0
def submit_and_kill(*arguments):
    global count
    count += 1
    if count == (4 if {after} > 0.1 else 1):
        signal.setitimer(signal.ITIMER_REAL, {after})
    return submit(*arguments)
signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.{number}))
if __name__ == "__main__":
    Pool.submit = submit_and_kill
    from vegtool.cli import main
    main()
"""
    script = tmp_path / "start.py"
    script.write_text(code)
    arguments = [sys.executable, str(script), "convert", str(folder), "-o", str(out), "-j", "2"]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=120)
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert not out.exists(), "workers end before they write"


def test_a_bug_in_one_file_does_not_stop_the_others(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from vegtool import batch

    read = batch.read_plant
    (tmp_path / "a.glb").write_bytes(model.read_bytes())
    (tmp_path / "b.glb").write_bytes(model.read_bytes())

    def read_with_bug(path: Path, options: Any) -> Any:
        return read(path, options) if path.stem == "b" else 1 // 0

    monkeypatch.setattr(batch, "read_plant", read_with_bug)
    assert run(["convert", str(tmp_path), "-o", str(tmp_path / "o"), *SMALL]) == 3
    assert "a.glb: vegtool failed in a way that it does not know" in capsys.readouterr().err
    assert (tmp_path / "o" / "b.glb").exists()
    assert run(["convert", str(tmp_path / "a.glb"), "-o", str(tmp_path / "o"), "-vv"]) == 1
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_folder_named_like_a_model_is_no_model(model: Path, tmp_path: Path) -> None:
    (tmp_path / "folder.glb").mkdir()
    (tmp_path / "UPPER.GLB").write_bytes(model.read_bytes())
    assert [job.name for job in find_jobs([tmp_path])] == ["UPPER"]


def test_what_lies_beside_another_input_is_never_overwritten(model: Path, tmp_path: Path) -> None:
    """The first input's contact sheet would take the place of the second's texture."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "oak.glb").write_bytes(model.read_bytes())
    (other / "bush.png").write_text("a texture of the oak")
    before = contents(other)
    arguments = ["convert", str(model), str(other / "oak.glb"), "-o", str(other), "-f", *SMALL]
    assert run(arguments) == 1, "both"
    assert contents(other) == before


def test_verbose_says_where_the_time_went(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["convert", str(model), "--dry-run", "--levels", "1", "-o", str(tmp_path)]
    arguments += ["--measure", "off", "--billboards", "24"]
    assert run(arguments) == 0
    assert " s, " not in capsys.readouterr().err
    for refine, stages in (("full", ("wood", "planes")), ("none", ("clustering", "boxes"))):
        assert run([*arguments, "-v", "--refine", refine]) == 0
        said = capsys.readouterr().err
        assert all(f"{stage} 0." in said for stage in stages)


@pytest.mark.parametrize("more", [[], ["--dry-run"]])
def test_a_file_in_place_of_the_folder_is_said_before_the_work(
    more: list[str], model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("the user's own")
    folder = tmp_path / "file" / "out"
    assert run(["convert", str(model), "-o", str(folder), *SMALL, *more]) == 1
    assert "a file stands where its folder should be" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "the user's own"


def test_levels_of_an_earlier_run_are_no_models(tmp_path: Path) -> None:
    for name in ("oak", "oak_LOD1", "oak_LOD2", "oak_shadow", "mine_LOD1", "my_shadow"):
        (tmp_path / f"{name}.glb").touch()
    (tmp_path / "oak.lod.json").touch()
    assert [job.name for job in find_jobs([tmp_path])] == ["mine_LOD1", "my_shadow", "oak"]
    for other in ("oak_LOD1.glb", "oak_shadow.glb"):
        with pytest.raises(UsageError, match="same name"):
            find_jobs([tmp_path / "oak.glb", tmp_path / other])


@pytest.mark.skipif(sys.platform != "linux", reason="file names need not be Unicode on Linux only")
def test_a_name_that_is_no_unicode(model: Path, tmp_path: Path) -> None:
    source = tmp_path / os.fsdecode(b"bad\xff.glb")
    source.write_bytes(model.read_bytes())
    out = tmp_path / "out"
    arguments = [sys.executable, "-m", "vegtool", "convert", str(source), "-o", str(out), *SMALL]
    done = subprocess.run(arguments, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert os.fsencode(out / "bad") + b"\xff.glb" in map(os.fsencode, out.iterdir())


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("billboards = 24\nwidth = 3", "line 2: no option is called 'width'"),
        ("[convert]\nbillboards = 24", "line 1: expected keys alone"),
        ("billboards = true", "line 1: expected a value for billboards, found true"),
        ('billboards = "many"', "--billboards"),
        ("billboards = [24]", "--billboards"),
        ("billboards = ", "expected TOML"),
        ("convert = 5", "no option is called 'convert'"),
    ],
)
def test_a_configuration_with_a_mistake(
    text: str, sentence: str, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "c.toml"
    config.write_text(text)
    assert run(["convert", str(model), "-o", str(tmp_path / "o"), "--config", str(config)]) == 2
    assert sentence in capsys.readouterr().err


def test_a_configuration_names_flags(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "c.toml"
    config.write_text('billboards = 7\nlevels = 1\nleaf-material = "b*"\nmax-texture = 64\n')
    arguments = ["convert", str(model), "-o", str(tmp_path / "o"), "--config", str(config)]
    assert run([*arguments, "--billboards", "9", "--json"]) == 0
    (outcome,) = json.loads(capsys.readouterr().out)
    assert 7 < outcome["levels"][1]["billboards"] <= 9, "flags win"
    assert outcome["levels"][1]["texels"] <= 2 * 64**2, "of colour and of normals"


@pytest.mark.skipif(os.name == "nt" or not hasattr(os, "mkfifo"), reason="POSIX streams")
@pytest.mark.parametrize("redirection", ["2>&-", ">&-", "| true", ">/dev/full"])
def test_closed_and_full_streams_give_no_traceback(redirection: str) -> None:
    if "full" in redirection and not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    command = f"{sys.executable} -m vegtool sample --list {redirection}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=60)
    assert "Traceback" not in done.stderr
    assert "bug" not in done.stdout + done.stderr


def test_a_file_that_may_not_be_read(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(path: Path) -> bytes:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert run(["convert", str(model), "-o", str(tmp_path / "o"), *SMALL]) == 1
    assert "bush.glb: cannot be read (Permission denied)" in capsys.readouterr().err
