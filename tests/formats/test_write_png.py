"""PNG bytes."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from vegtool.formats.png import encode, encode_texture
from vegtool.plant import Texture

RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    "pixels",
    [
        RNG.integers(0, 256, (5, 7, 4), dtype=np.uint8),
        RNG.integers(0, 256, (5, 7, 3), dtype=np.uint8),
        RNG.integers(0, 256, (5, 7), dtype=np.uint8),
        RNG.integers(0, 65536, (5, 7)).astype(np.uint16),
    ],
    ids=["rgba", "rgb", "grey", "grey16"],
)
def test_round_trip_and_same_bytes(pixels):
    data = encode(pixels)
    assert data == encode(pixels.copy())
    with Image.open(BytesIO(data)) as image:
        assert np.array_equal(np.asarray(image), pixels)


def test_colour_under_alpha_zero_is_kept():
    pixels = np.array([[[10, 200, 30, 0], [1, 2, 3, 255]]], np.uint8)
    with Image.open(BytesIO(encode(pixels))) as image:
        assert np.array_equal(np.asarray(image), pixels)


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def test_profiles_gamma_and_text_are_dropped_and_the_pixels_are_not():
    buffer, text = BytesIO(), PngInfo()
    text.add_text("Comment", "made by hand")
    image = Image.fromarray(RNG.integers(0, 4, (6, 6), dtype=np.uint8), "L").convert("P")
    image.save(buffer, "PNG", pnginfo=text, transparency=1, dpi=(72, 96), icc_profile=b"profile")
    data = buffer.getvalue()
    data = data[:33] + chunk(b"gAMA", struct.pack(">I", 100000)) + data[33:]
    texture = Texture("t", np.zeros((6, 6, 4), np.uint8), data, "image/png")
    stripped, mime_type = encode_texture(texture)
    assert mime_type == "image/png"
    for kind in (b"gAMA", b"iCCP", b"pHYs", b"tEXt"):
        assert kind in data
        assert kind not in stripped
    with Image.open(BytesIO(data)) as old, Image.open(BytesIO(stripped)) as new:
        assert np.array_equal(np.asarray(old.convert("RGBA")), np.asarray(new.convert("RGBA")))


def test_cmyk_jpeg_is_encoded_again():
    buffer = BytesIO()
    Image.new("CMYK", (4, 4)).save(buffer, "JPEG")
    pixels = np.full((4, 4, 4), 255, np.uint8)
    data, mime_type = encode_texture(Texture("t", pixels, buffer.getvalue(), "image/jpeg"))
    assert mime_type == "image/png"
    with Image.open(BytesIO(data)) as image:
        assert np.array_equal(np.asarray(image), pixels[..., :3])
