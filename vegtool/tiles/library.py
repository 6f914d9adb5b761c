"""The plants that a landscape is made of: each with its levels and where they take over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, overload

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.errors import InputError
from vegtool.formats import READERS, ReadOptions, read_plant
from vegtool.formats.beside import find_beside
from vegtool.formats.gltf_surfels import read_surfel_set
from vegtool.formats.manifest import read_manifest
from vegtool.limits import Limits
from vegtool.lod import FADE_FRACTION, Display
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.surfel_set import SurfelSet

MANIFEST = ".lod.json"


@dataclass(frozen=True)
class Stored(Sequence[Plant]):
    """Plants that are read anew each time they are asked for: nobody keeps what nobody looks at.

    shift: (x, y, z) metres by which they are moved. Raises InputError, when asked, for a file that
    is missing or broken.
    """

    files: tuple[Path, ...]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __len__(self) -> int:
        return len(self.files)

    @overload
    def __getitem__(self, index: int) -> Plant: ...
    @overload
    def __getitem__(self, index: slice) -> Stored: ...
    def __getitem__(self, index: int | slice) -> Plant | Stored:
        if isinstance(index, slice):
            return replace(self, files=self.files[index])
        return moved(read_plant(self.files[index]), np.array(self.shift))


@dataclass(frozen=True)
class StoredSurfels:
    """Surfels of which a plant is drawn from afar, read when they are asked for.

    switch_m, fade: as of Species; any prefix is drawn beyond. shift: (x, y, z) metres.
    """

    file: Path
    switch_m: float
    fade: float
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def read(self) -> SurfelSet:
        """Raises InputError for a file that is missing or broken."""
        return read_surfel_set(self.file).moved(np.array(self.shift))


def moved(plant: Plant, shift: FloatArray) -> Plant:
    """A plant elsewhere, by (3,) metres; nobody needs its branches there."""
    if not shift.any():
        return plant
    return replace(plant, positions=plant.positions + shift, branches=None)


@dataclass(frozen=True, eq=False)
class MadeFor:
    """Of levels that are for the eyes of a scene alone.

    bounds: (2, 3) metres of the original. original: whether that is the first of the levels.
    manifest: which says so. left_out: what is missing of what any eye would need.
    """

    limits: Limits
    bounds: FloatArray
    original: bool
    manifest: Path
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Species:
    """A plant and its levels, as files give them.

    levels: the original, then coarser and coarser; a tuple, or Stored: those that are triangles.
    surfels: what follows them, or None. switch_m: (n,) metres, from
    where each may be used, 0 for the original, in pictures in which a metre at a distance of one is
    `focal_px` pixels. fade: (n,) share of that distance along which it replaces the one before.
    files: where each was read. error_m: (n,) metres, no more than which 95 % of each is from where
    the original has it; NaN where nobody measured that. What is asked of all levels is read once,
    and kept when a species goes to another process.
    """

    name: str
    levels: Sequence[Plant]
    switch_m: FloatArray
    fade: FloatArray
    focal_px: float
    files: tuple[Path, ...]
    error_m: FloatArray = field(default_factory=lambda: np.empty(0))
    surfels: StoredSurfels | None = None
    made_for: MadeFor | None = None

    def __post_init__(self) -> None:
        count = len(self.levels)
        error = np.array(self.error_m) if self.error_m.size else np.full(count, np.nan)
        if error.shape != (count,) or (error < 0).any():
            raise ValueError("Species.error_m: expected a length for each level, or NaN")
        object.__setattr__(self, "error_m", error)
        for name in ("switch_m", "fade"):
            value = checked(f"Species.{name}", getattr(self, name), (count,), np.float64)
            object.__setattr__(self, name, value)
        if not count or self.switch_m[0] != 0 or (np.diff(self.switch_m) <= 0).any():
            raise ValueError("Species.switch_m: expected 0, then ascending distances")
        if self.surfels is not None and self.surfels.switch_m <= self.switch_m[-1]:
            raise ValueError("Species.surfels: expected a distance beyond that of all levels")

    @cached_property
    def _outline(self) -> tuple[FloatArray, IntArray]:
        """The two that follow."""
        bounds, faces = [], []
        for level in self.levels:
            bounds.append(level.bounds)
            faces.append(len(level.faces))
        return np.array(bounds), np.array(faces, np.int32)

    @property
    def bounds(self) -> FloatArray:
        """(n, 2, 3) metres: of each level, the least and the greatest coordinates."""
        return self._outline[0]

    @property
    def triangles(self) -> IntArray:
        """(n,) int32 of each level."""
        return self._outline[1]

    @property
    def limits(self) -> Limits | None:
        """The eyes that the levels are for; None for any."""
        return None if self.made_for is None else self.made_for.limits

    @property
    def whole(self) -> bool:
        """Whether the first level is the original."""
        return self.made_for is None or self.made_for.original

    @property
    def original_bounds(self) -> FloatArray:
        """(2, 3) metres: of the original, whether it is among the levels or not."""
        return self.bounds[0] if self.made_for is None else self.made_for.bounds

    @property
    def extent(self) -> float:
        """Metres: the longest side of the original."""
        return float(np.ptp(self.original_bounds, axis=0).max())

    @property
    def height(self) -> float:
        """Metres, of the original above its foot."""
        return float(self.original_bounds[1, 1])

    @property
    def size(self) -> float:
        """Metres: nothing of the original is farther from its foot."""
        return float(np.linalg.norm(np.abs(self.original_bounds).max(axis=0)))

    def moved(self, shift: FloatArray) -> Species:
        """The plant elsewhere, by (3,) metres."""
        levels: Sequence[Plant]
        x, y, z = shift.tolist()
        surfels = None if self.surfels is None else replace(self.surfels, shift=(x, y, z))
        made_for = self.made_for
        if made_for is not None:
            made_for = replace(made_for, bounds=made_for.bounds + shift)
        if isinstance(self.levels, Stored):
            levels = replace(self.levels, shift=(x, y, z))
        else:
            levels = tuple(moved(level, shift) for level in self.levels)
        return replace(self, levels=levels, surfels=surfels, made_for=made_for)


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
    found = stored_species(path)
    levels = []
    for index, file in enumerate(found.files):
        progress(f"{found.name}: {file.name}", index / len(found.files))
        levels.append(read_plant(file))
    return replace(found, levels=tuple(levels))


def stored_species(path: Path) -> Species:
    """The plant of a manifest, whose levels are read when they are asked for.

    Raises InputError where the manifest is missing or broken, or a file that it names is missing.
    """
    told = read_manifest(path)
    shown = Display(told["fov_y_deg"], told["image_height_px"])
    names = [told["combined"]["file"], *(level["file"] for level in told["levels"][1:])]
    files = []
    for name in names:
        file = find_beside(path, name)
        if file is None:
            raise InputError(
                f"{path}: expected the file {name} that it names beside it, found none. Convert "
                "the plant again."
            )
        files.append(file)
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
    errors = [level["geometric_error_m"] for level in told["levels"]]
    error = np.array([np.nan if one is None else one["p95"] for one in errors], np.float64)
    points = [index for index, level in enumerate(told["levels"]) if level["kind"] == "surfels"]
    surfels, count = None, len(files)
    if points:  # those that follow are parts of the first, and levels of triangles come before
        count = points[0]
        surfels = StoredSurfels(files[count], float(distances[count]), float(fade[count]))
    stored = Stored(tuple(files[:count]))
    return Species(
        told["name"], stored, distances[:count], fade[:count], focal, stored.files, error[:count],
        surfels, _made_for(path, told),
    )  # fmt: skip


def _made_for(manifest: Path, told: dict[str, Any]) -> MadeFor | None:
    """The eyes that the levels of a manifest are for; None for any."""
    if "scene" not in told:
        return None
    scene = told["scene"]
    farthest, azimuth, elevation = scene["farthest_m"], scene["azimuth_deg"], scene["elevation_deg"]
    limits = Limits(
        scene["digest"], scene["nearest_m"], inf if farthest is None else farthest,
        (azimuth["start"], azimuth["extent"]), (elevation["low"], elevation["high"]),
        Display(scene["fov_y_deg"], scene["image_height_px"]),
    )  # fmt: skip
    bounds = np.array(scene["bounds_m"], np.float64)
    if bounds.shape != (2, 3) or (bounds[0] > bounds[1]).any():
        raise InputError(
            f"{manifest}: scene.bounds_m: expected the least and the greatest corner, (x, y, z) "
            f"each, found {scene['bounds_m']!r:.60}. Convert the plant again."
        )
    left_out = tuple(one["what"] for one in scene["left_out"])
    return MadeFor(limits, bounds, scene["original"], manifest, left_out)
