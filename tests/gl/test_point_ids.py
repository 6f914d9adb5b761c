"""Which discs are seen from outside: as a plain loop over pixels says, and what hides what."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.arrays import unit
from vegtool.gl import point_ids
from vegtool.gl.point_ids import seen_discs
from vegtool.measure.views import upright
from vegtool.seeding import generator

pytestmark = pytest.mark.gl
PIXELS = 48


def axes(*directions: tuple[float, float, float]) -> np.ndarray:
    found = unit(np.array(directions, dtype=float))
    return np.array([np.stack([*upright(one), one]) for one in found])


def one_by_one(
    position: np.ndarray, normal: np.ndarray, radius: np.ndarray, view: np.ndarray
) -> set[int]:
    """Pixel by pixel, disc by disc: the nearest plane within its circle, a disc but for the pixel
    of its middle moved back by its radius."""
    low, high = position.min(axis=0), position.max(axis=0)
    whole = point_ids.WITHIN * np.linalg.norm(high - low) / 2
    middle = (position - (low + high) / 2) / whole @ view.T
    facing = normal @ view.T
    found = set()
    for row in range(PIXELS):
        for column in range(PIXELS):
            at = (np.array([column, row]) + 0.5) * 2 / PIXELS - 1
            nearest, which = -np.inf, None
            for disc, (center, n, r) in enumerate(zip(middle, facing, radius / whole, strict=True)):
                off = at - center[:2]
                height = center[2]
                if np.abs(off).max() > 1 / PIXELS:
                    rise = -(off @ n[:2]) / (max(abs(n[2]), 1e-3) * (1 if n[2] >= 0 else -1))
                    if off @ off + rise**2 > r**2:
                        continue
                    height += rise - r
                if height > nearest:
                    nearest, which = height, disc
            if which is not None:
                found.add(which)
    return found


def test_discs_are_seen_as_pixel_by_pixel() -> None:
    rng = generator(0, "discs")
    position, normal = rng.uniform(-1, 1, (30, 3)), unit(rng.normal(size=(30, 3)))
    radius = rng.uniform(0.0, 0.8, 30)
    views = axes((1, 2, 3), (-1, -0.2, 0.4))
    each = [one_by_one(position, normal, radius, view) for view in views]
    for view, expected in zip(views, each, strict=True):
        seen = seen_discs(position, normal, radius, view[None], PIXELS)
        assert set(np.flatnonzero(seen)) == expected
    together = seen_discs(position, normal, radius, views, PIXELS)
    assert set(np.flatnonzero(together)) == each[0] | each[1], "from any of them"
    assert len(each[0]) < 30, "some are hidden"


def test_a_disc_behind_another_is_hidden_and_one_on_the_same_plane_is_not() -> None:
    """From above: a wide one, a small one below it, one on it beside its middle, and a copy of
    that."""
    position = np.array([[0.0, 1, 0], [0.1, 0, 0.1], [0.15, 1, 0.15], [0.15, 1, 0.15]])
    radius, normal = np.array([0.25, 0.05, 0.05, 0.05]), np.tile([0.0, 1.0, 0.0], (4, 1))
    seen = seen_discs(position, normal, radius, axes((0, 1, 0)), PIXELS)
    assert seen.tolist() == [True, False, True, False]


def test_what_is_smaller_than_a_pixel_is_seen_all_the_same() -> None:
    """And from its edge; one alone fills no volume; of none, none is."""
    flat = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0]])
    edge_on = np.tile([0.0, 1.0, 0.0], (3, 1))
    assert seen_discs(flat, edge_on, np.zeros(3), axes((0, 0, 1)), PIXELS).all()
    assert seen_discs(flat[:1], edge_on[:1], np.zeros(1), axes((1, 1, 1)), PIXELS).all()
    assert seen_discs(flat[:0], edge_on[:0], np.zeros(0), axes((1, 1, 1)), PIXELS).shape == (0,)


def test_no_more_than_can_be_numbered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(point_ids, "MOST", 2)
    with pytest.raises(ValueError, match="fewer than 2"):
        seen_discs(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2), axes((0, 0, 1)), PIXELS)
