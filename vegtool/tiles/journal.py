"""What a run has made so far: a line of JSON for each part, so that another run can go on.

A line is written when the part's files are in their places. Its key is a hash of all that the part
was made from; where the key is still the same, and the files are there, the part is not made again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from hashlib import blake2b
from pathlib import Path, PurePath
from secrets import token_hex
from typing import Any

import numpy as np
import numpy.typing as npt

import vegtool
from vegtool.errors import OutputError
from vegtool.formats.atomic import explained

JOURNAL = "journal.jsonl"
PART = ".part"
"""Ending of files that are not whole yet."""
Hashed = str | float | int | bytes | npt.NDArray[Any] | None


@dataclass(frozen=True)
class Entry:
    """A part of a tileset that is made.

    name: of the tile, or of what tiles share. key: of what it was made from. files: their bytes, by
    their names in the folder of the tileset; none of a tile without plants. facts: of a tile, what
    is told of it.
    """

    name: str
    key: str
    files: dict[str, int] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)

    def there(self, folder: Path) -> bool:
        """Whether all files are, whole."""
        try:
            return all((folder / name).stat().st_size == size for name, size in self.files.items())
        except OSError:
            return False


def key_of(*values: Hashed) -> str:
    """A hash of values and of vegtool's version: other values, another hash."""
    found = blake2b(vegtool.__version__.encode(), digest_size=16)
    for value in values:
        if isinstance(value, np.ndarray):
            found.update(repr((value.dtype.str, value.shape)).encode())
            found.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, bytes):
            found.update(repr(len(value)).encode() + value)
        else:
            found.update(repr(value).encode())
        found.update(b"\0")
    return found.hexdigest()


def read_journal(folder: Path) -> dict[str, Entry]:
    """Entries by their names, the last of each; none where there is no journal. A line that is not
    whole, as where a run was killed, counts for nothing, nor does one of files elsewhere, which
    nobody is to remove."""
    try:
        lines = (folder / JOURNAL).read_bytes().splitlines()
    except OSError:
        return {}
    found: dict[str, Entry] = {}
    for line in lines:
        try:
            entry = Entry(**json.loads(line))
            outside = any(".." in (path := PurePath(n)).parts or path.anchor for n in entry.files)
        except (ValueError, TypeError):
            continue
        if not outside:
            found[entry.name] = entry
    return found


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Nobody else makes tiles in a folder meanwhile, where the system can tell (not on Windows, nor
    on some disks of a network). The folder is made; where nothing was written, it goes again.

    Raises OutputError where somebody does. Whoever is killed holds nothing.
    """
    with explained(folder):
        new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
    try:
        with _locked(folder):
            yield
    finally:
        if new:
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    try:
        import fcntl
    except ImportError:  # on Windows
        yield
        return
    with explained(folder):
        number = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(number)
        raise OutputError(
            f"{folder}: another run of vegtool tiles is at work there. Wait for it, or choose "
            "another place."
        ) from None
    except OSError:
        pass
    try:
        yield
    finally:
        os.close(number)


@contextmanager
def appended(folder: Path) -> Iterator[Callable[[Entry], None]]:
    """What adds entries to a folder's journal, each at once."""
    path = folder / JOURNAL
    with explained(path):
        folder.mkdir(parents=True, exist_ok=True)
        ended = not path.exists() or path.read_bytes()[-1:] in (b"", b"\n")
        with path.open("ab") as file:
            if not ended:
                file.write(b"\n")

            def write(entry: Entry) -> None:
                with explained(path):
                    file.write(_line(entry))
                    file.flush()

            yield write


def write_journal(folder: Path, entries: Mapping[str, Entry]) -> None:
    """A journal of these entries alone, in the order of their names: whole or as it was."""
    write_file(folder / JOURNAL, b"".join(_line(entries[name]) for name in sorted(entries)))


def write_file(path: Path, data: bytes) -> None:
    """A file, whole or not at all, whoever else writes it at the same time."""
    with explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.{token_hex(4)}{PART}")
        try:
            part.write_bytes(data)
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


def _line(entry: Entry) -> bytes:
    return json.dumps(asdict(entry), allow_nan=False, separators=(",", ":")).encode() + b"\n"
