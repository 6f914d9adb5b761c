"""As much passes the alpha test as is covered, picture by picture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vegtool.baking.coverage import PASS, coverage_kept, tables

WHOLE = np.array([[0, 0, 8, 8]], np.int32)


def passing(alpha: np.ndarray) -> float:
    """The plain reference: texels that pass, on average over mips 0 and 1."""
    h, w = alpha.shape
    mip = alpha.reshape(h // 2, 2, w // 2, 2).astype(float).mean(axis=(1, 3))
    return 0.5 * (alpha >= PASS).sum() + 0.5 * 4 * (mip > PASS - 1 + 0.25).sum()


def test_a_twig_thinner_than_half_a_texel_does_not_vanish() -> None:
    """Eight texels of coverage a quarter are two texels' worth. One texel wide, the twig is gone
    at mip 1, so four pass at mip 0: two on average over the level's range."""
    alpha = np.zeros((8, 8), np.uint8)
    alpha[:, 3] = [60, 61, 62, 63, 64, 65, 66, 67]
    kept = coverage_kept(alpha, WHOLE)
    np.testing.assert_array_equal(kept[:, 3] >= PASS, [False] * 4 + [True] * 4)


def test_nearly_full_texels_do_not_count_as_full() -> None:
    """64 texels of coverage 0.7, all different, are 45 texels' worth."""
    alpha = (0.7 * 255 + np.arange(-32, 32)).reshape(8, 8).astype(np.uint8)
    assert passing(coverage_kept(alpha, WHOLE)) == pytest.approx(alpha.sum() / 255, abs=2)
    assert passing(alpha) == 64


def test_what_is_cut_out_sharply_stays_as_it_is() -> None:
    alpha = np.where(np.indices((8, 8)).sum(0) % 3, 255, 0).astype(np.uint8)
    np.testing.assert_array_equal(coverage_kept(alpha, WHOLE), alpha)


def test_each_picture_by_itself_and_nothing_outside() -> None:
    alpha = np.full((8, 8), 40, np.uint8)
    alpha[:4, :4] = 255
    kept = coverage_kept(alpha, np.array([[0, 0, 4, 4], [4, 4, 2, 2]], np.int32))
    np.testing.assert_array_equal(kept[:4], alpha[:4])
    np.testing.assert_array_equal(kept[4:, :4], alpha[4:, :4])


def test_gutters_repeat_the_edge() -> None:
    """A twig one texel wide fills its picture: at mip 1 too, where its gutter is half of a block,
    so nothing has to change for as much to pass as is covered."""
    alpha = np.zeros((16, 16), np.uint8)
    alpha[5:11, 6] = 255
    kept = coverage_kept(alpha, np.array([[6, 5, 1, 6]], np.int32), gutter=2)
    expected = np.zeros_like(alpha)
    expected[3:13, 4:9] = 255
    np.testing.assert_array_equal(kept, expected)


def test_full_texels_stay_full_even_where_they_alone_pass() -> None:
    """At a threshold of 255 nothing below passes, and what is full is not lowered to the limit."""
    table = tables(np.array([255, 254, 1]))
    np.testing.assert_array_equal(table[:, [0, 255]], [[0, 255]] * 3)
    assert table[0, 254] < PASS <= table[1, 254]


@given(st.binary(min_size=64, max_size=64))
def test_ranks_nothing_and_everything_are_kept(data: bytes) -> None:
    alpha = np.frombuffer(data, np.uint8).reshape(8, 8)
    kept = coverage_kept(alpha, WHOLE)
    order = np.argsort(alpha, axis=None, kind="stable")
    assert (np.diff(kept.ravel()[order].astype(int)) >= 0).all()
    assert (kept[alpha == 0] == 0).all()
    assert (kept[alpha == 255] == 255).all()
    possible = [passing(table[alpha]) for table in tables(np.arange(1, 256))]
    wanted = alpha.sum() / 255
    nearest = min(abs(p - wanted) for p in possible)
    assert abs(passing(kept) - wanted) <= nearest + 1e-9
