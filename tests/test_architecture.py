"""The house keeps its shape: imports run one way, and starting up loads nothing heavy."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "vegtool"

GROUND = {
    "errors", "arrays", "options", "progress", "seeding", "srgb", "timing",
    "plant", "lod", "surfel_set", "vegtool",
}  # fmt: skip
"""Contracts that every room may import."""

MAY_IMPORT: dict[str, set[str]] = {
    "formats": {"tangents"},
    "growth": set(),
    "branches": {"formats"},
    "clustering": {"branches"},
    "boxes": {"meshes"},
    "lighting": set(),
    "elements": {"branches"},
    "tangents": set(),
    "gl": {"lighting", "elements", "tangents"},
    "baking": {"gl"},
    "measure": {"gl", "lighting"},
    "meshes": set(),
    "baselines": {"formats", "baking", "gl", "measure", "meshes"},
    "hybrid": {"clustering", "boxes", "gl", "baking", "measure", "meshes", "refine"},
    "refine": {"branches", "clustering", "boxes", "gl", "baking", "lighting", "measure"},
    "surfels": {"baking", "boxes", "formats", "gl", "lighting", "measure", "meshes", "refine"},
    "tiles": {
        "batch", "convert", "scene", "clustering", "boxes", "lighting", "formats", "baking", "gl",
        "measure", "refine", "surfels", "tangents", "console", "workers",
    },
    "convert": {
        "clustering", "boxes", "gl", "baking", "hybrid", "lighting", "measure", "refine", "surfels",
    },
    "workers": set(),
    "batch": {"convert", "formats", "measure", "workers"},
    "scene": {"convert", "lighting"},
    "camera_path": {"scene"},
    "needs": {"camera_path", "formats", "lighting", "scene", "tiles"},
    "preview": {
        "camera_path", "elements", "formats", "gl", "lighting", "measure", "needs", "scene",
        "surfels", "tiles",
    },
    "stability": {
        "branches", "clustering", "boxes", "gl", "lighting", "baking", "measure", "refine",
        "convert", "growth", "preview",
    },
    "report": {
        "formats", "clustering", "gl", "lighting", "measure", "baselines", "refine", "convert",
        "console",
    },
    "outcomes": {"batch", "console"},
    "inspect": {"branches", "formats", "console"},
    "doctor": {"gl", "measure"},
    "console": set(),
    "flags": set(),
    "__main__": {"cli"},
    "cli": {
        "batch", "console", "convert", "doctor", "flags", "formats", "growth", "inspect",
        "measure", "needs", "outcomes", "preview", "report", "scene", "stability", "tiles",
    },
}  # fmt: skip

HEAVY = (
    "moderngl", "trimesh", "sklearn", "scipy", "PIL", "skimage", "matplotlib",
    "fast_simplification", "numba", "pyrender", "pyglet", "OpenGL",
)  # fmt: skip


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    relative = path.relative_to(PACKAGE)
    return relative.parts[0].removesuffix(".py")


def imported_rooms(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
            if node.module == "vegtool":
                names = [f"vegtool.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        found |= {n.split(".")[1] for n in names if n.startswith("vegtool.")}
    return found - {"__version__"}


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_run_one_way(path: Path) -> None:
    room = room_of(path)
    if room in GROUND or room == "__init__":
        assert imported_rooms(path) <= GROUND
        return
    assert room in MAY_IMPORT, f"a new room: say in {Path(__file__).name} what it may import"
    assert imported_rooms(path) - {room} <= GROUND | MAY_IMPORT[room]


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_only_gl_imports_moderngl_and_only_formats_loads_models(path: Path) -> None:
    names = {
        alias.name if isinstance(node, ast.Import) else node.module or ""
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    roots = {name.split(".")[0] for name in names}
    if room_of(path) != "gl":
        assert not roots & {"moderngl", "pyrender", "pyglet", "OpenGL"}
    if room_of(path) != "formats":
        assert "trimesh" not in roots


@pytest.mark.parametrize(
    "code",
    [
        "import vegtool",
        "from vegtool.cli import run; run(['--help'])",
        "from vegtool.cli import run; run(['convert', '--help'])",
        "from vegtool.cli import run; run(['report', '--help'])",
        "from vegtool.cli import run; run(['preview', '--help'])",
        "from vegtool.cli import run; run(['sample', '--help'])",
    ],
)
def test_starting_up_loads_nothing_heavy(code: str) -> None:
    report = "; import sys, json; print('LOADED' + json.dumps(sorted(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code + report], capture_output=True, text=True, check=True
    )
    loaded = {name.split(".")[0] for name in json.loads(done.stdout.split("LOADED")[1])}
    assert not loaded & set(HEAVY)
