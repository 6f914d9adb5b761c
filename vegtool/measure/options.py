"""What measuring can be told, with defaults and units."""

from __future__ import annotations

from dataclasses import dataclass

from vegtool.errors import UsageError
from vegtool.options import option

ELEVATIONS = {"ground": (-15.0, 30.0), "aerial": (15.0, 90.0), "all": (-90.0, 90.0)}
"""Degrees above the horizon, from the plant to the eye: a walker among plants of all sizes, a
flight above them, everything."""


@dataclass(frozen=True)
class MeasureOptions:
    """How the distances come about from which levels may be used.

    Raises UsageError for a limit on what is not measured.
    """

    measure: str = option(
        "quick",
        "How well levels are measured. quick: 6 views; full: 12, at twice as many sizes; off: "
        "distances by rule.",
        choices=("quick", "full", "off"),
    )
    max_error: float | None = option(
        None,
        "Greatest FLIP error (mean over views) of a level where it is used; by default that of the "
        "original as a client draws it there, or 0.1 where that is less.",
        least=0.0,
        most=1.0,
        metavar="FLIP",
    )
    max_pixels: float | None = option(
        None,
        "Most that a level may displace anything where it is used, in pixels, by calculation.",
        least=0.001,
        most=1000.0,
        metavar="PIXELS",
    )
    views: str = option(
        "all", "From where plants are seen: by a walker, from the air, or both.",
        choices=tuple(ELEVATIONS),
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.measure == "off" and self.max_error is not None:
            raise UsageError(
                f"--max-error {self.max_error:g} with --measure off: an error that is not measured "
                "cannot be limited; leave out one of the two"
            )
