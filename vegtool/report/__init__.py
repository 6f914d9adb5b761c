"""Report: error against run time, every method and budget beside the baselines, measured.

`report` is the room's one entrance. Rows that are finished are kept in the output folder until the
report is whole, so that an interrupted one goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from vegtool.errors import CapabilityError, UsageError
from vegtool.progress import Progress, silent

if TYPE_CHECKING:
    from vegtool.formats import ReadOptions
    from vegtool.report.options import ReportOptions
    from vegtool.report.rows import Report


def report(
    sources: Mapping[str, Path],
    options: ReportOptions,
    read: ReadOptions,
    folder: Path,
    force: bool = False,
    progress: Progress = silent,
) -> Report:
    """Measure plants and write report.json, report.csv and report.html into a folder.

    sources: files by the names that the plants shall have. force: what stands in the folder is
    overwritten. A plant that fails is named in the report, `failed`, and where all do, nothing is
    written; the error of an only plant is raised. Raises UsageError for options out of range,
    OutputError for a folder that may not be written to, CapabilityError where matplotlib is missing
    or nothing can draw.
    """
    _check_plots()
    from vegtool.report.journal import Journal
    from vegtool.report.run import key, run
    from vegtool.report.write import check_folder, write

    if not sources:
        raise UsageError("expected a plant to report on; got none")
    inputs = tuple(sources.values())
    check_folder(folder, force, inputs)
    with Journal(folder, key(options, read), force) as journal:
        found = run(sources, options, read, journal, progress)
        progress("writing", 1.0)
        if found.plants:
            write(found, folder, force, inputs)
            journal.remove()
    return found


def _check_plots() -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise CapabilityError(
            "a report's plots are made by matplotlib, which is not installed; "
            "install it with: pip install 'vegtool[report]'"
        ) from error
