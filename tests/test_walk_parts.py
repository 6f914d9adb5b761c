"""The arithmetic of benchmarks/preview.py: what it counts, and where it looks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vegtool.elements import ordered
from vegtool.gl.landscape import Batch, Frame
from vegtool.tiles.grid import Grid
from vegtool.tiles.library import Species

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"


@pytest.fixture(autouse=True)
def _reachable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def test_vertices_are_those_of_the_faces_that_are_drawn() -> None:
    from walk.vertices import counts_of, vertices_in

    from vegtool.growth import sample

    plant = sample("herb")
    species = Species("herb", (plant,), np.zeros(1), np.zeros(1), 665.1, ())
    elements = ordered(plant)
    for share in (0.0, 0.3, 2.0):
        drawn = elements.faces[elements.face_rank < share]
        frame = Frame(np.zeros(3), (Batch(0, 0, 3, share),))
        assert vertices_in(frame, counts_of([species])) == 3 * len(np.unique(drawn))


def test_the_first_and_the_last_view_are_stations() -> None:
    from walk.path import evenly

    assert evenly(60, 10) == [0, 7, 13, 20, 26, 33, 39, 46, 52, 59]
    assert evenly(3, 10) == [0, 1, 2]


def test_a_walk_passes_all_of_a_fade_and_pairs_straddle_its_ends() -> None:
    from walk.transition import Transition, chosen_pairs, walked_m

    fade, below = Transition(1, 50.0, 57.5), -3.0
    away = walked_m(fade, below, 1.5)
    distance = np.hypot(away, below)
    assert np.allclose(np.diff(away), -0.05)
    assert distance[0] == pytest.approx(58.25) and distance[-1] <= 49.25
    pairs = chosen_pairs(away, fade, below, 4)
    for end in (fade.start_m, fade.end_m):
        assert any(distance[i] >= end > distance[i + 1] for i in pairs)
    assert pairs[0] == 0 and pairs[-1] == len(away) - 2


def test_no_tree_grows_on_the_trail() -> None:
    """As the placement reads the map: north, which is -z, is its first row."""
    from walk.trail import HALF_M, density, middle

    side = 100.0
    grid = Grid(np.float32(density(side) / 255), np.full(2, side))
    x = np.linspace(-40, 40, 50)
    for across in (-HALF_M + 1, 0.0, HALF_M - 1):
        assert (grid.at(np.stack([x, middle(x) + across], axis=1)) == 0).all()
    for across in (-HALF_M - 1, HALF_M + 1):
        assert (grid.at(np.stack([x, middle(x) + across], axis=1)) == 1).all()
