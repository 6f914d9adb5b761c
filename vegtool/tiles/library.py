"""The plants that a landscape is made of: each with its levels and where they take over."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray, checked
from vegtool.errors import InputError
from vegtool.formats import READERS, ReadOptions, read_plant
from vegtool.formats.beside import find_beside
from vegtool.formats.manifest import read_manifest
from vegtool.lod import FADE_FRACTION, Display
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

MANIFEST = ".lod.json"


@dataclass(frozen=True, eq=False)
class Species:
    """A plant and its levels, as files give them.

    levels: the original, then coarser and coarser. switch_m: (n,) metres, from where each may be
    used, 0 for the original, in pictures in which a metre at a distance of one is `focal_px`
    pixels. fade: (n,) share of that distance along which it replaces the one before. files: where
    each was read.
    """

    name: str
    levels: tuple[Plant, ...]
    switch_m: FloatArray
    fade: FloatArray
    focal_px: float
    files: tuple[Path, ...]

    def __post_init__(self) -> None:
        count = len(self.levels)
        for name in ("switch_m", "fade"):
            value = checked(f"Species.{name}", getattr(self, name), (count,), np.float64)
            object.__setattr__(self, name, value)
        if not count or self.switch_m[0] != 0 or (np.diff(self.switch_m) <= 0).any():
            raise ValueError("Species.switch_m: expected 0, then ascending distances")

    @property
    def height(self) -> float:
        """Metres, of the original above its foot."""
        return float(self.levels[0].bounds[1, 1])

    @property
    def size(self) -> float:
        """Metres: nothing of the original is farther from its foot."""
        return float(np.linalg.norm(np.abs(self.levels[0].bounds).max(axis=0)))


def read_library(path: Path, read: ReadOptions, progress: Progress = silent) -> list[Species]:
    """The plants at a path: a manifest, a folder of manifests as `convert` writes it, or a model,
    which has no other levels.

    Raises InputError for what is missing or broken, and for a folder without plants.
    """
    manifests = [path] if path.name.endswith(MANIFEST) else []
    if path.is_dir():
        manifests = sorted(path.glob(f"*{MANIFEST}"))
        if not manifests:
            raise InputError(
                f"{path}: expected a folder that vegtool convert wrote (NAME{MANIFEST}), found no "
                "manifest in it. Convert a plant into it, or name a model file."
            )
    if not manifests:
        if not path.exists():
            known = ", ".join(READERS)
            raise InputError(
                f"{path}: expected a folder of converted plants, a manifest (NAME{MANIFEST}) or a "
                f"model ({known}); found nothing there. Check the path."
            )
        plant = read_plant(path, read)
        focal = Display().pixels_per_metre(1.0)
        return [Species(plant.name, (plant,), np.zeros(1), np.zeros(1), focal, (path,))]
    found = []
    for index, manifest in enumerate(manifests):

        def report(stage: str, fraction: float, index: int = index) -> None:
            progress(stage, (index + fraction) / len(manifests))

        found.append(read_species(manifest, report))
    return found


def read_species(path: Path, progress: Progress = silent) -> Species:
    """The plant of a manifest. Raises InputError where it, or a file that it names, is missing or
    broken."""
    told = read_manifest(path)
    shown = Display(told["fov_y_deg"], told["image_height_px"])
    names = [told["combined"]["file"], *(level["file"] for level in told["levels"][1:])]
    files, levels = [], []
    for index, name in enumerate(names):
        progress(f"{told['name']}: {name}", index / len(names))
        file = find_beside(path, name)
        if file is None:
            raise InputError(
                f"{path}: expected the file {name} that it names beside it, found none. Convert "
                "the plant again."
            )
        files.append(file)
        levels.append(read_plant(file))
    distances = np.array([level["switch_distance_m"] for level in told["levels"]], np.float64)
    if distances[0] != 0 or (np.diff(distances) <= 0).any():
        listed = ", ".join(f"{distance:g}" for distance in distances)
        raise InputError(
            f"{path}: expected switch distances that begin with 0 and ascend, found {listed}. "
            "Convert the plant again."
        )
    ends = np.array([level["fade_end_m"] for level in told["levels"]], np.float64)
    fade = np.full(len(names), FADE_FRACTION)
    fade[0] = 0.0
    np.divide(ends - distances, distances, out=fade, where=distances > 0)
    focal = shown.pixels_per_metre(1.0)
    return Species(told["name"], tuple(levels), distances, fade, focal, tuple(files))
