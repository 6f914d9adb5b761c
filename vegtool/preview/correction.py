"""By how much lengths of elements are corrected: for each stage of a plant, and from each side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, checked

SIDES = 16
"""From which plants are compared."""
HARMONICS = 2
"""A crown of few triangles is wide or narrow, once or twice around; what varies more often from
side to side is samples that hit or miss."""


@dataclass(frozen=True, eq=False)
class Correction:
    """stage: (k,), ascending (choice.Switches.stage). factor: (k, SIDES) of lengths there, from
    where the plant is turned by so many parts of a circle towards the eye."""

    stage: FloatArray
    factor: FloatArray

    def __post_init__(self) -> None:
        stage = checked("Correction.stage", self.stage, (None,), np.float64)
        factor = checked("Correction.factor", self.factor, (len(stage), SIDES), np.float64)
        object.__setattr__(self, "stage", stage)
        object.__setattr__(self, "factor", factor)

    def at(self, stage: np.ndarray, side: np.ndarray) -> np.ndarray:
        """(n,) factors at stages (n,) and sides (n,), 0 to SIDES: linear in both, the first and the
        last stage beyond."""
        last = len(self.stage) - 1
        above = np.clip(np.searchsorted(self.stage, stage, side="right"), 0, last)
        below = np.maximum(above - 1, 0)
        step = self.stage[above] - self.stage[below]
        part = np.divide(stage - self.stage[below], step, out=np.ones(len(stage)), where=step > 0)
        part = np.clip(part, 0.0, 1.0)
        left = np.floor(side).astype(np.int64) % SIDES
        right, turned = (left + 1) % SIDES, side - np.floor(side)

        def around(row: np.ndarray) -> np.ndarray:
            here, next_to_it = self.factor[row, left], self.factor[row, right]
            return np.asarray((1 - turned) * here + turned * next_to_it)

        return np.asarray((1 - part) * around(below) + part * around(above))


NONE = Correction(np.zeros(1), np.ones((1, SIDES)))
"""Changes nothing."""


def smoothed(values: FloatArray) -> FloatArray:
    """(SIDES,) without what varies more than HARMONICS times around."""
    waves = np.fft.rfft(values)
    waves[HARMONICS + 1 :] = 0
    return np.asarray(np.fft.irfft(waves, len(values)))


def sides_of(place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """(n,) 0 to SIDES, which side of each plant the eye sees: 0 of one that is not turned and lies
    along -z. place: (n, 3) from the eye. turn: (n, 2) cosine and sine about y."""
    x, z = place[:, 0], place[:, 2]
    cos, sin = turn[:, 0], turn[:, 1]
    # the turn, less the angle from -z to the plant's direction
    angle = np.arctan2(cos * x - sin * z, -sin * x - cos * z)
    return np.asarray((angle / (2 * np.pi) * SIDES) % SIDES)
