"""What a hybrid is to cost, as the user says it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from math import isfinite

from vegtool.errors import UsageError

MOST = 1e9
"""A weight is no more."""


@dataclass(frozen=True)
class Weights:
    """Of the three terms of the cost (cost.py)."""

    error: float = 1.0
    polygons: float = 1.0
    fill: float = 0.1

    @staticmethod
    def read(text: str) -> Weights:
        """From `error=1,polygons=0.5`; what is not named is as by default. Raises UsageError."""
        known = [item.name for item in fields(Weights)]
        found: dict[str, float] = {}
        for part in filter(None, (part.strip() for part in text.split(","))):
            name, _, value = (word.strip() for word in part.partition("="))
            try:
                number = float(value)
            except ValueError:
                number = -1.0
            if name not in known or name in found or not (isfinite(number) and 0 <= number <= MOST):
                raise UsageError(
                    f"--weights: expected {', '.join(known)}, each once at most, as NAME=NUMBER "
                    f"from 0 to {MOST:g}, got {part!r}; such as --weights error=1,polygons=0.5"
                )
            found[name] = number
        return Weights(**{**asdict(Weights()), **found})


@dataclass(frozen=True)
class Budget:
    """triangles: of all, at most. fill: fragments, of the original's, at most; None for any."""

    triangles: int
    fill: float | None = None
