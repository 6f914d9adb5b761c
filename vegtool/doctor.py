"""What this machine can do, one line each, with the remedy where something is missing."""

from __future__ import annotations

import platform
import shutil
import sys
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from vegtool import __version__
from vegtool.errors import CapabilityError


@dataclass(frozen=True)
class Check:
    """One part: whether it is there, what was found, and what to do if it is not."""

    name: str
    ok: bool
    found: str
    remedy: str = ""
    required: bool = False


PYRENDER = "pyrender-maintained"

OPTIONAL_PACKAGES = {
    "DracoPy": ("reads Draco-compressed glTF", "pip install 'vegtool[draco]'"),
    "matplotlib": ("draws the plots of vegtool report", "pip install 'vegtool[report]'"),
    "av": ("writes films of vegtool preview as MP4", "pip install 'vegtool[video]'"),
    "rasterio": ("reads heightmaps that are GeoTIFFs", "pip install 'vegtool[geo]'"),
}

OPTIONAL_PROGRAMS = {
    "gltfpack": (
        "a baseline of vegtool report; decompresses meshopt glTF, which vegtool cannot",
        "npm install -g gltfpack",
    ),
}


def diagnose() -> list[Check]:
    """All checks, the required ones first."""
    return [_python(), *_drawing(), _windows(), *_packages(), *_programs()]


def _python() -> Check:
    found = f"Python {platform.python_version()}, vegtool {__version__}, {platform.system()}"
    return Check("python", sys.version_info >= (3, 11), found, required=True)


def _drawing() -> list[Check]:
    from vegtool.measure.pictures import renderer

    try:
        about = renderer()
    except CapabilityError as error:
        return [Check("drawing", False, "no OpenGL context", str(error), required=True)]
    return [Check(f"drawing: {name}", True, value, required=True) for name, value in about.items()]


def _windows() -> Check:
    from vegtool.gl.window import check_display

    purpose = "shows vegtool preview; its pictures, films and pages need none"
    try:
        check_display()
    except CapabilityError as error:
        return Check("windows", False, f"optional: {purpose}", str(error))
    return Check("windows", True, f"a display, and pyrender {version(PYRENDER)}: {purpose}")


def _packages() -> list[Check]:
    checks = []
    for name, (purpose, remedy) in OPTIONAL_PACKAGES.items():
        try:
            import_module(name)
            checks.append(Check(name, True, f"{version(name)}: {purpose}"))
        except (ImportError, PackageNotFoundError):
            checks.append(Check(name, False, f"optional: {purpose}", remedy))
    return checks


def _programs() -> list[Check]:
    checks = []
    for name, (purpose, remedy) in OPTIONAL_PROGRAMS.items():
        path = shutil.which(name)
        found = f"{path}: {purpose}" if path else f"optional: {purpose}"
        checks.append(Check(name, path is not None, found, "" if path else remedy))
    return checks
