"""How species come by levels that tiles need: models by conversion, converted plants that end early
by levels that go on from their coarsest one.

Each is made once and kept (cache.py). Levels that go on are made as the others were: of the
original, with the options that the manifest tells, half as many triangles each time for half the
size on the screen. The user's files stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from math import log2
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.convert import (
    LEVEL_RATIO,
    MOST_OF_PREVIOUS,
    NEAR_LIMITS,
    SURFELS,
    TRIANGLES_PER_BILLBOARD,
    ConvertOptions,
    convert,
)
from vegtool.errors import InputError, QualityError, UsageError, VegtoolError, unknown
from vegtool.formats import ReadOptions, read_plant, read_with_files
from vegtool.formats.gltf import write_chain
from vegtool.formats.manifest import read_manifest
from vegtool.lod import FADE_FRACTION, Display, Level, LodChain
from vegtool.measure.distances import rounded_up
from vegtool.measure.options import MeasureOptions
from vegtool.options import check_limits
from vegtool.progress import Progress, silent
from vegtool.tiles.cache import filling, place_of
from vegtool.tiles.library import Species, Stored, stored_species
from vegtool.tiles.limits import without_original
from vegtool.tiles.named import Source, stem
from vegtool.tiles.species import check_height, shift_of

LEVELS = 9
"""Of a model that is converted: the last has 2 billboards, for NEAR_LIMITS[0] pixels."""
FEW = 16
"""Triangles of a coarsest level that needs none after it: those of nine levels end with 4 to 16."""


@dataclass(frozen=True)
class Work:
    """A chain of levels that is to be made of a plant, unless it is kept in the folder `place`."""

    source: Source
    place: Path
    read: ReadOptions
    convert: ConvertOptions
    measure: MeasureOptions

    @property
    def name(self) -> str:
        """That of the plant."""
        return stem(self.source.path)


def work_of(source: Source, library: Path) -> Work | None:
    """What is to be made of a plant; None where it has all levels.

    Raises InputError and UsageError for what is missing or broken.
    """
    return _following(source, library) if source.converted else _of_model(source, library)


def make(work: Work, progress: Progress = silent) -> tuple[str, ...]:
    """Make a chain of levels and put it into its place; returns sentences for the user.

    Raises OutputError where it cannot be kept, and the errors of reading and converting; all of
    them name the plant.
    """
    path = work.source.path
    what = f"the model of {work.name}" if work.source.converted else str(path)
    by_hand = (
        f"convert it by hand, vegtool convert {what} --levels {LEVELS} -o FOLDER, and use that"
    )
    try:
        with filling(work.place, path, by_hand) as folder:
            how = _coarser if work.source.converted else _converted
            chain = how(work, progress)
            write_chain(chain, folder)
    except VegtoolError as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error
    except MemoryError as error:
        raise VegtoolError(f"{path}: not enough memory; fewer processes (-j) need less") from error
    except Exception as error:
        raise VegtoolError(f"{path}: {unknown(error)}") from error
    made = f"made its levels, of {_counts(chain.levels[1:])} triangles"
    if work.source.converted:
        made = f"made coarser levels, of {_counts(chain.levels[1:])} triangles"
    return (f"{path}: {made}; kept in {work.place}", *(f"{path}: {note}" for note in chain.notes))


def joined(manifests: Sequence[Path]) -> Species:
    """A plant whose levels are told by several manifests, each going on from where the one before
    ends: what is first in it is not drawn. Surfels follow all of them. Levels are read when they
    are asked for.

    Raises InputError for what is missing or broken.
    """
    first, *others = map(stored_species, manifests)
    for more in others:
        files = (*first.files, *more.files[1:])
        switch, surfels = np.concatenate([first.switch_m, more.switch_m[1:]]), first.surfels
        if surfels is not None:
            beyond = max(surfels.switch_m, float(np.nextafter(switch[-1], np.inf)))
            surfels = replace(surfels, switch_m=beyond)
        first = replace(
            first,
            levels=Stored(files),
            surfels=surfels,
            switch_m=switch,
            fade=np.concatenate([first.fade, more.fade[1:]]),
            files=files,
            error_m=np.concatenate([first.error_m, more.error_m[1:]]),
        )
    return first


def _of_model(source: Source, library: Path) -> Work:
    """How a model gets levels."""
    plant, files = read_with_files(source.path, source.read)
    check_height(source.path, plant.bounds + shift_of(plant.bounds))
    return _work(
        source, library, files, source.read, ConvertOptions(levels=LEVELS), MeasureOptions()
    )


def _converted(work: Work, progress: Progress) -> LodChain:
    plant = read_plant(work.source.path, work.read)
    chain = convert(plant, work.convert, work.measure, progress)
    options = {**asdict(work.read), **chain.options}
    notes = (*plant.notes, *chain.notes)
    return replace(chain, name=work.name, options=options, notes=notes)


def _following(source: Source, library: Path) -> Work | None:
    """How a converted plant gets coarser levels, where it lacks them."""
    base, told = stored_species(source.path), read_manifest(source.path)
    last = told["levels"][len(base.levels) - 1]
    if last["triangles"] <= FEW:
        return None
    read, how, measure = _options(source.path, told)
    alone = len(base.levels) == 1 and base.whole
    if alone:
        how = replace(how, levels=LEVELS)
        if how.method == SURFELS:  # tiles are merged of triangles
            how = ConvertOptions(levels=LEVELS, fov=how.fov, image_height=how.image_height)
    else:
        planes = max(1, last["triangles"] // (LEVEL_RATIO * TRIANGLES_PER_BILLBOARD))
        seen = Display(how.fov, how.image_height).pixels_per_metre(_last_from(base))
        pixels = float(np.clip(told["extent_m"] * seen / LEVEL_RATIO, *NEAR_LIMITS))
        levels = max(1, int(log2(planes)))
        how = replace(how, billboards=planes, pixels=pixels, levels=min(levels, LEVELS))
    files = [source.path, base.files[0], base.files[-1]]
    return _work(source, library, files, read, how, measure)


def _coarser(work: Work, progress: Progress) -> LodChain:
    """The levels that follow those of a manifest, and its coarsest in place of the original."""
    base, told = stored_species(work.source.path), read_manifest(work.source.path)
    last = told["levels"][len(base.levels) - 1]
    plant = read_plant(base.files[0], work.read)
    notes = without_original(base)
    try:
        chain = convert(plant, work.convert, work.measure, progress)
    except QualityError as error:
        notes.append(str(error))
        chain = LodChain(work.name, (), work.convert.display, work.convert.seed)
    triangles, after_m = last["triangles"], _last_from(base)
    alone = len(base.levels) == 1 and base.whole
    levels = [Level("mesh", mesh=base.levels[-1])]
    for level in chain.levels[1:]:
        lit_alike = alone or level.unlit == last.get("unlit", False)
        if level.triangles <= MOST_OF_PREVIOUS * triangles and lit_alike:
            least_m = rounded_up((1 + FADE_FRACTION) * after_m)
            if level.near_distance_m < least_m:
                level = replace(level, near_distance_m=least_m, measured=None)
            levels.append(level)
            triangles, after_m = level.triangles, level.near_distance_m
    options = {**asdict(work.read), **chain.options}
    return replace(
        chain, name=work.name, levels=tuple(levels), options=options, notes=tuple(notes),
        shadow=None,
    )  # fmt: skip


def _last_from(base: Species) -> float:
    """Metres from which on the last level is drawn; where that is all there is for the eyes of a
    scene, from the nearest one on."""
    if len(base.levels) > 1 or base.whole or base.limits is None:
        return float(base.switch_m[-1])
    ratio = base.focal_px / base.limits.display.pixels_per_metre(1.0)
    return base.limits.nearest_m * ratio


def _work(
    source: Source, library: Path, files: Sequence[Path], read: ReadOptions, how: ConvertOptions,
    measure: MeasureOptions,
) -> Work:  # fmt: skip
    told = {"name": stem(source.path), **asdict(read), **asdict(how), **asdict(measure)}
    return Work(source, place_of(library, files, told), read, how, measure)


def _options(
    manifest: Path, told: dict[str, Any]
) -> tuple[ReadOptions, ConvertOptions, MeasureOptions]:
    """What a plant was converted with, as far as its manifest tells. Its unit and its axis are
    those of the model: the original in the library is in metres, y up."""
    values = dict(told["options"])
    seen = {"fov": told["fov_y_deg"], "image_height": told["image_height_px"]}

    def of(kind: type, **others: Any) -> Any:
        known = {item.name for item in fields(kind)}
        found = kind(**{key: value for key, value in values.items() if key in known} | others)
        check_limits(found)
        return found

    try:
        leaves = tuple(values.get("leaf_materials", ()))
        how = of(ConvertOptions, shadow_proxy=None, **seen)
        return ReadOptions(leaf_materials=leaves), how, of(MeasureOptions)
    except (UsageError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{manifest}: options: expected those of vegtool convert, found others ({error}). "
            "Convert the plant again."
        ) from error


def _counts(levels: Sequence[Level]) -> str:
    return ", ".join(f"{level.triangles:,}" for level in levels) or "no"
