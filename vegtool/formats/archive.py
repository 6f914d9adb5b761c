"""Arrays in one file, as numpy's own .npz: the same bytes for the same arrays."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""The zip format's, so that the bytes do not tell the time."""


def archived(arrays: Mapping[str, npt.NDArray[np.generic]], *, compressed: bool = False) -> bytes:
    """The bytes of a file that `numpy.load` gives the arrays of, by name."""
    buffer = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in arrays.items():
            entry = io.BytesIO()
            np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", FIRST_DAY), entry.getvalue(), method)
    return buffer.getvalue()
