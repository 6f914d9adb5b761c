"""The page: it needs nothing else, holds every row, and is whole HTML."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import pytest
from report_cases import PIXELS, plant_report, report

from vegtool.report.page import page
from vegtool.report.plots import COST_AXES
from vegtool.report.write import csv_text, encoded, write

VOID = {"meta", "img", "br", "link"}


class Checker(HTMLParser):
    """Tags that are open; the words of table cells; addresses."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.cells = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self.cells += tag == "td"
        for name, value in attrs:
            if name in ("src", "href", "xlink:href") and value:
                self.addresses.append(value)
            if name == "id" and value:
                self.ids.append(value)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module", autouse=True)
def few_plots() -> Iterator[None]:
    """Plots are tests/report/test_plots.py's; here a few suffice."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vegtool.report.page.COST_AXES", COST_AXES[:1])
        yield


@pytest.fixture(scope="module")
def text() -> str:
    return page(
        replace(report(plant_report("oak"), plant_report("pine", 0.02)), failed={"ash": "x < y"})
    )


def test_it_needs_nothing_else(text: str) -> None:
    checker = Checker()
    checker.feed(text)
    assert not checker.open
    assert all(a.startswith(("#", "data:image/png")) for a in checker.addresses)
    assert not re.findall(r"url\((?!#)|@import|<link|src=\"http", text)
    assert {a[1:] for a in checker.addresses if a.startswith("#")} <= set(checker.ids)
    assert len(set(checker.ids)) == len(checker.ids)


def test_what_users_name_is_escaped(text: str) -> None:
    assert "a note &lt;of&gt; it" in text
    assert "x &lt; y" in text
    assert "llvmpipe &amp; co" in text


@pytest.mark.parametrize(
    "name", ["a$\\frac$b", "木", "bad\udcff", '"><script>x</script>', "n" * 240, "]]>-->"]
)
def test_a_plant_may_have_any_name_that_a_file_may(name: str, tmp_path: Path) -> None:
    """No formula, no letter that a font lacks, no markup, no bytes that are no Unicode."""
    made = report(plant_report(name))
    shown = escape(name).encode(errors="backslashreplace").decode()
    write(made, tmp_path, False, ())
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    checker = Checker()
    checker.feed(text)
    assert not checker.open
    assert f"<h2>{shown}</h2>" in text
    assert text.count("<script>") == 1


def test_each_plant_and_row_is_there_and_cells_that_beat_live_are_marked(text: str) -> None:
    assert all(f"<h2>{title}</h2>" in text for title in ("All plants", "oak", "pine"))
    assert text.count(">kmeans 64</td>") >= 3
    plain = page(report(plant_report()))
    marked = re.findall(r'<td class="better best" data-value="([^"]+)">', plain)
    assert "0.05" in marked, "the impostor beats live at 200 pixels"
    assert re.findall(r'<td class="better" data-value="0.08">', plain), "kmeans 64, at 50 pixels"


def test_the_tables_for_programs_hold_the_same() -> None:
    whole = report(plant_report("oak"), plant_report("pine", 0.02))
    lines = list(csv.DictReader(StringIO(csv_text(whole))))
    assert len(lines) == 2 * 5 * len(PIXELS)
    first = lines[2]
    assert (first["plant"], first["row"], first["pixels"]) == ("oak", "kmeans 64", "200")
    assert float(first["flip_mean"]) == pytest.approx(0.10)
    values = json.loads(json.dumps(encoded(whole), allow_nan=False))
    row = values["plants"][0]["rows"][1]
    assert row["errors"]["flip"][0]["mean"] == pytest.approx(0.10)
    assert row["values"]["flip"][0] == pytest.approx([0.09, 0.11])
    assert values["medians"][1]["name"] == "kmeans 64"
