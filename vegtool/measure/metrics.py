"""How far a picture of a level is from the truth: eight numbers, each of them always finite.

A picture is (h, w, 4) float32: linear light premultiplied by coverage, and coverage. For FLIP, SSIM
and PSNR both are put over one background in linear light; the rest compare coverage and colour
themselves. docs/metrics.md says what each means, and what it is where it would be undefined.

Sources: FLIP, see measure/flip.py. SSIM: Wang, Bovik, Sheikh and Simoncelli 2004, by scikit-image,
on luma alone, as in that paper: colour takes three times as long and is judged by FLIP already.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import grey_closing, minimum_filter
from skimage.metrics import structural_similarity

from vegtool.arrays import Picture, SingleArray, checked
from vegtool.measure.background import BACKGROUND, over
from vegtool.measure.flip import Perceived, difference, perceived
from vegtool.srgb import srgb_from_linear

METRICS: dict[str, str] = {
    "flip": "FLIP, 0 to 1, lower is better",
    "ssim": "SSIM, -1 to 1, higher is better",
    "psnr": "PSNR, dB, higher is better",
    "coverage_bias": "Coverage bias, share of the truth's coverage, best at 0",
    "silhouette": "Silhouette error, share of the truth's coverage, lower is better",
    "false_holes": "False holes, share of the truth's inside, lower is better",
    "color_bias": "Colour bias, share of the truth's luminance, best at 0",
    "shading_rmse": "Shading error, RMSE in linear light, lower is better",
}
"""What `score` tells: short title, unit, and which way is better."""
SIGNED = ("coverage_bias", "color_bias")
"""Best at 0, from both sides."""
GREATER_IS_BETTER = ("ssim", "psnr")
"""Of the others less is."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear sRGB (Rec. 709); of encoded sRGB the same weights give luma."""
PSNR_CAP = 100.0
"""dB: what equal pictures get."""
SSIM_WINDOW = 7
"""Pixels; smaller pictures get that much background around them."""
SAMPLE = 1 / 64
"""Pixels: the least area that a truth of 8 x 8 samples can cover, and the least divided by."""
DARKEST = 1 / (255 * 12.92)
"""The least luminance divided by: the first step of 8-bit sRGB above black."""
GAP = 3
"""Pixels: gaps in the truth up to twice as wide lie inside its silhouette."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The truth of one view, and all that scores need of it alone.

    picture: (h, w, 4). encoded: (h, w, 3) over the background, sRGB. luma: for SSIM, at least its
    window. perceived: for FLIP. inside: (h, w) how far each pixel lies within the silhouette.
    covered: pixels. luminance: mean of what is covered, linear.
    """

    picture: Picture
    encoded: SingleArray
    luma: SingleArray
    perceived: Perceived
    inside: SingleArray
    covered: float
    luminance: float


def reference(picture: Picture) -> Reference:
    """What every score against this truth shares.

    Raises ValueError for a picture that is not (h, w, 4), has no pixels or is not finite.
    """
    picture = _checked(picture)
    linear = over(picture)
    encoded = np.asarray(srgb_from_linear(linear))
    covered, luminance = _covered(picture)
    return Reference(
        picture, encoded, _luma(encoded), perceived(linear), _inside(picture[..., 3]),
        covered, luminance,
    )  # fmt: skip


def score(reference: Reference, picture: Picture) -> dict[str, float]:
    """Every metric of METRICS, for a picture of the same size as the reference's.

    Raises ValueError for a picture of another size, or with values that are not finite.
    """
    picture = _checked(picture, reference.picture.shape)
    linear = over(picture)
    encoded = np.asarray(srgb_from_linear(linear))
    covered, luminance = _covered(picture)
    truth, level = reference.picture[..., 3], picture[..., 3]
    area = max(reference.covered, SAMPLE)
    lost = np.maximum(truth - level, 0)
    return {
        "flip": _mean(difference(reference.perceived, perceived(linear))),
        "ssim": _ssim(reference.luma, _luma(encoded)),
        "psnr": _psnr(reference.encoded, encoded),
        "coverage_bias": (covered - reference.covered) / area,
        "silhouette": _sum(np.abs(truth - level)) / area,
        "false_holes": _sum(reference.inside * lost) / max(_sum(reference.inside * truth), SAMPLE),
        "color_bias": (
            (luminance - reference.luminance) / max(reference.luminance, DARKEST)
            if covered > 0 and reference.covered > 0
            else 0.0
        ),
        "shading_rmse": _shading_rmse(reference.picture, picture),
    }


def _checked(picture: Picture, shape: tuple[int, ...] | None = None) -> Picture:
    picture = checked("picture", picture, (None, None, 4), np.float32)
    if not picture.size or (shape is not None and picture.shape != shape):
        raise ValueError(f"picture: expected {shape or 'at least one pixel'}, got {picture.shape}")
    return picture


def _covered(picture: Picture) -> tuple[float, float]:
    """Pixels covered, and the mean linear luminance of what covers them, 0 for nothing."""
    covered = _sum(picture[..., 3])
    light = _sum(picture[..., :3] @ LUMINANCE)
    return covered, light / covered if covered > 0 else 0.0


def _inside(coverage: SingleArray) -> SingleArray:
    """(h, w) 0 to 1: least coverage of the closed silhouette in the pixel and its neighbours."""
    y, x = np.mgrid[-GAP : GAP + 1, -GAP : GAP + 1]
    disc = x * x + y * y <= (GAP + 0.5) ** 2
    padded = np.pad(coverage, GAP)
    closed = grey_closing(padded, footprint=disc)[GAP:-GAP, GAP:-GAP]
    return np.asarray(minimum_filter(closed, 3, mode="constant", cval=0.0))


def _luma(encoded: SingleArray) -> SingleArray:
    """(h, w) of an encoded picture, on as much background as SSIM's window needs."""
    luma = encoded @ LUMINANCE
    missing = [max(SSIM_WINDOW - n, 0) for n in luma.shape]
    if not any(missing):
        return np.asarray(luma)
    background = float(srgb_from_linear(BACKGROUND) @ LUMINANCE)
    return np.pad(luma, [(n // 2, n - n // 2) for n in missing], constant_values=background)


def _ssim(truth: SingleArray, level: SingleArray) -> float:
    similarity = structural_similarity(  # type: ignore[no-untyped-call]
        truth, level, win_size=SSIM_WINDOW, data_range=1.0
    )
    return float(similarity)


def _psnr(truth: SingleArray, level: SingleArray) -> float:
    """Peak signal-to-noise ratio over the three encoded channels, dB, at most PSNR_CAP."""
    error = _mean((truth - level) ** 2)
    return float(-10 * np.log10(max(error, 10 ** (-PSNR_CAP / 10))))


def _shading_rmse(truth: Picture, level: Picture) -> float:
    """Root mean square difference of colour where both cover, weighted by the smaller coverage."""
    common = np.minimum(truth[..., 3], level[..., 3])
    both = common > 0
    if not both.any():
        return 0.0
    weight, a, b = common[both], truth[both], level[both]
    error = (((a[:, :3] / a[:, 3:]) - (b[:, :3] / b[:, 3:])) ** 2).mean(axis=1)
    return float(np.sqrt(_sum(weight * error) / _sum(weight)))


def _sum(values: SingleArray) -> float:
    return float(values.sum(dtype=np.float64))


def _mean(values: SingleArray) -> float:
    return float(values.mean(dtype=np.float64))
