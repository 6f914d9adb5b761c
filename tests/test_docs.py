"""The documentation and the command line say the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer

from vegtool.cli import app
from vegtool.measure.metrics import METRICS

ROOT = Path(__file__).parent.parent
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_each_command_has_a_page_that_names_its_options(name: str) -> None:
    page = (ROOT / "docs" / "commands" / f"{name}.md").read_text(encoding="utf-8")
    options = [p for p in COMMANDS[name].params if p.param_type_name == "option"]
    real = {flag for option in options for flag in option.opts if flag.startswith("--")}
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", page))
    assert real - named == set(), "options that the page does not name"
    assert named - real == set(), "options that the page names and the command does not have"


PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("samples/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
        if not target.startswith(("http", "mailto")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_each_metric_is_defined_on_its_page() -> None:
    page = (ROOT / "docs" / "metrics.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == list(METRICS)


def test_each_benchmark_is_listed() -> None:
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    there = {path.name for path in ROOT.glob("benchmarks/*.py")} - {"recorded.py"}
    assert set(re.findall(r"`python benchmarks/(\w+\.py)", page)) == there


def test_each_room_is_on_the_map() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rooms = {path.name for path in (ROOT / "vegtool").iterdir() if path.suffix == ".py"}
    rooms |= {f"{path.parent.name}/" for path in ROOT.glob("vegtool/*/__init__.py")}
    named = set(re.findall(r"`([a-z_]+(?:\.py|/))`", page))
    assert {room for room in rooms if not room.startswith("__")} - named == set()
