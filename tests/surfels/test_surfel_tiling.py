"""Parts of a model that replace each other: whatever a client draws of them, all of it, once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from surfel_cases import COARSE, hills
from surfel_parts import with_some, without

from vegtool.growth import sample
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.tiling import FINER, WORTH, SurfelTile, tiles_of

pytestmark = pytest.mark.gl
SMALL = 300
"""Triangles of a tile: so that there are many."""


@pytest.fixture(scope="module")
def model() -> SurfelModel:
    return surfel_model(sample("statue", 4000), display=COARSE)


def cut(tile: SurfelTile, random: np.random.Generator, share: float) -> Iterator[SurfelTile]:
    """What a client might draw: of each tile itself, or all of its children so."""
    if tile.children and random.uniform() < share:
        for child in tile.children:
            yield from cut(child, random, share)
    else:
        yield tile


def patches_shown(model: SurfelModel, tiles: list[SurfelTile]) -> np.ndarray:
    """(p,) how often."""
    patch, over = model.hierarchy.pairs()
    shown = np.zeros(len(model.hierarchy.above), int)
    for tile in tiles:
        shown[tile.patches] += 1
        np.add.at(shown, patch[np.isin(over, tile.billboards)], 1)
    return shown


def test_every_cut_shows_every_patch_once(model: SurfelModel) -> None:
    random = np.random.default_rng(0)
    some = random.uniform(size=len(model.hierarchy)) < 0.5
    for one in (model, with_some(model, some)):
        root = tiles_of(one, SMALL)
        for share in (0.0, 0.5, 0.8, 0.9, 1.0):
            for _ in range(10):
                assert (patches_shown(one, list(cut(root, random, share))) == 1).all()


def test_errors_are_those_of_what_is_shown_and_fall(model: SurfelModel) -> None:
    mt = model.triangles
    made = np.repeat(mt.error[mt.end], mt.sizes)
    root = tiles_of(model, SMALL)
    for tile in root.all():
        errors = [*model.hierarchy.error[tile.billboards], *made[tile.triangles]]
        assert tile.error == max(errors)
        assert bool(tile.children) == (tile.error > 0)
        assert all(child.error <= FINER * tile.error for child in tile.children)
    assert root.error == model.hierarchy.error.max()


def test_leaves_are_the_original(model: SurfelModel) -> None:
    mt = model.triangles
    leaves = [tile for tile in tiles_of(model, SMALL).all() if not tile.children]
    assert not any(len(tile.billboards) for tile in leaves)
    rows = np.unique(np.concatenate([tile.triangles for tile in leaves]))
    original = np.unique(np.sort(mt.plant.faces, axis=1), axis=0)
    assert np.array_equal(np.unique(np.sort(mt.faces[rows], axis=1), axis=0), original)


def test_tiles_are_small_and_hardly_overlap(model: SurfelModel) -> None:
    """A border of triangles is drawn on both sides: here a third of them, in tiles that are some
    twenty triangles wide."""
    leaves = [tile for tile in tiles_of(model, SMALL).all() if not tile.children]
    drawn = sum(len(tile.triangles) for tile in leaves)
    assert len(model.plant.faces) <= drawn <= 1.4 * len(model.plant.faces)
    sizes = [
        len(tile.billboards) * 2 + len(tile.triangles) for tile in tiles_of(model, SMALL).all()
    ]
    assert max(sizes) <= 2 * WORTH * SMALL


def test_tiles_of_different_levels_leave_no_hole() -> None:
    """Seen from above, hills are a square at every level; so is what is drawn, wherever levels
    meet: every one of 2,000 points has a triangle above it."""
    model = without(hills(40), COARSE)
    root = tiles_of(model, SMALL)
    random = np.random.default_rng(0)
    points = random.uniform(0, 1, (2000, 2))
    mixed = 0
    for share in (0.3, 0.6, 0.9):
        tiles = list(cut(root, random, share))
        mixed += len({tile.error for tile in tiles}) > 2
        rows = np.concatenate([tile.triangles for tile in tiles])
        assert covered(points, model.plant.positions[model.triangles.faces[rows]][..., [0, 2]])
    assert mixed


def covered(points: np.ndarray, corners: np.ndarray) -> bool:
    """Whether all points (n, 2) are in some of triangles (m, 3, 2)."""
    inside = np.ones((len(points), len(corners)), bool)
    sides = np.roll(corners, -1, axis=1) - corners
    (ax, ay), (bx, by) = sides[:, 0].T, sides[:, 1].T
    turn = np.sign(ax * by - ay * bx)
    for side in range(3):
        away = points[:, None] - corners[:, side]
        cross = sides[:, side, 0] * away[..., 1] - sides[:, side, 1] * away[..., 0]
        inside &= turn * cross >= -1e-12
    return bool(inside.any(axis=1).all())
