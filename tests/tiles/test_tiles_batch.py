"""Tiles in batches: whoever makes them and however often that is interrupted, the same bytes."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import test_tiles_run
from plant_tables import columns
from test_tiles_run import COUNT, HIGH, PLACED, files, inventory, library
from tile_cases import TWO_SPECIES, scene_of

from vegtool import workers
from vegtool.cli import run as main
from vegtool.errors import OutputError, UsageError, VegtoolError
from vegtool.formats.gltf_data import open_gltf
from vegtool.formats.tileset_check import check_tileset
from vegtool.seeding import generator
from vegtool.tiles import jobs as jobs_module
from vegtool.tiles.command import Result, run_tiles
from vegtool.tiles.jobs import Inputs, Made, ModelJob, do_at, file_of, world_of
from vegtool.tiles.journal import (
    JOURNAL,
    Entry,
    appended,
    key_of,
    locked,
    read_journal,
    write_journal,
)
from vegtool.tiles.make import merged_tile
from vegtool.tiles.options import RunOptions, TileOptions
from vegtool.tiles.quadtree import Node
from vegtool.tiles.run import Run
from vegtool.tiles.shared import Shared
from vegtool.tiles.tree import tree_of
from vegtool.workers import Processes, alone

OPTIONS = TileOptions(tile=16.0, near=1, triangles=400)
"""Some 16 blocks of 32 m, most of whose tiles are there, and merged squares above them."""


def inputs(folder: Path, out: str = "out", options: TileOptions = OPTIONS) -> Inputs:
    """A landscape by its paths."""
    if not (folder / "scene.toml").exists():
        inventory(folder, HIGH)
        scene_of(folder, TWO_SPECIES + PLACED)
        library(folder)
    return Inputs(folder / "scene.toml", folder / "library", folder / out, options)


def run(of: Inputs, how: RunOptions | None = None) -> Result:
    """As the command does."""

    @contextmanager
    def bar(title: str) -> Iterator[Any]:
        yield lambda stage, fraction: None

    how = how or RunOptions(1)
    return run_tiles(of.scene, of.library, of.out, of.options, how, bar, lambda text: None)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Inputs, dict[str, bytes]]:
    """A landscape, and its tiles as one uninterrupted process makes them."""
    of = inputs(tmp_path_factory.mktemp("whole"))
    assert not run(of).failed
    assert check_tileset(of.out / "tileset.json") == []
    return of, files(of.out)


Whole = tuple[Inputs, dict[str, bytes]]


# ---------------------------------------------------------------------------------- whoever does


def test_two_processes_make_the_same_bytes(whole: Whole, tmp_path: Path) -> None:
    of, wanted = whole
    result = run(replace(of, out=tmp_path / "two"), RunOptions(2))
    assert not result.failed and files(tmp_path / "two") == wanted


def doubled(number: int) -> int:
    if number == 13:
        os._exit(1)
    return 2 * number


def test_a_process_that_is_ended_ends_no_other_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others' results are there, once each, whatever they lost on the way. Of four that wait
    for a process that the first ends, two at a time begin again together; of its own two each is
    begun alone, it itself twice."""
    sizes = list[int]()
    right = Processes.submit

    def counted(processes: Processes, function: Any, jobs: Sequence[Any]) -> Any:
        sizes.append(len(jobs))
        return right(processes, function, jobs)

    monkeypatch.setattr(Processes, "submit", counted)
    monkeypatch.setattr(workers, "AGAIN", 2)
    with Processes(1) as processes:
        found = list(processes.each(doubled, [13, 1, 2, 3]))
    assert found == [(13, None), (1, 2), (2, 4), (3, 6)]
    assert sizes == [4, 2, 1, 1, 1, 2]
    assert dict(alone(doubled, [4])) == {4: 8}


CLUSTER = ("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0")
WORKER = ("-m", "distributed.cli.dask_worker", "--host", "127.0.0.1", "--nthreads", "2")


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The address of a scheduler on loopback, and its two workers."""
    pytest.importorskip("distributed")
    import json

    told = tmp_path / "scheduler.json"
    paths = os.pathsep.join(
        filter(None, [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH")])
    )
    quiet: dict[str, Any] = {
        "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path,
        "env": {**os.environ, "PYTHONPATH": paths},
    }  # fmt: skip
    more = ("--scheduler-file", str(told), "--no-dashboard")
    started = [subprocess.Popen([sys.executable, *CLUSTER, *more], **quiet)]
    try:
        started += [subprocess.Popen([sys.executable, *WORKER, *more], **quiet) for _ in range(2)]
        until = time.monotonic() + 60
        while not told.exists() or not told.read_bytes():
            assert time.monotonic() < until and started[0].poll() is None
            time.sleep(0.05)
        yield json.loads(told.read_bytes())["address"], started[1:]
    finally:
        for process in started[::-1]:
            process.terminate()
        for process in started:
            process.wait(30)


def test_two_dask_workers_make_the_same_bytes_and_one_may_be_killed(
    whole: Whole, tmp_path: Path, scheduler: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    from vegtool.tiles.cluster import Cluster

    of, wanted = whole
    address, workers = scheduler
    result = run(replace(of, out=tmp_path / "cluster"), RunOptions(dask=address))
    assert not result.failed and files(tmp_path / "cluster") == wanted
    again = replace(of, out=tmp_path / "again")
    world = world_of(again)
    with Cluster(address) as cluster:
        work = Run(world, partial(cluster.each, partial(do_at, again)))
        for count, _ in enumerate(work.tiles()):
            if count == 5:
                workers[0].kill()
        work.finish()
    assert not work.failed and files(tmp_path / "again") == wanted


def test_a_scheduler_that_is_none_is_a_sentence(whole: Whole, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    of = replace(whole[0], out=tmp_path / "none")
    with pytest.raises(UsageError, match="--dask no: expected a Dask scheduler, found none that"):
        run(of, RunOptions(dask="no"))
    missing = replace(of, scene=tmp_path / "none.toml")  # it is said before anything is read
    with pytest.raises(UsageError, match="--dask: is in place of processes here; leave out -j"):
        run(missing, RunOptions(2, "tcp://127.0.0.1:9"))


def test_a_scheduler_that_is_lost_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask then cancels what it was given."""
    distributed = pytest.importorskip("distributed")
    from vegtool.tiles.cluster import Cluster

    def lost() -> None:
        raise distributed.client.FutureCancelledError("1", "scheduler-connection-lost")

    future = SimpleNamespace(key="1", result=lost)
    cluster = object.__new__(Cluster)
    cluster._client = SimpleNamespace(submit=lambda *given, **how: future, loop=None)
    monkeypatch.setattr(distributed, "as_completed", lambda futures, loop: futures)
    with pytest.raises(VegtoolError, match=r"--dask: expected the scheduler .* lost it; start it"):
        list(cluster.each(doubled, [1]))


def test_who_sees_other_files_says_so(tmp_path: Path) -> None:
    of = inputs(tmp_path)
    known = replace(of, digest=world_of(of).digest)
    job = ModelJob(kind=0, level=1)
    assert all(isinstance(one, Made) for one in do_at(replace(known, out=tmp_path / "b"), job))
    inventory(tmp_path, ("9", "8"))
    with pytest.raises(Exception, match="are not the same, here, as where the run was started"):
        do_at(known, job)


# ----------------------------------------------------------------------------- however interrupted


def made(of: Inputs, stop: int | None = None) -> list[str]:
    """What is made, in order; after `stop` parts the run is left as it is."""
    work = Run(world_of(of))
    names = []
    for outcome in work.tiles():
        if isinstance(outcome, Made) and outcome.again:
            names.append(outcome.entry.name)
        if len(names) == stop:
            return names
    work.finish()
    return names


def test_a_run_goes_on_where_it_was(whole: Whole, tmp_path: Path) -> None:
    """Whatever had come of it, and whatever a killed one leaves: no part is made twice."""
    of, wanted = whole
    of = replace(of, out=tmp_path / "out")
    every = made(replace(of, out=tmp_path / "other"))
    first = made(of, 7)
    (of.out / "tiles" / ".5_0_0.glb.0123.part").write_bytes(b"half")
    with (of.out / JOURNAL).open("ab") as file:
        file.write(b'{"name":"4/0/0","key":"')
    second = made(of, 9)
    third = made(of)
    assert len(first) == 7 and len(second) == 9
    # a block is told of as a whole: the parts of the one that was left are made again
    assert set(first) | set(second) | set(third) == set(every)
    assert files(of.out) == wanted
    assert made(of) == [], "all is there"


def test_squares_err_by_more_than_their_quarters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is clustered anew is off by what its quarters are off already, too. Where all are
    measured to be off by the same, clients are told of more."""
    of, below = inputs(tmp_path, options=replace(OPTIONS, triangles=40)), dict[Node, float]()
    right = jobs_module.reclustered_tile

    def told(pyramid: Any, node: Node, quarters: Any, plants: int, below_m: float) -> Any:
        below[node] = below_m
        return right(pyramid, node, quarters, plants, below_m)

    monkeypatch.setattr(jobs_module, "reclustered_tile", told)
    work = Run(world_of(of))
    for _ in work.tiles():
        pass
    pyramid, found = work.world.pyramid, work.found
    assert max(below.values()) > 0
    for node, below_m in below.items():
        errors = [found[str(one)].facts["error_m"] or 0.0 for one in pyramid.tree.quarters(node)]
        assert below_m == max(errors)
    alike = {n: replace(e, facts={**e.facts, "error_m": 1000.0}) for n, e in found.items()}
    root = tree_of(pyramid, alike)
    assert root is not None
    tiles = [root]
    for tile in tiles:  # which grows
        assert all(tile.error_m > child.error_m >= 1000.0 for child in tile.children)
        tiles += tile.children
    assert len(tiles) == sum(bool(entry.facts) for entry in found.values())


def test_what_a_process_that_was_ended_had_begun_is_removed(whole: Whole, tmp_path: Path) -> None:
    of = replace(whole[0], out=tmp_path / "out")
    work = Run(world_of(of))
    for _ in work.tiles():
        pass
    part = of.out / "tiles" / ".5_0_0.glb.0123.part"
    part.write_bytes(b"half")
    work.finish()
    assert files(of.out) == whole[1]


def test_only_what_is_missing_is_made(whole: Whole, tmp_path: Path) -> None:
    of, wanted = whole
    of = replace(of, out=tmp_path / "out")
    made(of)
    gone = next(iter((of.out / "tiles").glob("*.glb")))
    level, column, row = gone.stem.split("_")
    gone.unlink()
    assert made(of) == [f"{level}/{column}/{row}"]
    gone.write_bytes(gone.read_bytes()[:100])
    assert made(of) == [f"{level}/{column}/{row}"]
    assert files(of.out) == wanted


def test_only_what_a_plant_changes_is_made(tmp_path: Path) -> None:
    """One plant is higher: its tile, and the squares that it is on."""
    of = inputs(tmp_path)
    made(of)
    path = of.scene.parent / "plants.csv"
    lines = path.read_text().splitlines()
    x, y, name, _ = lines[9].split(",")
    lines[9] = f"{x},{y},{name},3.75"
    path.write_text("\n".join(lines))
    again = made(of)
    tree = world_of(of).pyramid.tree
    node = Node(tree.depth, *(int(v) for v in [
        (float(x) // 16) - tree.first[0], (-float(y) // 16) - tree.first[1]]))  # fmt: skip
    wanted = {str(node)}
    while node.level:
        node = node.parent
        wanted.add(str(node))
    assert set(again) == wanted
    fresh = replace(of, out=tmp_path / "fresh")
    made(fresh)
    assert files(of.out) == files(fresh.out)


@pytest.mark.parametrize(
    "changed",
    [
        {"plain": True}, {"near_texture": 4}, {"max_texture": 32}, {"triangles": 200},
        {"triangles": 40}, {"near_triangles": 12},
    ],
    ids=str,
)  # fmt: skip
def test_what_an_option_changes_is_made_anew(
    whole: Whole, tmp_path: Path, changed: dict[str, Any]
) -> None:
    """As a run from nothing makes it, whatever was there before."""
    of = replace(whole[0], out=tmp_path / "out", options=replace(OPTIONS, **changed))
    shutil.copytree(whole[0].out, of.out)
    made(of)
    fresh = replace(of, out=tmp_path / "fresh")
    made(fresh)
    wanted = files(fresh.out)
    assert files(of.out) == wanted
    assert any(data != whole[1].get(name) for name, data in wanted.items() if name != JOURNAL)


def test_what_is_no_longer_there_is_removed(tmp_path: Path) -> None:
    of = inputs(tmp_path)
    made(of)
    path = of.scene.parent / "plants.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:6]))
    made(of)
    fresh = replace(of, out=tmp_path / "fresh")
    made(fresh)
    assert files(of.out) == files(fresh.out)


def command(of: Inputs, *more: str) -> list[str]:
    options = [("--tile", "16"), ("--near", "1"), ("--triangles", "400")]
    named = [word for pair in options for word in pair]
    return [
        sys.executable, "-m", "vegtool", "tiles", str(of.scene), "--species", str(of.library),
        "-o", str(of.out), *named, "-q", *more,
    ]  # fmt: skip


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL on Windows")
def test_killed_ten_times_it_ends_in_the_same_bytes(whole: Whole, tmp_path: Path) -> None:
    """At random moments of its work, by the files that are there; after each, what was begun goes
    on. Files that are there are whole all the time."""
    of, wanted = whole
    of = replace(of, out=tmp_path / "out")
    rng = generator(0, "kill")
    started = time.monotonic()
    subprocess.run(command(replace(of, out=tmp_path / "timed"), "-j", "1"), check=True)
    lasts, killed = time.monotonic() - started, 0
    while killed < 10:
        process = subprocess.Popen(command(of, "-j", "1"))
        try:
            process.wait(float(rng.uniform(0.5, 1.0)) * lasts)
            shutil.rmtree(of.out)  # it was done before
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            killed += 1
        for name, data in (files(of.out) if of.out.exists() else {}).items():
            if name != JOURNAL and not name.endswith(".part"):
                assert data == wanted[name]
    subprocess.run(command(of, "-j", "1"), check=True)
    assert files(of.out) == wanted


# ------------------------------------------------------------------------------- what goes wrong


def test_a_tile_that_cannot_be_made_is_told_of_and_the_others_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its square stays without quarters, rather than with a hole; the next run makes it."""
    of = inputs(tmp_path)
    right, tree = jobs_module.instanced_tile, world_of(of).pyramid.tree
    lost = tree.nodes(tree.depth)[3]

    def broken(pyramid: Any, shared: Any, node: Node, *more: Any) -> Any:
        if node == lost:
            raise MemoryError
        return right(pyramid, shared, node, *more)

    monkeypatch.setattr(jobs_module, "instanced_tile", broken)
    result = run(of)
    assert result.exit_code == 3 and [one.name for one in result.failed] == [str(lost)]
    assert "not enough memory" in result.failed[0].message
    assert check_tileset(of.out / "tileset.json") == []
    text = (of.out / "tileset.json").read_text()
    assert file_of(lost) not in text and file_of(lost.parent) in text
    for one in tree.quarters(lost.parent):
        assert file_of(one) not in text
    monkeypatch.undo()
    assert made(of) == [str(lost)]
    fresh = replace(of, out=tmp_path / "fresh")
    made(fresh)
    assert files(of.out) == files(fresh.out)


def test_a_square_that_cannot_be_made_leaves_its_quarters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has no content then: clients go on to what is below."""
    of = inputs(tmp_path)
    right = jobs_module.merged_tile
    lost = world_of(of).pyramid.tree.nodes(world_of(of).pyramid.tree.depth - 1)[1]

    def broken(pyramid: Any, shared: Any, node: Node, *more: Any) -> Any:
        if node == lost:
            raise ValueError("of no known kind")
        return right(pyramid, shared, node, *more)

    monkeypatch.setattr(jobs_module, "merged_tile", broken)
    result = run(of)
    assert result.failed and "this is a bug" in result.failed[0].message
    assert "Traceback" in result.failed[0].trace
    assert check_tileset(of.out / "tileset.json") == []
    text = (of.out / "tileset.json").read_text()
    assert file_of(lost) not in text
    for one in world_of(of).pyramid.tree.quarters(lost):
        assert file_of(one) in text


def test_a_model_that_cannot_be_made_is_told_of_by_the_tiles_that_draw_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is no bug of theirs. Where no tile is left, the exit status is that of what went wrong."""
    of = inputs(tmp_path)

    def broken(*given: Any) -> Any:
        raise MemoryError

    monkeypatch.setattr(Shared, "model_files", broken)
    monkeypatch.setattr(jobs_module, "merged_tile", broken)
    words = command(of, "-j", "1")[3:]
    assert main(words) == 1
    said = capsys.readouterr().err
    assert "error: model 0/0: not enough memory; fewer processes (-j) need less" in said
    assert "expected" in said and "ash_0.gltf, which it draws, found none" in said
    assert "the others are there" not in said and "Traceback" not in said
    monkeypatch.setattr(jobs_module, "merged_tile", merged_tile)
    assert main(words) == 3
    assert "the others are there" in capsys.readouterr().err
    with pytest.raises(VegtoolError, match="model 0/0: not enough memory"):
        run(replace(of, out=tmp_path / "dry"), RunOptions(1, dry_run=True))


def test_a_full_disk_ends_the_run_which_goes_on_later(
    whole: Whole, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files that are there are whole, and nothing half-written is left."""
    from errno import ENOSPC

    of, wanted = whole
    of = replace(of, out=tmp_path / "out")
    right, room = Path.write_bytes, [12]

    def full(path: Path, data: bytes) -> int:
        room[0] -= 1
        if room[0] < 0:
            right(path, data[: len(data) // 2])
            raise OSError(ENOSPC, os.strerror(ENOSPC))
        return right(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="there is no room for it"):
        run(of)
    monkeypatch.undo()
    there = files(of.out)
    assert not [name for name in there if name.endswith(".part")]
    assert all(wanted[name] == data for name, data in there.items() if name != JOURNAL)
    run(of)
    assert files(of.out) == wanted


def test_a_folder_of_others_is_not_written_over(whole: Whole, tmp_path: Path) -> None:
    of = replace(whole[0], out=tmp_path / "out")
    (of.out / "tiles").mkdir(parents=True)
    with pytest.raises(OutputError, match="exists already, and no run of vegtool tiles says that"):
        run(of)
    (of.out / "tileset.json").write_text("mine")
    with pytest.raises(OutputError, match=r"tileset\.json: exists already"):
        run(of)
    assert not run(of, RunOptions(1, force=True)).failed
    assert not run(of).failed, "now it is a run's own"
    inside = replace(of, out=of.library.parent)
    (of.library.parent / "tiles").mkdir(exist_ok=True)
    within = of.library.parent / "tiles" / "scene.toml"
    within.write_bytes(of.scene.read_bytes())
    with pytest.raises(OutputError, match="is where tiles are to go"):
        run(replace(inside, scene=within), RunOptions(1, force=True))


def test_a_run_goes_on_in_the_folder_of_its_scene(tmp_path: Path) -> None:
    """What is there is its own. The scene itself is not, whatever it is called."""
    of = replace(inputs(tmp_path), out=tmp_path)
    assert not run(of).failed
    assert run(of).facts["made"] == 0
    points = of.scene.with_name("index.json")
    points.write_text("{}")
    of = replace(of, scene=points, options=replace(of.options, format="glb"))
    with pytest.raises(
        OutputError, match=r"index\.json: is where tiles are to go, and .* is there"
    ):
        run(of, RunOptions(1, force=True))


# --------------------------------------------------------------------------------- parts of it all


@pytest.mark.skipif(os.name == "nt", reason="no locks on folders on Windows")
def test_two_runs_do_not_share_a_folder(whole: Whole, tmp_path: Path) -> None:
    """The second would take away what the first makes; it waits for nobody, and changes nothing."""
    of = replace(whole[0], out=tmp_path / "out")
    with (
        locked(of.out),
        pytest.raises(OutputError, match="another run of vegtool tiles is at"),
    ):
        run(of)
    assert not of.out.exists()
    with pytest.raises(UsageError, match="expected its quarters"):
        run(of, RunOptions(1, only=("0/0/0",)))
    assert not of.out.exists()


def test_a_tile_alone_is_as_with_all_others(whole: Whole, tmp_path: Path) -> None:
    """With the models and the sheet that it draws, and no tileset; what another process is writing
    there stays."""
    of, wanted = whole
    of = replace(of, out=tmp_path / "out")
    other = of.out / "tiles" / ".5_0_0.glb.0123.part"
    other.parent.mkdir(parents=True)
    other.write_bytes(b"half")
    tree = world_of(of).pyramid.tree
    leaf, square = tree.nodes(tree.depth)[5], tree.nodes(tree.depth - 1)[0]
    result = run(of, RunOptions(1, only=(str(leaf), str(square)), force=True))
    other.unlink()
    there = files(of.out)
    assert result.facts["tileset"] is None and len(result.facts["tiles"]) == 2
    for node in (leaf, square):
        tile = of.out / file_of(node)
        uris = [one["uri"] for kind in ("buffers", "images")
                for one in open_gltf(tile).json.get(kind, []) if "uri" in one]  # fmt: skip
        assert uris and all((tile.parent / uri).exists() for uri in uris)
    assert {file_of(leaf), file_of(square)} <= set(there) and "tileset.json" not in there
    assert all(wanted[name] == data for name, data in there.items() if name != JOURNAL)
    assert len(there) < len(wanted)
    run(of)
    assert files(of.out) == wanted


@pytest.mark.parametrize("name", ["9/9/9", "x", "0/0", "1/7/0", "-1/0/0", f"1/{10**20}/0"])
def test_a_tile_of_no_such_name_is_a_sentence(whole: Whole, tmp_path: Path, name: str) -> None:
    of = replace(whole[0], out=tmp_path / "out")
    with pytest.raises(UsageError, match=f"--only {name}: expected LEVEL/COLUMN/ROW of a tile"):
        run(of, RunOptions(1, only=(name,)))


def test_a_square_without_its_quarters_is_a_sentence(whole: Whole, tmp_path: Path) -> None:
    of = replace(whole[0], out=tmp_path / "out")
    with pytest.raises(UsageError, match="--only 0/0/0: expected its quarters"):
        run(of, RunOptions(1, only=("0/0/0",)))


def test_a_dry_run_says_what_it_would_be_and_writes_nothing(whole: Whole, tmp_path: Path) -> None:
    of, wanted = whole
    result = run(replace(of, out=tmp_path / "out"), RunOptions(1, dry_run=True))
    assert not (tmp_path / "out").exists()
    tiles = [name for name in wanted if name.endswith(".glb")]
    assert result.facts["tiles"] == len(tiles)
    size = sum(len(data) for name, data in wanted.items() if name != JOURNAL)
    assert result.facts["bytes"] == pytest.approx(size, rel=0.5)
    assert result.facts["seconds"] > 0 and "plants at most" in result.text


def test_plain_files_have_an_index(whole: Whole, tmp_path: Path) -> None:
    """The same tiles; and each is in one before it."""
    import json

    of, wanted = whole
    of = replace(of, out=tmp_path / "out", options=replace(of.options, format="glb"))
    assert not run(of).failed
    there = files(of.out)
    assert {n: d for n, d in there.items() if n.startswith("tiles/")} == {
        name: data for name, data in wanted.items() if name.startswith("tiles/")
    }
    assert "tileset.json" not in there
    tiles = json.loads(there["index.json"])["tiles"]
    assert {tile["file"] for tile in tiles} == {n for n in wanted if n.endswith(".glb")}
    for number, tile in enumerate(tiles):
        assert (tile["in"] is None) == (number == 0)
        if number:
            above = tiles[tile["in"]]
            assert tile["in"] < number and above["from_m"] >= 2 * tile["from_m"]
    assert tiles[0]["plants"] == COUNT


def test_tiles_tell_which_plant_is_which_where_that_is_asked_for(
    whole: Whole, tmp_path: Path
) -> None:
    """Every plant once on each level; those without it are made anew, the pictures are not."""
    of = replace(whole[0], out=tmp_path / "out", options=replace(OPTIONS, attributes=True))
    shutil.copytree(whole[0].out, of.out)
    again = made(of)
    assert again and not [name for name in again if not name[0].isdigit()]
    rows = {row: name for row, (_, _, name) in enumerate(test_tiles_run.rows(), start=1)}
    tree, told = world_of(of).pyramid.tree, dict[int, dict[int, str]]()
    for level in range(tree.depth + 1):
        for node in tree.nodes(level):
            file = open_gltf(of.out / file_of(node))
            metadata = file.json.get("extensions", {}).get("EXT_structural_metadata")
            for table in range(len(metadata["propertyTables"]) if metadata else 0):
                found = columns(file, table)
                pairs = zip(found["id"].tolist(), found["species"].tolist(), strict=True)
                told.setdefault(level, {}).update(pairs)
    assert tree.depth in told and tree.depth - 1 in told
    assert all(found == rows for found in told.values())


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT for one process on Windows")
def test_an_interrupted_run_leaves_nothing_half_written(whole: Whole, tmp_path: Path) -> None:
    """Ctrl-C, with two processes at work."""
    of, wanted = whole
    of = replace(of, out=tmp_path / "out")
    process = subprocess.Popen(command(of, "-j", "2"), stderr=subprocess.PIPE)
    until = time.monotonic() + 60
    while not list(of.out.glob("tiles/*.glb")):
        assert time.monotonic() < until and process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, text = process.communicate(timeout=60)
    assert process.returncode == 130 and b"Traceback" not in text
    there = files(of.out)
    assert not [name for name in there if name.endswith(".part")]
    assert all(wanted[name] == data for name, data in there.items() if name != JOURNAL)


# -------------------------------------------------------------------------------------- the journal


def test_a_journal_keeps_the_last_of_each(tmp_path: Path) -> None:
    with appended(tmp_path) as write:
        write(Entry("a", "1"))
        write(Entry("b", "1", {"b.glb": 3}, {"plants": 2}))
        write(Entry("a", "2"))
    found = read_journal(tmp_path)
    assert {name: entry.key for name, entry in found.items()} == {"a": "2", "b": "1"}
    assert not found["b"].there(tmp_path)
    (tmp_path / "b.glb").write_bytes(b"abc")
    assert found["b"].there(tmp_path)
    write_journal(tmp_path, found)
    assert read_journal(tmp_path) == found
    assert read_journal(tmp_path / "none") == {}


@pytest.mark.parametrize("line", [b"", b"{", b"[]", b"7", b'{"name":1}', b"\xff\xfe", b'{"x":1}'])
def test_a_line_that_is_none_counts_for_nothing(tmp_path: Path, line: bytes) -> None:
    (tmp_path / JOURNAL).write_bytes(line + b"\n")
    with appended(tmp_path) as write:
        write(Entry("a", "1"))
    assert list(read_journal(tmp_path)) == ["a"]


def test_a_line_after_one_that_is_not_whole_counts(tmp_path: Path) -> None:
    """A run that was killed has left no end of line."""
    (tmp_path / JOURNAL).write_bytes(b'{"name":"b","ke')
    with appended(tmp_path) as write:
        write(Entry("a", "1"))
    assert list(read_journal(tmp_path)) == ["a"]


@pytest.mark.parametrize("name", ["../x", "tiles/../../x", "/x"])
def test_files_elsewhere_are_not_ours(tmp_path: Path, name: str) -> None:
    """Nobody who puts tiles into a folder that came from others is to lose files for it."""
    write_journal(tmp_path, {"a": Entry("a", "1", {"x": 3}), "b": Entry("b", "1", {name: 3})})
    assert list(read_journal(tmp_path)) == ["a"]


def test_keys_tell_values_apart() -> None:
    """Also where their bytes, put together, would be the same."""
    import numpy as np

    pairs: Sequence[tuple[Sequence[Any], Sequence[Any]]] = [
        (("ab", "c"), ("a", "bc")), ((b"ab", b"c"), (b"a", b"bc")), (("1",), (1,)), ((1,), (1.0,)),
        ((np.zeros(2),), (np.zeros((2, 1)),)), ((np.zeros(1),), (np.zeros(2, np.float32),)),
        ((None,), ()),
    ]  # fmt: skip
    for one, other in pairs:
        assert key_of(*one) != key_of(*other)
        assert key_of(*one) == key_of(*one)
