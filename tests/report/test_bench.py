"""What is measured of a row, on a small plant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from hybrids import hybrid_of
from PIL import Image

from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lod import Level
from vegtool.measure.bounds import distance_for_pixels
from vegtool.measure.scores import scores
from vegtool.plant import Plant
from vegtool.progress import silent
from vegtool.report.bench import Bench, measured, set_up
from vegtool.report.entries import Entry, Made, entries
from vegtool.report.options import ReportOptions
from vegtool.report.pictures import SIZES, of_truth, sizes_of
from vegtool.report.rows import PlantReport, Report, Row
from vegtool.report.run import _Clock, _digest, _with_distances, misses

pytestmark = pytest.mark.gl
OPTIONS = ReportOptions(methods="refined,kmeans", budgets="4,30", view_count=2)


@pytest.fixture(scope="module")
def plant() -> Plant:
    return sample("bush", 500)


@pytest.fixture(scope="module")
def bench(plant: Plant) -> Iterator[Bench]:
    with PlantBuffers(plant) as buffers:
        yield set_up(buffers, OPTIONS)


@pytest.fixture(scope="module")
def made(bench: Bench) -> dict[str, tuple[Row, Any]]:
    """Rows and pictures that need nothing installed."""
    todo = [e for e in entries(OPTIONS) if e.family in ("live", "refined", "kmeans", "octahedral")]
    return {e.name: measured(bench, e, sizes_of(e, todo)) for e in todo}


def entry(name: str) -> Entry:
    return next(e for e in entries(OPTIONS) if e.name == name)


def test_the_row_is_what_measuring_by_hand_gives(
    bench: Bench, made: dict[str, tuple[Row, Any]]
) -> None:
    level = entry("kmeans 30").make(bench.buffers, bench.truth_at, silent).shown
    assert isinstance(level, Level)
    row, _ = made["kmeans 30"]
    found = scores(bench.truths, level)
    for metric, values in found.values.items():
        np.testing.assert_array_equal(np.array(row.values[metric]), values)
    assert row.cost.triangles == level.triangles
    assert row.cost.texels == level.texels
    assert row.cost.bytes == len(level_glb(level, "level"))
    assert set(row.cost.seconds) == {"plant", *level.seconds}
    assert row.cost.frame.frames >= 30
    assert row.distance_m == tuple(bench.truths.distance_m)


def test_refined_rows_keep_to_their_budgets(made: dict[str, tuple[Row, Any]]) -> None:
    """In triangles, two for each billboard; and what they are made by takes its time."""
    for budget in (4, 30):
        row, _ = made[f"refined {budget}"]
        assert (row.family, row.budget) == ("refined", budget)
        assert 0 < row.cost.triangles <= 2 * budget
        assert {"plant", "planes"} <= set(row.cost.seconds)


def test_bounds_are_of_billboards_and_fall_with_distance(made: dict[str, tuple[Row, Any]]) -> None:
    """The farther the smaller; e_p is never more than what bounds it."""
    row, _ = made["kmeans 30"]
    projection, bound = np.array(row.projection_px), np.array(row.bound_px)
    assert (np.diff(projection) < 0).all()
    assert (projection <= bound * (1 + 1e-9)).all()
    assert row.within_pixels_from_m is not None
    live, _ = made["live"]
    assert live.projection_px == ()
    assert live.within_pixels_from_m == 0.0


def test_a_hybrid_has_the_bounds_of_its_billboards_and_its_mesh(bench: Bench) -> None:
    """Its distance is that of the worse part; without an error of the mesh there is none."""
    level = hybrid_of(bench.plant, 30, 40.0)
    for error, known in (((0.5, 0.1), True), (None, False)):
        given = replace(level, geometric_error_m=error)
        made = Made(given, given.triangles, given.texels, dict)
        entry = Entry("hybrid 30", "hybrid", 30, None, lambda *_, made=made: made)
        row, _ = measured(bench, entry, ())
        assert row.cost.triangles == level.triangles
        assert bool(row.bound_px) == known
        if known:
            assert row.within_pixels_from_m == distance_for_pixels(
                given, bench.plant.center, OPTIONS.display, 1.0
            )
        else:
            assert row.within_pixels_from_m is None


def test_an_impostor_counts_with_all_its_frames(made: dict[str, tuple[Row, Any]]) -> None:
    row, _ = made["octahedral"]
    assert (row.cost.triangles, row.cost.texels) == (2, 2 * 2048**2)
    assert row.cost.bytes is None, "no file holds one"
    assert row.bake_seconds > 0


def test_pictures_of_all_rows_lie_on_each_other(
    bench: Bench, made: dict[str, tuple[Row, Any]]
) -> None:
    truth = of_truth(bench.scene)
    assert set(truth) == set(SIZES)
    for _, pictures in made.values():
        for size, images in pictures.items():
            sides = {Image.open(BytesIO(data)).size for data in (*truth[size], *images)}
            assert len(sides) == 1
            assert 0.7 * size <= max(sides.pop()) <= 1.5 * size


def test_each_family_stands_at_each_size_once() -> None:
    todo = entries(OPTIONS)
    for family in {e.family for e in todo}:
        shown = [size for e in todo if e.family == family for size in sizes_of(e, todo)]
        assert sorted(shown) == sorted(SIZES)


def chain(made: dict[str, tuple[Row, Any]]) -> list[Row]:
    """Live errs 0.2 everywhere; by error 30 billboards suffice from 20 m on, 4 from 80 m on."""

    def erring(name: str, *flips: float) -> Row:
        row, _ = made[name]
        values = {**row.values, "flip": tuple((f, f) for f in flips)}
        distances = (10.0, 20.0, 40.0, 80.0, 160.0)
        bare = replace(row, texels_per_metre=0.0, made_for_pixels=None)
        return replace(bare, distance_m=distances, values=values)

    return [
        erring("live", 0.2, 0.2, 0.2, 0.2, 0.2),
        erring("kmeans 30", 0.3, 0.2, 0.1, 0.1, 0.3),
        erring("kmeans 4", 0.3, 0.3, 0.3, 0.2, 0.1),
        erring("octahedral", 0.3, 0.3, 0.3, 0.3, 0.3),
    ]


def test_rows_of_a_family_are_one_chain(made: dict[str, tuple[Row, Any]]) -> None:
    """What errs far away may be used near by, where a coarser one follows."""
    live, finer, coarser, impostor = _with_distances(chain(made), OPTIONS)
    assert live.switch_distance_m == 0.0
    assert finer.switch_distance_m == pytest.approx(20.0, rel=0.01)
    assert coarser.switch_distance_m == pytest.approx(80.0, rel=0.01)
    assert impostor.switch_distance_m is None
    assert impostor.why_not


def test_coarse_texels_and_displacement_move_distances_away(
    made: dict[str, tuple[Row, Any]],
) -> None:
    live, finer, coarser, impostor = chain(made)
    coarse = OPTIONS.display.pixels_per_metre(30.0)  # a texel covers a pixel from 30 m on
    rows = [live, replace(finer, texels_per_metre=coarse), coarser, impostor]
    assert _with_distances(rows, OPTIONS)[1].switch_distance_m == pytest.approx(30.0, rel=0.01)
    limited = replace(OPTIONS, max_pixels=1.0)
    bounded = [replace(row, within_pixels_from_m=40.0) for row in rows[:3]]
    found = _with_distances([*bounded, impostor], limited)
    assert found[1].switch_distance_m == pytest.approx(40.0, rel=0.01)
    assert found[3].why_not == "how far it displaces things is not known"


def test_a_level_without_texels_starts_where_it_was_made_for(
    made: dict[str, tuple[Row, Any]],
) -> None:
    """30 billboards suffice from 20 m on, where the plant is half as high as at 10 m."""
    live, finer, *_ = chain(made)
    mesh = replace(finer, family="refined", made_for_pixels=finer.pixels[0] / 3)
    assert _with_distances([live, mesh], OPTIONS)[1].switch_distance_m is None, "errs at 160 m"
    right = replace(mesh, values=live.values)
    found = _with_distances([live, right], OPTIONS)[1].switch_distance_m
    assert found == pytest.approx(30.0, rel=0.01)


def test_a_limit_is_checked_from_views_that_distances_were_not_chosen_by(
    plant: Plant, made: dict[str, tuple[Row, Any]]
) -> None:
    """Other views err by 0.15 where the row starts, halfway between 0.1 and 0.2 at two sizes."""
    row = made["kmeans 30"][0]
    near, far = row.distance_m[:2]
    at = replace(row, held_out=(0.1, 0.2, 0, 0, 0), switch_distance_m=float(np.sqrt(near * far)))
    nowhere = replace(at, switch_distance_m=None)
    about = PlantReport("bush", "bush.glb", 500, plant.extent, (), (at, nowhere))
    found = {
        limit: misses(Report((about,), {"max_error": limit}, "", "")) for limit in (0.12, 0.14)
    }
    assert not found[0.14], "0.15 is within 0.02 of it"
    (sentence,) = found[0.12]
    assert "bush: kmeans 30 from" in sentence
    assert "found 0.150: 0.030 more" in sentence


def test_other_views_are_measured_where_a_limit_is_to_be_checked(plant: Plant) -> None:
    """Of a level that is the original itself, they err as little as the first ones do."""
    options = replace(OPTIONS, max_error=0.2)
    with PlantBuffers(plant) as buffers:
        row, _ = measured(set_up(buffers, options), entry("live"), ())
    assert len(row.held_out) == len(row.pixels)
    assert row.held_out != tuple(row.mean("flip"))
    np.testing.assert_allclose(row.held_out, row.mean("flip"), atol=0.05)


def test_a_digest_is_of_what_can_be_seen(plant: Plant) -> None:
    material = plant.materials[0]
    assert material.color_texture is not None
    pixels = np.array(material.color_texture.pixels)
    pixels[0, 0, 0] ^= 1
    other = replace(material, color_texture=replace(material.color_texture, pixels=pixels))
    painted = replace(plant, materials=(other, *plant.materials[1:]))
    moved = replace(plant, positions=plant.positions + 1e-9)
    duller = replace(plant, materials=(replace(material, roughness=0.1), *plant.materials[1:]))
    assert _digest(replace(plant, source="elsewhere.glb")) == _digest(plant)
    assert len({_digest(p) for p in (plant, painted, moved, duller)}) == 4


def test_progress_rises_to_one_whatever_is_skipped() -> None:
    said: list[float] = []
    clock = _Clock(lambda stage, fraction: said.append(fraction), 4.0)
    clock.skip(2.0)
    for _ in range(2):
        with clock.work("row", 1.0) as progress:
            progress("making", 0.0)
            progress("measuring", 0.5)
            progress("done", 1.0)
    assert said == [0.0, 0.25, 0.5, 0.5, 0.75, 1.0]


def test_the_time_that_is_left_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal cuts the end off. Half of the work took 6 s, then 200 s."""
    clock = iter((0.0, 0.0, 6.0, 200.0))
    monkeypatch.setattr("vegtool.report.run.monotonic", lambda: next(clock))
    said: list[str] = []
    with _Clock(lambda stage, fraction: said.append(stage), 1.0).work("oak: row", 1.0) as progress:
        for _ in range(3):
            progress("measuring", 0.5)
    whole = "oak: row: measuring"
    assert said == [whole, f"6 s left, {whole}", f"3 min left, {whole}"]
