"""A client shows as much of every picture as is covered, whatever mips it takes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import map_coordinates

from vegtool.baking.bake import bake
from vegtool.baking.options import BakeOptions
from vegtool.boxes import make_billboards
from vegtool.clustering import cluster
from vegtool.growth import sample
from vegtool.lod import Display, Level
from vegtool.measure.scores import Truths, truths
from vegtool.measure.views import views
from vegtool.refine.coverage import (
    MIPS,
    ROUNDS,
    SURPLUS,
    halved,
    interpolated,
    measured_bias,
    seen_at,
    solve_coverage,
    unbiased_alpha,
)

GUTTER = 2


def framed(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An atlas with one picture well apart from its edges, and its rectangle."""
    height, width = picture.shape
    atlas = np.zeros((-(-(height + 16) // 16) * 16, -(-(width + 16) // 16) * 16), np.uint8)
    atlas[8 : 8 + height, 8 : 8 + width] = picture
    return atlas, np.array([[8, 8, width, height]], np.int32)


def leaves(size: int = 48, count: int = 12, seed: int = 3) -> np.ndarray:
    """Soft ellipses, as baked leaves look."""
    rng = np.random.default_rng(seed)
    y, x = np.indices((size, size)) + 0.5
    coverage = np.zeros((size, size))
    for _ in range(count):
        cx, cy = rng.uniform(4, size - 4, 2)
        turn, long, wide = rng.uniform(0, np.pi), rng.uniform(4, 7), rng.uniform(1.0, 2.5)
        u = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn)
        v = (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
        coverage = np.maximum(coverage, np.clip(2 - 2 * np.hypot(u / long, v / wide), 0, 1))
    return np.round(255 * coverage).astype(np.uint8)


def client_shows(alpha: np.ndarray, rect: np.ndarray, density: float, away: float) -> float:
    """The plain reference: texels of a picture that a client shows, from pixels taken at random.

    The billboard is turned any way. Each pixel takes the mip of the longer derivative, interpolates
    between texels and mips, and tests. A billboard seen obliquely has fewer pixels: the cosine.
    """
    rng, count = np.random.default_rng(5), 100_000
    mips = [alpha.astype(float)]
    while min(mips[-1].shape) > 1:
        a = mips[-1]
        mips.append((a[::2, ::2] + a[1::2, ::2] + a[::2, 1::2] + a[1::2, 1::2]) / 4)
    cosine, turn = rng.random(count), rng.uniform(0, np.pi, count)
    along = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    # what a step on the screen is on a plane that is foreshortened in the direction `along`
    steps = np.eye(2) + (1 / cosine - 1)[:, None, None] * along[:, :, None] * along[:, None]
    longer = density * away * np.linalg.norm(steps, axis=1).max(axis=1)
    level = np.clip(np.log2(longer), 0, len(mips) - 1.001)
    x0, y0, width, height = rect.tolist()
    x, y = x0 + width * rng.random(count), y0 + height * rng.random(count)

    def texel(mip: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return map_coordinates(
            mips[mip], [y / 2**mip - 0.5, x / 2**mip - 0.5], order=1, mode="nearest"
        )

    value = np.empty(count)
    for low in range(len(mips) - 1):
        at = level.astype(int) == low
        part = level[at] - low
        value[at] = (1 - part) * texel(low, x[at], y[at]) + part * texel(low + 1, x[at], y[at])
    return float((cosine * (value >= 127.5)).sum() / cosine.sum() * width * height)


@pytest.mark.parametrize("density", [0.7, 1.0, 1.5])
def test_a_client_shows_what_is_covered(density: float) -> None:
    alpha, rects = framed(leaves())
    covered = alpha.sum() / 255
    fitted = unbiased_alpha(alpha, rects, GUTTER, density, reach=1.0)
    assert client_shows(fitted, rects[0], density, 1.0) == pytest.approx(covered, rel=0.04)
    assert client_shows(alpha, rects[0], density, 1.0) < 0.85 * covered


def test_more_is_kept_farther_away_than_of_alpha_as_baked() -> None:
    """Two mips down, most of what linear averages lose is still there."""
    alpha, rects = framed(leaves())
    covered = alpha.sum() / 255
    fitted = unbiased_alpha(alpha, rects, GUTTER, reach=2.0)
    near, far = (client_shows(fitted, rects[0], 1.0, away) for away in (1.0, 2.0))
    assert near == pytest.approx(covered, rel=0.06)
    assert far == pytest.approx(covered, rel=0.06)
    assert client_shows(alpha, rects[0], 1.0, 2.0) < 0.6 * covered


@given(st.floats(0.3, 3.0), st.floats(1.0, 4.0))
def test_shares_of_mips_are_those_of_their_footprints(density: float, reach: float) -> None:
    share = seen_at(density, reach)
    assert share.sum() == pytest.approx(1)
    assert (share >= 0).all()
    if density * reach <= 1:  # half of the pixels of a sphere of planes see them within 45 degrees
        assert share[: np.searchsorted(MIPS, 0.5) + 1].sum() > 0.5


def test_grown_shapes_keep_their_holes() -> None:
    """A ring, asked for twice as much, grows outwards and inwards by its outline; the middle
    of its hole stays open."""
    y, x = np.indices((40, 40)) - 19.5
    radius = np.hypot(x, y)
    ring = (255 * np.clip(15 - radius, 0, 1) * np.clip(radius - 7, 0, 1)).astype(np.uint8)
    alpha, rects = framed(ring)
    grown = unbiased_alpha(alpha, rects, GUTTER, reach=1.0, factor=1.8)[8:48, 8:48] >= 128
    assert grown.sum() > 1.1 * (ring >= 128).sum()
    assert not grown[radius < 3].any()
    assert grown[(radius > 8) & (radius < 14)].all()


def test_shrunk_shapes_keep_their_middle() -> None:
    y, x = np.indices((40, 40)) - 19.5
    disc = (255 * (np.hypot(x, y) < 14)).astype(np.uint8)
    alpha, rects = framed(disc)
    left = unbiased_alpha(alpha, rects, GUTTER, reach=1.0, factor=0.5)[8:48, 8:48] >= 128
    assert 0 < left.sum() < 0.9 * (disc > 0).sum()
    assert left[np.hypot(x, y) < 8].all()
    assert not left[disc == 0].any()


def test_a_straight_twig_is_thinned_and_not_lost() -> None:
    """Thirty texels, all covered alike by two fifths: neither all of them nor none."""
    alpha, rects = framed(np.full((1, 30), 102, np.uint8))
    passing = unbiased_alpha(alpha, rects, GUTTER, reach=1.0)[8, 8:38] >= 128
    assert 4 <= passing.sum() <= 20


@pytest.mark.parametrize("value", [0, 255])
def test_empty_and_opaque_pictures_stay(value: int) -> None:
    alpha, rects = framed(np.full((9, 5), value, np.uint8))
    for factor in (0.3, 1.0, 3.0):
        np.testing.assert_array_equal(
            unbiased_alpha(alpha, rects, GUTTER, factor=factor)[8:17, 8:13], value
        )


def test_each_picture_by_itself_and_nothing_outside() -> None:
    """Beside another picture, and a white block that is none, a picture gets the alpha that it has
    alone."""
    alpha, _ = framed(leaves())
    one, _ = framed(leaves(seed=8))
    both = np.concatenate([alpha, one], axis=1)
    both[60:64, 0:4] = 255
    rects = np.array([[8, 8, 48, 48], [72, 8, 48, 48]], np.int32)
    fitted = unbiased_alpha(both, rects, GUTTER, factor=np.array([1.0, 0.5]))
    alone = unbiased_alpha(alpha, rects[:1], GUTTER)
    np.testing.assert_array_equal(fitted[6:58, 6:58], alone[6:58, 6:58])
    np.testing.assert_array_equal(fitted[60:64, 0:4], 255)
    assert (fitted[:, 70:] >= 128).sum() < 0.7 * (one >= 128).sum()


def test_gutters_repeat_the_edge_and_inputs_stay() -> None:
    alpha, rects = framed(leaves())
    before = alpha.copy()
    fitted = unbiased_alpha(alpha, rects, GUTTER)
    np.testing.assert_array_equal(alpha, before)
    inside = fitted[8:56, 8:56]
    np.testing.assert_array_equal(fitted[6:58, 6:58], np.pad(inside, 2, mode="edge"))


def test_halving_and_interpolating_are_the_plain_ones() -> None:
    rng = np.random.default_rng(1)
    values = rng.random((6, 10)).astype(np.float32)
    blocks = values.reshape(3, 2, 5, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(halved(values), blocks, rtol=1e-6)
    plain = np.array([0.5, 1.5, 5.5]), np.array([0.5, 9.5])
    np.testing.assert_array_equal(interpolated(values, *plain), values[[0, 1, 5]][:, [0, 9]])
    between = interpolated(values, np.array([1.0]), np.array([2.0]))
    np.testing.assert_allclose(between, [[values[0:2, 1:3].mean()]], rtol=1e-6)


@pytest.fixture(scope="module")
def scene() -> tuple[Level, Truths]:
    """A grown tree's level with alpha as baked, and its truth from six views at one distance."""
    plant = sample("broadleaf", 4000, seed=1)
    labels = cluster(plant, "kmeans", 40)
    boards = make_billboards(plant, labels)
    options = BakeOptions(fit_alpha=False)
    level = bake(plant, labels, boards, 100 / plant.extent, options)
    return level, truths(plant, views("all", 6), [100.0], Display())


@pytest.mark.gl
def test_a_level_covers_what_its_truth_does(scene: tuple[Level, Truths]) -> None:
    level, truth = scene
    before = level.atlas.color.copy()
    solved = solve_coverage(level, [truth], GUTTER)
    np.testing.assert_array_equal(level.atlas.color, before)
    assert abs(solved.bias - SURPLUS) < 0.02
    assert solved.bias == pytest.approx(measured_bias(solved.level, [truth]))
    assert solved.rounds <= ROUNDS


@pytest.mark.gl
def test_the_same_level_twice_is_the_same(scene: tuple[Level, Truths]) -> None:
    level, truth = scene
    one, two = (solve_coverage(level, [truth], GUTTER) for _ in range(2))
    np.testing.assert_array_equal(one.level.atlas.color, two.level.atlas.color)
    assert (one.factor, one.bias) == (two.factor, two.bias)
