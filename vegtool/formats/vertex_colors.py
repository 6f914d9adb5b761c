"""Vertex colours: a factor on the material, or a mask for wind in disguise.

glTF multiplies COLOR_0 into the base colour. Exporters also store weights for wind shaders there,
which would paint a plant red, green and black.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray

BLACK = 1.5 / 255
"""A channel never above this is empty."""
WHITE = 254.5 / 255
"""Colours never below this change nothing."""
VARIED = 0.1
"""Colours that vary less are one tint."""
UNALIKE = 0.5
"""Mean difference between the largest and the smallest channel over the largest: natural tints lie
well below on textured plants, weights for wind above."""


def settle_colors(
    colors: FloatArray, tints: bool | npt.NDArray[np.bool_], what: str, notes: list[str]
) -> FloatArray | None:
    """(v, 4) linear factors, or None where they change nothing or are no colours.

    colors: (v, 3) or (v, 4). tints: whether they can but tint a texture, or (v,) which of them;
    the others paint.
    """
    if not len(colors):
        return None
    if colors.shape[1] == 3:
        colors = np.concatenate([colors, np.ones((len(colors), 1))], axis=1)
    colors = np.clip(np.nan_to_num(np.asarray(colors, dtype=np.float64), nan=1.0), 0.0, 1.0)
    if colors.min() >= WHITE:
        return None
    rgb = colors[:, :3]
    highest = rgb.max(axis=0)
    if highest.max() <= BLACK:
        notes.append(f"{what}: vertex colours are all black; ignored")
        return None
    tinting = rgb[np.broadcast_to(tints, len(rgb))]
    if len(tinting) and _looks_like_weights(tinting):
        notes.append(f"{what}: vertex colours look like weights for wind, not colours; ignored")
        return None
    return colors


def texture_spread(uvs: FloatArray, faces: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
    """(v,) whether a vertex belongs to a face that spreads over the texture.

    A face whose corners all show one place of it has the colour of its vertices.
    """
    spread = np.zeros(len(uvs), bool)
    corners = uvs[faces]
    spread[faces[(corners != corners[:, :1]).any(axis=(1, 2))]] = True
    return spread


def _looks_like_weights(rgb: FloatArray) -> bool:
    """Colours that vary, in pure channels or in channels that have nothing to do with another."""
    if np.ptp(rgb, axis=0).max() <= VARIED:
        return False
    if (rgb.max(axis=0) <= BLACK).any():
        return True
    largest = rgb.max(axis=1)
    lit = largest > BLACK
    unlike = (largest[lit] - rgb.min(axis=1)[lit]) / largest[lit]
    return bool(unlike.mean() > UNALIKE)
