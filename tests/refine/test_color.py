"""Mean colour measured and put right, on levels whose error is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hybrids import hybrid_of

from vegtool.baking.bake import bake
from vegtool.growth import sample
from vegtool.lod import Atlas, Billboards, Level
from vegtool.measure.scores import Truths, scores, truths
from vegtool.measure.views import views
from vegtool.plant import Material, Plant
from vegtool.refine.color import (
    BRIGHTER,
    Shares,
    factor_table,
    gains,
    scaled,
    shares,
    unbiased_color,
)

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def tree() -> tuple[Level, Truths]:
    plant = sample("broadleaf", 2000)
    return hybrid_of(plant, 60, 150 / plant.extent), truths(plant, views("all", 4), [150.0])


def bias(level: Level, truth: Truths) -> float:
    shown = shares(level, truth)
    return shown.billboards + shown.mesh - BRIGHTER


def same(a: Level, b: Level) -> bool:
    assert a.atlas is not None and b.atlas is not None
    assert a.mesh is not None and b.mesh is not None
    return np.array_equal(a.atlas.color, b.atlas.color) and np.array_equal(
        np.asarray(a.mesh.colors), np.asarray(b.mesh.colors)
    )


@pytest.mark.parametrize("factor", [0.7, 1.0, 1.4])
def test_whatever_the_brightness_was_it_is_the_truths(
    factor: float, tree: tuple[Level, Truths]
) -> None:
    """Rounding to bytes of sRGB leaves less than 1 %."""
    level, truth = tree
    wrong = scaled(level, factor, factor)
    before = scaled(level, factor, factor)
    found = unbiased_color(wrong, truth)
    assert abs(bias(found, truth)) < 0.01
    assert same(wrong, before), "inputs stay as they are"


def test_the_metric_that_users_see_agrees(tree: tuple[Level, Truths]) -> None:
    """Up to its anisotropic filtering."""
    level, truth = tree
    found = unbiased_color(scaled(level, 0.6, 0.6), truth)
    assert abs(scores(truth, found).values["color_bias"].mean()) < 0.02 + BRIGHTER - 1


def test_twice_is_once(tree: tuple[Level, Truths]) -> None:
    level, truth = tree
    once = unbiased_color(level, truth)
    assert abs(bias(once, truth) - bias(unbiased_color(once, truth), truth)) < 0.01


def test_the_part_that_is_seen_most_changes_most() -> None:
    """Of the line of factors with the sum wanted, the foot of the perpendicular from (1, 1)."""
    a, b = gains(Shares(0.6, 0.2))
    assert a * 0.6 + b * 0.2 == pytest.approx(BRIGHTER)
    assert (a - 1) / (b - 1) == pytest.approx(3.0)
    assert gains(Shares(0.8, 0.0)) == pytest.approx((1.25 * BRIGHTER, 1.0))
    assert gains(Shares(0.0, 0.0)) == (1.0, 1.0)
    assert gains(Shares(0.1, 0.0)) == (2.0, 1.0), "that far off, it is not colour"


def test_factors_are_of_linear_light() -> None:
    half = factor_table(0.5)
    assert half[255] == 188, "linear 0.5 is sRGB 188"
    np.testing.assert_array_equal(factor_table(1.0), np.arange(256))
    assert (factor_table(3.0)[200:] == 255).all(), "nothing is brighter than white"


def test_the_white_block_stays_white_and_the_mesh_has_a_factor_of_its_own(
    tree: tuple[Level, Truths],
) -> None:
    level, _ = tree
    dark = scaled(level, 0.25, 0.5)
    assert dark.atlas is not None and dark.atlas.white is not None
    x, y, w, h = dark.atlas.white
    assert (dark.atlas.color[y : y + h, x : x + w] == 255).all()
    assert level.mesh is not None and dark.mesh is not None
    assert level.mesh.colors is not None and dark.mesh.colors is not None
    np.testing.assert_allclose(dark.mesh.colors[:, :3], level.mesh.colors[:, :3] * 0.5)
    np.testing.assert_array_equal(dark.mesh.colors[:, 3], level.mesh.colors[:, 3])


def test_billboards_alone_and_nothing_at_all(tree: tuple[Level, Truths]) -> None:
    level, truth = tree
    alone = replace(level, kind="billboards", mesh=None)
    assert abs(bias(unbiased_color(scaled(alone, 0.7, 1.0), truth), truth)) < 0.02
    assert alone.atlas is not None
    atlas: Atlas = replace(alone.atlas, color=np.zeros_like(alone.atlas.color))
    empty = replace(alone, atlas=atlas)
    assert unbiased_color(empty, truth).atlas is not None


def test_a_mesh_alone_is_scaled_by_its_vertices(tree: tuple[Level, Truths]) -> None:
    """The plant itself, in one colour that is too dark."""
    _, truth = tree
    colors = np.tile([0.02, 0.03, 0.01, 1.0], (len(truth.plant.positions), 1))
    plain = Material("plain", double_sided=True)
    face_material = np.zeros(len(truth.plant.faces), np.int32)
    mesh = replace(truth.plant, materials=(plain,), face_material=face_material, branches=None)
    level = Level("mesh", mesh=replace(mesh, colors=colors))
    for _ in range(3):  # each may double it
        level = unbiased_color(level, truth)
    assert abs(bias(level, truth)) < 0.005
    assert unbiased_color(Level("mesh", mesh=mesh), truth).mesh is mesh


@pytest.mark.parametrize("normal", [(0.6, 0.0, 0.8), (0.6, 0.0, -0.8), (0.0, 0.6, -0.8)])
def test_a_card_with_a_normal_of_its_own_is_lit_as_it_was(normal: tuple[float, ...]) -> None:
    """As of a crown: on one side of the card it points away from whoever sees that side."""
    x, y = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]).T
    card = Plant(
        "card",
        np.stack([x, y, np.zeros(4)], axis=1),
        np.tile(normal, (4, 1)),
        np.zeros((4, 2)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.zeros(2, np.int32),
        (Material("leaf", double_sided=True, role="leaf"),),
    )
    z, side = np.zeros((1, 3)), np.eye(3)[:2]
    plane = Billboards(z, side[:1], side[1:], np.ones((1, 2)), np.zeros(1), np.zeros(1))
    level = bake(card, np.zeros(2, np.int32), plane, 16.0)
    truth = truths(card, views("all", 6), [100.0])
    assert np.abs(scores(truth, level).values["color_bias"]).max() < 0.02
