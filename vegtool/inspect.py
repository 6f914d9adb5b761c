"""What was read from a model, as plain values: for `vegtool inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vegtool.branches import branches_of
from vegtool.console import table
from vegtool.errors import UsageError
from vegtool.formats import ReadOptions, read_plant
from vegtool.plant import Branches, Material, Plant
from vegtool.progress import Progress, silent


def inspect_plant(
    path: Path,
    read: ReadOptions,
    branches_file: Path | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Read a model and describe it; write its branches where a file for them is named.

    Raises UsageError where that file is none of its own: its name must end in .npz, so that
    neither the model nor what lies beside it is ever overwritten.
    """
    from vegtool.branches.table import write_branches

    if branches_file is not None and branches_file.suffix.lower() != ".npz":
        raise UsageError(f"--branches: expected a name that ends in .npz; got {branches_file}")
    plant = read_plant(path, read)
    branches = branches_of(plant, lambda stage, done: progress(stage, 0.3 + 0.7 * done))
    if branches_file is not None:
        write_branches(branches, branches_file, force)
    progress("done", 1.0)
    low, high = plant.bounds
    return {
        "file": str(path),
        "triangles": len(plant.faces),
        "vertices": len(plant.positions),
        "bounds_m": [low.tolist(), high.tolist()],
        "height_m": plant.height,
        "area_m2": float(plant.face_areas.sum()),
        "materials": [_material(plant, i, m) for i, m in enumerate(plant.materials)],
        "branches": _branches(branches),
        "notes": list(plant.notes),
    }


def inspection_text(inspection: dict[str, Any]) -> str:
    """The same for a person."""
    low, high = (np.array(c) for c in inspection["bounds_m"])
    size = " x ".join(f"{s:.3g}" for s in high - low)
    materials = [
        (
            *(m["name"], m["role"], f"{m['triangles']:,}", m["alpha"]),
            *(m["texture"], m["sides"], _light(m)),
        )
        for m in inspection["materials"]
    ]
    branches = inspection["branches"]
    levels = ", ".join(f"{n:,} at level {i}" for i, n in enumerate(branches["per_level"]))
    lines = [
        f"{inspection['file']}",
        f"  {inspection['triangles']:,} triangles, {inspection['vertices']:,} vertices,"
        f" {inspection['area_m2']:.4g} square metres",
        f"  {size} metres, from ({low[0]:.3g}, {low[1]:.3g}, {low[2]:.3g})",
        f"  branches ({branches['source']}): {levels}",
        "",
        table(("material", "role", "triangles", "alpha", "texture", "sides", "light"), materials),
    ]
    if inspection["notes"]:
        lines += ["", *(f"note: {note}" for note in inspection["notes"])]
    return "\n".join(lines)


def _material(plant: Plant, index: int, material: Material) -> dict[str, Any]:
    texture = material.color_texture
    size = "none" if texture is None else "{1} x {0}".format(*texture.pixels.shape[:2])
    masked = material.alpha_mode == "mask"
    return {
        "name": material.name,
        "role": material.role,
        "triangles": int((plant.face_material == index).sum()),
        "alpha": f"mask {material.alpha_cutoff:g}" if masked else "opaque",
        "texture": size,
        "normal_texture": material.normal_texture is not None,
        "base_color": [round(float(c), 4) for c in material.base_color],
        "sides": "both" if material.double_sided else "front",
        "unlit": material.unlit,
        "transmission": round(material.transmission, 4),
    }


def _light(material: dict[str, Any]) -> str:
    """What a person is told of a material and light: that it takes none, or how much passes."""
    if material["unlit"]:
        return "unlit"
    return f"passes {material['transmission']:.2f}" if material["transmission"] else ""


def _branches(branches: Branches) -> dict[str, Any]:
    counts = np.bincount(branches.level) if len(branches) else np.zeros(0, int)
    return {
        "source": branches.source,
        "count": len(branches),
        "per_level": [int(c) for c in counts],
    }
