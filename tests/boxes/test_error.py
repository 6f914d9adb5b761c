"""How far the surface is drawn from where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from box_cases import box_points, card, some_rotation
from plants import plant_of

from vegtool.boxes import BoxOptions, geometric_error, make_billboards
from vegtool.boxes.error import distance_to_mesh, surface_samples

X, Y, Z = np.eye(3)


def test_a_flat_plant_is_drawn_where_it_is() -> None:
    plant = plant_of(card(0 * X, 2 * X, Y))
    labels = np.zeros(2, dtype=np.int32)
    assert geometric_error(plant, labels, make_billboards(plant, labels)) == pytest.approx((0, 0))


def test_two_layers_are_drawn_between_them() -> None:
    """Nine tenths of the area at z = 0 and one at z = 1: the plane lies at 0.1."""
    plant = plant_of(np.concatenate([card(0 * X, 3 * X, 3 * Y), card(Z, X, Y)]))
    labels = np.zeros(4, dtype=np.int32)
    options = BoxOptions(shape="single", plane="orientation")
    billboards = make_billboards(plant, labels, options)
    assert geometric_error(plant, labels, billboards) == pytest.approx((0.9, 0.9), abs=1e-6)
    pushed = replace(billboards, center=billboards.center + 0.3 * Z)
    assert geometric_error(plant, labels, pushed) == pytest.approx((0.6, 0.6), abs=1e-6)


def test_of_crossed_planes_the_nearest_counts() -> None:
    plant = plant_of(box_points((1, 1, 1))[:, None] + 1e-4 * np.eye(3))
    labels = np.zeros(len(plant.faces), dtype=np.int32)
    crossed = make_billboards(plant, labels, BoxOptions(shape="crossed"))
    centroids = plant.face_centroids - crossed.center[0]
    expected = np.abs(centroids @ crossed.normal.T).min(axis=1)
    worst, most = geometric_error(plant, labels, crossed)
    assert worst == pytest.approx(expected.max(), abs=1e-3)
    assert most == pytest.approx(np.quantile(expected, 0.95), abs=0.02)
    shuffled = np.array([2, 0, 1])
    other = replace(
        crossed, center=crossed.center[shuffled], u=crossed.u[shuffled], v=crossed.v[shuffled]
    )
    assert geometric_error(plant, labels, other) == pytest.approx((worst, most))


def test_what_a_mesh_shows_is_as_far_as_the_mesh() -> None:
    """A card of a billboard of its own, one half a metre above a mesh, and one that nothing
    shows."""
    cards = [card(0 * X, X, Y), card(10 * X, X, Y), card(20 * X, X, Y)]
    plant, mesh = plant_of(np.concatenate(cards)), plant_of(card(10 * X - 0.5 * Z, 2 * X, 2 * Y))
    labels = np.array([0, 0, -1, -1, -1, -1], dtype=np.int32)
    by_mesh = np.array([False, False, True, True, False, False])
    billboards = make_billboards(plant_of(cards[0]), np.zeros(2, dtype=np.int32))
    error = geometric_error(plant, labels, billboards, mesh, by_mesh)
    assert error == pytest.approx((0.5, 0.5))
    assert geometric_error(plant, labels, billboards) == pytest.approx((0, 0), abs=1e-12)
    both = np.array([0, 0, 0, 0, -1, -1], dtype=np.int32)  # the nearer of the two counts
    assert geometric_error(plant, both, billboards, mesh, by_mesh) == pytest.approx(
        (0, 0), abs=1e-6
    )
    with pytest.raises(ValueError, match="nothing shows"):
        geometric_error(plant, np.full(6, -1, np.int32), billboards)


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_distance_to_a_mesh_is_that_to_the_nearest_of_its_points(offset: float) -> None:
    """The oracle has many points of every triangle, so it is too large by their spacing at most;
    a triangle that is a line and one that is a point show nothing."""
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(12, 3, 3))
    corners[0, 2], corners[1] = corners[0, :2].mean(axis=0), corners[1, 0]
    points = 2 * rng.normal(size=(200, 3))
    a, b = (np.mgrid[:61, :61].reshape(2, -1).astype(float) / 60)[:, :, None]
    inside = (a + b)[:, 0] <= 1 + 1e-9
    many = [(p + a * (q - p) + b * (r - p))[inside] for p, q, r in corners[2:]]
    gaps = points[:, None] - np.concatenate(many)
    oracle = np.linalg.norm(gaps, axis=-1).min(axis=1)
    found = distance_to_mesh(points + offset, plant_of(corners + offset))
    assert (found <= oracle + 1e-9).all()
    assert found == pytest.approx(oracle, abs=2e-2)


def test_turned_scaled_plant_has_a_scaled_error() -> None:
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(60, 3, 3))
    labels = rng.integers(0, 5, 60).astype(np.int32)
    options = BoxOptions(shape="single", plane="orientation")
    errors = []
    for scale, turn in ((1.0, np.eye(3)), (1e6, some_rotation())):
        plant = plant_of(scale * corners @ turn.T)
        errors.append(geometric_error(plant, labels, make_billboards(plant, labels, options)))
    assert np.array(errors[1]) == pytest.approx(1e6 * np.array(errors[0]), rel=1e-3)


def test_samples_follow_the_area() -> None:
    plant = plant_of(np.concatenate([card(0 * X, 3 * X, Y), card(Z, X, Y)]))
    face, points = surface_samples(plant, 1000)
    assert np.bincount(face).tolist() == [375, 375, 125, 125]
    flat = points[face < 2]
    assert flat.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.05)
    assert flat.var(axis=0) == pytest.approx([3, 1 / 3, 0], abs=0.05)
    assert len(np.unique(surface_samples(plant_of(np.ones((4, 3, 3))), 8)[0])) == 4


def test_a_cluster_without_a_billboard_is_an_error() -> None:
    plant = plant_of(np.concatenate([card(0 * X, X, Y), card(Z, X, Y)]))
    billboards = make_billboards(plant, np.zeros(4, dtype=np.int32))
    with pytest.raises(ValueError, match="every cluster"):
        geometric_error(plant, np.array([0, 0, 1, 1], dtype=np.int32), billboards)
