"""What a person sees."""

from __future__ import annotations

import json
import sys

import pytest

from vegtool.console import Console, human_bytes, table


def test_words_stand_left_and_numbers_right() -> None:
    assert table(("a", "n"), [("x", "5"), ("long", "12")]) == "a      n\nx      5\nlong  12"


@pytest.mark.parametrize(
    ("count", "said"),
    [(0, "0 B"), (999, "999 B"), (1500, "1.5 kB"), (64_000, "64 kB"), (3e9, "3000 MB")],
)
def test_bytes_as_a_person_says_them(count: float, said: str) -> None:
    assert human_bytes(count) == said


def test_json_goes_to_stdout_and_sentences_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(0, as_json=True)
    console.say("a note")
    console.result({"n": 1}, "for people")
    caught = capsys.readouterr()
    assert json.loads(caught.out) == {"n": 1}
    assert caught.err == "a note\n"


def test_quiet_prints_nothing_but_errors(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(-1)
    console.say("a note")
    console.say("an error", at=-1)
    console.result({}, "for people")
    assert capsys.readouterr() == ("", "an error\n")


def test_a_long_name_or_one_like_markup_leaves_the_bar_its_figures(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr("vegtool.console.BAR_AFTER_SECONDS", -1.0)
    for name, value in (("COLUMNS", "80"), ("TERM", "xterm"), ("NO_COLOR", "1")):
        monkeypatch.setenv(name, value)
    with Console().bar("convert") as progress:
        progress(f"a[blue]{'n' * 200}", 0.4)
    shown = capsys.readouterr().err
    assert "convert  a[blue]nnn" in shown
    assert "40 % 0:00:00" in shown
