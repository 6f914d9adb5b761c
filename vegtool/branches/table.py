"""The table of branches as a file: an .npz, the same bytes for the same branches."""

from __future__ import annotations

import os
from pathlib import Path

from vegtool.errors import OutputError
from vegtool.formats.archive import archived
from vegtool.formats.atomic import FileSet
from vegtool.plant import Branches


def write_branches(branches: Branches, path: Path, force: bool = False) -> None:
    """Write face_branch (f,), parent (b,) and level (b,), all int32, to an .npz that numpy loads.

    The file appears whole or not at all. Raises OutputError where it cannot be written, or where
    a file of that name exists and `force` is not set.
    """
    if os.path.lexists(path) and not force:
        raise OutputError(
            f"{path}: exists already. Overwrite it with -f, or name another file with --branches."
        )
    names = "face_branch", "parent", "level"
    data = archived({name: getattr(branches, name) for name in names})
    with FileSet(path.parent, force) as files:
        files.add(path.name, data)
