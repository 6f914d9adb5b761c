"""Clusters that are lines: what they cost, and moves within groups."""

from __future__ import annotations

import numpy as np
import pytest
from cluster_cases import cards
from plants import plant_of

from vegtool.clustering.features import samples
from vegtool.clustering.lines import cost, largest_eigenvalue, lines, settle_lines


def test_what_lies_on_a_line_costs_its_discounted_length_alone() -> None:
    """Points 0, 1, 2 on a line, weight a third each: scatter 2/3, of which a share of 1 - gain."""
    points = np.zeros((3, 9))
    points[:, 1] = [0.0, 1.0, 2.0]
    found = lines(points, np.full(3, 1 / 3), np.zeros(3, np.int64), gain=0.75)
    assert found.error == pytest.approx([0.25 * 2 / 3])
    assert np.abs(found.axes[0, 0]) == pytest.approx([0, 1, 0])


def test_cost_grows_with_weight_and_slowly_with_distance() -> None:
    """Sixteen times the mean squared distance is four times the cost; no distance costs nothing."""
    mass = np.array([1.0, 1.0, 3.0, 1.0])
    squared = np.array([1.0, 16.0, 1.0, 0.0])
    assert cost(mass * squared, mass) == pytest.approx([1.0, 4.0, 3.0, 0.0])


@pytest.mark.parametrize("groups", [1, 2, 5, 30])
def test_clusters_keep_to_their_groups(groups: int) -> None:
    few = samples(plant_of(cards(300)), 0.0, 40)
    group = np.arange(len(few.points)) % groups
    labels = settle_lines(few, group, 40, 3.0, group)
    assert np.array_equal(np.unique(labels), np.arange(40))
    for label in range(40):
        assert len(np.unique(group[labels == label])) == 1


def test_largest_eigenvalue_is_lapacks() -> None:
    """Also where two or all are equal, and of nothing."""
    random = np.random.default_rng(0)
    turns = np.linalg.qr(random.normal(size=(500, 3, 3)))[0]
    values = random.random((500, 3)) ** 4
    values[:100, 1] = values[:100, 0]
    values[100:200] = values[100:200, :1]
    values[200:300, 1:] = 0.0
    moment = np.einsum("kij,kj,klj->kil", turns, values, turns)
    moment[-1] = 0.0
    expected = np.linalg.eigvalsh(moment)[:, -1]
    assert largest_eigenvalue(moment) == pytest.approx(expected, rel=1e-7, abs=0)
    assert largest_eigenvalue(1e-20 * moment) == pytest.approx(1e-20 * expected, rel=1e-7, abs=0)
