"""The descent: its running terms, what it loses (nothing), extremes, and that it is the same
wherever the plant is."""

from __future__ import annotations

from dataclasses import astuple, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hybrid_cases import (
    LEAF,
    ball,
    book,
    counted,
    leaves,
    mesh,
    shown_once,
    together,
    tree,
    tube,
)

from vegtool.hybrid.cloud import Cloud, cloud_of
from vegtool.hybrid.cost import Weights
from vegtool.hybrid.greedy import Descent, Step, descent
from vegtool.hybrid.start import begun
from vegtool.plant import Plant

TRIANGLE = mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
MODELS = {
    "tree": tree,
    "wood alone": lambda: together(
        tube((0, 0, 0), 0.2, 2, 10, 8), tube((0.5, 1, 0), 0.05, 1, 5, 4)
    ),
    "leaves alone": lambda: leaves(40),
    "one triangle": lambda: TRIANGLE,
    "one leaf": lambda: mesh(TRIANGLE.positions, TRIANGLE.faces, LEAF),
    "a ball": ball,
    "five faces at an edge": book,
    "two balls through each other": lambda: together(ball(), ball((0.7, 0.2, 0.1))),
    "duplicates": lambda: together(ball(), ball()),
    "without area": lambda: mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]] * 3, np.arange(9)),
    "one point": lambda: mesh(np.ones((6, 3)), np.arange(6)),
}
WEIGHTS = {
    "as by default": Weights(),
    "error alone": Weights(1.0, 0.0, 0.0),
    "no error": Weights(0.0, 1.0, 1.0),
    "none": Weights(0.0, 0.0, 0.0),
    "error first": Weights(1e9, 1.0, 1.0),
    "polygons first": Weights(1.0, 1e9, 0.0),
    "fill first": Weights(1.0, 1.0, 1e9),
}


def made(plant: Plant, weights: Weights, count: int = 8) -> Descent:
    return begun(cloud_of(plant, count), weights)


@cache
def cloud(model: str) -> Cloud:
    return cloud_of(MODELS[model](), 8)


@pytest.mark.parametrize(
    ("weights", "cheap"),
    [*((name, False) for name in WEIGHTS), ("as by default", True), ("error first", True)],
)
@pytest.mark.parametrize("model", MODELS)
def test_terms_add_up_and_nothing_is_lost(model: str, weights: str, cheap: bool) -> None:
    """After every step the terms are those counted anew, and the cost is less than before."""
    now = begun(cloud(model), WEIGHTS[weights])
    costs = []
    for step in descent(now, cheap):
        np.testing.assert_allclose(astuple(step.terms), astuple(counted(now)), rtol=1e-9, atol=1e-9)
        assert np.isfinite(astuple(step.terms)).all()
        assert step.cost == step.terms.cost(now.weights)
        assert step.triangles / len(now.part_of) == pytest.approx(step.terms.polygons)
        assert shown_once(now)
        costs.append(step.cost)
    assert all(a > b for a, b in pairwise(costs))


def test_a_face_is_wrong_that_its_plane_shows_to_nobody() -> None:
    """One triangle lies along the plane, one across it; as far as planes may reach, neither is
    displaced."""
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 1]]
    plant = mesh(corners, np.arange(6))
    pair = np.arange(2, dtype=np.int32)
    flat = Cloud(plant, pair, np.zeros_like(pair), np.array([[0.0, 0.0, 1.0]]), 1e12)
    np.testing.assert_allclose(flat.wrong, [0.0, 1.0], atol=1e-9)


def test_what_alpha_cuts_out_stays_on_billboards() -> None:
    now = made(tree(), Weights(1e9, 0.0, 0.0))
    list(descent(now))
    leaf = now.cloud.plant.face_material == 1
    assert not now.in_mesh[leaf].any()
    assert now.in_mesh[~leaf].all()  # it costs nothing to draw wood as it is


def test_a_trunk_leaves_the_leaves_that_lie_on_its_planes() -> None:
    """By default the trunk is a mesh, of fewer triangles; it is one part, with no strips cut off
    along planes."""
    now = made(tree(), Weights(), count=20)
    steps = list(descent(now))
    trunk = np.arange(280)
    assert now.in_mesh[trunk].all()
    (number,) = np.unique(now.part_of[trunk])
    assert len(now.parts[number].surface.faces) < 280
    assert steps[-1].cost < 0.9 * steps[0].cost


def test_weights_decide_what_it_becomes() -> None:
    """Error alone: all wood in the mesh, as it is. Polygons first: all on billboards, where a plane
    takes two."""
    ends = {}
    for name in ("error alone", "as by default", "polygons first"):
        now = made(tree(), WEIGHTS[name], count=20)
        ends[name] = list(descent(now))[-1]
        if name == "error alone":
            assert now.in_mesh.sum() == 328
            assert {len(p.faces) - len(p.surface.faces) for p in now.parts.values()} == {0}
    errors = [end.terms.error for end in ends.values()]
    polygons = [end.triangles for end in ends.values()]
    assert errors == sorted(errors)
    assert polygons == sorted(polygons, reverse=True)
    assert len(set(errors)) == 3
    assert ends["polygons first"].triangles == 2 * ends["polygons first"].billboards


@pytest.mark.parametrize("weights", [Weights(1.0, 1.0, 1.0), Weights(1.0, 3.0, 0.01)])
def test_it_ends_where_nothing_saves(weights: Weights) -> None:
    """Two balls through each other: what is not worth it at first is, once others have left."""
    now = made(together(ball(), ball((0.7, 0.2, 0.1))), weights)
    last = list(descent(now))[-1]
    changes = [one.change.cost(weights) for nth in range(now.sources) for one in now.proposals(nth)]
    assert all(change > -1e-9 * last.cost for change in changes)


def test_equal_faces_of_two_materials_stay_apart() -> None:
    """Bark and leaf in the same places: the bark alone may leave."""
    bark = ball()
    leaf = mesh(bark.positions, bark.faces, LEAF)
    now = made(together(bark, leaf), Weights(1e9, 0.0, 0.0))
    list(descent(now))
    half = len(bark.faces)
    assert now.in_mesh[:half].all()
    assert not now.in_mesh[half:].any()


def key(step: Step) -> tuple[int, int]:
    return step.billboards, step.triangles


@pytest.mark.parametrize("cheap", [False, True], ids=["best", "costliest"])
def test_steps_are_the_same_wherever_the_plant_is(cheap: bool) -> None:
    """Turned, far away and of other sizes; and the same twice, from a plant that stays as it is."""
    plant = tree()
    kept = [a.copy() for a in (plant.positions, plant.faces, plant.face_material)]
    weights = Weights(1.0, 0.3, 0.02)
    steps = list(descent(made(plant, weights, 20), cheap))
    assert len(steps) > 2
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    for positions in (
        plant.positions,
        plant.positions @ turn.T,
        plant.positions + np.array([4096.0, 64.0, -8192.0]),
        1e-6 * plant.positions,
        1e6 * plant.positions,
    ):
        other = replace(plant, positions=positions)
        again = list(descent(made(other, weights, 20), cheap))
        assert [key(step) for step in again] == [key(step) for step in steps]
        for one, two in zip(again, steps, strict=True):
            np.testing.assert_allclose(astuple(one.terms), astuple(two.terms), rtol=1e-5)
    for before, after in zip(
        kept, (plant.positions, plant.faces, plant.face_material), strict=True
    ):
        assert np.array_equal(before, after)
