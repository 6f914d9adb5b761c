"""Hierarchies of surfel billboards: what stands for what, what is left, what is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.growth import sample
from vegtool.lod import Display
from vegtool.surfels.base import Base, base_of
from vegtool.surfels.cuts import by_image_error
from vegtool.surfels.hierarchy import SurfelHierarchy, ancestors, monotone, whole
from vegtool.surfels.merging import merged
from vegtool.surfels.multi_triangulation import MultiTriangulation, multi_triangulation
from vegtool.surfels.reduce import coarser_kept, kept, reduced, similar_gone, similarity
from vegtool.surfels.select import left_to_triangles, sequence, top_down, valid
from vegtool.surfels.validity import spread

pytestmark = pytest.mark.gl
PC = Display().pixels_per_metre(1.0)
Built = tuple[MultiTriangulation, Base, SurfelHierarchy]


@pytest.fixture(scope="module", params=["statue", "palm"])
def built(request: pytest.FixtureRequest) -> Built:
    mt = multi_triangulation(sample(request.param, 4000))
    base = base_of(mt)
    return mt, base, whole(base, merged(base.corners, base.first), 0.5)


def eyes(mt: MultiTriangulation, count: int) -> np.ndarray:
    """(count, 3) all around, from within the bounds to a thousand radii away."""
    random = np.random.default_rng(7)
    way = random.normal(size=(count, 3))
    away = np.exp(random.uniform(np.log(0.3), np.log(1000.0), (count, 1)))
    plant = mt.plant
    return np.asarray(
        plant.center + plant.radius * away * way / np.linalg.norm(way, axis=1)[:, None]
    )


def check_monotone(base: Base, one: SurfelHierarchy, growth: float = 1.0) -> None:
    """Errors grow by a factor, spheres contain those below, patches theirs too."""
    for child in np.flatnonzero(one.father >= 0):
        father = one.father[child]
        assert one.error[father] >= growth * one.error[child] * (1 - 1e-12)
        away = np.linalg.norm(one.center[father] - one.center[child])
        assert away + one.radius[child] <= one.radius[father] * (1 + 1e-12)
    for patch in np.flatnonzero(one.above >= 0):
        above = one.above[patch]
        assert one.error[above] >= base.error[patch]
        away = np.linalg.norm(one.center[above] - base.center[patch])
        assert away + base.radius[patch] <= one.radius[above] * (1 + 1e-12)


def test_the_base_is_the_coarsest_level(built: Built) -> None:
    mt, base, _ = built
    coarsest = np.flatnonzero(mt.start == len(mt.error) - 1)
    assert len(base.first) == len(coarsest)
    assert len(base.corners) == mt.sizes[coarsest].sum()


def test_boxes_are_round_all_that_they_show(built: Built) -> None:
    """And no larger: each touches its points on all six sides."""
    _, base, one = built
    patch, over = one.pairs()
    ends = np.append(base.first[1:], len(base.corners))
    for number in (0, len(one) // 2, len(one) - 1):
        rows = [np.arange(base.first[p], ends[p]) for p in patch[over == number]]
        points = base.corners[np.concatenate(rows)].reshape(-1, 3)
        local = (points - one.boxes.center[number]) @ one.boxes.axes[number].T
        scale = float(one.boxes.half[number, 0])
        np.testing.assert_allclose(local.max(axis=0), one.boxes.half[number], atol=1e-9 * scale)
        np.testing.assert_allclose(-local.min(axis=0), one.boxes.half[number], atol=1e-9 * scale)
    assert set(patch[over == len(one) - 1]) == set(range(len(base.first))), "the root shows all"


def test_all_grows_on_the_way_up(built: Built) -> None:
    _, base, one = built
    check_monotone(base, one)
    check_monotone(base, coarser_kept(base, one))
    check_monotone(base, reduced(base, one), 1 / spread(one.theta))


def test_what_is_no_coarser_than_triangles_goes(built: Built) -> None:
    _, base, one = built
    left = coarser_kept(base, one)
    patch, over = left.pairs()
    need = np.zeros(len(left))
    np.maximum.at(need, over, base.error[patch])
    flat = left.boxes.half[:, 2] * spread(left.theta)
    roots = left.father < 0
    assert (flat > need)[~roots].all()
    assert (left.above >= -1).all() and roots.sum() == 1


def test_ds_is_that_of_the_paper() -> None:
    """Of a father of 6 and children of 2 and 4: 6 (1/2 + 1/4) / 2."""
    assert similarity(6.0, np.array([2.0, 4.0])) == pytest.approx(2.25)
    assert similarity(6.0, np.array([0.0, 4.0])) == np.inf


def test_a_larger_ds_leaves_fewer(built: Built) -> None:
    _, base, one = built
    one = replace(one, theta=1.0)  # of which a father need not be coarser by any factor
    counts = [len(similar_gone(base, one, ds)) for ds in (1.0, 1.5, 2.5, 1e9)]
    assert counts == sorted(counts, reverse=True) and counts[0] == len(one)
    assert counts[-1] < counts[1]


def test_fathers_are_coarser_by_what_theta_asks_for(built: Built) -> None:
    """Nearly no error has to be raised for that: what is too like its father is gone."""
    _, base, one = built
    left = similar_gone(base, coarser_kept(base, one), 1.5)
    raised = monotone(base, left, 1 / spread(left.theta))
    assert (raised.error > left.error).mean() < 0.02


def test_fathers_of_what_goes_take_the_children(built: Built) -> None:
    _, base, one = built
    keep = np.random.default_rng(1).random(len(one)) < 0.4
    left = kept(base, one, keep)
    number = np.cumsum(keep) - 1
    for old in np.flatnonzero(keep)[:50]:
        above = one.father[old]
        while above >= 0 and not keep[above]:
            above = one.father[above]
        assert left.father[number[old]] == (number[above] if above >= 0 else -1)
    check_monotone(base, left)


def test_ancestors_are_all_above() -> None:
    below, over = ancestors(
        np.array([0, 0, 1, -1], dtype=np.int32), np.array([2, 2, -1], dtype=np.int32)
    )
    assert list(zip(below.tolist(), over.tolist(), strict=True)) == [
        (0, 0), (1, 0), (2, 1), (0, 2), (1, 2), (2, 2)
    ]  # fmt: skip


@pytest.mark.parametrize("theta", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("epsilon", [0.01, 1.0, 100.0])
def test_the_sequence_draws_what_a_descent_draws(
    built: Built, theta: float, epsilon: float
) -> None:
    """For a thousand eyes in all; nothing is missing, nothing drawn twice, and triangles are drawn
    where they are as good as their error says."""
    mt, base, one = built
    one = reduced(base, monotone(base, replace(one, theta=theta)))
    ordered = sequence(one)
    begin = len(mt.start) - len(base.first)
    many = 0
    for eye in eyes(mt, 60):
        drawn = ordered.drawn(eye, epsilon, PC)
        assert np.array_equal(drawn, top_down(one, eye, epsilon, PC))
        patch, over = one.pairs()
        shown = np.bincount(patch[np.isin(over, drawn)], minlength=len(base.first))
        left = left_to_triangles(one, drawn)
        assert np.array_equal(shown, 1 - left.astype(int)), "once each"
        cut = by_image_error(mt, eye, PC, epsilon)
        assert cut[begin:][~left].all(), "billboards stand for patches that need not be finer"
        many += 0 < len(drawn) < len(one)
    assert many > 5


def test_what_is_in_range_is_little_from_afar(built: Built) -> None:
    mt, base, one = built
    one = reduced(base, one)
    ordered = sequence(one)
    plant = mt.plant
    counts = []
    for away in (0.0, 3.0, 30.0, 3000.0):
        eye = plant.center + np.array([0.0, 0.0, away * plant.radius])
        rows = ordered.range(eye, 1.0, PC)
        counts.append(rows.stop - rows.start)
    assert counts[0] == len(one) and counts == sorted(counts, reverse=True) and counts[-1] == 1


def test_from_within_nothing_is_valid(built: Built) -> None:
    mt, _, one = built
    assert not valid(one, mt.plant.center, 1e9, PC)[-1]


@pytest.mark.parametrize("triangles", [1, 2])
def test_one_billboard_is_a_hierarchy(triangles: int) -> None:
    corners = np.random.default_rng(2).normal(size=(triangles, 3, 3))
    base = Base(corners, np.array([0]), np.zeros(1), corners.mean(axis=(0, 1))[None], np.ones(1))
    one = reduced(base, whole(base, merged(corners, base.first), 0.5))
    assert len(one) == 1 and one.father.tolist() == [-1] and one.above.tolist() == [0]
    assert top_down(one, np.array([0.0, 0.0, 1e4]), 1.0, PC).tolist() == [0]
