"""The report as one page that needs nothing else: no outside address, light and dark, any width."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib import resources

from vegtool.measure.metrics import METRICS
from vegtool.report.plots import COST_AXES, error_against, error_against_distance, svg
from vegtool.report.rows import PlantReport, Report
from vegtool.report.summary import Point, medians, points
from vegtool.report.tables import closest, making, tables

SEEN = {
    "all": "all around",
    "ground": "near the ground, as a walker sees it",
    "aerial": "above the horizon, as from the air",
}
"""Where views lie (measure/views.py)."""


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
        + closest(found)
        + _plots(found, f"medians of {len(report.plants)} plants")
        + tables(found)
    )


def _plant(plant: PlantReport) -> str:
    found = points(plant)
    notes = "".join(f"<li>{escape(note)}</li>" for note in plant.notes)
    return (
        f'<p class="facts">{plant.triangles:,} triangles, {plant.extent_m:.3g} metres. '
        f"{escape(plant.source)}</p>"
        + (f"<ul>{notes}</ul>" if notes else "")
        + closest(found)
        + _strips(plant)
        + _plots(found, plant.name)
        + tables(found)
        + making(plant)
    )


def _plots(found: Sequence[Point], of: str) -> str:
    drawn = [(cost.title, error_against(found, cost, cost.title)) for cost in COST_AXES]
    far = "Error against distance"
    drawn.append((far, error_against_distance(found, far)))
    return "".join(  # plants are named outside: a plot cannot show every name
        f'<figure class="plot">{svg(figure, escape(f"{title}: {of}", quote=True))}</figure>'
        for title, figure in drawn
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
        "Everything else is drawn as an engine does: mip-mapped textures, 4x anisotropy, alpha "
        "tested once per pixel, 4x multisampling. The original drawn so is called live, and is the "
        "line to beat: leaves lose coverage under mip-mapping, so that a good level of detail is "
        "closer to the truth than the model itself.</p>"
        "<p>Levels called refined are those that vegtool convert makes; their time includes the "
        "pictures of the original that they are made by, from six views. Of a model that a mesh "
        "can hold whole, they are hybrids where these err less. Hybrids are part mesh and part "
        "billboards, --method hybrid. Surfel billboards are cut out of a hierarchy, --method "
        "surfel-billboards; their time includes making it. Surfels are points, --method surfels, "
        "drawn as discs by vegtool preview. Branches, isodata, kmeans and planes "
        "are the paper's method, --refine none, by what its clusters are like.</p>"
        "<p>The pale band is the Pareto front: rows that no other beats in both error and cost. "
        "Times are of the machine and the renderer named above and compare rows of this page only. "
        "The octahedral impostor needs a shader of its own, which no stock client has; it is "
        "emulated, for orientation.</p>"
        f"<dl>{metrics}</dl></section>"
    )


def _resource(name: str) -> str:
    return resources.files("vegtool.report").joinpath(name).read_text(encoding="utf-8")
