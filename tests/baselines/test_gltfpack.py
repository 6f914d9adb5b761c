from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from surfaces import cards

from vegtool.baselines import baseline

needs_shell = pytest.mark.skipif(sys.platform == "win32", reason="the stand-ins are shell scripts")


def stand_in(folder: Path, script: str) -> str:
    """A PATH on which gltfpack is that shell script."""
    program = folder / "gltfpack"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    return f"{folder}{os.pathsep}{os.environ.get('PATH', '')}"


def test_where_there_is_none_the_reason_is_given(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    made = baseline(cards(10), "gltfpack", 8)
    assert made.level is None and made.seconds == {}
    assert "not found on the PATH" in made.missing


@needs_shell
@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("echo first >&2; echo 'Error: bad input' >&2; exit 3", "exit code 3: Error: bad input"),
        ("exit 1", "exit code 1: it said nothing"),
        ("exit 0", "wrote no file"),
        ('while [ "$1" != -o ]; do shift; done; echo broken > "$2"', "reduced.glb"),
    ],
)
def test_a_failure_is_a_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: str, said: str
) -> None:
    monkeypatch.setenv("PATH", stand_in(tmp_path, script))
    made = baseline(cards(10), "gltfpack", 8)
    assert made.level is None
    assert said in made.missing and "Traceback" not in made.missing


@needs_shell
def test_it_is_asked_for_the_ratio_and_its_file_is_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A stand-in that notes its arguments and gives back what it was given."""
    asked = tmp_path / "asked"
    monkeypatch.setenv("PATH", stand_in(tmp_path, f'echo "$@" > {asked}; cp "$2" "$4"'))
    made = baseline(cards(40), "gltfpack", 20)
    words = asked.read_text().split()
    assert words[0] == "-i" and words[2] == "-o"
    assert words[4:] == ["-si", "0.250000000", "-sa", "-noq"]
    assert made.missing == "" and made.triangles == 80
    assert set(made.seconds) == {"write", "gltfpack", "read"}
