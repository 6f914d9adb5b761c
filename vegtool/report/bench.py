"""One plant on the bench: what every row of it is measured against, and the measuring of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.measure.bounds import (
    distance_for_pixels,
    projection_bound,
    projection_error,
    texel_error,
)
from vegtool.measure.chain import HELD_OUT_PHASE, views_of
from vegtool.measure.cost import Cost, cost, peak_memory
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import Truths, TruthsAt, scores, truths
from vegtool.measure.views import Camera, views
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.report.entries import Entry, Made
from vegtool.report.options import ReportOptions
from vegtool.report.pictures import Scene, of_shown, scene
from vegtool.report.rows import Pictures, Row

FRAME_PIXELS = 200.0
"""Size on the screen at which frames are timed and fragments counted, or the nearest to it."""
TOLERATED_PIXELS = 1.0
"""Displacement for which a distance is stated where no other limit is asked for."""


@dataclass(frozen=True, eq=False)
class Bench:
    """buffers: the plant's, without mipmaps. truth_at: what levels are made by. truths: what rows
    are measured by. others: from other views under other suns, to check --max-error with, where
    there is one."""

    buffers: PlantBuffers
    options: ReportOptions
    truth_at: TruthsAt
    truths: Truths
    others: Truths | None
    scene: Scene

    @property
    def plant(self) -> Plant:
        return self.buffers.plant


def set_up(buffers: PlantBuffers, options: ReportOptions, progress: Progress = silent) -> Bench:
    """Draw the truths of a plant. Raises CapabilityError where nothing can draw."""
    watched = scene(buffers, options.display)

    def drawn(phase: float) -> Truths:
        shown_from = views(options.views, options.view_count, phase)
        return truths(
            buffers.plant, shown_from, display=options.display, progress=progress, buffers=buffers
        )

    others = None if options.max_error is None else drawn(HELD_OUT_PHASE)
    seen_from = views_of(MeasureOptions(views=options.views))
    truth_at = TruthsAt(buffers.plant, seen_from, options.display, buffers)
    return Bench(buffers, options, truth_at, drawn(0.0), others, watched)


def measured(
    bench: Bench, entry: Entry, sizes: Sequence[int], progress: Progress = silent
) -> tuple[Row, Pictures]:
    """Make what an entry shows and measure it; its pictures at the sizes asked for."""
    with peak_memory() as peak:
        made = entry.make(
            bench.buffers, bench.truth_at, lambda stage, done: progress(stage, 0.3 * done)
        )
    found = scores(bench.truths, made.shown, lambda stage, done: progress(stage, 0.3 + 0.6 * done))
    progress("frame time", 0.9)
    level = made.shown if isinstance(made.shown, Level) else made.shown(bench.truths.views[0])
    row = Row(
        bench.plant.name,
        entry.name,
        entry.family,
        entry.budget,
        _cost(bench, made, level, peak.mb),
        entry.made_for_pixels,
        _floats(bench.truths.pixels),
        _floats(bench.truths.distance_m),
        {metric: tuple(_floats(v) for v in values) for metric, values in found.values.items()},
    )
    if bench.others is not None:
        others = scores(bench.others, made.shown)
        row = replace(row, held_out=_floats(others.values["flip"].mean(axis=1)))
    if made.shown is level:
        row = _with_bounds(row, bench, level)
    return row, of_shown(made.shown, bench.scene, sizes)


def _cost(bench: Bench, made: Made, level: Level, peak_mb: float | None) -> Cost:
    """Of what is shown in every view, or of what is shown in the first."""
    size = int(np.abs(np.log(bench.truths.pixels / FRAME_PIXELS)).argmin())
    shared = made.shown is level
    seen = slice(None) if shared else slice(1)
    cameras = bench.truths.cameras[size][seen]
    covered = [reference.covered for reference in bench.truths.references[size][seen]]
    light = Light(direction=bench.truths.views[0].sun)
    file_bytes = len(level_glb(level, "level")) if shared else None
    found = cost(level, cameras, covered, light, file_bytes, peak_mb)
    return replace(
        found, triangles=made.triangles, texels=made.texels, seconds=dict(made.seconds())
    )


def _with_bounds(row: Row, bench: Bench, level: Level) -> Row:
    """The row with what formulas say of its level, at every size and of the worst view."""
    pixels = bench.options.max_pixels or TOLERATED_PIXELS
    plant, display = bench.plant, bench.options.display
    if level.mesh is not None and level.geometric_error_m is None:
        return row
    row = replace(
        row,
        texels_per_metre=level.texels_per_metre,
        within_pixels_from_m=distance_for_pixels(level, plant.center, display, pixels),
    )
    billboards, atlas = level.billboards, level.atlas
    if billboards is None or atlas is None:
        return row
    return replace(
        row,
        projection_px=_worst(bench, lambda camera: projection_error(billboards, camera)),
        bound_px=_worst(bench, lambda camera: projection_bound(billboards, camera)),
        texel_px=_worst(bench, lambda camera: texel_error(billboards, atlas, camera)),
    )


def _worst(bench: Bench, of: Callable[[Camera], FloatArray]) -> tuple[float | None, ...]:
    """The greatest of all billboards and views at each size; None for infinite."""
    worst = (
        max(float(of(c).max(initial=0.0)) for c in cameras) for cameras in bench.truths.cameras
    )
    return tuple(value if np.isfinite(value) else None for value in worst)


def _floats(values: FloatArray) -> tuple[float, ...]:
    return tuple(float(v) for v in values)
