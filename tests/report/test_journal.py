"""The journal of an unfinished report."""

from __future__ import annotations

from pathlib import Path

import pytest

from vegtool.errors import OutputError
from vegtool.report.journal import NAME, Journal


def test_what_was_added_is_there_the_next_time(tmp_path: Path) -> None:
    with Journal(tmp_path / "new" / "folder", "key") as journal:
        journal.add("oak", "live", {"row": 1})
        journal.add("oak", "kmeans 16", {"row": 2})
    with Journal(tmp_path / "new" / "folder", "key") as journal:
        assert journal.get("oak", "live") == {"row": 1}
        assert journal.get("oak", "kmeans 16") == {"row": 2}
        assert journal.get("pine", "live") is None


@pytest.mark.parametrize("torn", [1, 5, 30])
def test_a_torn_last_line_is_as_if_never_written(tmp_path: Path, torn: int) -> None:
    """And what is added after it does not continue it."""
    with Journal(tmp_path, "key") as journal:
        journal.add("oak", "live", {"row": 1})
        journal.add("oak", "kmeans 16", {"row": 2})
    path = tmp_path / NAME
    path.write_bytes(path.read_bytes()[:-torn])
    with Journal(tmp_path, "key") as journal:
        assert journal.get("oak", "live") == {"row": 1}
        assert journal.get("oak", "kmeans 16") in (None, {"row": 2})  # whole but for its newline
        journal.add("oak", "kmeans 64", {"row": 3})
    with Journal(tmp_path, "key") as journal:
        assert journal.get("oak", "kmeans 64") == {"row": 3}


def test_one_of_another_report_is_refused_unless_forced(tmp_path: Path) -> None:
    with Journal(tmp_path, "key") as journal:
        journal.add("oak", "live", {"row": 1})
    with pytest.raises(OutputError, match="an unfinished report with other options"):
        Journal(tmp_path, "other")
    with Journal(tmp_path, "key") as journal:
        assert journal.get("oak", "live") == {"row": 1}, "refusing loses nothing"
    with Journal(tmp_path, "other", force=True) as journal:
        assert journal.get("oak", "live") is None


@pytest.mark.parametrize("content", [b"", b"\n", b"hello\n", b"[1, 2]\n", b"\xff\xfe\n"])
def test_a_file_that_is_no_journal_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / NAME).write_bytes(content)
    with pytest.raises(OutputError, match="-f"):
        Journal(tmp_path, "key")


@pytest.mark.parametrize("line", ['{"plant": [1], "piece": "live", "value": {}}', "[]", "{}"])
def test_a_damaged_line_is_as_if_never_written(tmp_path: Path, line: str) -> None:
    with Journal(tmp_path, "key") as journal:
        journal.add("oak", "live", {"row": 1})
    with (tmp_path / NAME).open("a") as file:
        file.write(line + "\n" + '{"plant": "oak", "piece": "kmeans 16", "value": 5}\n')
    with Journal(tmp_path, "key") as journal:
        assert journal.get("oak", "live") == {"row": 1}
        assert journal.get("oak", "kmeans 16") is None


def test_nothing_is_left_of_a_whole_report(tmp_path: Path) -> None:
    with Journal(tmp_path, "key") as journal:
        journal.add("oak", "live", {"row": 1})
        journal.remove()
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_where_nothing_was_finished(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), Journal(tmp_path / "new" / "folder", "key"):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a file that is always full")
def test_a_full_disk_is_told_with_the_file_and_keeps_what_there_was(tmp_path: Path) -> None:
    with Journal(tmp_path, "key") as journal:
        journal.add("oak", "live", {"row": 1})
    with pytest.raises(OutputError, match=NAME), Journal(tmp_path, "key") as journal:
        journal._file.close()
        journal._file = Path("/dev/full").open("w", encoding="utf-8")  # noqa: SIM115
        journal.add("oak", "kmeans 16", {"row": 2})
    with Journal(tmp_path, "key") as journal:
        assert journal.get("oak", "live") == {"row": 1}
        assert journal.get("oak", "kmeans 16") is None
