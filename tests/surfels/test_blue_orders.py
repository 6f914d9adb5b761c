"""Progressive orders of points: every prefix is spread evenly."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from vegtool.arrays import FloatArray, IntArray
from vegtool.errors import UsageError
from vegtool.surfel_set import Spacing
from vegtool.surfels.blue.averaged import averaged
from vegtool.surfels.blue.distances import nearest, relative, spacing
from vegtool.surfels.blue.exact import exact_order
from vegtool.surfels.blue.farthest import farthest_order
from vegtool.surfels.blue.places import drawn
from vegtool.surfels.blue.randomised import randomised_order

ORDERS = (exact_order, farthest_order, randomised_order)


def sphere(many: int, seed: int = 1) -> FloatArray:
    points = np.random.default_rng(seed).normal(size=(many, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def plate(many: int, thickness: float) -> tuple[FloatArray, FloatArray]:
    """Positions and normals of the two sides of a square of one metre, half of the points each."""
    rng = np.random.default_rng(3)
    side = np.where(np.arange(many) % 2 == 0, 1.0, -1.0)
    positions = np.column_stack([rng.random(many), rng.random(many), thickness / 2 * side])
    return positions, np.outer(side, [0.0, 0.0, 1.0])


def plain(points: FloatArray, first: int, count: int) -> IntArray:
    """The farthest-first order, all distances looked at for each point."""
    order, near = [first], np.full(len(points), np.inf)
    while len(order) < count:
        near = np.minimum(near, ((points - points[order[-1]]) ** 2).sum(axis=1))
        near[order] = -1
        order.append(int(near.argmax()))
    return np.array(order, np.int32)


@pytest.mark.parametrize("many", [1, 2, 63, 64, 65, 2048, 2049, 5000])
def test_the_exact_order_is_the_plain_one(many: int) -> None:
    """At, below and above what fills leaves and nodes. Distances of random points all differ."""
    points = sphere(many)
    order = exact_order(points, min(many, 400))
    assert np.array_equal(order, plain(points, int(order[0]), len(order)))


def test_the_exact_order_with_normals_is_the_plain_one_in_six_dimensions() -> None:
    positions, normals = plate(3000, 0.001)
    order = exact_order(positions, 300, normals=normals, normal_weight=0.05)
    joined = np.hstack([positions, 0.05 * normals])
    assert np.array_equal(order, plain(joined, int(order[0]), 300))


def test_of_equally_far_points_any_is_next() -> None:
    """On a grid most distances are equal: whatever is taken is as far as any."""
    points = np.stack(np.meshgrid(*[np.arange(9.0)] * 3), axis=-1).reshape(-1, 3)
    order = exact_order(points, len(points))
    near = np.full(len(points), np.inf)
    for number in order:
        assert near[number] == near.max()
        near = np.minimum(near, ((points - points[number]) ** 2).sum(axis=1))
        near[number] = -1
    assert np.all(near == -1)  # so that all have come, once


@pytest.mark.parametrize("length", [2, 10, 100, 700])
def test_prefixes_of_the_exact_order_are_nets(length: int) -> None:
    """No two points nearer than r, the least distance in a prefix, and no candidate farther than r
    from all: it would have come before the last of them."""
    points = sphere(4000)
    prefix = points[exact_order(points, 700)[:length]]
    away = cKDTree(prefix).query(points)[0]
    assert away.max() <= nearest(prefix).min() * (1 + 1e-12)


def test_ours_is_near_the_exact_one_and_better_than_the_papers() -> None:
    """Of a tenth of the candidates ordered exactly, least distances are little smaller; those of
    rounds of samples are."""
    points = sphere(40_000)
    exact, ours, paper = (order(points, 1000) for order in ORDERS)
    for length in (100, 300, 1000):
        least = [nearest(points[order[:length]]).min() for order in (exact, ours, paper)]
        assert least[1] > 0.85 * least[0]
        assert least[1] > least[2]
    random = np.median(nearest(points[np.arange(1000)]))
    assert np.median(nearest(points[paper])) > 1.3 * random


@pytest.mark.parametrize("order", ORDERS)
def test_orders_take_none_twice_and_are_the_same_again(order: Callable[..., IntArray]) -> None:
    points = sphere(3000)
    one = order(points, 500, seed=4)
    assert one.dtype == np.int32
    assert len(np.unique(one)) == len(one) == 500
    assert one.tobytes() == order(points, 500, seed=4).tobytes()
    assert one.tobytes() != order(points, 500, seed=5).tobytes()


@pytest.mark.parametrize("order", [exact_order, farthest_order])
def test_as_many_as_there_are(order: Callable[..., IntArray]) -> None:
    points = sphere(300)
    assert len(order(points, 0)) == 0
    assert len(order(points, 1)) == 1
    assert sorted(order(points, 300)) == list(range(300))
    assert np.array_equal(order(points, 10**8), order(points, 300))
    assert len(order(points[:0], 5)) == 0


def test_the_papers_order_ends_where_no_candidates_are_left() -> None:
    points = sphere(300)
    assert len(randomised_order(points, 0)) == len(randomised_order(points[:0], 5)) == 0
    assert sorted(randomised_order(points, 10**8)) == list(range(300))
    assert len(randomised_order(np.ones((1000, 3)), 10)) == 1  # copies are dropped


@pytest.mark.parametrize("order", ORDERS)
def test_orders_are_of_the_shape_not_of_where_it_is(order: Callable[..., IntArray]) -> None:
    """Twice as large and 1024 m off changes no distance's rank, but for rounding, which powers of
    two leave alone; nor does what was x being y."""
    points = np.round(sphere(3000) * 2**20) / 2**20
    one = order(points, 200)
    assert np.array_equal(order(2 * points + 1024, 200)[:150], one[:150])
    if order is not randomised_order:  # whose grid has no part in what is found either, but ties
        assert np.array_equal(order(points[:, [1, 2, 0]] * [1, -1, 1], 200)[:150], one[:150])


def test_copies_come_last_by_number() -> None:
    points = np.repeat(sphere(50), 3, axis=0)
    order = exact_order(points, 150)
    assert len(np.unique(order // 3)) == len(np.unique(order[:50] // 3)) == 50
    assert np.all(np.diff(order[50:]) > 0)
    assert sorted(exact_order(np.ones((500, 3)), 500)) == list(range(500))


def test_an_outlier_far_away_comes_second() -> None:
    """A hundred million sizes off: whatever cells and keys are, it is the farthest."""
    points = np.vstack([sphere(2000), [[1e8, 0, 0]]])
    assert 2000 in exact_order(points, 10)[:2]
    assert len(randomised_order(points, 500)) == 500


@pytest.mark.parametrize("scale", [1e-320, 1e-300, 1e300])
def test_sizes_whose_squares_are_no_numbers(scale: float) -> None:
    """Nothing is said of the order, but that all come, once."""
    points = sphere(300) * scale
    assert sorted(exact_order(points, 300)) == list(range(300))
    assert len(np.unique(randomised_order(points, 100))) in (1, 100)


def test_what_cannot_be_kept_is_compiled_all_the_same() -> None:
    """Without a file there is no place beside it."""
    from vegtool.surfels.blue.compiled import compiled

    names: dict[str, Any] = {}
    exec("def twice(x):\n    return 2 * x", names)
    assert compiled(names["twice"])(21) == 42


def test_both_sides_of_a_thin_plate_get_points() -> None:
    """A hair thick, its sides are one for distances of positions, and points of one side keep those
    of the other away; with normals, sides are two planes, on which the spacing of one side alone
    returns: about that of half as many points."""
    positions, normals = plate(20_000, 1e-4)
    blind = positions[farthest_order(positions, 1000)]
    keen = positions[farthest_order(positions, 1000, normals=normals, normal_weight=0.2)]
    for side in (-1, 1):
        away = [
            cKDTree(points[points[:, 2] * side > 0]).query(positions[positions[:, 2] * side > 0])[0]
            for points in (blind, keen)
        ]
        assert away[1].max() < 0.75 * away[0].max()  # the largest hole of a side
    assert abs(int((keen[:, 2] > 0).sum()) - 500) < 30


@pytest.mark.parametrize(("there", "many"), [(0, 0), (7, 7), (10, 7), (1000, 30)])
def test_one_candidate_is_drawn_of_each_run(there: int, many: int) -> None:
    """Runs do not overlap, and together are all: each has one, and none is longer than another by
    more than one."""
    some = drawn(there, many, 1)
    starts = np.arange(many + 1) * there // max(many, 1)
    assert np.all((some >= starts[:-1]) & (some < starts[1:]))


def test_what_is_refused() -> None:
    points = sphere(10)
    with pytest.raises(UsageError, match="points: expected zero or more; got -1"):
        exact_order(points, -1)
    with pytest.raises(UsageError, match="expected metres"):
        farthest_order(points, 1, normals=points, normal_weight=-1.0)
    with pytest.raises(UsageError, match="expected normals"):
        farthest_order(points, 1, normal_weight=1.0)
    with pytest.raises(ValueError, match="positions"):
        randomised_order(np.full((3, 3), np.nan), 1)


def test_relative_distances_of_a_hexagonal_grid_are_one() -> None:
    """It has the largest distances that there are. Each point has an area of sqrt(3) / 2."""
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    points = np.stack([x + y % 2 / 2, y * 3**0.5 / 2, 0 * x], axis=-1).reshape(-1, 3)
    assert np.allclose(relative(points, len(points) * 3**0.5 / 2), 1)


def test_prefix_lengths() -> None:
    """p(r) = p_m (r_m / r)^2: half the radius takes four times the points."""
    one = Spacing(1000, 0.1, 50_000)
    assert one.prefix(0.1) == 1000
    assert one.prefix(0.05) == 4000
    assert one.prefix(0.2) == 250
    assert (one.prefix(1e9), one.prefix(1e-9), one.prefix(0.0)) == (1, 50_000, 50_000)


def test_spacing_is_that_of_the_first_thousand() -> None:
    points = sphere(20_000)
    ordered = points[farthest_order(points, 2000)]
    one = spacing(ordered)
    assert (one.length, one.total) == (1000, 2000)
    assert one.radius_m == np.median(nearest(ordered[:1000]))
    few = spacing(ordered[:10])
    assert (few.length, few.total) == (10, 10)


@pytest.mark.parametrize("many", [0, 1, 5])
def test_spacing_of_nothing_and_of_copies(many: int) -> None:
    """One place is covered by one disc, if it is no disc of radius 0 by whatever there is."""
    one = spacing(np.ones((many, 3)))
    assert one.radius_m == 0
    assert one.prefix(1.0) == min(many, 1)
    assert one.prefix(0.0) == many


def test_points_have_the_mean_of_what_they_stand_for() -> None:
    """Of black and white candidates points are grey, each the mean of some eight."""
    points = sphere(20_000)
    values = np.column_stack([np.arange(20_000) % 2, np.full(20_000, 3.0)]).astype(np.float64)
    order = farthest_order(points, 2000)
    result = averaged(points, values, order)
    assert result.shape == (2000, 2)
    assert result[:, 0].mean() == pytest.approx(0.5, abs=0.02)
    assert result[:, 0].std() == pytest.approx(0.5 / 8**0.5, rel=0.2)
    assert np.allclose(result[:, 1], 3)
    assert averaged(points, values, order[:0]).shape == (0, 2)


def test_means_keep_to_their_side() -> None:
    """Sides of a plate are red and green: with normals no point is both."""
    positions, normals = plate(4000, 1e-4)
    values = (normals[:, 2:] + 1) / 2
    order = farthest_order(positions, 300, normals=normals, normal_weight=0.5)
    kept = averaged(positions, values, order, normals=normals, normal_weight=2.0)
    assert np.array_equal(kept[2:], values[order[2:]])
    assert 0.1 < averaged(positions, values, order)[5, 0] < 0.9


def test_numba_is_not_loaded_before_an_order_is_made() -> None:
    code = (
        "import vegtool.surfels.blue.farthest, vegtool.surfels.blue.randomised, sys;"
        "assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
