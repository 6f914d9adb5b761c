"""Images decoded to straight RGBA, with their size checked before any pixel is unpacked."""

from __future__ import annotations

import io
import warnings
from typing import Any, Literal

import numpy as np

from vegtool.arrays import ByteArray
from vegtool.errors import CapabilityError, InputError
from vegtool.plant import Texture

MAX_SIDE = 16_384
"""Pixels: the largest texture side of current GPUs."""
MAX_PIXELS = 2**27
"""Pixels: half a gigabyte as RGBA."""

FORMATS = ("PNG", "JPEG", "WEBP", "TGA", "BMP", "TIFF", "GIF", "DDS")
PASSED_ON: dict[str, Literal["image/png", "image/jpeg", "image/webp"]] = {
    "PNG": "image/png",
    "JPEG": "image/jpeg",
    "WEBP": "image/webp",
}
KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"


def decode(data: bytes, name: str, where: str) -> Texture:
    """The texture in an image file's bytes; `where` names file and image in messages.

    The bytes are kept in the texture where its pixels are exactly what they decode to. Raises
    InputError for a broken or oversized image, CapabilityError for KTX2.
    """
    from PIL import Image, UnidentifiedImageError

    if data.startswith(KTX2):
        raise CapabilityError(
            f"{where}: KTX2 textures cannot be decoded; convert them to PNG, for example with "
            "`ktx extract` of KTX-Software, and refer to those"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's own bomb warning; ours is below
            image = Image.open(io.BytesIO(data), formats=FORMATS)
            _check_size(*image.size, where)
            pixels = _rgba(image)
    except UnidentifiedImageError:
        raise InputError(
            f"{where}: expected a {', '.join(FORMATS)} image, found something else; export it again"
        ) from None
    except Image.DecompressionBombError:
        raise _too_large("far more pixels than that", where) from None
    except (OSError, ValueError, SyntaxError, EOFError, ArithmeticError, LookupError) as error:
        raise InputError(
            f"{where}: the image is broken ({error}); export or download it again"
        ) from None
    exact = (
        image.mode in ("1", "L", "LA", "P", "RGB", "RGBA") and getattr(image, "n_frames", 1) == 1
    )
    mime_type = PASSED_ON.get(image.format or "") if exact else None
    return Texture(name, pixels, data if mime_type else None, mime_type)


def _check_size(width: int, height: int, where: str) -> None:
    if max(width, height) > MAX_SIDE or width * height > MAX_PIXELS:
        raise _too_large(f"{width} x {height}", where)


def _too_large(found: str, where: str) -> InputError:
    return InputError(
        f"{where}: expected at most {MAX_SIDE} pixels on a side and {MAX_PIXELS // 2**20} million "
        f"in all, found {found}; scale the image down"
    )


def _rgba(image: Any) -> ByteArray:
    """(h, w, 4) uint8; palettes, their transparency and 16-bit greys included."""
    if image.mode.startswith("I"):  # 16-bit grey, which Pillow would clip at 255
        grey = (np.asarray(image, dtype=np.float64) / 257).round().clip(0, 255).astype(np.uint8)
        return np.dstack([grey, grey, grey, np.full_like(grey, 255)])
    return np.asarray(image.convert("RGBA"))
