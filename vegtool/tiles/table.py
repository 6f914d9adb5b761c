"""A file with a row per plant, as readers hand it to inventory.py: columns of text or numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError

Value = str | float | None
Part = tuple[Sequence[Value], ...]

MISSING = {"", "-", "?", "na", "n/a", "nan", "none", "null"}
"""What stands, in any case, where nothing is known."""


@dataclass(frozen=True)
class Table:
    """Rows of an inventory, numbered from 1.

    names: of the columns. parts: given the numbers of the columns that are wanted, yields their
    values, so many rows at a time. place: says where a row is, for messages.
    given: what a column means, where the format itself says so. geographic: whether x and y are
    longitude and latitude, where the format says so. decimal_comma: whether 1,5 is a number.
    crs: the coordinate reference system of x and y, such as EPSG:25832, where the file says so.
    notes: sentences on what was guessed; to be shown to the user.
    """

    path: Path
    names: tuple[str, ...]
    parts: Callable[[Sequence[int]], Iterator[Part]]
    place: Callable[[int], str]
    given: Mapping[str, int] = field(default_factory=dict)
    geographic: bool | None = None
    decimal_comma: bool = False
    notes: tuple[str, ...] = ()
    crs: str | None = None

    def numbers(self, values: Sequence[Value], column: str, row: int, needed: bool) -> FloatArray:
        """(n,) float64; NaN where nothing is known and nothing needed.

        row: number of the first value. Raises InputError, with row and column, for what is no
        number.
        """
        try:
            found = np.fromiter(map(float, values), np.float64, len(values))  # type: ignore[arg-type]
            if np.isfinite(found).all():
                return found
        except (ValueError, TypeError, OverflowError):
            pass
        found = np.empty(len(values))
        for index, value in enumerate(values):
            found[index] = self._number(value, column, row + index, needed)
        return found

    def _number(self, value: Value, column: str, row: int, needed: bool) -> float:
        text = "" if value is None else str(value).strip()
        if not needed and text.casefold() in MISSING:
            return np.nan
        if self.decimal_comma and "." not in text:
            text = text.replace(",", ".", 1)
        try:
            number = float(text) if not isinstance(value, bool) else np.nan
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            raise self.error(row, column, "a number", value)
        return number

    def error(
        self, row: int, column: str, expected: str, found: Value, remedy: str = ""
    ) -> InputError:
        """What is said of a value that cannot be."""
        what = f"{found!r:.60}" if isinstance(found, str) and found.strip() else "nothing"
        if isinstance(found, float | int):  # whole numbers may be more than a float can be
            what = f"{found:.15g}" if abs(found) < 1e300 else f"{found!s:.60}"
        return InputError(
            f"{self.path}, {self.place(row)}, column {column}: expected {expected}, found {what}; "
            f"{remedy or 'correct or remove the row'}"
        )
