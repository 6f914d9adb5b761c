"""As much passes the alpha test as is covered, picture by picture."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vegtool.baking.coverage import PASS, coverage_kept, tables

WHOLE = np.array([[0, 0, 8, 8]], np.int32)


def test_a_twig_thinner_than_half_a_texel_does_not_vanish() -> None:
    """Eight texels of coverage a quarter are two texels' worth: the test lets two of them pass
    where the ranks allow it."""
    alpha = np.zeros((8, 8), np.uint8)
    alpha[:, 3] = [60, 61, 62, 63, 64, 65, 66, 67]
    kept = coverage_kept(alpha, WHOLE)
    np.testing.assert_array_equal(kept[:, 3] >= PASS, [False] * 6 + [True] * 2)


def test_nearly_full_texels_do_not_count_as_full() -> None:
    """64 texels of coverage 0.6, all different, are 38 texels' worth."""
    alpha = (0.6 * 255 + np.arange(-32, 32)).reshape(8, 8).astype(np.uint8)
    assert (coverage_kept(alpha, WHOLE) >= PASS).sum() == round(alpha.sum() / 255)


def test_what_is_cut_out_sharply_stays_as_it_is() -> None:
    alpha = np.where(np.indices((8, 8)).sum(0) % 3, 255, 0).astype(np.uint8)
    np.testing.assert_array_equal(coverage_kept(alpha, WHOLE), alpha)


def test_each_picture_by_itself_and_nothing_outside() -> None:
    alpha = np.full((8, 8), 40, np.uint8)
    alpha[:4, :4] = 255
    kept = coverage_kept(alpha, np.array([[0, 0, 4, 4], [4, 4, 2, 2]], np.int32))
    np.testing.assert_array_equal(kept[:4], alpha[:4])
    np.testing.assert_array_equal(kept[4:, :4], alpha[4:, :4])


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
    possible = [(alpha >= t).sum() for t in range(1, 256)]  # the plain reference
    wanted = alpha.sum() / 255
    nearest = min(abs(p - wanted) for p in possible)
    assert abs((kept >= PASS).sum() - wanted) <= nearest + 1e-9
