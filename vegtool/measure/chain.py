"""The levels of a plant, each with the distance from which it may be used and its error there.

Errors are measured at a few sizes on the screen, limits laid on them (distances.py), and every
level measured once more at the very distance that came of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import QualityError
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display, Level, Measured, Spread
from vegtool.measure.bounds import distance_for_pixels
from vegtool.measure.distances import LeftOut, limits, rounded_up, switch_distances
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant
from vegtool.measure.scores import LADDER, Scores, outside, scores, truths
from vegtool.measure.views import CLOSEST, View, views
from vegtool.plant import Plant
from vegtool.progress import Progress, silent


@dataclass(frozen=True)
class Effort:
    """How well levels are measured: from so many views, at these sizes on the screen (pixels)."""

    views: int
    pixels: tuple[float, ...]


EFFORTS = {
    "quick": Effort(6, LADDER),
    "full": Effort(12, tuple(LADDER[0] / 2 ** (i / 2) for i in range(9))),
}
SMALLEST = 3.0
"""Pixels. Where no level suffices at the usual sizes, smaller ones are tried down to this one."""
HELD_OUT_VIEWS, HELD_OUT_PHASE = 12, 0.5
"""Views and suns halfway between those that distances are chosen by."""
HELD_OUT_MARGIN = 0.02
"""FLIP by which a level may exceed the limit from views that its distance was not chosen by."""


def with_distances(
    plant: Plant,
    levels: Sequence[Level],
    options: MeasureOptions,
    display: Display,
    progress: Progress = silent,
) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """The levels that may be used somewhere, with `near_distance_m` and `measured`; and a sentence
    on each that was left out.

    levels: coarser and coarser, without the original. Raises QualityError where none keeps to
    `max_error` at any size, UsageError where no size is seen from outside the plant.
    """
    least_m = [0.0] * len(levels)
    if options.max_pixels is not None:
        pixels = options.max_pixels
        least_m = [distance_for_pixels(level, plant.center, display, pixels) for level in levels]
    if options.measure == "off":
        if options.max_pixels is None:
            return tuple(levels), ()
        return _by_bound(plant, levels, least_m)
    with ExitStack() as stack:
        return _by_error(_bench(stack, plant, levels, options, display), least_m, progress)


def misses(levels: Sequence[Level], options: MeasureOptions) -> list[str]:
    """A sentence on each level that exceeds `max_error` by more than HELD_OUT_MARGIN, from views
    and suns that were not used to choose its distance. levels: of a chain, with the original."""
    found = []
    for number, level in enumerate(levels):
        held_out = level.measured.held_out if level.measured else None
        if options.max_error is None or held_out is None:
            continue
        over = held_out.mean - options.max_error
        if over > HELD_OUT_MARGIN:
            found.append(
                f"LOD{number} from {level.near_distance_m:g} m on: expected an error of at most "
                f"{options.max_error:g} (FLIP, within {HELD_OUT_MARGIN:g}) from other views and "
                f"suns than its distance was chosen by, found {held_out.mean:.3f}: "
                f"{over:.3f} more"
            )
    return found


@dataclass(frozen=True, eq=False)
class _Bench:
    """What measuring needs again and again. sharp: the original without mipmaps, for the truth;
    drawn: the original, then the levels, as clients have them."""

    plant: Plant
    levels: tuple[Level, ...]
    options: MeasureOptions
    display: Display
    views: tuple[View, ...]
    sharp: PlantBuffers
    drawn: tuple[PlantBuffers, ...]


def _bench(
    stack: ExitStack,
    plant: Plant,
    levels: Sequence[Level],
    options: MeasureOptions,
    display: Display,
) -> _Bench:
    shown = views(options.views, EFFORTS[options.measure].views)
    meshes = [plant, *(client_plant(level) for level in levels)]
    sharp = stack.enter_context(PlantBuffers(plant))
    drawn = tuple(stack.enter_context(PlantBuffers(mesh, mipmaps=True)) for mesh in meshes)
    return _Bench(plant, tuple(levels), options, display, shown, sharp, drawn)


def _by_bound(
    plant: Plant, levels: Sequence[Level], least_m: Sequence[float]
) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """Distances by calculation alone."""
    nothing = np.zeros(1)
    near = np.array([CLOSEST * plant.radius])
    starts = switch_distances(near, [nothing] * len(levels), nothing, least_m)
    kept = [
        replace(level, near_distance_m=start)
        for level, start in zip(levels, starts, strict=True)
        if not isinstance(start, LeftOut)
    ]
    return tuple(kept), tuple(_notes(levels, starts))


def _by_error(
    bench: _Bench, least_m: Sequence[float], progress: Progress
) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """Distances by measured error, and no less than `least_m`."""
    options, levels = bench.options, bench.levels
    pixels, distance_m = outside(bench.plant, EFFORTS[options.measure].pixels, bench.display)
    flips = _flips(bench, pixels, progress)
    exact: dict[tuple[int, float], Measured] = {}

    def holds(level: int, distance_m: float) -> bool:
        found = exact[level, distance_m] = _measured(bench, level, distance_m)
        allowed = _limits(np.array([found.live["flip"].mean]), options)
        return bool(found.errors["flip"].mean <= allowed[0])

    while True:
        live, errors = flips[:, 0], flips[:, 1:].T
        starts = switch_distances(distance_m, list(errors), _limits(live, options), least_m, holds)
        if not all(isinstance(start, LeftOut) for start in starts) or pixels[-1] / 2 < SMALLEST:
            break
        farther = np.array([pixels[-1] / 2])
        flips = np.concatenate([flips, _flips(bench, farther, silent)])
        pixels = np.append(pixels, farther)
        distance_m = np.append(distance_m, 2 * distance_m[-1])
    notes = _notes(levels, starts)
    if all(isinstance(start, LeftOut) for start in starts):
        starts, notes = _despite(bench, pixels[-1], distance_m[-1], flips[-1])
    kept = []
    for index, (level, start) in enumerate(zip(levels, starts, strict=True)):
        if not isinstance(start, LeftOut):
            found = exact.get((index, start)) or _measured(bench, index, start)
            if options.max_error is not None:
                found = replace(found, held_out=_held_out(bench, index, start))
            kept.append(replace(level, near_distance_m=start, measured=found))
    return tuple(kept), tuple(notes)


def _flips(bench: _Bench, pixels: FloatArray, progress: Progress) -> FloatArray:
    """(d, 1 + l) mean FLIP of the live original and of each level, at each size."""
    rows = []
    done, total = 0.0, float((pixels**2).sum())
    for size in pixels:
        progress("measuring", done / total)
        found = _scores(bench, bench.views, size, range(len(bench.drawn)))
        rows.append([s.values["flip"].mean() for s in found])
        done += size**2
    return np.array(rows)


def _measured(bench: _Bench, level: int, distance_m: float) -> Measured:
    """The errors of a level at a distance, and those of the live original."""
    pixels = _pixels(bench, distance_m)
    live, found = (
        {name: s.spread(name, 0) for name in s.values}
        for s in _scores(bench, bench.views, pixels, (0, 1 + level))
    )
    return Measured(pixels, bench.options.views, len(bench.views), found, live)


def _held_out(bench: _Bench, level: int, distance_m: float) -> Spread:
    """FLIP of a level at a distance, from views and suns that it was not chosen by."""
    others = views(bench.options.views, HELD_OUT_VIEWS, HELD_OUT_PHASE)
    (found,) = _scores(bench, others, _pixels(bench, distance_m), (1 + level,))
    return found.spread("flip", 0)


def _scores(
    bench: _Bench, shown: Sequence[View], pixels: float, which: Iterable[int]
) -> list[Scores]:
    """The scores of some of the drawn at one size."""
    truth = truths(bench.plant, shown, [pixels], bench.display, buffers=bench.sharp)
    return [scores(truth, bench.drawn[index]) for index in which]


def _pixels(bench: _Bench, distance_m: float) -> float:
    """Size of the plant on the screen from that distance."""
    extent = float((bench.plant.bounds[1] - bench.plant.bounds[0]).max())
    return extent * bench.display.pixels_per_metre(distance_m)


def _despite(
    bench: _Bench, pixels: float, distance_m: float, flips: FloatArray
) -> tuple[tuple[float | LeftOut, ...], list[str]]:
    """Where no level is within the limit at any size: the best one, from the last distance on.

    flips: (1 + l,) there. Raises QualityError where the limit is the user's own.
    """
    options, errors = bench.options, flips[1:]
    best, count = int(np.argmin(errors)), len(errors)
    if options.max_error is not None:
        raise QualityError(
            f"{bench.plant.source or bench.plant.name}: expected a level with an error of at most "
            f"{options.max_error:g} (FLIP), found {errors[best]:.3f} at best, at {pixels:.3g} "
            "pixels; allow a larger --max-error, or more --billboards"
        )
    starts: list[float | LeftOut] = [LeftOut.ERRS] * count
    starts[best] = rounded_up(distance_m)
    sentence = (
        f"no level errs less than the original as a client draws it ({flips[0]:.3f} at "
        f"{pixels:.3g} pixels); kept the best alone, for smaller sizes ({errors[best]:.3f}); more "
        "--billboards may come closer"
    )
    return tuple(starts), [sentence]


def _notes(levels: Sequence[Level], starts: Sequence[float | LeftOut]) -> list[str]:
    """A sentence on each level that was left out."""
    return [
        f"left out the level of {len(level.billboards or ())} billboards: {start.value}"
        for level, start in zip(levels, starts, strict=True)
        if isinstance(start, LeftOut)
    ]


def _limits(live: FloatArray, options: MeasureOptions) -> FloatArray:
    """(d,) mean FLIP allowed. Where only displacement is limited, any."""
    if options.max_error is None and options.max_pixels is not None:
        return np.ones_like(live)
    return limits(live, options.max_error)
