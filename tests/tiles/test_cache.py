"""What is kept in a library: found again by what it is made from, whole or absent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from library_cases import model, write

import vegtool
from vegtool.errors import InputError, OutputError
from vegtool.tiles import cache
from vegtool.tiles.cache import CACHE, STALE_S, clean, filling, kept, place_of


def test_a_place_is_that_of_what_is_made_from_what(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names and contents of files, what else is told, and the program; not where files are."""
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        model(tmp_path / name)
    oak, moved = tmp_path / "a" / "oak.glb", tmp_path / "b" / "oak.glb"
    place = place_of(tmp_path, [oak], {"levels": 9})
    assert place.parent == tmp_path / CACHE and len(place.name) == 32
    assert place_of(tmp_path, [moved], {"levels": 9}) == place
    assert place_of(tmp_path / "b", [moved], {"levels": 9}).name == place.name
    elm = moved.rename(moved.with_name("elm.glb"))
    others = [
        place_of(tmp_path, [elm], {"levels": 9}),
        place_of(tmp_path, [oak, elm], {"levels": 9}),
        place_of(tmp_path, [oak], {"levels": 8}),
    ]
    oak.write_bytes(oak.read_bytes() + b"\0")
    others.append(place_of(tmp_path, [oak], {"levels": 9}))
    monkeypatch.setattr(vegtool, "__version__", "0.0.0")
    others.append(place_of(tmp_path, [oak], {"levels": 9}))
    assert len({place, *others}) == 6
    with pytest.raises(InputError, match=r"none\.glb: cannot be read"):
        place_of(tmp_path, [tmp_path / "none.glb"], {})


def fill(place: Path, distance: float = 10.0) -> None:
    with filling(place, Path("oak.glb"), "do it by hand") as folder:
        write(folder, "oak", (distance,))
        assert kept(place) is None, "before it is whole"


def test_a_folder_is_whole_or_absent(tmp_path: Path) -> None:
    place = tmp_path / CACHE / "0123"
    with pytest.raises(KeyboardInterrupt), filling(place, Path("oak.glb"), "") as folder:
        write(folder, "oak")
        raise KeyboardInterrupt
    assert kept(place) is None and not list(place.parent.iterdir())
    fill(place)
    assert kept(place) == place / "oak.lod.json"
    assert [path.name for path in place.parent.iterdir()] == ["0123"]


def test_whoever_comes_second_leaves_what_is_there(tmp_path: Path) -> None:
    place = tmp_path / CACHE / "0123"
    with filling(place, Path("oak.glb"), "") as folder:
        write(folder, "oak", (20.0,))
        fill(place)
        first = (place / "oak.lod.json").read_bytes()
    assert (place / "oak.lod.json").read_bytes() == first
    assert [path.name for path in place.parent.iterdir()] == ["0123"]


@pytest.mark.parametrize("there", [True, False])
def test_whoever_comes_second_at_the_very_moment_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    """Between looking and moving; a folder that cannot be moved for other reasons is an error."""
    place = tmp_path / CACHE / "0123"

    def late(part: Path, target: Path) -> Path:
        monkeypatch.undo()
        if there:
            fill(target)
        raise OSError(39, "Directory not empty")

    with filling(place, Path("oak.glb"), "") as folder:
        write(folder, "oak")
        monkeypatch.setattr(Path, "replace", late)
        if not there:
            with pytest.raises(OutputError, match="0123: cannot be written"):
                cache._move_in(folder, place)
            return
    assert kept(place) is not None


@pytest.mark.parametrize("name", ["oak.lod.json", "oak.glb", "oak_LOD1.glb"])
@pytest.mark.parametrize("how", ["taken away", "cut short"])
def test_what_is_not_whole_any_more_is_made_anew(tmp_path: Path, name: str, how: str) -> None:
    place = tmp_path / CACHE / "0123"
    fill(place)
    file = place / name
    if how == "taken away":
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:-9])
    assert kept(place) is None
    fill(place)
    assert kept(place) is not None


def test_a_library_that_cannot_be_written_is_said_with_what_to_do(tmp_path: Path) -> None:
    (tmp_path / CACHE).write_text("in the way")
    says = rf"{CACHE}: expected a folder to keep the levels of oak\.glb in; .* or do it by hand"
    with (
        pytest.raises(OutputError, match=says),
        filling(tmp_path / CACHE / "0123", Path("oak.glb"), "do it by hand"),
    ):
        pytest.fail("begun")
    assert kept(tmp_path / CACHE / "0123") is None


def test_what_killed_runs_left_is_removed_and_what_others_fill_is_not(tmp_path: Path) -> None:
    clean(tmp_path)  # where there is nothing
    old, new = (tmp_path / CACHE / f"0123.{name}.part" for name in ("old", "new"))
    for part in (old, new):
        part.mkdir(parents=True)
        write(part, "oak")
    then = new.stat().st_mtime - STALE_S - 60
    os.utime(old, (then, then))
    clean(tmp_path)
    assert (old.exists(), new.exists()) == (False, True)
