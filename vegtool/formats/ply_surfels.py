"""Surfels as PLY, for programs that read point clouds: Turk, The PLY polygon file format (1994).

In progressive order; p_m and r_m are in comments of the head (gltf_surfels.py).
"""

from __future__ import annotations

import numpy as np

from vegtool.srgb import srgb_from_linear
from vegtool.surfel_set import SurfelSet

ROW = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "size")] + [
    (name, "u1") for name in ("red", "green", "blue")
]
LIGHT = [(name, "u1") for name in ("exposure", "exposure_behind", "transmission")]
"""Further columns, of surfels with light of their own: 255 for 1."""
TYPES = {"<f4": "float", "u1": "uchar"}


def ply_bytes(surfels: SurfelSet) -> bytes:
    """A binary file, little endian: positions in metres, y up; normals; sizes of the
    discs, of the radius of all; colours in sRGB; light, where they have some of their own."""
    columns = ROW if surfels.light is None else ROW + LIGHT
    rows = np.empty(len(surfels), columns)
    color = np.round(255 * srgb_from_linear(np.clip(surfels.color, 0.0, 1.0))).astype(np.uint8)
    for names, values in (
        (("x", "y", "z"), surfels.position),
        (("nx", "ny", "nz"), surfels.normal),
        (("red", "green", "blue"), color),
    ):
        for name, column in zip(names, values.T, strict=True):
            rows[name] = column
    rows["size"] = surfels.size
    if surfels.light is not None:
        for (name, _), column in zip(LIGHT, np.round(255 * surfels.light).T, strict=True):
            rows[name] = column
    head = [
        "ply",
        "format binary_little_endian 1.0",
        "comment surfels in progressive order: any first part is a picture of the whole",
        f"comment p_m {surfels.spacing.length}",
        f"comment r_m {surfels.spacing.radius_m:.9g}",
        f"element vertex {len(rows)}",
        *(f"property {TYPES[kind]} {name}" for name, kind in columns),
        "end_header\n",
    ]
    return "\n".join(head).encode() + rows.tobytes()
