"""For which eyes of a scene a chain of levels is, and what was left out for that.

What is said of plants here holds for those of scale 1: of twice the size, they are as one half as
far away (docs/methods/needs.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from vegtool.lod import FADE_FRACTION, Display

ROUNDING = 2e-5
"""Of a distance: levels are chosen in floats of 32 bits."""


@dataclass(frozen=True)
class Span:
    """From how near and from how far a plant is seen, metres, in pictures that a chain's distances
    are stated for. farthest_m may be infinite."""

    nearest_m: float = 0.0
    farthest_m: float = inf

    @property
    def replaced_m(self) -> float:
        """A level that may be used from nearer than that has faded in wherever an eye may be."""
        return self.nearest_m * (1 - ROUNDING) / (1 + FADE_FRACTION)

    def replaced(self, start_m: float) -> bool:
        """Whether a level that may be used from there on is all that is drawn, or a later one."""
        return start_m < self.replaced_m

    def reached(self, start_m: float) -> bool:
        """Whether an eye may be as far away as that."""
        return start_m <= self.farthest_m * (1 + ROUNDING)


ANYWHERE = Span()


@dataclass(frozen=True)
class Limits:
    """What a scene says of the eyes that see a plant.

    digest: of all that this came of. nearest_m, farthest_m: metres from `middle_m` divided by the
    scale; farthest_m may be infinite. azimuth_deg: start and extent, from +z towards +x in the
    model's frame. elevation_deg: low and high above the horizon. display: of the pictures.
    middle_m: (x, y, z) metres in the model's frame: on its axis, half way up.
    """

    digest: str
    nearest_m: float
    farthest_m: float
    azimuth_deg: tuple[float, float]
    elevation_deg: tuple[float, float]
    display: Display
    middle_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def span(self, display: Display) -> Span:
        """The same distances, where they are stated for another display."""
        ratio = display.pixels_per_metre(1.0) / self.display.pixels_per_metre(1.0)
        return Span(self.nearest_m * ratio, self.farthest_m * ratio)


@dataclass(frozen=True)
class Omitted:
    """Something that a chain does without: what it is and why, in words. bytes, triangles: of it,
    where that is known."""

    what: str
    why: str
    bytes: int | None = None
    triangles: int | None = None


def between(nearest_m: float, farthest_m: float) -> str:
    """Distances in a sentence."""
    if farthest_m == inf:
        return f"from {nearest_m:.4g} m on"
    return f"from {nearest_m:.4g} to {farthest_m:.4g} m"
