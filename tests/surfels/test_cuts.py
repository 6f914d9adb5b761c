"""Cuts: each covers the surface once and without cracks, whatever levels it mixes."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_cases import COARSE, Border, ball, hills, rounds

from vegtool.growth import sample
from vegtool.surfels import cuts
from vegtool.surfels.multi_triangulation import MultiTriangulation, multi_triangulation


@pytest.fixture(scope="module", params=["hills", "ball", "palm"])
def made(request: pytest.FixtureRequest) -> MultiTriangulation:
    if request.param == "palm":
        return multi_triangulation(sample("palm", 12000), epsilon=6.0)
    return multi_triangulation(
        hills(60, materials=True) if request.param == "hills" else ball(5), COARSE
    )


def from_the_top(mt: MultiTriangulation, fine: np.ndarray) -> set[int]:
    """Eq. 10 and 12 by hand: from the source down, whatever node is not fine, (n,), is replaced by
    the arcs that it takes."""
    arcs: set[int] = set()
    todo, seen = [len(mt.error) - 1], set()
    while todo:
        node = todo.pop()
        if node in seen:
            continue
        seen.add(node)
        for arc in np.flatnonzero(mt.start == node).tolist():
            end = int(mt.end[arc])
            if fine[end]:
                arcs.add(arc)
            else:
                todo.append(end)
    return arcs


def eyes(mt: MultiTriangulation, count: int) -> list[np.ndarray]:
    """Random places close above the surface."""
    random = np.random.default_rng(0)
    at = mt.plant.face_centroids[random.integers(len(mt.plant.faces), size=count)]
    away = random.normal(size=(count, 3)) * mt.plant.radius
    return list(at + away * 10 ** random.uniform(-2.5, -0.7, (count, 1)))


PC = COARSE.pixels_per_metre(1.0)


def test_any_threshold(made: MultiTriangulation) -> None:
    """Fewer triangles with each node that is applied, and never a crack."""
    random = np.random.default_rng(1)
    left, border = [], Border(made.plant)
    for delta in np.sort(random.choice(made.error[:-1], 8)):
        cut = cuts.by_error(made, delta)
        assert set(np.flatnonzero(cut)) == from_the_top(made, made.error <= delta)
        faces = made.faces[cuts.triangles(made, cut)]
        border.assert_kept(faces)
        left.append(len(faces))
    assert left == sorted(left, reverse=True)


def test_any_eye(made: MultiTriangulation) -> None:
    """Most cuts from close by are of at least three rounds; none has a crack."""
    mixed, border = 0, Border(made.plant)
    for eye in eyes(made, 12):
        cut = cuts.by_image_error(made, eye, PC, 3.0)
        fine = cuts.image_errors(made, eye, PC) <= 3.0
        assert set(np.flatnonzero(cut)) == from_the_top(made, fine)
        border.assert_kept(made.faces[cuts.triangles(made, cut)])
        mixed += len(np.unique(rounds(made)[made.end[cut]])) >= 3
    assert mixed >= 8


def test_any_nodes_with_all_below_them(made: MultiTriangulation) -> None:
    """Valid cuts that no threshold gives."""
    random = np.random.default_rng(2)
    mixed, border = 0, Border(made.plant)
    for share in (0.002, 0.01, 0.03, 0.1, 0.3, 0.6):
        applied = random.random(len(made.error)) < share
        applied[0], applied[-1] = True, False
        for start, end in zip(made.start[::-1].tolist(), made.end[::-1].tolist(), strict=True):
            applied[end] |= applied[start]  # arcs are sorted by their start
        cut = cuts.between(made, applied)
        border.assert_kept(made.faces[cuts.triangles(made, cut)])
        mixed += len(np.unique(rounds(made)[made.end[cut]])) >= 3
    assert mixed >= 3


def test_every_way_down_meets_a_cut_once(made: MultiTriangulation) -> None:
    """Both properties of section 4.1: no arc lies below another one, and none could be added."""
    random = np.random.default_rng(3)
    first = np.searchsorted(made.start, np.arange(len(made.error) + 1))
    for eye in eyes(made, 5):
        cut = cuts.by_image_error(made, eye, PC, 3.0)
        for _ in range(100):
            node, met = len(made.error) - 1, 0
            while node:
                arc = random.integers(first[node], first[node + 1])
                met += cut[arc]
                node = int(made.end[arc])
            assert met == 1


def test_a_crack_is_found() -> None:
    """The oracle sees what a cut would be that forgets a patch, and what it would be that gives one
    patch of a node way and not the others."""
    made = multi_triangulation(ball(4), COARSE)
    border = Border(made.plant)
    cut = cuts.by_error(made, float(np.median(made.error[1:-1])))
    patch = np.flatnonzero(cut & (made.end > 0))[0]
    node = made.end[patch]
    border.assert_kept(made.faces[cuts.triangles(made, cut)])
    for wrong in (cut & (np.arange(len(cut)) != patch), cut | (made.start == node)):
        wrong = wrong.copy()
        wrong[patch] = False
        with pytest.raises(AssertionError):
            border.assert_kept(made.faces[cuts.triangles(made, wrong)])


def test_image_errors(made: MultiTriangulation) -> None:
    """A node seen from z_min away has an error of epsilon; from inside its sphere, none is small
    enough; the drain has none from anywhere."""
    z_min = cuts.z_min(made, PC, 0.5)
    for node in (1, len(made.error) // 2, len(made.error) - 2):
        way = np.array([0.6, 0.0, 0.8])
        eye = made.center[node] + z_min[node] * way
        assert cuts.image_errors(made, eye, PC)[node] == pytest.approx(0.5)
        inside = made.center[node] + 0.9 * made.radius[node] * way
        assert cuts.image_errors(made, inside, PC)[node] == np.inf
        assert cuts.image_errors(made, inside, PC)[0] == 0.0
    assert z_min[0] == 0.0
    assert z_min[-1] == np.inf
    assert np.array_equal(
        cuts.by_image_error(made, made.plant.center + 1e6, PC, 0.5), cuts.coarsest(made)
    )


def test_image_errors_grow_along_arcs(made: MultiTriangulation) -> None:
    """Else a cut would not be one."""
    for eye in eyes(made, 5):
        error = cuts.image_errors(made, eye, PC)
        assert (error[made.start] >= error[made.end] * (1 - 1e-9)).all()


def test_a_cut_as_a_plant(made: MultiTriangulation) -> None:
    """Its triangles, with their materials and all vertices of the original."""
    cut = cuts.coarsest(made)
    drawn = cuts.drawn(made, cut)
    assert drawn.positions is made.plant.positions
    at = 0
    for arc in np.flatnonzero(cut):
        patch = made.faces[made.first[arc] : made.first[arc + 1]]
        assert np.array_equal(drawn.faces[at : at + len(patch)], patch)
        assert (drawn.face_material[at : at + len(patch)] == made.material[arc]).all()
        at += len(patch)
    assert at == len(drawn.faces)
