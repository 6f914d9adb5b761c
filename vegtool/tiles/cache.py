"""What is made of plants once, and kept in the library under a hash of all that it is made from.

LIBRARY/.vegtool/HASH/ holds a chain of levels as `write_chain` writes it, or surfels (samples.py),
whole, or is not there: it is filled under another name first. Whoever comes second leaves what the
first one made.
"""

from __future__ import annotations

import json
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from time import time
from typing import Any

import vegtool
from vegtool.errors import InputError, OutputError
from vegtool.formats.atomic import explained
from vegtool.formats.manifest import read_manifest
from vegtool.tiles.library import MANIFEST

CACHE = ".vegtool"
"""In a library."""
PART = ".part"
"""What the name of a folder ends in that is being filled."""
DIGITS = 32
"""Of a hash, in hexadecimal."""
STALE_S = 86_400.0
"""Seconds after which nobody fills a folder any more."""


def place_of(library: Path, files: Sequence[Path], told: Mapping[str, Any]) -> Path:
    """The folder for what is made from these files. told: what else shapes it, as JSON.

    Names and contents of the files count, and not where they are. Raises InputError for a file
    that cannot be read.
    """
    contents = []
    for file in files:
        try:
            contents.append([file.name, sha256(file.read_bytes()).hexdigest()])
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror}); allow it") from error
    values = {"version": vegtool.__version__, "files": contents, **told}
    text = json.dumps(values, sort_keys=True, allow_nan=False)
    return library / CACHE / sha256(text.encode()).hexdigest()[:DIGITS]


def kept(place: Path) -> Path | None:
    """The manifest in a folder of a cache, if that is there with all its files."""
    for manifest in place.glob(f"*{MANIFEST}"):
        try:
            told = read_manifest(manifest)
            files = [told["combined"], *told["levels"][1:]]
            if all((place / one["file"]).stat().st_size == one["bytes"] for one in files):
                return manifest
        except (InputError, OSError):
            pass
    return None


@contextmanager
def filling(
    place: Path, source: Path, by_hand: str, whole: Callable[[Path], object] = kept
) -> Iterator[Path]:
    """A folder to write into, which stands at `place` when the `with` block ends without an
    exception, unless another process has put one there.

    Raises OutputError where it cannot be made; by_hand: what the user can do to do without. whole:
    whether a folder has all that it is to have; a chain, unless told otherwise.
    """
    part = place.with_name(f"{place.name}.{secrets.token_hex(6)}{PART}")
    try:
        part.mkdir(parents=True)
    except OSError as error:
        raise OutputError(
            f"{place.parent}: expected a folder to keep the levels of {source} in; it cannot be "
            f"made or written ({error.strerror}). Allow it, or {by_hand}"
        ) from error
    try:
        yield part
        _move_in(part, place, whole)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def _move_in(part: Path, place: Path, whole: Callable[[Path], object] = kept) -> None:
    if whole(place):
        return
    shutil.rmtree(place, ignore_errors=True)  # what somebody has taken files from
    try:
        with explained(place):
            part.replace(place)
    except OutputError:
        if not whole(place):  # nor did another process put it there meanwhile
            raise


def clean(library: Path) -> None:
    """Remove what runs that were killed have left."""
    for part in (library / CACHE).glob(f"*{PART}"):
        try:
            if time() - part.stat().st_mtime > STALE_S:
                shutil.rmtree(part, ignore_errors=True)
        except OSError:  # another process was faster
            pass
