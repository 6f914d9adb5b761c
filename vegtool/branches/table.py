"""The table of branches as a file: an .npz, the same bytes for the same branches."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import numpy as np

from vegtool.errors import OutputError
from vegtool.formats.atomic import FileSet
from vegtool.plant import Branches

FIRST_DAY = (1980, 1, 1, 0, 0, 0)  # the zip format's, so that the bytes do not tell the time


def write_branches(branches: Branches, path: Path, force: bool = False) -> None:
    """Write face_branch (f,), parent (b,) and level (b,), all int32, to an .npz that numpy loads.

    The file appears whole or not at all. Raises OutputError where it cannot be written, or where
    a file of that name exists and `force` is not set.
    """
    if os.path.lexists(path) and not force:
        raise OutputError(
            f"{path}: exists already. Overwrite it with -f, or name another file with --branches."
        )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in ("face_branch", "parent", "level"):
            entry = io.BytesIO()
            np.lib.format.write_array(entry, getattr(branches, name), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", FIRST_DAY), entry.getvalue())
    with FileSet(path.parent, force) as files:
        files.add(path.name, buffer.getvalue())
