"""An armadillo that stands on its hind legs, of bronze, as a scanner gives it, of about 200,000
triangles."""

from __future__ import annotations

import numpy as np

from solids.implicit import Limb, folded, limbs, mirrored, nearest, plates, scanned
from vegtool.arrays import FloatArray
from vegtool.growth.noise import octaves
from vegtool.plant import Plant
from vegtool.seeding import generator

TORSO = [
    *limbs([(-0.005, 0.22, 0), (0.02, 0.285, 0), (0.01, 0.37, 0)], [0.085, 0.095, 0.078], 0.03),
    *limbs([(0.005, 0.38, 0.075), (0.005, 0.38, -0.075)], [0.045, 0.045], 0.03),
]
SHELL = limbs(
    [(-0.045, 0.2, 0), (-0.05, 0.27, 0), (-0.045, 0.34, 0), (-0.02, 0.405, 0)],
    [0.09, 0.105, 0.1, 0.075], 0.006,
)  # fmt: skip
HEAD = [
    *limbs([(0.015, 0.41, 0), (0.04, 0.46, 0)], [0.05, 0.045], 0.02),
    *limbs([(0.04, 0.47, 0), (0.085, 0.465, 0), (0.135, 0.445, 0), (0.17, 0.435, 0)],
           [0.052, 0.042, 0.024, 0.015], 0.015),
    *limbs([(0.183, 0.436, 0)], [0.012], 0.006),
]  # fmt: skip
TAIL = limbs(
    [(-0.09, 0.16, 0), (-0.14, 0.1, 0.0), (-0.19, 0.055, 0.01), (-0.25, 0.03, 0.03),
     (-0.31, 0.022, 0.06), (-0.36, 0.02, 0.1)],
    [0.05, 0.036, 0.027, 0.02, 0.013, 0.006], 0.02,
)  # fmt: skip
ARM = limbs(
    [(0.005, 0.385, 0.09), (-0.005, 0.345, 0.15), (0.005, 0.325, 0.175), (0.055, 0.35, 0.205),
     (0.085, 0.37, 0.215)],
    [0.045, 0.036, 0.031, 0.032, 0.02], 0.015,
)  # fmt: skip
LEG = [
    *limbs([(0.0, 0.2, 0.06), (0.035, 0.125, 0.1), (0.0, 0.08, 0.1), (-0.015, 0.035, 0.1)],
           [0.066, 0.048, 0.04, 0.028], 0.02),
    *limbs([(-0.02, 0.022, 0.098), (0.05, 0.02, 0.112)], [0.026, 0.022], 0.012, flat=1.3),
]  # fmt: skip
HAND = [
    *limbs([(0.085, 0.37, 0.215), (0.105, 0.385, 0.22)], [0.022, 0.024], 0.01),
    *limbs([(0.11, 0.395, 0.205), (0.137, 0.42, 0.198)], [0.012, 0.009], 0.006),
    *limbs([(0.115, 0.393, 0.222), (0.147, 0.415, 0.226)], [0.012, 0.009], 0.006),
    *limbs([(0.11, 0.385, 0.238), (0.137, 0.4, 0.252)], [0.011, 0.008], 0.006),
    *limbs([(0.1, 0.37, 0.2), (0.128, 0.372, 0.187)], [0.011, 0.008], 0.006),
]
FOOT = [
    *limbs([(0.05, 0.018, 0.09), (0.082, 0.014, 0.088)], [0.015, 0.013], 0.006),
    *limbs([(0.055, 0.018, 0.115), (0.092, 0.014, 0.12)], [0.016, 0.013], 0.006),
    *limbs([(0.045, 0.018, 0.138), (0.075, 0.014, 0.148)], [0.015, 0.012], 0.006),
]
CLAWS = [
    *limbs([(0.137, 0.42, 0.198), (0.152, 0.437, 0.193), (0.162, 0.44, 0.189)],
           [0.007, 0.005, 0.002], 0.002),
    *limbs([(0.147, 0.415, 0.226), (0.165, 0.43, 0.229), (0.176, 0.431, 0.23)],
           [0.007, 0.005, 0.002], 0.002),
    *limbs([(0.137, 0.4, 0.252), (0.152, 0.412, 0.26), (0.162, 0.412, 0.264)],
           [0.007, 0.005, 0.002], 0.002),
    *limbs([(0.128, 0.372, 0.187), (0.144, 0.377, 0.179), (0.153, 0.375, 0.175)],
           [0.006, 0.005, 0.002], 0.002),
    *limbs([(0.085, 0.016, 0.088), (0.102, 0.013, 0.087), (0.113, 0.006, 0.086)],
           [0.009, 0.006, 0.002], 0.002),
    *limbs([(0.095, 0.016, 0.12), (0.112, 0.013, 0.122), (0.123, 0.006, 0.123)],
           [0.009, 0.006, 0.002], 0.002),
    *limbs([(0.078, 0.016, 0.149), (0.094, 0.013, 0.154), (0.104, 0.006, 0.157)],
           [0.009, 0.006, 0.002], 0.002),
]  # fmt: skip
FORWARD = (0.85, 0.2, 0.5)
"""Where the left ear opens to."""
EAR = [
    *limbs([(0.02, 0.505, 0.03), (0.008, 0.54, 0.048), (-0.005, 0.575, 0.06), (-0.013, 0.6, 0.066)],
           [0.014, 0.024, 0.022, 0.007], 0.008, side=FORWARD, flat=0.42),
    *limbs([(0.028, 0.53, 0.05), (0.013, 0.56, 0.061), (0.006, 0.582, 0.068)],
           [0.009, 0.016, 0.01], 0.005, side=FORWARD, flat=0.7, cut=True),
]  # fmt: skip
EYES = [
    *limbs([(0.088, 0.493, 0.026), (0.105, 0.482, 0.026)], [0.011, 0.007], 0.006),
    *limbs([(0.103, 0.478, 0.033)], [0.011], 0.005, cut=True),
    *limbs([(0.101, 0.477, 0.026)], [0.0085], 0.0015),
]
MOUTH = limbs(
    [(0.178, 0.424, 0), (0.14, 0.428, 0.019), (0.11, 0.438, 0.034)], [0.003, 0.0035, 0.002],
    0.003, cut=True,
)  # fmt: skip


def parts() -> list[Limb]:
    left = [*ARM, *LEG, *HAND, *FOOT, *CLAWS, *EAR, *EYES, *MOUTH]
    return [*TORSO, *SHELL, *HEAD, *TAIL, *left, *mirrored(left)]


def armadillo(triangles: int = 215_914) -> Plant:
    """0.6 m tall; it looks along x, y is up."""
    return scanned("armadillo", parts(), _armour, triangles, "#8f7a55")


def _armour(points: FloatArray, normals: FloatArray) -> FloatArray:
    """Bands and scutes of the shell, scutes of the limbs and rings of the tail, folds of the belly;
    nothing on claws and eyes; and grain."""
    rng = generator(0, "armadillo")
    both = folded(points)
    shell, tail = _near(SHELL, points, 0.004), _near(TAIL, points, 0.01)
    limb = np.maximum(_near([*LEG, *ARM], both, 0.015), _near(HEAD, points, 0.008))
    smooth = np.maximum(_near(CLAWS, both, 0.002), _near(EYES[-1:], both, 0.012))
    belly = _near(TORSO, points, 0.01) * np.clip(normals[:, 0] / 0.3, 0, 1)
    tail, limb = tail * (1 - shell), limb * (1 - shell) * (1 - tail)
    belly = belly * (1 - shell) * (1 - limb)

    relief = shell * 0.0045 * _ridges((points[:, 1] + 0.35 * points[:, 0]) / 0.027)
    relief += shell * 0.0015 * plates(points, 0.015, 0.005)
    relief += tail * 0.0035 * _ridges(np.linalg.norm(points - TAIL[0].start, axis=1) / 0.019)
    relief += limb * 0.0022 * plates(points, 0.012, 0.006)
    relief += belly * 0.0015 * np.sin(2 * np.pi * points[:, 1] / 0.02 + 6 * np.abs(points[:, 2]))
    relief += 0.0016 * octaves(points * 40.0, 2, 0.5, rng) * (1 - shell)
    return (1 - smooth) * relief + 0.00025 * octaves(points * 300.0, 2, 0.6, rng)


def _near(of: list[Limb], points: FloatArray, within: float) -> FloatArray:
    """(v,) 1 on some limbs, 0 farther than that many metres away."""
    return np.clip(1 - nearest(of, points) / within, 0, 1)


def _ridges(turns: FloatArray) -> FloatArray:
    """Bands that overlap like tiles: a slow rise and a steep fall, 0 to 1."""
    share = turns % 1.0
    return np.minimum(share, (1 - share) * 3) / (3 / 4)
