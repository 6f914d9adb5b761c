"""Shared by all tests: strict arithmetic, and the folder of real plants where there is one."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

# scikit-learn's joblib counts processors when first used, and warns in containers that show none.
os.environ.setdefault("LOKY_MAX_CPU_COUNT", "1")
np.seterr(divide="raise", over="raise", invalid="raise")

ROOT = Path(__file__).resolve().parent.parent


def models_folder() -> Path | None:
    """The folder of real plants: $VEGTOOL_MODELS, or ../shared/models beside the checkout."""
    folder = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    return folder if folder.is_dir() else None


@pytest.fixture(scope="session")
def models() -> Path:
    """The folder of real plants; the test is skipped where there is none."""
    folder = models_folder()
    if folder is None:
        pytest.skip("no folder of real plants: set VEGTOOL_MODELS, or have ../shared/models")
    return folder
