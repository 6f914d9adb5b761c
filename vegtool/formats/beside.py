"""Files that a model refers to: found beside it, never outside its folder.

A model comes from the network and names any path it likes; what it names is read and may be
written into the output, so a reference that leaves the model's folder is refused. Windows paths
from the artist's machine (`C:/art/leaf.png`) are looked up by file name instead.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from urllib.parse import unquote

from vegtool.errors import InputError

WINDOWS_ROOT = re.compile(r"^(?:[A-Za-z]:|//|\\\\)")

_found: ContextVar[list[Path] | None] = ContextVar("_found", default=None)


@contextmanager
def found_files() -> Iterator[list[Path]]:
    """The files that `find_beside` finds as long as this is open, in order."""
    files: list[Path] = []
    token = _found.set(files)
    try:
        yield files
    finally:
        _found.reset(token)


def find_beside(model: Path, reference: str, percent_encoded: bool = False) -> Path | None:
    """The file that `reference` in `model` names, or None where there is none.

    Raises InputError where it points outside the model's folder: by `..`, as an absolute path, by
    a symbolic link, or by a URL scheme.
    """
    folder = model.resolve().parent
    text = (unquote(reference) if percent_encoded else reference).strip()
    refused = InputError(
        f"{model}: expected files inside its own folder, found a reference to {reference!r}; "
        "copy that file beside the model and refer to it by its name"
    )
    if "\0" in text or re.match(r"^[A-Za-z][A-Za-z0-9+.-]+:", text):
        raise refused
    windows = bool(WINDOWS_ROOT.match(text))
    text = text.replace("\\", "/")
    parts = [part for part in text.split("/") if part not in ("", ".")]
    if ".." in parts or (text.startswith("/") and not windows):
        raise refused
    if not parts:
        return None
    candidates = [folder / parts[-1]] if windows else [folder.joinpath(*parts), folder / parts[-1]]
    found = next((path for path in candidates if _is_file(path)), None) or _any_case(
        folder, parts[-1]
    )
    if found is not None and not found.resolve().is_relative_to(folder):
        raise refused
    files = _found.get()
    if found is not None and files is not None:
        files.append(found)
    return found


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name too long for the file system
        return False


def _any_case(folder: Path, name: str) -> Path | None:
    """A file of that name in other capitals, as made on systems that do not tell them apart."""
    wanted = name.casefold()
    return next(
        (p for p in sorted(folder.iterdir()) if p.name.casefold() == wanted and p.is_file()), None
    )
