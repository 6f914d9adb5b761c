"""The plants that are judged."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample

ROOT = Path(__file__).resolve().parents[2]
MODELS = {
    "ash": "eztree_ash_small/eztree_ash_small.glb",
    "pine": "eztree_pine_medium/eztree_pine_medium.glb",
    "birch": "sapling_birch_lv2/sapling_birch_lv2.glb",
    "bush": "sapling_callistemon_bush/sapling_callistemon_bush.glb",
    "commontree": "q_mega_commontree_1/gltf/CommonTree_1.gltf",
}
SAMPLES = ("broadleaf", "conifer", "bush")
QUICK = 2


def wanted(words: Sequence[str], quick: bool, folder: Path) -> dict[str, Path]:
    """Name and file of each plant: those named or given as files, else all, or the first QUICK.

    Samples, which are written to `folder`, stand in where there is none of the models.
    """
    models = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    there = {name: models / file for name, file in MODELS.items() if (models / file).exists()}
    if not there:
        for name in SAMPLES:
            file = folder / f"{name}-sample.glb"
            file.write_bytes(plant_glb(sample(name)))
            there[file.stem] = file
    found = {}
    for word in words:
        file = Path(word)
        if word not in there and not file.is_file():
            raise SystemExit(f"expected a file or one of {', '.join(there)}; got {word}")
        found[file.stem] = there.get(word, file)
    return found or dict(list(there.items())[: QUICK if quick else None])
