"""What holds for every method: the contract of `cluster`, bad input, stability, determinism."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cluster_cases import cards, inertia, random_branches, same_partition
from hypothesis import given, settings
from hypothesis import strategies as st
from plants import plant_of

from vegtool.clustering import METHODS, ClusterOptions, cluster
from vegtool.errors import UsageError
from vegtool.plant import Plant

ALL = pytest.mark.parametrize("method", METHODS)
BOTH = ClusterOptions(orientation_weight=0.12)
"""By position and orientation."""
TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def check_labels(labels: np.ndarray, plant: Plant, k: int) -> None:
    """Every face labelled, every label used, in the promised type."""
    assert labels.shape == (len(plant.faces),)
    assert labels.dtype == np.int32
    assert np.array_equal(np.unique(labels), np.arange(k))


def forked(corners: np.ndarray, branches: int = 1) -> Plant:
    """A plant whose faces hang on that many branches."""
    return plant_of(corners, random_branches(len(corners), branches))


@ALL
def test_two_far_triangles_are_two_clusters(method: str) -> None:
    plant = forked(np.stack([TRIANGLE, TRIANGLE + 9, TRIANGLE + np.array([0.1, 0, 0])]))
    assert cluster(plant, method, 2).tolist() == [0, 1, 0]


@ALL
def test_orientation_tells_faces_apart_where_position_does_not(method: str) -> None:
    """Cards about one point that face x or y: the weight groups them by where they face."""
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # x -> y -> z -> x
    flat = np.concatenate([TRIANGLE[None] - TRIANGLE.mean(axis=0) + [0, 0, z] for z in (0, 0.2)])
    plant = forked(np.concatenate([flat, flat @ turn]))
    assert cluster(plant, method, 2, ClusterOptions(orientation_weight=10.0)).tolist() == [
        0,
        0,
        1,
        1,
    ]


@ALL
@pytest.mark.parametrize("count", [1, 2, 7, 40, 79, 80, 81, 10_000_000])
def test_count_is_met_or_every_face_is_its_own(method: str, count: int) -> None:
    plant = forked(cards(40))
    check_labels(cluster(plant, method, count), plant, min(count, 80))


@ALL
def test_halves_of_a_card_stay_together(method: str) -> None:
    plant = forked(cards(200))
    labels = cluster(plant, method, 30)
    assert np.array_equal(labels[0::2], labels[1::2])


@ALL
def test_one_triangle(method: str) -> None:
    assert cluster(forked(TRIANGLE[None]), method, 5).tolist() == [0]


@ALL
def test_all_points_equal(method: str) -> None:
    plant = forked(np.full((6, 3, 3), 7.0))
    assert cluster(plant, method, 3).tolist() == [0] * 6


@ALL
def test_equal_faces_share_a_label(method: str) -> None:
    """100,000 copies of three triangles: three distinct faces, so three clusters at most."""
    plant = forked(np.tile(np.stack([TRIANGLE, TRIANGLE + 3, TRIANGLE + 7]), (33_334, 1, 1)))
    labels = cluster(plant, method, 10)
    check_labels(labels, plant, 3)
    assert np.array_equal(labels, np.arange(len(labels)) % 3)


@ALL
def test_faces_without_area(method: str) -> None:
    """Lines and points weigh next to nothing, or alike if there is nothing else; no NaN."""
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    only = forked(np.stack([line + i for i in range(6)]))
    check_labels(cluster(only, method, 4), only, 4)
    mixed = forked(np.concatenate([only.corners, cards(10)]))
    check_labels(cluster(mixed, method, 4), mixed, 4)


@ALL
def test_one_leaf_ten_thousand_times_larger(method: str) -> None:
    """The small ones huddle in one place, with hardly any area: they are still clustered."""
    plant = forked(np.concatenate([1e4 * TRIANGLE[None], cards(100)]))
    check_labels(cluster(plant, method, 20), plant, 20)


@ALL
def test_many_points_in_few_places(method: str) -> None:
    """More points than the grid takes, all within a thousandth of the plant: not one cell."""
    plant = forked(np.concatenate([3e3 * TRIANGLE[None], cards(9_000, size=0.01)[::2]]))
    check_labels(cluster(plant, method, 50), plant, 50)


@ALL
@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_scale_changes_nothing(method: str, scale: float) -> None:
    plant = forked(cards(150), 9)
    grown = forked(scale * plant.corners, 9)
    a, b = (inertia(p, cluster(p, method, 12, BOTH), 0.12, 12) for p in (plant, grown))
    assert b == pytest.approx(a, rel=1e-6)


@ALL
def test_map_coordinates_change_nothing(method: str) -> None:
    plant = forked(cards(150), 9)
    moved = forked(plant.corners + np.array([5e6, 300.0, -5e6]), 9)
    a, b = (inertia(p, cluster(p, method, 12, BOTH), 0.12, 12) for p in (plant, moved))
    assert b == pytest.approx(a, rel=1e-6)


@ALL
def test_turning_changes_nothing(method: str) -> None:
    """All is measured in the plant's own frame."""
    plant = forked(cards(400), 9)
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turned = forked(plant.corners @ turn.T, 9)
    labels = [cluster(p, method, 25, BOTH) for p in (plant, turned)]
    a, b = (inertia(plant, found, 0.12, 25) for found in labels)
    assert b == pytest.approx(a, rel=1e-9)


@ALL
def test_turning_changes_nothing_where_all_is_alike(method: str) -> None:
    """A cubic lattice has no axes of its own and ties everywhere: the file's order decides."""
    steps = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 1, 3)
    plant = plant_of(steps + TRIANGLE)
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turned = plant_of(np.einsum("fci,ai->fca", plant.corners, turn))
    assert np.array_equal(cluster(plant, method, 10), cluster(turned, method, 10))


@ALL
@settings(max_examples=25, deadline=None)
@given(
    corners=st.lists(
        st.lists(st.integers(-3, 3).map(float), min_size=9, max_size=9), min_size=1, max_size=14
    ),
    count=st.integers(1, 20),
    weight=st.sampled_from([0.0, 0.12, 3.0]),
    branches=st.integers(1, 4),
)
def test_any_small_plant(
    method: str, corners: list[list[float]], count: int, weight: float, branches: int
) -> None:
    """On a coarse lattice, so that equal, flat and touching faces are common."""
    plant = plant_of(
        np.array(corners).reshape(-1, 3, 3),
        random_branches(len(corners), branches, trunks=branches),
    )
    labels = cluster(plant, method, count, ClusterOptions(orientation_weight=weight))
    k = int(labels.max()) + 1
    check_labels(labels, plant, k)
    assert k <= count
    assert same_partition(labels, cluster(plant, method, count, ClusterOptions(weight), seed=1))


def test_unknown_method_names_the_choices() -> None:
    with pytest.raises(UsageError, match="kmeans"):
        cluster(plant_of(TRIANGLE[None]), "k-means", 2)


@pytest.mark.parametrize("count", [0, -3])
def test_count_below_one_is_refused(count: int) -> None:
    with pytest.raises(UsageError, match="at least 1"):
        cluster(plant_of(TRIANGLE[None]), "kmeans", count)


@pytest.mark.parametrize("weight", [float("nan"), float("inf"), -0.1])
def test_orientation_weight_out_of_range_is_refused(weight: float) -> None:
    with pytest.raises(UsageError, match="orientation weight"):
        ClusterOptions(orientation_weight=weight)


@pytest.mark.parametrize("elongation", [float("nan"), 0.5])
def test_elongation_out_of_range_is_refused(elongation: float) -> None:
    with pytest.raises(UsageError, match="elongation"):
        ClusterOptions(elongation=elongation)


SCRIPT = """
import hashlib
from cluster_cases import cards, random_branches
from plants import plant_of
from vegtool.clustering import METHODS, cluster
corners = cards(12_000)
plant = plant_of(corners, random_branches(len(corners), 9))
digest = hashlib.sha256()
for method in METHODS:
    digest.update(cluster(plant, method, 60).tobytes())
print(digest.hexdigest())
"""


def test_same_bytes_for_any_number_of_threads() -> None:
    found = []
    for threads in ("1", "2"):
        names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
        env = {
            **os.environ,
            **dict.fromkeys(names, threads),
            "PYTHONPATH": os.pathsep.join(map(str, Path(__file__).parents[:2])),
        }
        run = subprocess.run(
            [sys.executable, "-c", SCRIPT], env=env, capture_output=True, text=True, check=True
        )
        found.append(run.stdout)
    assert found[0] == found[1]
    assert len(found[0].strip()) == len(hashlib.sha256().hexdigest())
