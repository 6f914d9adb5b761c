from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vegtool.baking.dilate import nearest_covered
from vegtool.baking.pack import pack


def owners(shape, rect, gutter):
    """The picture to which each texel belongs, gutter included, or -1."""
    label = np.full(shape, -1)
    for i, (x, y, w, h) in enumerate(rect.tolist()):
        label[max(y - gutter, 0) : y + h + gutter, max(x - gutter, 0) : x + w + gutter] = i
    return label


def plainly(covered, rect, gutter):
    """The distance to the nearest covered texel of the same picture, texel by texel."""
    label = owners(covered.shape, rect, gutter)
    ys, xs = np.nonzero(covered & (label >= 0))
    distance = np.full(covered.shape, np.inf)
    for y, x in np.ndindex(covered.shape):
        same = label[ys, xs] == label[y, x]
        if label[y, x] >= 0 and same.any():
            distance[y, x] = np.min((ys[same] - y) ** 2 + (xs[same] - x) ** 2)
    return label, distance


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.floats(0.02, 0.6))
def test_each_texel_takes_the_nearest_of_its_own_picture(seed, count, share):
    rng = np.random.default_rng(seed)
    packing = pack(rng.integers(1, 12, (count, 2)), 2, 256)
    covered = np.zeros((packing.height, packing.width), dtype=bool)
    for x, y, w, h in packing.rect:
        covered[y : y + h, x : x + w] = rng.random((h, w)) < share
    nearest = nearest_covered(covered, packing.rect, 2)
    label, distance = plainly(covered, packing.rect, 2)
    y, x = np.divmod(nearest, packing.width)
    row, column = np.indices(covered.shape)
    found = np.isfinite(distance)
    assert ((y - row) ** 2 + (x - column) ** 2)[found] == pytest.approx(distance[found])
    assert covered.ravel()[nearest[found]].all()
    assert (label.ravel()[nearest] == label)[found].all()
    own = np.arange(covered.size).reshape(covered.shape)
    assert (nearest == own)[~found].all()  # outside all pictures, or in an empty one
    assert (nearest == own)[covered].all()


def test_a_row_reaches_across_the_whole_picture_and_its_gutter_but_no_further():
    covered = np.zeros((5, 12), dtype=bool)
    covered[2, 2] = True
    rect = np.array([[2, 2, 4, 1], [8, 2, 2, 1]], dtype=np.int32)
    nearest = nearest_covered(covered, rect, 1)
    assert (nearest[1:4, 1:7] == 2 * 12 + 2).all()
    assert (nearest[1:4, 7:] == np.arange(60).reshape(5, 12)[1:4, 7:]).all()
