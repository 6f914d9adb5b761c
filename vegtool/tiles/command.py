"""What `vegtool tiles` does."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from vegtool.errors import BatchError, OutputError, UsageError
from vegtool.progress import Progress
from vegtool.surfels.options import SUFFIX
from vegtool.tiles.options import RunOptions, TileOptions

if TYPE_CHECKING:
    from vegtool.tiles.jobs import Failed, Inputs, World
    from vegtool.tiles.placement import Placement
    from vegtool.tiles.run import Each, Run
    from vegtool.tiles.view import View

Bar = Callable[[str], AbstractContextManager[Progress]]
"""What shows progress, under a title, as long as it is open."""

ViewOf = Callable[["Placement"], "View"]
"""Whom tiles of plants that are placed are for."""


@dataclass(frozen=True)
class Result:
    """facts: for machines. text: for people. failed: parts that could not be made. exit_code: that
    of BatchError where others were made."""

    facts: dict[str, Any]
    text: str
    failed: tuple[Failed, ...] = ()
    exit_code: int = 0


def run_tiles(
    scene: Path, library: Path | None, out: Path, options: TileOptions, run: RunOptions, bar: Bar,
    say: Callable[[str], None], view_of: ViewOf | None = None,
) -> Result:  # fmt: skip
    """Make the tiles of a scene or an inventory, or of one plant's surfel billboards; or, in a dry
    run, say what they would be. view_of: whom they are for; anybody if None.

    Raises UsageError and InputError for what is missing or broken, OutputError where nothing can be
    written, CapabilityError where nothing can draw.
    """
    if scene.suffix.lower() == SUFFIX:
        if view_of is not None:
            raise UsageError(f"--scene: expected a landscape; got one plant, {scene}; leave it out")
        from vegtool.tiles.surfel_tiles import run_surfel_tiles

        return run_surfel_tiles(scene, library, out, options, run, bar)
    if library is None:
        raise UsageError(
            f"{scene}: expected --species, the folder of its plants; got none. One plant alone is "
            "NAME.surfels, as `vegtool convert --method surfel-billboards` writes it"
        )
    from vegtool.tiles.jobs import Inputs, world_of

    started = perf_counter()
    if run.dask is not None and run.jobs is not None:
        raise UsageError("--dask: is in place of processes here; leave out -j")
    if run.only and view_of is not None:
        raise UsageError(
            "--only: what a scene needs of one tile depends on others; leave out --scene"
        )
    inputs = Inputs(scene.absolute(), library.absolute(), out.absolute(), options)
    _check_out(inputs, run.force)
    with bar("reading") as progress:
        world = world_of(inputs, progress, run.jobs or os.cpu_count() or 1)
    inputs = replace(inputs, digest=world.digest)
    view = None if view_of is None else view_of(world.pyramid.placement)
    for note in (*world.pyramid.notes, *(() if view is None else view.notes)):
        say(note)
    with bar("tiles") as progress:
        if run.dry_run:
            from vegtool.tiles.estimate import estimated

            facts, text = estimated(world, _processes(world, run), progress, view)
            return Result(facts, text)
        with _crew(inputs, world, run) as each:
            start = partial(_run, world, view, each, progress)
            return _made(world, start, run, out, started)


def _run(world: World, view: View | None, each: Each, progress: Progress) -> Run:
    from vegtool.tiles.run import Run
    from vegtool.tiles.viewed import ViewedRun

    if view is None:
        return Run(world, each, progress)
    return ViewedRun(world, view, each, progress)


def _made(
    world: World, start: Callable[[], Run], run: RunOptions, out: Path, started: float
) -> Result:
    from vegtool.tiles.jobs import Made
    from vegtool.tiles.journal import locked
    from vegtool.tiles.report import facts_of, text_of
    from vegtool.tiles.run import node_of

    only = [node_of(name, world.pyramid) for name in run.only]
    with locked(out):
        work = start()
        made = [
            outcome
            for outcome in (work.only(only) if only else work.tiles())
            if isinstance(outcome, Made)
        ]
        files = [] if only else work.finish()
    seconds = perf_counter() - started
    facts = facts_of(world, work.shown(made), work.failed, out, files, seconds, work.told())
    failed = tuple(work.failed.values())
    if failed and not any(one.entry.facts.get("plants") for one in made):
        return Result(facts, "", failed, failed[0].exit_code)
    return Result(facts, text_of(facts), failed, BatchError.exit_code if failed else 0)


@contextmanager
def _crew(inputs: Inputs, world: World, run: RunOptions) -> Iterator[Each]:
    """Who makes the tiles."""
    from vegtool.tiles.jobs import do, do_at
    from vegtool.workers import Processes, alone

    if run.dask is not None:
        from vegtool.tiles.cluster import Cluster

        with Cluster(run.dask) as cluster:
            yield partial(cluster.each, partial(do_at, inputs))
        return
    count = _processes(world, run)
    if count <= 1:
        yield partial(alone, partial(do, world))
        return
    with Processes(count) as processes:
        yield partial(processes.each, partial(do_at, inputs))


def _processes(world: World, run: RunOptions) -> int:
    """No more than there is work for."""
    tree = world.pyramid.tree
    top = min(world.pyramid.options.near, tree.depth)
    parts = len(run.only) or tree.count(tree.depth - top)
    return min(run.jobs or os.cpu_count() or 1, parts)


def _check_out(inputs: Inputs, force: bool) -> None:
    """Raise OutputError where the tiles would go over something else."""
    from vegtool.formats.atomic import check_free
    from vegtool.tiles.jobs import TILES
    from vegtool.tiles.journal import JOURNAL
    from vegtool.tiles.run import BEGINS

    own = (inputs.out / JOURNAL).exists()
    begin = BEGINS[inputs.options.format]
    beside = () if own else (inputs.scene, inputs.library / begin)
    check_free(inputs.out, [begin, JOURNAL], force or own, beside)
    for path in (inputs.scene, inputs.library):
        for place in (inputs.out / TILES, inputs.out / begin):
            if path.resolve().is_relative_to(place.resolve()):
                raise OutputError(
                    f"{place}: is where tiles are to go, and {path} is there. Choose another place."
                )
    if not own and not force and (inputs.out / TILES).exists():
        raise OutputError(
            f"{inputs.out / TILES}: exists already, and no run of vegtool tiles says that it made "
            "it. Overwrite it with -f, or choose another place."
        )
