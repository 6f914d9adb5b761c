"""One plant before the camera: the truth, its level at each distance, and what stands beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from judge.chains import (
    DISTANCES,
    PLAIN,
    Chain,
    converted,
    gltfpacked,
    level_at,
    like,
    within,
)
from judge.photographs import HELD_OUT, STANDARD, TRUTH, Pictures, Shot, load, photograph
from vegtool.formats import read_plant
from vegtool.formats.gltf import plant_glb
from vegtool.plant import Plant

VIEWS = {"standard": STANDARD, "held-out": HELD_OUT}


@dataclass(frozen=True, eq=False)
class Sitting:
    """shown: the level at each of DISTANCES, as the manifest has it. files: what was drawn there,
    by name. taken: where the photographs are, by views, name and distance."""

    TRUTH: ClassVar = "truth"
    LIVE: ClassVar = "original, live"
    OURS: ClassVar = "vegtool"
    PLAIN: ClassVar = "plain"
    REDUCED: ClassVar = "gltfpack"

    plant: Plant
    chain: Chain
    shown: list[dict[str, Any]]
    files: dict[str, list[Path]]
    taken: dict[tuple[str, str, int], Path]

    @property
    def beside(self) -> list[str]:
        """What is compared with the truth."""
        return [name for name in self.files if name != self.TRUTH]

    def pictures(self, views: str, drawn: str, distance: int) -> Pictures:
        """From a set of views, at DISTANCES[distance]."""
        return load(self.taken[views, drawn, distance])


def sit(
    model: Path,
    options: str,
    sets: Sequence[str],
    folder: Path,
    cache: Path | None = None,
    stock_truth: bool = False,
) -> Sitting:
    """Convert a plant and photograph all of it, from the sets of VIEWS that are named.

    folder: of this plant alone. cache: keeps the photographs of originals from run to run.
    stock_truth: draw the truth with mip-maps too.
    """
    plant = read_plant(model)
    folder.mkdir()
    original = folder / "original.glb"
    original.write_bytes(plant_glb(plant))
    chain = within(model, folder / "levels", options, plant)
    shown = [level_at(chain, plant.radius * distance) for distance in DISTANCES]
    files = {
        Sitting.TRUTH: [original] * len(DISTANCES),
        Sitting.LIVE: [original] * len(DISTANCES),
        Sitting.OURS: [chain.file(level) for level in shown],
        **_plain(model, chain, shown, folder),
        **_reduced(original, shown, folder),
    }
    shots = {
        (views, drawn, i): Shot(
            files[drawn][i],
            tuple(plant.center.tolist()),
            plant.radius,
            distance,
            VIEWS[views],
            TRUTH if drawn == Sitting.TRUTH else 1,
            mipmaps=drawn != Sitting.TRUTH or stock_truth,
            keep=files[drawn][i] == original,
        )
        for views in sets
        for drawn in files
        for i, distance in enumerate(DISTANCES)
    }
    taken = photograph(list(shots.values()), folder / "photographs", cache)
    where = {key: taken[shot] for key, shot in shots.items()}
    return Sitting(plant, chain, shown, files, where)


def _plain(
    model: Path, chain: Chain, shown: Sequence[dict[str, Any]], folder: Path
) -> dict[str, list[Path]]:
    """The plain method's level of as many triangles as are shown, if it is not that already.

    Unmeasured: its levels are the same, and none is left out.
    """
    if PLAIN in chain.options:
        return {}
    plain = converted(model, folder / "plain", f"{chain.options} {PLAIN} --measure off")
    return {Sitting.PLAIN: [plain.file(like(plain, level["triangles"])) for level in shown]}


def _reduced(
    original: Path, shown: Sequence[dict[str, Any]], folder: Path
) -> dict[str, list[Path]]:
    """gltfpack's reduction to no fewer triangles than are shown, if it is here."""
    made = [gltfpacked(original, folder, level["triangles"]) for level in shown]
    found = [file for file in made if file]
    return {Sitting.REDUCED: found} if found else {}
