"""`vegtool tiles NAME.surfels`: whole or not at all, and with options of its own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vegtool.cli import run
from vegtool.formats.tileset_check import check_tileset
from vegtool.growth import sample
from vegtool.surfels.make import surfel_model
from vegtool.surfels.store import surfels_bytes

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("surfels") / "statue.surfels"
    path.write_bytes(surfels_bytes(surfel_model(sample("statue", 1500))))
    return path


def test_a_tileset_is_written(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["tiles", str(source), "-o", str(out), "--dry-run", "--json"]) == 0
    would = json.loads(capsys.readouterr().out)
    assert not out.exists()
    assert run(["tiles", str(source), "-o", str(out), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert {key: would[key] for key in would if key != "seconds"} == {
        key: facts[key] for key in facts if key != "seconds"
    }
    assert check_tileset(out / "tileset.json") == []
    assert facts["files"] == {file.name: file.stat().st_size for file in out.iterdir()}
    assert facts["tiles"] == sum(level["tiles"] for level in facts["levels"])
    assert facts["tiles"] == len(list(out.glob("*.glb")))

    assert run(["tiles", str(source), "-o", str(out)]) == 1
    assert "exists already" in capsys.readouterr().err
    assert run(["tiles", str(source), "-o", str(out), "-f"]) == 0
    told = capsys.readouterr().out
    assert f"{facts['tiles']} tiles" in told and "screen-space error is set to 1" in told


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--tile", "16"], "for landscapes alone there is --tile"),
        (["--species", ".", "-j", "2", "--plain"], "--plain, --species, --jobs"),
        (["--only", "0/0/0"], "--only"),
    ],
)
def test_options_of_landscapes_are_refused(
    source: Path, tmp_path: Path, more: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["tiles", str(source), "-o", str(tmp_path / "out"), *more]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_read_leaves_nothing(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.surfels"
    broken.write_bytes(source.read_bytes()[:1000])
    assert run(["tiles", str(broken), "-o", str(tmp_path / "out")]) == 1
    assert "Convert the plant again" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_landscape_needs_its_species(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["tiles", str(tmp_path / "trees.csv"), "-o", str(tmp_path / "out")]) == 2
    assert "expected --species" in capsys.readouterr().err
