"""The table of branches as a file: one compressed-free .npz, the same bytes for the same branches."""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from vegtool.errors import OutputError
from vegtool.plant import Branches

EPOCH = (1980, 1, 1, 0, 0, 0)  # the zip format's first day, so that bytes do not tell the time


def write_branches(branches: Branches, path: str | os.PathLike[str]) -> Path:
    """Write face_branch (f,), parent (b,) and level (b,), all int32, to an .npz that numpy loads.

    The file appears whole or not at all, and replaces one of that name. Returns its path.
    Raises OutputError where it cannot be written.
    """
    target = Path(path)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in ("face_branch", "parent", "level"):
            entry = io.BytesIO()
            np.lib.format.write_array(entry, getattr(branches, name), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", EPOCH), entry.getvalue())
    temporary = ""
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(buffer.getvalue())
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(target)
    except OSError as error:
        Path(temporary).unlink(missing_ok=True) if temporary else None
        raise OutputError(
            f"{target}: expected to write the table of branches here, found: {error.strerror}; "
            "name a file in a folder that exists and may be written"
        ) from error
    return target


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
