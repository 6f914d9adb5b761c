"""All steps together: what keeps to a limit of memory, and how."""

from __future__ import annotations

from itertools import pairwise

import pytest

from vegtool.errors import UsageError
from vegtool.growth import sample
from vegtool.surfels.bake import BYTES_PER_TEXEL
from vegtool.surfels.make import surfel_model
from vegtool.surfels.options import MEGABYTE, SurfelOptions

pytestmark = pytest.mark.gl


def test_less_memory_is_kept_to_by_beginning_farther_away() -> None:
    """No texel is larger than its billboard's error, whatever the memory: the picture stays."""
    plant = sample("statue", 4000)
    found = []
    for megabytes in (64.0, 0.2, 0.02, 0.001):
        model = surfel_model(plant, SurfelOptions(max_texture_memory=megabytes))
        one, taken = model.hierarchy, BYTES_PER_TEXEL * model.textures.atlas.texels
        assert taken <= megabytes * MEGABYTE
        size = 2 * one.boxes.half[:, :2] / model.texels
        assert (size <= one.error[:, None] * (1 + 1e-9)).all()
        assert bool(model.notes) == (megabytes < 64)
        found.append((one.least, len(one)))
    for (least, count), (larger, fewer) in pairwise(found):
        assert larger > least and 1 <= fewer <= count
    assert "textures of 0.001 MB are too small" in model.notes[0]
    assert "--max-texture-memory" in model.notes[0]


def test_an_atlas_too_small_begins_farther_away_too() -> None:
    plant = sample("statue", 2000)
    model = surfel_model(plant, max_texture=16)
    assert max(model.textures.atlas.color.shape[:2]) <= 16 and model.notes


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(UsageError, match=r"--theta: expected 0\.01 to 1"):
        surfel_model(sample("statue", 500), SurfelOptions(theta=0.0))
