"""A level beside its truth: every metric from every view, at every size on the screen.

The truth of a view is drawn once and shared by all that is scored against it. Pictures are drawn
one after another, and scored beside that in a few threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from vegtool.arrays import FloatArray, Picture
from vegtool.errors import UsageError
from vegtool.gl.sun import SunMaps
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Display, Level, Spread
from vegtool.measure.metrics import METRICS, Reference, reference, score
from vegtool.measure.pictures import Uploaded, live, truth, uploaded
from vegtool.measure.views import CLOSEST, Camera, View, around, distance_of
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

LADDER = (400.0, 200.0, 100.0, 50.0, 25.0)
"""Sizes of the plant's longest extent on the screen, in pixels, at which errors are measured."""
THREADS = min(4, os.cpu_count() or 1)
"""Pictures scored at a time."""
MANY_POINTS = 10_000
"""Below, looking at all of them is quicker than their hull."""
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Shadowed:
    """A light that does not move, and what its sun sees; None where it throws no shadows."""

    light: Light
    shadows: SunMaps | None


@dataclass(frozen=True, eq=False)
class Truths:
    """What a plant really looks like, from each of the views v at each of the distances d.

    pixels, distance_m: (d,) sizes on the screen and the distances that give them on `display`.
    cameras, references: [d][v]. under: the light that does not move, with its shadows; None where
    each view has a sun of its own, which throws none.
    """

    plant: Plant
    display: Display
    views: tuple[View, ...]
    pixels: FloatArray
    distance_m: FloatArray
    cameras: tuple[tuple[Camera, ...], ...]
    references: tuple[tuple[Reference, ...], ...]
    under: Shadowed | None = None

    def light(self, view: View) -> Light:
        """What a view is drawn under."""
        return Light(direction=view.sun) if self.under is None else self.under.light

    @property
    def shadows(self) -> SunMaps | None:
        """What throws shadows."""
        return None if self.under is None else self.under.shadows


@dataclass(frozen=True, eq=False)
class Scores:
    """What was measured of a level. values: by metric, (d, v) for distances and views."""

    pixels: FloatArray
    distance_m: FloatArray
    values: dict[str, FloatArray]

    def spread(self, metric: str, row: int) -> Spread:
        """A metric at one distance, over the views."""
        return spread(self.values[metric][row])


def truths(
    plant: Plant,
    views: Sequence[View],
    pixels: Sequence[float] = LADDER,
    display: Display | None = None,
    progress: Progress = silent,
    buffers: PlantBuffers | None = None,
    under: Shadowed | None = None,
) -> Truths:
    """Draw the truth of each view at each size, 8 x 8 samples to the pixel.

    pixels: sizes on the screen, any order; kept in descending order. Sizes at which a display of
    so wide an angle would have to stand within the plant are left out; UsageError where none is
    left. buffers: the plant's, without mipmaps, where there are some. under: the light of all
    views, where it does not move.
    """
    display = display or Display()
    sizes, distances = outside(plant, pixels, display)
    outline = _outline(plant.positions)
    cameras = tuple(
        tuple(around(outline, view.direction, distance, display) for view in views)
        for distance in distances
    )

    def pictures(draw_from: PlantBuffers) -> list[Reference]:
        def draw(row: int, column: int) -> Picture:
            light = Light(direction=views[column].sun) if under is None else under.light
            shadows = None if under is None else under.shadows
            return truth(draw_from, cameras[row][column], light, shadows=shadows)

        return _drawn_and(reference_of, draw, (len(sizes), len(views)), "truth", progress)

    def reference_of(row: int, column: int, picture: Picture) -> Reference:
        return reference(picture)

    if buffers is None:
        with PlantBuffers(plant) as own:
            found = pictures(own)
    else:
        found = pictures(buffers)
    rows = tuple(tuple(found[i * len(views) : (i + 1) * len(views)]) for i in range(len(sizes)))
    return Truths(plant, display, tuple(views), sizes, distances, cameras, rows, under)


def outside(
    plant: Plant, pixels: Sequence[float], display: Display
) -> tuple[FloatArray, FloatArray]:
    """Those sizes on the screen, descending, at which the eye is outside the plant; and the
    distances, metres, that give them. Raises UsageError where there are none, and for a plant
    without extent."""
    sizes = np.array(sorted(set(pixels), reverse=True), dtype=np.float64)
    distances = np.array([distance_of(plant, display, size) for size in sizes])
    seen = distances > CLOSEST * plant.radius
    if not seen.any():
        raise UsageError(
            f"--fov {display.fov_y_deg:g}: at no size from {sizes[0]:g} to {sizes[-1]:g} pixels is "
            "the eye outside the plant; use a narrower field of view or a larger --image-height"
        )
    return sizes[seen], distances[seen]


class TruthsAt:
    """What a plant looks like from the same views at any distance, each drawn once.

    plant, views, display, under: as of `truths`. buffers: the plant's, without mipmaps.
    """

    def __init__(
        self,
        plant: Plant,
        views: Sequence[View],
        display: Display,
        buffers: PlantBuffers,
        under: Shadowed | None = None,
    ) -> None:
        self.under = under
        self.plant, self.views, self.display = plant, tuple(views), display
        self.buffers = buffers
        self._known: dict[float, Truths] = {}

    def __call__(self, distance_m: float, progress: Progress = silent) -> Truths:
        """From that many metres away."""
        if distance_m not in self._known:
            size = self.plant.extent * self.display.pixels_per_metre(distance_m)
            self._known[distance_m] = truths(
                self.plant, self.views, [size], self.display, progress, self.buffers, self.under
            )
        return self._known[distance_m]

    def from_views(self, views: Sequence[View]) -> TruthsAt:
        """The same plant from other views."""
        return TruthsAt(self.plant, views, self.display, self.buffers, self.under)


def scores(
    truths: Truths,
    level: Level | Uploaded | Callable[[View], Level],
    progress: Progress = silent,
) -> Scores:
    """Draw a level live (measure/pictures.py) from every camera of the truths, and score it.

    level: or the same `uploaded`; or a function that gives the level for a
    view, for those that depend on it.
    """
    shape = len(truths.pixels), len(truths.views)
    on_gpu: dict[Level, Uploaded] = {}

    def buffers_for(view: View) -> Uploaded:
        if isinstance(level, Uploaded):
            return level
        shown = level if isinstance(level, Level) else level(view)
        if shown not in on_gpu:
            on_gpu[shown] = uploaded(shown)
        return on_gpu[shown]

    def draw(row: int, column: int) -> Picture:
        view = truths.views[column]
        camera, light = truths.cameras[row][column], truths.light(view)
        return live(buffers_for(view), camera, light, shadows=truths.shadows)

    def scored(row: int, column: int, picture: Picture) -> dict[str, float]:
        return score(truths.references[row][column], picture)

    try:
        found = _drawn_and(scored, draw, shape, "measuring", progress)
    finally:
        for buffers in on_gpu.values():
            buffers.release()
    values = {name: np.array([f[name] for f in found]).reshape(shape) for name in METRICS}
    return Scores(truths.pixels, truths.distance_m, values)


def _outline(points: FloatArray) -> FloatArray:
    """(m, 3) the points of (n, 3) that any picture's bounds are made by: those of the hull."""
    if len(points) < MANY_POINTS:
        return points
    try:
        return np.asarray(points[ConvexHull(points - points.mean(axis=0)).vertices])
    except QhullError:  # all in one plane
        return points


def spread(values: FloatArray) -> Spread:
    """Mean, standard deviation, least and greatest of (n,) values."""
    low, high = float(values.min()), float(values.max())
    return Spread(float(values.mean()), float(values.std()), low, high)


def _drawn_and(
    process: Callable[[int, int, Picture], Result],
    draw: Callable[[int, int], Picture],
    shape: tuple[int, int],
    stage: str,
    progress: Progress,
) -> list[Result]:
    """`process` of every picture, row by row; drawn here, processed in threads meanwhile."""
    waiting: list[Future[Result]] = []
    places = list(product(range(shape[0]), range(shape[1])))
    with ThreadPoolExecutor(THREADS) as pool:
        for done, (row, column) in enumerate(places):
            progress(stage, done / len(places))
            if done >= 2 * THREADS:  # no more pictures in memory than are worked on
                waiting[done - 2 * THREADS].result()
            waiting.append(pool.submit(process, row, column, draw(row, column)))
        return [future.result() for future in waiting]
