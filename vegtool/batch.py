"""Files in, files out: one plant file converted and written, and many of them side by side.

One bad file does not stop the others, and each file's outputs appear whole or not at all.
"""

from __future__ import annotations

import re
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from vegtool.convert import ConvertOptions
from vegtool.errors import InputError, UsageError, VegtoolError, unknown
from vegtool.formats import READERS, ReadOptions, read_plant
from vegtool.limits import Limits
from vegtool.lod import LodChain, ShadowProxy
from vegtool.measure.options import MeasureOptions
from vegtool.progress import Progress, silent


@dataclass(frozen=True)
class Job:
    """One file to convert, and the name that its outputs carry."""

    source: Path
    name: str


@dataclass(frozen=True)
class Outcome:
    """What came of a job: files and their bytes, a row per level, a row on what throws the shadow,
    notes; or the error.

    After a dry run the files are those that would be written. misses: where levels are worse than
    they were to be; the files are written all the same.
    """

    job: Job
    files: dict[str, int] = field(default_factory=dict)
    levels: tuple[dict[str, Any], ...] = ()
    shadow: dict[str, Any] | None = None
    notes: tuple[str, ...] = ()
    misses: tuple[str, ...] = ()
    seconds: float = 0.0
    error: str | None = None
    exit_code: int = 0
    trace: str = ""
    """Where an error that vegtool does not know came from."""


@dataclass(frozen=True)
class Task:
    """What is done with every file of a batch."""

    folder: Path
    read: ReadOptions = field(default_factory=ReadOptions)
    convert: ConvertOptions = field(default_factory=ConvertOptions)
    measure: MeasureOptions = field(default_factory=MeasureOptions)
    force: bool = False
    depth: bool = False
    packed: bool = False
    dry_run: bool = False
    strict: bool = False
    inputs: tuple[Path, ...] = ()
    """The other files of the batch: like a job's own, they and what lies beside them are kept."""
    limits: Mapping[Path, Limits] = field(default_factory=dict)
    """The eyes of a scene that plants are for, by their files; of others, any."""


def find_jobs(inputs: Sequence[Path]) -> list[Job]:
    """The model files named, or found directly inside the folders named, in order.

    Two files of the same stem get the extension into their names (oak.glb, oak.obj: oak_glb,
    oak_obj). Raises InputError for a folder without models, UsageError where two inputs would
    write files of the same name.
    """
    sources: list[Path] = []
    for path in inputs:
        if _is_folder(path):
            models = models_in(path)
            if not models:
                known = " ".join(READERS)
                raise InputError(f"{path}: expected models ({known}) in this folder, found none")
            sources += models
        else:
            sources.append(path)
    unique = list(dict.fromkeys(sources))
    stems = [p.stem.lower() for p in unique]
    jobs = [
        Job(p, p.stem if stems.count(s) == 1 else f"{p.stem}_{p.suffix[1:].lower()}")
        for p, s in zip(unique, stems, strict=True)
    ]
    names = [job.name.lower() for job in jobs]
    twice = next(
        (
            job
            for job, name in zip(jobs, names, strict=True)
            if names.count(name) > 1 or plant_of_level(name) in names
        ),
        None,
    )
    if twice:
        raise UsageError(
            f"{twice.source}: another input would write files of the same name ({twice.name});"
            " convert them into folders of their own"
        )
    return jobs


def convert_file(job: Job, task: Task, progress: Progress = silent) -> Outcome:
    """Read one file, convert it, write its levels, its manifest and its contact sheet.

    A dry run does all of it but the writing, so that what it says is exact.
    Raises the errors of reading, converting and writing; then nothing was written.
    """
    from vegtool.convert import convert, endings
    from vegtool.formats.atomic import check_free
    from vegtool.formats.gltf import file_names, write_chain
    from vegtool.measure.chain import misses
    from vegtool.measure.contact_sheet import contact_sheet

    start = perf_counter()
    progress("reading", 0.0)
    plant = read_plant(job.source, task.read)
    sheet_name = f"{job.name}.png"
    levels, casts = 1 + task.convert.levels, task.convert.shadow_proxy is not None
    names = [*file_names(job.name, levels, task.depth, task.packed, casts), sheet_name]
    names += [job.name + ending for ending in endings(task.convert)]
    inputs = (job.source, *task.inputs)
    check_free(task.folder, names, task.force, inputs)
    chain = convert(
        plant, task.convert, task.measure, lambda s, f: progress(s, 0.05 + 0.8 * f),
        task.limits.get(job.source),
    )  # fmt: skip
    options = {**asdict(task.read), **chain.options}
    chain = replace(chain, name=job.name, options=options)
    progress("contact sheet", 0.85)
    extra = {sheet_name: contact_sheet(chain)}
    extra |= {job.name + ending: data for ending, data in chain.beside.items()}
    progress("writing", 0.9)
    with TemporaryDirectory() if task.dry_run else nullcontext(task.folder) as folder:
        paths = write_chain(
            chain, Path(folder), task.force, task.depth, extra, inputs, task.packed,
            task.convert.quantized,
        )  # fmt: skip
        files = {str(task.folder / p.name): p.stat().st_size for p in paths}
    progress("done", 1.0)
    rows = tuple(_row(chain, i) for i in range(len(chain.levels)))
    notes = (*plant.notes, *chain.notes)
    if task.packed and not any(
        level.atlas and level.atlas.light is not None for level in chain.levels
    ):
        notes = (*notes, _NOTHING_TO_PACK)
    missed = tuple(misses(chain.levels, task.measure))
    if task.strict:
        missed = (*missed, *chain.misses)
    else:
        notes = (*notes, *chain.misses)
    shadow = None if chain.shadow is None else _shadow_row(chain.shadow)
    return Outcome(job, files, rows, shadow, notes, missed, perf_counter() - start)


def convert_files(
    jobs: Sequence[Job],
    task: Task,
    workers: int,
    progress: Callable[[Job], Progress] = lambda job: silent,
) -> Iterator[Outcome]:
    """Convert a batch in the order given; an error becomes part of that file's outcome."""

    from vegtool.workers import WORKER_DIED, side_by_side

    def died(job: Job) -> Outcome:
        return Outcome(job, error=f"{job.source}: {WORKER_DIED}", exit_code=1)

    yield from side_by_side(partial(_outcome, task), jobs, died, workers, progress)


_NOTHING_TO_PACK = (
    "--packed: no level has light beside its colours to write; --occlusion and --translucency give"
    " it some, --prelit takes it"
)


def plant_of_level(name: str) -> str | None:
    """oak, where the name is that of a level of an oak, oak_LOD1, or of its shadow, oak_shadow."""
    found = re.fullmatch(r"(.+)_(?:lod\d+|shadow)", name, re.IGNORECASE | re.DOTALL)
    return found[1] if found else None


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # in a folder that may not be entered: reading it says so
        return False


def models_in(folder: Path) -> list[Path]:
    """The models in a folder, less the levels that an earlier run left there."""
    try:
        return sorted(
            p
            for p in folder.iterdir()
            if p.suffix.lower() in READERS
            and not p.is_dir()
            and not (folder / f"{plant_of_level(p.stem)}.lod.json").exists()
        )
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); allow it") from error


def _outcome(task: Task, job: Job, progress: Progress) -> Outcome:
    try:
        return convert_file(job, task, progress)
    except VegtoolError as error:
        return Outcome(job, error=str(error), exit_code=error.exit_code)
    except MemoryError:
        message = f"{job.source}: not enough memory; fewer billboards or --max-texture need less"
        return Outcome(job, error=message, exit_code=1)
    except Exception as error:
        message = f"{job.source}: {unknown(error)}"
        return Outcome(job, error=message, exit_code=1, trace=traceback.format_exc())


def _row(chain: LodChain, index: int) -> dict[str, Any]:
    from vegtool.formats.ramp import written_texels

    level = chain.levels[index]
    measured = level.measured
    return {
        "level": index,
        "kind": level.kind,
        "billboards": 0 if level.billboards is None else len(level.billboards),
        "surfels": 0 if level.surfels is None else len(level.surfels),
        "triangles": level.triangles,
        "texels": written_texels(level),
        "switch_distance_m": float(f"{level.near_distance_m:.4g}"),
        "flip": None if measured is None else round(measured.errors["flip"].mean, 4),
        "live_flip": None if measured is None else round(measured.live["flip"].mean, 4),
        "seconds": {k: round(v, 4) for k, v in level.seconds.items()},
    }


def _shadow_row(shadow: ShadowProxy) -> dict[str, Any]:
    bias = shadow.errors["coverage_bias"]
    return {
        "triangles": shadow.level.triangles,
        "texels": shadow.level.texels,
        "suns": shadow.suns,
        "pixels": shadow.pixels,
        "coverage_bias": round(bias.mean, 4),
        "worst_coverage_bias": round(bias.high if bias.high > -bias.low else bias.low, 4),
        "silhouette": round(shadow.errors["silhouette"].mean, 4),
        "live_silhouette": round(shadow.live["silhouette"].mean, 4),
    }
