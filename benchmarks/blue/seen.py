"""How much of what is seen of a model from outside eight pictures miss, and what further ones add.

Brandt et al. 2019, section 3.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

from blue.prefixes import MODELS
from vegtool.gl.upload import PlantBuffers
from vegtool.surfels.blue.candidates import (
    RESOLUTION,
    candidates,
    corner_directions,
    joined,
    missed,
    seen_from,
)


@dataclass(frozen=True)
class Found:
    """candidates, missed: of eight pictures, then with further ones; missed is the share of what
    other directions show that no candidate is near. cpu_s: seconds of the latter."""

    model: str
    triangles: int
    candidates: tuple[int, int]
    missed: tuple[float, float]
    cpu_s: float


def measured(name: str) -> Found:
    """Of one of MODELS."""
    plant = MODELS[name]()
    with PlantBuffers(plant) as buffers:
        eight = joined([seen_from(buffers, one, RESOLUTION) for one in corner_directions(plant)])
        began = process_time()
        every = candidates(buffers)
        spent = process_time() - began
        return Found(
            name, len(plant.faces), (len(eight), len(every)),
            (missed(buffers, eight), missed(buffers, every)), spent,
        )  # fmt: skip
