"""Boxes turned into billboards: how many, where, how large, and which way up."""

from __future__ import annotations

import numpy as np
import pytest
from box_cases import box_points, card, some_rotation
from plants import plant_of

from vegtool.arrays import FloatArray
from vegtool.boxes import BoxOptions, make_billboards
from vegtool.lod import Billboards
from vegtool.plant import Plant

X, Y, Z = np.eye(3)


def boxy(half: tuple[float, float, float], turn: FloatArray | None = None) -> Plant:
    """Small triangles of all directions that fill a box."""
    points = box_points(half) @ (np.eye(3) if turn is None else turn).T
    corners = np.random.default_rng(1).normal(size=(len(points), 3, 3))
    return plant_of(points[:, None] + 5e-4 * min(half) * corners)


def tube(length: float, radius: float, turn: FloatArray) -> Plant:
    """The side of an upright cylinder, turned."""
    angle = np.linspace(0, 2 * np.pi, 25)
    ring = radius * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    up = np.array([0.0, length / 2, 0.0])
    low, high = ring - up, ring + up
    corners = np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], 1), np.stack([low[:-1], high[1:], high[:-1]], 1)]
    )
    return plant_of(corners @ turn.T)


@pytest.mark.parametrize("length", [0.1, 0.7, 2.0, 3.0, 12.0])
@pytest.mark.parametrize("shape", ["auto", "crossed"])
def test_a_piece_of_trunk_gets_no_plane_across(length: float, shape) -> None:
    """Across its axis a tube shows nothing but its rim: two planes along it, however short."""
    turn = some_rotation()
    plant = tube(length, 0.5, turn)
    billboards = make_billboards(plant, labels_of(plant), BoxOptions(shape=shape))
    assert len(billboards) == 2
    assert np.abs(billboards.normal @ turn[:, 1]) == pytest.approx(0, abs=0.05)


def labels_of(plant: Plant) -> np.ndarray:
    return np.zeros(len(plant.faces), dtype=np.int32)


def check(billboards: Billboards, plant: Plant, labels: np.ndarray) -> None:
    """Every corner lies on each of its cluster's rectangles' projections, within the depth."""
    for frame in (billboards.u, billboards.v):
        assert np.linalg.norm(frame, axis=1) == pytest.approx(1)
    assert np.einsum("pi,pi->p", billboards.u, billboards.v) == pytest.approx(0, abs=1e-9)
    assert (np.diff(billboards.cluster) >= 0).all()
    assert (billboards.v[:, 1] >= -1e-3).all()
    for p, k in enumerate(billboards.cluster):
        offset = plant.corners[labels == k].reshape(-1, 3) - billboards.center[p]
        slack = 1e-9 * plant.radius
        assert np.abs(offset @ billboards.u[p]).max() <= billboards.half_size[p, 0] + slack
        assert np.abs(offset @ billboards.v[p]).max() <= billboards.half_size[p, 1] + slack
        assert np.abs(offset @ billboards.normal[p]).max() <= billboards.half_depth[p] + slack


@pytest.mark.parametrize(
    ("half", "planes"),
    [((3, 2, 0.2), 1), ((9, 1, 0.1), 1), ((9, 1, 1), 2), ((1, 1, 1), 3), ((3, 2, 1), 3)],
)
@pytest.mark.parametrize("fit", ["volume", "orientation"])
def test_the_form_of_the_box_decides(half: tuple[float, float, float], planes: int, fit) -> None:
    plant = boxy(half, some_rotation())
    labels = labels_of(plant)
    billboards = make_billboards(plant, labels, BoxOptions(plane=fit))
    check(billboards, plant, labels)
    if fit == "volume":
        assert len(billboards) == planes
    else:  # no cluster of faces that look one way needs three
        assert len(billboards) in (1, 2)
    for shape, expected in (("single", {1}), ("crossed", {2, 3})):
        other = make_billboards(plant, labels, BoxOptions(shape=shape, plane=fit))
        check(other, plant, labels)
        assert len(other) in expected


def test_crossed_planes_are_square_to_each_other_and_share_the_long_axis() -> None:
    plant = boxy((9, 1.2, 1))
    two = make_billboards(plant, labels_of(plant))
    assert len(two) == 2
    assert two.normal[0] @ two.normal[1] == pytest.approx(0, abs=1e-9)
    assert np.abs(two.normal @ X) == pytest.approx(0, abs=0.02)
    assert two.half_size.max(axis=1) == pytest.approx(9, rel=0.02)
    cube = boxy((1, 1, 1))
    three = make_billboards(cube, labels_of(cube))
    assert np.abs(three.normal @ three.normal.T) == pytest.approx(np.eye(3), abs=1e-9)
    assert three.center == pytest.approx(np.zeros((3, 3)), abs=0.02)


def test_single_plane_lies_where_most_of_the_surface_is() -> None:
    """Three cards at z = 0 and one at z = 1: the area's mean is 0.25, the box's centre 0.5."""
    cards = [card(0 * Z, 3 * X, 2 * Y)] * 3 + [card(Z, 3 * X, 2 * Y)]
    plant = plant_of(np.concatenate(cards))
    options = BoxOptions(shape="single", plane="orientation")
    billboards = make_billboards(plant, labels_of(plant), options)
    assert billboards.center[0] == pytest.approx([0, 0, 0.25], abs=1e-9)
    assert billboards.half_depth[0] == pytest.approx(0.75)
    assert sorted(billboards.half_size[0]) == pytest.approx([2, 3])
    assert billboards.v[0] == pytest.approx(Y, abs=1e-9)  # upright, though x is the longer side


@pytest.mark.parametrize("fit", ["volume", "orientation"])
def test_front_is_where_single_sided_faces_look_else_outwards(fit) -> None:
    """A card at x = 5 whose faces look back to the plant's centre, beside one at x = -5."""
    corners = np.concatenate([card(5 * X, Z, Y), card(-5 * X, Z, Y)])  # z cross y: along -x
    labels = np.repeat([0, 1], 2).astype(np.int32)
    options = BoxOptions(plane=fit)
    facing = make_billboards(plant_of(corners, double_sided=False), labels, options)
    assert facing.normal == pytest.approx(np.stack([-X, -X]), abs=1e-9)
    outward = make_billboards(plant_of(corners, double_sided=True), labels, options)
    assert outward.normal == pytest.approx(np.stack([X, -X]), abs=1e-9)


def test_flat_on_the_ground_the_top_is_north() -> None:
    plant = plant_of(card(0 * X, 3 * X, 2 * Z))
    billboards = make_billboards(plant, labels_of(plant))
    assert np.abs(billboards.normal[0]) == pytest.approx(Y, abs=1e-9)
    assert billboards.v[0] == pytest.approx(-Z, abs=1e-4)


def test_clusters_keep_their_numbers_and_empty_ones_have_no_planes() -> None:
    corners = np.concatenate([card(5 * X, Z, Y), card(-5 * X, Z, Y)])
    labels = np.repeat([4, 1], 2).astype(np.int32)
    billboards = make_billboards(plant_of(corners), labels)
    assert billboards.cluster.tolist() == [1, 4]
    assert billboards.center[:, 0] == pytest.approx([-5, 5])


@pytest.mark.parametrize("shape", ["auto", "single", "crossed"])
@pytest.mark.parametrize("fit", ["volume", "orientation"])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_no_billboard_is_without_area(shape, fit, scale: float) -> None:
    """A point, a line and a triangle, beside each other: every picture has texels."""
    corners = scale * np.array(
        [
            [[9.0, 0, 0], [9, 0, 0], [9, 0, 0]],
            [[0, 0, 0], [1, 1, 1], [2, 2, 2]],
            [[0, 0, 0], [0, 1, 0], [0, 0, 1]],
        ]
    )
    plant, labels = plant_of(corners), np.arange(3, dtype=np.int32)
    billboards = make_billboards(plant, labels, BoxOptions(shape=shape, plane=fit))
    check(billboards, plant, labels)
    assert (billboards.half_size > 1e-7 * plant.radius).all()
    everything_equal = plant_of(corners[:1])
    alone = make_billboards(everything_equal, np.zeros(1, dtype=np.int32), BoxOptions(plane=fit))
    assert (alone.half_size > 0).all()


def test_input_stays_and_the_result_repeats() -> None:
    plant = boxy((3, 2, 1))
    labels = labels_of(plant)
    a = make_billboards(plant, labels)
    b = make_billboards(plant, labels)
    assert a.center.tobytes() == b.center.tobytes() and a.u.tobytes() == b.u.tobytes()
    assert not labels.any()
