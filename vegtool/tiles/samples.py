"""Species as surfels that squares are sampled from: each made once, and kept in the library.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.4. Where plants of a species stand in a square, a prefix
of these stands for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import VegtoolError
from vegtool.formats.glb import Document
from vegtool.formats.gltf_surfels import add_surfels, read_surfel_set
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.surfel_set import Spacing, SurfelSet
from vegtool.tiles.cache import filling, place_of
from vegtool.tiles.library import Species, Stored
from vegtool.workers import WORKER_DIED, side_by_side

COUNT = 50_000
"""Surfels of a species, at most."""
FILE = "surfels.glb"
"""In the folder that a cache has for them."""


@dataclass(frozen=True)
class Sample:
    """Where the surfels of a species are, whose foot is at the origin once they are moved by shift,
    (3,) metres. digest: of all that they are made from. made: whether they are in a cache, or the
    user's own."""

    species: Species
    file: Path
    digest: str
    made: bool
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def read(self) -> SurfelSet:
        """Raises InputError for a file that is missing or broken."""
        return read_surfel_set(self.file).moved(np.array(self.shift))


def samples_of(
    species: Sequence[Species], library: Path, workers: int = 1, progress: Progress = silent
) -> tuple[Sample, ...]:
    """Those of species. What is missing is made, in so many processes.

    Raises InputError for files that cannot be read, OutputError where the library has no room,
    CapabilityError where nothing can draw.
    """
    found = [_sample(one, library) for one in species]
    wanted = [one for one in found if one.made and not _there(one.file.parent)]
    wanted = list({one.file: one for one in wanted}.values())

    def of(one: Sample) -> Progress:
        def report(stage: str, fraction: float) -> None:
            progress(f"surfels of {one.species.name}: {stage}", fraction)

        return report

    def died(one: Sample) -> None:
        raise VegtoolError(f"{one.species.files[0]}: {WORKER_DIED}")

    for _ in side_by_side(_make, wanted, died, workers, of):
        pass
    return tuple(found)


def _sample(one: Species, library: Path) -> Sample:
    """Of the species' own surfels, where it has some, else of its original."""
    own = one.surfels
    if own is not None:
        digest = place_of(library, [own.file], {"shift": own.shift}).name
        return Sample(one, own.file, digest, False, own.shift)
    shift = one.levels.shift if isinstance(one.levels, Stored) else (0.0, 0.0, 0.0)
    place = place_of(library, [one.files[0]], {"surfels": COUNT, "shift": shift})
    return Sample(one, place / FILE, place.name, True)


def _there(place: Path) -> bool:
    return (place / FILE).is_file()


def _make(one: Sample, progress: Progress) -> None:
    by_hand = "convert the plant with --method surfels, and use that"
    with filling(one.file.parent, one.species.files[0], by_hand, _there) as folder:
        document = Document()
        surfels = surfels_of_plant(one.species.levels[0], progress)
        document.show(add_surfels(document, surfels, one.species.name, np.zeros(3)))
        (folder / FILE).write_bytes(document.glb())


def surfels_of_plant(plant: Plant, progress: Progress = silent) -> SurfelSet:
    """COUNT surfels of a plant, or as many as there are places of it that are seen, or one to each
    triangle of one of which nothing is: it may be a sliver. Raises CapabilityError where nothing
    can draw."""
    from vegtool.gl.upload import PlantBuffers
    from vegtool.surfels.blue.level import resolution_for
    from vegtool.surfels.blue.make import surfels_of

    with PlantBuffers(plant) as buffers:
        found = surfels_of(buffers, COUNT, resolution=resolution_for(COUNT), progress=progress)
    return found if len(found) else _of_faces(plant)


def _of_faces(plant: Plant) -> SurfelSet:
    """The first COUNT triangles, each at its middle."""
    faces = plant.faces[:COUNT]
    middle: FloatArray = plant.positions[faces].mean(axis=1)
    normal = np.tile([0.0, 1.0, 0.0], (len(faces), 1))
    colors = np.array([one.base_color[:3] for one in plant.materials])
    color = colors[plant.face_material[: len(faces)]]
    return SurfelSet(middle, normal, color, Spacing(1, 0.0, len(faces)))
