"""Which levels a need asks for, and which squares a client can refine."""

from __future__ import annotations

from dataclasses import replace
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest
from needs_cases import FLAT, hills, scene_with, tree

from vegtool.lod import Display
from vegtool.needs.inside import inside
from vegtool.needs.levels import levels_needed
from vegtool.needs.need import Need
from vegtool.needs.tiles import refined
from vegtool.needs.viewers import viewers_of
from vegtool.seeding import generator
from vegtool.tiles.library import StoredSurfels

TREE = tree((0.0, 20.0, 50.0), fade=0.1)
"""Levels are drawn from 0 to 22 m, from 20 to 55 m, and from 50 m on."""


def need(nearest: float, farthest: float, display: Display | None = None, plants: int = 1) -> Need:
    around, up = (0.0, 2 * pi), (-pi / 2, pi / 2)
    shown = display or Display()
    return Need(
        "tree", nearest, farthest, around, up, True, True, 1.0, shown, "unsaid", None, plants
    )


@pytest.mark.parametrize(
    ("nearest", "farthest", "kept"),
    [
        (0, inf, [True, True, True]),
        (0, 19.9, [True, False, False]),
        (0, 20, [True, True, False]),
        (21.9, 30, [True, True, False]),
        (22.1, 30, [False, True, False]),
        (54.9, 60, [False, True, True]),
        (55.1, inf, [False, False, True]),
    ],
)
def test_levels_by_distance(nearest: float, farthest: float, kept: list[bool]) -> None:
    found = levels_needed(TREE, need(nearest, farthest))
    assert found.kept.tolist() == kept
    for is_kept, reason in zip(kept, found.reasons, strict=True):
        assert ("kept" in reason) == is_kept and ("left out" in reason) != is_kept


def test_reasons() -> None:
    found = levels_needed(TREE, need(22.5, 30))
    assert found.reasons == (
        "the original: left out: drawn from 0 to 22 m, and no eye is within 22.5 m",
        "level 1: kept, as it is drawn from 20 to 55 m and plants are seen from 22.5 to 30 m",
        "level 2: left out: drawn from 50 m on, and no eye is beyond 30 m",
    )


def test_a_picture_of_twice_the_size() -> None:
    """Levels then take over at twice the distance."""
    found = levels_needed(TREE, need(0, 39.9, Display(60.0, 2160)))
    assert found.kept.tolist() == [True, False, False]


def test_surfels_are_a_level() -> None:
    """From 100 m on, faded in at 120 m: until then it is the last level that is triangles."""
    one = replace(TREE, surfels=StoredSurfels(Path("tree.glb"), 100.0, 0.2))
    assert levels_needed(one, need(0, 99)).kept.tolist() == [True, True, True, False]
    assert levels_needed(one, need(119, 200)).kept.tolist() == [False, False, True, True]
    assert levels_needed(one, need(121, 200)).kept.tolist() == [False, False, False, True]
    assert levels_needed(one, need(121, 200)).reasons[3].startswith("surfels: kept")


def test_a_species_without_plants() -> None:
    found = levels_needed(TREE, need(inf, 0, plants=0))
    assert not found.kept.any() and all("no plant of it stands" in r for r in found.reasons)


def test_squares_that_no_eye_refines(tmp_path: Path) -> None:
    """A box of 10 m, 100 m from a square: at 1,080 pixels and 60 degrees a metre there is
    9.353 pixels, so that errors of more than 1.711 m are seen as more than 16."""
    scene = scene_with(tmp_path, "polygon = [[0, 0], [9, 0], [9, 9], [0, 9]]\nheight_m = [1, 2]")
    viewers = viewers_of(scene, FLAT)
    box = np.array([[109.0, 0.0, 0.0], [119.0, 10.0, 9.0]])
    boxes = np.stack([box, box, box - [100, 0, 0], box - [100, 0, 0]])
    errors = np.array([1.71, 1.72, 0.0, 1e-9])
    assert refined(boxes, errors, viewers, Display()).tolist() == [False, True, False, True]


def test_every_square_that_an_eye_refines(tmp_path: Path) -> None:
    """From random eyes, square by square, as the walk chooses them."""
    ground, random = hills(), generator(0, "boxes")
    scene = scene_with(
        tmp_path,
        "polygon = [[-30, -30], [-9, -30], [-9, 30]]\nheight_m = [1, 9]\nmargin_m = 2",
    )
    viewers = viewers_of(scene, ground)
    low = random.uniform([-90, 80, -90], [90, 110, 90], (300, 3))
    boxes = np.stack([low, low + random.uniform(1, 40, (300, 3))], axis=1)
    errors = random.uniform(0, 2, 300)
    found = refined(boxes, errors, viewers, Display())
    focal, ever = Display().pixels_per_metre(1.0), np.zeros(300, np.bool_)
    for eye in inside(viewers, 2000, 0).position:
        near = np.linalg.norm(np.clip(eye, boxes[:, 0], boxes[:, 1]) - eye, axis=1)
        ever |= errors * focal > 16 * near
    assert (found >= ever).all() and (~found).sum() > 50
    assert (found != ever).sum() < 20  # those that eyes at random are not near enough to
