"""The reduction that levels are compared with, by the program itself."""

from __future__ import annotations

import os

import pytest
from programs import MARKS, PACKAGES

from vegtool.baselines import baseline
from vegtool.growth import sample

pytestmark = MARKS


def test_gltfpack_reduces_a_plant(monkeypatch: pytest.MonkeyPatch) -> None:
    """A statue is closed and smooth: nothing hinders its reduction to a tenth."""
    path = f"{PACKAGES / '.bin'}{os.pathsep}{os.environ['PATH']}"
    monkeypatch.setenv("PATH", path)
    plant = sample("statue", 5000)
    made = baseline(plant, "gltfpack", 500)
    assert made.missing == ""
    assert 0.5 * 500 < made.triangles < 1.5 * 500
