"""Reductions of a connected part: borders stay, errors are measured, flat sides stay flat."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hybrid_cases import ball, book, mesh, together, tube
from surfaces import grid_faces

from vegtool.hybrid.cost import DISPLACED, Terms, Weights, misplaced
from vegtool.hybrid.reduction import FEWEST, ROUGH, displaced, reductions
from vegtool.meshes.collapse import Collapsed, uncollapsed
from vegtool.meshes.pieces import Surface, all_welded
from vegtool.plant import Plant

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)


def surface(plant: Plant, turned: bool = False) -> Surface:
    positions = plant.positions @ TURN.T if turned else plant.positions
    return all_welded(replace(plant, positions=positions))


def borders(of: Surface) -> np.ndarray:
    """(b, 3) places at open edges, in order."""
    edges = np.sort(np.concatenate([of.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]))
    edge, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(of.positions[edge[count == 1]].reshape(-1, 3), axis=0)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("sides", [4, 14])
def test_open_borders_stay_exactly(sides: int, turned: bool) -> None:
    """What is beyond them is drawn by others."""
    whole = surface(tube((0.3, 0, 0), 0.15, 2.0, sides, 10), turned)
    made = reductions(whole, 0.05, ("stay",))
    assert len(made.surfaces) > 3
    for one in made.surfaces:
        assert np.array_equal(borders(one), borders(whole))


@pytest.mark.parametrize("turned", [False, True])
def test_flat_sides_cost_nothing_however_they_lie(turned: bool) -> None:
    """A square tube of ten rings: the rings between its ends may go, and 8 triangles be left of
    each side but for those at the borders."""
    made = reductions(surface(tube((0, 0, 0), 0.15, 2.0, 4, 10), turned), 0.05, ("stay",))
    flat = made.triangles <= 20
    assert flat.any()
    area = made.area[0]
    assert made.wrong[flat].min() < 4 * DISPLACED * ROUGH / 0.05 * area


@pytest.mark.parametrize(
    "plant",
    [ball(), book(), together(ball(), ball((0.7, 0.2, 0.1))), tube((0, 0, 0), 0.2, 1, 5, 4)],
    ids=["ball", "five faces at an edge", "two balls", "tube"],
)
def test_what_has_become_of_corners_is_what_is_drawn(plant: Plant) -> None:
    """Triangles that are left are those whose corners became three different ones; errors are
    from none to all of the surface."""
    whole = surface(plant)
    before = whole.positions.copy()
    made = reductions(whole, 0.05, ("stay",))
    assert made.surfaces[0] is whole
    assert made.wrong[0] == 0
    assert all(a > b >= 1 for a, b in pairwise(made.triangles))
    for one, became, wrong in zip(made.surfaces[1:], made.became[1:], made.wrong[1:], strict=True):
        left = uncollapsed(became)
        assert np.array_equal(np.sort(became[left]), np.sort(one.faces))
        assert np.array_equal(np.unique(one.faces), np.arange(len(one.positions)))
        assert np.isin(one.corners, whole.corners).all()
        assert 0 <= wrong <= whole.areas.sum() * (1 + 1e-9)
    assert np.array_equal(before, whole.positions)


def test_a_ball_shrinks_no_further_than_its_error_says() -> None:
    """Inscribed in the unit sphere, or about it: what is drawn is within the mean displacement."""
    whole = surface(ball(rows=12, columns=18))
    reach = 1.0
    made = reductions(whole, reach, ("stay",))
    radius = np.linalg.norm(whole.positions[0])
    for one, wrong in zip(made.surfaces, made.wrong, strict=True):
        if len(one.faces) < 40:
            break
        off = np.abs(np.linalg.norm(one.positions, axis=1) - radius).mean()
        assert off < 0.12 * radius
        lost = max(0.0, 1 - one.areas.sum() / whole.areas.sum())
        assert wrong / whole.areas.sum() < DISPLACED * 0.12 * radius / reach + lost
    assert made.triangles[-1] < 20


def test_area_that_is_lost_is_not_shown() -> None:
    """Where no displacement counts, what a ball inscribed in another lacks is all that is wrong."""
    made = reductions(surface(ball(rows=12, columns=18)), 1e12, ("stay",))
    lost = np.maximum(made.area[0] - made.area, 0.0)
    assert lost[-1] > 0.1 * made.area[0]
    np.testing.assert_allclose(made.wrong, lost, atol=1e-9)


def test_a_border_that_moves_leaves_a_gap() -> None:
    """A square loses a corner: half of the two edges that met there are half a diagonal away."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    became = np.array([[0, 1, 2], [0, 2, 2]], dtype=np.int32)
    made = Collapsed(square[:3], faces[:1], became)
    assert displaced(Surface(square, faces, faces), made, 1e12) == pytest.approx(0.5**0.5)


def test_faces_without_area_go_first() -> None:
    """The quads at the poles of a ball have a half without area."""
    whole = surface(ball())
    assert len(whole.faces) == 108
    made = reductions(whole, 0.05, ("stay",))
    assert (made.triangles[1:] <= 108 - 18).all()
    points = surface(mesh(np.ones((30, 3)), np.arange(30)))
    assert len(reductions(points, 0.05, ("stay",)).surfaces) == 1


def test_few_triangles_stay() -> None:
    square = surface(mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], grid_faces(1, 1)))
    assert len(square.faces) <= FEWEST
    assert reductions(square, 0.05, ("stay",)).triangles.tolist() == [2]


def test_what_is_misplaced() -> None:
    """Half as wrong as nothing at the reach, all wrong from twice that on; and not drawn, all."""
    away = np.array([0.0, 0.05, 0.1, 0.2, 5.0, np.inf])
    np.testing.assert_allclose(misplaced(away, 0.1), [0, 0.25, 0.5, 1, 1, 1])
    assert misplaced(np.zeros(1), 0.0)[0] == 0  # no cloud is flat and moves something


def test_terms_are_sums() -> None:
    one, two = Terms(0.5, 1.0, 2.0), Terms(0.25, 0.5, 0.5)
    assert one - two + two == one
    assert one.cost(Weights(2.0, 3.0, 0.5)) == 2 * 0.5 + 3 * 1 + 0.5 * 2
