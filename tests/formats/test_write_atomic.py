"""Sets of files: whole or not at all, and nothing of the user's overwritten."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from vegtool.errors import OutputError
from vegtool.formats.atomic import FileSet, check_free


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones included, by relative path."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_files_appear_together_at_the_end(tmp_path: Path):
    out = tmp_path / "a" / "b"
    with FileSet(out) as files:
        files.add("one", b"1")
        files.add("two", b"2")
        assert not (out / "one").exists()
    assert contents(tmp_path) == {"a/b/one": b"1", "a/b/two": b"2"}
    assert files.paths == [out / "one", out / "two"]
    assert [p.name for p in out.iterdir() if p.is_dir()] == []


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_a_failure_leaves_nothing_not_even_the_folder(tmp_path: Path, error):
    with pytest.raises(error), FileSet(tmp_path / "a" / "b") as files:
        files.add("one", b"1")
        raise error
    assert list(tmp_path.iterdir()) == []


def test_existing_files_are_refused_by_name_and_kept(tmp_path: Path):
    (tmp_path / "one").write_bytes(b"mine")
    with pytest.raises(OutputError, match=r"one: exists already.*-f"), FileSet(tmp_path) as files:
        files.add("zero", b"0")
        files.add("one", b"1")
    assert contents(tmp_path) == {"one": b"mine"}


def test_force_replaces_files_and_leaves_the_others(tmp_path: Path):
    (tmp_path / "one").write_bytes(b"old")
    (tmp_path / "other").write_bytes(b"other")
    with FileSet(tmp_path, force=True) as files:
        files.add("one", b"new")
    assert contents(tmp_path) == {"one": b"new", "other": b"other"}


def test_a_file_that_appears_meanwhile_is_not_overwritten(tmp_path: Path):
    with pytest.raises(OutputError, match="exists already"), FileSet(tmp_path) as files:
        files.add("one", b"1")
        (tmp_path / "one").write_bytes(b"mine")
    assert contents(tmp_path) == {"one": b"mine"}


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
@pytest.mark.parametrize("step", range(1, 6))
def test_a_failure_at_any_move_puts_everything_back(tmp_path: Path, monkeypatch, step, error):
    # Three files, two of which replace old ones: five moves. Each in turn fails after it is done,
    # as a Ctrl-C would, or before, as a full disk would.
    before = {"one": b"old 1", "three": b"old 3"}
    for name, data in before.items():
        (tmp_path / name).write_bytes(data)
    replace, calls = Path.replace, []

    def failing(path: Path, target: Path) -> Path:
        calls.append(target)
        if len(calls) == step and error is OSError:
            raise OSError(28, "No space left on device")
        result = replace(path, target)
        if len(calls) == step:
            raise error
        return result

    monkeypatch.setattr(Path, "replace", failing)
    expected = OutputError if error is OSError else error
    with pytest.raises(expected), FileSet(tmp_path, force=True) as files:
        for name in ("one", "two", "three"):
            files.add(name, b"new")
    assert contents(tmp_path) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(before)


def test_an_input_is_never_overwritten_nor_anything_beside_it(tmp_path: Path):
    model, texture = tmp_path / "oak.glb", tmp_path / "oak.png"
    model.write_bytes(b"model")
    texture.write_bytes(b"texture")
    inputs = [tmp_path / "." / "oak.glb"]
    with pytest.raises(OutputError, match="is the input"):
        check_free(tmp_path, ["oak.glb"], force=True, inputs=inputs)
    with pytest.raises(OutputError, match="beside the input"):
        check_free(tmp_path, ["oak.png"], force=True, inputs=inputs)
    check_free(tmp_path, ["oak_LOD1.glb"], inputs=inputs)
    linked = tmp_path / "out"
    linked.mkdir()
    (linked / "oak.glb").symlink_to(model)
    with pytest.raises(OutputError, match="is the input"):
        check_free(linked, ["oak.glb"], force=True, inputs=inputs)


def test_a_folder_is_never_replaced_by_a_file(tmp_path: Path):
    (tmp_path / "oak.glb").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        check_free(tmp_path, ["oak.glb"], force=True)


def test_a_file_where_the_folder_should_be(tmp_path: Path):
    (tmp_path / "out").write_bytes(b"mine")
    for folder in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(OutputError, match="a file stands where"), FileSet(folder):
            pass
    assert contents(tmp_path) == {"out": b"mine"}


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder nobody may write to")
def test_an_unwritable_folder():
    with pytest.raises(OutputError, match=r"cannot be written .*place"), FileSet(Path("/proc/out")):
        pass


def test_names_cannot_leave_the_folder(tmp_path: Path):
    for name in ("../oak.glb", "a/b", "/etc/passwd"):
        with pytest.raises(ValueError, match="no plain file name"), FileSet(tmp_path) as files:
            files.add(name, b"")


def python(script: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on file sizes")
def test_a_full_disk_is_named_and_leaves_nothing(tmp_path: Path):
    process = python(
        """
        import resource, sys
        from pathlib import Path
        from vegtool.errors import OutputError
        from vegtool.formats.atomic import FileSet
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        try:
            with FileSet(Path(sys.argv[1])) as files:
                files.add("small", bytes(10))
                files.add("large", bytes(10_000))
        except OutputError as error:
            print(error)
        """,
        str(tmp_path / "out"),
    )  # fmt: skip
    printed, errors = process.communicate(timeout=60)
    assert "large: there is no room for it" in printed, errors
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="sends a POSIX signal")
def test_ctrl_c_leaves_the_old_files_and_nothing_else(tmp_path: Path):
    (tmp_path / "one").write_bytes(b"old")
    process = python(
        """
        import sys, time
        from pathlib import Path
        from vegtool.formats.atomic import FileSet
        with FileSet(Path(sys.argv[1]), force=True) as files:
            files.add("one", b"new")
            print("ready", flush=True)
            time.sleep(60)
        """,
        str(tmp_path),
    )
    assert process.stdout.readline() == "ready\n"
    os.kill(process.pid, signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode != 0
    assert contents(tmp_path) == {"one": b"old"}
    assert [p.name for p in tmp_path.iterdir()] == ["one"]
