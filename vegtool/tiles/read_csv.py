"""Inventories as text: a header, then a row per plant (RFC 4180, and what programs make of it).

Values are separated by commas, semicolons or tabs, whichever the header has most of; beside
semicolons and tabs, 1,5 is a number. Text is UTF-8 or, where it cannot be, Latin-1.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from vegtool.errors import InputError
from vegtool.tiles.table import Part, Table

SEPARATORS = ",;\t"
ROWS = 512
"""Of a part. Text takes ten times the memory of numbers, and Python's garbage collector visits all
lists that are kept: parts of 65,536 took nearly twice the time."""
BOMS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}


def read(path: Path) -> Table:
    """The table in a file. Raises InputError for one that is empty or broken."""
    text, notes = _decoded(path)
    header = text.lstrip().partition("\n")[0]
    separator = max(SEPARATORS, key=header.count)
    names = tuple(name.strip() for name in next(_rows(path, text, separator), ()))
    if not any(names):
        raise InputError(f"{path}: expected a row of column names, found nothing; add one")

    def place(row: int) -> str:
        return f"row {row:,} (line {_line(text, separator, row):,})"

    def parts(wanted: Sequence[int]) -> Iterator[Part]:
        rows = _rows(path, text, separator)
        next(rows)
        first = 1
        while part := list(islice(rows, ROWS)):
            _check_lengths(path, part, len(names), place, first)
            columns = list(zip(*part, strict=False))
            yield tuple(columns[index] for index in wanted)
            first += len(part)

    return Table(path, names, parts, place, decimal_comma=separator != ",", notes=notes)


def _decoded(path: Path) -> tuple[str, tuple[str, ...]]:
    data = path.read_bytes()
    encoding = next((name for bom, name in BOMS.items() if data.startswith(bom)), "utf-8")
    try:
        return data.decode(encoding), ()
    except UnicodeDecodeError:
        return data.decode("latin-1"), (f"{path}: is not {encoding}; read as Latin-1",)


def _rows(path: Path, text: str, separator: str) -> Iterator[list[str]]:
    """All rows but empty ones, the header among them; those that spreadsheets leave below a table
    have separators, and no values."""
    reader = _reader(text, separator)
    try:
        yield from filter(any, reader)
    except csv.Error as error:
        raise InputError(
            f"{path}, line {reader.line_num:,}: expected values between {separator!r}, found what "
            f"is none ({error}); export it again"
        ) from None


def _line(text: str, separator: str, row: int) -> int:
    """In which line a row ends: counted anew, as it is only asked of a broken one."""
    reader = _reader(text, separator)
    next(islice(filter(any, reader), row, None), None)
    return int(reader.line_num)


def _reader(text: str, separator: str) -> Any:
    return csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)


def _check_lengths(
    path: Path, part: list[list[str]], count: int, place: Callable[[int], str], first: int
) -> None:
    """Raise InputError for a row of fewer than `count` values, or of more, unless those are empty,
    as spreadsheets leave them."""
    if set(map(len, part)) == {count}:
        return
    for index, row in enumerate(part):
        if len(row) < count or any(value.strip() for value in row[count:]):
            raise InputError(
                f"{path}, {place(first + index)}: expected {count} values, found {len(row)}; put "
                "quotes around values with separators in them"
            )
