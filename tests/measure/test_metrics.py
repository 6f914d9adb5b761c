"""Metrics on pictures whose scores follow from their definition."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import flip_evaluator
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from vegtool.arrays import Picture
from vegtool.measure.background import BACKGROUND
from vegtool.measure.metrics import (
    DARKEST,
    METRICS,
    PSNR_CAP,
    SAMPLE,
    SSIM_WINDOW,
    reference,
    score,
)
from vegtool.seeding import generator
from vegtool.srgb import srgb_from_linear

PERFECT = {
    "flip": 0.0, "ssim": 1.0, "psnr": PSNR_CAP, "coverage_bias": 0.0, "silhouette": 0.0,
    "false_holes": 0.0, "color_bias": 0.0, "shading_rmse": 0.0,
}  # fmt: skip
BLACK, GREY, WHITE = np.zeros(3), np.full(3, 0.2), np.ones(3)
FULL = np.ones((20, 20))


def plain(color: npt.ArrayLike = GREY, coverage: npt.ArrayLike = FULL) -> Picture:
    """A picture of one straight colour, (3,), that covers its pixels (h, w) by so much."""
    alpha = np.asarray(coverage, np.float32)[..., None]
    return np.concatenate([alpha * np.asarray(color, np.float32), alpha], axis=2)


def block(size: int = 40, margin: int = 10) -> Picture:
    """(size, size) coverage: a full square within an empty margin."""
    coverage = np.zeros((size, size), np.float32)
    coverage[margin:-margin, margin:-margin] = 1
    return coverage


def noise(*size: int) -> Picture:
    random = generator(1, "noise", *size)
    alpha = random.random((*size, 1), np.float32)
    return np.concatenate([alpha * random.random((*size, 3), np.float32), alpha], axis=2)


def scored(truth: Picture, level: Picture) -> dict[str, float]:
    return score(reference(truth), level)


@pytest.mark.parametrize("size", [(1, 1), (1, 20), (20, 1), (6, 6), (7, 7), (40, 30)])
@pytest.mark.parametrize("coverage", [0.0, SAMPLE, 0.5, 1.0])
def test_the_truth_itself_scores_perfectly(size: tuple[int, int], coverage: float) -> None:
    picture = plain([0.2, 0.5, 0.1], np.full(size, coverage))
    assert scored(picture, picture) == PERFECT
    assert list(PERFECT) == list(METRICS)


def test_half_the_coverage_in_the_same_colour() -> None:
    """Half is missing, everywhere, the inside included; what is there is right."""
    found = scored(plain(coverage=block()), plain(coverage=block() / 2))
    assert found["coverage_bias"] == pytest.approx(-0.5)
    assert found["silhouette"] == pytest.approx(0.5)
    assert found["false_holes"] == pytest.approx(0.5)
    assert found["color_bias"] == pytest.approx(0, abs=1e-6)
    assert found["shading_rmse"] == pytest.approx(0, abs=1e-6)


def test_as_much_coverage_in_the_wrong_place() -> None:
    """The left half instead of the right: no bias, all of it wrong twice, nothing in common."""
    left = np.zeros((20, 20), np.float32)
    left[:, :10] = 1
    found = scored(plain(coverage=left), plain(coverage=left[:, ::-1]))
    assert found["coverage_bias"] == pytest.approx(0)
    assert found["silhouette"] == pytest.approx(2)
    assert found["false_holes"] == pytest.approx(1)
    assert found["shading_rmse"] == 0


def test_a_lighter_level() -> None:
    """Three halves of the light, on the same silhouette."""
    found = scored(plain(GREY, block()), plain(1.5 * GREY, block()))
    assert found["color_bias"] == pytest.approx(0.5, abs=1e-6)
    assert found["shading_rmse"] == pytest.approx(0.1, abs=1e-6)
    assert found["coverage_bias"] == found["silhouette"] == found["false_holes"] == 0


def test_errors_of_shading_that_cancel_are_no_bias() -> None:
    checks = np.indices((20, 20)).sum(axis=0)[..., None] % 2
    level = plain()
    level[..., :3] += np.where(checks, 0.1, -0.1).astype(np.float32)
    found = scored(plain(), level)
    assert found["color_bias"] == pytest.approx(0, abs=1e-6)
    assert found["shading_rmse"] == pytest.approx(0.1, abs=1e-6)


def test_shading_counts_where_both_cover_and_by_how_much() -> None:
    """Pixels: right at 1/2, wrong by 0.3 at 1/4, seen by one of the two: 0.3 of a third."""
    truth = plain(GREY, [[1.0, 0.25, 1.0, 0.0]])
    level = plain(GREY, [[0.5, 1.0, 0.0, 1.0]])
    level[0, 1, :3] += 0.3
    expected = 0.3 * (0.25 / 0.75) ** 0.5
    assert scored(truth, level)["shading_rmse"] == pytest.approx(expected, rel=1e-5)


def test_luminance_is_that_of_linear_srgb() -> None:
    """A green level is 0.7152 / 0.2126 times as luminous as a red truth."""
    found = scored(plain([0.5, 0, 0]), plain([0, 0.5, 0]))
    assert found["color_bias"] == pytest.approx(0.7152 / 0.2126 - 1, rel=1e-5)


def test_holes_inside_are_false_and_a_worn_edge_is_not() -> None:
    """Of a square of 20 x 20, the pixels that have no edge are 18 x 18."""
    holed, worn = block(), block(margin=11)
    holed[15:17, 15:17] = 0
    truth = plain(coverage=block())
    assert scored(truth, plain(coverage=holed))["false_holes"] == pytest.approx(4 / 18**2)
    found = scored(truth, plain(coverage=worn))
    assert found["false_holes"] == 0
    assert found["silhouette"] == pytest.approx(76 / 400)


@pytest.mark.parametrize(("gap", "closed"), [(6, True), (8, False)])
def test_small_gaps_of_the_truth_are_inside_its_silhouette(gap: int, closed: bool) -> None:
    """What stands at a small gap is inside; at a large one it is edge, where nothing counts."""
    coverage = block(60)
    coverage[:, 30 - gap // 2 : 30 + gap // 2] = 0
    level = coverage.copy()
    level[25:35, 30 - gap // 2 - 1] = 0
    truth = plain(coverage=coverage)
    assert (scored(truth, plain(coverage=level))["false_holes"] > 0) == closed
    filled = scored(truth, plain(coverage=block(60)))
    assert filled["false_holes"] == 0  # the truth's own gaps are not missed
    assert filled["coverage_bias"] > 0


def test_black_and_white() -> None:
    """Encoded, they differ by 1: 0 dB. SSIM of plain pictures is C1 / (1 + C1), C1 = 0.01^2.
    FLIP's colour difference is 100^0.7, where the largest possible is 41.3."""
    found = scored(plain(BLACK), plain(WHITE))
    assert found["psnr"] == pytest.approx(0, abs=1e-5)
    assert found["ssim"] == pytest.approx(1e-4 / (1 + 1e-4), rel=1e-3)
    assert found["flip"] == pytest.approx(1 - 0.05 * (41.3 - 100**0.7) / (0.6 * 41.3), abs=1e-4)
    assert found["color_bias"] == pytest.approx(1 / DARKEST, rel=1e-5)  # the truth has no light


def test_pictures_are_compared_over_one_background_as_srgb() -> None:
    truth, level = noise(60, 50), noise(60, 51)[:, :50]

    def shown(picture: Picture) -> Picture:
        linear = picture[..., :3] + (1 - picture[..., 3:]) * BACKGROUND
        return np.asarray(srgb_from_linear(linear))

    found, a, b = scored(truth, level), shown(truth), shown(level)
    _, flip, _ = flip_evaluator.evaluate(a, b, "LDR", applyMagma=False)
    assert found["flip"] == pytest.approx(flip, abs=1e-5)
    assert found["psnr"] == pytest.approx(peak_signal_noise_ratio(a, b, data_range=1), abs=1e-4)
    luma = [p @ np.array([0.2126, 0.7152, 0.0722]) for p in (a, b)]
    assert found["ssim"] == pytest.approx(structural_similarity(*luma, data_range=1), abs=1e-5)


def test_light_above_white_is_shown_as_white() -> None:
    found = scored(plain(WHITE), plain(1.5 * WHITE))
    assert (found["flip"], found["ssim"], found["psnr"]) == (0, 1, PSNR_CAP)
    assert found["color_bias"] == pytest.approx(0.5)


def test_small_pictures_stand_on_background_for_ssim() -> None:
    truth, level = noise(3, 4), noise(4, 4)[:3]
    padding = ((2, 2), (1, 2), (0, 0))
    large = [np.pad(p, padding) for p in (truth, level)]
    assert large[0].shape[:2] == (SSIM_WINDOW, SSIM_WINDOW)
    assert scored(truth, level)["ssim"] == pytest.approx(scored(*large)["ssim"], abs=1e-6)


def test_a_plant_below_a_pixel() -> None:
    """One sample of one pixel, missed or doubled: shares are of that sample; it has no inside."""
    coverage = np.zeros((10, 10), np.float32)
    coverage[4, 4] = SAMPLE
    truth = plain(coverage=coverage)
    missed, doubled = scored(truth, np.zeros_like(truth)), scored(truth, 2 * truth)
    assert (missed["coverage_bias"], doubled["coverage_bias"]) == (-1, 1)
    assert (missed["silhouette"], doubled["silhouette"]) == (1, 1)
    assert missed["false_holes"] == missed["color_bias"] == missed["shading_rmse"] == 0


def test_what_is_undefined_is_stated() -> None:
    """An empty truth is divided by as if it covered one sample; no colour has no bias."""
    nothing, something = plain(coverage=0 * FULL), plain(coverage=block(20, 5))
    found = scored(nothing, something)
    assert found["coverage_bias"] == found["silhouette"] == pytest.approx(100 / SAMPLE)
    assert found["false_holes"] == found["color_bias"] == found["shading_rmse"] == 0
    found = scored(something, nothing)
    assert (found["coverage_bias"], found["silhouette"], found["false_holes"]) == (-1, 1, 1)
    assert found["color_bias"] == found["shading_rmse"] == 0


@settings(deadline=None, max_examples=60)
@given(
    size=st.tuples(st.integers(1, 12), st.integers(1, 12)),
    seed=st.integers(0, 1000),
    empty=st.tuples(*[st.sampled_from([0.0, 0.9, 1.0])] * 2),
)
def test_every_score_is_a_finite_number(
    size: tuple[int, int], seed: int, empty: tuple[float, float]
) -> None:
    random = generator(seed, "finite")

    def picture(share: float) -> Picture:
        alpha = random.integers(0, 65, size) / 64 * (random.random(size) >= share)
        return plain(random.random(3), alpha)

    found = scored(picture(empty[0]), picture(empty[1]))
    json.dumps(found, allow_nan=False)
    assert list(found) == list(METRICS)
    assert all(type(value) is float for value in found.values())
    assert 0 <= found["flip"] <= 1 and -1 <= found["ssim"] <= 1 + 1e-6
    assert 0 <= found["psnr"] <= PSNR_CAP and 0 <= found["false_holes"] <= 1 + 1e-6
    assert found["coverage_bias"] >= -1 and found["silhouette"] >= abs(found["coverage_bias"])


def test_more_background_around_both_changes_no_share() -> None:
    truth, level = noise(30, 24), noise(31, 24)[:30]
    wide = [np.pad(p, ((5, 2), (3, 9), (0, 0))) for p in (truth, level)]
    found, expected = scored(*wide), scored(truth, level)
    for name in ("coverage_bias", "silhouette", "false_holes", "color_bias", "shading_rmse"):
        assert found[name] == pytest.approx(expected[name], rel=1e-5), name


def test_mirrored_pictures_score_the_same() -> None:
    truth, level = noise(30, 24), noise(31, 24)[:30]
    found = scored(truth[:, ::-1], level[:, ::-1])
    assert found == pytest.approx(scored(truth, level), abs=1e-5)


def test_one_reference_serves_many_threads() -> None:
    truth = reference(noise(90, 80))
    levels = [noise(90, 80 + i)[:, :80] for i in range(1, 7)]
    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(lambda level: score(truth, level), levels))
    assert together == [score(truth, level) for level in levels]


def test_pictures_stay_as_they_were() -> None:
    truth, level = noise(20, 20), noise(21, 20)[:20]
    before = truth.copy(), level.copy()
    scored(truth, level)
    np.testing.assert_array_equal([truth, level], before)
    assert truth.flags.writeable


def test_pictures_that_cannot_be_compared_are_refused() -> None:
    truth = reference(plain(coverage=np.ones((8, 9))))
    with pytest.raises(ValueError, match=r"\(8, 9, 4\).*\(9, 8, 4\)"):
        score(truth, plain(coverage=np.ones((9, 8))))
    with pytest.raises(ValueError, match="shape"):
        reference(np.zeros((8, 9, 3), np.float32))
    for height, width in product((0, 5), repeat=2):
        if not height * width:
            with pytest.raises(ValueError, match="pixel"):
                reference(np.zeros((height, width, 4), np.float32))
    broken = plain()
    broken[3, 4, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        reference(broken)


def test_scores_need_no_graphics() -> None:
    code = "import vegtool.measure.metrics, sys; assert 'moderngl' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
