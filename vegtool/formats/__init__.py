"""Model files in, level-of-detail files out: the only place that opens model files.

Reading: `read_plant(path, ReadOptions())` gives a Plant, whatever the format; a new format is one
line in READERS. What each format's quirks become is written in docs/formats.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from vegtool.errors import CapabilityError, InputError, UsageError
from vegtool.options import option

if TYPE_CHECKING:
    from vegtool.plant import Plant

READERS = {
    ".glb": "vegtool.formats.read_gltf",
    ".gltf": "vegtool.formats.read_gltf",
    ".obj": "vegtool.formats.read_obj",
    ".ply": "vegtool.formats.read_mesh",
    ".stl": "vegtool.formats.read_mesh",
}
"""File name extension -> module whose `parse(path)` gives Parsed (see parts.py)."""

CONVERTERS = {
    ".fbx": "Blender (File > Import > FBX, then File > Export > glTF 2.0), FBX2glTF or assimp",
    ".blend": "Blender (File > Export > glTF 2.0)",
    ".usd": "Blender (File > Import > Universal Scene Description, then File > Export > glTF 2.0)",
    ".usdz": "Blender (File > Import > Universal Scene Description, then File > Export > glTF 2.0)",
    ".dae": "Blender before 5.0 or assimp",
    ".3ds": "assimp",
    ".max": "3ds Max (File > Export > glTF)",
    ".spm": "the SpeedTree Modeler (File > Export mesh)",
}
"""Formats that vegtool cannot read, and what turns them into GLB."""

METRES_PER = {"mm": 0.001, "cm": 0.01, "dm": 0.1, "m": 1.0, "in": 0.0254, "ft": 0.3048}

SMALLEST, LARGEST = 1e-9, 1e9
"""Metres: the range of units and of plants. Beyond, 32-bit files and GPUs lose count."""

UP_AXES = ("auto", "x", "y", "z", "-x", "-y", "-z")


@dataclass(frozen=True)
class ReadOptions:
    """How to understand a file that does not say so itself.

    unit: length of the file's unit: mm, cm, dm, m, in, ft, or a number of metres.
    up: the file's upward axis; "auto" is the format's convention (glTF: y) or, where it has none,
    a guess from the geometry.
    leaf_materials: names or patterns (`leaf*`) of the materials that are leaves, all others being
    wood; empty for a guess.
    """

    unit: str = option("m", "Unit of the file: mm, cm, dm, m, in, ft, or a number of metres.")
    up: str = option(
        "auto", "Upward axis of the file; auto: the format's own, or judged.", choices=UP_AXES
    )
    leaf_materials: tuple[str, ...] = option((), "A material that is leaves: a name or pattern.")

    def __post_init__(self) -> None:
        if self.up not in UP_AXES:
            raise UsageError(f"--up: expected one of {', '.join(UP_AXES)}; found {self.up!r}")
        if not SMALLEST <= self.metres <= LARGEST:
            raise UsageError(
                f"--unit: expected {SMALLEST:g} to {LARGEST:g} metres; found {self.unit!r}"
            )

    @property
    def metres(self) -> float:
        """Metres per unit of the file."""
        if self.unit in METRES_PER:
            return METRES_PER[self.unit]
        try:
            return float(self.unit)
        except ValueError:
            raise UsageError(
                f"--unit: expected {', '.join(METRES_PER)} or a number of metres; "
                f"found {self.unit!r}"
            ) from None


def read_plant(path: str | Path, options: ReadOptions = ReadOptions()) -> Plant:
    """Read a plant model.

    Raises InputError for a file that is missing, broken or not a plant, CapabilityError for one
    that needs a converter or a decoder that is not here; each message names file and remedy.
    """
    path = Path(path)
    try:
        return _read(path, options)
    except OSError as error:
        raise InputError(
            f"{error.filename or path}: cannot be read ({error.strerror}); allow it, or copy it"
        ) from error


def read_with_files(
    path: Path, options: ReadOptions = ReadOptions()
) -> tuple[Plant, tuple[Path, ...]]:
    """A plant model, and all files that it consists of: itself, then what it refers to, each once.

    Raises as `read_plant`.
    """
    from vegtool.formats.beside import found_files

    with found_files() as beside:
        plant = read_plant(path, options)
    return plant, tuple(dict.fromkeys([path, *beside]))


def _read(path: Path, options: ReadOptions) -> Plant:
    try:
        path.lstat()
    except FileNotFoundError:
        raise InputError(
            f"{path}: expected a model file, found nothing there; check the path"
        ) from None
    extension = path.suffix.lower()
    if extension in CONVERTERS:
        raise CapabilityError(
            f"{path}: {extension[1:].upper()} files cannot be read; convert it to GLB with "
            f"{CONVERTERS[extension]}, then read the GLB"
        )
    if extension not in READERS:
        raise InputError(
            f"{path}: expected a model file ({', '.join(READERS)}), found "
            f"{extension or 'no file name extension'}; convert or rename it"
        )
    if not path.is_file():
        found = "a folder" if path.is_dir() else "nothing"
        raise InputError(f"{path}: expected a model file, found {found} there; check the path")
    from vegtool.formats.read import assemble  # numpy and Pillow load only when a file is read

    plant = assemble(import_module(READERS[extension]).parse(path), path, options)
    size = plant.extent
    if not SMALLEST <= size <= LARGEST:
        raise InputError(
            f"{path}: expected a plant of {SMALLEST:g} to {LARGEST:g} metres, found one of "
            f"{size:.3g}; say the file's unit with --unit"
        )
    return plant
