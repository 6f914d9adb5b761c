"""The tables of a report's page: every row, what it costs and how wrong it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

from vegtool.lod import Spread
from vegtool.measure.metrics import GREATER_IS_BETTER, METRICS, SIGNED
from vegtool.report.plots import look
from vegtool.report.rows import EMULATED, LIVE, PlantReport, Row
from vegtool.report.summary import Point, families


@dataclass(frozen=True)
class Column:
    """A table's column: its head, a cell's words (HTML), the number that it is sorted by.

    worse: how bad a cell's value is, where rows compete; the least is the best.
    """

    head: str
    text: Callable[[Point], str]
    value: Callable[[Point], float | None]
    worse: Callable[[Point], float] | None = None


def closest(found: Sequence[Point]) -> str:
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


def tables(found: Sequence[Point]) -> str:
    """Every row with its cost and FLIP, then the other metrics, folded away."""
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


def making(plant: PlantReport) -> str:
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
