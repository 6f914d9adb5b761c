"""The command line: parse, call, print; nothing else.

Exit codes: 0 done, 1 failed, 2 usage, 3 part of a batch failed, 4 a quality limit missed,
5 a capability missing, 130 interrupted.
"""

from __future__ import annotations

import logging
import re
import signal
import sys
from dataclasses import replace
from functools import partial
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any

import typer

from vegtool import __version__
from vegtool.console import Console, human_bytes, table
from vegtool.convert import ConvertOptions
from vegtool.errors import BatchError, QualityError, UsageError, VegtoolError, unknown
from vegtool.flags import flags, read_config
from vegtool.formats import ReadOptions
from vegtool.measure.options import MeasureOptions
from vegtool.preview.options import PreviewOptions
from vegtool.report.options import ReportOptions
from vegtool.tiles.options import RunOptions, TileOptions

app = typer.Typer(
    name="vegtool",
    help="Plant models in, levels of detail out.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="rich",
)

INTERRUPTED = 130


def _path(text: str) -> Path:
    """A path as typed; the empty one, mostly a variable that was not set, is no folder."""
    if not text:
        raise UsageError("expected a file or a folder; got an empty name")
    return Path(text)


Out = Annotated[
    Path,
    typer.Option("-o", "--out", help="Folder for what is made.", metavar="FOLDER", parser=_path),
]
Force = Annotated[bool, typer.Option("-f", "--force", help="Overwrite files of the same names.")]
Json = Annotated[bool, typer.Option("--json", help="The result as JSON on stdout.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Errors only.")]
Verbose = Annotated[int, typer.Option("-v", "--verbose", count=True, help="Say more; -vv most.")]
Config = Annotated[
    Path | None,
    typer.Option(
        "--config",
        help="A TOML file with values for these options.",
        metavar="FILE.toml",
        is_eager=True,
        callback=read_config,
    ),
]


@app.callback(invoke_without_command=True)
def root(
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Plant models in, levels of detail out."""
    if version:
        print(f"vegtool {__version__}")
        raise typer.Exit


@app.command("convert")
@flags
def convert_command(
    *,
    inputs: Annotated[
        list[Path], typer.Argument(help="Plant models, or folders of them.", parser=_path)
    ],
    out: Out,
    convert: ConvertOptions,
    measure: MeasureOptions,
    read: ReadOptions,
    jobs: Annotated[int, typer.Option("-j", "--jobs", help="Files at a time.", min=1)] = 1,
    depth: Annotated[bool, typer.Option("--depth", help="Write depth textures too.")] = False,
    packed: Annotated[
        bool,
        typer.Option(
            "--packed",
            help="Write packed light textures for engines too: sky visibility, thickness, "
            "translucency.",
        ),
    ] = False,
    scene: Annotated[
        Path | None,
        typer.Option(
            "--scene",
            help="A scene file: its light, and its camera where --fov and --image-height are not "
            "given; what none of its viewers sees of its species is left out.",
            metavar="FILE.toml",
            parser=_path,
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be made.")] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Exit with 4 where triangles or memory exceed what was asked for."
        ),
    ] = False,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
    config: Config = None,
) -> None:
    """Make levels of detail of plant models.

    Writes a GLB per level, one combined GLB with MSFT_lod, a manifest and a contact sheet.

    [bold]Examples[/bold]

        vegtool convert oak.glb -o out/

        vegtool convert models/ -o out/ -j 4 --billboards 256
    """
    from vegtool.batch import Task, convert_files, find_jobs
    from vegtool.outcomes import as_summary, summary_text

    console = Console(-1 if quiet else verbose, json)
    of_scene: list[str] = []
    described = None
    if scene is not None:
        from vegtool.needs.plants import limits_of, says_so
        from vegtool.scene import read_scene, unused, with_scene

        described = read_scene(scene)
        convert = with_scene(convert, described)
        of_scene = unused(described, convert, says_so(described))
    todo = find_jobs(inputs)
    sources = tuple(job.source for job in todo)
    task = Task(
        out, read, convert, measure, force,
        depth=depth, packed=packed, dry_run=dry_run, strict=strict, inputs=sources,
    )  # fmt: skip
    if described is not None:
        with console.bar("scene") as progress:
            limited = limits_of(described, sources, read, progress)
        task = replace(task, limits=limited.limits)
        of_scene += limited.notes
        for note in of_scene:
            console.say(note)
    outcomes = []
    with console.bar("convert") as progress:
        for outcome in convert_files(todo, task, jobs, _file_progress(todo, progress)):
            outcomes.append(outcome)
    for outcome in outcomes:
        if outcome.error:
            console.say(f"error: {outcome.error}", at=-1)
            console.say(outcome.trace, at=2)
            continue
        for note in outcome.notes:
            console.say(f"{outcome.job.name}: {note}")
        for row in outcome.levels:
            spent = ", ".join(f"{stage} {s:.2f} s" for stage, s in row["seconds"].items())
            if spent:
                console.say(f"{outcome.job.name}: level {row['level']}: {spent}", at=1)
    console.result(as_summary(outcomes, of_scene), summary_text(outcomes, dry_run))
    failed = [o for o in outcomes if o.error]
    missed = [f"{o.job.name}: {sentence}" for o in outcomes for sentence in o.misses]
    if missed and failed:
        console.say(f"error: {'; '.join(missed)}", at=-1)
    if len(outcomes) == 1 and failed:
        raise typer.Exit(failed[0].exit_code)
    if failed:
        names = ", ".join(str(o.job.source) for o in failed)
        kind = BatchError if len(failed) < len(outcomes) else VegtoolError
        raise kind(f"{len(failed)} of {len(outcomes)} inputs failed: {names}")
    if missed:
        raise QualityError("; ".join(missed))


@app.command("report")
@flags
def report_command(
    *,
    inputs: Annotated[
        list[Path] | None, typer.Argument(help="Plant models, or folders of them.", parser=_path)
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Folder for the report.", metavar="FOLDER", parser=_path),
    ] = None,
    report: ReportOptions,
    read: ReadOptions,
    stability: Annotated[
        bool, typer.Option("--stability", help="Check the arithmetic on extreme cases instead.")
    ] = False,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
    config: Config = None,
) -> None:
    """Plot error against run time: every method and budget, beside what others do.

    Writes report.html, which needs nothing else, report.json and report.csv. An interrupted report
    goes on where it stopped.

    [bold]Examples[/bold]

        vegtool report oak.glb -o out/

        vegtool report models/ -o out/ --methods refined,branches --budgets 64,256

        vegtool report --stability
    """
    console = Console(-1 if quiet else verbose, json)
    if stability:
        _report_stability(console, out, force, bool(inputs))
        return
    if not inputs or out is None:
        lacking = "a folder for the report (-o out/)" if inputs else "a plant to report on"
        raise UsageError(f"expected {lacking}; got none")
    from vegtool.batch import find_jobs
    from vegtool.report import report as make_report
    from vegtool.report.journal import NAME as JOURNAL

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it frets over its cache
    sources = {job.name: job.source for job in find_jobs(inputs)}
    with console.bar("report") as progress:
        try:
            found = make_report(sources, report, read, out, force, progress)
        except KeyboardInterrupt:
            if (out / JOURNAL).exists():
                console.say("rows that are finished are kept: the same command goes on from there")
            raise
    from vegtool.report.run import misses
    from vegtool.report.text import as_summary, summary_text  # draws, which may not be possible

    for plant in found.plants:
        for note in plant.notes:
            console.say(f"{plant.name}: {note}")
        for row in plant.rows:
            spent = ", ".join(f"{stage} {s:.2f} s" for stage, s in row.cost.seconds.items())
            console.say(f"{plant.name}: {row.name}: {spent}", at=1)
    console.result(as_summary(found, out), summary_text(found, out))
    for name, error in found.failed.items():
        console.say(f"error: {name}: {error}", at=-1)
    if found.failed:
        kind = BatchError if found.plants else VegtoolError
        names = ", ".join(str(sources[name]) for name in found.failed)
        raise kind(f"{len(found.failed)} of {len(sources)} plants failed: {names}")
    if missed := misses(found):
        raise QualityError("; ".join(missed))


def _report_stability(console: Console, out: Path | None, force: bool, plants: bool) -> None:
    """The table of stability; QualityError where a case fails."""
    if plants:
        raise UsageError(
            "--stability: checks cases of its own, no plants; leave out one of the two"
        )
    from vegtool.formats.atomic import FileSet, check_free
    from vegtool.stability import as_json, markdown, run

    if out is not None:
        check_free(out, ["stability.md"], force)
    with console.bar("stability") as progress:
        results = run(progress)
    text = markdown(results)
    if out is not None:
        with FileSet(out, force) as files:
            files.add("stability.md", text.encode())
    console.result(as_json(results), text)
    failed = [result.name for result in results if not result.passed]
    if failed:
        raise QualityError(f"{len(failed)} of {len(results)} cases failed: {', '.join(failed)}")


@app.command("inspect")
@flags
def inspect_command(
    *,
    model: Annotated[Path, typer.Argument(help="A plant model.", parser=_path)],
    read: ReadOptions,
    branches: Annotated[
        Path | None,
        typer.Option("--branches", help="Write face_branch, parent, level.", metavar="FILE.npz"),
    ] = None,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
) -> None:
    """Show what is read from a model: triangles, materials, alpha, branches, bounds, warnings.

    [bold]Examples[/bold]

        vegtool inspect oak.glb

        vegtool inspect oak.obj --unit cm --branches oak_branches.npz
    """
    from vegtool.inspect import inspect_plant, inspection_text

    console = Console(-1 if quiet else verbose, json)
    with console.bar("inspect") as progress:
        inspection = inspect_plant(model, read, branches, force, progress)
    console.result(inspection, inspection_text(inspection))


@app.command("preview")
@flags
def preview_command(
    *,
    path: Annotated[
        Path,
        typer.Argument(
            help="A folder of converted plants, a manifest, a plant model or a scene.",
            parser=_path,
        ),
    ],
    scene: Annotated[
        Path | None,
        typer.Option(
            "--scene", help="A scene file: where plants stand.", metavar="FILE.toml", parser=_path
        ),
    ] = None,
    preview: PreviewOptions,
    read: ReadOptions,
    camera: Annotated[
        Path | None,
        typer.Option(
            "--path",
            help="A camera path to walk; by default the scene's.",
            metavar="PATH.toml",
            parser=_path,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            help="Write the walk: NAME.mp4, NAME.gif, NAME.png or a folder.",
            metavar="FILE",
            parser=_path,
        ),
    ] = None,
    screenshot: Annotated[
        Path | None,
        typer.Option("--screenshot", help="Write one picture.", metavar="FILE.png", parser=_path),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option("--frames", help="Draw so many frames and say what they took.", min=1),
    ] = None,
    stats: Annotated[
        Path | None,
        typer.Option("--stats", help="Write their figures.", metavar="FILE.json", parser=_path),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html",
            help="Write a page that shows converted plants in any browser.",
            metavar="FILE.html",
            parser=_path,
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
    config: Config = None,
) -> None:
    """Walk through plants and landscapes: geometry near, levels of detail far.

    Opens a window (h shows the keys); with --screenshot, --frames, --out or --html none.

    [bold]Examples[/bold]

        vegtool preview out/

        vegtool preview out/ --scene scene.toml --fps 30

        vegtool preview oak.glb --screenshot oak.png

        vegtool preview out/ --scene scene.toml --path way.toml --out way.mp4

        vegtool preview out/ --html page.html
    """
    from vegtool.preview.command import Wanted, run_preview

    console = Console(-1 if quiet else verbose, json)
    wanted = Wanted(path, scene, camera, out, screenshot, frames, stats, html, force)
    result = run_preview(wanted, preview, read, console.bar, console.say)
    console.result(result.facts, result.text)


@app.command("tiles")
@flags
def tiles_command(
    *,
    source: Annotated[
        Path,
        typer.Argument(
            help="A scene, an inventory with a row per plant, or the surfel billboards of one "
            "plant (NAME.surfels).",
            parser=_path,
        ),
    ],
    species: Annotated[
        Path | None,
        typer.Option(
            "--species",
            help="Folder of a landscape's plants, converted or models.",
            metavar="FOLDER",
            parser=_path,
        ),
    ] = None,
    out: Out,
    tiles: TileOptions,
    scene: Annotated[
        Path | None,
        typer.Option(
            "--scene",
            help="Make what the viewers of this scene can be shown, and nothing else.",
            metavar="FILE.toml",
            parser=_path,
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "-j",
            "--jobs",
            help="Processes; one to each core, unless told.",
            min=1,
            show_default=False,
        ),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(
            "--dask",
            help="Scheduler of a Dask cluster that sees the same files, in place of processes "
            "here.",
            metavar="ADDRESS",
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", help="Make this tile alone; may be repeated.", metavar="LEVEL/COLUMN/ROW"
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say how many tiles, bytes and seconds it would be.")
    ] = False,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
    config: Config = None,
) -> None:
    """Merge a landscape of plants, or make one plant, into tiles for 3D Tiles clients.

    [bold]Examples[/bold]

        vegtool tiles trees.csv --species library/ -o tiles/

        vegtool tiles scene.toml --species library/ -o tiles/ --dry-run

        vegtool tiles scene.toml --species library/ --scene scene.toml -o tiles/

        vegtool tiles oak.surfels -o oak/

        vegtool preview tiles/
    """
    from vegtool.tiles.command import run_tiles

    console = Console(-1 if quiet else verbose, json)
    how = RunOptions(jobs, dask, tuple(only or ()), dry_run, force)
    view = None
    if scene is not None:
        from vegtool.needs.view import view_of

        view = partial(view_of, scene)
    result = run_tiles(source, species, out, tiles, how, console.bar, console.say, view)
    for one in result.failed:
        console.say(f"error: {one.message}", at=-1)
        console.say(one.trace, at=2)
    console.result(result.facts, result.text)
    if result.exit_code == BatchError.exit_code:
        raise BatchError(
            f"{len(result.failed):,} parts could not be made; the others are there, and the same "
            "command tries again"
        )
    if result.exit_code:
        raise typer.Exit(result.exit_code)


@app.command("plan")
@flags
def plan_command(
    *,
    scene: Annotated[
        Path, typer.Argument(help="A scene file with cameras.", metavar="SCENE.toml", parser=_path)
    ],
    species: Annotated[
        Path,
        typer.Option(
            "--species",
            help="Folder of its plants, converted or as models.",
            metavar="FOLDER",
            parser=_path,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            help="Write the plan to this file too.",
            metavar="FILE.json",
            parser=_path,
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
    config: Config = None,
) -> None:
    """Say what of its plants a scene's viewers can ever see, and what can be left out.

    [bold]Examples[/bold]

        vegtool plan scene.toml --species library/

        vegtool plan scene.toml --species library/ -o plan.json
    """
    from vegtool.plan.command import run_plan

    console = Console(-1 if quiet else verbose, json)
    result = run_plan(scene, species, out, force, console.bar)
    for note in result.notes:
        console.say(note)
    console.result(result.facts, result.text)


@app.command("doctor")
def doctor_command(*, json: Json = False) -> None:
    """Check what this machine can do, with the remedy where something is missing."""
    from vegtool.doctor import diagnose

    checks = diagnose()
    rows = [("ok" if c.ok else "missing", c.name, c.found, c.remedy) for c in checks]
    Console(0, json).result(
        [c.__dict__ for c in checks], table(("", "part", "found", "remedy"), rows)
    )
    if not all(c.ok for c in checks if c.required):
        raise typer.Exit(5)


@app.command("sample")
def sample_command(
    *,
    name: Annotated[str, typer.Argument(help="Which plant; --list shows them.")] = "",
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File to write.", metavar="FILE.glb", parser=_path),
    ] = None,
    triangles: Annotated[
        int | None, typer.Option("-t", "--triangles", help="About how many.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Another seed, another individual.")] = 0,
    list_: Annotated[bool, typer.Option("--list", help="List the samples.")] = False,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a procedural plant, with its branches, to try things on.

    [bold]Examples[/bold]

        vegtool sample broadleaf

        vegtool sample conifer --triangles 50000 -o pine.glb
    """
    from vegtool.growth import SAMPLES, sample

    console = Console(-1 if quiet else 0, json)
    if list_ or not name:
        console.result(dict(SAMPLES), table(("sample", "what it is"), list(SAMPLES.items())))
        return
    from vegtool.formats.atomic import FileSet
    from vegtool.formats.gltf import plant_glb

    target = out or Path(f"{name}.glb")
    if target.suffix.lower() != ".glb":
        raise UsageError(f"--out: expected a name that ends in .glb; got {target}")
    plant = sample(name, triangles, seed)
    data = plant_glb(plant)
    with FileSet(target.parent, force) as files:
        files.add(target.name, data)
    facts = {"file": str(target), "triangles": len(plant.faces), "bytes": len(data)}
    console.result(facts, f"{target}: {len(plant.faces):,} triangles, {human_bytes(len(data))}")


def _file_progress(todo: list[Any], progress: Any) -> Any:
    """Each file's own progress as its share of the whole batch's."""

    def of(job: Any) -> Any:
        index = todo.index(job)
        return lambda stage, fraction: progress(
            f"{job.name}: {stage}", (index + fraction) / len(todo)
        )

    return of


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code."""
    _be_ended_politely()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # names that the terminal cannot show are escaped
            stream.reconfigure(errors="backslashreplace")
    sys.exit(run(arguments))


def _be_ended_politely() -> None:
    """Clean up on `kill` and on a terminal that closes as on Ctrl-C."""

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows has no SIGHUP
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # not under nohup
            signal.signal(number, interrupt)


def run(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code; every error is a sentence on stderr."""
    given = sys.argv[1:] if arguments is None else arguments
    try:
        command = typer.main.get_command(app)
        code = command.main(given, prog_name="vegtool", standalone_mode=False) or 0
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        return int(code)
    except typer.TyperException as error:
        message = error.format_message()
        if message:  # none where the help was shown for want of arguments
            print(f"error: {message} (vegtool --help lists what there is)", file=sys.stderr)
        return error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted: nothing is left half-written", file=sys.stderr)
        return INTERRUPTED
    except VegtoolError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        return 0
    except OSError as error:
        where = f"{error.filename}: " if error.filename else "the output could not be written: "
        print(f"error: {where}{error.strerror}", file=sys.stderr)
        return 1
    except Exception as error:
        if sum(a.count("v") for a in given if re.fullmatch(r"-\w*v\w*", a)) > 1:
            raise
        print(f"error: {unknown(error)}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    main()
