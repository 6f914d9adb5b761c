"""Clusters along the branches."""

from __future__ import annotations

import numpy as np
import pytest
from cluster_cases import cards, random_branches, same_partition
from plants import plant_of

from vegtool.clustering import ClusterOptions, cluster
from vegtool.clustering.branches import PER_BRANCH, covered_level
from vegtool.plant import Branches, Plant

STRICT = ClusterOptions(strict_level=True)


def small_tree() -> Plant:
    """A trunk (branch 0) with two boughs (1, 2), each with two twigs (3, 4 and 5, 6); 4 faces each.

    One cluster per branch takes 1 at level 0, 3 at level 1 and 7 at level 2.
    """
    parent = np.array([-1, 0, 0, 1, 1, 2, 2])
    level = np.array([0, 1, 1, 2, 2, 2, 2])
    face_branch = np.repeat(np.arange(7), 4)
    return plant_of(cards(14), Branches(face_branch, parent, level, "generator"))


@pytest.mark.parametrize(
    ("count", "expected"),
    [
        (1, [0, 0, 0, 0, 0, 0, 0]),
        (2, [0, 0, 0, 0, 0, 0, 0]),  # level 1 would need three
        (3, [0, 1, 2, 1, 1, 2, 2]),  # twigs go with their bough, the trunk keeps its own faces
        (6, [0, 1, 2, 1, 1, 2, 2]),
        (7, [0, 1, 2, 3, 4, 5, 6]),
        (99, [0, 1, 2, 3, 4, 5, 6]),
    ],
)
def test_strict_level_is_the_deepest_that_fits(count: int, expected: list[int]) -> None:
    labels = cluster(small_tree(), "branches", count, STRICT)
    assert labels.tolist() == np.repeat(expected, 4).tolist()


def test_the_rest_of_the_count_is_spent_within_branches() -> None:
    branches = random_branches(2_000, 12)
    plant = plant_of(cards(1_000), branches)
    count = 100
    level = covered_level(branches, count // PER_BRANCH)
    owner = branches.ancestor_at(level)[branches.face_branch]
    labels = cluster(plant, "branches", count)
    assert labels.max() + 1 == count
    for label in range(count):
        assert len(np.unique(owner[labels == label])) == 1


def test_more_trunks_than_clusters_are_merged_by_nearness() -> None:
    """Six trunks in three far pairs, three clusters: each pair is one."""
    corners = np.concatenate([cards(3, seed) + 10.0 * (seed // 2) for seed in range(6)])
    trunks = Branches(
        np.repeat(np.arange(6), 6), np.full(6, -1), np.zeros(6, dtype=np.int32), "generator"
    )
    labels = cluster(plant_of(corners, trunks), "branches", 3)
    assert labels.tolist() == np.repeat([0, 1, 2], 12).tolist()


def test_one_branch_alone_is_isodata() -> None:
    plant = plant_of(cards(100), random_branches(200, 1))
    labels = cluster(plant, "branches", 9)
    assert same_partition(labels, cluster(plant, "isodata", 9))


def test_a_bent_branch_is_cut_where_it_bends() -> None:
    """Two arms of one branch at a right angle, 20 small triangles along each: two clusters are the
    arms, not a near and a far part of both."""
    triangle = 0.01 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    steps = np.linspace(0.05, 1.0, 20)
    arms = [triangle + step * axis for axis in np.eye(3)[:2] for step in steps]
    bent = Branches(np.zeros(40), np.array([-1]), np.array([0]), "generator")
    plant = plant_of(np.stack(arms), bent)
    labels = cluster(plant, "branches", 2, ClusterOptions(elongation=4.0))
    assert labels.tolist() == [0] * 20 + [1] * 20


def test_plant_that_knows_no_branches() -> None:
    """Leaves alone: there is nothing to recover, and still every face gets a label."""
    plant = plant_of(cards(30))
    labels = cluster(plant, "branches", 5)
    assert np.array_equal(np.unique(labels), np.arange(5))
