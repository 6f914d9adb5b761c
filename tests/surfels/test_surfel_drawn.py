"""Which billboards and triangles the shader draws: what the cut says, and each patch once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from surfel_cases import COARSE, ball

from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import (
    SURFEL_INSTANCE,
    Run,
    SurfelFrame,
    frame_of,
    instances,
    let_through,
    taken,
)
from vegtool.gl.surfel_data import SurfelData
from vegtool.gl.surfel_read import shown
from vegtool.growth import sample
from vegtool.surfels.cuts import by_image_error
from vegtool.surfels.drawn import drawn_data, heights
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.select import left_to_triangles, top_down

pytestmark = pytest.mark.gl
EYES = 340
"""Of each model: a thousand and more in all."""
DOUBT = 1e-4
"""Of epsilon: what is nearer than that to a threshold may be rounded to either side."""


@dataclass(frozen=True)
class Case:
    """A model, eyes (e, 3) in its unit, and what the shader lets through for each: (e, b) of the
    hierarchy's billboards, (e, a) of the arcs."""

    model: SurfelModel
    data: SurfelData
    pixels: float
    eyes: np.ndarray
    billboards: np.ndarray
    arcs: np.ndarray


@pytest.fixture(scope="module", params=["statue", "palm", "ball"])
def case(request: pytest.FixtureRequest) -> Case:
    if request.param == "ball":
        model = surfel_model(ball(4), display=COARSE)
    else:
        model = surfel_model(sample(request.param, 4000))
    data = drawn_data(model)
    random = np.random.default_rng(5)
    way = random.normal(size=(EYES, 3))
    away = np.exp(random.uniform(np.log(0.3), np.log(600.0), (EYES, 1)))
    eyes = away * way / np.linalg.norm(way, axis=1)[:, None]
    pixels = model.display.pixels_per_metre(1.0) / model.options.epsilon
    eyes[::2] = on_thresholds(data, pixels, eyes[::2])
    eyes = eyes.astype(np.float32)
    billboards = np.zeros((EYES, len(model.hierarchy)), bool)
    arcs = np.zeros((EYES, len(model.triangles.start)), bool)
    with SurfelBuffers(data) as buffers:
        billboards[:, data.billboards.number] = shown(buffers, data.billboards, eyes, pixels)
        for one in data.patches:
            arcs[:, one.arcs.number] = shown(buffers, one.arcs, eyes, pixels)
    return Case(model, data, pixels, eyes.astype(np.float64), billboards, arcs)


def on_thresholds(data: SurfelData, pixels: float, way: np.ndarray) -> np.ndarray:
    """(n, 3) eyes in directions (n, 3) from where a step is just taken, to a rounding or two; for
    every second one in the plane of a billboard, whose depth decides as well."""
    random = np.random.default_rng(8)
    steps = data.steps[np.isfinite(data.steps[:, 7]) & (data.steps[:, 3] >= 0)].astype(float)
    steps = steps[random.integers(len(steps), size=len(way))]
    way = way.copy()
    way[::2] = np.cross(steps[::2, 4:7] + 1e-30, way[::2])
    way /= np.linalg.norm(way, axis=1)[:, None]
    z = steps[:, 7] * pixels * (1 + 2.0**-23 * random.integers(-2, 3, len(way)))
    return np.asarray(steps[:, :3] + (steps[:, 3] + z)[:, None] * way)


def test_the_shader_draws_the_cut(case: Case) -> None:
    """Eq. 12 and 18 in double precision, by descent, but where rounding decides."""
    model, mt, one = case.model, case.model.triangles, case.model.hierarchy
    pc = model.display.pixels_per_metre(1.0)
    source = mt.start == len(mt.error) - 1
    mixed = 0
    for local, billboards, arcs in zip(case.eyes, case.billboards, case.arcs, strict=True):
        eye = model.plant.center + model.plant.radius * local
        found = []
        for epsilon in np.array([1.0, 1 - DOUBT, 1 + DOUBT]) * model.options.epsilon:
            drawn = top_down(one, eye, epsilon, pc)
            cut = by_image_error(mt, eye, pc, epsilon)
            cut[source] &= left_to_triangles(one, drawn)
            found.append(np.concatenate([np.isin(np.arange(len(one)), drawn), cut]))
        sure = (found[0] == found[1]) & (found[0] == found[2])
        assert np.array_equal(np.concatenate([billboards, arcs])[sure], found[0][sure])
        mixed += bool(billboards.any() and arcs.any())
    assert mixed > 10, "views with both"


def test_everything_is_drawn_once(case: Case) -> None:
    """On every way down, from the root over a patch to the original, lies one thing that is drawn:
    nothing is missing, nothing twice, whatever was rounded."""
    mt, one = case.model.triangles, case.model.hierarchy
    random = np.random.default_rng(3)
    first = np.searchsorted(mt.start, np.arange(len(mt.error) + 1))
    begin = int(first[len(mt.error) - 1])
    for patch in random.integers(len(one.above), size=150):
        met, at = np.zeros(len(case.eyes), int), one.above[patch]
        while at >= 0:
            met += case.billboards[:, at]
            at = one.father[at]
        arc = begin + int(patch)
        met += case.arcs[:, arc]
        while (node := int(mt.end[arc])) > 0:
            arc = int(random.integers(first[node], first[node + 1]))
            met += case.arcs[:, arc]
        assert (met == 1).all()


def test_arrays_say_the_same(case: Case) -> None:
    """`taken`, by which what is drawn is counted; but on thresholds, where rounding decides."""
    differ, rest = 0, slice(1, None, 2)
    for eye, billboards, arcs in zip(
        case.eyes[rest], case.billboards[rest], case.arcs[rest], strict=True
    ):
        steps = taken(case.data, eye, case.pixels)
        items = case.data.billboards
        differ += int((let_through(items, steps) != billboards[items.number]).sum())
        for one in case.data.patches:
            differ += int((let_through(one.arcs, steps) != arcs[one.arcs.number]).sum())
    assert differ <= 3


def test_no_run_leaves_out_what_is_drawn(case: Case) -> None:
    """Of all instances at once, as a frame has them; and from afar, few are in a run."""
    data = case.data
    rows = np.zeros(EYES, SURFEL_INSTANCE)
    rows["eye"] = case.eyes
    frame = frame_of(data, rows, case.pixels)
    with SurfelBuffers(data) as buffers:
        drawn = [shown(buffers, data.billboards, frame.rows["eye"], case.pixels)]
        drawn += [shown(buffers, one.arcs, frame.rows["eye"], case.pixels) for one in data.patches]
    for seen, runs in zip(drawn, (frame.billboards, *frame.patches), strict=True):
        room = np.zeros(EYES, int)
        for run in runs:
            assert (room[run.first : run.first + run.count] == 0).all(), "each instance once"
            room[run.first : run.first + run.count] = run.items
        last = seen.shape[1] - seen[:, ::-1].argmax(axis=1)
        assert (np.where(seen.any(axis=1), last, 0) <= room).all()
        assert len(runs) <= 2 + np.log2(seen.shape[1])
    far = np.linalg.norm(frame.rows["eye"], axis=1) > 300
    assert not any(run.first + run.count > np.argmax(far) for runs in frame.patches for run in runs)
    assert frame.billboards[0].first > 0, "from within, no billboard can be valid"


def test_steps_grow_in_single_precision(case: Case) -> None:
    """By more than a shader rounds, and by less than anyone sees."""
    data, model = case.data, case.model
    steps = data.steps
    for items in (data.billboards, *(one.arcs for one in data.patches)):
        has = (items.above >= 0) & np.isfinite(steps[items.above, 7])
        below, above = steps[items.below[has]], steps[items.above[has]]
        assert (above[:, 7] >= below[:, 7] * np.float32(1 + 2**-20)).all()
        apart = np.linalg.norm(above[:, :3].astype(float) - below[:, :3], axis=1)
        assert ((apart + below[:, 3] < above[:, 3] * (1 - 2**-20)) | (below[:, 3] < 0)).all()
    error = model.hierarchy.error[data.billboards.number] / model.plant.radius
    np.testing.assert_allclose(steps[: len(error), 7], error, rtol=DOUBT / 2)


def test_instances_see_the_eye_in_their_own_frame() -> None:
    """A plant that is turned, scaled and moved, and an eye moved with it."""
    model = surfel_model(ball(2, center=(3.0, 1.0, -2.0)), display=COARSE)
    data = drawn_data(model)
    eye, turn, scale = np.array([4.0, 2.0, 9.0]), 0.7, 2.5
    foot = np.array([-5.0, 0.5, 11.0])
    c, s = np.cos(turn), np.sin(turn)
    around = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])  # counter-clockwise from above
    here = instances(data, eye, np.zeros((1, 3)), np.zeros(1), np.ones(1))
    there = instances(
        data, foot + scale * around @ eye, foot[None], np.array([turn]), np.array([scale])
    )
    np.testing.assert_allclose(here["eye"], there["eye"], rtol=1e-6)
    np.testing.assert_allclose(there["place"][0, :3], scale * around @ here["place"][0, :3], 1e-6)
    assert there["place"][0, 3] == pytest.approx(2.5 * model.plant.radius)
    np.testing.assert_allclose(
        here["place"][0, :3], model.plant.center - eye, rtol=1e-6, err_msg="from the eye"
    )


def test_runs_are_few_and_fall() -> None:
    """Of distances from near to far, what is about as long is one call."""
    model = surfel_model(ball(3), display=COARSE)
    data = drawn_data(model)
    count = 200
    foot = np.zeros((count, 3))
    foot[:, 2] = -np.geomspace(2.0, 2000.0, count)
    order = np.random.default_rng(0).permutation(count)
    rows = instances(data, np.zeros(3), foot[order], np.zeros(count), np.ones(count))
    frame = frame_of(data, rows, COARSE.pixels_per_metre(1.0))
    assert isinstance(frame, SurfelFrame) and isinstance(frame.billboards[0], Run)
    assert (np.diff(np.linalg.norm(frame.rows["eye"], axis=1)) >= 0).all(), "nearest first"
    items = [run.items for run in frame.billboards]
    assert items == sorted(items, reverse=True) and len(items) <= 1 + np.log2(len(model.hierarchy))
    assert sum(run.count for run in frame.billboards) + frame.billboards[0].first == count


def test_how_high_above_the_lowest() -> None:
    assert heights(np.array([2, 2, 3, -1], np.int32)).tolist() == [0, 0, 1, 2]
