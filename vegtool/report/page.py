"""The report as one page that needs nothing else: no outside address, light and dark, any width."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources

from vegtool.lod import Spread
from vegtool.measure.metrics import METRICS
from vegtool.report.plots import COSTS, error_against, error_against_distance, look, svg
from vegtool.report.rows import EMULATED, LIVE, PlantReport, Report, Row
from vegtool.report.summary import Point, families, medians, points

SIGNED = ("coverage_bias", "color_bias")
"""Metrics whose best value is 0, from both sides."""
SEEN = {
    "all": "all around",
    "ground": "near the ground, as a walker sees it",
    "aerial": "above the horizon, as from the air",
}
"""Where views lie (measure/views.py)."""
GREATER_IS_BETTER = ("ssim", "psnr")


@dataclass(frozen=True)
class Column:
    """A table's column: its head, a cell's words (HTML), the number that it is sorted by.

    worse: how bad a cell's value is, where rows compete; the least is the best.
    """

    head: str
    text: Callable[[Point], str]
    value: Callable[[Point], float | None]
    worse: Callable[[Point], float] | None = None


def page(report: Report) -> str:
    """The whole page."""
    several = len(report.plants) > 1
    names = [p.name for p in report.plants]
    sections = [("all", "All plants", _all_plants(report))] if several else []
    sections += [(f"plant-{i}", p.name, _plant(p)) for i, p in enumerate(report.plants)]
    links = "".join(f'<a href="#{key}">{escape(title)}</a>' for key, title, _ in sections)
    body = "".join(
        f'<section id="{key}"><h2>{escape(title)}</h2>{text}</section>'
        for key, title, text in sections
    )
    return (
        "<!doctype html>\n"
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(", ".join(names))}: vegtool '
        'report</title><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{_resource('page.css')}</style></head><body>"
        f"{_head(report)}<nav>{links}<a href='#reading'>How to read this</a></nav>"
        f"{_failed(report)}{body}{_reading(report)}"
        f"<script>{_resource('page.js')}</script></body></html>\n"
    )


def _head(report: Report) -> str:
    names = [p.name for p in report.plants]
    what = names[0] if len(names) == 1 else f"{len(names)} plants"
    rows = len({row.name for plant in report.plants for row in plant.rows})
    count, where = report.options["view_count"], SEEN[report.options["views"]]
    return (
        f"<header><h1>{escape(what)}: error against run time</h1>"
        f"<p>What stands in for the plant at a distance, {rows} ways to make it, each drawn as a "
        f"client draws it and compared with the truth from {count} directions {where}, each "
        "under a sun of its own.</p>"
        f'<p class="facts">vegtool {escape(report.version)}. Drawn by '
        f"{escape(report.renderer)}.</p></header>"
    )


def _failed(report: Report) -> str:
    items = "".join(
        f"<li>{escape(name)}: {escape(error)}</li>" for name, error in report.failed.items()
    )
    return f"<h3>Not in this report</h3><ul>{items}</ul>" if items else ""


def _all_plants(report: Report) -> str:
    found = medians(report.plants)
    names = ", ".join(p.name for p in report.plants)
    return (
        f"<p>Medians over {len(report.plants)} plants: {escape(names)}.</p>"
        + _closest(found)
        + _plots(found, f"medians of {len(report.plants)} plants")
        + _tables(found)
    )


def _plant(plant: PlantReport) -> str:
    found = points(plant)
    notes = "".join(f"<li>{escape(note)}</li>" for note in plant.notes)
    return (
        f'<p class="facts">{plant.triangles:,} triangles, {plant.extent_m:.3g} metres. '
        f"{escape(plant.source)}</p>"
        + (f"<ul>{notes}</ul>" if notes else "")
        + _closest(found)
        + _strips(plant)
        + _plots(found, plant.name)
        + _tables(found)
        + _making(plant)
    )


def _plots(found: Sequence[Point], of: str) -> str:
    titles = {
        "bake_seconds": "Error against the time to make it",
        "triangles": "Error against triangles",
        "texture_bytes": "Error against bytes of textures",
        "frame_ms": "Error against frame time",
    }
    drawn = [(titles[cost.name], error_against(found, cost, titles[cost.name])) for cost in COSTS]
    far = "Error against distance"
    drawn.append((far, error_against_distance(found, far)))
    return "".join(  # plants are named outside: a plot cannot show every name
        f'<figure class="plot">{svg(figure, escape(f"{title}: {of}", quote=True))}</figure>'
        for title, figure in drawn
    )


def _closest(found: Sequence[Point]) -> str:
    """At each size the row that comes closest to the truth, beside the live original."""
    live = next(p for p in found if p.name == LIVE)
    rivals = [p for p in found if p is not live and p.family not in EMULATED]
    if not rivals:
        return ""
    lines = []
    for i, size in enumerate(live.pixels):
        best = min(rivals, key=lambda p: p.errors["flip"][i].mean)
        error, own = best.errors["flip"][i], live.errors["flip"][i]
        lines.append(
            [
                f"{size:g} pixels",
                best.name,
                f"{error.mean:.3f} ± {error.sd:.3f}",
                f"{own.mean:.3f} ± {own.sd:.3f}",
                f"{best.triangles:,.0f} of {live.triangles:,.0f}",
            ]
        )
    head = ["height", "closest to the truth", "its FLIP", "live original's", "triangles"]
    return _words_table(head, lines, "words")


def _tables(found: Sequence[Point]) -> str:
    others = [metric for metric in found[0].errors if metric != "flip"]
    more = "".join(
        f"<details><summary>{escape(METRICS[m])}</summary>{_metric_table(found, m)}</details>"
        for m in others
    )
    return "<h3>Every row</h3>" + _main_table(found) + more


def _main_table(found: Sequence[Point]) -> str:
    errors = [_error_column("flip", i, size) for i, size in enumerate(found[0].pixels)]
    costs = [
        _number("triangles", "triangles"),
        _number("billboards", "billboards"),
        _number("draw calls", "draw_calls"),
        _number("texels", "texels"),
        Column("file", lambda p: _size(p.bytes), lambda p: p.bytes),
        _number("fragments per pixel", "fragments_per_pixel", ".2f"),
        _number("seconds to make", "bake_seconds", ".2f"),
        Column("frame, ms", _frame, lambda p: p.frame_ms),
        _number("frame over live", "frame_ratio", ".2f"),
        _number("peak MB", "peak_mb"),
    ]
    if found[0].plants == 1:
        costs.append(Column("use from, m", _from, lambda p: p.switch_distance_m))
    caption = (
        f"{METRICS['flip']} at each height on the screen: mean ± standard deviation over "
        + ("plants (median in place of the mean)" if found[0].plants > 1 else "views")
        + ". Tinted: closer to the truth than the live original. Bold: the closest."
    )
    return _table(found, [*errors, *costs], caption)


def _metric_table(found: Sequence[Point], metric: str) -> str:
    columns = [_error_column(metric, i, size) for i, size in enumerate(found[0].pixels)]
    return _table(found, columns, f"{METRICS[metric]}; mean ± standard deviation, from low to high")


def _error_column(metric: str, index: int, size: float) -> Column:
    def of(point: Point) -> Spread:
        return point.errors[metric][index]

    def text(point: Point) -> str:
        value = of(point)
        title = f"{value.low:.3f} to {value.high:.3f}"
        sign = "+" if metric in SIGNED else ""
        return (
            f'<span title="{title}">{value.mean:{sign}.3f} <small>± {value.sd:.3f}</small></span>'
        )

    def worse(point: Point) -> float:
        mean = of(point).mean
        return -mean if metric in GREATER_IS_BETTER else abs(mean)

    return Column(f"{size:g} px", text, lambda p: of(p).mean, worse)


def _number(head: str, name: str, how: str = ",.0f") -> Column:
    def value(point: Point) -> float | None:
        found = getattr(point, name)
        return None if found is None else float(found)

    return Column(head, lambda p: _plain(value(p), how), value)


def _plain(value: float | None, how: str) -> str:
    return "" if value is None else f"{value:{how}}"


def _size(count: float | None) -> str:
    if count is None:
        return ""
    return f"{count / 1e3:,.0f} kB" if count < 1e6 else f"{count / 1e6:,.1f} MB"


def _frame(point: Point) -> str:
    low, high = point.frame_quartiles_ms
    return f"{point.frame_ms:.2f} <small>{low:.2f} to {high:.2f}</small>"


def _from(point: Point) -> str:
    if point.switch_distance_m is not None:
        return f"{point.switch_distance_m:g}"
    return f'<span title="{escape(point.why_not, quote=True)}">nowhere</span>'


def _table(found: Sequence[Point], columns: Sequence[Column], caption: str) -> str:
    live = next((p for p in found if p.name == LIVE), None)
    among = families(found)
    head = "".join(f"<th scope='col'>{escape(c.head)}</th>" for c in columns)
    best = [min(map(c.worse, found)) if c.worse else None for c in columns]
    body = []
    for point in found:
        cells = []
        for column, least in zip(columns, best, strict=True):
            kinds = []
            if column.worse is not None and live is not None:
                kinds += ["better"] if column.worse(point) < column.worse(live) else []
                kinds += ["best"] if column.worse(point) == least else []
            kind = f' class="{" ".join(kinds)}"' if kinds else ""
            value = column.value(point)
            sort = "" if value is None else f"{value:.6g}"
            cells.append(f'<td{kind} data-value="{sort}">{column.text(point)}</td>')
        color = look(point.family, among)[0] if point is not live else "var(--ink)"
        name = f'<span class="key" style="background:{color}"></span>{escape(point.name)}'
        kind = ' class="live"' if point is live else ""
        body.append(
            f'<tr{kind}><td data-value="{escape(point.name)}">{name}</td>{"".join(cells)}</tr>'
        )
    return (
        f'<p class="faint">{escape(caption)}</p><div class="scroll"><table class="sortable"><thead>'
        f"<tr><th scope='col'>row</th>{head}</tr></thead><tbody>{''.join(body)}</tbody>"
        "</table></div>"
    )


def _making(plant: PlantReport) -> str:
    """How long each stage took, and the bounds by formula, folded away."""
    stages = list(dict.fromkeys(stage for row in plant.rows for stage in row.cost.seconds))
    timed = [
        [row.name, *(_plain(row.cost.seconds.get(stage), ".3f") for stage in stages)]
        for row in plant.rows
        if row.cost.seconds
    ]
    bounded = [
        [row.name, *(f"{_pixels(e)} / {_pixels(b)} / {_pixels(t)}" for e, b, t in _bounds(row))]
        for row in plant.rows
        if row.projection_px
    ]
    sizes = [f"{size:g} px" for size in plant.rows[0].pixels]
    return (
        "<details><summary>Seconds by stage</summary>"
        + _words_table(["row", *stages], timed)
        + "</details><details><summary>Bounds by formula, pixels: e_p / the most that anything is"
        " displaced / e_t, of the worst billboard</summary>"
        + _words_table(["row", *sizes], bounded)
        + "</details>"
    )


def _bounds(row: Row) -> list[tuple[float | None, float | None, float | None]]:
    return list(zip(row.projection_px, row.bound_px, row.texel_px, strict=True))


def _pixels(value: float | None) -> str:
    return "none" if value is None else f"{value:.3g}"


def _words_table(head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    heads = "".join(f"<th scope='col'>{escape(h)}</th>" for h in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return (
        f'<div class="scroll"><table class="{kind}"><thead><tr>{heads}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _strips(plant: PlantReport) -> str:
    """Truth, live and the families side by side, magnified, at each size that was kept."""
    sizes = sorted({size for kept in plant.pictures.values() for size in kept}, reverse=True)
    return "".join(_strip(plant, size) for size in sizes)


def _strip(plant: PlantReport, size: int) -> str:
    rows = {row.name: row for row in plant.rows}
    shown = []
    for name, kept in plant.pictures.items():
        if size in kept:
            images = "".join(
                f'<img alt="{escape(name, quote=True)}" src="data:image/png;base64,'
                f'{b64encode(image).decode()}">'
                for image in kept[size]
            )
            facts = (
                f" <small>{rows[name].cost.triangles:,} triangles</small>" if name in rows else ""
            )
            caption = f"<figcaption>{escape(name)}{facts}</figcaption>"
            shown.append(f"<figure>{caption}{images}</figure>")
    return (
        f"<h3>{size} pixels high, magnified</h3><div class='strip'>{''.join(shown)}</div>"
        "<p class='faint'>Below each picture its difference from the truth by FLIP, from black "
        "(none) to yellow (all).</p>"
    )


def _reading(report: Report) -> str:
    metrics = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in METRICS.items()
    )
    return (
        "<section id='reading'><h2>How to read this</h2>"
        "<p>The truth is the original with 8 x 8 samples to the pixel, its alpha tested in each. "
        "Everything else is drawn as an engine does: mip-mapped textures, alpha tested once per "
        "pixel, 4x multisampling. The original drawn so is called live, and is the line to beat: "
        "leaves lose coverage under mip-mapping, so that a good level of detail is closer to the "
        "truth than the model itself.</p>"
        "<p>The pale band is the Pareto front: rows that no other beats in both error and cost. "
        "Times are of the machine and the renderer named above and compare rows of this page only. "
        "The octahedral impostor needs a shader of its own, which no stock client has; it is "
        "emulated, for orientation.</p>"
        f"<dl>{metrics}</dl></section>"
    )


def _resource(name: str) -> str:
    return resources.files("vegtool.report").joinpath(name).read_text(encoding="utf-8")
