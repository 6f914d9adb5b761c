"""All steps together: what keeps to a limit of memory, and how."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from surfel_cases import surface

from vegtool.errors import UsageError
from vegtool.gl.surfel_data import TEXEL_BYTES
from vegtool.growth import sample
from vegtool.plant import Plant
from vegtool.surfels.make import surfel_model
from vegtool.surfels.options import MEGABYTE, SurfelOptions
from vegtool.surfels.select import left_to_triangles, top_down

pytestmark = pytest.mark.gl


def test_less_memory_is_kept_to_by_beginning_farther_away() -> None:
    """No texel is larger than its billboard's error, whatever the memory: the picture stays."""
    plant = sample("statue", 4000)
    found = []
    for megabytes in (32.0, 0.2, 0.02, 0.001):
        model = surfel_model(plant, SurfelOptions(max_texture_memory=megabytes))
        one, taken = model.hierarchy, TEXEL_BYTES * model.textures.atlas.texels
        assert taken <= megabytes * MEGABYTE
        if megabytes in (0.2, 0.02):
            assert taken > 0.5 * megabytes * MEGABYTE, "what is allowed is used"
        size = 2 * one.boxes.half[:, :2] / model.texels
        assert (size <= one.error[:, None] * (1 + 1e-9)).all()
        assert bool(model.notes) == (megabytes < 32)
        found.append((one.least, len(one)))
    for (least, count), (larger, fewer) in pairwise(found):
        assert larger > least and 1 <= fewer <= count
    assert "textures of 0.001 MB are too small" in model.notes[0]
    assert "--max-texture-memory" in model.notes[0]


def test_an_atlas_too_small_begins_farther_away_too() -> None:
    plant = sample("statue", 2000)
    model = surfel_model(plant, max_texture=16)
    assert max(model.textures.atlas.color.shape[:2]) <= 16
    assert "Allow more with --max-texture" in model.notes[0]
    assert "memory" not in model.notes[0]


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(UsageError, match=r"--theta: expected 0\.01 to 1"):
        surfel_model(sample("statue", 500), SurfelOptions(theta=0.0))


def soup(count: int) -> Plant:
    """Triangles that share nothing."""
    rng = np.random.default_rng(0)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, 0.05, (count, 3, 3))
    return surface(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


LINE = surface([[i / 8, 0, 0] for i in range(9)], [[i, i + 1, i + 2] for i in range(7)])
EXTREMES = {
    "soup": soup(300),
    "line": LINE,
    "triangle": surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "tiny": surface([[5, 5, 5], [5 + 1e-8, 5, 5], [5, 5 + 1e-8, 5]], [[0, 1, 2]]),
    "far": surface([[1e6, 0, 0], [1e6 + 1, 0, 0], [1e6, 1, 0]], [[0, 1, 2]]),
}
STIFF = (
    SurfelOptions(theta=0.25), SurfelOptions(theta=1.0), SurfelOptions(epsilon=0.01),
    SurfelOptions(epsilon=100.0), SurfelOptions(max_texture_memory=0.001),
)  # fmt: skip


@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_have_a_hierarchy_that_shows_all_from_afar(name: str) -> None:
    plant = EXTREMES[name]
    for options in STIFF:
        model = surfel_model(plant, options)
        one = model.hierarchy
        far = plant.center + np.array([0, 0, 1e7]) * plant.radius / options.epsilon
        drawn = top_down(one, far, options.epsilon, model.display.pixels_per_metre(1.0))
        assert len(drawn) == (one.father < 0).sum() >= 1, "the roots, and nothing else"
        assert not left_to_triangles(one, drawn).any()
        atlas = model.textures.atlas
        assert TEXEL_BYTES * atlas.texels <= options.max_texture_memory * MEGABYTE


def test_a_point_is_refused() -> None:
    point = surface(np.zeros((3, 3)), [[0, 1, 2]])
    with pytest.raises(UsageError, match="expected a plant with an extent, found none"):
        surfel_model(point)
