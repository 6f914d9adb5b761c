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
from hashlib import sha256
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from vegtool.measure.metrics import METRICS
from vegtool.report.labels import LEFT, Labels, Line
from vegtool.report.rows import EMULATED, LIVE
from vegtool.report.summary import Point, families, pareto

ERROR = "flip"
"""The metric that is plotted."""
SIZES = (200.0, 50.0)
"""Pixels: one panel each."""
INK, FAINT, LINE, PAPER = "#1f2429", "#626a71", "#d5d9dc", "#ffffff"
IN_PAGE = {INK: "var(--ink)", FAINT: "var(--faint)", LINE: "var(--line)", PAPER: "var(--paper)"}
"""What an SVG takes from its page instead."""
DASHED = (0, (4, 3))
LOOKS: dict[str, tuple[str, str]] = {
    "refined": ("#8250c4", "p"),
    "hybrid": ("#8a1538", "h"),
    "surfel-billboards": ("#2e6b2e", "d"),
    "surfels": ("#b5179e", "8"),
    "branches": ("#009e73", "o"),
    "isodata": ("#0072b2", "s"),
    "kmeans": ("#e69f00", "^"),
    "planes": ("#7a7a00", "*"),
    "live": (INK, "_"),
    "quadric": ("#cc79a7", "D"),
    "gltfpack": ("#d55e00", "v"),
    "crossed": ("#56b4e9", "P"),
    "octahedral": ("#8a8f94", "X"),
}
"""Colour and marker by family."""
OTHERS = (("#a0522d", "<"), ("#2e8b8b", ">"), ("#b08fd0", "H"), ("#4b5d16", "1"))
"""For families that are new here, in turn."""
HALO = 2.5
"""Points, around words."""
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
class CostAxis:
    """A cost to plot against: an attribute of Point, its label, and the plot's title."""

    name: str
    label: str
    title: str


COST_AXES = (
    CostAxis("bake_seconds", "time to make it, seconds", "Error against the time to make it"),
    CostAxis("triangles", "triangles", "Error against triangles"),
    CostAxis("texture_bytes", "bytes of its textures", "Error against bytes of textures"),
    CostAxis("frame_ms", "time of a frame, milliseconds", "Error against frame time"),
)


def error_against(points: Sequence[Point], cost: CostAxis, title: str) -> Figure:
    """A panel per size: the mean error against a cost."""
    sizes = [s for s in SIZES if any(s in p.pixels for p in points)] or [points[0].pixels[0]]
    with rc_context(STYLE):
        figure = Figure(figsize=(4.9 * len(sizes), 4.1), layout="constrained")
        panels = figure.subplots(1, len(sizes), sharey=True, squeeze=False)[0]
        for axes, size in zip(panels, sizes, strict=True):
            _axis(axes, cost, [getattr(p, cost.name) for p in points])
            axes.set_title(f"{size:g} pixels high")
        drawn = [
            _panel(axes, [p for p in points if size in p.pixels], cost, size)
            for axes, size in zip(panels, sizes, strict=True)
        ]
        panels[0].set_ylim(bottom=0)
        panels[0].set_ylabel(_error_label(points))
        _framed(figure, title, "band: Pareto front, with budgets; dashed: the original, live; "
                "whiskers: standard deviation")  # fmt: skip
        for axes, lines in zip(panels, drawn, strict=True):
            _words(axes, lines)
    return figure


@dataclass(frozen=True)
class _Lines:
    """What a panel shows: by family its points, the front's points and budgets, and the rest."""

    families: dict[str, Line]
    front: list[tuple[int, Line]]
    others: list[Line]


def _panel(axes: Axes, points: list[Point], cost: CostAxis, size: float) -> _Lines:
    """Draw a panel. What costs nothing has no place on its axis."""
    errors = {p.name: p.errors[ERROR][p.pixels.index(size)] for p in points}
    at = {p.name: (float(getattr(p, cost.name)), errors[p.name].mean) for p in points}
    placed = [p for p in points if at[p.name][0] > 0]
    own_lines: dict[str, Line] = {}
    for family in families(placed):
        color, marker = look(family, families(points))
        own = sorted((p for p in placed if p.family == family), key=lambda p: at[p.name])
        line = np.array([at[p.name] for p in own])
        spread = [errors[p.name].sd for p in own]
        axes.errorbar(
            line[:, 0], line[:, 1], spread, fmt="none", ecolor=color, elinewidth=1, alpha=0.35
        )
        axes.plot(*line.T, color=color, marker=marker, markersize=6.5, linewidth=1.4, zorder=3,
                  markeredgecolor=PAPER, markeredgewidth=0.7)  # fmt: skip
        own_lines[family] = line
    for_clients = [p for p in placed if p.family not in EMULATED]
    best = [for_clients[i] for i in pareto([at[p.name] for p in for_clients])]
    front = np.array([at[p.name] for p in best]).reshape(-1, 2)
    axes.plot(*front.T, color=LINE, linewidth=8, solid_capstyle="round", zorder=1)
    others = []
    if LIVE in errors:
        axes.axhline(errors[LIVE].mean, color=INK, linewidth=1, linestyle=DASHED, zorder=2)
        others.append(np.array([(x, errors[LIVE].mean) for x in axes.get_xlim()]))
    budgets = [(p.budget, np.array([at[p.name]])) for p in best if p.budget is not None]
    return _Lines(own_lines, budgets, others)


def _words(axes: Axes, lines: _Lines) -> None:
    """Each family's name beside its line, then the front's budgets where there is room."""
    labels = Labels(axes, [*lines.families.values(), *lines.others])
    for family, line in lines.families.items():
        labels.write(family, line, 8.5, INK)
    for budget, point in lines.front:
        labels.write_if_free(str(budget), point, 7.0, FAINT)


def _axis(axes: Axes, cost: CostAxis, values: list[float]) -> None:
    """A logarithmic axis, with numbers at 1, 2 and 5 where it spans few powers of ten."""
    positive = [value for value in values if value > 0]
    axes.set_xscale("log")
    axes.set_xlabel(cost.label)
    if positive:
        axes.set_xlim(min(positive) / 2.5, max(positive) * 2.5)
    few = bool(positive) and max(positive) / min(positive) < 30
    axes.xaxis.set_major_locator(LogLocator(10, (1.0, 2.0, 5.0) if few else (1.0,), numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _short(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())


def error_against_distance(points: Sequence[Point], title: str) -> Figure:
    """Every row's error at each size, from near to far; a panel per family with its budgets."""
    shown = [f for f in families(points) if f != LIVE]
    columns = min(4, len(shown)) or 1
    rows = -(-len(shown) // columns) or 1
    ticks = sorted({size for point in points for size in point.pixels})
    with rc_context(STYLE):
        figure = Figure(figsize=(2.45 * columns, max(2.4 * rows + 0.5, 4.3)), layout="constrained")
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        drawn = []
        for axes, family in zip(panels.flat, shown, strict=False):
            axes.set_title(family)
            axes.set_xscale("log")
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
            axes.minorticks_off()
            axes.yaxis.set_major_locator(MaxNLocator(5))
            drawn.append(_distance_panel(axes, points, family))
        panels[0, 0].set_xlim(ticks[-1] * 2.2, ticks[0] / 1.25)  # near to far
        panels[0, 0].set_ylim(bottom=0)
        for axes in panels.flat[len(shown) :]:
            axes.set_visible(False)
        figure.supylabel(_error_label(points), fontsize=9, color=FAINT)
        _framed(figure, title, "height on the screen, pixels, from near to far; numbers: budgets; "
                "dashed: the original, live; band: the least of all")  # fmt: skip
        for axes, lines in zip(panels.flat, drawn, strict=False):
            labels = Labels(axes, [line for _, line in lines])
            for budget, line in lines:
                if budget is not None:
                    labels.write_if_free(str(budget), line[:1], 7.0, FAINT, LEFT)
    return figure


def _distance_panel(
    axes: Axes, points: Sequence[Point], family: str
) -> list[tuple[int | None, Line]]:
    """Draw a family's rows over the live original's; their budgets and lines, near points first."""
    color, marker = look(family, families(points))
    lines = []
    axes.plot(*_least(points).T, color=LINE, linewidth=7, solid_capstyle="round", zorder=1)
    for point in points:
        line = np.array([point.pixels, [e.mean for e in point.errors[ERROR]]]).T
        if point.family == LIVE:
            axes.plot(*line.T, color=INK, linewidth=1, linestyle=DASHED, zorder=2)
        elif point.family == family:
            axes.plot(*line.T, color=color, marker=marker, markersize=5.5, linewidth=1.3, zorder=3,
                      markeredgecolor=PAPER, markeredgewidth=0.5)  # fmt: skip
            lines.append((point.budget, line))
    return lines


def _least(points: Sequence[Point]) -> Line:
    """The least error of all rows that a client can draw, at each size that they share."""
    for_clients = [p for p in points if p.family not in EMULATED]
    sizes = sorted(set.intersection(*(set(p.pixels) for p in for_clients)))
    of = [[p.errors[ERROR][p.pixels.index(s)].mean for p in for_clients] for s in sizes]
    return np.array([sizes, [min(errors) for errors in of]]).T


def _framed(figure: Figure, title: str, key: str) -> None:
    """Title above, key below; then settle where everything is, so that words can be placed."""
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    figure.supxlabel(key, x=0.99, ha="right", fontsize=7.5, color=FAINT)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # settled: saving need not do it again


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
    text = _named_apart(text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{described}" ', 1)


def _named_apart(text: str) -> str:
    """With ids of its own, so that a page may hold several figures."""
    own = sha256(text.encode()).hexdigest()[:8]
    text = re.sub(r'\bid="', f'id="{own}-', text)
    text = text.replace('xlink:href="#', f'xlink:href="#{own}-')
    return text.replace("url(#", f"url(#{own}-")


def png(figure: Figure) -> bytes:
    """The figure as a PNG on white paper, words with a halo as page.css gives them."""
    for axes in figure.axes:
        for words in axes.texts:
            words.set_path_effects([withStroke(linewidth=HALO, foreground=PAPER)])
    stream = BytesIO()
    with rc_context(STYLE):
        figure.savefig(stream, format="png", dpi=110, facecolor=PAPER, metadata={"Software": None})
    return stream.getvalue()


def _error_label(points: Sequence[Point]) -> str:
    several = points[0].plants > 1
    return f"{METRICS[ERROR]}, " + ("median over plants" if several else "mean over views")


def _short(value: float) -> str:
    for factor, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:g} {unit}"
    return f"{value:g}"
