"""What error a frame's time buys: pictures of some stations at details that double."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import BytesIO
from statistics import median
from time import perf_counter

from vegtool.gl.context import context
from vegtool.gl.screen import Screen
from vegtool.measure.background import over
from vegtool.measure.flip import perceived
from vegtool.preview.eye import Eye
from vegtool.preview.forest import Forest
from vegtool.preview.scenery import FrameStats, Look
from vegtool.preview.show import SKY
from walk.scenes import SETTINGS
from walk.speed import CROSSED, LEVELS, SIZE
from walk.truth import WHOLE, Sitting, flip_of

DETAILS = tuple(2.0**-power for power in range(8, -1, -1))
STATIONS = 3
REPEATS = 3
"""Frames whose median time counts, after one that does not."""


@dataclass(frozen=True)
class Point:
    """One picture. detail: of LEVELS; 0 for CROSSED. seconds: median of frames."""

    scene: str
    station: int
    drawn: str
    detail: float
    seconds: float
    plants: int
    triangles: int
    flip: float


def points(sitting: Sitting, eyes: Sequence[tuple[int, Eye]]) -> Iterator[Point]:
    """All details, and crossed billboards, at stations (number and eye)."""
    with Screen(context()) as screen:
        for station, eye in eyes:
            seen = perceived(over(sitting.truth(eye)))
            looks = [(LEVELS, d, sitting.levels, Look(detail=d)) for d in DETAILS]
            looks.append((CROSSED, 0.0, sitting.crossed, WHOLE))
            for drawn, detail, forest, look in looks:
                seconds, stats = _timed(screen, forest, eye, look)
                flip = flip_of(seen, forest.picture(eye, SIZE, look))
                yield Point(
                    sitting.name, station, drawn, detail, seconds, stats.plants, stats.triangles,
                    flip,
                )  # fmt: skip


def _timed(screen: Screen, forest: Forest, eye: Eye, look: Look) -> tuple[float, FrameStats]:
    times = []
    for _ in range(1 + REPEATS):
        started = perf_counter()
        screen.begin(SIZE, SKY)
        stats = forest.draw(eye, SIZE, look)
        screen.resolve()
        screen.ctx.finish()
        times.append(perf_counter() - started)
    return median(times[1:]), stats


def plot(found: Sequence[Point]) -> bytes:
    """A PNG: error against the time of a frame, a panel for each scene, a line for each station."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from vegtool.report.plots import INK, STYLE

    scenes = list(dict.fromkeys(point.scene for point in found))
    with rc_context(STYLE):
        figure = Figure(figsize=(4.6 * len(scenes), 3.8), layout="constrained", facecolor="w")
        panels = figure.subplots(1, len(scenes), sharey=True, squeeze=False)[0]
        for panel, scene in zip(panels, scenes, strict=True):
            for station in dict.fromkeys(p.station for p in found if p.scene == scene):
                here = [p for p in found if (p.scene, p.station) == (scene, station)]
                line = [p for p in here if p.drawn == LEVELS]
                (drawn,) = panel.plot(
                    [1e3 * p.seconds for p in line], [p.flip for p in line], "o-",
                    label=f"view {station}", markersize=4,
                )  # fmt: skip
                flat = [p for p in here if p.drawn == CROSSED]
                panel.plot(
                    [1e3 * p.seconds for p in flat], [p.flip for p in flat], "X",
                    color=drawn.get_color(), markersize=8,
                )  # fmt: skip
            for rate in (SETTINGS[scene].fps, 15.0):
                panel.axvline(1e3 / rate, color=INK, linewidth=0.8, linestyle=":")
                panel.annotate(
                    f"{rate:g} fps", (1e3 / rate, 1), xycoords=("data", "axes fraction"),
                    xytext=(3, -3), textcoords="offset points", va="top", fontsize=8,
                )  # fmt: skip
            panel.set(xscale="log", xlabel="milliseconds of a frame", title=scene, ylim=(0, None))
            panel.legend(frameon=False, loc="lower left")
        least = f"1/{1 / DETAILS[0]:.0f}"
        panels[0].set_ylabel(f"FLIP; dots: detail {least} to 1, crosses: crossed billboards")
        buffer = BytesIO()
        figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
