"""From where a surfel billboard may stand for what it shows.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007),
section 3.2 and 3.3, whose names these are: pc the pixels of a metre at one metre, epsilon the error
that is allowed in pixels, theta the share of all directions from which it is kept at z_min.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from vegtool.arrays import FloatArray, unit


def image_size(length: FloatArray, z: FloatArray, pc: float) -> FloatArray:
    """Pixels that lengths in metres across the view cover at distances of z metres (eq. 3);
    infinite from nowhere."""
    length, z = np.broadcast_arrays(np.asarray(length, float), np.asarray(z, float))
    pixels = np.divide(length * pc, z, out=np.full(length.shape, np.inf), where=z > 0)
    return np.asarray(pixels)


def projection_error(
    half_depth: FloatArray, normal: FloatArray, to_center: FloatArray, z: FloatArray, pc: float
) -> FloatArray:
    """e_p (eq. 4): pixels between a point and its projection on the plane, about.

    half_depth: (b,) d in metres. normal, to_center: (b, 3) unit normals, and from the eye to the
    centres. z: (b,) metres.
    """
    cosine = np.einsum("bi,bi->b", unit(to_center), normal)
    sine = np.sqrt(np.clip(1 - cosine * cosine, 0.0, 1.0))
    return image_size(half_depth * sine, z, pc)


def texel_error(half: FloatArray, texels: FloatArray, z: FloatArray, pc: float) -> FloatArray:
    """e_t (eq. 5): pixels that a texel covers. half: (b, 2) w and h in metres. texels: (b, 2)."""
    return np.asarray((image_size(2 * half, z[:, None], pc) / texels).max(axis=1))


def spread(theta: float) -> float:
    """Sine of the angle beta from the normal, either way, within which the share theta of all
    directions lies: sqrt(theta (2 - theta)) (eq. 7, 8)."""
    return sqrt(theta * (2 - theta))


def distance_error(half_depth: FloatArray, theta: float) -> FloatArray:
    """Metres: d sqrt(theta (2 - theta)), which is epsilon z_min / pc (eq. 8)."""
    return np.asarray(half_depth * spread(theta))


def z_min(error: FloatArray, epsilon: float, pc: float) -> FloatArray:
    """Metres: the least distance at which an error in metres is of epsilon pixels (eq. 6, 8)."""
    return np.asarray(error * (pc / epsilon))
