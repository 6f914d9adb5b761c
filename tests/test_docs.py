"""The documentation and the command line say the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer

from vegtool.cli import app

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
