"""Boxes of least volume: shapes whose box is known, degenerate ones, and properties of the fit."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from box_cases import box_points, one, some_rotation
from hypothesis import given, settings
from hypothesis import strategies as st

from vegtool.arrays import FloatArray
from vegtool.boxes import Boxes, BoxOptions, fit_boxes
from vegtool.boxes.box import MIN_EXTENT
from vegtool.boxes.fit import START_GRID, box_sides, even_directions, extreme_rows
from vegtool.clustering import ClusterOptions, cluster
from vegtool.formats import read_plant


def check(boxes: Boxes, points: FloatArray, labels: np.ndarray) -> None:
    """Axes are right-handed unit axes, extents descend, and every point is inside its box."""
    product = boxes.axes @ boxes.axes.transpose(0, 2, 1)
    assert np.allclose(product, np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(boxes.axes), 1)
    assert (np.diff(boxes.half, axis=1) <= 0).all()
    along = np.einsum("nij,nj->ni", boxes.axes[labels], points - boxes.center[labels])
    size = np.linalg.norm(boxes.half[labels], axis=1) + np.abs(points).max() * 1e-6
    assert (np.abs(along) <= boxes.half[labels] + 1e-9 * size[:, None]).all()


def test_box_of_a_turned_box_is_that_box() -> None:
    turn = some_rotation()
    points = box_points((3, 2, 1)) @ turn.T + [7, 8, 9]
    boxes = fit_boxes(points, one(points), 1)
    check(boxes, points, one(points))
    assert boxes.half[0] == pytest.approx([3, 2, 1], rel=0.01)
    assert boxes.center[0] == pytest.approx([7, 8, 9], abs=0.01)
    assert np.abs(boxes.axes[0] @ turn) == pytest.approx(np.eye(3), abs=0.01)


@pytest.mark.parametrize("half", [(1, 1, 1), (5, 1, 1), (5, 5, 1), (100, 10, 1)])
def test_equal_and_very_unequal_sides(half: tuple[float, float, float]) -> None:
    points = box_points(half) @ some_rotation().T
    boxes = fit_boxes(points, one(points), 1)
    check(boxes, points, one(points))
    assert boxes.volume()[0] <= 8 * np.prod(half) * 1.02


def test_sphere_has_a_box_of_its_diameter() -> None:
    points = np.concatenate([even_directions(500), -even_directions(500)])
    boxes = fit_boxes(points, one(points), 1)
    check(boxes, points, one(points))
    assert boxes.half[0] == pytest.approx([1, 1, 1], rel=0.02)


TRIANGLE = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]])
LINE = np.linspace(-1, 1, 9)[:, None] * [1.0, 2, 3]
DEGENERATE = {
    "one point": np.array([[1.0, 2, 3]]),
    "equal points": np.tile([1.0, 2, 3], (300, 1)),
    "two points": np.array([[0.0, 0, 0], [1, 1, 1]]),
    "line": LINE,
    "triangle": TRIANGLE,
    "plane": np.concatenate(
        [TRIANGLE, np.random.default_rng(0).uniform(size=(300, 3)) * [1, 1, 0]]
    ),
    "needle": np.random.default_rng(0).uniform(-1, 1, (300, 3)) * [1e3, 1e-3, 1e-3],
}


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 5e6])
def test_degenerate_clusters_have_boxes(name: str, scale: float, offset: float) -> None:
    points = DEGENERATE[name] * scale + offset
    boxes = fit_boxes(points, one(points), 1)
    check(boxes, points, one(points))
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    assert 2 * np.linalg.norm(boxes.half[0]) == pytest.approx(diagonal, rel=0.5, abs=1e-9 * offset)
    if name == "triangle" and scale == 1:  # a least rectangle has twice the triangle's area
        assert 4 * boxes.half[0, 0] * boxes.half[0, 1] == pytest.approx(12, rel=0.01)
        assert boxes.half[0, 2] == pytest.approx(0, abs=1e-9 + 1e-15 * offset)
    if name == "line" and offset == 0:
        assert boxes.half[0] / scale == pytest.approx([14**0.5, 0, 0], abs=1e-9)


def test_clusters_do_not_see_each_other_and_may_be_empty() -> None:
    a, b = box_points((3, 2, 1)), box_points((9, 1, 1), seed=1) + 50
    points = np.concatenate([a, b])
    labels = np.repeat(np.array([3, 1], dtype=np.int32), len(a))
    mixed = np.random.default_rng(0).permutation(len(points))
    boxes = fit_boxes(points[mixed], labels[mixed], 5)
    alone = fit_boxes(a[np.argsort(mixed[mixed < len(a)])], one(a), 1)
    assert boxes.volume()[3] == pytest.approx(alone.volume()[0], rel=0.01)
    assert boxes.volume()[1] == pytest.approx(8 * 9, rel=0.02)
    assert (boxes.half[[0, 2, 4]] == 0).all()
    assert len(fit_boxes(np.zeros((0, 3)), np.zeros(0, dtype=np.int32), 2)) == 2


cloud = st.integers(0, 2**32 - 1).map(
    lambda seed: (
        np.random.default_rng(seed).normal(size=(40, 3))
        * np.random.default_rng(seed + 1).uniform(0.05, 1, 3)
    )
)


@settings(max_examples=20, deadline=None)
@given(cloud, st.integers(0, 99), st.floats(1e-6, 1e6), st.floats(-5e6, 5e6))
def test_moved_turned_scaled_points_have_a_box_of_the_same_volume(
    points: FloatArray, seed: int, scale: float, shift: float
) -> None:
    volume = fit_boxes(points, one(points), 1).volume()[0]
    turned = fit_boxes(points @ some_rotation(seed).T, one(points), 1).volume()[0]
    assert turned == pytest.approx(volume, rel=0.01)
    scaled = fit_boxes(points * scale, one(points), 1).volume()[0]
    assert scaled == pytest.approx(volume * scale**3, rel=1e-6)
    moved = fit_boxes(points + shift, one(points), 1).volume()[0]
    assert moved == pytest.approx(volume, rel=0.01)


@settings(max_examples=20, deadline=None)
@given(cloud)
def test_no_plain_rotation_beats_the_search(points: FloatArray) -> None:
    """The oracle: 125 rotations about the world's axes, each box measured plainly."""
    local = points - points.mean(axis=0)
    least = min(np.ptp(local @ turn.T, axis=0).prod() for turn in START_GRID)
    assert fit_boxes(points, one(points), 1).volume()[0] <= least * 1.02


def test_sides_are_the_plain_extents_with_a_floor() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (2, 30, 3))
    points[1, :, 2] = 0  # flat: counted as thick as the floor in its first rotation, which is none
    found = box_sides(START_GRID[None, :3].repeat(2, axis=0), points)
    for g in range(2):
        for r in range(3):
            extent = np.ptp(points[g] @ START_GRID[r].T, axis=0)
            assert found[g, r] == pytest.approx(np.maximum(extent, 2 * MIN_EXTENT), abs=1e-4)


def test_extreme_points_of_many_blocks_are_those_of_all() -> None:
    points = np.random.default_rng(0).normal(size=(3, 5000)).astype(np.float32)
    along = even_directions(96).astype(np.float32) @ points
    expected = np.unique(np.concatenate([along.argmax(axis=1), along.argmin(axis=1)]))
    assert extreme_rows(points).tolist() == expected.tolist()


def test_input_stays_and_the_result_repeats() -> None:
    points = box_points((3, 2, 1))
    before, labels = points.copy(), one(points)
    a, b = fit_boxes(points, labels, 1), fit_boxes(points, labels, 1)
    assert np.array_equal(points, before) and not labels.any()
    assert a.axes.tobytes() == b.axes.tobytes() and a.half.tobytes() == b.half.tobytes()


def test_threads_do_not_change_a_byte() -> None:
    program = (
        "import numpy as np, hashlib\n"
        "from vegtool.boxes import fit_boxes\n"
        "rng = np.random.default_rng(0)\n"
        "b = fit_boxes(rng.normal(size=(60000, 3)), rng.integers(0, 7, 60000), 7)\n"
        "print(hashlib.sha256(b.axes.tobytes() + b.half.tobytes()).hexdigest())\n"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "OPENBLAS_NUM_THREADS": n, "OMP_NUM_THREADS": n},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for n in ("1", "4")
    }
    assert len(digests) == 1


@pytest.mark.models
@pytest.mark.parametrize("name", ["eztree_ash_small", "eztree_pine_medium"])
def test_real_clusters_against_trimesh(models: Path, name: str) -> None:
    """The whole table, with oak and the dense search, is benchmarks/boxes.py."""
    plant = read_plant(models / name / f"{name}.glb")
    labels = cluster(plant, "kmeans", 64, ClusterOptions(orientation_weight=0.0))
    points, member = plant.corners.reshape(-1, 3), np.repeat(labels, 3)
    each = [points[member == k] for k in range(64)]
    floor = MIN_EXTENT * np.array([2 * np.linalg.norm(p - p.mean(0), axis=1).max() for p in each])
    theirs = np.stack([trimesh.bounds.oriented_bounds(p)[1] for p in each])
    excess = fit_boxes(points, member, 64, BoxOptions()).volume(floor)
    excess /= np.maximum(theirs, floor[:, None]).prod(axis=1)
    assert np.median(excess) <= 1.0
    assert np.quantile(excess, 0.95) <= 1.05


def test_how_many_blocks_are_taken_at_once_changes_nothing(monkeypatch) -> None:
    points = np.random.default_rng(1).normal(size=(20_000, 3)) * [3, 2, 1]
    here = fit_boxes(points, one(points), 1)
    monkeypatch.setattr("vegtool.boxes.fit.BLOCKS", 3)
    there = fit_boxes(points, one(points), 1)
    assert np.array_equal(here.half, there.half) and np.array_equal(here.axes, there.axes)
