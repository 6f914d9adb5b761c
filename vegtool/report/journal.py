"""What an interrupted report had finished, so that the next run goes on from there.

One JSON object per line: the first says of which report, each other is a finished piece of work. A
last line that was torn when the power went is as if it had never been written.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from vegtool.errors import OutputError
from vegtool.formats.atomic import explained

NAME = "report.unfinished.jsonl"


class Journal:
    """The journal of one report in its folder; a context manager, kept until `remove`.

    Nothing is kept of a report that finished nothing, not even the folders made for it.

    key: a digest of what shapes every row: options and version. `force` begins anew where the
    folder holds a journal of another key; else OutputError says so, as it does of a full disk.
    """

    def __init__(self, folder: Path, key: str, force: bool = False) -> None:
        self._path = folder / NAME
        self._done: dict[tuple[str, str], Any] = {}
        kept = self._read(key, force)
        self._missing_folders = [p for p in (folder, *folder.parents) if not p.exists()]
        with explained(self._path):
            folder.mkdir(parents=True, exist_ok=True)
            whole = self._path.with_suffix(".new")
            self._file = whole.open("w", encoding="utf-8")
            self._write({"report": key})
            for (plant, piece), value in kept.items():
                self.add(plant, piece, value)
            self._file.close()
            whole.replace(self._path)
            self._file = self._path.open("a", encoding="utf-8")

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        with explained(self._path):
            self._file.close()
        if self._done:
            return
        self._path.unlink(missing_ok=True)
        for folder in self._missing_folders:
            if not any(folder.iterdir()):
                folder.rmdir()

    def get(self, plant: str, piece: str) -> Any | None:
        """The value that was added for a piece of work on a plant (its digest), or None."""
        return self._done.get((plant, piece))

    def add(self, plant: str, piece: str, value: Any) -> None:
        """Write a finished piece of work, through to the disk."""
        self._done[plant, piece] = value
        with explained(self._path):
            self._write({"plant": plant, "piece": piece, "value": value})

    def remove(self) -> None:
        """The report is whole: nothing is left to go on with."""
        self._file.close()
        self._path.unlink(missing_ok=True)

    def _write(self, value: dict[str, Any]) -> None:
        self._file.write(json.dumps(value) + "\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self, key: str, force: bool) -> dict[tuple[str, str], Any]:
        if not self._path.exists():
            return {}
        lines = [_parsed(line) for line in self._path.read_bytes().splitlines()]
        if not lines or lines[0] is None or lines[0].get("report") != key:
            if force:
                return {}
            raise OutputError(
                f"{self._path}: an unfinished report with other options stands here. Begin anew "
                "with -f, or choose another folder with -o."
            )
        return {
            (line["plant"], line["piece"]): line["value"]
            for line in lines[1:]
            if line is not None and _is_piece(line)
        }


def _is_piece(line: dict[str, Any]) -> bool:
    kinds = {"plant": str, "piece": str, "value": dict}
    return all(isinstance(line.get(name), kind) for name, kind in kinds.items())


def _parsed(line: bytes) -> dict[str, Any] | None:
    """The object of a line, or None for what is no whole line."""
    try:
        value = json.loads(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None
