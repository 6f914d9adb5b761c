"""Mip levels as a client makes them: plain averages, of colours in linear light.

Made here and not by the driver: each level is rounded once and to the nearest, so that pictures are
the same on every driver. Mesa's software rasteriser rounds sRGB upwards, 5 % of brightness by the
eighth level (docs/methods/agreement.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from vegtool.arrays import ByteArray
from vegtool.srgb import linear_from_srgb, srgb_from_linear

STEPS = 1 << 16
"""Of linear light, in the table back to sRGB: at most a twentieth of a step of 8 bits wide."""
_LINEAR = linear_from_srgb(np.arange(256) / 255).astype(np.float32) * np.float32(STEPS - 1)
_ENCODED = np.rint(srgb_from_linear(np.arange(STEPS) / (STEPS - 1)) * 255).astype(np.uint8)


def mip_levels(pixels: ByteArray, srgb: bool, cutoff: float | None = None) -> Iterator[ByteArray]:
    """The levels below an image (h, w, 4) uint8, each of half the size rounded down, to one texel.

    srgb: the first three channels are averaged in linear light. Where a side is odd, the average is
    the linear interpolation at the middle of the new texel. cutoff: alpha is scaled in each level
    such that as many of its texels pass a test as of the image (Castano 2010, Computing alpha
    mipmaps); plain averages lose leaves. No client is told to do so: of what is measured as theirs,
    leave it out.
    """
    shown = None if cutoff is None else passing(pixels, cutoff)
    for level in _averages(pixels, srgb):
        if shown is None or cutoff is None:
            yield level
        else:
            kept = level.copy()
            kept[..., 3] = _as_shown(level[..., 3], cutoff, shown)
            yield kept


def passing(pixels: ByteArray, cutoff: float) -> float:
    """Share of an image (h, w, 4) uint8 that passes an alpha test, interpolated as a GPU does."""
    return float((_between(pixels[..., 3]) >= 255 * cutoff).mean())


def _as_shown(alpha: ByteArray, cutoff: float, shown: float) -> ByteArray:
    """Alpha scaled such that, interpolated, a share `shown` of it is at least `cutoff`."""
    if shown <= 0:
        return alpha
    least = float(np.quantile(_between(alpha), 1 - shown, method="nearest"))
    if least <= 0:  # less than that is covered at all
        return alpha
    scaled = np.ceil(alpha.astype(np.float32) * np.float32(255 * cutoff / least))
    return np.asarray(np.minimum(scaled, 255), np.uint8)


def _between(alpha: ByteArray) -> np.ndarray:
    """(4, h, w) what a GPU interpolates at four places of each texel: a single texel among empty
    ones shows less than its area, one hole among full ones more."""
    values = alpha.astype(np.float32)
    parts = []
    for dy, dx in product((-1, 1), repeat=2):
        across = 0.75 * values + 0.25 * np.roll(values, dx, 1)
        parts.append(0.75 * across + 0.25 * np.roll(across, dy, 0))
    return np.stack(parts)


def _averages(pixels: ByteArray, srgb: bool) -> Iterator[ByteArray]:
    while max(pixels.shape[:2]) > 1:
        values = _halved(_linear(pixels) if srgb else pixels.astype(np.float32)) + 0.5
        pixels = values.astype(np.uint8)
        if srgb:
            pixels[..., :3] = _ENCODED[values[..., :3].astype(np.int32)]
        yield pixels


def _linear(pixels: ByteArray) -> np.ndarray:
    values = np.empty(pixels.shape, np.float32)
    values[..., :3] = _LINEAR[pixels[..., :3]]
    values[..., 3] = pixels[..., 3]
    return values


def _halved(values: np.ndarray) -> np.ndarray:
    """(max(h // 2, 1), max(w // 2, 1), 4) linear interpolation at the middles of larger texels."""
    for axis in (0, 1):
        size, rest = values.shape[axis], (slice(None),) * axis
        count = size // 2
        if size % 2 == 0:
            values = (values[*rest, 0::2] + values[*rest, 1::2]) * np.float32(0.5)
        elif count:
            middle = (np.arange(count) + 0.5) * (size / count) - 0.5
            first = middle.astype(np.int32)
            share = np.expand_dims((middle - first).astype(np.float32), (1, 2) if axis == 0 else 1)
            low, high = values[*rest, first], values[*rest, first + 1]
            values = low + (high - low) * share
    return values
