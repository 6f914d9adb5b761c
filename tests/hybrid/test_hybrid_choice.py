"""What a hybrid starts with, what of its steps is kept, and where hybrids are what is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hybrid_cases import LEAF, ball, mesh, together
from surfaces import grid_faces

from vegtool.convert import ConvertOptions, budget_notes, convert
from vegtool.gl.upload import PlantBuffers
from vegtool.hybrid.budget import Tried, least_fill, within
from vegtool.hybrid.cloud import cloud_of
from vegtool.hybrid.greedy import descent
from vegtool.hybrid.level import hybrid_level
from vegtool.hybrid.options import Budget, Weights
from vegtool.hybrid.or_refined import mesh_holds
from vegtool.hybrid.reduction import border_lengths
from vegtool.hybrid.start import begun, filling, per_billboard, started
from vegtool.lod import Display, Level
from vegtool.measure.chain import views_of
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import TruthsAt, scores
from vegtool.plant import Material, Plant
from vegtool.refine.level import Source, Wanted, source_of

OFF = MeasureOptions(measure="off")


def cards(count: int, material: Material = LEAF, side: float = 0.3) -> Plant:
    """Squares all around, each turned its own way."""
    random = np.random.default_rng(3)
    center = random.uniform(-1, 1, (count, 3))
    u, v = np.linalg.qr(random.normal(size=(count, 3, 2)))[0].swapaxes(1, 2).swapaxes(0, 1)
    corners = [center + side * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(count)[:, None, None]
    return mesh(np.stack(corners, axis=1).reshape(-1, 3), faces, material)


def source(plant: Plant, buffers: PlantBuffers) -> Source:
    return source_of(buffers, TruthsAt(plant, views_of(MeasureOptions()), Display(), buffers))


def test_all_that_leaves_may_err_more_than_nothing_that_does() -> None:
    """Sixty small cards on twelve planes, 24 triangles: with a little less weight of polygons all
    leave, with a little more all leave and vanish. What is kept is the start."""
    plant = cards(60, replace(LEAF, alpha_mode="opaque"), 0.05)
    start = begun(cloud_of(plant, 12), Weights())
    found = within(start, Budget(30))
    assert found.triangles <= 30
    assert found.terms.error <= start.terms.error
    ends = []
    for polygons in np.geomspace(1e-3, 1e3, 13):
        now = start.again(Weights(1.0, polygons, 1e-3))
        for _ in descent(now):
            pass
        ends.append(now)
    fitting = [now.terms.error for now in ends if now.triangles <= 30]
    assert found.terms.error <= min(fitting)


def test_a_step_that_is_kept_is_not_changed_by_later_ones() -> None:
    start = begun(cloud_of(ball(), 8), Weights(1.0, 0.1, 0.1))
    kept, told = [], []
    now = start.again(start.weights)
    for _ in descent(now):
        kept.append(now.copy())
        told.append((now.triangles, now.terms, now.in_mesh.sum()))
    assert len(kept) > 1
    assert [(one.triangles, one.terms, one.in_mesh.sum()) for one in kept] == told


def test_what_is_left_of_a_budget_is_spent() -> None:
    """Two balls, of which one weight takes both or neither: with triangles for one and a half, the
    half is used too."""
    plant = together(ball(), ball((3.0, 0.0, 0.0)))
    start = begun(cloud_of(plant, 8), Weights())
    errors = []
    for triangles in (40, 60, 80, 100, 120):
        tried = Tried(start, Budget(triangles), cheap=False)
        tried.at_fill(1e-3)
        before = tried.best.terms.error
        found = tried.spent(1e-3)
        assert found.triangles <= triangles and found.terms.error <= before
        errors.append(found.terms.error)
    assert errors == sorted(errors, reverse=True)
    assert found.terms.polygons * len(plant.faces) == pytest.approx(found.triangles)


def test_a_budget_that_is_exceeded_is_told() -> None:
    level = Level("mesh", mesh=ball())
    options = ConvertOptions(method="hybrid", triangles=level.triangles - 1)
    (note,) = budget_notes([level], options)
    assert note.startswith("LOD1: no hybrid was found of ")
    assert not budget_notes([level], replace(options, triangles=level.triangles))
    assert not budget_notes([level], ConvertOptions())


def test_what_fits_is_better_than_what_does_not() -> None:
    start = begun(cloud_of(ball(), 8), Weights())
    tried = Tried(start, Budget(10, 0.5), cheap=False)
    assert tried.merit(start)[0] == start.triangles - 10
    assert tried.merit(start)[1] == pytest.approx(start.terms.fill - 0.5)


@pytest.mark.gl
@pytest.mark.parametrize(("double_sided", "triangles"), [(True, 2), (False, 4)])
def test_billboards_whose_sides_differ_count_twice(double_sided: bool, triangles: int) -> None:
    """Of cards that are seen from one side alone, the other side of a billboard is empty."""
    plant = cards(40, replace(LEAF, double_sided=double_sided))
    with PlantBuffers(plant) as buffers:
        own = source(plant, buffers)
        assert per_billboard(own, cloud_of(plant, 8)) == triangles
        start = started(own, 64, Budget(64))
        assert start.per_billboard == triangles
        assert start.triangles <= 32, "half of the budget: billboards"


def test_no_more_billboards_than_fill_allows() -> None:
    """Cards fill more on many planes than on few, and none of them may leave."""
    plant = cards(300, side=0.1)
    start = begun(cloud_of(plant, 100), Weights())
    allowed = 0.5 * least_fill(start)
    fewer = filling(start, 100, allowed)
    assert len(fewer.pairs) < len(start.pairs)
    assert 0.8 * allowed <= least_fill(fewer) <= allowed
    assert filling(start, 100, least_fill(start)) is start
    assert len(filling(start, 100, 0.0).pairs) < len(start.pairs), "as near as it comes"


def test_least_fill_is_of_what_stays() -> None:
    plant = together(ball(), cards(10))
    start = begun(cloud_of(plant, 16), Weights())
    assert least_fill(start) < start.terms.fill
    assert least_fill(begun(cloud_of(ball(), 8), Weights())) == 0.0


def test_open_edges_and_no_others_are_borders() -> None:
    """A square of 2 x 2 cells has a border of 8, half of two edges for each of 8 vertices."""
    positions = np.stack(np.mgrid[:3, :3], axis=-1).reshape(-1, 2)
    positions = np.concatenate([positions, np.zeros((9, 1))], axis=1)
    length = border_lengths(grid_faces(2, 2), positions.astype(np.float64))
    assert length.sum() == pytest.approx(8.0)
    assert length[4] == 0 and (np.delete(length, 4) == 1.0).all()


def test_open_ground_goes_below_the_triangles_of_its_border() -> None:
    """A flat square of 20 x 20 cells has 80 edges around it: two triangles show it as well."""
    row, column = (axis.ravel() for axis in np.mgrid[:21, :21])
    ground = mesh(np.stack([column, 0 * row, row], axis=1), grid_faces(20, 20)[:, ::-1])
    start = begun(cloud_of(ground, 1), Weights())
    found = start.part(np.arange(len(ground.faces)))
    assert found.terms.polygons * len(ground.faces) <= 40
    assert found.terms.error < 1e-3


@pytest.mark.parametrize(
    ("plant", "triangles", "holds"),
    [
        (ball(), 4, True),
        (ball(), 3, False),
        (cards(60, replace(LEAF, alpha_mode="opaque")), 239, False),
        (cards(60, replace(LEAF, alpha_mode="opaque")), 240, True),
        (together(ball(), cards(1)), 1000, False),
    ],
    ids=["a ball", "less than a body needs", "many bodies", "as many as they need", "cut out"],
)
def test_what_a_mesh_holds(plant: Plant, triangles: int, holds: bool) -> None:
    assert mesh_holds(plant, triangles) == holds


@pytest.mark.gl
def test_a_ball_becomes_a_mesh_unasked() -> None:
    """By what is measured: a ball on sixteen planes is full of cracks."""
    options = ConvertOptions(billboards=32, levels=1, pixels=48.0)
    level = convert(ball(rows=8, columns=12), options, OFF).levels[1]
    assert level.mesh is not None and level.triangles <= 64


@pytest.mark.gl
def test_pictures_and_patches_are_kept_where_they_help() -> None:
    """A ball of one colour, all of its triangles allowed: pictures of itself show it no better."""
    plant = ball(rows=8, columns=12)
    plant = replace(plant, normals=plant.positions)
    with PlantBuffers(plant) as buffers:
        own = source(plant, buffers)
        near_m = 12.0
        whole = hybrid_level(own, Wanted(400, near_m), Budget(400))
        assert whole.texels == 0 and whole.charts is None
        fewer = hybrid_level(own, Wanted(60, near_m), Budget(60))
        assert fewer.triangles <= 60
        errs = [float(scores(own.truth_at(near_m), one).values["flip"].mean())
                for one in (whole, fewer)]  # fmt: skip
        assert errs[0] < errs[1] < 0.2


@pytest.mark.gl
def test_patches_keep_to_the_budget() -> None:
    """Two triangles are one billboard: planes that patch its cracks would be two or three."""
    plant = cards(40, replace(LEAF, alpha_mode="opaque"), 0.1)
    with PlantBuffers(plant) as buffers:
        level = hybrid_level(source(plant, buffers), Wanted(2, 12.0), Budget(2))
        assert level.triangles == 2
