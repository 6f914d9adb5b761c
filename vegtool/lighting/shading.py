"""Light that surfaces send to the viewer, in arrays: what shading.glsl does, fragment by fragment.

Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes using
hybrid level-of-detail approaches (2005), section 3, for normals that turn to the viewer. A sun, and
a sky that is brighter above than below; both are diffuse. Of the light on one side of a leaf a
share leaves by the other, as KHR_materials_diffuse_transmission has it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.lighting.light import Light


def turned(normal: FloatArray, front: npt.NDArray[np.bool_]) -> FloatArray:
    """(..., 3) normals as seen: those of back faces reversed. front: (...) bool."""
    return np.where(front[..., None], normal, -normal)


def turned_to(normal: FloatArray, to_viewer: FloatArray) -> FloatArray:
    """(..., 3) normals turned to a viewer in the directions (..., 3), of any length."""
    return turned(normal, (normal * to_viewer).sum(axis=-1) >= 0)


def sky_light(normal: FloatArray, light: Light) -> FloatArray:
    """(...) what the sky adds to surfaces with normals (..., 3), as a factor of the albedo."""
    up = 0.5 + 0.5 * normal[..., 1]
    return np.asarray(light.sky_below + (light.sky_above - light.sky_below) * up)


def shaded(
    color: FloatArray,
    normal: FloatArray,
    light: Light,
    exposure: FloatArray | None = None,
    transmission: npt.ArrayLike = 0.0,
    tint: npt.ArrayLike = (1.0, 1.0, 1.0),
    visible: npt.ArrayLike = 1.0,
    through: npt.ArrayLike = 1.0,
) -> FloatArray:
    """(..., 3) linear light.

    color: (..., 3) linear albedo. normal: (..., 3) unit, turned to the viewer. exposure: (..., 2)
    how much of the sky's light reaches the viewer's side and the other; None for all of it.
    transmission: (...) share of light that passes through, times `tint`, (..., 3). visible,
    through: (...) share of the sun that nothing hides, for light on this side and on the other.
    """
    toward = normal @ light.unit
    near, far = (1.0, 1.0) if exposure is None else (exposure[..., 0], exposure[..., 1])
    here = light.sun * np.asarray(visible) * np.maximum(toward, 0) + sky_light(normal, light) * near
    share = np.asarray(transmission, np.float64)
    if not share.any():
        return np.asarray(color * here[..., None])
    behind = light.sun * np.asarray(through) * np.maximum(-toward, 0)
    behind = behind + sky_light(-normal, light) * far
    passed = (share * behind)[..., None] * np.asarray(tint, np.float64)
    return np.asarray(color * (((1 - share) * here)[..., None] + passed))
