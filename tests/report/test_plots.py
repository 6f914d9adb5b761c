"""Plots that stand on their own: nothing over anything, in the page's ink, the same every time."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from report_cases import plant_report

from vegtool.report.labels import Labels
from vegtool.report.plots import (
    COST_AXES,
    IN_PAGE,
    LOOKS,
    CostAxis,
    error_against,
    error_against_distance,
    look,
    png,
    svg,
)
from vegtool.report.rows import LIVE
from vegtool.report.summary import points

POINTS = points(plant_report())


@pytest.mark.parametrize("cost", COST_AXES, ids=lambda cost: cost.name)
def test_each_family_is_named_once_in_each_panel(cost: CostAxis) -> None:
    figure = error_against(POINTS, cost, "title")
    for axes in figure.axes:
        words = [t.get_text() for t in axes.texts]
        for family in {p.family for p in POINTS} - (
            {LIVE} if cost.name == "bake_seconds" else set()
        ):
            assert words.count(family) == 1


def test_the_front_is_of_what_clients_draw() -> None:
    """The impostor is the cheapest and the best, and takes a shader of its own."""
    figure = error_against(POINTS, COST_AXES[1], "title")
    band = next(line for line in figure.axes[0].lines if line.get_linewidth() > 5)
    assert np.asarray(band.get_xdata()).tolist() == [4, 32, 128, 10_000]


def test_an_svg_is_whole_and_takes_the_pages_ink() -> None:
    text = svg(
        error_against_distance(POINTS, "title"),
        'of "oak" & co'.replace('"', "&quot;").replace("& co", "&amp; co"),
    )
    root = ElementTree.fromstring(text)
    assert root.get("role") == "img"
    assert root.get("aria-label") == 'of "oak" & co'
    assert not any(color in text for color in IN_PAGE)
    assert "var(--ink)" in text
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(set(ids)) == len(ids)


def test_the_same_figure_gives_the_same_bytes() -> None:
    first, again = (svg(error_against(POINTS, COST_AXES[0], "t"), "t") for _ in range(2))
    assert first == again
    one, two = (png(error_against(POINTS, COST_AXES[0], "t")) for _ in range(2))
    assert one == two


def test_ids_of_two_figures_differ() -> None:
    """A page holds several, and a clip path of the one must not cut the other."""
    ids = []
    for cost in COST_AXES[:2]:
        root = ElementTree.fromstring(svg(error_against(POINTS, cost, "t"), "t"))
        ids.append({e.get("id") for e in root.iter() if e.get("id")})
    assert not ids[0] & ids[1]


def test_families_look_different() -> None:
    families = [*LOOKS, "one more", "another"]
    looks = [look(family, families) for family in families]
    assert len({color for color, _ in looks}) == len({marker for _, marker in looks}) == len(looks)


def test_words_beside_one_point_do_not_cover_each_other() -> None:
    figure = Figure(figsize=(4, 4))
    axes = figure.subplots()
    axes.set(xlim=(0, 2), ylim=(0, 2))
    point = np.array([[1.0, 1.0]])
    labels = Labels(axes, [point])
    for word in ("branches", "isodata", "kmeans"):
        labels.write(word, point, 8.0, "black")
    figure.draw_without_rendering()
    boxes = [t.get_window_extent() for t in axes.texts]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_words_that_have_no_room_are_left_out() -> None:
    figure = Figure(figsize=(1, 1))
    axes = figure.subplots()
    everywhere = np.array([[x, y] for x in np.linspace(0, 1, 20) for y in (0.0, 0.5, 1.0)])
    labels = Labels(axes, [everywhere])
    labels.write_if_free("1024", np.array([[0.5, 0.5]]), 8.0, "black")
    assert not axes.texts


def test_the_axis_of_a_single_row_of_panels_has_room_for_its_words() -> None:
    figure = error_against_distance(POINTS, "title")
    words = figure._supylabel.get_window_extent()  # type: ignore[attr-defined]
    title = figure._suptitle.get_window_extent()  # type: ignore[attr-defined]
    assert words.y0 >= 0
    assert words.y1 <= title.y0
