"""sRGB to linear light and back (IEC 61966-2-1); gl/shaders/srgb.glsl is the same on the GPU."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[Any]
"""float32 or float64; the result is of the same type."""


def linear_from_srgb(color: Floats) -> Floats:
    """Decode; what lies outside 0 to 1 is clipped."""
    color = np.clip(color, 0.0, 1.0)
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(light: Floats) -> Floats:
    """Encode values of 0 to 1."""
    curve = 1.055 * np.maximum(light, 1e-8) ** (1 / 2.4) - 0.055
    return np.where(light <= 0.0031308, light * 12.92, curve)
