"""Which rows a plant's report has, and how what they show is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from vegtool.baselines import BASELINES, baseline
from vegtool.convert import (
    SURFELS,
    TRIANGLES_PER_BILLBOARD,
    level_maker,
    near_pixels,
)
from vegtool.errors import CapabilityError
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Level
from vegtool.measure.scores import TruthsAt
from vegtool.measure.views import View, distance_of
from vegtool.progress import Progress
from vegtool.report.options import FAMILIES, SURFELS_PER_BILLBOARD, ReportOptions
from vegtool.report.rows import LIVE
from vegtool.timing import timed

Maker = Callable[[PlantBuffers, TruthsAt, Progress], "Made"]
"""From a plant's buffers, without mipmaps, and what it looks like: what an entry shows."""
Shown = Level | Callable[[View], Level]
"""A level, or the one that is shown in a view."""


@dataclass(frozen=True, eq=False)
class Made:
    """What an entry shows. triangles, texels: that a client holds. seconds: by stage of making it,
    asked once all of it was shown."""

    shown: Shown
    triangles: int
    texels: int
    seconds: Callable[[], Mapping[str, float]]


@dataclass(frozen=True)
class Entry:
    """A row to be: its name, unique within a plant; its family; the budget of billboards, or None.

    made_for_pixels: size on screen that it is made for, or None. make: raises CapabilityError where
    it cannot be made here.
    """

    name: str
    family: str
    budget: int | None
    made_for_pixels: float | None
    make: Maker


def entries(options: ReportOptions) -> list[Entry]:
    """The line to beat, then methods and baselines, each with its budgets, most first."""
    budgets = options.budget_counts[::-1]
    found = [Entry(LIVE, LIVE, None, None, _original)]
    for method in options.method_names:
        make = partial(_level, method, options)
        found += [_budgeted(method, budget, partial(make, budget)) for budget in budgets]
    for name, maker in BASELINES.items():
        if maker.budgeted:
            found += [_budgeted(name, b, partial(_baseline, name, b)) for b in budgets]
        else:
            found.append(Entry(name, name, None, None, partial(_baseline, name, 0)))
    return found


def _budgeted(family: str, budget: int, make: Maker) -> Entry:
    return Entry(f"{family} {budget}", family, budget, near_pixels(budget), make)


def _original(buffers: PlantBuffers, truth_at: TruthsAt, progress: Progress) -> Made:
    level = Level("mesh", mesh=buffers.plant, geometric_error_m=(0.0, 0.0))
    return Made(level, level.triangles, level.texels, dict)


def _level(
    family: str,
    options: ReportOptions,
    budget: int,
    buffers: PlantBuffers,
    truth_at: TruthsAt,
    progress: Progress,
) -> Made:
    """A level of a family, all that it needs made for it alone."""
    convert, count = FAMILIES[family], budget
    if convert.method == SURFELS:
        count = SURFELS_PER_BILLBOARD * budget
        convert = replace(convert, points=count)
    else:
        convert = replace(convert, billboards=budget)
    convert = replace(
        convert,
        fov=options.fov,
        image_height=options.image_height,
        seed=options.seed,
    )
    near_m = distance_of(buffers.plant, options.display, near_pixels(budget))
    seconds: dict[str, float] = {}
    with timed(seconds, "plant"):
        make = level_maker(buffers, truth_at, convert)
    level = make(count, near_m, progress)
    return Made(level, level.triangles, level.texels, lambda: {**seconds, **level.seconds})


def _baseline(
    name: str, budget: int, buffers: PlantBuffers, truth_at: TruthsAt, progress: Progress
) -> Made:
    progress(name, 0.0)
    found = baseline(buffers.plant, name, TRIANGLES_PER_BILLBOARD * budget)
    if found.level is None:
        raise CapabilityError(found.missing)
    return Made(found.level, found.triangles, found.texels, lambda: found.seconds)
