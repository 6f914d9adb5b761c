"""What a show needs of what it shows: a place to walk in, and what draws it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.draw import MSAA
from vegtool.gl.instances import View
from vegtool.gl.landscape import GroundMesh
from vegtool.gl.window_client import Context
from vegtool.lighting.light import Light, Sun
from vegtool.preview.eye import Eye
from vegtool.preview.fovea import Fovea
from vegtool.preview.options import FadeMode
from vegtool.preview.palette import Color

VIEWS: dict[Color, View] = {"as it is": "lit", "by overdraw": "overdraw"}
"""How plants are drawn that are not painted."""
IN_FULL = 1e9
"""Detail at which every plant is its original, whole, or the finest that there is."""


@dataclass(frozen=True, eq=False)
class Look:
    """How a frame is drawn. detail: factor of all distances. level: held for all plants, or None.
    color: what plants are coloured by. surfel_px: diameter of surfels, pixels. fovea: where they
    are larger, or None."""

    light: Light = field(default_factory=Light)
    detail: float = 1.0
    level: int | None = None
    color: Color = "as it is"
    wireframe: bool = False
    surfel_px: float = 1.0
    fovea: Fovea | None = None


AS_IT_IS = Look()


@dataclass(frozen=True)
class FrameStats:
    """What a frame took. plants: drawn, of `total`; rows: levels drawn, fading plants twice.
    fragments: of pixels that passed the depth test. seconds: by part. said: more lines of figures.
    """

    tiles: int
    plants: int
    total: int
    rows: int
    draws: int
    triangles: int
    fragments: int
    detail: float
    seconds: dict[str, float] = field(default_factory=dict)
    said: tuple[str, ...] = ()


class Scenery(Protocol):
    """Draws a place, once it is loaded. total: plants."""

    total: int

    def load(self, ctx: Context | None = None) -> Iterator[float]:
        """Upload everything; yields the share that is done."""

    def release(self) -> None:
        """Free everything on the GPU."""

    @property
    def texture_bytes(self) -> int:
        """On the GPU."""

    def draw(self, eye: Eye, size: tuple[int, int], look: Look = AS_IT_IS) -> FrameStats:
        """Draw into the framebuffer in use, and wait until that is done."""

    def picture(
        self, eye: Eye, size: tuple[int, int], look: Look = AS_IT_IS, supersample: int = 1,
        samples: int = MSAA,
    ) -> Picture:  # fmt: skip
        """What `draw` draws, as light and coverage, the ground too."""


class Place(Protocol):
    """What is walked through. start: the first eye. target: (3,) metres, what is orbited about.
    sun: of the scene, or None. way: the file of the scene's camera path, or None. notes: sentences
    for the user."""

    @property
    def start(self) -> Eye: ...
    @property
    def target(self) -> FloatArray: ...
    @property
    def ground(self) -> GroundMesh | None: ...
    @property
    def sun(self) -> Sun | None: ...
    @property
    def way(self) -> Path | None: ...
    @property
    def notes(self) -> tuple[str, ...]: ...
    @property
    def orbited(self) -> bool:
        """Whether it is looked at from around at first, and not walked through."""

    @property
    def progressive(self) -> bool:
        """Whether there are surfels in it, of which fewer and larger ones can be drawn."""

    def height_at(self, x: float, z: float) -> float:
        """Metres: of the ground."""

    def scenery(self, fade: FadeMode) -> Scenery:
        """What draws it; nothing is uploaded yet."""

    def details(self, focal_px: float) -> list[str]:
        """Sentences on what there is to draw, for those who ask; in pictures in which a metre at a
        distance of one is so many pixels."""
