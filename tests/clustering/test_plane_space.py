"""Planes near all pieces: each within epsilon of its own, few of them, always the same."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from cluster_cases import cards
from plants import plant_of

from vegtool.clustering import cluster, plane_cover, plane_space
from vegtool.clustering.features import samples
from vegtool.clustering.plane_cover import (
    ROUNDING,
    STEP,
    Cover,
    Grid,
    Pieces,
    cover,
    densest_offsets,
    densest_plane,
    even_hemisphere,
    tilts,
)
from vegtool.clustering.plane_space import (
    FILLED,
    by_first_face,
    one_plane,
    pieces_of,
    planes_for,
)
from vegtool.plant import Plant

TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])[
    [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
]
SQUARE = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]])
TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


def pieces(corners: np.ndarray) -> Pieces:
    """Each face one."""
    return pieces_of(plant_of(corners), np.arange(len(corners)))[0]


def box(half: tuple[float, float, float]) -> np.ndarray:
    """(12, 3, 3)"""
    upper = 2 * SQUARE + np.array([-1.0, -1, 1])
    turned = [np.roll(side * upper, axis, axis=2) for axis in range(3) for side in (-1, 1)]
    return np.concatenate(turned) * half


def heights(of: Pieces, found: Cover) -> np.ndarray:
    """(f,) how far the farthest corner of each face is from its plane."""
    label = np.repeat(found.labels, np.diff([*of.first, len(of.area)]))
    along = np.einsum("cfi,fi->fc", of.corners, found.normal[label])
    return np.abs(along - found.offset[label][:, None]).max(axis=1)


@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["level", "turned"])
@pytest.mark.parametrize("epsilon", [0.05, 1e-3, 1e-7])
@pytest.mark.parametrize(
    ("corners", "count"),
    [(box((1, 1, 1)), 6), (box((1, 0.6, 0.3)), 6), (TETRAHEDRON, 4)],
    ids=["cube", "box", "tetrahedron"],
)
def test_flat_sides_take_a_plane_each(
    corners: np.ndarray, count: int, epsilon: float, turn: np.ndarray
) -> None:
    """Half of a side of a box is a piece of its own: both find the one plane."""
    assert len(cover(pieces(corners @ turn), epsilon, 100).normal) == count


def test_two_sheets_take_one_plane_from_half_their_distance_on() -> None:
    """Unit squares 0.2 apart: the plane between them is 0.1 from all corners."""
    made = pieces(np.concatenate([SQUARE, SQUARE + np.array([0.0, 0, 0.2])]))
    half = np.linalg.norm(made.corners[0, 0] - made.corners[0, 2]) / 2  # radii
    counts = [len(cover(made, share * half, 9).normal) for share in (0.2, 0.98, 1.02)]
    assert counts == [2, 2, 1]


@pytest.mark.parametrize("epsilon", [0.01, 0.05, 0.3])
def test_every_piece_is_within_epsilon_of_its_plane(epsilon: float) -> None:
    """Each label is used; both halves of a card are one piece."""
    plant = plant_of(cards(150))
    made, _ = pieces_of(plant, by_first_face(samples(plant, 0.0, 1).of_face))
    assert len(made) == 150
    found = cover(made, epsilon, 1000)
    assert np.array_equal(np.unique(found.labels), np.arange(len(found.normal)))
    assert heights(made, found).max() <= epsilon + 2 * ROUNDING
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-12)


def test_no_more_planes_than_allowed() -> None:
    made = pieces(box((1, 1, 1)))
    assert cover(made, 0.01, 5) is None
    assert len(cover(made, 0.01, 6).normal) == 6


def test_planes_fall_with_epsilon() -> None:
    made = pieces(cards(150))
    counts = [len(cover(made, epsilon, 1000).normal) for epsilon in (0.02, 0.05, 0.1, 0.3, 1.0)]
    assert all(a > b for a, b in pairwise(counts))
    assert counts[-1] == 1  # nothing lies farther from the middle


@pytest.mark.parametrize("epsilon", [0.1, 0.3])
def test_the_first_plane_is_about_the_best_there_is(epsilon: float) -> None:
    """Beside the best of 4,000 directions, each with every offset at which a piece begins to be
    valid: no plane of such a direction is valid for more."""
    shares = []
    for seed in range(5):
        made = pieces(cards(15, seed))
        grid = Grid(made, epsilon + ROUNDING)
        rows, normal, _ = densest_plane(grid)
        directions = even_hemisphere(4_000)
        low, high = made.spans(directions)
        area = made.projected(directions)
        begin, end = high - grid.reach, low + grid.reach
        best = max(
            float(np.where((begin <= at) & (at <= end), area, 0.0).sum(axis=1).max())
            for at in begin.T[:, :, None]
        )
        shares.append(float(made.projected(normal[None])[0, rows].sum()) / best)
    assert min(shares) > 0.7
    assert np.mean(shares) > 0.9


def test_most_valid_area_along_a_direction() -> None:
    """Against each end of each interval, one at a time. Whole numbers: ties are common."""
    random = np.random.default_rng(0)
    low = random.integers(0, 9, (40, 7)).astype(np.float64)
    high = low + random.integers(0, 5, low.shape)
    area = random.integers(0, 4, low.shape).astype(np.float64)
    density, offset = densest_offsets(low, high, area, 1.0)
    for row in range(len(low)):
        begin, end = high[row] - 1, low[row] + 1

        def at(place: float, begin=begin, end=end, row=row) -> float:
            return float(area[row][(begin <= place) & (place <= end)].sum())

        assert density[row] == max(at(place) for place in (*begin, *end))
        assert density[row] == 0 or density[row] == at(offset[row])


def test_densities_end_at_exactly_zero() -> None:
    """All are sums of whole multiples of STEP: what is taken leaves nothing behind."""
    grid = Grid(pieces(cards(150)), 0.1)
    assert grid.density.max() > 0.01
    assert np.array_equal(grid.density / STEP, np.rint(grid.density / STEP))
    for rows in np.array_split(np.random.default_rng(1).permutation(300), 11):
        grid.take(rows)
    assert not grid.left.any()
    assert not grid.density.any()


def test_a_cell_has_what_a_plane_in_it_is_worth() -> None:
    """A square through the middle, epsilon 0.1: planes along it are valid within 0.1, and none
    beyond; the grid's own direction leans by some degrees, and its cells are 0.05 deep."""
    sheet = pieces(SQUARE)
    grid = Grid(sheet, 0.1)
    offset = np.abs((np.arange(grid.density.shape[1]) + 0.5) * grid.cell + grid.low.min() - 0.1)
    flat = int(np.abs(plane_cover.GRID @ sheet.area[0]).argmax())
    worth = sheet.projected(plane_cover.GRID[flat][None]).sum()
    tilt = float(np.abs(grid.high[flat]).max())
    assert tilt < 0.1
    inside, beyond = offset < 0.1 - tilt - grid.cell, offset > 0.1 + tilt + grid.cell
    assert inside.any() and beyond.any()
    assert (grid.density[flat][inside] == worth).all()
    assert not grid.density[flat][beyond].any()


def test_tilts_lean_by_their_angle() -> None:
    direction = np.array([0.6, 0.0, 0.8])
    leaning = tilts(direction, 0.1)
    np.testing.assert_allclose(leaning @ direction, [1.0] + 8 * [np.cos(0.1)], atol=1e-15)


@pytest.mark.parametrize(("most", "epsilon"), [(60, 0.05), (20, 0.02)])
def test_many_pieces_join_the_planes_of_some(
    most: int, epsilon: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Still within epsilon, still no plane without pieces, and not many more planes."""
    made = pieces(np.concatenate([box((1, 0.7, 0.5)), cards(200, size=0.05)]))
    direct = cover(made, epsilon, 1000)
    monkeypatch.setattr(plane_cover, "MOST_PIECES", most)
    found = cover(made, epsilon, 1000)
    assert heights(made, found).max() <= epsilon + 2 * ROUNDING
    assert np.array_equal(np.unique(found.labels), np.arange(len(found.normal)))
    assert len(found.normal) <= 2 * len(direct.normal)
    assert cover(made, epsilon, len(found.normal) // 2) is None


@pytest.mark.parametrize("count", [1, 6, 20, 60])
def test_about_as_many_planes_as_asked(count: int) -> None:
    """As many clusters, by cuts; and nearly as many planes, by epsilon."""
    plant = plant_of(cards(300))
    made, _ = pieces_of(plant, by_first_face(samples(plant, 0.0, 1).of_face))
    found = planes_for(made, count)
    assert FILLED * count <= len(found.normal) <= count
    assert len(np.unique(cluster(plant, "planes", count))) == count


def test_one_plane_faces_most_of_the_area() -> None:
    """Of a box of 20 x 2 x 1, its sides of 2, 20 and 40 all show most along (2, 20, 40). The grid
    is 9 degrees coarse."""
    plant = plant_of(box((10, 1, 0.5)))
    made, axes = pieces_of(plant, np.arange(12))
    normal = one_plane(made).normal @ axes
    assert np.abs(normal[0]) @ [2, 20, 40] > 0.99 * np.hypot(2, np.hypot(20, 40))


DEGENERATE = {
    "without area": np.arange(12.0)[:, None, None] + np.array([0.0, 0.3, 0.9])[:, None] * [1, 2, 3],
    "one point": np.full((12, 3, 3), 7.0),
    "one 1e4 times larger": np.concatenate([1e4 * TETRAHEDRON[:1], cards(30)]),
    "duplicates": np.tile(TETRAHEDRON, (20, 1, 1)),
    "needle": np.concatenate([box((1, 1e-6, 1e-6)), box((0.5, 1e-6, 1e-6))]),
}


@pytest.mark.parametrize("epsilon", [1e-6, 0.1])
@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate(name: str, epsilon: float) -> None:
    """No piece is left out; duplicates take no planes of their own."""
    made = pieces(DEGENERATE[name])
    found = cover(made, epsilon, 1000)
    assert heights(made, found).max() <= epsilon + 2 * ROUNDING
    assert {"one point": 1, "duplicates": 4}.get(name, 1000) >= len(found.normal)


def moved(plant: Plant) -> list[Plant]:
    """The same one turned, far away, and of other sizes."""
    far = np.array([5e6, 300.0, -5e6])
    return [
        plant_of(corners)
        for corners in (
            plant.corners @ TURN.T,
            plant.corners + far,
            1e-6 * plant.corners,
            1e6 * plant.corners,
        )
    ]


def test_labels_are_the_same_wherever_the_plant_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cards that touch nowhere: no two planes are equally good. Every time alike, too."""
    monkeypatch.setattr(plane_space, "SOME", 100)
    plant = plant_of(cards(300))
    before = plant.positions.copy()
    labels = cluster(plant, "planes", 25)
    assert np.array_equal(labels, cluster(plant, "planes", 25, seed=1))
    for other in moved(plant):
        assert np.array_equal(labels, cluster(other, "planes", 25))
    assert np.array_equal(plant.positions, before)
