"""The programs of others that the checks run: Node.js, its packages, Chromium."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
PACKAGES = Path(os.environ.get("VEGTOOL_NODE_MODULES", HERE / "node_modules"))
MODELS = Path(os.environ.get("VEGTOOL_MODELS", HERE.parents[2] / "shared" / "models"))
BROWSERS = (
    os.environ.get("VEGTOOL_CHROMIUM", ""),
    "chromium",
    "chromium-browser",
    "google-chrome",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
)
BROWSER = next(filter(None, map(shutil.which, filter(None, BROWSERS))), None)


def missing() -> str | None:
    """What is not here that the checks need."""
    if shutil.which("node") is None:
        return "needs Node.js"
    if not all((PACKAGES / name).is_dir() for name in ("three", "3d-tiles-renderer")):
        return "needs npm packages: tests/clients/run installs them"
    if BROWSER is None:
        return "needs Chromium"
    return None


MARKS = [
    pytest.mark.clients,
    # where these checks are demanded, a missing part is a failure
    pytest.mark.skipif(bool(missing()) and not os.environ.get("CI"), reason=missing() or ""),
]


def node(script: str, job: Any) -> list[dict[str, Any]]:
    """Run one of the programs beside this file; return the objects that it prints."""
    done = subprocess.run(
        ["node", HERE / script],
        input=json.dumps(job),
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, "VEGTOOL_NODE_MODULES": str(PACKAGES), "VEGTOOL_CHROMIUM": str(BROWSER)},
    )
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]
