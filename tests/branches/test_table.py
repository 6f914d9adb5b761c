"""The table of branches as a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from branch_cases import small_tree

from vegtool.branches import recover_branches, write_branches
from vegtool.errors import OutputError


def test_numpy_reads_what_was_written(tmp_path: Path):
    branches = recover_branches(small_tree())
    write_branches(branches, tmp_path / "tree.npz")
    with np.load(tmp_path / "tree.npz") as table:
        assert sorted(table) == ["face_branch", "level", "parent"]
        for name in table:
            assert table[name].dtype == np.int32
            assert np.array_equal(table[name], getattr(branches, name))


def test_same_branches_same_bytes_and_no_traces(tmp_path: Path):
    for name in ("one.npz", "other.npz"):
        write_branches(recover_branches(small_tree()), tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.npz", "other.npz"]


def test_a_file_of_that_name_is_kept_unless_forced(tmp_path: Path):
    path = tmp_path / "tree.npz"
    path.write_text("mine")
    branches = recover_branches(small_tree())
    with pytest.raises(OutputError, match=r"tree\.npz: exists already.*-f"):
        write_branches(branches, path)
    assert path.read_text() == "mine"
    write_branches(branches, path, force=True)
    assert path.read_bytes().startswith(b"PK")


def test_a_place_that_cannot_be_written(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file"):
        write_branches(recover_branches(small_tree()), tmp_path / "file" / "tree.npz")
