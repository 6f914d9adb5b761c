"""The rows of a report: what is drawn, what it costs, how wrong it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.baselines import BASELINES
from vegtool.lod import Spread
from vegtool.measure.cost import Cost, FrameTime
from vegtool.measure.scores import spread

LIVE = "live"
"""Name of the original as a client draws it: the line to beat."""
EMULATED = tuple(name for name, maker in BASELINES.items() if maker.emulated)
"""Families that no stock client draws: for orientation, and on no Pareto front."""
TRUTH = "truth"
"""What pictures of the original as it is are called."""


Pictures = Mapping[int, tuple[bytes, ...]]
"""By size in pixels: PNGs of what is shown and of its difference from the truth."""


@dataclass(frozen=True)
class Row:
    """One thing drawn in place of a plant.

    name: unique within a plant. family: what is compared; budget: billboards asked for, or None.
    cost: what it takes to make, store and draw it. made_for_pixels: size on screen that its
    textures suit, or None. pixels, distance_m: (d,) sizes at which it was measured. values: by
    metric, [d][v] over views. held_out: (d,) mean FLIP from other views under other suns, where
    --max-error is to be checked; else empty. texels_per_metre: of its atlas, or 0.
    switch_distance_m: may be used from here on; None where nowhere, and `why_not` says why.
    within_pixels_from_m: from here on it displaces nothing by more than --max-pixels (1), by
    calculation; None where that is not known.
    projection_px, bound_px, texel_px: (d,) of its worst billboard by formula (measure/bounds.py):
    e_p, the most that anything is displaced, e_t; empty for a mesh.
    """

    plant: str
    name: str
    family: str
    budget: int | None
    cost: Cost
    made_for_pixels: float | None
    pixels: tuple[float, ...]
    distance_m: tuple[float, ...]
    values: Mapping[str, tuple[tuple[float, ...], ...]]
    held_out: tuple[float, ...] = ()
    texels_per_metre: float = 0.0
    switch_distance_m: float | None = None
    why_not: str = ""
    within_pixels_from_m: float | None = None
    projection_px: tuple[float | None, ...] = ()
    bound_px: tuple[float | None, ...] = ()
    texel_px: tuple[float | None, ...] = ()

    @property
    def bake_seconds(self) -> float:
        """All stages together."""
        return sum(self.cost.seconds.values())

    def spread(self, metric: str, index: int) -> Spread:
        """A metric at one size, over the views."""
        return spread(np.array(self.values[metric][index]))

    def mean(self, metric: str) -> FloatArray:
        """(d,) a metric at every size, mean over the views."""
        return np.asarray(np.array(self.values[metric]).mean(axis=1))


def as_json(row: Row) -> dict[str, Any]:
    """The row as plain values."""
    return asdict(row)


def from_json(values: dict[str, Any]) -> Row:
    """The row that `as_json` gave, also after a round through a file.

    Raises TypeError or KeyError for what is none.
    """
    plain = dict(values)
    plain["values"] = {name: _tuples(v) for name, v in plain["values"].items()}
    frame = {k: _tuples(v) for k, v in plain["cost"]["frame"].items()}
    plain["cost"] = Cost(**{**plain["cost"], "frame": FrameTime(**frame)})
    return Row(**{k: _tuples(v) if isinstance(v, list) else v for k, v in plain.items()})


def _tuples(value: Any) -> Any:
    return tuple(_tuples(v) for v in value) if isinstance(value, list | tuple) else value


@dataclass(frozen=True)
class PlantReport:
    """All of one plant. pictures: by row name ("truth" too), PNGs by size in pixels:
    the picture, and its difference from the truth."""

    name: str
    source: str
    triangles: int
    extent_m: float
    notes: tuple[str, ...]
    rows: tuple[Row, ...]
    pictures: Mapping[str, Pictures] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """What a report says.

    options: everything that shaped it, as plain values. renderer: what drew it, in words.
    failed: by plant, the sentence that says why it is not among `plants`.
    """

    plants: tuple[PlantReport, ...]
    options: Mapping[str, Any]
    version: str
    renderer: str
    failed: Mapping[str, str] = field(default_factory=dict)
