"""Alpha such that billboards cover what the plant covers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.measure.pictures import truth
from vegtool.measure.views import Camera, around, framed, views
from vegtool.surfels.coverage import MOST, covered_alike
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.options import SurfelOptions
from vegtool.surfels.pictures import pictured

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def statue() -> SurfelModel:
    return surfel_model(sample("statue", 3000))


def bias(model: SurfelModel, pixels: float) -> float:
    """Of what is covered, as a share, from views that nothing was solved by."""
    plant, found, wanted = model.plant, 0.0, 0.0
    away = model.display.distance_m(pixels / plant.extent)
    with PlantBuffers(plant) as original, SurfelBuffers(drawn_data(model)) as surfels:
        for view in views("all", 6, 0.5):
            camera = around(plant.positions, view.direction, away, model.display)
            wanted += float(truth(original, camera)[..., 3].sum())
            found += float(pictured(surfels, model, camera)[..., 3].sum())
    return found / wanted - 1


def thinned(model: SurfelModel) -> SurfelModel:
    """With a third of its alpha, so that hardly anything passes the test."""
    atlas = model.textures.atlas
    color = atlas.color.copy()
    color[..., 3] //= 3
    textures = replace(model.textures, atlas=replace(atlas, color=color))
    return replace(model, textures=textures)


def test_what_is_lost_to_the_test_is_won_back(statue: SurfelModel) -> None:
    thin = thinned(statue)
    solved = covered_alike(thin)
    for pixels in (60.0, 30.0):
        assert bias(thin, pixels) < -0.9
        assert abs(bias(solved, pixels)) < 0.06
        assert abs(bias(statue, pixels)) < 0.06


def test_alpha_only_grows_and_colours_stay(statue: SurfelModel) -> None:
    before = thinned(statue)
    after = covered_alike(before).textures.atlas
    old = before.textures.atlas
    assert (after.color[..., 3] >= old.color[..., 3]).all()
    assert (after.color[..., 3] <= np.ceil(MOST * old.color[..., 3].astype(float))).all()
    assert np.array_equal(after.color[..., :3], old.color[..., :3])
    assert np.array_equal(before.textures.atlas.color, thinned(statue).textures.atlas.color)


def test_backs_grow_as_their_fronts_do(statue: SurfelModel) -> None:
    before = thinned(statue)
    old, new = before.textures.atlas, covered_alike(before).textures.atlas
    own = np.flatnonzero((old.front != old.back).any(axis=1))
    assert len(own)
    for front, back in zip(old.front[own], old.back[own], strict=True):
        grown = [
            new.color[y : y + h, x : x + w, 3].max() / old.color[y : y + h, x : x + w, 3].max()
            for x, y, w, h in (front, back)
        ]
        assert min(grown) > 1.5, "a third of it was left"


def test_what_is_drawn_from_elsewhere_has_another_factor(statue: SurfelModel) -> None:
    """The finer half has lost its alpha: from near it is won back, and the coarser half, which lost
    nothing, stays as it is."""
    atlas, error = statue.textures.atlas, statue.hierarchy.error
    fine = error < 8 * error.min()
    assert 0 < fine.sum() < len(fine)
    color = atlas.color.copy()
    for x, y, w, h in np.concatenate([atlas.front[fine], atlas.back[fine]]):
        color[y : y + h, x : x + w, 3] = atlas.color[y : y + h, x : x + w, 3] // 3
    thin = replace(statue, textures=replace(statue.textures, atlas=replace(atlas, color=color)))
    solved = covered_alike(thin)
    pixels = 0.5 * statue.plant.extent / error.min()  # of twice where the finest are drawn first
    assert bias(thin, pixels) < -0.1 and abs(bias(solved, pixels)) < 0.06
    for x, y, w, h in atlas.front[error > 32 * error.min()]:
        before = color[y : y + h, x : x + w, 3].astype(float)
        assert (solved.textures.atlas.color[y : y + h, x : x + w, 3] <= 1.3 * before + 1).all()


def test_bands_are_seen_from_where_they_are_drawn_first(
    statue: SurfelModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error is so many pixels from the nearest point of the plant."""
    away = []

    def told(*where: Any) -> Camera:
        away.append(where[3])
        return framed(*where)

    monkeypatch.setattr("vegtool.surfels.coverage.framed", told)
    model = replace(statue, options=SurfelOptions(epsilon=0.25))
    covered_alike(model)
    begin = max(away) - model.plant.radius
    seen = model.hierarchy.error.max() * model.display.pixels_per_metre(begin)
    assert seen == pytest.approx(0.25)
