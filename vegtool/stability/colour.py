"""Colour and scores: what has no light, no area or no difference still gets numbers, right ones."""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from vegtool.arrays import Picture
from vegtool.measure.metrics import PSNR_CAP, reference, score
from vegtool.seeding import generator
from vegtool.srgb import linear_from_srgb, srgb_from_linear
from vegtool.stability.case import Case, Outcome, exact, holds


def evenly(value: float, coverage: float, size: tuple[int, int] = (24, 20)) -> Picture:
    """(h, w, 4) a picture of one colour, premultiplied."""
    picture = np.full((*size, 4), value * coverage, dtype=np.float32)
    picture[..., 3] = coverage
    return picture


def noise(size: tuple[int, int] = (24, 20)) -> Picture:
    """(h, w, 4) a picture of anything."""
    random = generator(0, "stability", "picture")
    picture = random.random((*size, 4)).astype(np.float32)
    picture[..., :3] *= picture[..., 3:]
    return picture


def line() -> Picture:
    """(24, 20, 4) half a sample's coverage in one pixel."""
    picture = evenly(0.0, 0.0)
    picture[3, 4] = 1 / 128
    return picture


PICTURES: dict[str, Picture] = {
    "nothing": evenly(0.0, 0.0),
    "all black": evenly(0.0, 1.0),
    "all white": evenly(1.0, 1.0),
    "all equal": evenly(0.3, 0.6),
    "least light": evenly(1e-30, 1.0),
    "brighter than white": evenly(1e4, 1.0),
    "less than a sample": line(),
    "noise": noise(),
}

LEAST = {"flip": 0.0, "ssim": -1.0, "psnr": -0.1, "coverage_bias": -1.0, "silhouette": 0.0,
         "false_holes": 0.0, "color_bias": -1.0, "shading_rmse": 0.0}  # fmt: skip
"""The least that each score may be."""


def equal_pictures(picture: Picture) -> Outcome:
    """A picture against itself: no error, the greatest likeness."""
    found = score(reference(picture), picture)
    right = dict.fromkeys(found, 0.0) | {"ssim": 1.0, "psnr": PSNR_CAP}
    error = max(abs(found[name] - right[name]) / max(abs(right[name]), 1.0) for name in found)
    return exact(error)


def any_pair(truth: Picture) -> Outcome:
    """A picture against all others: finite numbers, within their ranges."""
    wrong = 0
    against = reference(truth)
    for picture in PICTURES.values():
        for name, value in score(against, picture).items():
            wrong += not np.isfinite(value) or value < LEAST[name] - 1e-6
            wrong += name in ("flip", "ssim", "false_holes") and value > 1 + 1e-6
    return holds(int(wrong), "finite, and within their ranges")


def any_size(size: tuple[int, int]) -> Outcome:
    """Pictures of very few pixels, or of one row: scores are numbers."""
    wrong = 0
    for a, b in ((noise(size), noise(size)), (noise(size), evenly(0.3, 0.6, size))):
        values = score(reference(a), b)
        wrong += int((~np.isfinite(list(values.values()))).sum())
    return holds(wrong, "finite")


def black_and_white() -> Outcome:
    """Black against white is the greatest difference there is: FLIP is 1 but for rounding."""
    found = score(reference(evenly(0.0, 1.0)), evenly(1.0, 1.0))
    return Outcome(abs(found["flip"] - 1), 0.05, "FLIP's own scale ends near 1")


def srgb_in_long_double() -> Outcome:
    """All 256 codes, decoded in double and in long double."""
    codes = np.arange(256) / 255
    wide = np.arange(256).astype(np.longdouble) / 255
    curve = ((wide + np.longdouble("0.055")) / np.longdouble("1.055")) ** np.longdouble("2.4")
    right = np.where(wide <= np.longdouble("0.04045"), wide / np.longdouble("12.92"), curve)
    error = np.abs(linear_from_srgb(codes) - right) / np.maximum(right, np.longdouble(1e-300))
    return exact(float(error.max()))


def srgb_there_and_back(dtype: npt.DTypeLike) -> Outcome:
    """Every code comes back as itself; nothing below 0 or above 1 does harm."""
    codes = np.arange(256)
    back = np.round(srgb_from_linear(linear_from_srgb((codes / 255).astype(dtype))) * 255)
    outside = linear_from_srgb(np.array([-1e30, -1e-30, 0.0, 1.0, 1e30], dtype=dtype))
    wrong = int((back != codes).sum()) + int((outside != [0, 0, 0, 1, 1]).sum())
    return holds(wrong, "the same 256 codes")


CASES = (
    *(
        Case(f"scores of equal pictures, {name}", "colour", "exact",
             partial(equal_pictures, picture))
        for name, picture in PICTURES.items()
    ),
    *(
        Case(f"scores against {name}", "colour", "property", partial(any_pair, picture))
        for name, picture in PICTURES.items()
    ),
    *(
        Case(f"scores of {width} x {height} pixels", "colour", "property",
             partial(any_size, (height, width)))
        for width, height in ((1, 1), (1, 300), (300, 1), (6, 6))
    ),
    Case("FLIP of black and white", "colour", "property", black_and_white),
    Case("sRGB in long double", "colour", "exact", srgb_in_long_double),
    *(
        Case(f"sRGB there and back, {np.dtype(dtype).name}", "colour", "property",
             partial(srgb_there_and_back, dtype))
        for dtype in (np.float32, np.float64)
    ),
)  # fmt: skip
