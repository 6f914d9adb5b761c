"""Plants in, a report out: truths once per plant, every row beside them, what is finished kept.

A report that was interrupted goes on where it stopped: what the folder's journal holds is not made
again, and the truths of a plant that lacks nothing are not drawn.
"""

from __future__ import annotations

import hashlib
import json
from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from vegtool import __version__
from vegtool.errors import CapabilityError, VegtoolError
from vegtool.formats import ReadOptions, read_plant
from vegtool.gl.upload import PlantBuffers
from vegtool.measure.chain import miss
from vegtool.measure.distances import LeftOut, limits, switch_distances
from vegtool.measure.pictures import check_drawing, renderer
from vegtool.plant import Plant
from vegtool.progress import Progress
from vegtool.report.bench import Bench, measured, set_up
from vegtool.report.entries import Entry, entries
from vegtool.report.journal import Journal
from vegtool.report.options import FAMILIES, ReportOptions
from vegtool.report.pictures import of_truth, sizes_of
from vegtool.report.rows import LIVE, TRUTH, Pictures, PlantReport, Report, Row, as_json, from_json

TRUTHS = 8.0
"""Rows that the truths of a plant take as long as, about."""


def run(
    sources: Mapping[str, Path],
    options: ReportOptions,
    read: ReadOptions,
    journal: Journal,
    progress: Progress,
) -> Report:
    """Measure every row of every plant that the journal does not hold, and put them together.

    sources: files by the names of their plants, one at least. A plant that fails is named in
    `failed`; where it is the only one, its error is raised. Raises CapabilityError where nothing
    can draw.
    """
    check_drawing()
    todo = entries(options)
    found: list[PlantReport] = []
    failed: dict[str, str] = {}
    clock = _Clock(progress, len(sources) * (len(todo) + TRUTHS))
    for name, source in sources.items():
        try:
            found.append(_plant(name, source, options, read, todo, journal, clock))
        except VegtoolError as error:
            if len(sources) == 1:
                raise
            failed[name] = str(error)
        except MemoryError:
            failed[name] = f"{source}: not enough memory; a smaller --view-count needs less"
    shaped = {**asdict(read), **asdict(options)}
    return Report(tuple(found), shaped, __version__, renderer()["renderer"], failed)


def key(options: ReportOptions, read: ReadOptions) -> str:
    """A digest of all that shapes a report, but for its plants."""
    shaping = [__version__, asdict(options), asdict(read)]
    return hashlib.sha256(json.dumps(shaping, sort_keys=True).encode()).hexdigest()


class _Clock:
    """Progress over work of so many units, with the time that is left, as the work done tells."""

    def __init__(self, progress: Progress, units: float) -> None:
        self._progress, self._left, self._done = progress, units, 0.0
        self._start = monotonic()

    def skip(self, units: float) -> None:
        """So much of the work need not be done."""
        self._left -= units

    @contextmanager
    def work(self, what: str, units: float) -> Iterator[Progress]:
        """A block that does so many units."""

        def report(stage: str, fraction: float) -> None:
            done = self._done + units * fraction
            share = done / (self._done + self._left)
            left = _remaining(monotonic() - self._start, share)
            self._progress(f"{left}{what}: {stage}", share)

        try:
            yield report
        finally:
            self._done, self._left = self._done + units, self._left - units


def _remaining(elapsed: float, share: float) -> str:
    if elapsed < 5 or share < 0.01:
        return ""
    seconds = elapsed / share - elapsed
    return f"{seconds / 60:.0f} min left, " if seconds > 90 else f"{seconds:.0f} s left, "


def _plant(
    name: str,
    source: Path,
    options: ReportOptions,
    read: ReadOptions,
    todo: Sequence[Entry],
    journal: Journal,
    clock: _Clock,
) -> PlantReport:
    plant = read_plant(source, read)
    digest = _digest(plant)
    units = {TRUTH: TRUTHS, **{entry.name: 1.0 for entry in todo}}
    done = [piece for piece in units if journal.get(digest, piece) is not None]
    clock.skip(sum(units[piece] for piece in done))
    if len(done) < len(units):
        with PlantBuffers(plant) as buffers:
            with clock.work(name, 0.0 if TRUTH in done else TRUTHS) as progress:
                bench = set_up(buffers, options, progress)
            journal.add(digest, TRUTH, {"pictures": _encoded(of_truth(bench.scene))})
            for entry in (entry for entry in todo if entry.name not in done):
                with clock.work(f"{name}: {entry.name}", 1.0) as progress:
                    value = _finished(bench, entry, sizes_of(entry, todo), progress)
                journal.add(digest, entry.name, value)
    finished = {piece: journal.get(digest, piece) or {} for piece in units}
    rows = [from_json(v["row"]) for v in finished.values() if "row" in v]
    missing = dict.fromkeys(v["missing"] for v in finished.values() if "missing" in v)
    return PlantReport(
        name,
        str(source),
        len(plant.faces),
        plant.extent,
        (*plant.notes, *missing),
        tuple(replace(row, plant=name) for row in _with_distances(rows, options)),
        {k: _decoded(v["pictures"]) for k, v in finished.items() if v.get("pictures")},
    )


def _finished(
    bench: Bench, entry: Entry, sizes: Sequence[int], progress: Progress
) -> dict[str, Any]:
    """What the journal keeps of an entry: its row and pictures, or why there are none."""
    try:
        row, pictures = measured(bench, entry, sizes, progress)
    except CapabilityError as error:
        if entry.name == LIVE:
            raise
        return {"missing": f"{entry.family}: {error}"}
    return {"row": as_json(row), "pictures": _encoded(pictures)}


def _with_distances(rows: Sequence[Row], options: ReportOptions) -> list[Row]:
    """The rows with the distances from which they may be used: those of a family as one chain."""
    live = next(row for row in rows if row.name == LIVE)
    limit = limits(live.mean("flip"), options.max_error)
    least_m = {row.name: _least_m(row, options) for row in rows if row is not live}
    starts: dict[str, float | LeftOut] = {}
    for family in dict.fromkeys(row.family for row in rows):
        chain = [row for row in rows if row.family == family and least_m.get(row.name) is not None]
        errors = [row.mean("flip") for row in chain]
        least = [least_m[row.name] or 0.0 for row in chain]
        found = switch_distances(np.array(live.distance_m), errors, limit, least)
        starts |= {row.name: start for row, start in zip(chain, found, strict=True)}
    return [
        replace(row, switch_distance_m=0.0) if row is live else _starting(row, starts.get(row.name))
        for row in rows
    ]


def misses(report: Report) -> list[str]:
    """A sentence on each row that exceeds --max-error where it is said to be of use, from views and
    suns that its distance was not chosen by."""
    found = []
    for plant in report.plants:
        for row in (row for row in plant.rows if row.held_out and row.switch_distance_m):
            start = row.switch_distance_m or 0.0
            error = float(np.interp(np.log(start), np.log(row.distance_m), row.held_out))
            name = f"{plant.name}: {row.name}"
            found.append(miss(name, start, report.options["max_error"], error))
    return [sentence for sentence in found if sentence]


def _least_m(row: Row, options: ReportOptions) -> float | None:
    """Metres from which a row's texels are small enough, and what it displaces little enough; None
    where that is not known. A level of ours without texels starts where it was made for."""
    near = 0.0
    if row.texels_per_metre:
        near = options.display.distance_m(row.texels_per_metre)
    elif row.family in FAMILIES and row.made_for_pixels:
        near = row.distance_m[0] * row.pixels[0] / row.made_for_pixels
    if options.max_pixels is None:
        return near
    return None if row.within_pixels_from_m is None else max(near, row.within_pixels_from_m)


def _starting(row: Row, start: float | LeftOut | None) -> Row:
    if start is None:
        return replace(row, why_not="how far it displaces things is not known")
    if isinstance(start, LeftOut):
        return replace(row, why_not=start.value)
    return replace(row, switch_distance_m=start)


def _digest(plant: Plant) -> str:
    """Of everything in a plant that can be seen."""
    found = hashlib.sha256()
    arrays = (plant.positions, plant.normals, plant.uvs, plant.faces, plant.face_material)
    for array in arrays:
        found.update(np.ascontiguousarray(array).data)
    if plant.colors is not None:
        found.update(np.ascontiguousarray(plant.colors).data)
    if plant.branches is not None:
        found.update(np.ascontiguousarray(plant.branches.face_branch).data)
    for material in plant.materials:
        textures = (material.color_texture, material.normal_texture)
        bare = replace(material, color_texture=None, normal_texture=None)
        found.update(repr(bare).encode())
        for texture in textures:
            found.update(b"" if texture is None else np.ascontiguousarray(texture.pixels).data)
    return found.hexdigest()


def _encoded(pictures: Pictures) -> dict[str, list[str]]:
    return {str(size): [b64encode(p).decode() for p in kept] for size, kept in pictures.items()}


def _decoded(pictures: Mapping[str, Sequence[str]]) -> dict[int, tuple[bytes, ...]]:
    return {int(size): tuple(b64decode(p) for p in kept) for size, kept in pictures.items()}
