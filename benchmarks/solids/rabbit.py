"""A sitting rabbit of clay as a scanner gives it, of about 100,000 triangles."""

from __future__ import annotations

import numpy as np

from solids.implicit import Limb, folded, limbs, mirrored, nearest, scanned
from vegtool.arrays import FloatArray
from vegtool.growth.noise import octaves
from vegtool.plant import Plant
from vegtool.seeding import generator

BODY = [
    *limbs([(-0.085, 0.115, 0), (0.0, 0.125, 0), (0.075, 0.135, 0)], [0.105, 0.098, 0.078], 0.03),
    *limbs([(0.08, 0.16, 0), (0.115, 0.235, 0)], [0.068, 0.052], 0.03),
    *limbs([(0.115, 0.262, 0), (0.165, 0.248, 0)], [0.058, 0.036], 0.02, flat=0.92),
]
LEG = [
    *limbs([(-0.08, 0.095, 0.068), (-0.015, 0.085, 0.095), (0.005, 0.065, 0.097)],
           [0.078, 0.05, 0.036], 0.01, flat=0.7),
    *limbs([(-0.065, 0.024, 0.085), (0.0, 0.022, 0.097), (0.065, 0.02, 0.1)],
           [0.026, 0.024, 0.022], 0.01, flat=1.15),
    *limbs([(0.085, 0.125, 0.042), (0.112, 0.07, 0.045), (0.122, 0.026, 0.046)],
           [0.044, 0.028, 0.021], 0.012),
    *limbs([(0.125, 0.022, 0.046), (0.157, 0.019, 0.048)], [0.021, 0.02], 0.008),
]  # fmt: skip
FACE = [
    *limbs([(0.155, 0.235, 0.028)], [0.03], 0.012),
    *limbs([(0.196, 0.236, 0.009)], [0.014], 0.005),
    *limbs([(0.135, 0.283, 0.04), (0.16, 0.279, 0.034)], [0.012, 0.008], 0.008),
    *limbs([(0.149, 0.268, 0.058)], [0.017], 0.008, cut=True),
    *limbs([(0.147, 0.268, 0.0385)], [0.0125], 0.002),
]
TOES = [
    groove
    for x, z in ((0.083, 0.093), (0.085, 0.107), (0.173, 0.043), (0.174, 0.053))
    for groove in limbs(
        [(x - 0.014, 0.046, z), (x + 0.006, 0.026, z), (x + 0.006, 0.002, z)],
        [0.003, 0.005, 0.004], 0.005, flat=0.5, cut=True,
    )
]  # fmt: skip
OUT = (0.62, 0.28, 0.73)
"""Where the left ear opens to."""
EAR = limbs(
    [(0.098, 0.3, 0.026), (0.086, 0.33, 0.033), (0.067, 0.365, 0.042), (0.045, 0.4, 0.051),
     (0.023, 0.43, 0.058), (0.003, 0.455, 0.064), (-0.01, 0.47, 0.067)],
    [0.016, 0.023, 0.029, 0.031, 0.027, 0.017, 0.006], 0.01, side=OUT, flat=0.4,
)  # fmt: skip
INSIDE = limbs(
    [(0.097, 0.336, 0.048), (0.081, 0.368, 0.057), (0.059, 0.403, 0.066), (0.037, 0.432, 0.073),
     (0.018, 0.455, 0.078)],
    [0.011, 0.019, 0.021, 0.017, 0.008], 0.005, side=OUT, flat=0.62, cut=True,
)  # fmt: skip
TAIL = limbs([(-0.19, 0.095, 0), (-0.205, 0.12, 0)], [0.034, 0.028], 0.008)
EYES = FACE[-1:]


def parts() -> list[Limb]:
    left = [*LEG, *FACE, *TOES, *EAR, *INSIDE]
    return [*BODY, *TAIL, *left, *mirrored(left)]


def rabbit(triangles: int = 104_026) -> Plant:
    """0.47 m tall; it looks along x, y is up."""
    return scanned("rabbit", parts(), _fur, triangles, "#b9a58c")


def _fur(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Tufts, longer on the tail, none on the eyes, little in the ears; and grain."""
    rng = generator(0, "rabbit")
    eyes, tail, ears = (nearest(of, folded(points)) for of in (EYES, TAIL, INSIDE))
    long = np.clip(eyes / 0.004, 0, 1) * (0.3 + 0.7 * np.clip(ears / 0.006, 0, 1))
    long *= 1.0 + np.clip(1 - tail / 0.01, 0, 1)
    tufts = octaves(points * np.array([45.0, 75.0, 75.0]), 2, 0.6, rng)
    grain = octaves(points * 260.0, 2, 0.6, rng)
    return 0.0024 * long * tufts + 0.00045 * grain
