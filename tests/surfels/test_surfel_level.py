"""Levels out of a hierarchy: everything is shown once, within the error, and within the budget."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, convert
from vegtool.errors import UsageError
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lod import Display, Level
from vegtool.measure.chain import views_of
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import TruthsAt, scores
from vegtool.measure.views import around
from vegtool.refine.level import Wanted, source_of
from vegtool.surfels.base import base_of
from vegtool.surfels.cuts import coarsest
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.level import SurfelSource, cut, least_error, surfel_level
from vegtool.surfels.make import surfel_model
from vegtool.surfels.pictures import pictured
from vegtool.surfels.store import read_surfels
from vegtool.surfels.validity import spread

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module", params=["statue", "broadleaf"])
def made_from(request: pytest.FixtureRequest) -> Iterator[SurfelSource]:
    plant = sample(request.param, 4000)
    with PlantBuffers(plant) as buffers:
        truth_at = TruthsAt(plant, views_of(MeasureOptions()), Display(), buffers)
        yield SurfelSource(source_of(buffers, truth_at), surfel_model(plant))


def test_a_cut_shows_every_patch_once_and_keeps_to_its_error(made_from: SurfelSource) -> None:
    model = made_from.model
    mt, one = model.triangles, model.hierarchy
    source = np.flatnonzero(coarsest(mt))
    reach = float(one.error.max()) / spread(one.theta)
    seen = set()
    for delta in [0.0, *np.geomspace(1e-4 * reach, 1.01 * reach, 12)]:
        chosen = cut(model, delta)
        shown = np.unique(chosen.by[chosen.by >= 0])
        assert (one.error[shown] <= delta * spread(one.theta)).all()
        assert (one.boxes.half[shown, 2] <= delta * (1 + 1e-12)).all(), "from any direction"
        ways = (chosen.by >= 0).astype(int)
        ways[chosen.alone] += 1
        ways += chosen.arcs[source]
        assert (ways <= 1).all(), "no patch twice"
        finer = chosen.arcs & ~coarsest(mt)
        assert (mt.error[mt.end[chosen.arcs]] <= delta).all()
        if not finer.any():
            assert (ways == 1).all(), "and none missing"
        seen.add((bool(finer.any()), len(shown) > 0))
    assert (False, True) in seen


def test_the_least_error_of_a_budget_spends_it(made_from: SurfelSource) -> None:
    model = made_from.model
    for most in (10, 100, 1000):
        error = least_error(model, most)
        assert cut(model, error).triangles(model.triangles.sizes, 2) <= most
        less = cut(model, np.nextafter(error, 0)).triangles(model.triangles.sizes, 2)
        assert less > 0.97 * most, "counts fall as errors rise, nearly always"


def test_errors_are_of_epsilon_from_where_the_plant_begins(made_from: SurfelSource) -> None:
    """Of what is nearest to the eye; which is how far a budget's errors are from."""
    model = made_from.model
    begins = 3 * model.plant.radius
    seen = made_from.allowed_m(begins) * Display().pixels_per_metre(begins - model.plant.radius)
    assert seen == pytest.approx(model.options.epsilon)
    assert made_from.allowed_m(model.plant.radius / 2) == 0, "from inside"
    error = least_error(model, 300)
    assert made_from.allowed_m(made_from.nearest_m(300)) == pytest.approx(error)


def test_what_alpha_cuts_out_is_off_by_what_it_was_simplified_by(made_from: SurfelSource) -> None:
    """It has no mesh: its patches stand as they are at the coarsest, whatever is allowed."""
    model = made_from.model
    plant = model.plant
    masked = tuple(replace(material, alpha_mode="mask") for material in plant.materials)
    mt = replace(model.triangles, plant=replace(plant, materials=masked))
    chosen = cut(replace(model, triangles=mt), 0.0)
    assert len(chosen.alone) == len(model.hierarchy.above) and not chosen.arcs.any()
    assert chosen.error == base_of(mt).error.max()


def test_a_level_is_off_by_its_triangles_too(
    made_from: SurfelSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Billboards are measured against the coarsest triangles, these against the original."""
    monkeypatch.setattr("vegtool.surfels.level.geometric_error", lambda *of: (0.5, 0.2))
    model = made_from.model
    wanted = Wanted(10_000, 60 * model.plant.radius)
    off = cut(model, made_from.allowed_m(wanted.near_m)).error
    level = surfel_level(made_from, wanted)
    assert level.geometric_error_m == pytest.approx((0.5 + off, 0.2 + off))
    assert (off > 0) == (model.plant.name == "statue"), "leaves on cards cannot be simplified"


@pytest.mark.parametrize("sided", [False, True])
def test_a_mesh_is_seen_from_where_its_plant_is(made_from: SurfelSource, sided: bool) -> None:
    model = made_from.model
    plant = model.plant
    materials = tuple(
        replace(each, double_sided=sided, alpha_mode="opaque") for each in plant.materials
    )
    mt = replace(model.triangles, plant=replace(plant, materials=materials))
    like = SurfelSource(made_from.source, replace(model, triangles=mt))
    level = surfel_level(like, Wanted(1_500, 20 * plant.radius))
    assert level.mesh is not None
    assert [each.double_sided for each in level.mesh.materials] == [sided]


def test_of_two_alphas_the_better_one_stays(
    made_from: SurfelSource, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = Wanted(200, Display().distance_m(60 / made_from.model.plant.extent))
    usual = surfel_level(made_from, wanted)

    def gone(source: object, wanted: object, level: Level, *rest: object) -> Level:
        assert level.atlas is not None
        return replace(level, atlas=replace(level.atlas, color=0 * level.atlas.color))

    monkeypatch.setattr("vegtool.surfels.level.as_measured", gone)
    left = surfel_level(made_from, wanted)
    assert left.atlas is not None and left.atlas.color[..., 3].any()
    assert left.triangles == usual.triangles


def test_levels_keep_to_their_budget_and_look_like_the_plant(made_from: SurfelSource) -> None:
    plant = made_from.model.plant
    near_m = Display().distance_m(60 / plant.extent)
    errs = []
    for most in (100, 400):
        level = surfel_level(made_from, Wanted(most, near_m))
        assert 0 < level.triangles <= most
        truth = made_from.source.truth_at(near_m)
        errs.append(float(scores(truth, level).values["flip"].mean()))
        assert level.geometric_error_m is not None and level.geometric_error_m[0] < plant.radius
    assert errs[1] < errs[0] < 0.2


def test_a_chain_has_distances_by_its_budget() -> None:
    """Each level has half the billboards, from where these are enough for a pixel; with a size on
    the screen, as many as that size asks for."""
    plant, off = sample("statue", 3000), MeasureOptions(measure="off")
    chain = convert(plant, ConvertOptions(method="surfel-billboards", levels=3), off)
    near = [level.near_distance_m for level in chain.levels[1:]]
    assert all(b > a for a, b in pairwise(near)) and list(chain.beside) == [".surfels"]
    assert (np.array([level.triangles for level in chain.levels[1:]]) <= [1024, 512, 256]).all()
    sized = convert(plant, ConvertOptions(method="surfel-billboards", levels=2, pixels=40.0), off)
    assert sized.levels[1].near_distance_m == pytest.approx(
        Display().distance_m(40 / plant.extent), rel=0.01
    )


def test_light_that_is_baked_stays_in_the_levels(tmp_path: Path) -> None:
    """Of the native file billboards have none, so triangles must not: both are as bright."""
    plant, off = sample("statue", 1500), MeasureOptions(measure="off")
    options = ConvertOptions(method="surfel-billboards", levels=1, occlusion=1.0)
    chain = convert(plant, options, off)
    assert "light that is baked is in the levels, not in statue.surfels" in chain.notes
    assert chain.levels[0].mesh is not None and chain.levels[0].mesh.exposure is not None
    file = tmp_path / "statue.surfels"
    file.write_bytes(chain.beside[".surfels"])
    model = read_surfels(file)
    assert model.plant.exposure is None
    bright = []
    with SurfelBuffers(drawn_data(model)) as surfels:
        for radii in (3.0, 40.0):
            away = radii * plant.radius
            camera = around(plant.positions, np.array([1.0, 0, 1]), away, Display())
            seen = pictured(surfels, model, camera)
            bright.append(float(seen[..., :3].sum() / seen[..., 3].sum()))
    assert bright[1] == pytest.approx(bright[0], rel=0.06)


def test_options_of_other_methods_are_refused() -> None:
    with pytest.raises(UsageError, match="--theta: is of another method alone; add --method surf"):
        ConvertOptions(theta=0.3)
    with pytest.raises(UsageError, match="--fill: is of another method alone; add --method hybrid"):
        ConvertOptions(method="surfel-billboards", fill=0.1)
    with pytest.raises(UsageError, match="--method surfel-billboards: goes with --refine full"):
        ConvertOptions(method="surfel-billboards", refine="none")
