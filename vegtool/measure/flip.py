"""LDR-FLIP: the difference that a person sees when two pictures alternate, 0 to 1 per pixel.

Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild: FLIP: A Difference Evaluator
for Alternating Images (Proc. ACM Comput. Graph. Interact. Tech. 3, 2, 2020), with the separable
filters of flip-evaluator 1.7 (note "separatedConvolutions" in its repository), which is the oracle
of the tests. In two steps, so that what depends on one picture alone is computed once: `perceived`
for each picture, `difference` for each pair.

The fifteen filters along lines are the larger part of the work. Tried, milliseconds of processor
time for those of one picture of 400 x 400: scipy.ndimage.correlate1d 11.5, sums of shifted pictures
8.3, real FFT 6.7, products with banded Toeplitz matrices in blocks of 48 rows 4.4, of 16 rows 2.7
(float32, one core with AVX-512). Up to 500 pixels, blocks of 14 stay below the 2^18 multiplications
from which OpenBLAS spreads one product over threads, so that pairs can be scored side by side.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, hypot, pi, sqrt

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from vegtool.arrays import FloatArray, SingleArray

PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * pi / 180
"""Of visual angle: 0.7 m away from 3840 pixels on 0.7 m, the paper's and flip-evaluator's."""
BLOCK = 14
"""Rows or columns that one matrix product filters."""
STRIP = 64
"""Rows whose colours are worked out at a time, so that intermediate results stay in the cache."""

# The paper's constants. Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees.
B_ACHROMATIC, B_RED_GREEN = 0.0047, 0.0053
BLUE_YELLOW = ((34.1, 0.04), (13.5, 0.025))  # a, b of the two that are added
FEATURE_DEG = 0.082
Q_COLOR, P_CUT, P_TARGET = 0.7, 0.4, 0.95

XYZ_FROM_LINEAR = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
WHITE_XYZ = XYZ_FROM_LINEAR / XYZ_FROM_LINEAR.sum(axis=1, keepdims=True)
"""Linear sRGB to XYZ over the XYZ of white."""
OPPONENT = np.array([[0.0, 1, 0], [1, -1, 0], [0, 1, -1]]) @ WHITE_XYZ
"""Linear sRGB to Y, X - Y, Y - Z over white: the paper's YCxCz without offset and factors."""
LINEAR = np.linalg.inv(OPPONENT)


@dataclass(frozen=True, eq=False)
class Perceived:
    """What FLIP compares of a picture, float32.

    color: (3, h, w) L*a*b* of the picture as the eye blurs it, chroma scaled by L* (Hunt).
    edges, points: (h, w) strength of first and second derivatives of its lightness.
    """

    color: SingleArray
    edges: SingleArray
    points: SingleArray


def perceived(picture: SingleArray) -> Perceived:
    """A picture as FLIP sees it. picture: (h, w, 3) float32, linear sRGB, 0 to 1, opaque."""
    height, width = picture.shape[:2]
    y, cx, cz = _padded(picture @ OPPONENT.T.astype(np.float32))
    inside = np.s_[..., :height, :width]
    edges, points = _features(y)
    return Perceived(
        _hunt_lab(_contrast_filtered(y, cx, cz)[inside]), edges[inside], points[inside]
    )


def difference(reference: Perceived, test: Perceived) -> SingleArray:
    """(h, w) float32 errors, 0 to 1, of two pictures of the same size."""
    error = np.empty_like(reference.edges)
    for first in range(0, len(error), STRIP):
        rows = np.s_[..., first : first + STRIP, :]
        color = _color_difference(reference.color[rows], test.color[rows])
        feature = np.maximum(
            np.abs(reference.edges[rows] - test.edges[rows]),
            np.abs(reference.points[rows] - test.points[rows]),
        )
        error[rows] = color ** (1 - np.sqrt(feature / np.float32(sqrt(2))))
    return error


def _contrast_filtered(y: SingleArray, cx: SingleArray, cz: SingleArray) -> SingleArray:
    """(3, H, W): opponent colours blurred as the eye does at this distance."""
    yellow_blue = [_across(_down(cz, band), band) for band in YELLOW_BLUE]
    return np.stack(
        [
            _across(_down(y, ACHROMATIC), ACHROMATIC),
            _across(_down(cx, RED_GREEN), RED_GREEN),
            yellow_blue[0] + yellow_blue[1],
        ]
    )


def _features(y: SingleArray) -> tuple[SingleArray, SingleArray]:
    """Edges and points, (H, W) each."""
    blur, slope, bend = FEATURES
    blurred = _down(y, blur)
    edges = _length(_across(blurred, slope), _across(_down(y, slope), blur))
    return edges, _length(_across(blurred, bend), _across(_down(y, bend), blur))


def _color_difference(reference: SingleArray, test: SingleArray) -> SingleArray:
    """HyAB distance of colours (3, h, w), compressed and mapped to 0 to 1."""
    lightness, a, b = np.abs(reference - test)
    distance = (lightness + _length(a, b)) ** np.float32(Q_COLOR)
    # two straight pieces, the second less steep, so the lower of two lines
    steep, flat = P_TARGET / P_CUT, (1 - P_TARGET) / (1 - P_CUT)
    first = distance * np.float32(steep / LARGEST)
    second = distance * np.float32(flat / LARGEST) + np.float32(1 - flat)
    return np.asarray(np.minimum(first, second))


def _length(a: SingleArray, b: SingleArray) -> SingleArray:
    return np.asarray(np.sqrt(a * a + b * b))


def _hunt_lab(opponent: SingleArray) -> SingleArray:
    """L*a*b* (3, h, w), chroma times L* / 100, of filtered opponent colours (3, h, w)."""
    color = np.empty_like(opponent)
    for first in range(0, opponent.shape[1], STRIP):
        rows = np.s_[:, first : first + STRIP]
        linear = np.clip(_mixed(LINEAR, opponent[rows]), 0, 1)
        x, y, z = _lab_curve(_mixed(WHITE_XYZ, linear))
        lightness = 116 * y - 16
        color[rows] = lightness, 5 * lightness * (x - y), 2 * lightness * (y - z)
    return color


def _mixed(matrix: FloatArray, planes: SingleArray) -> SingleArray:
    """A matrix (3, 3) applied to the colours of planes (3, h, w), row of pixels by row."""
    rows = np.matmul(matrix.astype(np.float32), planes.swapaxes(0, 1))
    return np.asarray(rows.swapaxes(0, 1))


def _lab_curve(t: SingleArray) -> SingleArray:
    """Cube root above (6/29)^3, its tangent below, as a sum of both: no choice per pixel."""
    delta = 6 / 29
    low = np.minimum(t, np.float32(delta**3)) - np.float32(delta**3)
    return np.asarray(np.cbrt(t - low) + low * np.float32(1 / (3 * delta**2)))


# Filters: rows of a Toeplitz matrix, applied to overlapping windows of the padded picture.


def _kernels() -> tuple[list[FloatArray], list[FloatArray], list[FloatArray]]:
    """The paper's kernels, (2 RADIUS + 1,) each.

    Contrast sensitivity: achromatic and red-green; blue-yellow, whose sum is normalised over two
    dimensions. Features: a Gaussian and its derivatives, whose positive and negative weights sum
    to 1 and -1.
    """
    x = np.arange(-RADIUS, RADIUS + 1.0)

    def gaussian(b: float) -> FloatArray:
        return np.asarray(np.exp(-((pi * x / PIXELS_PER_DEGREE) ** 2) / b))

    single = [gaussian(b) / gaussian(b).sum() for b in (B_ACHROMATIC, B_RED_GREEN)]
    double = [sqrt(a * sqrt(pi / b)) * gaussian(b) for a, b in BLUE_YELLOW]
    norm = hypot(*(k.sum() for k in double))

    sigma = FEATURE_DEG / 2 * PIXELS_PER_DEGREE
    blur = np.where(abs(x) <= ceil(3 * sigma), np.exp(-((x / sigma) ** 2) / 2), 0)
    derivatives = [-x * blur, ((x / sigma) ** 2 - 1) * blur]
    features = [k / np.where(k > 0, k[k > 0].sum(), -k[k < 0].sum()) for k in derivatives]
    return single, [k / norm for k in double], [blur / blur.sum(), *features]


def _band(kernel: FloatArray) -> SingleArray:
    """(BLOCK, BLOCK + 2 RADIUS) Toeplitz matrix: row i holds the kernel from column i on."""
    band = np.zeros((BLOCK, BLOCK + 2 * RADIUS), np.float32)
    for i in range(BLOCK):
        band[i, i : i + len(kernel)] = kernel
    return band


def _padded(picture: SingleArray) -> SingleArray:
    """(3, H + 2 RADIUS, W + 2 RADIUS) from (h, w, 3): H, W multiples of BLOCK, edges repeated."""
    extra = [(RADIUS, RADIUS + -n % BLOCK) for n in picture.shape[:2]]
    return np.pad(np.moveaxis(picture, 2, 0), ((0, 0), *extra), mode="edge")


def _down(plane: SingleArray, band: SingleArray) -> SingleArray:
    """(H, W + 2 RADIUS) from (H + 2 RADIUS, W + 2 RADIUS): filtered along columns."""
    windows = sliding_window_view(plane, band.shape[1], axis=0)[::BLOCK]
    filtered = np.matmul(band, windows.swapaxes(1, 2))
    return np.asarray(filtered.reshape(-1, plane.shape[1]))


def _across(plane: SingleArray, band: SingleArray) -> SingleArray:
    """(H, W) from (H, W + 2 RADIUS): filtered along rows."""
    windows = sliding_window_view(plane, band.shape[1], axis=1)[:, ::BLOCK]
    blocks = np.empty((*windows.shape[:2], BLOCK), np.float32)
    np.matmul(windows.swapaxes(0, 1), band.T, out=blocks.swapaxes(0, 1))
    return blocks.reshape(len(plane), -1)


def _largest() -> float:
    """The paper's largest colour difference: between green and blue."""
    green, blue = (
        _hunt_lab((OPPONENT @ c).astype(np.float32).reshape(3, 1, 1)).ravel().astype(np.float64)
        for c in (np.array([0, 1, 0]), np.array([0, 0, 1]))
    )
    lightness, a, b = abs(green - blue)
    return float((lightness + hypot(a, b)) ** Q_COLOR)


RADIUS = ceil(3 * sqrt(max(b for _, b in BLUE_YELLOW) / (2 * pi**2)) * PIXELS_PER_DEGREE)
"""Pixels: three standard deviations of the widest filter."""
_SINGLE, _DOUBLE, _FEATURES = _kernels()
ACHROMATIC, RED_GREEN = map(_band, _SINGLE)
YELLOW_BLUE = tuple(map(_band, _DOUBLE))
FEATURES = tuple(map(_band, _FEATURES))
LARGEST = _largest()
