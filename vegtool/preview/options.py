"""What the user chooses of a preview."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from vegtool.errors import UsageError
from vegtool.lighting.light import Light, Sun
from vegtool.options import option

FadeMode = Literal["none", "alpha-test", "dither"]
"""How a level follows another: at once, texel by texel and element by element, pixel by pixel."""
LARGEST = 16_384
"""Pixels along a side of a picture."""


@dataclass(frozen=True)
class PreviewOptions:
    """How a landscape is shown.

    size: pixels of the picture, "WIDTHxHEIGHT". fps: frames per second to be held by coming nearer
    with all distances; 0 keeps the distances. fade: how levels follow each other. stereo: a picture
    for each eye, side by side.
    """

    size: str = option("1024x768", "Width and height of the picture in pixels.", metavar="WxH")
    fps: float = option(
        0.0, "Frames per second to hold, by coarser levels or larger surfels; 0: distances as "
        "stated.", least=0.0, most=1000.0,
    )  # fmt: skip
    fade: str = option(
        "alpha-test", "How a level follows another: at once, by texels, by pixels.",
        choices=get_args(FadeMode),
    )  # fmt: skip
    sun: str | None = option(
        None, "Where the sun stands: azimuth from +z towards +x and elevation, degrees.",
        metavar="AZ,EL",
    )  # fmt: skip

    stereo: bool = option(
        False, "A picture for each eye, side by side, each of half the width.",
    )  # fmt: skip

    def __post_init__(self) -> None:
        _ = self.pixels, self.light

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height. Raises UsageError for what is no size."""
        parts = self.size.lower().split("x")
        try:
            width, height = (int(part) for part in parts)
        except ValueError:
            width = height = 0
        if not (1 <= width <= LARGEST and 1 <= height <= LARGEST):
            raise UsageError(
                f"--size: expected pixels from 1x1 to {LARGEST}x{LARGEST}, such as 1024x768; got "
                f"{self.size}"
            )
        return width, height

    @property
    def light(self) -> Light:
        """The sun that was asked for, or the usual one."""
        return Light() if self.sun is None else Sun.read(self.sun).light
