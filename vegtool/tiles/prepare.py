"""Species made ready for tiles: those that plants are of, with levels down to a few triangles.

What is missing of them is made here, in one place and before everything else. Whoever reads the
species afterwards, in any process, reads files alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vegtool.arrays import IntArray
from vegtool.errors import VegtoolError
from vegtool.progress import Progress, silent
from vegtool.scene import Scene
from vegtool.tiles.cache import clean, kept
from vegtool.tiles.chains import Work, joined, make, work_of
from vegtool.tiles.inventory import Inventory
from vegtool.tiles.library import Species
from vegtool.tiles.named import Source, library_at
from vegtool.tiles.placement import Placement
from vegtool.tiles.species import check_height, folder_of, note_on_place, placed, source_of
from vegtool.workers import WORKER_DIED, side_by_side

LOOKING, MAKING = 0.1, 0.8
"""Shares of the time, where there is something to make."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """species: those that there are plants of; what is asked of all levels is known, and levels
    themselves are read when they are asked for (Stored), so that all of it goes to other processes
    in little room. placement: counts through them. notes: sentences for the user."""

    species: tuple[Species, ...]
    placement: Placement
    notes: tuple[str, ...]


def prepare(
    scene: Scene, placement: Placement, library: Path, workers: int = 1,
    progress: Progress = silent,
) -> Prepared:  # fmt: skip
    """The species of a scene's plants, from a folder of plants, or as the scene names their models.

    What is missing is made in so many processes, and kept in the folder. Raises InputError and
    UsageError for what is missing or broken, OutputError where the folder has no room for levels,
    and the errors of converting, which name the plant; nothing of that plant is kept then.
    """
    known = library_at(folder_of(library))
    placement, used = renumbered(placement, len(scene.species))
    sources = [source_of(known, scene, int(index)) for index in used]
    clean(known.folder)
    works: dict[Source, Work | None] = {}
    for source in dict.fromkeys(sources):
        progress(f"plants: {source.path.name}", LOOKING * len(works) / len(sources))
        works[source] = work_of(source, known.folder)
    wanted = [work for work in works.values() if work is not None and kept(work.place) is None]
    notes = _made(wanted, workers, lambda s, f: progress(s, LOOKING + MAKING * f))
    species = list[Species]()
    for index, source in zip(used, sources, strict=True):
        done = LOOKING + MAKING + (1 - LOOKING - MAKING) * len(species) / len(sources)
        progress(f"plants: {source.path.name}", done)
        one = joined(_manifests(source, works[source]))
        one, away = placed(replace(one, name=scene.species[int(index)].name or one.name))
        check_height(source.path, one.original_bounds)
        if away:
            notes.append(note_on_place(source.path, away))
        species.append(one)
    return Prepared(tuple(species), placement, tuple(dict.fromkeys(notes)))


def renumbered(placement: Placement, count: int) -> tuple[Placement, IntArray]:
    """A placement that counts through those of `count` species that it has plants of, and (u,)
    int32 which these are: of rules, all."""
    if not isinstance(placement, Inventory):
        return placement, np.arange(count, dtype=np.int32)
    there = np.bincount(placement.species, minlength=count) > 0
    number = (np.cumsum(there) - 1).astype(np.int32)
    found = replace(placement, species=number[placement.species])
    return found, np.flatnonzero(there).astype(np.int32)


def _made(works: Sequence[Work], workers: int, progress: Progress) -> list[str]:
    """Sentences on what was made, side by side."""
    number = {work: index for index, work in enumerate(works)}
    alone = workers <= 1 or len(works) <= 1

    def of(work: Work) -> Progress:
        def report(stage: str, fraction: float) -> None:
            share = (number[work] + fraction) / len(works) if alone else fraction
            progress(f"converting {work.name}: {stage}", share)

        return report

    def died(work: Work) -> tuple[str, ...]:
        raise VegtoolError(f"{work.source.path}: {WORKER_DIED}")

    return [note for notes in side_by_side(make, works, died, workers, of) for note in notes]


def _manifests(source: Source, work: Work | None) -> list[Path]:
    """Where the levels of a plant are told, the nearer ones first."""
    found = [source.path] if source.converted else []
    if work is not None:
        manifest = kept(work.place)
        if manifest is None:
            raise VegtoolError(
                f"{work.place}: expected the levels of {source.path}, which were there before; "
                "found none. Run it again, and leave the folder alone"
            )
        found.append(manifest)
    return found
