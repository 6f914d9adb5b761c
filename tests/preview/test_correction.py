"""Corrections of lengths: sides as angles, and what lies between two stages and two sides."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.preview.correction import HARMONICS, NONE, SIDES, Correction, sides_of, smoothed
from vegtool.seeding import generator


def test_sides_turn_with_the_plant_and_against_the_eye() -> None:
    """A plant along -z that is turned by a sixteenth shows side 1; so does one that is not turned
    and lies a sixteenth to the right, as seen from above clockwise; and both by as much show 0."""
    step = 2 * np.pi / SIDES
    for turn, aside, side in ((0, 0, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (3, 2, 5), (0, -1, 15)):
        place = np.array([[np.sin(aside * step), 0.3, -np.cos(aside * step)]])
        turned = np.array([[np.cos(turn * step), np.sin(turn * step)]])
        off = (sides_of(9 * place, turned)[0] - side + SIDES / 2) % SIDES - SIDES / 2
        assert off == pytest.approx(0, abs=1e-9)


def test_factors_are_linear_in_stage_and_side() -> None:
    rng = generator(0, "factors")
    factor = rng.uniform(0.5, 1.5, (3, SIDES))
    found = Correction(np.array([1.0, 2.0, 4.0]), factor)
    stage = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0, 1.5])
    side = np.array([0.0, 3.0, 3.0, 15.0, 15.5, 2.25, 1.0, 15.999999])
    wanted = [
        factor[0, 0], factor[0, 3], (factor[0, 3] + factor[1, 3]) / 2, factor[1, 15],
        (factor[1, 15] + factor[1, 0] + factor[2, 15] + factor[2, 0]) / 4,
        0.75 * factor[2, 2] + 0.25 * factor[2, 3], factor[2, 1], (factor[0, 0] + factor[1, 0]) / 2,
    ]  # fmt: skip
    np.testing.assert_allclose(found.at(stage, side), wanted, rtol=1e-5)
    assert (NONE.at(stage, side) == 1).all()


def test_two_stages_at_one_place_are_a_jump() -> None:
    found = Correction(np.array([1.0, 1.0]), np.stack([np.full(SIDES, 2.0), np.full(SIDES, 3.0)]))
    assert found.at(np.array([0.9, 1.0, 1.1]), np.zeros(3)).tolist() == [2.0, 3.0, 3.0]


def test_smoothing_keeps_the_mean_and_what_is_wide() -> None:
    around = 2 * np.pi * np.arange(SIDES) / SIDES
    kept = 3 + np.cos(around) - 0.5 * np.sin(HARMONICS * around)
    np.testing.assert_allclose(smoothed(kept), kept, atol=1e-12)
    np.testing.assert_allclose(smoothed(kept + np.cos(5 * around)), kept, atol=1e-12)
