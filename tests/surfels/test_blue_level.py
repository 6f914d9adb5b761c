"""Levels out of surfels: from where they may be used, and how far off they are."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_sets import ball

from vegtool.lod import Display
from vegtool.surfels.blue.level import Sampled, nearest_m, surfel_level

DISPLAY = Display(60.0, 1000)


def test_a_level_begins_where_its_discs_are_a_pixel() -> None:
    """On the nearest side of the plant, which is its radius nearer."""
    surfels = ball(2000)
    away = nearest_m(surfels, 500, 1.0, DISPLAY)
    wide = 2 * surfels.spacing.radius(500) * DISPLAY.pixels_per_metre(away - 1.0)
    assert wide == pytest.approx(1.0)


def test_a_quarter_of_the_surfels_is_for_half_the_size() -> None:
    surfels = ball(2000)
    ratio = nearest_m(surfels, 250, 0.0, DISPLAY) / nearest_m(surfels, 1000, 0.0, DISPLAY)
    assert ratio == pytest.approx(2.0)


def test_a_level_is_a_prefix_and_errs_by_its_gaps() -> None:
    """No place of a ball is farther from the nearest of an r-net than r."""
    surfels = ball(2000)
    level = surfel_level(Sampled(surfels, surfels.position, {}), 500, 3.0)
    assert level.surfels is not None and level.geometric_error_m is not None
    assert np.array_equal(level.surfels.position, surfels.position[:500])
    assert level.surfels.spacing.total == 500
    largest, most = level.geometric_error_m
    gaps = np.linalg.norm(surfels.position[:, None] - surfels.position[None, :500], axis=2)
    assert largest == pytest.approx(gaps.min(axis=1).max())
    assert 0 < most < largest
