"""What this machine can do, and what is said where it cannot."""

from __future__ import annotations

import json
import sys

import pytest
import xvfb

from vegtool import doctor
from vegtool.cli import run
from vegtool.doctor import Check, diagnose

pytestmark = pytest.mark.gl


def named(name: str) -> Check:
    (check,) = (check for check in diagnose() if check.name == name)
    return check


def test_without_a_display_only_windows_are_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vegtool.gl.window._viewer_class", refuse)
    assert run(["doctor", "--json"]) == 0, "nothing else needs one"
    (row,) = (row for row in json.loads(capsys.readouterr().out) if row["name"] == "windows")
    assert not row["ok"] and not row["required"]
    assert "no display" in row["remedy"]


def refuse() -> None:
    from vegtool.errors import CapabilityError

    raise CapabilityError("no display")


def on_a_display() -> None:
    check = doctor._windows()
    assert check.ok and "pyrender" in check.found and not check.remedy


@pytest.mark.skipif(sys.platform != "linux", reason="Xvfb is X11's")
def test_with_a_display_there_are_windows() -> None:
    with xvfb.display() as name:
        xvfb.alone(on_a_display, environment={"DISPLAY": name})


@pytest.mark.parametrize(("package", "extra"), [("av", "video"), ("rasterio", "geo")])
def test_a_package_that_is_missing_is_named_with_its_extra(
    package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    check = named(package)
    assert not check.ok and not check.required
    assert check.remedy == f"pip install 'vegtool[{extra}]'"
