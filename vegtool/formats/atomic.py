"""Sets of files that appear whole or not at all.

Files are first written to a hidden folder inside the target folder, and moved to their names when
all are there. Files that they replace wait in that hidden folder until the last move is done; on
any failure, Ctrl-C included, they are put back and everything new is removed.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from errno import EACCES, EDQUOT, EEXIST, EFBIG, ENAMETOOLONG, ENOSPC, ENOTDIR
from pathlib import Path
from types import TracebackType
from typing import Self

from vegtool.errors import OutputError


class FileSet:
    """A set of files to appear in `folder` when the `with` block ends without an exception.

        with FileSet(folder, force) as files:
            files.add("oak.glb", data)

    folder: made where it is missing, and removed again where the set fails.
    force: existing files are replaced; else OutputError names the first one.
    inputs: the user's own files. Neither they nor, even with `force`, anything else in their
    folders (the textures beside a model) is ever replaced.
    Raises OutputError where the folder cannot be made or written, or is full.
    """

    def __init__(self, folder: Path, force: bool = False, inputs: Iterable[Path] = ()) -> None:
        self._folder = folder
        self._force = force
        self._inputs = tuple(inputs)
        self._names: list[str] = []
        self._first_there: list[str] = []  # names that stand for no older file
        self._missing_folders = [p for p in (folder, *folder.parents) if not os.path.lexists(p)]
        self._hidden = folder / f".vegtool-{secrets.token_hex(6)}"
        self._new, self._old = self._hidden / "new", self._hidden / "old"

    @property
    def paths(self) -> list[Path]:
        """Where the files added so far are going to be."""
        return [self._folder / name for name in self._names]

    def __enter__(self) -> Self:
        try:
            with explained(self._folder):
                self._new.mkdir(parents=True)
                self._old.mkdir()
        except BaseException:
            _finish(self._clean_up)
            raise
        return self

    def add(self, name: str, data: bytes) -> None:
        """Write a file of the set; it appears under `name`, a plain file name, with the others."""
        if Path(name).name != name:
            raise ValueError(f"FileSet.add: {name!r} is no plain file name")
        check_free(self._folder, [name], self._force, self._inputs)
        with explained(self._folder / name):
            (self._new / name).write_bytes(data)
        self._names.append(name)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self._move_in()
        _finish(self._clean_up)

    def _move_in(self) -> None:
        try:
            check_free(self._folder, self._names, self._force, self._inputs)
            there = {p.name for p in self.paths if os.path.lexists(p)}
            self._first_there = [name for name in self._names if name not in there]
            for path in self.paths:
                with explained(path):
                    if path.name in there:
                        path.replace(self._old / path.name)
                    (self._new / path.name).replace(path)
            self._missing_folders = []
        except BaseException:
            _finish(self._put_back)
            _finish(self._clean_up)
            raise

    def _put_back(self) -> None:
        """Undo the moves, as far as they went. May be repeated."""
        for path in self.paths:
            if os.path.lexists(self._old / path.name):
                (self._old / path.name).replace(path)
            elif path.name in self._first_there and not (self._new / path.name).exists():
                path.unlink(missing_ok=True)

    def _clean_up(self) -> None:
        """Remove the hidden folder, and the folders made for a set that failed. May be repeated."""
        shutil.rmtree(self._hidden, ignore_errors=True)
        for folder in self._missing_folders:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def check_free(
    folder: Path, names: Iterable[str], force: bool = False, inputs: Iterable[Path] = ()
) -> None:
    """Raise OutputError for the first of the names that may not be written, as FileSet would.

    To be asked before long work, so that a refusal comes at once.
    """
    inputs = tuple(inputs)
    _check_folder(folder)
    for path in (folder / name for name in names):
        if not os.path.lexists(path):
            continue
        if path.is_dir():
            raise OutputError(f"{path}: is a folder; a file is to stand there. {_ELSEWHERE}")
        if any(_same(path, own) for own in inputs):
            raise OutputError(f"{path}: is the input, which is never overwritten. {_ELSEWHERE}")
        if any(_same(folder, own.parent) for own in inputs):
            raise OutputError(
                f"{path}: exists beside the input, where no file is ever overwritten. {_ELSEWHERE}"
            )
        if not force:
            raise OutputError(
                f"{path}: exists already. Overwrite it with -f, or choose another place."
            )


def _check_folder(folder: Path) -> None:
    """Raise OutputError where the folder is not there and cannot be made, or not be written."""
    there = next((p for p in (folder, *folder.parents) if os.path.lexists(p)), folder)
    with explained(folder):
        if not there.is_dir():
            raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR))
        if not os.access(there, os.W_OK | os.X_OK):
            raise PermissionError(EACCES, os.strerror(EACCES))


_ELSEWHERE = "Choose another place."


def _same(path: Path, other: Path) -> bool:
    """Whether two paths lead to one file or folder; those that do not exist are different."""
    try:
        return path.samefile(other)
    except OSError:
        return False


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn the operating system's refusals to write there into OutputErrors."""
    try:
        yield
    except OSError as error:
        if error.errno in (ENOSPC, EDQUOT, EFBIG):
            reason = f"there is no room for it ({error.strerror}). Free some space, or choose"
        elif error.errno in (ENOTDIR, EEXIST):
            reason = "a file stands where its folder should be. Choose"
        elif error.errno == ENAMETOOLONG:
            reason = "the name is too long here. Rename the input, or choose"
        else:
            reason = f"cannot be written ({error.strerror}). Allow it, or choose"
        raise OutputError(f"{path}: {reason} another place.") from error


def _finish(action: Callable[[], None]) -> None:
    """Run an action that may be repeated to its end, however often Ctrl-C arrives meanwhile."""
    interrupt: KeyboardInterrupt | None = None
    while True:
        try:
            action()
            break
        except KeyboardInterrupt as error:
            interrupt = error
    if interrupt is not None:
        raise interrupt
