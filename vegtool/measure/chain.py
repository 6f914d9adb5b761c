"""The levels of a plant, each with the distance from which it may be used and its error there.

Errors are measured at a few sizes on the screen, limits laid on them (distances.py), and every
level measured once more at the very distance that came of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import QualityError
from vegtool.gl.upload import PlantBuffers
from vegtool.limits import ANYWHERE, Span
from vegtool.lod import Display, Level, Measured
from vegtool.measure.bounds import distance_for_pixels
from vegtool.measure.distances import LeftOut, limits, rounded_up, switch_distances
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import Uploaded, uploaded
from vegtool.measure.scores import LADDER, Scores, TruthsAt, outside, scores
from vegtool.measure.views import CLOSEST, View, views
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

QUICK_VIEWS, FULL_VIEWS = 6, 12
"""Six leave a standard error of about 0.005 FLIP in the mean of a leafy plant, twelve 0.003."""
FULL_LADDER = tuple(LADDER[0] / 2 ** (i / 2) for i in range(2 * len(LADDER) - 1))
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
    truth_at: TruthsAt | None = None,
    span: Span = ANYWHERE,
) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """The levels that may be used somewhere, with `near_distance_m` and `measured`; and a sentence
    on each that was left out.

    levels: coarser and coarser, without the original. truth_at: the plant's truths from
    `views_of(options)`, where some are drawn already. span: where eyes may be: no level needs to
    keep to a limit farther away, and some may begin there that would not go on beyond. Raises
    QualityError where none keeps to `max_error` at any size, UsageError where no size is seen from
    outside the plant.
    """
    if options.max_pixels is not None:
        pixels = options.max_pixels
        least_m = [distance_for_pixels(level, plant.center, display, pixels) for level in levels]
    elif options.measure == "off":
        least_m = [level.near_distance_m for level in levels]
    else:
        least_m = [0.0] * len(levels)
    if options.measure == "off":
        return _unmeasured(plant, levels, least_m)
    least_m = [max(pair) for pair in zip(least_m, _by_texels(levels, display), strict=True)]
    with ExitStack() as stack:
        bench = _Measuring(stack, plant, levels, options, display, truth_at)
        return _by_error(bench, least_m, progress, span)


def views_of(options: MeasureOptions) -> tuple[View, ...]:
    """The views that distances are chosen by."""
    return views(options.views, FULL_VIEWS if options.measure == "full" else QUICK_VIEWS)


def misses(levels: Sequence[Level], options: MeasureOptions) -> list[str]:
    """A sentence on each level that exceeds `max_error` by more than HELD_OUT_MARGIN, from views
    and suns that were not used to choose its distance. levels: of a chain, with the original."""
    found = [
        miss(f"LOD{number}", level.near_distance_m, options.max_error, level.measured.held_out.mean)
        for number, level in enumerate(levels)
        if options.max_error is not None and level.measured and level.measured.held_out
    ]
    return [sentence for sentence in found if sentence]


def miss(what: str, from_m: float, limit: float, held_out: float) -> str:
    """The sentence on an error from views and suns that a distance was not chosen by, where it is
    above the limit by more than HELD_OUT_MARGIN; else nothing."""
    if not held_out - limit > HELD_OUT_MARGIN:
        return ""
    return (
        f"{what} from {from_m:g} m on: expected an error of at most {limit:g} (FLIP, within "
        f"{HELD_OUT_MARGIN:g}) from other views and suns than its distance was chosen by, found "
        f"{held_out:.3f}: {held_out - limit:.3f} more"
    )


class _Measuring:
    """Measures the original as clients have it (index 0) and the levels (1, 2, ...), each once at
    a distance."""

    def __init__(
        self,
        stack: ExitStack,
        plant: Plant,
        levels: Sequence[Level],
        options: MeasureOptions,
        display: Display,
        truth_at: TruthsAt | None,
    ) -> None:
        self.plant, self.levels, self.options, self.display = plant, levels, options, display
        if truth_at is None:
            sharp = stack.enter_context(PlantBuffers(plant))
            truth_at = TruthsAt(plant, views_of(options), display, sharp)
        self._truth_at = truth_at
        shown = [Level("mesh", mesh=plant), *levels]
        self._drawn: list[Uploaded] = []
        for one in shown:
            on_gpu = uploaded(one)
            stack.callback(on_gpu.release)
            self._drawn.append(on_gpu)
        self._known: dict[tuple[float, int], Scores] = {}

    def distances(self) -> FloatArray:
        """(d,) metres, increasing, of the sizes at which everything is measured.

        Rounded, so that a level may start at one of them as it is.
        """
        sizes = FULL_LADDER if self.options.measure == "full" else self._quick_ladder()
        _, distance_m = outside(self.plant, sizes, self.display)
        return np.array([rounded_up(metres) for metres in distance_m])

    def _quick_ladder(self) -> Sequence[float]:
        """From the first size that the finest level is not made for; much nearer, it errs."""
        made_for = self.pixels(min(level.near_distance_m for level in self.levels))
        larger = [size for size in LADDER if size > 0.99 * made_for]
        return [size for size in LADDER if size <= min(larger, default=LADDER[0])]

    def pixels(self, distance_m: float) -> float:
        """Size of the plant on the screen from that distance."""
        return self.plant.extent * self.display.pixels_per_metre(distance_m)

    def scores(self, distance_m: float, which: Sequence[int]) -> list[Scores]:
        """Of some of what is measured, at one distance."""
        new = [index for index in which if (distance_m, index) not in self._known]
        found = self._measure(self._truth_at, distance_m, new) if new else []
        self._known.update({(distance_m, i): s for i, s in zip(new, found, strict=True)})
        return [self._known[distance_m, index] for index in which]

    def flips(self, distance_m: float, which: Sequence[int]) -> FloatArray:
        """Their mean FLIP over the views."""
        return np.array([s.values["flip"].mean() for s in self.scores(distance_m, which)])

    def everything(self, distance_m: FloatArray, progress: Progress = silent) -> FloatArray:
        """(d, 1 + l) mean FLIP of the live original and of all levels."""
        share = np.cumsum(distance_m**-2.0) / np.sum(distance_m**-2.0)  # of all pixels drawn
        rows = []
        for distance, done in zip(distance_m, share, strict=True):
            rows.append(self.flips(distance, range(1 + len(self.levels))))
            progress("measuring", done)
        return np.array(rows)

    def measured(self, level: int, distance_m: float) -> Measured:
        """All that a level is said to be at its distance; held-out views where a limit is given."""
        live, found = (
            {name: s.spread(name, 0) for name in s.values}
            for s in self.scores(distance_m, (0, 1 + level))
        )
        held_out = None
        if self.options.max_error is not None:
            others = views(self.options.views, HELD_OUT_VIEWS, HELD_OUT_PHASE)
            other_truths = self._truth_at.from_views(others)
            held_out = self._measure(other_truths, distance_m, (1 + level,))[0].spread("flip", 0)
        pixels, count = self.pixels(distance_m), len(self._truth_at.views)
        return Measured(pixels, self.options.views, count, found, live, held_out)

    def _measure(self, truth_at: TruthsAt, distance_m: float, which: Sequence[int]) -> list[Scores]:
        truth = truth_at(distance_m)
        return [scores(truth, self._drawn[index]) for index in which]


def _by_texels(levels: Sequence[Level], display: Display) -> list[float]:
    """Metres from which levels were made to be used, and a texel of each covers no more than a
    pixel: what is smeared is seen sooner than a mean error over the picture tells."""
    return [
        max(
            level.near_distance_m,
            display.distance_m(level.texels_per_metre) if level.atlas else 0.0,
        )
        for level in levels
    ]


def _unmeasured(
    plant: Plant, levels: Sequence[Level], least_m: Sequence[float]
) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """Levels from `least_m` metres on, where that is outside the plant."""
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
    bench: _Measuring, least_m: Sequence[float], progress: Progress, span: Span
) -> tuple[tuple[Level, ...], tuple[str, ...]]:
    """Distances by measured error, and no less than `least_m`, (l,) metres."""
    options = bench.options

    def holds(level: int, distance_m: float) -> bool:
        live, error = bench.flips(distance_m, (0, 1 + level))
        return bool(error <= _limits(np.array([live]), options)[0])

    distance_m = bench.distances()
    if span.nearest_m and distance_m[-1] < min(least_m):  # no eye sees plants as large as that
        distance_m = np.array([rounded_up(min(least_m))])
    flips = bench.everything(distance_m, progress)
    while True:
        allowed, errors = _limits(flips[:, 0], options), list(flips[:, 1:].T)
        starts = switch_distances(distance_m, errors, allowed, least_m, holds, span.farthest_m)
        notes = _notes(bench.levels, starts)
        found = any(isinstance(start, float) for start in starts)
        if found or distance_m[-1] >= span.farthest_m:
            break
        farther = np.array([rounded_up(2 * distance_m[-1])])
        if bench.pixels(farther[0]) < SMALLEST:
            starts, notes = _despite(bench, distance_m[-1], flips[-1])
            break
        distance_m = np.concatenate([distance_m, farther])
        flips = np.concatenate([flips, bench.everything(farther)])
    kept = [
        replace(level, near_distance_m=start, measured=bench.measured(index, start))
        for index, (level, start) in enumerate(zip(bench.levels, starts, strict=True))
        if isinstance(start, float)
    ]
    return tuple(kept), tuple(notes)


def _limits(live: FloatArray, options: MeasureOptions) -> FloatArray:
    """(d,) mean FLIP allowed. Where displacement alone is limited, any."""
    if options.max_error is None and options.max_pixels is not None:
        return np.ones_like(live)
    return limits(live, options.max_error)


def _despite(
    bench: _Measuring, distance_m: float, flips: FloatArray
) -> tuple[tuple[float | LeftOut, ...], list[str]]:
    """Where no level keeps to the limit at any size: the best one, from the last distance on.

    flips: (1 + l,) there. Raises QualityError where the limit is the user's own.
    """
    limit, errors = bench.options.max_error, flips[1:]
    best, pixels = int(np.argmin(errors)), bench.pixels(distance_m)
    if limit is not None:
        raise QualityError(
            f"{bench.plant.source or bench.plant.name}: expected a level with an error of at most "
            f"{limit:g} (FLIP), found {errors[best]:.3f} at best, at {pixels:.3g} pixels; allow a "
            "larger --max-error, or more --billboards"
        )
    starts: list[float | LeftOut] = [LeftOut.ERRS] * len(errors)
    starts[best] = rounded_up(distance_m)
    sentence = (
        f"no level errs as little as the original drawn live, or little enough: kept the best "
        f"alone, for {pixels:.3g} pixels and less ({errors[best]:.3f} FLIP, live {flips[0]:.3f}); "
        "more --billboards may come closer"
    )
    return tuple(starts), [sentence]


def _notes(levels: Sequence[Level], starts: Sequence[float | LeftOut]) -> list[str]:
    """A sentence on each level that was left out."""
    return [
        f"left out the level of {level.triangles:,} triangles: {start.value}"
        for level, start in zip(levels, starts, strict=True)
        if isinstance(start, LeftOut)
    ]
