"""The plots of a report: error against what it costs, and against distance.

One look for all: a colour and a marker per family that a colour-blind reader tells apart (Okabe and
Ito 2008), rows of a family joined from small budget to large and labelled once, the Pareto front
(what none of the others beats in both) drawn as a broad band behind, logarithmic costs. An SVG
takes its ink from the page that holds it, so that it is right in the light and in the dark.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from vegtool.measure.metrics import METRICS
from vegtool.report.summary import Point, families, pareto

SIZES = (200.0, 50.0)
"""Pixels: one panel each."""
INK, FAINT, LINE, PAPER = "#1f2429", "#626a71", "#d5d9dc", "#ffffff"
IN_PAGE = {INK: "var(--ink)", FAINT: "var(--faint)", LINE: "var(--line)", PAPER: "var(--paper)"}
"""What an SVG takes from its page instead."""
LOOKS: dict[str, tuple[str, str]] = {
    "branches": ("#009e73", "o"),
    "isodata": ("#0072b2", "s"),
    "kmeans": ("#e69f00", "^"),
    "live": (INK, "_"),
    "quadric": ("#cc79a7", "D"),
    "gltfpack": ("#d55e00", "v"),
    "crossed": ("#56b4e9", "P"),
    "octahedral": ("#8a8f94", "X"),
}
"""Colour and marker by family."""
OTHERS = (("#8f6bb3", "h"), ("#7a7a00", "*"), ("#a0522d", "<"), ("#2e8b8b", ">"))
"""For families that are new here, in turn."""
FONTS = ["DejaVu Sans", "Verdana", "Arial"]
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "vegtool",
    "font.family": "sans-serif",
    "font.sans-serif": FONTS,
    "font.size": 9.0,
    "text.color": INK,
    "axes.labelcolor": FAINT,
    "axes.edgecolor": LINE,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}


@dataclass(frozen=True)
class Cost:
    """An axis: an attribute of Point, and what it is called."""

    name: str
    label: str


COSTS = (
    Cost("bake_seconds", "time to make it, seconds"),
    Cost("triangles", "triangles"),
    Cost("texture_bytes", "bytes of its textures"),
    Cost("frame_ms", "time of a frame, milliseconds"),
)


def error_against(points: Sequence[Point], cost: Cost, title: str, metric: str = "flip") -> Figure:
    """A panel per size: the metric's mean against a cost."""
    sizes = [s for s in SIZES if any(s in p.pixels for p in points)] or [points[0].pixels[0]]
    with rc_context(STYLE):
        figure = Figure(figsize=(4.9 * len(sizes), 4.1), layout="constrained")
        panels = figure.subplots(1, len(sizes), sharey=True, squeeze=False)[0]
        ends = []
        for panel, size in zip(panels, sizes, strict=True):
            ends.append(_panel(panel, [p for p in points if size in p.pixels], cost, metric, size))
            panel.set_title(f"{size:g} pixels high")
        panels[0].set_ylabel(_error_label(points, metric))
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
        figure.draw_without_rendering()  # places the panels, so that names can keep apart
        for panel, end in zip(panels, ends, strict=True):
            _name(panel, end)
    return figure


End = tuple[float, float, str, str]
"""Of a family's line: where it ends, its name, its colour."""


def _panel(axes: Axes, points: list[Point], cost: Cost, metric: str, size: float) -> list[End]:
    def at(point: Point) -> tuple[float, float]:
        error = point.errors[metric][point.pixels.index(size)].mean
        return float(getattr(point, cost.name)), error

    placed = {p.name: at(p) for p in points if at(p)[0] > 0}
    ends: list[End] = []
    front = pareto(*np.array(list(placed.values())).T) if placed else []
    best = np.array(list(placed.values()))[front].reshape(-1, 2)
    axes.plot(*best.T, color=LINE, linewidth=7, solid_capstyle="round", zorder=1)
    for family in families(points):
        color, marker = look(family, families(points))
        own = sorted((p for p in points if p.family == family and p.name in placed),
                     key=lambda p: placed[p.name][0])  # fmt: skip
        if family == "live":
            error = at(next(p for p in points if p.family == family))[1]
            axes.axhline(error, color=color, linewidth=1, linestyle=(0, (4, 3)), zorder=2)
        if not own:
            continue
        x, y = np.array([placed[p.name] for p in own]).T
        axes.plot(x, y, color=color, marker=marker, markersize=6, linewidth=1.3, zorder=3,
                  markeredgecolor=PAPER, markeredgewidth=0.6)  # fmt: skip
        ends.append((float(x[-1]), float(y[-1]), family, color))
    axes.set_xscale("log")
    axes.set_xlabel(cost.label)
    axes.xaxis.set_major_locator(LogLocator(10, numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _short(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.margins(x=0.16, y=0.08)
    axes.set_ylim(bottom=0)
    return ends


def error_against_distance(points: Sequence[Point], title: str, metric: str = "flip") -> Figure:
    """Every row's error at each size, from near to far; a panel per family with its budgets."""
    shown = [f for f in families(points) if f != "live"]
    live = next((p for p in points if p.family == "live"), None)
    columns = min(4, len(shown)) or 1
    rows = -(-len(shown) // columns) or 1
    with rc_context(STYLE):
        figure = Figure(figsize=(2.55 * columns, 2.5 * rows + 0.5), layout="constrained")
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, family in zip(panels.flat, shown, strict=False):
            color, marker = look(family, families(points))
            own = [p for p in points if p.family == family]
            if live is not None:
                axes.plot(live.pixels, _means(live, metric), color=INK, linewidth=1,
                          linestyle=(0, (4, 3)))  # fmt: skip
            for i, point in enumerate(own):
                fade = 0.35 + 0.65 * (i + 1) / len(own)
                axes.plot(point.pixels, _means(point, metric), color=color, marker=marker,
                          markersize=4, linewidth=1.3, alpha=fade)  # fmt: skip
                if point.budget is not None:
                    axes.annotate(f"{point.budget}", (point.pixels[0], _means(point, metric)[0]),
                                  (-4, 0), textcoords="offset points", ha="right", va="center",
                                  fontsize=7, color=FAINT)  # fmt: skip
            axes.set_title(family)
            axes.set_xscale("log")
            ticks = sorted({size for point in points for size in point.pixels})
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.minorticks_off()
            axes.yaxis.set_major_locator(MaxNLocator(5))
            axes.set_ylim(bottom=0)
            axes.margins(x=0.12)
        panels[0, 0].invert_xaxis()
        for axes in panels.flat[len(shown):]:  # fmt: skip
            axes.set_visible(False)
        figure.supxlabel("height on the screen, pixels (near to far)", fontsize=9, color=FAINT)
        figure.supylabel(_error_label(points, metric), fontsize=9, color=FAINT)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def look(family: str, among: Sequence[str]) -> tuple[str, str]:
    """Colour and marker of a family; those without their own take OTHERS in turn."""
    new = [f for f in among if f not in LOOKS]
    return LOOKS[family] if family in LOOKS else OTHERS[new.index(family) % len(OTHERS)]


def svg(figure: Figure, described: str) -> str:
    """The figure as an `<svg>` for a page, in the page's own ink; described: for who cannot see it.

    The same figure gives the same text.
    """
    stream = BytesIO()
    with rc_context(STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    text = stream.getvalue().decode()
    text = text[text.index("<svg") :]
    for color, name in IN_PAGE.items():
        text = text.replace(color, name)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    return text.replace("<svg ", f'<svg role="img" aria-label="{described}" ', 1)


def png(figure: Figure) -> bytes:
    """The figure as a PNG on white paper."""
    stream = BytesIO()
    with rc_context(STYLE):
        figure.savefig(stream, format="png", dpi=110, facecolor=PAPER, metadata={"Software": None})
    return stream.getvalue()


def _means(point: Point, metric: str) -> list[float]:
    return [spread.mean for spread in point.errors[metric]]


def _error_label(points: Sequence[Point], metric: str) -> str:
    several = points[0].plants > 1
    return f"{METRICS[metric]}, " + ("median over plants" if several else "mean over views")


def _short(value: float) -> str:
    for factor, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:g} {unit}"
    return f"{value:g}"


def _name(axes: Axes, ends: list[End]) -> None:
    """Write each family beside the end of its line, none over another."""
    placed: list[tuple[float, float]] = []
    for x, y, text, color in sorted(ends, key=lambda end: end[1]):
        px, py = axes.transData.transform((x, y))
        while any(abs(px - qx) < 60 and abs(py - qy) < 11 for qx, qy in placed):
            py += 3
        placed.append((px, py))
        _, height = axes.transData.inverted().transform((px, py))
        axes.annotate(text, (x, height), (7, 0), textcoords="offset points", color=color,
                      va="center", fontsize=8.5, fontweight="bold")  # fmt: skip
