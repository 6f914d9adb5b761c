"""Leaves that let light through."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.growth import sample
from vegtool.lighting.leaves import translucent


def test_leaves_alone_let_light_through_and_all_else_stays() -> None:
    plant = sample("bush", 300)
    tint = np.array([0.9, 1.0, 0.3])
    tinted = tuple(replace(m, transmission_tint=tint, transmission=0.2) for m in plant.materials)
    plant = replace(plant, materials=tinted)
    found = translucent(plant, 0.4)
    for before, after in zip(plant.materials, found.materials, strict=True):
        assert after.transmission == (0.4 if before.role == "leaf" else 0.2)
        np.testing.assert_array_equal(after.transmission_tint, tint)
        assert after.color_texture is before.color_texture
        assert before.transmission == 0.2, "inputs stay as they are"
    assert {m.role for m in found.materials} == {"leaf", "wood"}
    assert found.positions is plant.positions
    assert found.faces is plant.faces


def test_no_light_is_a_share_too() -> None:
    """A file may say otherwise; the option has the last word."""
    plant = translucent(sample("bush", 300), 0.7)
    assert all(m.transmission == 0 for m in translucent(plant, 0.0).materials)


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_there_are_no_other_shares(share: float) -> None:
    with pytest.raises(ValueError, match="transmission"):
        translucent(sample("bush", 300), share)
