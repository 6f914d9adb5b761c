"""A level beside the octahedral impostor, both in vegtool's own renderer.

No stock client draws an impostor: it takes a shader of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from judge.photographs import FOV_DEG, SIZE, View
from vegtool.arrays import FloatArray, unit
from vegtool.baselines.octahedral import Octahedral, octahedral
from vegtool.formats import read_plant
from vegtool.lod import Display, Level
from vegtool.measure import views as measured
from vegtool.measure.scores import Truths, scores, truths
from vegtool.plant import Plant

DISPLAY = Display(FOV_DEG, SIZE)


class Impostor:
    """Of one plant, with its truths from the views of the photographs at their distances."""

    texels = Octahedral.texels

    def __init__(self, plant: Plant, distances: Sequence[float], views: Sequence[View]) -> None:
        self._impostor = octahedral(plant)
        suns = unit(np.array([view.sun for view in views]))
        directions = unit(np.array([view.direction for view in views]))
        seen = [measured.View(d, sun) for d, sun in zip(directions, suns, strict=True)]
        self._truths: list[Truths] = []
        for distance in distances:
            pixels = plant.extent * DISPLAY.pixels_per_metre(distance * plant.radius)
            self._truths.append(truths(plant, seen, [pixels], DISPLAY))

    def flips(self, levels: Sequence[Path]) -> FloatArray:
        """(d, 2) mean FLIP of the level (a file) at each distance, and of the impostor there."""
        found = []
        for truth, file in zip(self._truths, levels, strict=True):
            level = Level("mesh", mesh=read_plant(file))
            found.append(
                [scores(truth, shown).values["flip"].mean() for shown in (level, self._impostor)]
            )
        return np.array(found)
