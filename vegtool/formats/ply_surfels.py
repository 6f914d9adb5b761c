"""Surfels as PLY, for programs that read point clouds: Turk, The PLY polygon file format (1994).

In progressive order; p_m and r_m are in comments of the head (gltf_surfels.py).
"""

from __future__ import annotations

import numpy as np

from vegtool.srgb import srgb_from_linear
from vegtool.surfel_set import SurfelSet

ROW = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "size")]
    + [(name, "u1") for name in ("red", "green", "blue")]
)
TYPES = {"<f4": "float", "|u1": "uchar"}


def ply_bytes(surfels: SurfelSet) -> bytes:
    """A binary file, little endian: positions in metres, y up; normals; sizes of the
    discs, of the radius of all; colours in sRGB."""
    rows = np.empty(len(surfels), ROW)
    color = np.round(255 * srgb_from_linear(np.clip(surfels.color, 0.0, 1.0))).astype(np.uint8)
    for names, values in (
        (("x", "y", "z"), surfels.position),
        (("nx", "ny", "nz"), surfels.normal),
        (("red", "green", "blue"), color),
    ):
        for name, column in zip(names, values.T, strict=True):
            rows[name] = column
    rows["size"] = surfels.size
    head = [
        "ply",
        "format binary_little_endian 1.0",
        "comment surfels in progressive order: any first part is a picture of the whole",
        f"comment p_m {surfels.spacing.length}",
        f"comment r_m {surfels.spacing.radius_m:.9g}",
        f"element vertex {len(rows)}",
        *(f"property {TYPES[ROW[name].str]} {name}" for name in ROW.names or ()),
        "end_header\n",
    ]
    return "\n".join(head).encode() + rows.tobytes()
