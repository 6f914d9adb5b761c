"""Exposure of vertices in glTF, which knows occlusion as a texture alone.

The RAMP shows its own coordinates, so that the second set of a mesh (TEXCOORD_1) holds what the
vertices hold (Plant.exposure).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.lod import Level

RAMP_SIZE = 16  # texels: halves evenly into mip levels, and 15 steps of 17 make 255


def _ramp() -> npt.NDArray[np.uint8]:
    """(RAMP_SIZE, RAMP_SIZE, 4): red grows along u, green and alpha along v, each from 0 to 255."""
    step = np.round(np.linspace(0, 255, RAMP_SIZE)).astype(np.uint8)
    v, u = np.meshgrid(step, step, indexing="ij")
    return np.stack([u, v, np.zeros_like(u), v], axis=2)


RAMP = _ramp()


def on_ramp(exposure: FloatArray) -> FloatArray:
    """(v, 2) texture coordinates at which the RAMP is `exposure`, 0 to 1: between the middles of
    its outermost texels."""
    return np.asarray((0.5 + (RAMP_SIZE - 1) * np.clip(exposure, 0.0, 1.0)) / RAMP_SIZE)


def has_ramp(level: Level) -> bool:
    """Whether a RAMP is written with a level: a mesh of known exposure, not all of it unlit."""
    if level.kind != "mesh" or level.mesh is None or level.mesh.exposure is None:
        return False
    lit = np.array([not material.unlit for material in level.mesh.materials])
    return bool(lit[level.mesh.face_material].any())


def written_texels(level: Level) -> int:
    """Texels of all images that a level is written with: its textures, and the RAMP."""
    return level.texels + (RAMP_SIZE**2 if has_ramp(level) else 0)
