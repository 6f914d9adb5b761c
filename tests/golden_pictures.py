"""Golden pictures: what was drawn once, looked at and kept, against what is drawn now.

`VEGTOOL_REGENERATE=1 scripts/test` keeps what is drawn now instead; look at the pictures before
committing them. A mismatch leaves the picture and its difference in tests/golden/differences.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from PIL import Image

FOLDER = Path(__file__).parent / "golden"
MEAN_DIFFERENCE = 1.5
"""Grey levels of 255, over all pixels: what another version of the software renderer may change."""


def assert_golden(name: str, picture: np.ndarray) -> None:
    """Hold an (h, w, 3) uint8 picture against tests/golden/NAME.png."""
    path = FOLDER / f"{name}.png"
    if os.environ.get("VEGTOOL_REGENERATE"):
        Image.fromarray(picture).save(path, optimize=True)
        return
    assert path.exists(), f"no golden picture {path}; make it with VEGTOOL_REGENERATE=1"
    golden = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert golden.shape == picture.shape
    difference = np.abs(golden - picture)
    if difference.mean() <= MEAN_DIFFERENCE:
        return
    folder = FOLDER / "differences"
    folder.mkdir(exist_ok=True)
    Image.fromarray(picture).save(folder / f"{name}.png")
    Image.fromarray((255 - difference).astype(np.uint8)).save(folder / f"{name}_difference.png")
    raise AssertionError(
        f"{name}: differs from its golden picture by {difference.mean():.2f} grey levels on"
        f" average (at most {MEAN_DIFFERENCE}); see {folder}"
    )
