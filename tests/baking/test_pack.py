from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vegtool.baking.pack import BLOCK, pack

SIZES = st.lists(st.tuples(st.integers(1, 60), st.integers(1, 60)), min_size=1, max_size=60)


@settings(max_examples=60, deadline=None)
@given(SIZES, st.integers(0, 3))
def test_rectangles_lie_inside_and_apart(sizes, gutter):
    """Each texel belongs to one rectangle and gutter at most, and none lies outside."""
    sizes = np.array(sizes)
    packing = pack(sizes, gutter, 4096)
    assert packing.width % BLOCK == 0 and packing.height % BLOCK == 0
    assert (packing.rect[:, 2:] == sizes).all()
    owners = np.zeros((packing.height, packing.width), dtype=int)
    for x, y, w, h in packing.rect:
        assert x >= gutter and y >= gutter
        assert x + w + gutter <= packing.width and y + h + gutter <= packing.height
        owners[y - gutter : y + h + gutter, x - gutter : x + w + gutter] += 1
    assert owners.max() == 1
    assert packing.fill == pytest.approx((owners > 0).mean())


@pytest.mark.parametrize("count", [22, 67, 200, 600, 20_000])
@pytest.mark.parametrize("mean", [4, 12, 30])
def test_three_quarters_are_filled(count, mean):
    """Sizes as clusters have them: many of the mean, some three times as long, mixed shapes."""
    rng = np.random.default_rng(count + mean)
    sizes = np.maximum(1, np.rint(rng.gamma(3, mean / 3, (count, 2)))).astype(int)
    assert pack(sizes, 2, 8192).fill >= 0.75


@pytest.mark.parametrize("most", [4096, 16384])
def test_twenty_thousand_leave_little_free_and_lie_apart(most):
    """As many small as large ones, 4 to 128 texels: the tallest come first, so the smallest close
    what little the skyline leaves open at its end."""
    rng = np.random.default_rng(1)
    sizes = np.exp(rng.uniform(np.log(4), np.log(129), (20_000, 2))).astype(int)
    packing = pack(sizes, 0, most)
    assert packing.width <= most
    owners = np.zeros((packing.height, packing.width), dtype=np.uint8)
    for x, y, w, h in packing.rect:
        owners[y : y + h, x : x + w] += 1
    assert owners.max() == 1
    assert owners.mean() == pytest.approx(packing.fill) and packing.fill >= 0.95


def test_one_rectangle_takes_no_more_than_the_next_multiple_of_four():
    packing = pack(np.array([[13, 5]]), 2, 2048)
    assert (packing.width, packing.height) == (20, 12)
    assert packing.rect.tolist() == [[2, 2, 13, 5]]


def test_the_same_sizes_give_the_same_packing_whatever_came_before():
    sizes = np.random.default_rng(0).integers(1, 40, (300, 2))
    first = pack(sizes, 2, 2048).rect
    pack(sizes[::-1], 1, 512)
    assert (pack(sizes, 2, 2048).rect == first).all()


def test_the_width_keeps_to_the_limit_where_the_rectangles_do():
    packing = pack(np.full((200, 2), 30), 2, 250)
    assert packing.width <= 250


@pytest.mark.parametrize(("mip", "most"), [(1, 0.0), (2, 1 / 16)])
def test_two_texels_of_gutter_keep_neighbours_out_of_two_mips(mip, most):
    """A client averages 2 x 2 texels a mip and filters bilinearly. Along the edges of a picture,
    wherever it lies on the mip's grid, the neighbours weigh nothing at mip 1 and at most a
    sixteenth at mip 2."""
    gutter, step = 2, 2**mip
    for offset in range(step):
        start, end = 64 + offset, 64 + offset + 24
        neighbours = np.ones(160)
        neighbours[start - 2 * gutter : end + 2 * gutter] = 0  # theirs begins after both gutters
        level = neighbours.reshape(-1, step).mean(axis=1)
        centers = (np.arange(len(level)) + 0.5) * step
        assert np.interp(np.linspace(start, end, 500), centers, level).max() <= most + 1e-9
