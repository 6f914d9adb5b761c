"""Grey pictures read as numbers: heights and densities."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import ByteArray, SingleArray
from vegtool.errors import InputError

MAX_SIDE = 16_384
"""Pixels: 1 GB as float32."""
DEEP = ("I;16", "I;16L", "I;16B", "I;16N", "I")
"""Pillow's modes of 16 bits."""


@dataclass(frozen=True, eq=False)
class Grey:
    """values: (rows, columns) float32, 0 black to 1 white. bits: 8 or 16, of the file."""

    values: SingleArray
    bits: int

    @property
    def size(self) -> str:
        """As people say it: width first."""
        rows, columns = self.values.shape
        return f"{columns} x {rows} pixels"


def read_grey(path: Path, named: str) -> Grey:
    """A grey PNG of 8 or 16 bits, or one whose colours are all grey.

    named: file, line and key that name the picture, for messages.
    Raises InputError for a file that is missing, broken, not a PNG, coloured, of fewer than 2 x 2
    pixels or of too many.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's own bomb warning; ours is below
            with Image.open(path, formats=("PNG",)) as image:
                width, height = image.size
                if not 2 <= min(width, height) <= max(width, height) <= MAX_SIDE:
                    raise InputError(
                        f"{path}: expected 2 to {MAX_SIDE} pixels on each side, found "
                        f"{width} x {height}; scale it ({named})"
                    )
                return _grey(image, path, named)
    except (FileNotFoundError, IsADirectoryError, PermissionError) as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check {named}") from None
    except UnidentifiedImageError:
        raise InputError(
            f"{path}: expected a PNG picture, found something else; export it as a grey PNG of 16 "
            f"bits ({named})"
        ) from None
    except Image.DecompressionBombError:
        raise InputError(
            f"{path}: expected at most {MAX_SIDE} pixels on each side; scale it ({named})"
        ) from None
    except (OSError, ValueError, SyntaxError, EOFError) as error:
        raise InputError(
            f"{path}: the picture is broken ({error}); export it again ({named})"
        ) from None


def _grey(image: Any, path: Path, named: str) -> Grey:
    if image.mode in DEEP:
        return Grey(np.asarray(image, dtype=np.float32) / np.float32(65535), 16)
    if image.mode not in ("1", "L"):  # greys that were saved as colours are greys
        colours = np.asarray(image.convert("RGBA"))
        red = colours[..., :1]
        if (colours[..., 1:3] != red).any() or (colours[..., 3] != 255).any():
            raise InputError(
                f"{path}: expected shades of grey, found colours or transparency; export it as a "
                f"grey PNG of 16 bits ({named})"
            )
        return Grey(_of_bytes(colours[..., 0]), 8)
    return Grey(_of_bytes(np.asarray(image.convert("L"))), 8)


def _of_bytes(values: ByteArray) -> SingleArray:
    return values.astype(np.float32) / np.float32(255)
